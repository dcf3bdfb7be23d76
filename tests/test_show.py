"""`show` of runs, structures, lattices, modes and paths: a page without a network."""

import base64
import html
import json
import re

import numpy as np
import pytest
from browser import CHROMIUM, Browser
from structures import icosahedron

from granular import Bead, Striker, fcc_pack, materials, y_guide
from granular import chain as beads
from tensegrity import (
    Chain,
    Ensemble,
    Prism,
    Record,
    Structure,
    TensegrityError,
    catalogue,
    equilibrium_path,
    files,
    held,
    simulate,
    units,
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


def saved(thing, folder):
    """The text of a page in a file."""
    thing.show().save(folder / "one.html")
    return (folder / "one.html").read_text()


def table(data, name):
    kind = {"shade": "u1", "tension": "i1"}.get(name, "<f4")
    found = np.frombuffer(base64.b64decode(data[name]), dtype=kind)
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
    assert table(data, "shade").max() == 255


def test_a_long_run_is_thinned_with_its_ends_kept():
    run = of_chain(Prism(1.0, 0.7, 0.01, 1.0), interval=0.02)
    assert len(run.t) == 1001
    _, data = page_of(run)
    assert len(data["t"]) == 300
    assert (data["t"][0], data["t"][-1]) == (0, run.t[-1])
    assert (
        repr(run.show())
        == "300 instants of a run: shown in a notebook, or by save(path) in a browser"
    )


def test_what_was_not_recorded_is_refused():
    with pytest.raises(TensegrityError, match="2 of 30 sites recorded: record all to show"):
        of_chain(Prism(1.0, 0.7, 0.01, 1.0), every=10, sites=[1, 2]).show()
    chain = Chain(Prism(1.0, 0.7, 0.01, 1.0).potential(), 5)
    both = Ensemble([chain, chain])
    with pytest.raises(TensegrityError, match=r"a run of 2 scenes: take that of one, run\[k\]"):
        simulate(both, both.at_rest({0: 0.01}), 1.0, dt=0.1).show()


def things():
    """One of each kind that has no scene, the number of members drawn, and of those slack."""
    loose = icosahedron(0.1)
    loose = loose.at(loose.positions, natural_lengths=loose.natural_lengths * SLACKENED)
    two = Structure([[-1, 0], [1, 0], [0, 1]], bars=[(0, 2), (1, 2)])
    path = equilibrium_path(two, supports=held([0, 1]), loads={2: (0.0, -0.1)}, max_load=20.0)
    return {
        "structure": (loose, 30, 3), "mode": (loose.modes(2), 30, 3),
        "lattice": (catalogue.x_plate(), 9 * 4, 0), "path": (path, 2, 0),
    }  # fmt: skip


SLACKENED = np.where(np.isin(np.arange(30), [7, 12, 20]), 1.3, 1.0)


@pytest.mark.parametrize("name", ["structure", "mode", "lattice", "path"])
def test_pages_carry_places_and_tensions_and_say_what_is_slack(name):
    thing, members, slack = things()[name]
    _, data = page_of(thing)
    frames = thing.frames()
    assert data["title"] == frames.title
    assert len(data["bonds"]) == members
    places = table(data, "places").reshape(frames.places.shape)
    assert np.abs(places - frames.places).max() < 1e-6 * np.ptp(frames.places)
    levels, tension = table(data, "tension").astype(float), frames.of_segments["tension [N]"]
    assert (np.sum(levels == -128, axis=1) == slack).all()
    taut = levels > -128
    assert data["most"] == np.abs(tension).max()
    assert np.abs(levels / 127 * data["most"] - tension)[taut].max() <= data["most"] / 254 * 1.001


def test_cells_of_a_lattice_join_at_their_images():
    lattice = catalogue.x_plate()
    frames = lattice.frames((4, 2))
    (places,), vectors = frames.places, lattice.positions[lattice.ends[:, 1]] + lattice.shift
    d = places[frames.ends[:, 1]] - places[frames.ends[:, 0]]
    own = vectors - lattice.positions[lattice.ends[:, 0]]
    assert d == pytest.approx(np.repeat(own, 8, axis=0))
    assert len(places) > 8
    inside = frames.ends[:, 1] < 8  # these are the members of a block
    assert np.sort(frames.ends[inside], axis=0).tolist() == np.sort(
        lattice.tile((4, 2)).ends, axis=0
    ).tolist()  # fmt: skip
    assert len(lattice.plot(counts=(4, 2)).collections) == 2


def test_a_page_of_60_nodes_and_200_instants_is_small(tmp_path):
    rng = np.random.default_rng(0)
    ends = [(i, (i + 1 + k) % 60) for k in range(2) for i in range(60)]
    many = Structure(rng.normal(size=(60, 3)), strings=ends[:100], bars=ends[100:])
    network = many.network()
    start = network.at_rest({0: (0.1, 0, 0)})
    run = simulate(network, start, 2.0, dt=0.01, record=Record(interval=0.01))
    assert len(run.t) == 201
    run.show().save(tmp_path / "run.html")
    assert (tmp_path / "run.html").stat().st_size < 300_000
    with pytest.raises(TensegrityError, match=r"must end in \.html"):
        run.show().save(tmp_path / "run.htm5")


def test_a_pack_at_rest_is_a_page_and_titles_are_escaped(tmp_path):
    pack = fcc_pack(2, 2, bead=BEAD, floor=materials["steel"], sides=materials["steel"])
    files.write(tmp_path / "pack.html", pack)
    text = (tmp_path / "pack.html").read_text()
    data = json.loads(re.search(r"play\((\{.*\})\)", text)[1])
    assert len(data["radius"]) == pack.sites
    with pytest.raises(TensegrityError, match="unknown option number"):
        files.write(tmp_path / "pack.html", pack, number=1)
    with units(force="</script>"):
        assert saved(icosahedron(), tmp_path).count("</script>") == 1


@pytest.mark.slow
@pytest.mark.skipif(CHROMIUM is None, reason="no Chromium is installed")
def test_runs_play_and_follow_the_slider(tmp_path):
    drawn = "document.getElementById('picture').toDataURL()"
    path = tmp_path / "run.html"
    with Browser() as browser:
        browser.resize(700, 470)
        moving = [things()[name][0] for name in ("mode", "path")]
        runs = (of_chain(Prism(1.0, 0.7, 0.01, 1.0)), of_chain(ELASTIC, 0.05), of_guide(),
                of_beads(), of_structure(), *moving)  # fmt: skip
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
                f"document.getElementById('row').value = {part} * "
                "document.getElementById('row').max;"
                "document.getElementById('row').dispatchEvent(new Event('input'));"
                f"{drawn}") for part in (0, 0.25, 0.7)}  # fmt: skip
            assert len(seen) == 3
            assert browser.complaints == []


