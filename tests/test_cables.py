"""Members by EA, winches, several members between two nodes: closed forms, other integrators."""

import numpy as np
import pytest
import sympy as sp
from scipy.integrate import solve_ivp
from scipy.special import jv, yv
from structures import Frame, cross, stiff_state

from tensegrity import (
    Drive,
    Lattice,
    Structure,
    TensegrityError,
    bands,
    catalogue,
    control_path,
    equilibrium,
    held,
    simulate,
)

T = sp.Symbol("t")
LINE = held([0, 2]) + held([1], axes=[1])


def in_series(natural=1.25, **given):
    """A string of EA 1000 N and a spring of 200 N/m over 2.5 m."""
    nodes, members = [(0, 0), (1.3, 0), (2.5, 0)], {"bars": [(1, 2)], "strings": [(0, 1)]}
    lengths = {"k_bar": 200.0, "natural_lengths": [1.0, natural]}
    stiff = given or {"EA_string": 1000.0}
    return equilibrium(Structure(nodes, **members, **lengths, **stiff), None, LINE).structure


def test_a_wound_cable_keeps_its_axial_stiffness():
    s = in_series()
    assert s.stiffnesses[1] == pytest.approx(800, rel=1e-15)
    assert s.EA.tolist() == [200, 1000]
    for keep, tension, word in ((None, 3500 / 29, "EA is kept"), ("k", 112.0, "k are kept")):
        path = control_path(s, {1: 0.8}, LINE, keep=keep)
        assert path.tensions[-1] == pytest.approx(tension, rel=1e-12)
        assert word in str(path)
    assert in_series(0.8).tensions == pytest.approx(3500 / 29, rel=1e-12)
    of_k = control_path(in_series(k_string=800.0), {1: 0.8}, LINE, keep="EA")
    assert of_k.tensions[-1] == pytest.approx(3500 / 29, rel=1e-12)
    both = control_path(in_series(), {0: 0.9, 1: 0.8}, LINE)
    assert "EA is kept: wound members get stiffer (members 1)" in str(both)


@pytest.mark.parametrize("keep", ["EA", "k"])
def test_work_of_a_winch_is_that_on_what_hangs_outside_the_drum(keep):
    """The tension along the path in closed form, integrated by Gauss's rule."""
    path = control_path(in_series(), {1: 0.8}, LINE, keep=keep)
    at, weights = np.polynomial.legendre.leggauss(20)
    natural = 1.025 - 0.225 * at
    k = 1000 / natural if keep == "EA" else 800.0
    tension = 200 * k * (1.5 - natural) / (200 + k)
    per_length = tension + (tension**2 / 2000 if keep == "EA" else 0)
    assert path.work[-1] == pytest.approx(0.225 * weights @ per_length, rel=1e-12)


def test_cross_strings_drawn_in_with_axial_stiffness_meet_the_structure_that_is_built_so():
    """A structure that turns: the path's Jacobian by the control, and its branches."""
    s = cross(3, 0.1)
    s = s.at(s.positions, EA_string=2.0, EA_bar=8.0).relaxed()
    path = control_path(s, {2: 0.7, 4: 0.8})
    drawn = s.natural_lengths.copy()
    drawn[[2, 4]] = 0.7, 0.8
    built = s.at(path.positions[-1], natural_lengths=drawn)
    assert built.EA.tolist() == s.EA.tolist()
    assert path.tensions[-1] == pytest.approx(built.tensions, rel=1e-11)
    left = np.abs(built.members.gradient(built.positions)).max()
    assert left < 1e-10 * built.tensions.max()
    gained = built.members.energy(built.positions) - s.members.energy(s.positions)
    assert path.work[-1] == pytest.approx(gained, rel=1e-11)


