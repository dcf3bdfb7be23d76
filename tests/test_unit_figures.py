"""The pictures of units: their states, waves, bands and formula are those of closed forms."""

import math

import numpy as np
import pytest

from figures import units_kresling, units_rotating, units_squares, units_stiffness
from figures._files import lines

pytestmark = pytest.mark.unchanged()


@pytest.fixture(scope="module")
def kresling():
    return units_kresling.data()


def test_kresling_states_folds_and_barrier_are_those_of_the_references(kresling):
    folds, (first, barrier, second) = [], ({}, {}, {})
    for one in lines(kresling["states"]):
        if one["state"] == "fold":
            folds.append(one["load"])
        {"first": first, "barrier": barrier, "second": second}.get(one["state"], {}).update(one)
    assert folds == pytest.approx([0.20646787268761, -0.11521925214735], rel=1e-11)
    assert second["f"] == pytest.approx(math.pi - first["f"], rel=1e-13)
    drop = 4 * math.cos(first["f"]) * math.cos(math.pi / 6)
    assert second["h"] == pytest.approx(math.sqrt(first["h"] ** 2 - drop), rel=1e-13)
    assert barrier["f"] == pytest.approx(math.pi / 2, rel=1e-13)
    assert barrier["energy"] == pytest.approx(0.048453711417975, rel=1e-12)
    assert kresling["path"]["energy"].max() <= barrier["energy"]


def test_the_drawn_unit_has_creases_of_their_natural_lengths_where_it_is_unstressed(kresling):
    wanted = sorted(set(units_kresling.unit().natural_lengths()))
    for state, stressed in (("first", False), ("barrier", True), ("second", False)):
        x = np.column_stack(list(kresling[f"unit, {state}"].values()))
        low, high = x[:6], x[6:]
        found = [np.linalg.norm(np.roll(high, -k, axis=0) - low, axis=1) for k in (0, 1)]
        off = max(np.abs(one - length).max() for one, length in zip(found, wanted, strict=True))
        assert (off > 1e-2) if stressed else (off < 1e-13)


@pytest.mark.parametrize(
    ("state", "sign", "sound", "peak"),
    [
        ("first", 1, 3.4458474929526, (0.189619006139, 0.116295304143)),
        ("second", -1, 2.1960519426103, (-0.0163943364845, -0.0340868878111)),
    ],
)
def test_the_wave_is_a_rarefaction_at_the_first_state_and_a_compression_at_the_second(
    kresling, state, sign, sound, peak
):
    found, of = kresling[f"peak, {state}"], kresling[f"wave, {state}"]
    assert (found["du"][0], found["dphi"][0]) == pytest.approx(peak, rel=1e-10)
    assert found["sound"][0] == pytest.approx(sound, rel=1e-12)
    for name in ("du", "dphi"):
        run, exact = of[f"{name}, run"], of[f"{name}, exact"]
        top = np.abs(exact).max()
        assert (sign * run > -1e-9 * top).all()
        assert np.abs(run - exact).max() < 1e-8 * top
        assert np.abs(of[f"{name}, begin"] - exact).max() > 0.9 * top  # it went on
        assert np.abs(run[[0, -1]]).max() < 0.02 * top  # the picture shows the whole wave


@pytest.fixture(scope="module")
def squares():
    return units_squares.data()


def test_squares_have_the_closed_forms_at_the_centre_and_a_zero_mode_without_resistance(squares):
    for name in units_squares.CASES:
        bands = [squares[name][f"band {k}"] for k in range(6)]
        turning, between, common = squares[f"{name}, centre"]["closed form"]
        for at in (0, -1):  # the path ends where it began
            found = sorted(band[at] for band in bands)
            wanted = sorted([0, 0, turning, between, between, common])
            assert found == pytest.approx(wanted, rel=1e-12, abs=1e-7)
        assert (turning == 0) == (name == "upright")
        assert min(bands[2][5:-5]) > 0.2
    for kt in (0.01, 0.0):
        of = squares[f"kt {kt:g}"]
        wanted = np.sqrt(8 * (np.sin(of["beta"]) ** 2 + kt) / 0.3)
        assert of["found"] == pytest.approx(wanted, rel=1e-12, abs=1e-7)


