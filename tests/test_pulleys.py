"""Cables over nodes without friction: statics in closed form, published tensions, limits."""

import pickle

import numpy as np
import pytest
import sympy as sp
from scipy.integrate import solve_ivp
from scipy.optimize import brentq
from structures import Frame, cross

from tensegrity import (
    Damping,
    EquilibriumError,
    Force,
    Network,
    PowerLaw,
    Record,
    StabilityError,
    Structure,
    TensegrityError,
    control_path,
    equilibrium,
    equilibrium_path,
    held,
    simulate,
)

ENDS = held([0, 1])
SQUARE = [(0.0, 0.0), (1.0, 0.0), (1.0, 1.0), (0.0, 1.0)]
BARS = [(0, 2), (1, 3)]


def pulley(span=4.0, rise=0.0, natural=6.0, axial=2000.0, at=(2, -2), weight=50.0):
    nodes = [(0, 0), (span, rise), at]
    given = {"EA_string": axial, "natural_lengths": [natural], "mass": weight / 9.81}
    return Structure(nodes, cables=[(0, 2, 1)], **given)


def tension_under(span, natural, axial, weight):
    """span/L = sin angle, 2 T cos angle = W, T = EA (L/natural - 1)."""

    def left(strain):
        cosine = np.sqrt(1 - (span / (natural * (1 + strain))) ** 2)
        return 2 * axial * strain * cosine - weight

    return axial * brentq(left, 0.0, 1.0, xtol=1e-18, rtol=1e-14)


@pytest.mark.parametrize(
    ("rise", "position", "frequencies"),
    [
        (1.0, (1.5656486222082284, -1.8022834763042945), (1.5959490928307325, 12.288811311419655)),
        (0.0, (2.0, -2.3022834763042943), (1.5583339720332645, 12.285056511974283)),
    ],
)
def test_a_weight_on_a_pulley_hangs_and_oscillates_as_the_closed_form(rise, position, frequencies):
    state = equilibrium(pulley(rise=rise), {2: (0, -50.0)}, ENDS)
    assert state.positions[2] == pytest.approx(position, rel=1e-12)
    assert state.tensions == pytest.approx([33.11574849635783], rel=1e-12)
    assert state.structure.lengths == pytest.approx([6.099347245489073], rel=1e-13)
    assert state.structure.modes(2, ENDS).frequencies == pytest.approx(frequencies, rel=1e-11)
    assert state.stable
    assert state.reactions[:2].sum(axis=0) == pytest.approx([0, 50], abs=1e-9)


@pytest.mark.parametrize("scale", [1e-5, 1.0, 100.0])
@pytest.mark.parametrize("axial", [1e3, 1e5, 1e8])
def test_fine_cables_hang_over_pulleys_at_any_scale(scale, axial):
    s = pulley(natural=6.0 * scale, span=4.0 * scale, axial=axial, at=(2.3 * scale, -2.2 * scale))
    state = equilibrium(s, {2: (0, -50.0)}, ENDS)
    tension = tension_under(4.0, 6.0, axial, 50.0)
    assert state.tensions == pytest.approx([tension], rel=1e-8)
    assert state.positions[2, 0] == pytest.approx(2 * scale, rel=1e-8)


EA = [
    102438920.88241433,
    102438920.88241433,
    439224.0394972034,
    439224.0394972034,
    439224.03949720325,
]
NATURAL = [
    2.000019524019843,
    2.000019524019843,
    1.24527381272865,
    1.4119404793953167,
    2.8238809587906335,
]
DRAWN = 0.9119404793953167
PUBLISHED = [-16512.752350958, -25890.076370348, 3925.139569164, 26914.208637868, 14017.401158772]


def double_bar(natural=None):
    nodes = [(0, 0), (1, 1), (2, 0), (1, -1)]
    return Structure(
        nodes,
        bars=BARS,
        strings=[(2, 3), (3, 0)],
        cables=[(0, 1, 2)],
        EA_bar=EA[:2],
        EA_string=EA[2:],
        natural_lengths=natural or NATURAL,
    )