@pytest.mark.parametrize(
    ("natural", "length", "tensions"),
    [
        (1.5, 1.5227272727272727, (20.909090909090907, 9.090909090909083)),
        (1.2, 1.2407407407407407, (9.629629629629628, 20.370370370370374)),
        (0.9, 0.945, (0.0, 30.0)),
    ],
)
def test_a_band_beside_a_cable_shares_the_pull(natural, length, tensions):
    ends = held([0]) + held([1], axes=[1])
    s = Structure(
        [(0, 0), (1.3, 0)],
        strings=[(0, 1), (1, 0)],
        EA_string=[40.0, 600.0],
        natural_lengths=[1.0, natural],
    )
    state = equilibrium(s, {1: (30.0, 0)}, ends)
    assert state.positions[1, 0] == pytest.approx(length, rel=1e-12)
    assert state.tensions == pytest.approx(tensions, rel=1e-12, abs=1e-12)
    u = state.positions - s.positions
    scene = s.network(held=[0], drive={1: Drive(force=[30.0, 0.0])})
    assert scene.bond_tension(u) == pytest.approx(tensions, rel=1e-12, abs=1e-12)
    assert np.abs(scene.forces(u) + np.array([[0, 0], [30, 0]])).max() < 1e-12 * 30
    taut = s.at([(0, 0), (2.0, 0)])  # both taut: one string of the sum of both stiffnesses
    one = Structure(taut.positions, strings=[(0, 1)], k_string=taut.stiffnesses.sum())
    squares = (x.modes(1, ends).frequencies[0] ** 2 for x in (taut, one))
    assert next(squares) == pytest.approx(next(squares), rel=1e-12)


def test_two_parallel_members_move_as_one_and_have_a_state_of_self_stress():
    nodes, others = [(0, 0), (1, 0), (0.4, 0.9)], [(1, 2), (2, 0)]
    two = Structure(nodes, bars=[(0, 1), (1, 0), *others], k_bar=[3.0, 7.0, 5.0, 5.0])
    one = Structure(nodes, bars=[(0, 1), *others], k_bar=[10.0, 5.0, 5.0])
    runs = []
    for s in (two, one):
        scene = s.network()
        runs.append(simulate(scene, scene.at_rest({2: (0.3, -0.5)}), 3.0, dt=0.01, method="rkn6"))
    np.testing.assert_allclose(runs[0].u, runs[1].u, atol=1e-14)
    (state,) = two.self_stress().states
    assert np.abs(state) == pytest.approx([0.5**0.5, 0.5**0.5, 0, 0], abs=1e-15)


@pytest.mark.parametrize("cells", [1, 3])
def test_parallel_members_of_a_lattice_add_their_tensions(cells):
    """A band of k 40 N/m beside a cable of EA 600 N, 1 and 1.2 m long: 30 N at 1.24074074074 m."""
    row = Lattice([(0, 0)], [(1.0, 0)], bars=[(0, 0, 1)], strings=[(0, 0, 1)], k_bar=40.0,
                  EA_string=600.0, natural_lengths=[1.0, 1.2])  # fmt: skip
    assert row.slack.tolist() == [False, True]
    long = 1.24074074074
    taut = row.at([(0, 0)], [(long, 0)]).repeated(cells)
    assert taut.stress[0, 0] == pytest.approx(30.0, rel=1e-10)
    (k,) = {x.sum() for x in taut.stiffnesses.reshape(2, cells).T}
    assert k == pytest.approx(40 + 600 / 1.2, rel=1e-14)
    wavenumbers = [[0.3], [2.0]]
    own = bands(taut, wavenumbers).frequencies[:, -1]
    one = Lattice([(0, 0)], [(long, 0)], bars=[(0, 0, 1)], k_bar=k, natural_lengths=[long - 30 / k])
    alone = bands(one.repeated(cells), wavenumbers).frequencies[:, -1]
    np.testing.assert_allclose(own, alone, rtol=1e-9)
    block = taut.tile(4).network(held=[0, 4 * cells - 1])
    assert block.bond_tension(0 * block.at_rest().u).sum() == pytest.approx(30.0 * (4 * cells - 1))


def test_axial_stiffness_of_a_lattice_is_another_spelling_and_is_kept():
    of = catalogue.x_strip(prestrain=0.1, k_string=3.0)
    given = {"EA_bar": of.EA[: of.bars], "EA_string": of.EA[of.bars :]}
    other = of.at(of.positions, **given)
    np.testing.assert_allclose(other.stiffnesses, of.stiffnesses, rtol=1e-15)
    assert other.keeps_EA.all()
    assert not of.keeps_EA.any()
    longer = 1.25 * of.natural_lengths
    wound, k_kept = (x.at(x.positions, natural_lengths=longer) for x in (other, of))
    np.testing.assert_allclose(wound.EA, of.EA, rtol=1e-15)
    np.testing.assert_allclose(k_kept.stiffnesses, of.stiffnesses, rtol=1e-15)
    half = other.at(other.positions, k_bar=7.0)
    assert half.keeps_EA.tolist() == [False] * of.bars + [True] * of.strings
    for made in (other.repeated(2), other.tile(2)):
        assert made.keeps_EA.all()
        assert set(made.EA.round(12)) == set(of.EA.round(12))
    state = other.at(other.positions, natural_lengths=None).prestressed(2 * of.densities)
    np.testing.assert_allclose(state.tensions, 2 * of.tensions, rtol=1e-12)
    np.testing.assert_allclose(state.EA, of.EA, rtol=1e-15)


