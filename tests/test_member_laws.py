"""Bars that buckle and members with laws of their own, in statics, on paths and in motion."""

import numpy as np
import pytest
import sympy as sp
from scipy.integrate import solve_ivp
from scipy.optimize import brentq
from structures import Frame

from tensegrity import (
    EquilibriumError,
    Potential,
    State,
    Structure,
    TensegrityError,
    control_path,
    equilibrium,
    equilibrium_path,
    gradient,
    held,
    objective,
    simulate,
)

R = sp.Symbol("r")
TISSUE = Potential(2 * (sp.exp(8 * R) / 8 - R), R)  # T = 2 (exp(8 r) - 1)
POINTS = np.array([[0, 0], [0.01, 50], [0.03, 80], [0.1, 90]])
MULTILINEAR = Potential.from_table(*np.vstack([-POINTS[:0:-1], POINTS]).T, kind="linear")
ENDS = held([0, 1])


def vee(law=TISSUE, depth=0.1, **given):
    """Two strings from (-1, 0) and (1, 0) of natural length 1 to a node below."""
    nodes = [(-1, 0), (1, 0), (0, -depth)]
    return Structure(nodes, strings=[(0, 2), (1, 2)], law=law, natural_lengths=[1, 1], **given)


def truss(rise=0.3, **given):
    return Structure([(-1, 0), (1, 0), (0, rise)], bars=[(0, 2), (1, 2)], k_bar=100.0, **given)


@pytest.mark.parametrize(
    ("buckling", "plateau", "at", "load", "samples"),
    [
        (
            1.0,
            0.0,
            0.036904224697204835,
            0.5088742293588254,
            {0.06: 0.4667459049506483, 0.18: 0.23829044123686127, 0.45: -0.2966809058604892},
        ),
        (
            0.4,
            0.05,
            0.014231291438562887,
            0.21981560510094764,
            {0.06: 0.21384859861304606, 0.18: 0.1344629899981923, 0.45: -0.1614585404893581},
        ),
        (
            2.0,
            0.0,
            0.07945799954576022,
            0.8614664034219534,
            {0.06: 0.729703094635994, 0.18: 0.47658088247372254, 0.45: -0.5933618117209783},
        ),
    ],
)
def test_a_shallow_truss_gives_way_where_its_bars_buckle(buckling, plateau, at, load, samples):
    s = truss(buckling=buckling, plateau=plateau)
    guided = ENDS + held([2], axes=[0])
    path = equilibrium_path(
        s, supports=guided, loads={2: (0, -1)}, max_shortening=0.5, at={"shortening": [*samples]}
    )
    event = next(e for e in path.events if e.kind == "buckling")
    assert (event.shortening, event.load) == pytest.approx((at, load), rel=1e-11)
    assert event.note == "bars 0, 1 buckled"
    found = {e.shortening: e.load for e in path.events if e.kind == "shortening"}
    assert [*found.values()] == pytest.approx([*samples.values()], rel=1e-11)
    assert path.buckled[-1].all()
    assert not path.buckled[0].any()
    assert "buckled: 0, 1" in str(path)
    crushed = s.at(path.positions[-1])
    assert "buckled: bars 0, 1" in str(crushed)
    assert crushed.tensions == pytest.approx(path.tensions[-1], rel=1e-12)
    if plateau == 0:
        assert path.load.max() == pytest.approx(load, rel=1e-11)
        assert crushed.tensions == pytest.approx([-buckling] * 2, rel=1e-12)


def test_one_bar_of_a_free_truss_buckles_alone():
    """The branch of least energy; the other bar is unloaded, and the node moves sideways."""
    path = equilibrium_path(
        truss(buckling=1.0), supports=ENDS, loads={2: (0, -1)}, max_shortening=0.2
    )
    assert [(e.kind, e.note) for e in path.events] == [("buckling", "bar 0 buckled")]
    assert abs(path.positions[-1][2, 0]) > 1e-6
    both = equilibrium_path(
        truss(buckling=1.0),
        supports=ENDS,
        loads={2: (0, -1)},
        max_shortening=0.2,
        branch="symmetric",
    )
    assert [e.note for e in both.events] == ["bars 0, 1 buckled"]