def test_double_bar_with_a_cable_over_a_node_has_the_published_tensions():
    wound = [*NATURAL[:2], DRAWN, *NATURAL[3:]]
    assert double_bar(wound).relaxed().tensions == pytest.approx(PUBLISHED, rel=1e-11)
    start = double_bar().relaxed()
    path = control_path(start, {2: DRAWN})
    assert path.tensions[-1] == pytest.approx(PUBLISHED, rel=1e-11)
    end = start.at(path.positions[-1], natural_lengths=wound)
    gained = end.members.energy(end.positions) - start.members.energy(start.positions)
    assert path.work[-1] == pytest.approx(gained, rel=1e-10)


def test_drawing_in_a_cable_over_nodes_does_the_work_that_is_stored():
    start = double_bar().relaxed()
    path = control_path(start, {4: 2.7}, at={"control": [0.5]})
    half = double_bar([*NATURAL[:4], (NATURAL[4] + 2.7) / 2]).relaxed()
    (event,) = path.events
    assert event.at["tension 4"] == pytest.approx(half.tensions[4], rel=1e-10)
    stored = half.members.energy(half.positions) - start.members.energy(start.positions)
    assert event.work == pytest.approx(stored, rel=1e-9)


def test_two_strings_made_one_cable_leave_a_mechanism():
    strings = [(0, 1), (1, 2), (2, 3), (3, 0)]
    plain = Structure(SQUARE, bars=BARS, strings=strings)
    clustered = Structure(SQUARE, bars=BARS, strings=strings[2:], cables=[(0, 1, 2)])
    for s, mechanisms in ((plain, 0), (clustered, 1)):
        assert (len(s.self_stress().states), len(s.mechanisms())) == (1, mechanisms)
    motion = clustered.mechanisms()[0]
    moved = clustered.at(clustered.positions + 1e-6 * motion)
    assert np.abs(moved.lengths - clustered.lengths).max() < 1e-11
    assert np.abs(plain.at(moved.positions).lengths - plain.lengths).max() > 1e-7
    q = clustered.self_stress().feasible
    stressed = clustered.prestressed(0.1 * q)
    assert np.ptp(stressed.tensions[2:]) < 1e-15
    assert np.abs(stressed.members.gradient(stressed.positions)).max() < 1e-14
    assert stressed.densities == pytest.approx(0.1 * q, rel=1e-12)


def test_cables_of_one_segment_are_strings_to_the_bit():
    plain = cross()
    ends, lengths = plain.ends.tolist(), plain.natural_lengths
    some = Structure(
        plain.positions, ends[:2], ends[2:4], cables=ends[4:], k_bar=10.0, natural_lengths=lengths
    )
    loads, feet = {2: (0.02, -0.05), 3: (0, -0.05)}, held([0]) + held([1], axes=[1])
    one, other = (equilibrium(s, loads, feet) for s in (plain, some))
    assert np.array_equal(one.positions, other.positions)
    assert np.array_equal(one.structure.modes(3).frequencies, other.structure.modes(3).frequencies)
    paths = [
        equilibrium_path(s, supports=feet, loads=loads, max_shortening=0.2) for s in (plain, some)
    ]
    assert np.array_equal(paths[0].positions, paths[1].positions)
    runs = []
    for s in (plain, some):
        scene = s.network()
        runs.append(simulate(scene, scene.at_rest({2: (0.1, 0.2)}), 1.0, dt=0.01))
    assert np.array_equal(runs[0].u, runs[1].u)


def tackle(rng, nodes=7):
    """A cable through all nodes in the plane, some of them twice, and bars that hold them."""
    x = rng.normal(size=(nodes, 2))
    around = [*range(nodes), 0, 2, 5]
    rods = [(i, (i + 3) % nodes) for i in range(nodes)]
    lengths = Structure(x, bars=rods, cables=[around]).lengths
    natural = np.append(lengths[:-1], 0.9 * lengths[-1])
    return Structure(
        x, bars=rods, cables=[around], EA_bar=50.0, EA_string=2.0, natural_lengths=natural
    )


def test_forces_and_stiffness_are_derivatives_of_the_energy(rng):
    s = tackle(rng)
    members, x, h = s.members, s.positions, 1e-6
    tangent = s.stiffness().toarray()
    for k, step in enumerate(h * np.eye(x.size).reshape(-1, *x.shape)):
        slope = (members.energy(x + step) - members.energy(x - step)) / (2 * h)
        row = (members.gradient(x + step) - members.gradient(x - step)).ravel() / (2 * h)
        assert members.gradient(x).ravel()[k] == pytest.approx(slope, abs=1e-7)
        assert tangent[k] == pytest.approx(row, abs=1e-6)
    loose = s.at(x, natural_lengths=[*s.natural_lengths[:-1], 2 * s.lengths[-1]])
    assert loose.tensions[-1] == 0
    assert loose.slack[-1]


