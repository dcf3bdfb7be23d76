"""Columns of prisms between heavy plates that move along the axis and turn about it."""

import math
from functools import cache

import numpy as np
import pytest
import sympy as sp
from scipy.optimize import brentq

from derivations import prism as derived
from tensegrity import (
    Chain,
    Network,
    Potential,
    Prism,
    Run,
    State,
    TensegrityError,
    bands,
    dispersion,
    floquet,
    gradient,
    modes,
    moduli,
    objective,
    simulate,
    solitary_wave,
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


def residual_of(wave, column):
    """Largest m c^2 r - K T(r) over the largest force; K by quadrature, T by differences of the
    energy of a unit."""
    x = np.linspace(-1, 1, 401)
    tent = (1 - np.abs(x)) * (x[1] - x[0])  # exact to the square of the step
    unit = Network(column.positions[:2], [[0, 1]], column.springs[0], mass=column.mass[0])
    h, found = 1e-5, []

    def force(place):
        r = wave.elongation(place)
        steps = [[np.zeros(2), r + s * h * e] for e in np.eye(2) for s in (1, -1)]
        up, down = np.reshape(unit.bond_energy(np.array(steps)), (2, 2)).T
        return (up - down) / (2 * h)

    largest = np.abs(force(0.0)).max()
    for place in (0.0, 0.7, 2.0):
        mean = sum(w * force(place + s) for s, w in zip(x, tent, strict=True))
        left = column.mass[0] * wave.speed**2 * wave.elongation(place)
        found.append(np.abs(left - mean).max() / largest)
    return max(found)


@pytest.mark.parametrize(("ratio", "extension"), [(1.02, 0.0446), (2.0, 0.996)])
def test_waves_of_one_handedness_solve_their_equation(ratio, extension):
    column = PRISM.column(60, "same", plates=NODES)
    wave = solitary_wave(column, speed_ratio=ratio)
    assert wave.residual < 1e-14
    assert residual_of(wave, column) < 1e-5
    assert wave.sound_speed * PRISM.height == pytest.approx(SPEEDS["same"][1], rel=1e-10)
    assert wave.amplitude[0] == pytest.approx(extension, rel=2e-3)
    assert wave.elongation(0.0) == pytest.approx(wave.amplitude, rel=1e-12)
    assert wave.elongation([0.0, 1.0]).shape == (2, 2)


@pytest.mark.parametrize("direction", [1, -1])
def test_a_wave_of_extension_and_twist_keeps_its_form_in_a_run(direction):
    column = PRISM.column(90, "same", plates=NODES)
    wave = solitary_wave(column, speed_ratio=1.1)
    start, end = (45.5 - direction * s for s in (20, -20))
    state = wave.launch(column, start, direction)
    assert column.energy(state) == pytest.approx(wave.energy, rel=1e-13)
    assert column.momentum(state)[0] == pytest.approx(direction * wave.momentum, rel=1e-13)
    run = simulate(column, state, 40 / wave.speed, tol=1e-8)
    expected = wave.launch(column, end, direction)
    assert np.abs(run.final.u - expected.u).max() < 1e-8 * wave.amplitude[0]


@pytest.mark.parametrize("dim", [1, 2])
def test_a_line_of_one_component_has_the_waves_of_the_chain(dim):
    r = sp.Symbol("r")
    toda = Potential(sp.exp(-r) - 1 + r, r)
    x = np.zeros((6, dim))
    x[:, 0] = np.arange(6)
    line = Network(x, np.column_stack([np.arange(5), np.arange(1, 6)]), toda, mass=3.0)
    wave, chain = solitary_wave(line, speed_ratio=1.2), solitary_wave(toda, 3.0, speed_ratio=1.2)
    for name in ("energy", "momentum", "speed", "sound_speed"):
        assert getattr(wave, name) == pytest.approx(getattr(chain, name), rel=1e-13)
    assert wave.amplitude == pytest.approx([chain.amplitude] + [0] * (dim - 1), rel=1e-13)
    assert wave.width() == pytest.approx(chain.width(), rel=1e-10)
    places = [0.0, 1.3]
    assert wave.elongation(places)[:, 0] == pytest.approx(chain.elongation(places), rel=1e-12)
    assert not wave.elongation(places)[:, 1:].any()


def test_a_family_of_a_line_ends_where_that_of_the_chain_does():
    spring = PRISM.potential()
    line = Network([[0.0], [1.0]], [[0, 1]], spring, mass=3.0)
    assert solitary_wave(line, speed_ratio=1.13).family == "compression"
    with pytest.raises(TensegrityError, match=r"ratio of 1.14 found.*at most about 1.13"):
        solitary_wave(line, speed_ratio=1.14)
    with pytest.raises(TensegrityError, match="must be below"):
        solitary_wave(spring, 3.0, speed_ratio=1.14)


@pytest.mark.parametrize("ratio", [0.5, 1.05, 3.0])
def test_waves_of_any_speed_meet_torsion_among_alternating_units(ratio):
    """With staggered rotations units are equal; of the two branches one is not 0 at phase 0."""
    column = PRISM.column(1, plates=NODES)
    stiffness = column.springs[0].tangent(*np.zeros((2, 1, 2)))[0, 2:, 2:] / 3.0

    def branches(phase):
        of = np.diag([2j * np.sin(phase / 2), 2 * np.cos(phase / 2)])  # of u, and of rotations
        return np.sqrt(np.linalg.eigvalsh(of.conj() @ stiffness @ of))

    all_bands = waves(PRISM.column(plates=NODES, periodic=True), 1.0)[0]
    assert all_bands[[1, 2]] == pytest.approx(branches(1.0), rel=1e-10)
    speed = ratio * math.sqrt(PRISM.axial_stiffness() / 3.0)
    meets = brentq(lambda q: branches(q)[1] - speed * q, 1e-9, 20 / ratio)
    assert branches(meets)[1] == pytest.approx(speed * meets, rel=1e-9)
    assert meets > 0.3


@cache
def refused():
    return tuple(no_waves())


def no_waves():
    column = PRISM.column(60, "same", plates=NODES)
    wave = solitary_wave(column, speed_ratio=1.1)
    mixed = Network(column.positions, column.bonds[::-1], column.springs[0])
    heavy = Network(column.positions, column.bonds, column.springs[0],
                    mass=np.arange(1.0, 62.0)[:, None])  # fmt: skip
    light = PRISM.column(60, "same", plates=(1.0, 0.5))
    yield (
        "units of alternating handedness radiate",
        lambda: solitary_wave(PRISM.column(4, plates=NODES), speed_ratio=1.1),
    )
    yield "masses of a column", lambda: solitary_wave(heavy, speed_ratio=1.1)
    yield "from each site to the next", lambda: solitary_wave(mixed, speed_ratio=1.1)
    yield "must be above", lambda: solitary_wave(column, speed_ratio=1.0)
    yield "alone", lambda: solitary_wave(column, amplitude=0.1)
    yield "alone", lambda: solitary_wave(column, 2.0, speed_ratio=1.1)
    yield "several components", lambda: wave.energy_slope
    yield "several components", lambda: floquet(wave)
    yield "no strain", lambda: wave.strain
    yield "differ from those of the wave", lambda: wave.launch(light, 30.5)
    yield "ends of the chain", lambda: wave.launch(column, 3.5)
    yield "not a Network", lambda: wave.launch(Chain(PRISM.potential(), 60), 30.5)


@pytest.mark.parametrize("words", range(12))
def test_what_is_no_wave_of_a_column_is_refused(words):
    words, make = refused()[words]
    with pytest.raises(TensegrityError, match=words):
        make()


def test_what_is_not_between_plates_is_refused():
    for wrong in ((3.0,), (0.0, 1.0), (1.0, -1.0), (1.0, math.nan), "ab"):
        with pytest.raises(TensegrityError, match="plates"):
            PRISM.column(3, plates=wrong)
    with pytest.raises(TensegrityError, match="k_bar inf"):
        Prism(1.0, 0.7, 0.1, 1.0).column(3, plates=NODES)
    with pytest.raises(TensegrityError, match="multiple of 2"):
        PRISM.column(3, plates=NODES, periodic=True)
    column = PRISM.column(2, plates=NODES)
    spring, other = column.springs[0], Prism(1, 0.8, 0.1, 1, 5, 50, 4).column(1, plates=NODES)
    for what, given in {
        "radius": {"spring": spring, "radius": 0.1},
        "one form": {"spring": [spring, other.springs[0]]},
    }.items():
        with pytest.raises(TensegrityError, match=what):
            Network(column.positions, column.bonds, **given)
    with pytest.raises(TensegrityError, match="have 3 coordinates"):
        Network(np.eye(3), column.bonds, spring)