def test_a_buckled_bar_that_is_wound_up_by_axial_stiffness_keeps_its_load():
    """Lengthened between two walls with a string beside it."""
    line = held([0, 2]) + held([1], axes=[1])
    s = Structure(
        [(0, 0), (1, 0), (1.8, 0)],
        bars=[(0, 1)],
        strings=[(0, 1), (1, 2)],
        EA_bar=30.0,
        k_string=[2.0, 1.0],
        buckling=0.5,
        plateau=0.2,
        natural_lengths=[1.0, 1.0, 0.9],
    )
    path = control_path(s.at(equilibrium(s, None, line).positions), {0: 1.3}, line)
    (event,) = [e for e in path.events if e.kind == "buckling"]
    assert event.at["tension 0"] == pytest.approx(-0.5, rel=1e-10)

    def left(x):
        strain = x / 1.3 - 1
        bar = -0.5 + 0.2 * (30 * strain + 0.5)
        return bar + 2 * max(x - 1, 0) - max(0.9 - x, 0)

    x = brentq(left, 1.0, 1.3, xtol=1e-14)
    assert path.positions[-1][1, 0] == pytest.approx(x, rel=1e-11)
    members = [
        s.at(p, natural_lengths=[n, 1.0, 0.9]).members
        for p, n in ((path.positions[0], 1.0), (path.positions[-1], 1.3))
    ]
    stored = [m.energy(p) for m, p in zip(members, path.positions[[0, -1]], strict=True)]
    assert path.work[-1] == pytest.approx(stored[1] - stored[0], rel=1e-11)


def test_a_weight_on_tissue_hangs_as_the_closed_form():
    """2 T sin(angle) = W with T = c (exp(a strain) - 1)."""
    s = vee()
    assert s.stiffnesses == pytest.approx(16.0, rel=1e-8)
    state = equilibrium(s, {2: (0, -5.0)}, ENDS)
    assert -state.positions[2, 1] == pytest.approx(0.5804240244257298, rel=1e-12)
    assert state.tensions == pytest.approx(4.980154299167181, rel=1e-12)
    tangent = state.structure.stiffness().toarray()[4:, 4:]
    assert tangent == pytest.approx(np.diag([85.7096794532009, 34.58718120835718]), rel=1e-12)
    energy = state.structure.members.energy(state.positions)
    assert energy == pytest.approx(0.6200766538578548, rel=1e-12)
    assert state.stable


def test_a_path_passes_the_kinks_of_a_law_and_ends_with_it():
    hung = equilibrium(vee(MULTILINEAR), {2: (0, -30.0)}, ENDS)
    assert -hung.positions[2, 1] == pytest.approx(0.2183091891457699, rel=1e-12)
    assert hung.tensions == pytest.approx(70.32815047706917, rel=1e-12)
    s = vee(MULTILINEAR, 0.0 + 1e-3)
    path = equilibrium_path(
        s,
        supports=ENDS + held([2], axes=[0]),
        loads={2: (0, -1.0)},
        max_load=200.0,
        at={"load": [30.0]},
    )
    sags = [-e.at["shortening"] - 1e-3 for e in path.events if e.kind == "kink"]
    kinks = POINTS[1:3, 0]
    assert -np.array(sags) == pytest.approx(np.sqrt((1 + kinks) ** 2 - 1), rel=1e-10)
    assert [e.note for e in path.events if e.kind == "kink"] == [
        "members 0, 1 above a kink of its law"
    ] * 2
    (at_load,) = (e for e in path.events if e.kind == "load")
    assert at_load.shortening + 1e-3 == pytest.approx(0.2183091891457699, rel=1e-11)
    assert path.tensions[-1] == pytest.approx([90, 90], rel=1e-8)
    assert path.end == "string 0 is where its law ends"


