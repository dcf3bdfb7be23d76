"""`Run.show`: a page without a network, in which a run is played."""

import base64
import html
import json
import re

import numpy as np
import pytest
from browser import CHROMIUM, Browser

from granular import Bead, Striker, materials, y_guide
from granular import chain as beads
from tensegrity import (
    Chain,
    Ensemble,
    Prism,
    Record,
    TensegrityError,
    equilibrium_path,
    simulate,
)

ELASTIC = Prism(1.0, 0.5, 0.4, 1.0, k_base=2.0, k_bar=20.0)
BEAD = Bead(diameter=10e-3, material=materials["steel"])
STRIKER = Striker(BEAD, speed=1.0)


def of_chain(prism, preload=0.0, **record):
    chain = Chain(prism.potential(preload), 30)
    record = record or {"interval": 0.25}
    return simulate(chain, chain.at_rest({0: 0.05}), 20.0, record=Record(**record))


def of_guide():
    guide = y_guide(stem=6, branch=5, bead=BEAD, striker=STRIKER)
    return simulate(guide, guide.start(), 2e-4, record=Record(interval=4e-6))


def of_beads():
    chain = beads([BEAD] * 8, striker=STRIKER)
    return simulate(chain, chain.start(), 1e-4, record=Record(interval=4e-6))


def of_structure():
    structure = Prism(1.0, 0.7, 0.1, 1.0, k_base=10.0, k_bar=100.0).structure()
    network = structure.at(structure.positions, mass=1.0).network()
    return simulate(network, network.at_rest({3: (0, 0, -0.2)}), 10.0, record=Record(interval=0.1))


def page_of(run):
    """The page in the frame, and its data."""
    text = run.show()._repr_html_()
    page = html.unescape(re.search(r'srcdoc="([^"]*)"', text)[1])
    assert not re.search(r"(src|href)=|https?://|@import", page)
    return page, json.loads(re.search(r"play\((\{.*\})\)", page)[1])


def table(data, name):
    found = np.frombuffer(base64.b64decode(data[name]), dtype="<f4")
    return found.reshape(len(data["t"]), -1)


@pytest.mark.parametrize(
    ("prism", "preload"),
    [(Prism(1.0, 0.7, 0.01, 1.0), 0.0), (Prism(1.0, 0.7, 0.02, 1.0), 0.01), (ELASTIC, 0.05)],
)
def test_prisms_have_the_twist_and_the_base_of_their_height(prism, preload):
    run = of_chain(prism, preload)
    _, data = page_of(run)
    length = prism.potential(preload).length
    height = length + np.diff(run.u)
    assert np.abs(table(data, "height") - height).max() < 1e-6
    assert np.abs(table(data, "strain") - np.diff(run.u) / length).max() < 1e-6
    for row, unit in ((40, 3), (60, 10)):
        one = float(height[row, unit])
        ends = {"max_height": one} if one > prism.height else {"min_height": one}
        end = equilibrium_path(prism, **ends)[0 if one > prism.height else -1]
        assert table(data, "twist")[row, unit] == pytest.approx(end["twist"], abs=1e-4)
        assert table(data, "base")[row, unit] == pytest.approx(end["base"], abs=1e-4)


def test_beads_and_nodes_stand_where_they_are():
    for run in (of_guide(), of_structure()):
        _, data = page_of(run)
        places = run.scene.positions + run.u
        found = table(data, "places").reshape(places.shape)
        assert np.abs(found - places).max() < 1e-6 * np.ptp(places)
        assert np.all(np.array(data["frame"][0]) <= data["frame"][1])
        assert data["bonds"] == run.scene.bonds.tolist()
    assert sum(data["bars"]) == 3  # the others are strings
    _, data = page_of(of_beads())
    assert len(data["radius"]) == 9
    assert table(data, "shade").max() == 1


def test_a_long_run_is_thinned_with_its_ends_kept():
    run = of_chain(Prism(1.0, 0.7, 0.01, 1.0), interval=0.02)
    assert len(run.t) == 1001
    _, data = page_of(run)
    assert len(data["t"]) == 300
    assert (data["t"][0], data["t"][-1]) == (0, run.t[-1])
    assert repr(run.show()) == "300 instants of a run, shown in a notebook"


def test_what_was_not_recorded_is_refused():
    with pytest.raises(TensegrityError, match="2 of 30 sites recorded: record all to show"):
        of_chain(Prism(1.0, 0.7, 0.01, 1.0), every=10, sites=[1, 2]).show()
    chain = Chain(Prism(1.0, 0.7, 0.01, 1.0).potential(), 5)
    both = Ensemble([chain, chain])
    with pytest.raises(TensegrityError, match=r"a run of 2 scenes: take that of one, run\[k\]"):
        simulate(both, both.at_rest({0: 0.01}), 1.0, dt=0.1).show()


@pytest.mark.slow
@pytest.mark.skipif(CHROMIUM is None, reason="no Chromium is installed")
def test_runs_play_and_follow_the_slider(tmp_path):
    drawn = "document.getElementById('picture').toDataURL()"
    path = tmp_path / "run.html"
    with Browser() as browser:
        browser.resize(700, 470)
        runs = (of_chain(Prism(1.0, 0.7, 0.01, 1.0)), of_chain(ELASTIC, 0.05), of_guide(),
                of_beads(), of_structure())  # fmt: skip
        for run in runs:
            path.write_text(page_of(run)[0])
            browser.open(f"file://{path}")
            assert browser.evaluate("""new Promise((done) => {
              const look = () => (document.getElementById("row").value > 0 ? done(true)
                : requestAnimationFrame(look));
              look();
            })""")
            browser.evaluate("document.getElementById('play').click()")
            seen = {browser.evaluate(
                f"document.getElementById('row').value = {row};"
                "document.getElementById('row').dispatchEvent(new Event('input'));"
                f"{drawn}") for row in (0, 12, 24)}  # fmt: skip
            assert len(seen) == 3
            assert browser.complaints == []
