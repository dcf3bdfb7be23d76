"""What a notebook shows of an object: a table and a picture, nothing that could run."""

import base64
import contextlib
import io
import subprocess
import sys
import threading
from html.parser import HTMLParser
from types import SimpleNamespace

import pytest
from tqdm import tqdm

from tensegrity import (
    Chain,
    LockingError,
    Network,
    Prism,
    Record,
    equilibrium_path,
    equilibrium_paths,
    gradient,
    notebook,
    objective,
    printing,
    pulses,
    simulate,
    solitary_wave,
    sweep,
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
    "path": (lambda: equilibrium_path(ELASTIC), ("contact", "height 0.7 m", "the bars meet")),
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
    assert len(image) < 62_000  # 61 kB of the oldest Matplotlib, 60 of the newest
    assert picture["alt"]
    assert "nan" not in words


def test_a_result_without_a_picture_is_a_table_of_what_it_prints():
    found = ELASTIC.structure().self_stress()
    words, pictures = read(found._repr_html_())
    assert words.split() == str(found).replace(": ", " ").split()
    assert pictures == []


def test_a_part_of_a_path_says_that_it_is_one():
    path = equilibrium_path(ELASTIC)[:5]
    words, _ = read(path._repr_html_())
    assert "end of the slice" in words
    assert "5 equilibria" in words


def test_text_is_escaped_and_a_run_without_all_sites_has_no_picture():
    text = printing.page(["<b>&", "<script>: <img src=x>"])
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
    monkeypatch.setattr(type(long), "plot", lambda self, ax=None: seen.append(len(self.t)))
    long._repr_html_()
    assert seen[0] <= 300


def test_nothing_is_drawn_until_it_is_asked_for():
    code = (
        "import sys; from tensegrity import Prism; p = Prism(1.0, 0.7, 0.01, 1.0); repr(p);"
        "assert 'matplotlib' not in sys.modules; p._repr_html_();"
        "assert 'matplotlib' in sys.modules and 'matplotlib.pyplot' not in sys.modules"
    )
    subprocess.run([sys.executable, "-c", code], check=True)


class Terminal(io.StringIO):
    """What a user sees: text in which a return of the carriage goes to the beginning of a line."""

    def isatty(self):
        return True

    @property
    def last(self):
        """The line as it is left."""
        line = ""
        for part in self.getvalue().split("\r"):
            line = part + line[len(part) :]
        return line.rstrip()


def a_terminal(monkeypatch):
    """A terminal, where bars show at once, and these."""
    shown = Terminal()
    monkeypatch.setattr(sys, "stderr", shown)
    init, shown.bars = tqdm.__init__, []

    def at_once(self, *given, **options):
        init(self, *given, **options | {"delay": 0, "mininterval": 0})
        shown.bars.append(self)

    monkeypatch.setattr(tqdm, "__init__", at_once)
    return shown


def long_chain():
    chain = Chain(SPRING, 3000)
    return chain, chain.at_rest({0: 0.03}), 200.0


CALLS = {
    "run": lambda: simulate(*long_chain(), dt=0.01),
    "run to a tolerance": lambda: simulate(*long_chain(), tol=1e-8),
    "gradient": lambda: gradient(objective.peak(objective.load(bond=9)), *long_chain(), dt=0.02),
    "sweep": lambda: sweep(lambda dt: simulate(*long_chain(), dt=dt).steps, [0.02, 0.025]),
    "pulses": lambda: pulses(run(), fraction=0.01),
    "paths": lambda: equilibrium_paths([ELASTIC] * 3),
    "run that locks": lambda: simulate(Chain(SPRING, 3000), wild(), 2000.0, dt=0.02),
}


def wild():
    return Chain(SPRING, 3000).at_rest({0: 0.3})


@pytest.mark.parametrize("name", CALLS)
def test_a_call_has_one_bar_that_is_full_and_cleared_at_the_end(monkeypatch, name):
    terminal = a_terminal(monkeypatch)
    with contextlib.suppress(LockingError):
        CALLS[name]()
    assert len(terminal.bars) <= 1
    assert len(terminal.bars) == 1 or name == "run to a tolerance"  # that may be done at once
    for bar in terminal.bars:
        assert bar.n == bar.total > 0
        assert "%|" in terminal.getvalue()
    assert terminal.last == ""


def test_parts_of_a_call_add_up_on_its_bar(monkeypatch):
    terminal = a_terminal(monkeypatch)
    with notebook.one_bar("step"):
        with notebook.progress(4, "step") as first:
            first.update(4)
        with notebook.progress(10, "step", done=2) as second:  # broken off at 5
            second.update(3)
            (bar,) = terminal.bars
            assert (bar.n, bar.total) == (9, 14)
            with notebook.progress(7, "case") as other:
                other.update(7)
        assert (bar.n, bar.total) == (9, 9)
    assert len(terminal.bars) == 1
    assert (first.n, second.n, other.n) == (4, 5, 7)


def test_another_thread_shows_no_second_bar(monkeypatch):
    terminal = a_terminal(monkeypatch)

    def count():
        with notebook.progress(3, "step") as still:
            still.update(3)

    with notebook.progress(5, "step") as one:
        other = threading.Thread(target=count)
        other.start()
        other.join()
        one.update()
        assert (terminal.bars[0].n, len(terminal.bars)) == (1, 1)


def test_bars_are_seen_in_notebooks_and_never_in_a_file(monkeypatch):
    made = a_terminal(monkeypatch).bars
    monkeypatch.setattr(sys, "stderr", None)
    with notebook.progress(3, "step", done=1) as still:
        still.update(2)
    assert made == []
    assert still.n == 3
    shell = SimpleNamespace(config={"IPKernelApp": {}})
    monkeypatch.setattr(sys, "stderr", io.StringIO())
    monkeypatch.setitem(sys.modules, "IPython", SimpleNamespace(get_ipython=lambda: shell))
    assert notebook.in_notebook()
    with notebook.progress(3, "step", done=1) as bar:
        bar.update()
    assert bar.n == 2
    (drawn,) = made
    assert drawn.n == drawn.total == 2  # a notebook leaves a bar that is not full
    monkeypatch.setitem(sys.modules, "IPython", SimpleNamespace(get_ipython=lambda: None))
    assert not notebook.in_notebook()