@pytest.mark.slow
@pytest.mark.skipif(CHROMIUM is None, reason="no Chromium is installed")
@pytest.mark.parametrize("width", [390, 1200])
def test_a_structure_is_turned_tilted_and_zoomed(tmp_path, width):
    drawn = "document.getElementById('picture').toDataURL()"
    with Browser() as browser:
        browser.resize(width, 700)
        for name, (thing, _, _) in things().items():
            thing.show().save(tmp_path / f"{name}.html")
            browser.open(f"file://{tmp_path / name}.html")
            seen = [browser.evaluate(f"document.getElementById('play').click(), {drawn}")]
            middle = {"x": width / 2, "y": 300, "button": "left", "clickCount": 1}
            mouse = "Input.dispatchMouseEvent"
            for right, down in ((40, 0), (0, 40)):
                browser.call(mouse, type="mousePressed", buttons=1, **middle)
                to = middle | {"x": middle["x"] + right, "y": middle["y"] + down}
                browser.call(mouse, type="mouseMoved", buttons=1, **to)
                browser.call(mouse, type="mouseReleased", **to)
                seen.append(browser.evaluate(drawn))
            browser.call(mouse, type="mouseWheel", deltaX=0, deltaY=-200, x=middle["x"], y=300)
            seen.append(browser.evaluate(f"new Promise((d) => setTimeout(() => d({drawn}), 100))"))
            in_space = name in ("structure", "mode")
            assert len(set(seen)) == (4 if in_space else 2), name  # the plane is zoomed alone
            assert browser.evaluate("document.documentElement.scrollWidth <= innerWidth")
            assert browser.evaluate("document.documentElement.scrollHeight <= innerHeight")
            alone = browser.evaluate("document.getElementById('controls').hidden")
            assert alone == (name in ("structure", "lattice"))
            assert (
                browser.evaluate("document.querySelector('h1').textContent") == thing.frames().title
            )
            assert browser.complaints == []


@pytest.mark.slow
@pytest.mark.skipif(CHROMIUM is None, reason="no Chromium is installed")
def test_five_hundred_members_are_drawn_in_a_frame(tmp_path):
    lattice = catalogue.octahedra()
    members = len(lattice.frames((3, 3, 1)).ends)
    assert members > 500
    lattice.show((3, 3, 1)).save(tmp_path / "many.html")
    with Browser() as browser:
        browser.resize(1200, 800)
        browser.open(f"file://{tmp_path}/many.html")
        spent = browser.evaluate("""(() => {
          const press = () => document.getElementById("picture").dispatchEvent(
            new KeyboardEvent("keydown", { key: "ArrowLeft" }));
          const times = [];
          for (let k = 0; k < 40; k++) {
            const start = performance.now();
            press();
            times.push(performance.now() - start);
          }
          return times.sort((a, b) => a - b)[20];
        })()""")
        assert spent < 1000 / 60
