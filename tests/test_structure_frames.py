"""Strings at their natural length: one rule for all, and nothing depends on frame or round-off."""

import numpy as np
import pytest
from hypothesis import example, given, settings
from hypothesis import strategies as st
from structures import Frame, icosahedron, with_strings_at_rest

from tensegrity import (
    EquilibriumError,
    Prism,
    State,
    Structure,
    equilibrium,
    equilibrium_path,
    held,
    modes,
    plates,
    simulate,
)
from tensegrity.springs.kinks import TAUT

SEEDS = st.integers(0, 2**32 - 1)
many = settings(max_examples=60, deadline=None)


def pair(seed):
    """A structure with strings at rest, the same in another frame, the frame, and a generator."""
    s, rng = with_strings_at_rest(seed), np.random.default_rng(seed)
    frame = Frame.of(s, rng)
    return s, frame.structure(s), frame, rng


def squares(frequencies):
    """Signed, over the largest: what is right to round-off."""
    return np.sign(frequencies) * (frequencies / np.abs(frequencies).max(initial=1e-300)) ** 2


def moved(s, rng):
    return s.positions + 0.1 * rng.normal(size=s.positions.shape)


def there_of(frame, x, moved=True):
    return frame.size * frame.vectors(x) + moved * frame.shift


def supported(s, frame, rng):
    """Some nodes held, or plates, in either frame."""
    nodes = rng.permutation(s.nodes)[: s.dim + 1].tolist()
    there = frame.nodes(nodes).tolist()
    if rng.random() < 0.5:
        return held(nodes[:-1]), held(there[:-1])
    across = rng.normal(size=s.dim)
    return tuple(
        plates(n[:1], n[1:], normal=v) for n, v in ((nodes, across), (there, frame.turn @ across))
    )


@many
@given(SEEDS)
def test_forces_and_energy_are_the_same_in_any_frame(seed):
    s, other, frame, rng = pair(seed)
    for here, there in ((s, other), (s.at(x := moved(s, rng)), other.at(there_of(frame, x)))):
        force, near = frame.size * here.stiffnesses.max(), {"rel": 1e-9}
        assert (here.slack == there.slack).all()
        assert there.lengths == pytest.approx(frame.size * here.lengths, rel=1e-12)
        assert there.tensions == pytest.approx(frame.size * here.tensions, abs=1e-12 * force)
        assert there.densities == pytest.approx(here.densities, abs=1e-11 * force / frame.size)
        energy = [one.members.energy(one.positions) for one in (here, there)]
        assert energy[1] == pytest.approx(frame.size**2 * energy[0], abs=1e-20 * force**2, **near)
        pulls = [one.members.gradient(one.positions) for one in (here, there)]
        assert there_of(frame, pulls[0], moved=False) == pytest.approx(pulls[1], abs=1e-11 * force)


@many
@given(SEEDS)
def test_stiffness_modes_and_stability_are_the_same_in_any_frame(seed):
    s, other, frame, rng = pair(seed)
    stiffest = s.stiffnesses.max()
    for _ in range(3):
        v = rng.normal(size=s.positions.shape)
        pulls = (s.stiffness() @ v.ravel()).reshape(v.shape)
        there = (other.stiffness() @ frame.vectors(v).ravel()).reshape(v.shape)
        assert frame.vectors(pulls) == pytest.approx(there, abs=1e-10 * stiffest)
    for supports in ((None, None), supported(s, frame, rng), supported(s, frame, rng)):
        here, there = (one.modes(99, x) for one, x in zip((s, other), supports, strict=True))
        assert there.eigenvalues == pytest.approx(here.eigenvalues, abs=1e-11 * stiffest)
        assert squares(there.frequencies) == pytest.approx(squares(here.frequencies), abs=1e-11)
        assert s.is_stable(supports[0]) == other.is_stable(supports[1])


def span(rows):
    """The projection on what rows span."""
    rows = rows.reshape(len(rows), int(np.prod(rows.shape[1:])))
    return rows.T @ rows


@many
@given(SEEDS)
def test_self_stress_mechanisms_and_prestress_are_the_same_in_any_frame(seed):
    s, other, frame, _ = pair(seed)
    here, there = s.self_stress(), other.self_stress()
    sizes = here.singular_values
    assert there.singular_values / frame.size == pytest.approx(sizes, abs=1e-12 * sizes[0])
    assert span(there.states) == pytest.approx(span(here.states), abs=1e-8)
    free = [frame.vectors(s.mechanisms()), other.mechanisms()]
    assert span(free[1]) == pytest.approx(span(free[0]), abs=1e-8)
    try:
        q = here.feasible
    except EquilibriumError as error:
        with pytest.raises(EquilibriumError, match=str(error)[:12]):
            _ = there.feasible
        return
    weakest = [np.min(np.abs(x)) for x in (q, there.feasible)]
    assert weakest[1] == pytest.approx(weakest[0], abs=1e-8)
    factor = 0.1 * s.stiffnesses.min() / np.abs(q).max()
    stressed = [one.prestressed(force_densities=factor * q) for one in (s, other)]
    assert stressed[1].natural_lengths == pytest.approx(
        frame.size * stressed[0].natural_lengths, rel=1e-12
    )
    assert stressed[0].is_stable() == stressed[1].is_stable()