def laws():
    frame = {"bars": [(0, 1), (1, 2), (2, 0)], "strings": [(3, 0), (3, 1), (3, 2)]}
    lengths = {"natural_lengths": [1, 0.95, 0.95, 0.6, 0.45, 0.45]}
    nodes = [(0, 0), (1, 0), (0.5, 0.8), (0.6, 0.3)]
    wide = Potential.from_table(
        *np.vstack([-POINTS[:0:-1], POINTS]).T, kind="linear", extrapolate=True
    )
    soft = sp.Rational(1, 2) * 10 * R**2 + 3 * R**4
    for given in (
        {"law": TISSUE},
        {"law": {4: wide, 5: TISSUE}},
        {"law": {0: Potential(soft, R), 3: TISSUE}},
        {"buckling": 0.5, "plateau": 0.1, "k_bar": 10.0},
        {"buckling": [0.2, 0.5, 0.5], "EA_bar": 10.0},
    ):
        yield Structure(nodes, **frame, **lengths, **given)


@pytest.mark.parametrize(
    "s", [*laws()], ids=["tissue", "two laws", "of a bar", "buckling", "plateau"]
)
def test_structure_and_scene_have_the_forces_and_stiffness_of_the_energy(s, rng):
    scene = s.network()
    for _ in range(5):
        u = 0.2 * rng.normal(size=(4, 2))
        moved = s.at(s.positions + u)
        members, x, h = moved.members, moved.positions, 1e-6
        assert scene.bond_tension(u) == pytest.approx(moved.tensions, rel=1e-11, abs=1e-12)
        energy = members.energy(x)
        assert scene.energy(State(u, 0 * u)) == pytest.approx(energy, rel=1e-12)
        tangent = moved.stiffness().toarray()
        np.testing.assert_allclose(scene.stiffness(u).toarray(), tangent, rtol=1e-9, atol=1e-8)
        for k, step in enumerate(h * np.eye(8).reshape(8, 4, 2)):
            slope = (members.energy(x + step) - members.energy(x - step)) / (2 * h)
            row = (members.gradient(x + step) - members.gradient(x - step)) / (2 * h)
            assert members.gradient(x).ravel()[k] == pytest.approx(slope, abs=1e-6)
            assert tangent[k] == pytest.approx(row.ravel(), rel=1e-5, abs=1e-4)


@pytest.mark.parametrize("s", [*laws()][2:4], ids=["of a bar", "buckling"])
def test_members_of_laws_move_as_by_another_integrator(s):
    v = np.array([(0, 0), (0, 0), (0, -0.4), (1, -0.5)])
    run = simulate(s.network(), State(0 * v, v), 2.0, tol=1e-8)
    assert np.ptp(run.energy) < 1e-8 * run.energy[0]

    def rates(_, y):
        return np.append(y[8:], -s.members.gradient(y[:8].reshape(4, 2)))

    start = np.concatenate([s.positions.ravel(), v.ravel()])
    y = solve_ivp(rates, (0, 2), start, "DOP853", rtol=1e-10, atol=1e-11, max_step=0.01).y[:8, -1]
    np.testing.assert_allclose(s.positions + run.final.u, y.reshape(4, 2), atol=2e-7)


