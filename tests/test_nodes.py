"""The 18-coordinate prism against the three-coordinate one, and what only it can see."""

import math

import numpy as np
import pytest
import sympy as sp

from derivations import member as derived
from derivations import prism as symmetric
from tensegrity import Prism, TensegrityError, equilibrium_path
from tensegrity.prisms import stability as nodes
from tensegrity.prisms.stack import symmetric_nodes

THICK = Prism(1.0, 0.5, 0.4, 1.0, 2.0, 20.0)
SLENDER = Prism(1.0, 1.5, 0.02, 1.0, 10.0, 100.0)


@pytest.fixture(scope="module")
def energy():
    return sp.lambdify((*derived.POSITIONS, *derived.CONSTANTS), derived.prism_energy(), "numpy")


def test_energy_of_the_members_is_that_of_the_prism_at_symmetric_positions():
    place = dict(zip(derived.POSITIONS, derived.symmetric_positions(), strict=True))
    state = {symmetric.base: 1.1, symmetric.twist: 2.7, symmetric.height: 0.6}
    numbers = dict(zip(derived.CONSTANTS, (1.0, 2.0, 3.0, 0.5, 0.9, 1.2), strict=True))
    gap = derived.prism_energy().subs(place) - symmetric.energy()
    assert abs(sp.N(gap.subs(numbers).subs(state), 30)) < 1e-15


def test_the_argument_shows_the_hessian_of_the_energy():
    """The last formula of the argument at a vector d of its own, against second derivatives."""
    (shown,) = derived.argument()[-1].formulas
    (n,) = shown.atoms(sp.MatrixSymbol)
    d = sp.Matrix(derived.separation(3))
    at = {derived.stiffness: 3, derived.natural: sp.Rational(7, 5)}
    at |= dict(zip(d, (sp.Rational(2, 3), 2, 1), strict=True))
    size = d.norm().subs(at)
    exact = sp.hessian(derived.energy(derived.length_of(3)), list(d)).subs(at)
    density = 3 * (1 - sp.Rational(7, 5) / size)
    shown = shown.subs({derived.stiffness: 3, derived.density: density})
    shown = shown.subs(n, d.subs(at) / size).as_explicit()
    assert (shown - exact).applyfunc(sp.simplify).is_zero_matrix


@pytest.fixture(scope="module")
def row():
    return equilibrium_path(SLENDER)[10]


def constants(prism):
    return [prism.k_cross, prism.k_base, prism.k_bar, *prism.natural_lengths()]


def place(row):
    """By the derivation, (18,)."""
    symbols = (symmetric.base, symmetric.twist, symmetric.height)
    numbers = sp.lambdify(symbols, derived.symmetric_positions(), "numpy")
    return np.array(numbers(*(row[x] for x in ("base", "twist", "height"))), dtype=float)


def test_nodes_of_a_row_are_those_of_the_derivation(row):
    (found,) = symmetric_nodes(3, *([row[x]] for x in ("base", "twist", "height")))
    assert np.abs(found.ravel() - place(row)).max() < 1e-15


def test_symmetric_equilibria_are_equilibria_of_the_nodes(energy):
    """Forces by central differences: none but a third of the load on each upper node."""
    path = equilibrium_path(SLENDER)
    row = path[len(path) // 2]
    at, step = place(row), 1e-5
    force = [
        (energy(*(at + d), *constants(SLENDER)) - energy(*(at - d), *constants(SLENDER)))
        / (2 * step)
        for d in step * np.eye(18)
    ]
    force = np.reshape(force, (6, 3))
    assert np.abs(force[:, :2]).max() < 1e-7
    assert np.allclose(force[3:, 2], -row["load"] / 3, atol=1e-7)
    assert np.allclose(force[:3, 2], row["load"] / 3, atol=1e-7)


def test_tangent_of_the_structure_is_the_hessian_of_the_energy_in_18_coordinates(row):
    slopes = [derived.prism_energy().diff(x) for x in derived.POSITIONS]
    slopes = sp.lambdify((derived.POSITIONS, derived.CONSTANTS), slopes, cse=True)
    s = SLENDER.structure()
    for at in (s.positions.ravel(), place(row)):
        steps, moved = 1e-30j * np.eye(18), at.reshape(6, 3)  # complex: no difference is taken
        wanted = np.imag([slopes(at + step, constants(SLENDER)) for step in steps]) / 1e-30
        network = s.network().stiffness(moved - s.positions)
        for found in (s.at(moved).stiffness(), network):
            assert np.abs(found.toarray() - wanted).max() <= 1e-12 * np.abs(wanted).max()


def test_sliding_and_turning_as_a_whole_are_left_out(row):
    path = equilibrium_path(SLENDER)[10:11]
    for support, count in (("plates", 10), ("tilting", 12)):
        values, _ = nodes.lowest(SLENDER, path, support, 18)
        assert values.shape == (1, count)
        assert (np.abs(values) > 1e-6).all()


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


def test_a_square_prism_is_lost_where_its_lowest_eigenvalue_changes_its_sign():
    prism = Prism(1.0, 1.0, 0.1, 1.0, 5.0, 50.0, sides=4)
    loss = nodes.first_loss(prism, "plates")
    for share, stands in ((1e-6, True), (-1e-6, False)):
        state = equilibrium_path(prism, min_height=(1 + share) * loss.height)[-1:]
        values, symmetric_modes = nodes.lowest(prism, state, "plates", 1)
        assert (values[0, 0] > 0) == stands
        assert symmetric_modes[0, 0] == loss.symmetric


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


def test_rigid_members_are_refused():
    with pytest.raises(TensegrityError, match="k_base inf N/m"):
        nodes.first_loss(Prism(1.0, 0.7, 0.01, 1.0))