def test_many_pulleys_have_a_sparse_tangent_and_one_tension(rng):
    """More coordinates than are solved densely: loads on pulleys apart, drawn along a ceiling."""
    count = 120
    x = np.zeros((2 * count + 1, 2))
    x[:, 0] = np.arange(2 * count + 1)
    x[1::2, 1] = -1.0 - 0.01 * rng.random(count)
    fixed = held(range(0, 2 * count + 1, 2))
    s = Structure(x, cables=[range(2 * count + 1)], EA_string=1e4)
    state = equilibrium(s, {n: (0, -1.0) for n in range(1, 2 * count, 2)}, fixed)
    assert x.size > 400
    down = -state.positions[1::2, 1]
    sine = down / np.hypot(1, down)
    assert 2 * state.tensions[0] * sine == pytest.approx(np.ones(count), rel=1e-9)


def test_paths_of_cables_over_nodes_meet_equilibria_and_slacken(rng):
    """A pulley pressed up until its cable is slack, beside a spring to the ground."""
    s = Structure(
        [(0, 0), (4, 1), (1.7, -2), (1.7, -3)],
        bars=[(2, 3)],
        cables=[(0, 2, 1)],
        k_bar=3.0,
        EA_string=100.0,
        natural_lengths=[0.5, 5.2],
    )
    fixed = held([0, 1, 3])
    start = equilibrium(s, None, fixed).structure
    path = equilibrium_path(
        start, supports=fixed, loads={2: (0, 1.0)}, max_shortening=2.0, at={"load": [0.4]}
    )
    event = next(e for e in path.events if e.kind == "load")
    direct = equilibrium(start, {2: (0, 0.4)}, fixed)
    assert event.at["tension 1"] == pytest.approx(direct.tensions[1], rel=1e-9)
    (slack,) = [e for e in path.events if e.kind == "slack"]
    assert slack.note == "string 1 slack"
    assert abs(slack.at["tension 1"]) < 1e-8


def test_another_frame_changes_nothing(rng):
    s = tackle(rng)
    frame = Frame.of(s, rng)
    there = Structure(
        frame.size * frame.vectors(s.positions) + frame.shift,
        bars=frame.nodes(s.ends[: s.bars]),
        cables=[frame.nodes(s.cables[0])[::-1]],
        EA_bar=50.0,
        EA_string=2.0,
        natural_lengths=frame.size * s.natural_lengths,
    )
    np.testing.assert_allclose(there.tensions, s.tensions, rtol=1e-8, atol=1e-8)
    ratios = there.modes(8).eigenvalues * frame.size / s.modes(8).eigenvalues
    np.testing.assert_allclose(ratios, 1, rtol=1e-6)
    counts = [(len(x.self_stress().states), len(x.mechanisms())) for x in (s, there)]
    assert counts[0] == counts[1]


def test_weights_on_neighbouring_free_pulleys_of_one_cable_run_together():
    s = Structure(
        [(0, 0), (6, 0), (2, -2), (4, -2)],
        cables=[(0, 2, 3, 1)],
        EA_string=2000.0,
        natural_lengths=[7.0],
    )
    with pytest.raises(
        EquilibriumError, match="two pulleys run together: nodes 2 and 3 of cable 0"
    ):
        equilibrium(s, {2: (0, -30.0), 3: (0, -50.0)}, ENDS)


def test_what_is_no_cable_is_refused():
    for cables, words in (
        ([(0, 1, 1, 2)], "has a segment of length 0 m"),
        ([(0,)], "must run from one node to another"),
        ([(0, 7)], "node of a cable 7 must be below 4"),
        (3, "cables 3 must list the nodes of each"),
    ):
        with pytest.raises(TensegrityError, match=words):
            Structure(SQUARE, bars=BARS, cables=cables)
    same = [*SQUARE[:3], SQUARE[2]]
    with pytest.raises(TensegrityError, match="two pulleys run together: nodes 2 and 3 of cable 1"):
        Structure(same, bars=[(0, 2)], cables=[(0, 1, 2, 3, 0)])
    s = double_bar()
    with pytest.raises(
        TensegrityError, match=r"string_mass 0\.3: there are no strings: cables over"
    ):
        Structure([(0, 0), (4, 0), (2, -1)], cables=[(0, 2, 1)], string_mass=0.3)
    assert "1 cable" in repr(s)
    assert s.name_of(4) == "cable 4"
    assert (s.bars, s.strings, len(s.cables)) == (2, 2, 1)
    s.plot()