@pytest.mark.parametrize(
    "case", [3, *(pytest.param(k, marks=pytest.mark.slow) for k in (0, 1, 2, 4))]
)
def test_members_of_laws_are_wound_in_motion(case):
    """Kinks move with natural lengths, and the energy gained is the work of the winches.  Steps are
    not corrected at kinks, of which the steep law of case 1 has more: it takes shorter ones."""
    s, steep = [*laws()][case], case == 1
    end, dt, within = (0.5, 2.5e-4, 2e-5) if steep else (2.0, 1e-3, 1e-6)
    v, natural = np.array([(0, 0), (0, 0), (0, -0.4), (1, -0.5)]), s.natural_lengths
    depth = {0: 0.1, 3: -0.2, len(natural) - 1: 0.15}
    time = sp.Symbol("t")
    wound = {m: natural[m] * (1 - a * sp.sin(2 * time) ** 2) for m, a in depth.items()}
    scene = s.network(natural_lengths=wound)
    run = simulate(scene, State(0 * v, v), end, dt=dt, method="rkn6")
    assert run.energy[-1] - run.energy[0] == pytest.approx(run.work[-1], abs=within)

    def rates(t, y):
        now = natural.copy()
        for m, a in depth.items():
            now[m] *= 1 - a * np.sin(2 * t) ** 2
        moved = s.at(y[:8].reshape(4, 2), natural_lengths=now)
        return np.append(y[8:], -moved.members.gradient(moved.positions))

    start = np.concatenate([s.positions.ravel(), v.ravel()])
    y = solve_ivp(rates, (0, end), start, "DOP853", rtol=1e-9, atol=1e-10, max_step=0.02).y[:8, -1]
    np.testing.assert_allclose(s.positions + run.final.u, y.reshape(4, 2), atol=within)
    assert abs(run.work[-1]) > 1e-3


def square(c=None, **changed):
    """Four bars and two strings, struck so that strings slacken and bars buckle."""
    given = {"k_bar": [20.0, 21, 22, 23], "k_string": [4.0, 5], "buckling": [0.5, 0.6, 0.4, 0.5]}
    given |= {"plateau": 0.1, "natural_lengths": [0.72] * 4 + [0.97, 0.98]}
    for name, (place, value) in changed.items():
        given[name] = [value if k == place else x for k, x in enumerate(given[name])]
    if c is not None:
        symbol = sp.Symbol("c")
        given["law"] = {4: Potential(symbol * (sp.exp(2 * R) / 2 - R), R, {symbol: c})}
    nodes, ring = [(0.5, 0), (0, 0.5), (-0.5, 0), (0, -0.5)], [(0, 1), (1, 2), (2, 3), (3, 0)]
    return Structure(nodes, bars=ring, strings=[(0, 2), (1, 3)], **given)


@pytest.mark.parametrize(
    ("name", "bond", "argument", "place", "value"),
    [
        ("k", 1, "k_bar", 1, 21.0),  # at constant buckling load
        ("k", 5, "k_string", 1, 5.0),
        ("buckling", 2, "buckling", 2, 0.4),
        ("c", 4, "c", None, 2.0),
    ],
)
def test_gradients_by_what_members_are_made_of_are_those_of_differences(
    name, bond, argument, place, value
):
    def seen(s):
        scene = s.network()
        start = scene.at_rest({0: (-0.9, 0.1), 3: (0.2, 0.4)})
        return gradient(objective.displacement(0, axis=0), scene, start, 1.5, dt=0.002)

    def other(h):
        return seen(square(**{argument: value + h if place is None else (place, value + h)})).value

    found, h = seen(square(**{"c": value} if place is None else {})), 1e-4
    slope = (other(h) - other(-h)) / (2 * h)
    assert abs(slope) > 1e-4
    assert found.by(name)[bond] == pytest.approx(slope, rel=1e-4)
    tensions = found.run.scene.bond_tension(found.run.u)
    assert tensions[:, :4].min() < -0.6
    assert tensions[:, 4:].min() == 0


def test_members_of_laws_are_prestressed():
    """Two strings in line and a bar beside them; the law is inverted, on its own side of 0."""
    soft = Potential(sp.sqrt(1 + R**2), R)  # T = r/sqrt(1 + r^2), below 1 N
    nodes, strings = [(-1, 0), (1.3, 0), (0, 0)], [(0, 2), (1, 2)]
    made = {"bars": [(0, 1)], "strings": strings, "k_bar": 50.0}
    s = Structure(nodes, law={0: soft, 1: TISSUE, 2: soft}, **made)
    for given in ({"tension": {1: 0.6}}, {"prestrain": {2: 3.0}}):
        tight = s.prestressed(**given)
        longer = 0.6 / 0.8 if "tension" in given else 1.3 * 3 / 4
        pull = longer / np.hypot(1, longer)
        np.testing.assert_allclose(tight.tensions, [-pull, pull, pull], atol=1e-14)
        lengths = [2.3 + longer, 1 - np.log1p(pull / 2) / 8, 1.3 - longer]
        np.testing.assert_allclose(tight.natural_lengths, lengths, rtol=1e-13)
        assert np.abs(equilibrium(tight).positions - s.positions).max() < 1e-9
    for tension, words in ((1.2, "is never reached by its law"), (0.9, "must be below its length")):
        with pytest.raises(TensegrityError, match=words):
            s.prestressed(tension={1: tension})


