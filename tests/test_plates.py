"""Columns of prisms between heavy plates that move along the axis and turn about it."""

import math

import numpy as np
import pytest
import sympy as sp

from derivations import prism as derived
from tensegrity import (
    Network,
    Prism,
    Run,
    State,
    TensegrityError,
    bands,
    dispersion,
    gradient,
    modes,
    moduli,
    objective,
    simulate,
)

PRISM = Prism(1.0, 0.7, 0.1, 1.0, 5.0, 50.0)
NODES = (3.0, PRISM.circumradius)  # plates with the inertia of the nodes of LATTICES B3
SPEEDS = {
    "same": (0.255990895989, 1.368504482822),
    "alternate": (0.277767871646, 0.594133064682),
}


def waves(column, phases):
    return bands(column, column.nodes * np.reshape(phases, (-1, 1))).frequencies


@pytest.mark.parametrize("hand", SPEEDS)
def test_long_waves_have_the_speeds_of_the_column_of_nodes(hand):
    q = 1e-5
    found = waves(PRISM.column(chirality=hand, plates=NODES, periodic=True), q)[0, :2]
    assert found / q * PRISM.height == pytest.approx(SPEEDS[hand], rel=1e-8)
    nodes = moduli(PRISM.column(chirality=hand, periodic=True)).speeds([0, 0, 1])[2:]
    assert found / q * PRISM.height == pytest.approx(nodes, rel=1e-8)


@pytest.mark.parametrize("hand", SPEEDS)
def test_shorter_waves_differ_from_those_of_nodes_by_the_square_of_the_wavenumber(hand):
    plates, nodes = (PRISM.column(chirality=hand, plates=x, periodic=True) for x in (NODES, False))
    units = nodes.nodes // 3

    def off(q):
        w, all_nodes = waves(plates, q)[0, :2], bands(nodes, [[units * q]]).frequencies[0]
        return [np.abs(all_nodes / x - 1).min() for x in w]

    ratio = np.array(off(0.2)) / off(0.1)
    assert np.log2(ratio).min() > 1.9


def test_plates_of_little_inertia_are_the_chain():
    """The twist of each unit is then in equilibrium; its inertia counts by the gyration's square,
    most where plates turn all one way, near the end of the zone."""
    q = np.array([0.5, 1.0, 1.5])
    chain = dispersion(PRISM.potential(), 3.0, q)[:, 0]
    off = []
    for gyration in (0.02, 0.01):
        column = PRISM.column(plates=(3.0, gyration), periodic=True)
        w = waves(column, q)
        off.append(np.abs(w / chain[:, None] - 1).min(axis=1))
    assert np.max(off[1]) < 1e-3
    assert np.allclose(off[0] / np.array(off[1]), 4, atol=0.05)


def energy_of(prism, height, twist):
    """Energy of the members of a unit, with its bases in equilibrium, by SymPy."""
    known = dict(zip((derived.natural_cross, derived.natural_base, derived.natural_bar),
                     prism.natural_lengths(), strict=True))  # fmt: skip
    known |= {derived.k_cross: prism.k_cross, derived.k_base: prism.k_base}
    known |= {derived.k_bar: prism.k_bar, derived.height: height, derived.twist: twist}
    energy = derived.energy().subs(known)
    base = sp.nsolve(sp.diff(energy, derived.base), derived.base, prism.base, prec=30)
    return float(energy.subs(derived.base, base))


@pytest.mark.parametrize("hand", SPEEDS)
def test_energy_of_a_unit_is_that_of_its_members_with_bases_in_equilibrium(hand):
    column = PRISM.column(2, hand, plates=(2.0, 0.4))
    rest = energy_of(PRISM, PRISM.height, PRISM.reference_twist)
    u = np.array([[0.1, 0.05], [0.06, -0.03], [-0.05, 0.1]])
    for j, sign in enumerate((1, -1 if hand == "alternate" else 1)):
        rise, turn = u[j + 1] - u[j]
        exact = energy_of(PRISM, PRISM.height + rise, PRISM.reference_twist + sign * turn / 0.4)
        assert column.bond_energy(u)[j] == pytest.approx(exact - rest, rel=1e-11)


@pytest.mark.parametrize(
    "prism", [PRISM, Prism(0.1, 0.05, 0.2, 300.0, math.inf, 2e4), Prism(1, 1, 0.1, 1, 4, 30, 4)]
)
def test_forces_are_the_slope_of_the_energy_and_stiffness_that_of_the_forces(prism):
    column = prism.column(3, "same", plates=(2.0, prism.base))
    size = 0.03 * prism.height
    u = size * np.random.default_rng(1).standard_normal(column.shape)
    step, rest = 1e-4 * size, np.zeros(column.shape)
    stiffness = column.stiffness(u).toarray()
    for k, each in enumerate(step * np.eye(u.size).reshape(-1, *column.shape)):
        up, down = (column.energy(State(u + x, rest)) for x in (each, -each))
        assert column.forces(u).ravel()[k] == pytest.approx(
            (down - up) / (2 * step), abs=1e-7 * prism.k_cross * size
        )
        slope = (column.forces(u - each) - column.forces(u + each)).ravel() / (2 * step)
        assert np.abs(stiffness[:, k] - slope).max() < 1e-6 * np.abs(stiffness).max()