T = sp.Symbol("t")
START, WEIGHT = (2.0, -2.0), 50.0


def swing(scale=1.0, natural=6.0, other=(0, 2, 1), **given):
    """A weight on a pulley that is let go, between fixed nodes at different heights."""
    at = scale * np.array([(0, 0), (4, 1), START])
    stiff = {"EA_string": 2000.0} | given
    return Structure(at, cables=[other], natural_lengths=[scale * natural], mass=5.0, **stiff)


def let_go(s, t_end=2.0, natural_lengths=None, scale=1.0, **method):
    lengths = {} if natural_lengths is None else {"natural_lengths": {0: natural_lengths}}
    scene = s.network(held=[0, 1], gravity=WEIGHT / 5.0, **lengths)
    return simulate(scene, scene.at_rest(), t_end * scale**0.5, **method)


def test_a_weight_on_a_pulley_swings_as_the_reference():
    """MuJoCo and an integrator restarted at each of 5 kinks agree to 3e-10 m; steps are corrected
    where the cable slackens and tightens, so that few do."""
    run = let_go(swing(), tol=1e-8)
    at, velocity = np.add(START, run.final.u[2]), run.final.v[2]
    assert at == pytest.approx([1.2714650997746673, -1.3858546720654923], abs=1e-11)
    assert velocity == pytest.approx([0.19339119778204492, 0.4852938037091139], abs=1e-10)
    assert np.ptp(run.energy) < 1e-9
    assert run.steps < 3000
    slack = run.scene.bond_tension(run.u)
    assert np.array_equal(slack[:, 0], slack[:, 1])
    assert (slack == 0).any()


@pytest.mark.parametrize("scale", [1e-6, 100.0])
def test_the_unit_of_length_changes_nothing_in_motion(scale):
    one, other = (let_go(swing(x), scale=x, dt=1e-3 * x**0.5, method="rkn6") for x in (1.0, scale))
    np.testing.assert_allclose(other.u / scale, one.u, atol=1e-9)


def test_the_direction_and_the_frame_of_a_cable_change_nothing(rng):
    one, back = (
        let_go(swing(other=way), dt=1e-3, method="verlet") for way in ((0, 2, 1), (1, 2, 0))
    )
    np.testing.assert_allclose(back.u, one.u, atol=1e-11)
    s = tackle(rng)
    frame = Frame.of(s, rng)
    there = Structure(
        frame.vectors(s.positions) + frame.shift / frame.size,
        bars=frame.nodes(s.ends[: s.bars]),
        cables=[frame.nodes(s.cables[0])],
        EA_bar=50.0,
        EA_string=2.0,
        natural_lengths=s.natural_lengths,
    )
    runs = [simulate(x.network(), x.network().at_rest(), 0.5, dt=0.001) for x in (s, there)]
    np.testing.assert_allclose(runs[1].u, frame.vectors(runs[0].u), atol=1e-9)
    assert np.ptp(runs[0].energy) < 1e-4 * runs[0].energy[0]


def by_hand(segments, mass, natural, axial, keeps_EA=True):
    """Rates of one free body of a cable, of which it is an end of each of these segments, with the
    work of the winch; the equations written down once more."""
    ends, rest = np.array(segments, dtype=float), natural(0.0)
    slope = natural.derivative

    def rates(t, y):
        d = ends - y[:2]
        lengths = np.linalg.norm(d, axis=1)
        k = axial / (natural(t) if keeps_EA else rest)
        pull = max(k * (lengths.sum() - natural(t)), 0.0)
        a = pull / mass * (d / lengths[:, None]).sum(axis=0) - [0, WEIGHT / 5.0]
        more = pull**2 / (2 * axial) if keeps_EA else 0.0
        return [*y[2:4], *a, -(pull + more) * slope(t)]

    return rates