def test_a_linear_law_is_a_spring_constant_in_any_frame(rng):
    nodes = [(0, 0, 0), (1, 0, 0.1), (0, 1, 0), (0.4, 0.4, -0.5)]
    strings = [(0, 3), (1, 3), (2, 3)]
    plain = Structure(nodes, strings=strings, k_string=7.0, natural_lengths=[0.6, 0.7, 0.7])
    law = plain.at(nodes, law=Potential(sp.Rational(7, 2) * R**2, R))
    load, corners = {3: (0.1, 0.2, -1.0)}, held([0, 1, 2])
    one, other = (equilibrium(x, load, corners) for x in (plain, law))
    np.testing.assert_allclose(one.positions, other.positions, atol=1e-13)
    np.testing.assert_allclose(
        one.structure.modes(2, corners).frequencies,
        other.structure.modes(2, corners).frequencies,
        rtol=1e-12,
    )
    paths = [
        equilibrium_path(x.structure, supports=corners, loads={3: (0, 0, 1.0)}, max_load=0.5)
        for x in (equilibrium(plain, None, corners), equilibrium(law, None, corners))
    ]
    assert [e.kind for e in paths[0].events] == [e.kind for e in paths[1].events]
    np.testing.assert_allclose(paths[0].tensions[-1], paths[1].tensions[-1], atol=1e-8)
    frame = Frame.of(law, rng)
    stretch = {"law": Potential(7 * R**2 / 2, R)}
    there = frame.structure(law).at(frame.structure(law).positions, **stretch)
    np.testing.assert_allclose(there.tensions, frame.size * law.tensions, rtol=1e-9, atol=1e-14)


def test_laws_and_loads_that_cannot_be_are_refused():
    stiff = {"k_string": 1.0}
    jump = Potential(sp.Piecewise((R**2, R < 0), (R**2 + R, True)), R)
    for words, make in (
        ("law of all strings and k_string or EA_string", lambda: vee(**stiff)),
        ("law of string 1 'x'", lambda: vee({1: "x"})),
        ("member with a law 5 must be below 2", lambda: vee({5: TISSUE})),
        ("law 3 must be a Potential, or a dict", lambda: vee(3)),
        ("law of string 0 jumps", lambda: vee(jump)),
        ("stiffness -1 N/m at the natural length", lambda: vee(Potential(-(R**2) / 2, R))),
        ("tension 1 N at the natural length", lambda: vee(Potential(R + R**2, R))),
        ("string 0: elongation 0.414214 m is at or above 0.1", lambda: vee(MULTILINEAR, 1.0)),
        ("buckling 0 N must be finite and above 0", lambda: truss(buckling=0.0)),
        ("plateau 1 must be below 1", lambda: truss(buckling=1.0, plateau=1.0)),
        ("bar 0 has a law and a buckling load", lambda: truss(buckling=1.0, law={0: TISSUE})),
    ):
        with pytest.raises(TensegrityError, match=words):
            make()
    frame = Structure(
        [(0, 0), (1, 0), (0.5, 0.8)], bars=[(0, 1), (1, 2), (2, 0), (0, 1)], buckling=0.05
    )
    state = frame.self_stress().states[0]
    with pytest.raises(EquilibriumError, match="must be below its buckling load 0\\.05 N"):
        frame.prestressed(state)
