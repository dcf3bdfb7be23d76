"""Every picture keeps the rules that can be checked on it: letters, sizes, names, curves."""

import ast
from pathlib import Path

import matplotlib
import matplotlib.pyplot as plt
import numpy as np
import pytest
from PIL import Image

from figures import _draw, _small, pictures
from figures.__main__ import costs
from figures._files import read_tables
from tests.rules import broken

pytestmark = pytest.mark.unchanged("docs", "README.md")

matplotlib.use("Agg")
QUICK = 1.2  # s; pictures that take longer are slow tests


def check(name, folder):
    module = pictures()[name]
    tables = module.data()
    with plt.rc_context(_draw.STYLE):
        figure = _draw.pictured(module, tables)
        found = broken(figure)
        plt.close(figure)
    _small.gather(folder, folder, [name])
    found += [*differ(tables, read_tables(folder / module.GROUP / f"{name}.csv"))]
    assert not found, "\n".join(found)


def differ(tables, kept):
    """Where the numbers of a picture are not those that are kept; round-off does not count."""
    for table, columns in tables.items():
        for column, values in columns.items():
            was = kept.get(table, {}).get(column, [])
            now = [str(value) for value in values]
            where = f"{table}, {column}: draw it again with --update"
            if len(was) != len(now):
                yield f"{len(now)} values are kept as {len(was)}: {where}"
            try:
                one, other = (np.array(x, dtype=float) for x in (now, was))
            except ValueError:
                if now != was:
                    yield f"other words: {where}"
                continue
            size = max(1e-9 * np.max(np.abs(one), initial=0.0, where=np.isfinite(one)), 1e-12)
            if len(one) == len(other) and not np.allclose(one, other, 1e-6, size, equal_nan=True):
                yield f"other numbers: {where}"


@pytest.mark.parametrize("name", pictures())
def test_a_small_version_of_each_picture_is_kept_and_is_of_these_sources(name):
    assert (_small.SMALL / f"{name}.by").read_text().strip() == _small.drawn_by(name), (
        f"call `python -m figures {name} --update`"
    )
    with Image.open(_small.SMALL / f"{name}.png") as image:
        image.verify()
    assert (_small.SMALL / f"{name}.png").stat().st_size < 150_000


def test_what_is_kept_is_shown_where_nothing_was_drawn_and_numbers_are_the_same(tmp_path):
    _small.gather(tmp_path / "none", tmp_path / "all")
    for name, module in pictures().items():
        assert (tmp_path / "all" / module.GROUP / f"{name}.png").is_file()
    folder = tmp_path / "drawn" / pictures()["prism_drawing"].GROUP
    folder.mkdir(parents=True)
    (folder / "prism_drawing.png").write_bytes(b"new")
    _small.gather(tmp_path / "drawn", tmp_path / "all")
    assert (tmp_path / "all" / folder.name / "prism_drawing.png").read_bytes() == b"new"
    assert not (tmp_path / "all" / folder.name / "prism_drawing.csv").exists()


def test_other_numbers_words_and_lengths_are_told():
    tables = {"t": {"x": [1.0, 2.0], "name": ["a", "b"]}}
    kept = {"t": {"x": ["1.0000000001", "2.0"], "name": ["a", "b"]}}
    assert not [*differ(tables, kept)]
    for wrong in ({"x": ["1.001", "2.0"]}, {"x": ["1.0"]}, {"name": ["a", "c"]}):
        assert [*differ(tables, {"t": kept["t"] | wrong})]


@pytest.mark.parametrize("name", [x for x in pictures() if costs().get(x, 0) <= QUICK])
def test_pictures_keep_the_rules(name, tmp_path):
    check(name, tmp_path)


@pytest.mark.slow
@pytest.mark.parametrize("name", [x for x in pictures() if costs().get(x, 0) > QUICK])
def test_pictures_that_take_long_keep_the_rules(name, tmp_path):
    check(name, tmp_path)


@pytest.mark.parametrize("name", sorted(pictures()))
def test_no_text_is_set_smaller_than_8_pt(name):
    """What the source says, of pictures that are too slow to be drawn here."""
    for node in ast.walk(ast.parse(Path(pictures()[name].__file__).read_text())):
        if isinstance(node, ast.keyword) and node.arg in ("fontsize", "labelsize"):
            assert not isinstance(node.value, ast.Constant) or node.value.value >= 8


def good():
    figure = plt.figure(layout="constrained", figsize=(8, 4))
    for axes, name in zip(figure.subplots(1, 2), "ab", strict=True):
        axes.plot(np.arange(5.0), np.arange(5.0) ** 2)
        axes.set(xlabel="time [s]", ylabel="overlap [µm]", title=f"({name}) it grows")
    return figure


BREACHES = {
    "text of 6 pt": lambda axes: axes.text(1, 2, "small", fontsize=6),
    "µ or TeX": lambda axes: axes.set_ylabel("overlap [um]"),
    "panels are called": lambda axes: axes.set_title("it grows"),
    "is empty": lambda axes: axes.lines[0].remove(),
    "has no name": lambda axes: axes.set_xlabel(""),
    "has no word": lambda axes: axes.set_xlabel("t"),
    "has 8 curves": lambda axes: [axes.plot([0, 1, 2], [k, k, k + 1]) for k in range(7)],
    "coincide": lambda axes: axes.plot(np.arange(5.0), np.arange(5.0) ** 2),
    "named in a legend": lambda axes: (axes.plot([0, 1, 4], [5, 1, 9]), axes.legend(["a", "b"])),
    "lies over data": lambda axes: axes.legend(["a"], loc="lower left"),
    "touches": lambda axes: [axes.text(2, 12, word) for word in ("one", "two")],
    "runs out": lambda axes: axes.text(4.5, 2, "a long text that does not end in time " * 3),
}


def test_a_figure_that_keeps_the_rules_has_no_breach():
    figure = good()
    assert broken(figure) == []
    plt.close(figure)


@pytest.mark.parametrize("rule", BREACHES)
def test_each_breach_is_found(rule):
    figure = good()
    BREACHES[rule](figure.axes[0])
    assert any(rule in line for line in broken(figure)), broken(figure)
    plt.close(figure)