def test_axial_stiffness_is_another_spelling_of_spring_constants_at_any_scale(rng):
    for seed in range(6):
        s, loads, supports = stiff_state(np.random.default_rng(seed))
        given = {"EA_bar": s.EA[: s.bars], "EA_string": s.EA[s.bars :]}
        other = s.at(s.positions, **given)
        np.testing.assert_allclose(other.stiffnesses, s.stiffnesses, rtol=1e-15)
        one, two = (equilibrium(x, loads, supports) for x in (s, other))
        size = np.abs(one.tensions).max()
        np.testing.assert_allclose(two.tensions, one.tensions, atol=1e-8 * size)
        frame = Frame.of(s, rng)
        there = frame.structure(other)
        np.testing.assert_allclose(there.EA, other.EA, rtol=1e-13)
        np.testing.assert_allclose(there.tensions, s.tensions, atol=1e-9 * np.abs(s.EA).max())


def test_prestress_of_members_with_axial_stiffness():
    ball = catalogue.expandable_octahedron(1.0)
    ball = ball.at(ball.positions, EA_string=3.0, EA_bar=500.0)
    drawn = ball.prestressed(prestrain={6: 0.05})
    assert drawn.lengths[6] / drawn.natural_lengths[6] == pytest.approx(1.05, rel=1e-12)
    assert drawn.tensions[6] == pytest.approx(0.15, rel=1e-12)
    assert drawn.EA.tolist() == ball.EA.tolist()
    q = ball.self_stress().feasible
    assert ball.prestressed(0.1 * q).densities == pytest.approx(0.1 * q, rel=1e-11)
    with pytest.raises(TensegrityError, match="above -EA over its length, -500 N/m"):
        ball.prestressed(1e4 * q)
    assert "k_string" not in repr(drawn)


# winches in motion

EA, MASS, G, L0, SPEED, END = 500.0, 2.0, 9.81, 3.0, 0.4, 4.0
REST = L0 * (1 + MASS * G / EA)
HOISTED = [1.4338591871147237, 0.0025008483646354663]
WORK = 32.08724444449308


def hoist(**stiff):
    """A mass on a rope that is wound up, from rest in balance."""
    s = Structure([(0, 0), (REST, 0)], strings=[(0, 1)], natural_lengths=[L0], mass=MASS, **stiff)
    return s.network(
        held=[0], natural_lengths={0: L0 - SPEED * T}, drive={1: Drive(force=[MASS * G, 0])}
    )


def end_of(run):
    """Position, velocity and the work of the winch."""
    u = run.final.u[1, 0]
    return np.array([REST + u, run.final.v[1, 0], run.work[-1] - MASS * G * u])


def by_bessel_functions():
    """x = (1 + m g/EA) s + sqrt(s) (c1 J1(2 sqrt(a s)) + c2 Y1(2 sqrt(a s))), s = L0 - v t."""
    a = EA / (MASS * SPEED**2)

    def both(s):
        z, root = 2 * np.sqrt(a * s), np.sqrt(s)
        return np.array([root * jv(1, z), root * yv(1, z)])

    def slope(s):  # d/ds sqrt(s) C1(2 sqrt(a s)) = sqrt(a) C0
        z = 2 * np.sqrt(a * s)
        return np.sqrt(a) * np.array([jv(0, z), yv(0, z)])

    c = np.linalg.solve([both(L0), slope(L0)], [0.0, -(1 + MASS * G / EA)])
    s = L0 - SPEED * END
    return (1 + MASS * G / EA) * s + c @ both(s)


def test_a_hoisted_mass_moves_as_the_closed_form():
    assert by_bessel_functions() == pytest.approx(HOISTED[0], rel=1e-12)
    run = simulate(hoist(EA_string=EA), hoist(EA_string=EA).at_rest(), END, dt=0.005, method="rkn6")
    assert end_of(run) == pytest.approx([*HOISTED, WORK], rel=1e-11, abs=1e-11)
    assert run.energy_error < 1e-12
    scene = hoist(k_string=EA / L0)
    kept = simulate(scene, scene.at_rest(), END, dt=0.005, method="rkn6")
    assert end_of(kept)[0] == pytest.approx(1.477134814931944, rel=1e-11)


