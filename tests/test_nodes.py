"""The 18-coordinate prism against the three-coordinate one, and what only it can see."""

import math

import numpy as np
import pytest
import sympy as sp

from derivations import nodes as derived
from derivations import prism as symmetric
from tensegrity import Prism, TensegrityError, equilibrium_path
from tensegrity.prisms import stability as nodes

THICK = Prism(1.0, 0.5, 0.4, 1.0, 2.0, 20.0)
SLENDER = Prism(1.0, 1.5, 0.02, 1.0, 10.0, 100.0)


@pytest.fixture(scope="module")
def energy():
    return sp.lambdify((*derived.POSITIONS, *derived.CONSTANTS), derived.energy(), "numpy")


def test_energy_of_the_members_is_that_of_the_prism_at_symmetric_positions():
    place = dict(zip(derived.POSITIONS, derived.symmetric_positions(), strict=True))
    state = {symmetric.base: 1.1, symmetric.twist: 2.7, symmetric.height: 0.6}
    numbers = dict(zip(derived.CONSTANTS, (1.0, 2.0, 3.0, 0.5, 0.9, 1.2), strict=True))
    gap = derived.energy().subs(place) - symmetric.energy()
    assert abs(sp.N(gap.subs(numbers).subs(state), 30)) < 1e-15


def test_symmetric_equilibria_are_equilibria_of_the_nodes(energy):
    """Forces by central differences: none but a third of the load on each upper node."""
    path = equilibrium_path(SLENDER)
    row = path[len(path) // 2]
    state = [row[x] for x in ("base", "twist", "height")]
    place = np.array(nodes._tangent()[0](state)).ravel()
    constants = [SLENDER.k_cross, SLENDER.k_base, SLENDER.k_bar, *SLENDER.natural_lengths()]
    step = 1e-5
    force = [
        (energy(*(place + d), *constants) - energy(*(place - d), *constants)) / (2 * step)
        for d in step * np.eye(18)
    ]
    force = np.reshape(force, (6, 3))
    assert np.abs(force[:, :2]).max() < 1e-7
    assert np.allclose(force[3:, 2], -row["load"] / 3, atol=1e-7)
    assert np.allclose(force[:3, 2], row["load"] / 3, atol=1e-7)


def test_tangent_is_the_second_difference_of_the_energy(energy, rng):
    row = equilibrium_path(SLENDER)[10]
    state = [row[x] for x in ("base", "twist", "height")]
    place = np.array(nodes._tangent()[0](state)).ravel()
    constants = [SLENDER.k_cross, SLENDER.k_base, SLENDER.k_bar, *SLENDER.natural_lengths()]
    (matrix,) = nodes.tangents(SLENDER, *state)
    assert np.abs(matrix - matrix.T).max() <= 1e-13 * np.abs(matrix).max()
    for motion in rng.normal(size=(5, 18)):
        d = 1e-4 * motion
        second = sum(energy(*(place + s * d), *constants) for s in (1, -1))
        second = (second - 2 * energy(*place, *constants)) / 1e-8
        assert second == pytest.approx(motion @ matrix @ motion, rel=1e-5)


def test_sliding_and_turning_as_a_whole_cost_nothing_and_are_left_out():
    row = equilibrium_path(SLENDER)[10]
    state = [row[x] for x in ("base", "twist", "height")]
    (matrix,) = nodes.tangents(SLENDER, *state)
    place = np.array(nodes._tangent()[0](state)).ravel()
    for support, count in (("plates", 10), ("tilting", 12)):
        motions = nodes._motions(support, place)
        assert motions.shape == (18, count)
        assert np.allclose(motions.T @ motions, np.eye(count), atol=1e-13)
        slid = np.zeros(18)
        slid[0::3] = 1
        turned = np.zeros(18)
        turned[0::3], turned[1::3] = -place[1::3], place[0::3]
        for whole in (slid, turned):
            assert np.abs(motions.T @ whole).max() < 1e-13
            assert np.abs(matrix @ whole).max() < 1e-11


@pytest.mark.parametrize("support", nodes.SUPPORTS)
def test_thick_prism_first_loses_the_symmetric_fold(support):
    (fold,) = (e for e in equilibrium_path(THICK).events if e.kind == "fold")
    loss = nodes.first_loss(THICK, support)
    assert loss.symmetric
    assert loss.height == pytest.approx(fold.height, rel=1e-10)
    assert loss.load == pytest.approx(fold.load, rel=1e-12)


def test_slender_prism_tilts_long_before_its_bars_meet():
    (contact,) = equilibrium_path(SLENDER).events
    loss = nodes.first_loss(SLENDER, "tilting")
    assert not loss.symmetric
    assert loss.load < 0.3 * contact.load


def test_tilting_is_a_pair_of_modes_which_are_lost_together():
    loss = nodes.first_loss(SLENDER, "tilting")
    state = equilibrium_path(SLENDER, min_height=loss.height)[-1:]
    values, symmetric_modes = nodes.lowest(SLENDER, state, "tilting", 3)
    assert np.abs(values[0, :2]).max() < 1e-10
    assert not symmetric_modes[0, :2].any()
    assert values[0, 2] > 1e-2


@pytest.mark.parametrize("shape", [(0.4, 0.2), (1.0, 0.1), (1.5, 0.02), (2.5, 0.01)])
def test_between_plates_three_coordinates_see_every_first_loss(shape):
    prism = Prism(1.0, *shape, 1.0, 10.0, 100.0)
    folds = [e for e in equilibrium_path(prism).events if e.kind == "fold"]
    loss = nodes.first_loss(prism, "plates")
    if folds:
        assert loss.height == pytest.approx(folds[0].height, rel=1e-9)
        assert loss.symmetric
    else:
        assert math.isnan(loss.height)


def test_rigid_members_and_unknown_supports_are_refused():
    with pytest.raises(TensegrityError, match="k_base inf N/m"):
        nodes.first_loss(Prism(1.0, 0.7, 0.01, 1.0))
    with pytest.raises(TensegrityError, match="support 'glue' must be one of plates, tilting"):
        nodes.lowest(THICK, equilibrium_path(THICK), "glue")
