"""Every picture keeps the rules that can be checked on it: letters, sizes, names, curves."""

import ast
from pathlib import Path

import matplotlib
import matplotlib.pyplot as plt
import numpy as np
import pytest

from figures import _draw, pictures
from figures.__main__ import costs
from tests.rules import broken

pytestmark = pytest.mark.unchanged("docs", "README.md")

matplotlib.use("Agg")
QUICK = 1.2  # s; pictures that take longer are slow tests


def check(name):
    module = pictures()[name]
    with plt.rc_context(_draw.STYLE):
        figure = _draw.pictured(module, module.data())
        found = broken(figure)
        plt.close(figure)
    assert not found, "\n".join(found)


@pytest.mark.parametrize("name", [x for x in pictures() if costs().get(x, 0) <= QUICK])
def test_pictures_keep_the_rules(name):
    check(name)


@pytest.mark.slow
@pytest.mark.parametrize("name", [x for x in pictures() if costs().get(x, 0) > QUICK])
def test_pictures_that_take_long_keep_the_rules(name):
    check(name)


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