class Wound:
    """6.32 - 0.1 t - 0.05 sin 2 t [m]."""

    expression = sp.Float(6.32) - 0.1 * T - 0.05 * sp.sin(2 * T)

    def __call__(self, t):
        return 6.32 - 0.1 * t - 0.05 * np.sin(2 * t)

    def derivative(self, t):
        return -0.1 - 0.1 * np.cos(2 * t)


@pytest.mark.parametrize("keeps", ["EA", "k"])
def test_a_cable_over_a_pulley_is_wound_and_its_winch_does_the_work(keeps):
    natural, t_end = Wound(), 0.3  # taut throughout
    stiff = {} if keeps == "EA" else {"EA_string": None, "k_string": 2000 / natural(0)}
    s = swing(natural=natural(0), **stiff)
    run = let_go(s, t_end, natural.expression, dt=5e-4, method="rkn6")
    rates = by_hand([(0, 0), (4, 1)], 5.0, natural, 2000.0, keeps == "EA")
    exact = solve_ivp(rates, (0, t_end), [*START, 0, 0, 0], "DOP853", rtol=1e-12, atol=1e-13).y.T[
        -1
    ]
    assert np.add(START, run.final.u[2]) == pytest.approx(exact[:2], abs=1e-9)
    assert run.work[-1] == pytest.approx(exact[4], abs=1e-8)
    assert run.energy[-1] - run.energy[0] == pytest.approx(run.work[-1], abs=1e-8)


def test_a_tackle_of_several_falls_moves_as_its_equations():
    """A block that hangs in four falls of one cable between fixed sheaves."""
    x = [(0, 0), (1, 0), (2.5, 0.3), (1.2, -2.0)]
    falls = [(0, 0), (1, 0), (1, 0), (2.5, 0.3)]
    natural = 0.993 * sum(np.linalg.norm(np.subtract(a, x[3])) for a in falls)
    s = Structure(x, cables=[(0, 3, 1, 3, 2)], EA_string=900.0, natural_lengths=[natural], mass=2.0)
    scene = s.network(held=[0, 1, 2], gravity=WEIGHT / 5.0)
    run = simulate(scene, scene.at_rest(), 0.4, dt=2e-4, method="rkn6")

    class Length:
        def __call__(self, t):
            return natural

        def derivative(self, t):
            return 0.0

    rates = by_hand(falls, 2.0, Length(), 900.0)
    exact = solve_ivp(rates, (0, 0.4), [*x[3], 0, 0, 0], "DOP853", rtol=1e-12, atol=1e-13).y.T[-1]
    assert (run.scene.bond_tension(run.u) > 0).all()
    assert x[3] + run.final.u[3] == pytest.approx(exact[:2], abs=1e-10)


@pytest.mark.parametrize("bar_mass", [None, 3.0])
def test_corrected_steps_keep_their_order_where_a_cable_of_several_falls_slackens(bar_mass):
    """Of a block with a bar, in four falls that share its node and a sheave."""
    x = [(0, 0), (1, 0), (2.5, 0.3), (1.2, -2.0), (1.9, -2.6)]
    falls = [(0, 0), (1, 0), (1, 0), (2.5, 0.3)]
    natural = sum(np.linalg.norm(np.subtract(a, x[3])) for a in falls)
    given = {} if bar_mass is None else {"bar_mass": bar_mass}
    lengths, k = [np.hypot(0.7, 0.6), natural], {"k_bar": 4e3, "EA_string": 900.0, "mass": 2.0}
    s = Structure(x, bars=[(3, 4)], cables=[(0, 3, 1, 3, 2)], natural_lengths=lengths, **k, **given)
    scene = s.network(held=[0, 1, 2], gravity=9.81)
    start = scene.at_rest({3: (0.3, 0.9), 4: (0.1, 0.5)})

    def ends(method, *steps):
        return [simulate(scene, start, 1.0, dt=1 / n, method=method) for n in steps]

    *runs, exact = ends("corrected6", 250, 1000, 16000)
    (plain,) = ends("rkn6", 1000)
    coarse, fine, other = (np.abs(r.final.u - exact.final.u).max() for r in (*runs, plain))
    assert fine < 5e-11
    assert fine < coarse / 4**3
    assert other > 100 * fine
    taut = scene.bond_tension(exact.u)[:, -1] > 0
    assert np.count_nonzero(np.diff(taut)) == 3