@pytest.mark.parametrize(("method", "order", "steps"), [("verlet", 2, 800), ("rkn6", 6, 60)])
def test_winches_keep_the_order_of_a_method(method, order, steps):
    scene = hoist(EA_string=EA)
    counts = np.array([steps, 2 * steps])
    ends = [simulate(scene, scene.at_rest(), END, dt=END / n, method=method) for n in counts]
    errors = np.abs([end_of(run) - [*HOISTED, WORK] for run in ends])
    assert np.log2(errors[0] / errors[1]) == pytest.approx(np.full(3, order), abs=0.3)


@pytest.mark.parametrize("keep", ["EA", "k"])
def test_strings_wound_each_in_its_own_way_move_as_by_another_integrator(keep):
    """Sixteen strings of an octahedron, each with its own frequency."""
    ball = catalogue.expandable_octahedron(1.0, prestrain=0.1, k_bar=2000.0)
    k = np.where(ball.is_string, 200.0, 2000.0)
    of = k * ball.natural_lengths if keep == "EA" else k
    name = "EA" if keep == "EA" else "k"
    ball = ball.at(ball.positions, **{f"{name}_bar": of[:6], f"{name}_string": of[6:]}, mass=0.2)
    depth, omega = np.zeros((2, 30))
    wound = [m for m in range(6, 30) if m % 3]
    depth[wound], omega[wound] = 0.25, 1.5 + 0.1 * np.arange(16)
    natural = ball.natural_lengths

    def lengths(m, t, sin=np.sin):
        return natural[m] * (1 - depth[m] * sin(omega[m] * t) ** 2)

    scene = ball.network(natural_lengths={m: lengths(m, T, sp.sin) for m in wound})
    run = simulate(scene, scene.at_rest(), 1.0, dt=1 / 512, method="rkn6")
    (i, j), size = ball.ends.T, ball.positions.size
    each = np.arange(30)

    def rates(t, y):
        x, l0 = y[:size].reshape(-1, 3), lengths(each, t)
        rate = -natural * depth * omega * np.sin(2 * omega * t)
        d = x[j] - x[i]
        long = np.sqrt(np.sum(d**2, axis=1))
        stiff = of / l0 if keep == "EA" else of
        pull = stiff * np.where(ball.is_string, np.maximum(long - l0, 0), long - l0)
        f = np.zeros_like(x)
        np.add.at(f, i, (pull / long)[:, None] * d)
        np.add.at(f, j, -(pull / long)[:, None] * d)
        power = -(pull + (pull**2 / (2 * of) if keep == "EA" else 0)) @ rate
        return np.concatenate([y[size:-1], (f / 0.2).ravel(), [power]])

    start = np.concatenate([ball.positions.ravel(), np.zeros(size + 1)])
    y = solve_ivp(rates, (0, 1), start, "DOP853", rtol=1e-11, atol=1e-12).y[:, -1]
    np.testing.assert_allclose(ball.positions + run.final.u, y[:size].reshape(-1, 3), atol=1e-9)
    assert run.work[-1] == pytest.approx(y[-1], abs=1e-9)
    assert run.work[-1] > 1
    assert run.energy_error < 1e-9


NODES = [
    (-0.5, 0, 0.25),
    (-0.5, 0, -0.25),
    (0.5, 0, 0.25),
    (0.5, 0, -0.25),
    (0, 0.25, 0.5),
    (0, -0.25, 0.5),
    (0, 0.25, -0.5),
    (0, -0.25, -0.5),
    (-0.25, 0.5, 0),
    (0.25, 0.5, 0),
    (-0.25, -0.5, 0),
    (0.25, -0.5, 0),
]
SIX_BARS = [(0, 2), (1, 3), (4, 6), (5, 7), (8, 10), (9, 11)]
ENDS_OF_TWO_BARS = {
    4: (0, 2),
    5: (0, 2),
    6: (1, 3),
    7: (1, 3),
    8: (0, 1, 4, 6),
    9: (2, 3, 4, 6),
    10: (0, 1, 5, 7),
    11: (2, 3, 5, 7),
}