@many
@given(SEEDS)
def test_stable_equilibria_are_the_same_in_any_frame(seed):
    s, other, frame, rng = pair(seed)
    supports = supported(s, frame, rng)
    node, load = int(rng.integers(s.nodes)), 0.01 * rng.normal(size=s.dim)
    found = []
    for one, at, force, x in (
        (s, node, load, supports[0]),
        (other, int(frame.nodes(node)), frame.size * frame.turn @ load, supports[1]),
    ):
        try:
            found.append(equilibrium(one, {at: force}, x))
        except EquilibriumError:
            found.append(None)
    if None in found or not (found[0].stable and found[1].stable):
        return
    here, there = found
    size = frame.size * np.ptp(s.positions)
    assert there.positions == pytest.approx(there_of(frame, here.positions), abs=1e-8 * size)
    assert (there.slack == here.slack).all()


@settings(max_examples=20, deadline=None)
@given(SEEDS.filter(lambda seed: seed % 2))  # under prestress
def test_relaxed_shapes_are_the_same_in_any_frame(seed):
    s, other, frame, rng = pair(seed)
    x = s.positions + 0.02 * rng.normal(size=s.positions.shape)
    here, there = s.at(x).relaxed(), other.at(there_of(frame, x)).relaxed()
    assert there.lengths == pytest.approx(frame.size * here.lengths, rel=1e-8)
    assert (there.slack == here.slack).all()


@settings(max_examples=20, deadline=None)
@given(SEEDS)
def test_nearest_forms_are_the_same_in_any_frame(seed):
    rng = np.random.default_rng(seed)
    exact = icosahedron() if seed % 2 else Prism(1.0, 0.7, 0.1, 1.0, 5.0, 50.0).structure()
    s = exact.at(exact.positions + 0.01 * rng.normal(size=exact.positions.shape))
    frame = Frame.of(s, rng)
    here, there = s.nearest_form(), frame.structure(s).nearest_form()
    near = 1e-9 * frame.size
    assert there.positions == pytest.approx(there_of(frame, here.positions), abs=near)


@settings(max_examples=8, deadline=None)
@given(st.integers(0, 2**30).map(lambda k: 4 * k + 3))
def test_paths_of_an_icosahedron_with_strings_at_rest_are_the_same_in_any_frame(seed):
    s, other, frame, _ = pair(seed)
    triangles = np.array([[0, 4, 8], [3, 7, 11]])
    axis = np.subtract(*(s.positions[list(t)].mean(axis=0) for t in triangles[::-1]))
    here = equilibrium_path(s, supports=plates(*triangles, normal=axis), max_shortening=0.3)
    there = equilibrium_path(
        other,
        supports=plates(*frame.nodes(triangles), normal=frame.turn @ axis),
        max_shortening=0.3 * frame.size,
    )
    assert [e.kind for e in there.events] == [e.kind for e in here.events]
    assert there.load[-1] / frame.size == pytest.approx(here.load[-1], rel=1e-9)
    assert (there.slack[-1] == here.slack[-1]).all()


@many
@given(SEEDS)
def test_modes_of_a_structure_are_those_of_its_network(seed):
    s = with_strings_at_rest(seed)
    own, scene = s.modes(99).frequencies, modes(s.network(), count=99).frequencies
    rigid = np.zeros(len(scene) - len(own))
    assert squares(np.sort([*rigid, *own])) == pytest.approx(squares(scene), abs=1e-13)
    assert np.sum(scene == 0) == len(rigid) + np.sum(own == 0)


@many
@given(SEEDS)
def test_natural_lengths_by_another_route_change_nothing(seed):
    s, rng = with_strings_at_rest(seed), np.random.default_rng(seed)
    route = s.natural_lengths * (1 + 1e-15 * rng.uniform(-1, 1, len(s.ends)))
    other = s.at(s.positions, natural_lengths=route)
    assert (other.slack == s.slack).all()
    assert other.is_stable() == s.is_stable()
    own, there = (one.modes(99).frequencies for one in (s, other))
    assert squares(there) == pytest.approx(squares(own), abs=1e-13)


