"""Paths on which natural lengths change, with and without loads that stay."""

import warnings

import numpy as np
import pytest
from scipy.interpolate import CubicSpline

from tensegrity import (
    EquilibriumError,
    Prism,
    Structure,
    TensegrityError,
    control_path,
    equilibrium,
    held,
)

PRISM = Prism(1.0, 1.0, 0.1, 1.0, 5.0, 50.0)
GROUND = held([0, 1])


def test_control_path_draws_in_cross_strings_and_meets_the_prism_of_those_members():
    s = PRISM.structure()
    rest = PRISM.natural_lengths()
    path = control_path(s, {m: 0.9 * rest.cross for m in (3, 4, 5)})
    other = Prism.from_members(0.9 * rest.cross, rest.base, rest.bar, 1.0, 5.0, 50.0)
    heights = path.positions[-1][:, 2]
    assert np.ptp(heights) == pytest.approx(other.height, rel=1e-11)
    assert path.control[-1] == 1
    assert path.stable_load.all()
    stored = other.structure()
    gained = stored.members.energy(stored.positions) - s.members.energy(s.positions)
    assert path.work[-1] == pytest.approx(gained, rel=1e-10)


def arch(height, load, k=10.0):
    """Two bars from the ground to an apex on which a weight rests; natural length from its
    equilibrium, (1 + load/(2 k y)) times the length at the height y."""
    length = np.hypot(1, height)
    natural = length * (1 + load / (2 * k * height))
    nodes = [[-1, 0], [1, 0], [0, height]]
    return Structure(nodes, bars=[(0, 2), (1, 2)], k_bar=k, natural_lengths=[natural] * 2)


def test_weight_on_an_arch_of_shrinking_bars_snaps_at_the_fold_of_its_closed_form():
    """The natural length at the height y is least where y^3 = load/(2 k)."""
    s, load = arch(0.6, 1.0), {2: (0, -1.0)}
    shorter = 0.95 * s.natural_lengths[0]
    path = control_path(s, {0: shorter, 1: shorter}, GROUND, loads=load)
    (fold,) = path.events
    level = 0.05 ** (1 / 3)
    least = (1 + level**2) ** 1.5
    control = (s.natural_lengths[0] - least) / (s.natural_lengths[0] - shorter)
    assert fold.kind == "fold"
    assert fold.control == pytest.approx(control, rel=1e-9)
    assert path.end == "back at the natural lengths of the start"
    heights = path.positions[:, 2, 1]
    assert (path.stable_load == (heights > level)).all()
    natural = s.natural_lengths[0] + path.control * (shorter - s.natural_lengths[0])
    assert natural == pytest.approx(np.hypot(1, heights) * (1 + 0.05 / heights), rel=1e-11)


@pytest.mark.parametrize("branch", ["symmetric", "stable"])
def test_weight_on_an_arch_of_growing_bars_falls_sideways_at_the_pitchfork(branch):
    """Its stiffness sideways vanishes where y = 2 k/load; no branch beyond is stable."""
    s, load = arch(1.5, 10.0), {2: (0, -10.0)}
    longer = arch(2.5, 10.0).natural_lengths[0]
    path = control_path(s, {0: longer, 1: longer}, GROUND, branch, load)
    (pitchfork,) = path.events
    control = (arch(2.0, 10.0).natural_lengths[0] - s.natural_lengths[0]) / (
        longer - s.natural_lengths[0]
    )
    assert pitchfork.kind == "bifurcation"
    assert pitchfork.control == pytest.approx(control, rel=1e-9)
    assert ("snaps" in path.end) == (branch == "stable")
    assert path.control[-1] == pytest.approx(control if branch == "stable" else 1, rel=1e-9)


def guyed(weight):
    """Two upright bars between held ends, their joint guyed by two taut strings, and its load."""
    nodes = [[0, 0], [0, 2], [0, 1], [-1, 1], [1, 1]]
    s = Structure(nodes, bars=[(0, 2), (2, 1)], strings=[(2, 3), (2, 4)], k_bar=10.0,
                  natural_lengths=[1, 1, 0.8, 0.8])  # fmt: skip
    supports, loads = held([0, 1, 3, 4]), {2: (0, -weight)}
    path = control_path(equilibrium(s, loads, supports).structure, {0: 1.2, 1: 1.2}, supports,
                        loads=loads)  # fmt: skip
    return s, supports, loads, path


def test_growing_bars_bow_then_snap_at_a_slack_corner_of_their_closed_form():
    """At the joint's displacement x: 2 k (l_N/l - 1) x is what the guys pull, one slack at 0.2."""
    *_, path = guyed(0.0)
    pitchfork, corner, fold = path.events
    assert [e.kind for e in path.events] == ["bifurcation", "slack", "fold"]
    assert "the path reverses its sense" in corner.note
    assert pitchfork.control == pytest.approx(0.5, rel=1e-9)
    assert corner.control == pytest.approx((1.1 * np.hypot(1, 0.2) - 1) / 0.2, rel=1e-10)
    x = (0.01 / 1.05) ** (1 / 3)  # where l_N(x) is least with one guy
    least = np.hypot(1, x) * (1.05 + 0.01 / x)
    assert fold.control == pytest.approx((least - 1) / 0.2, rel=1e-9)
    between = np.arange(len(path))[corner.row + 1 : fold.row]
    assert not path.stable_load[between].any()
    assert path.stable_load[: corner.row].all()
    assert path.stable_load[fold.row + 2 :].all()


