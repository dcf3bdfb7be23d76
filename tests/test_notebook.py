"""What a notebook shows of an object: a table and a picture, nothing that could run."""

import base64
import re
import subprocess
import sys
from html.parser import HTMLParser
from types import SimpleNamespace

import numpy as np
import pytest

from tensegrity import (
    Chain,
    Network,
    Prism,
    Record,
    equilibrium_path,
    notebook,
    simulate,
    solitary_wave,
)

RIGID = Prism(1.0, 0.7, 0.01, 1.0)
ELASTIC = Prism(1.0, 0.7, 0.01, 1.0, k_base=10.0, k_bar=100.0)
SPRING = RIGID.potential()


def run(**record):
    chain = Chain(SPRING, 30)
    return simulate(chain, chain.at_rest({0: 0.05}), 20.0, dt=0.1, record=Record(**record))


SHOWN = {
    "prism": (lambda: RIGID, ("0.302509 N/m", "locking height", "bar 1.31682 m")),
    "run": (lambda: run(every=1), ("verlet", "0.1 s, 200 steps", "201 instants of 30 sites")),
    "path": (lambda: equilibrium_path(ELASTIC), ("contact", "shortening", "the bars meet")),
    "wave": (lambda: solitary_wave(SPRING, speed_ratio=2.0), ("2 sound speeds", "width")),
    "structure": (lambda: ELASTIC.structure(), ("3 bars, 9 strings", "3 dimensions")),
    "network": (lambda: Network([[0, 0], [1, 0], [0, 1]], [(0, 1), (1, 2)], SPRING), ("bonds",)),
}


class Tags(HTMLParser):
    """Checks that what is opened is closed, and keeps text and pictures."""

    def __init__(self):
        super().__init__()
        self.open, self.words, self.pictures = [], [], []

    def handle_starttag(self, tag, attrs):
        if tag == "img":
            self.pictures.append(dict(attrs))
        else:
            self.open.append(tag)

    def handle_endtag(self, tag):
        assert self.open.pop() == tag

    def handle_data(self, data):
        self.words.append(data)


def read(text):
    tags = Tags()
    tags.feed(text)
    assert tags.open == []
    return " ".join(tags.words), tags.pictures


@pytest.mark.parametrize("name", SHOWN)
def test_objects_show_a_table_and_a_picture(name):
    make, wanted = SHOWN[name]
    words, pictures = read(make()._repr_html_())
    for word in wanted:
        assert word in words
    (picture,) = pictures
    image = base64.b64decode(picture["src"].removeprefix("data:image/png;base64,"))
    assert image.startswith(b"\x89PNG")
    assert len(image) < 60_000
    assert picture["alt"]
    assert "nan" not in words


def test_a_part_of_a_path_says_that_it_is_one():
    path = equilibrium_path(ELASTIC)[:5]
    words, _ = read(path._repr_html_())
    assert "end of the slice" in words
    assert "EquilibriumPath, 5 rows" in words


def test_text_is_escaped_and_a_run_without_all_sites_has_no_picture():
    text = notebook.page("<b>&", {"<script>": "<img src=x>"})
    words, pictures = read(text)
    assert "<script>" in words
    assert "<img src=x>" in words
    assert pictures == []
    words, pictures = read(run(every=10, sites=[1, 2])._repr_html_())
    assert "of 2 sites" in words
    assert pictures == []


def test_a_long_run_is_thinned_before_it_is_drawn(monkeypatch):
    seen = []
    found = run(every=1)
    big = 1500
    long = simulate(found.scene, found.final, 150.0, dt=0.1, record=Record(every=1))
    assert len(long.t) == big + 1
    monkeypatch.setattr(type(long), "plot", lambda self, axes=None: seen.append(len(self.t)))
    long._repr_html_()
    assert seen[0] <= 300


def test_nothing_is_drawn_until_it_is_asked_for():
    code = (
        "import sys; from tensegrity import Prism; p = Prism(1.0, 0.7, 0.01, 1.0); repr(p);"
        "assert 'matplotlib' not in sys.modules; p._repr_html_();"
        "assert 'matplotlib' in sys.modules and 'matplotlib.pyplot' not in sys.modules"
    )
    subprocess.run([sys.executable, "-c", code], check=True)


def test_bars_are_seen_in_notebooks(monkeypatch, capsys):
    monkeypatch.setattr(sys, "stderr", None)
    with notebook.progress(3, "step") as still:
        assert not hasattr(still, "close")
    monkeypatch.undo()
    shell = SimpleNamespace(config={"IPKernelApp": {}})
    monkeypatch.setitem(sys.modules, "IPython", SimpleNamespace(get_ipython=lambda: shell))
    assert notebook.in_notebook()
    with notebook.progress(3, "step", done=1) as bar:
        bar.update(2)
        assert re.match("tqdm", type(bar).__name__)
        assert bar.n == 3
    monkeypatch.setitem(sys.modules, "IPython", SimpleNamespace(get_ipython=lambda: None))
    assert not notebook.in_notebook()


def test_lines_are_seen_from_aside_in_any_dimension():
    from matplotlib.figure import Figure

    for dim in (1, 2, 3):
        axes = Figure().subplots()
        notebook.wires(axes, np.eye(3)[:, :dim], [(0, 1), (1, 2)], bars=1)
        thin, thick = axes.collections
        assert len(thin.get_segments()) == len(thick.get_segments()) == 1
        assert all(np.isfinite(s).all() for s in thick.get_segments())