PAIR = [(0, 0), (4, 0), (1.5, -2), (2.5, -2)]  # two free pulleys, which the cable pulls together


@pytest.mark.parametrize("changes", [False, True])
def test_free_pulleys_that_meet_are_named(changes):
    s = Structure(PAIR, cables=[(0, 2, 3, 1)], EA_string=500.0, natural_lengths=[6.0])
    lengths = {"natural_lengths": {0: 6 - T / 10}} if changes else {}
    scene = s.network(held=[0, 1], gravity=9.81, **lengths)
    with pytest.raises(StabilityError, match="two pulleys run together, sites 2 and 3 of a cable"):
        simulate(scene, scene.at_rest(), 2.0, dt=1e-3)


def test_free_pulleys_pass_each_other_where_steps_resolve_it():
    """They pass at .9 mm: the pull between them has a direction throughout."""
    s = Structure(PAIR, cables=[(0, 2, 3, 1)], EA_string=500.0, natural_lengths=[6.0])
    scene = s.network(held=[0, 1], gravity=9.81)
    start = scene.at_rest({2: (0, 0.02), 3: (0, -0.02)})
    with pytest.raises(StabilityError, match="turns by more than a right angle within a step"):
        simulate(scene, start, 0.6, dt=1e-3)
    every = Record(every=1)
    fine, finer = (simulate(scene, start, 0.6, dt=dt, record=every) for dt in (1e-4, 2.5e-5))
    distance = np.linalg.norm(
        np.diff(PAIR[2:], axis=0)[0] + np.diff(finer.u[:, 2:], axis=1)[:, 0], axis=1
    )
    assert 8e-4 < distance.min() < 1e-3
    assert np.ptp(finer.energy) < np.ptp(fine.energy) / 12
    assert np.ptp(fine.energy) < 2e-4


def test_networks_of_cables_are_stored_and_refuse_what_acts_on_single_bonds(tmp_path):
    run = let_go(swing(), dt=1e-3, method="verlet")
    for copy in (pickle.loads(pickle.dumps(run.scene)), run.scene):
        assert copy == run.scene
        assert np.array_equal(simulate(copy, copy.at_rest(), 2.0, dt=1e-3).u, run.u)
    path = tmp_path / "run.npz"
    run.save(path)
    assert type(run).load(path).scene == run.scene
    x, bonds = run.scene.positions, run.scene.bonds
    for given, words in (
        ({"cables": [(0, 7)]}, "bond of a cable 7 must be below 2"),
        ({"cables": [(0, 0)]}, "must have bonds that differ"),
        ({"cables": 3}, "cables 3"),
        ({"cables": [(0, 1)], "damping": Damping(bond=1.0)}, "bond 0 is a segment of a cable"),
        ({"cables": [(0, 1)], "forces": [Force(sp.Symbol("rate"), "bonds", [1])]}, "bond 1 is a"),
    ):
        with pytest.raises(TensegrityError, match=words):
            Network(x, bonds, PowerLaw(1.0, 1.5), **given)
    with pytest.raises(TensegrityError, match="not for cables over sites"):
        simulate(run.scene, run.scene.at_rest(), 0.1, dt=1e-3, method="midpoint")
    with pytest.raises(TensegrityError, match="tangent stiffness of a network: not for cables"):
        run.scene.stiffness(run.u[0])


@pytest.mark.parametrize("dim", [2, 3])
def test_the_nearest_form_of_a_cable_is_no_farther_than_those_found_from_around(dim, rng):
    """Of the cross whose strings are two cables over its nodes."""
    square = np.pad(np.array(SQUARE, dtype=float), [(0, 0), (0, dim - 2)])

    def made(x):
        return Structure(x, bars=BARS, cables=[(0, 1, 2), (2, 3, 0)])

    given = square + 0.02 * rng.normal(size=square.shape)
    assert not len(made(given).self_stress().states)
    near = made(given).nearest_form()
    assert len(near.self_stress().states) == 1
    distance = np.linalg.norm(near.positions - given)
    assert 1e-3 < distance < 0.1
    for _ in range(4):
        other = made(given + 0.3 * distance * rng.normal(size=given.shape)).nearest_form()
        assert np.linalg.norm(other.positions - given) > distance