def test_squares_on_the_path_have_the_reference_frequencies():
    found = units_squares.frequencies(units_squares.lattice(0.3, 0.01), [[1.0, 0.5]])[0]
    slow = 0.7775451585884, 0.8984573137737, 1.783176968521
    wanted = *slow, 2.601795544538, 3.126132992068, 4.669021704199
    assert found == pytest.approx(wanted, rel=1e-11)


def test_both_sounds_of_squares_without_torsion_are_the_same_in_every_direction(squares):
    of = squares["sound"]
    assert of["slow"] == pytest.approx(np.full(3, math.sqrt(0.5)), rel=1e-6)
    assert of["fast"] == pytest.approx(np.full(3, math.sqrt(0.5)), rel=1e-6)


def test_the_typeset_formula_is_the_stiffness_of_the_icosahedron():
    tables = units_stiffness.data()
    assert tables["formula"]["latex"] == [
        r"\frac{12 k p \left(4 p + 1\right)}{\left(p + 1\right) \left(12 p + 1\right)}"
    ]
    p = tables["dots"]["prestrain"]
    wanted = 12 * p * (1 + 4 * p) / ((1 + p) * (1 + 12 * p))
    assert tables["dots"]["stiffness"] == pytest.approx(wanted, rel=1e-13)
    fine = tables["rigid"]["prestrain"]
    assert np.interp(p, fine, tables["rigid"]["stiffness"]) == pytest.approx(wanted, rel=1e-13)
    printed = {one["struts"]: one["stiffness [N/m]"] for one in units_stiffness.table(tables)}
    assert printed["rigid"] == pytest.approx(0.69421487603306, rel=1e-13)
    assert printed["50 N/m"] == pytest.approx(0.69181013151322, rel=1e-13)
    assert tables["5 N/m"]["lost"].min() > tables["50 N/m"]["lost"].min() > 0
    elastic = units_stiffness.icosahedron(1.0, 0.3, k_strut=50.0).axial_stiffness()
    of = tables["50 N/m"]
    assert np.interp(0.3, *list(of.values())[:2]) == pytest.approx(elastic, rel=1e-12)


@pytest.fixture(scope="module")
def rotating():
    """Half of the waves of the picture."""
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(units_rotating, "RATIOS", (0.65, 0.8, 0.97, 0.999))
        patch.setattr(units_rotating, "SPEEDS", (0.3, 0.5, 0.65))
        yield units_rotating.data()


def test_waves_slower_than_sound_are_small_and_faster_ones_never(rotating):
    slower, faster = rotating["slower"], rotating["faster"]
    sound, fastest = rotating["limits"]["speed"]
    tilt, bending = math.tan(units_rotating.TILT), 8 * units_rotating.BENDING
    assert sound == pytest.approx(math.sqrt(bending / (tilt**2 + bending)), rel=1e-12)
    assert fastest == pytest.approx(0.19188, abs=2e-5)
    assert max(slower["speed"]) < sound < fastest < min(faster["speed"])
    assert np.all(np.diff(slower["rotation"]) < 0)
    assert slower["rotation"][-1] < 1e-3
    assert slower["rotation"][1] == pytest.approx(0.187849809054, rel=1e-10)
    assert np.max(faster["rotation"]) < -0.5
    assert np.max(slower["tail, other periods"]) == 0
    assert np.min(faster["tail"]) > 1e-5
    assert np.all(np.asarray(faster["tail, other periods"]) > np.asarray(faster["tail"]))
    long = [units_rotating.long_wave_peak(c) for c in (slower["speed"][2], faster["speed"][2])]
    assert long == pytest.approx([slower["rotation"][2], faster["rotation"][2]], rel=0.02)


def test_the_drawn_tail_is_that_of_the_table_and_the_slower_wave_has_none(rotating):
    far = np.abs(rotating["faster, profile"]["rotation"][rotating["faster, profile"]["x"] > 10])
    at = list(rotating["faster"]["speed"]).index(units_rotating.SHOWN["faster"])
    assert far.max() == pytest.approx(rotating["faster"]["tail"][at], rel=0.1)
    slow = rotating["slower, profile"]["rotation"]
    assert (np.diff(slow) < 0).all()
    assert 0 < slow[-1] < 1e-3 * slow[0]