def test_a_blow_keeps_energy_and_both_momenta_and_converges():
    column = PRISM.column(20, "same", plates=NODES)
    start = column.at_rest({0: [0.05, 0.0]})
    runs = {dt: simulate(column, start, 20.0, method="rkn6", dt=dt) for dt in (0.1, 0.05, 0.025)}
    assert runs[0.025].energy_error < 1e-11
    moved = [column.momentum(run.final) - column.momentum(start) for run in runs.values()]
    assert np.abs(moved).max() < 1e-14
    coarse, middle, fine = (run.final.u for run in runs.values())
    order = np.log2(np.abs(coarse - middle).max() / np.abs(middle - fine).max())
    assert order == pytest.approx(6, abs=0.5)
    tight = simulate(column, start, 20.0, tol=1e-9).final.u
    assert np.abs(tight - fine).max() < 2e-9 * np.abs(fine).max()
    implicit = simulate(column, start, 20.0, method="midpoint", dt=0.025)
    assert np.abs(implicit.final.u - fine).max() < 1e-2 * np.abs(fine).max()


def test_default_step_is_stable_where_a_column_is_compressed_hard():
    column = PRISM.column(10, "alternate", plates=(1.0, 0.2))
    run = simulate(column, column.at_rest({0: [0.6, 0.0]}), 10.0)
    assert run.energy_error < 1e-6
    fastest = np.sqrt(np.linalg.eigvalsh(column.stiffness(run.final.u).toarray()).max())
    assert run.dt * fastest < 2


def test_gradient_is_that_of_differences():
    column = PRISM.column(6, "alternate", plates=NODES)
    u, v = 0.02 * np.random.default_rng(2).standard_normal((2, *column.shape))

    def value(u, v):
        traces = objective.displacement(5, 1), objective.energy([2, 3])
        return gradient(traces, column, State(u, v), 3.0, dt=0.05)

    found, step = value(u, v), 1e-5
    for site, axis in ((0, 0), (3, 1)):
        each = np.zeros(column.shape)
        each[site, axis] = step
        for one, up, down in zip(found, value(u + each, v), value(u - each, v), strict=True):
            assert one.u[site, axis] == pytest.approx((up.value - down.value) / 2 / step, rel=1e-6)


def test_modes_of_a_column_held_at_an_end_are_standing_waves():
    column = PRISM.column(12, "same", plates=NODES)
    held = Network(column.positions, column.bonds, column.springs[0], mass=3.0, held=[0])
    q = np.pi / 2 / 12.5
    exact = waves(PRISM.column(chirality="same", plates=NODES, periodic=True), q)[0, 0]
    assert modes(held, count=1).frequencies[0] == pytest.approx(exact, rel=2e-2)


def test_a_run_is_read_from_its_file(tmp_path):
    column = PRISM.column(3, plates=NODES)
    run = simulate(column, column.at_rest({0: [0.01, 0.0]}), 1.0, dt=0.05)
    run.save(tmp_path / "run.npz")
    again = Run.load(tmp_path / "run.npz")
    assert again.scene == column
    assert np.array_equal(again.u, run.u)


def test_what_is_not_between_plates_is_refused():
    for wrong in ((3.0,), (0.0, 1.0), (1.0, -1.0), (1.0, math.nan), "ab"):
        with pytest.raises(TensegrityError, match="plates"):
            PRISM.column(3, plates=wrong)
    with pytest.raises(TensegrityError, match="k_bar inf"):
        Prism(1.0, 0.7, 0.1, 1.0).column(3, plates=NODES)
    with pytest.raises(TensegrityError, match="multiple of 2"):
        PRISM.column(3, plates=NODES, periodic=True)
    column = PRISM.column(2, plates=NODES)
    spring, other = column.springs[0], Prism(1.0, 0.8, 0.1, 1.0, 5.0, 50.0).column(1, plates=NODES)
    for what, given in {
        "radius": {"spring": spring, "radius": 0.1},
        "2 different": {"spring": [spring, other.springs[0]]},
    }.items():
        with pytest.raises(TensegrityError, match=what):
            Network(column.positions, column.bonds, **given)
    with pytest.raises(TensegrityError, match="not 3"):
        Network(np.eye(3), column.bonds, spring)
