"""The pictures of gradients: what they claim."""

import numpy as np
import pytest

from benchmarks._candidates import SPLITTINGS
from figures import _stored, chosen, gradients_pack, gradients_protector
from tensegrity import gradient
from tensegrity import objective as o


def test_prestrains_found_bring_the_peak_18_times_below_the_best_uniform_chain():
    """With two steps and another method, and slopes that keep their digits: by no error."""
    one = gradients_protector
    tables, _ = _stored.read(_stored.DATA / "gradients_protector_data.npz")
    found = tables["prestrains"]["by gradients"]
    uniform = one.peak(np.full(one.BONDS, 0.0708))
    assert uniform == pytest.approx(0.0683, rel=3e-3)  # known to three digits
    peaks = [one.peak(found, dt=dt) for dt in one.FINER]
    assert 18 * peaks[1] <= uniform
    assert peaks[0] == pytest.approx(peaks[1], rel=one.MOVED)
    chain = one.chain(found)
    start, load = chain.at_rest({0: one.SPEED}), o.peak(o.load(wall=0))
    other = gradient(
        load, chain, start, one.WINDOW, dt=0.1, method=SPLITTINGS["kahan-li 6"], wanted=()
    )
    assert other.value == pytest.approx(peaks[1], rel=one.MOVED)
    top = one.differentiated(found, o.peak(o.load(wall=0)), wanted=("prestrain",))
    assert top.digits >= one.DIGITS
    assert (
        one.RANGE[0] <= found.min() < found.max() <= one.RANGE[1] * (1 + 1e-15)
    )  # exp(log) rounds


def test_maxima_of_a_chain_are_pressed_down(monkeypatch):
    one = gradients_protector
    monkeypatch.setattr(one, "WINDOW", 300.0)
    monkeypatch.setattr(one, "PROGRAMS", 3)
    monkeypatch.setattr(one.differentiated, "__defaults__", (300.0, (), one.DT))
    start = np.geomspace(0.05, 0.02, one.BONDS)
    way = one.pressed(start)
    assert min(top for top, _ in way) < 0.95 * way[0][0]
    heights, slopes = one.maxima(np.log(start))
    assert (np.diff(heights) <= 0).all()
    h, bond = 1e-6, 30
    moved = h * np.eye(one.BONDS)[bond]
    low, high = (one.maxima(np.log(start) + x)[0][0] for x in (-moved, moved))
    assert slopes[0, bond] == pytest.approx((high - low) / (2 * h * heights[0]), rel=1e-4)


def test_the_floor_of_a_pack_feels_beads_on_both_sides_of_the_middle_alike(monkeypatch):
    plane = gradients_pack.scenes()["plane"]
    monkeypatch.setattr(gradients_pack, "scenes", lambda: {"plane": plane})
    tables = gradients_pack.data()
    numbers = {line["quantity"]: line["value"] for line in gradients_pack.table(tables)}
    assert numbers["plane: largest force on the floor [N]"] == pytest.approx(575.759, rel=1e-4)
    beads = tables["plane"]
    x, z, share = (np.asarray(beads[k]) for k in ("x", "z", "percent per um"))
    mirror = [int(np.argmin(np.hypot(2 * x[-1] - x - x[k], z - z[k]))) for k in range(len(x))]
    np.testing.assert_allclose(share[mirror], share, rtol=0, atol=1e-6 * np.abs(share).max())
    assert np.abs(share).max() > 1
    assert np.abs(share[z > z[-1] - 2.1 * (z[-1] - z[-2])][0]) < 1e-6  # a corner, not reached


def test_the_pictures_of_gradients_are_one_group():
    assert {f"gradients_{k}" for k in ("guide", "pack", "protector")} == set(chosen(["gradients"]))