@pytest.mark.parametrize(
    ("keep", "gain", "apart"),
    [("EA", 23.346741899244876, 0.8311327202608574), ("k", 19.8948332409838, 0.8466536131731925)],
)
def test_a_robot_of_six_heavy_bars_moves_as_the_reference(keep, gain, apart):
    """Sixteen of 24 strings wound, each with its own frequency; DOP853 at two tolerances."""
    strings = [(i, j) for j, others in ENDS_OF_TWO_BARS.items() for i in others]
    natural = np.repeat([1.0013636363636365, 0.556702214268904], [6, 24])
    given = {"bar": 20000.0 * natural[0], "string": 200.0 * natural[6]}
    if keep == "k":
        given = {"bar": 20000.0, "string": 200.0}
    stiff = {f"{keep}_{name}": value for name, value in given.items()}
    robot = Structure(
        NODES, SIX_BARS, strings, mass=0.02, bar_mass=0.2, natural_lengths=natural, **stiff
    )
    omega = dict(zip(range(6, 30), np.linspace(1.5, 4, 24).tolist(), strict=True))
    wound = {m: natural[m] * (1 - sp.sin(omega[m] * T) ** 2 / 4) for m in omega if m % 3}
    scene = robot.network(natural_lengths=wound)
    run = simulate(scene, scene.at_rest(), 2.0, dt=1 / 2048, method="rkn6")
    assert run.work[-1] == pytest.approx(gain, rel=1e-9)
    assert run.energy_error < 1e-11
    at = robot.positions + run.final.u
    assert np.linalg.norm(at[0] - at[11]) == pytest.approx(apart, rel=1e-8)


def test_a_winch_that_stands_still_changes_nothing():
    s = cross()
    plain, still = s.network(), s.network(natural_lengths={3: s.natural_lengths[3] + 0 * T})
    start = plain.at_rest({0: (0.1, 0.3)})
    one, other = (simulate(x, start, 3.0, dt=0.01, method="rkn6") for x in (plain, still))
    np.testing.assert_allclose(one.u, other.u, atol=1e-13)
    assert not np.any(other.work)


def test_a_wound_string_goes_slack_and_taut():
    """It is let out and drawn in again; against an integrator with short steps."""
    s = Structure([(0, 0), (1, 0)], strings=[(0, 1)], EA_string=4.0, natural_lengths=[0.9])
    natural = 0.9 + 0.3 * sp.sin(2 * T) ** 2
    scene = s.network(held=[0], natural_lengths={0: natural})
    run = simulate(scene, scene.at_rest({1: (0.0, 0.4)}), 4.0, tol=1e-6)

    def rates(t, y):
        x, length = y[:2], 0.9 + 0.3 * np.sin(2 * t) ** 2
        long = np.hypot(*x)
        return [*y[2:], *(-4 * max(long / length - 1, 0) / long * x)]

    y = solve_ivp(rates, (0, 4), [1, 0, 0, 0.4], "DOP853", rtol=1e-9, atol=1e-10, max_step=2e-3)
    slack = np.hypot(*y.y[:2]) < 0.9 + 0.3 * np.sin(2 * y.t) ** 2
    assert np.count_nonzero(np.diff(slack)) > 2
    np.testing.assert_allclose(s.positions[1] + run.final.u[1], y.y[:2, -1], atol=1e-6)
    assert run.energy_error < 1e-6


def test_winches_that_cannot_be_are_refused():
    s = in_series()

    ending = s.network(held=[0, 2], natural_lengths={1: 1 - T})
    assert simulate(ending, ending.at_rest(), 0.5, dt=1e-4).complete
    text = "natural length of string 1 .* must be above 0: it is driven there at t = 1 s"
    with pytest.raises(TensegrityError, match=text):
        simulate(ending, ending.at_rest(), 2.0, dt=1e-4)
    for natural, text in (
        ({1: T - 1}, "natural length of string 1 -1 m must be above 0"),
        ({7: 1 - T}, "member 7 must be below 2"),
        ({1: sp.Symbol("x")}, "depends on x"),
        ([1 - T], "must be a dict {member: expression of t}"),
    ):
        with pytest.raises(TensegrityError, match=text):
            s.network(natural_lengths=natural)
    with pytest.raises(TensegrityError, match="keep 'both' must be 'EA' or 'k'"):
        control_path(s, {1: 0.8}, LINE, keep="both")