@settings(max_examples=8, deadline=None)
@given(SEEDS)
def test_motion_is_the_same_in_any_frame(seed):
    s, other, frame, rng = pair(seed)
    u, v = 0.01 * rng.normal(size=(2, *s.positions.shape))
    here, there = s.network(), other.network()
    runs = [
        simulate(here, State(u, v), 2.0, tol=1e-8),
        simulate(there, State(*(frame.size * frame.vectors(x) for x in (u, v))), 2.0, tol=1e-8),
    ]
    ends = [run.final.u for run in runs]
    assert frame.vectors(ends[0]) == pytest.approx(ends[1] / frame.size, abs=1e-7)


@settings(max_examples=20, deadline=None)
@given(SEEDS)
@example(1487)  # round-off above the natural length of a string that goes slack
@example(24)  # below that of one that stays taut
def test_default_steps_are_the_same_in_any_frame(seed):
    s, other, frame, rng = pair(seed)
    rest, velocity = np.zeros(s.positions.shape), 0.01 * rng.normal(size=s.dim)
    struck = np.outer(np.arange(s.nodes) == 0, velocity)
    here = simulate(s.network(), State(rest, struck), 2.0)
    there = simulate(other.network(), State(rest, frame.size * frame.vectors(struck)), 2.0)
    assert there.steps == here.steps


@pytest.mark.parametrize(("shorter", "taut"), [(0.9, True), (1.1, False)])
def test_a_string_shorter_by_less_than_the_tolerance_counts_as_taut_everywhere(shorter, taut):
    """Two strings in a row, and one across them that alone holds their joint sideways."""
    nodes, held_nodes = [[0, 0], [2, 0], [1, 0], [1, 3]], held([0, 1, 3])
    lengths = np.array([1, 1, 3 * (1 + shorter * TAUT)])
    s = Structure(nodes, strings=[(0, 2), (1, 2), (3, 2)], natural_lengths=lengths)
    assert s.slack.tolist() == [False, False, not taut]
    assert not s.tensions.any()
    assert s.is_stable(held_nodes) == taut
    assert s.modes(2, held_nodes).frequencies[0] == pytest.approx(float(taut))
    assert s.network().stiffness(np.zeros((4, 2)))[5, 5] == pytest.approx(float(taut))


def test_equilibria_that_leave_a_node_loose_are_the_same_however_strings_at_rest_are_rounded():
    """Node 4 is between strings that the load slackens: any place within their reach would do."""
    nodes = np.array([[0, 0], [0, 1], [3.1, 0.2], [1, 0.3], [2.2, 0.47]])
    bars, strings = [(0, 3), (1, 3)], [(3, 4), (4, 2)]
    s, found = Structure(nodes, bars=bars, strings=strings), []
    for angle in range(40):
        c, sine = np.cos(angle), np.sin(angle)
        turn = np.array([[c, -sine], [sine, c]])
        load = {3: turn @ (0.5, 0.1)}
        found.append(equilibrium(s.at(nodes @ turn.T), load, held([0, 1, 2])).positions @ turn)
    assert np.ptp(found, axis=0).max() < 1e-9


def test_equilibria_with_a_string_hardly_slack_are_right_to_round_off():
    """A weight on two strings, and above it a stiff one that is shorter by less than `TAUT`."""
    nodes, load, ground = [[-1, 0], [1, 0], [0, 0.5], [0, -1]], {3: (0, -1.0)}, held([0, 1, 2])
    strings, k = [(0, 3), (1, 3), (2, 3)], [1, 1, 1e4]
    s = Structure(nodes, strings=strings, k_string=k, natural_lengths=[1, 1, 3])
    hung = equilibrium(s, load, ground).structure
    natural = [1, 1, hung.lengths[2] * (1 + 0.5 * TAUT)]
    off = hung.positions + np.outer(np.arange(4) == 3, (1e-11, 1e-11))
    state = equilibrium(hung.at(off, natural_lengths=natural), load, ground)
    assert np.abs(state.reactions[3]).max() < 1e-12
    assert state.tensions[2] == 0
    assert not state.slack[2]


def test_forces_know_no_tolerance():
    """A string pulls by all it is longer, and not at all where it is shorter, to the last bit."""
    for natural, k in ((1 - 2**-53, 3.0), (1 + 2**-52, 3.0), (1 - 1e-13, 3.0), (1 + 1e-13, 3.0)):
        s = Structure([[0, 0], [1, 0]], strings=[(0, 1)], k_string=k, natural_lengths=[natural])
        assert s.tensions[0] == k * max(1 - natural, 0)
        assert s.network().bond_tension(np.zeros((2, 2)))[0] == s.tensions[0]
