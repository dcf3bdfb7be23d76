"""The pictures of gradients: what they claim."""

import numpy as np
import pytest

from figures import chosen, gradients_pack


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
    assert {f"gradients_{k}" for k in ("guide", "pack")} == set(chosen(["gradients"]))
