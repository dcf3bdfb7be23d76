"""Scenes that are at rest under loads, asked to a tolerance: round-off is no motion."""

import numpy as np
import pytest
import sympy as sp
from springs import series

from granular import Bead, chain, materials, y_guide
from tensegrity import Chain, Potential, Prism, State, TensegrityError, simulate

STEEL = Bead(diameter=4.76e-3, material=materials["steel"])
SOFT = Prism(1.0, 0.5, 0.4, 1.0, 2.0, 20.0)
SCENES = {
    "preloaded prisms": (Chain(SOFT.potential(0.05), 10), 100.0, 0.5),
    "structure": (Prism(1.0, 0.7, 0.1, 1.0, 5.0, 50.0).structure(mass=1.0).network(), 50.0, 1.0),
    "column": (chain([STEEL] * 5, gravity=9.81, end=materials["steel"]), 1e-2, 4.76e-3),
    "guide": (
        y_guide(stem=3, branch=3, bead=STEEL, gravity=9.81, end=materials["steel"]), 1e-3, 4.76e-3,
    ),
}  # fmt: skip


@pytest.mark.parametrize("name", SCENES)
def test_a_scene_at_rest_stays_where_it_is(name):
    scene, t_end, length = SCENES[name]
    start = scene.start() if hasattr(scene, "start") else scene.at_rest()
    run = simulate(scene, start, t_end, tol=1e-8)
    assert run.error_estimate < 1e-12
    assert abs(run.u - start.u).max() < 1e-13 * length


def test_a_displacement_far_below_a_length_is_a_motion():
    scene = Chain(SOFT.potential(), 3, ends=("fixed", "fixed"))
    stiffness = 2 * SOFT.axial_stiffness()
    run = simulate(scene, State([0, 1e-10, 0], np.zeros(3)), 20.0, tol=1e-4)
    assert abs(run.u[:, 1] - 1e-10 * np.cos(np.sqrt(stiffness) * run.t)).max() < 1e-14


def test_a_displacement_above_round_off_is_a_motion_to_the_tolerance():
    """Some 450 units of the last digit of the length beside it, and no fewer digits for that."""
    r = sp.Symbol("r")
    scene = Chain(Potential(r**2 / 2, r, length=1.0), 3, ends=("fixed", "fixed"))
    run = simulate(scene, State([0, 1e-13, 0], np.zeros(3)), 20.0, tol=1e-10)
    assert abs(run.u[:, 1] / 1e-13 - np.cos(np.sqrt(2) * run.t)).max() < 1e-10


def test_a_scene_that_leaves_its_rest_by_round_off_is_no_answer():
    barrier, stiff = series(0, 1 / 4, k=-1.0, length=1.0), series(length=1.0)
    scene = Chain([barrier, stiff], 3)
    with pytest.raises(TensegrityError, match="moves by round-off alone"):
        simulate(scene, State([0, 1e-16, 1e-16], np.zeros(3)), 80.0, tol=1e-6)