@pytest.mark.parametrize("weight", [0.0, 2.0])
def test_growing_bars_bow_to_where_the_weight_on_them_rests(weight):
    s, supports, loads, path = guyed(weight)
    pushed = s.positions + 0.1 * np.outer(np.arange(5) == 2, (1, 0))
    found = equilibrium(s.at(pushed, natural_lengths=[1.2, 1.2, 0.8, 0.8]), loads, supports)
    bowed = path.positions[-1, 2]
    assert np.abs(bowed) == pytest.approx(np.abs(found.positions[2]), rel=1e-9)
    assert path.end == "the requested natural lengths are reached"


def test_work_of_control_is_what_the_strings_do_as_they_are_drawn_in():
    """Minus the integral of tension over natural length: weight that rises is paid too."""
    s = Structure([[-1, 0], [1, 0], [0, -1.0]], strings=[(0, 2), (1, 2)], k_string=3.0)
    weight = {2: (0, -1.0)}
    hung = equilibrium(s, weight, GROUND).structure
    path = control_path(hung, {0: 1.1, 1: 1.1}, GROUND, loads=weight)
    rows = np.arange(len(path))
    drawn = (2**0.5 - 1.1) * path.tensions.sum(axis=1)
    done = CubicSpline(rows, drawn * CubicSpline(rows, path.control)(rows, 1)).integrate(
        0, rows[-1]
    )
    assert path.work[-1] == pytest.approx(done, rel=1e-4)
    raised = path.positions[-1, 2, 1] - path.positions[0, 2, 1]
    stored = s.at(path.positions[-1], natural_lengths=[1.1] * 2).members
    gained = stored.energy(path.positions[-1]) - hung.members.energy(hung.positions)
    assert raised > 0.2
    assert path.work[-1] == pytest.approx(gained + raised, rel=1e-10)


def test_structure_that_its_loads_do_not_leave_at_rest_is_refused():
    s = arch(0.6, 1.0)
    with pytest.raises(EquilibriumError, match="not in equilibrium: 1 N are unbalanced"):
        control_path(s, {0: 1.0}, GROUND)
    with pytest.raises(TensegrityError, match="loaded node 3 must be below 3"):
        control_path(s, {0: 1.0}, GROUND, loads={3: (0, -1.0)})
    with pytest.raises(EquilibriumError, match="do work"):
        control_path(s, {0: 1.0}, held([0]), loads={2: (0, -1.0)})


def test_paths_along_which_nothing_or_anything_may_move_are_refused():
    slack = Structure([[0, 0], [2, 0], [1, 0]], strings=[(0, 2), (1, 2)], natural_lengths=[1.5] * 2)
    with pytest.raises(EquilibriumError, match="without stiffness at the start"):
        control_path(slack, {0: 1.6}, GROUND)
    with pytest.raises(EquilibriumError, match="permit no motion"):
        control_path(arch(0.6, 1.0), {0: 1.0}, held([0, 1, 2]))


def test_a_path_that_loses_its_stiffness_with_its_strings_ends_where_they_go_slack():
    line = [[0, 0], [2, 0], [1, 0]]
    s = Structure(line, strings=[(0, 2), (1, 2)], natural_lengths=[0.9, 0.9])
    path = control_path(s, {0: 1.3}, GROUND)
    assert "no unique one" in path.end
    assert path.control[-1] == pytest.approx(0.5, abs=1e-9)
    assert [e.note for e in path.events] == ["strings 0, 1 slack"]


def test_a_string_that_a_path_met_goes_slack_however_near_it_was_located():
    nodes = [[-1, 0], [1, 0], [0, 0.6], [0, 2]]
    frame, ground = {"bars": [(0, 2), (1, 2)], "strings": [(3, 2)]}, held([0, 1, 3])
    lengths = [1.166, 1.166, 1.3]
    s = equilibrium(Structure(nodes, **frame, natural_lengths=lengths), supports=ground).structure
    path = control_path(s, {0: 1.4, 1: 1.4}, ground)
    assert [e.note for e in path.events] == ["string 2 slack"]
    assert path.tensions[-1, 2] == 0


def test_searches_for_events_that_run_off_are_silent():
    nodes = [[0, 0, 0], [2, 0, 0], [1, 1.5, 0], [1, 0.5, 0.6]]
    bars = [(0, 1), (1, 2), (2, 0), (0, 3), (1, 3), (2, 3)]
    s = Structure(nodes, bars=bars, k_bar=[10, 20, 5, 3, 1, 7])
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        path = control_path(s, {3: 3.0})
    assert path.end == "two bars meet"


def test_a_winch_keeps_the_spring_constant_and_says_so():
    """In series with a spring, in closed form: T = k (span - x - 1), x = b (1 + T/EA)."""
    supports = held([0, 2]) + held([1], axes=[1])
    for k, tension in ((1000 / 1.25, 96.0), (1000 / 0.9, 200 * 0.6 / (1 + 200 * 0.9 / 1000))):
        s = Structure([(0, 0), (1.3, 0), (2.5, 0)], bars=[(1, 2)], strings=[(0, 1)], k_bar=200.0,
                      k_string=k, natural_lengths=[1.0, 1.25])  # fmt: skip
        path = control_path(equilibrium(s, None, supports).structure, {1: 0.9}, supports)
        assert path.tensions[-1] == pytest.approx(tension, rel=1e-12)
        assert "spring constants k are kept" in str(path)
