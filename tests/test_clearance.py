"""Contacts that are not in a network's list: noticed whenever they form."""

import numpy as np
import pytest
from networks import fork

from tensegrity import (
    ContactError,
    Network,
    PowerLaw,
    Record,
    State,
    TensegrityError,
    Wall,
    simulate,
)

SPRING = PowerLaw(1e3, 1.5)
FEW = Record(every=10**6)


def flying(angle=0.0, speed=1.0):
    """A bead that flies past a resting one, 3 m away."""
    network = Network([[0.0, 0.0], [3.0, 0.0]], [], SPRING, radius=0.5)
    velocity = speed * np.array([np.cos(angle), np.sin(angle)])
    return network, network.at_rest({0: velocity})


def test_an_unlisted_contact_is_noticed_in_the_step_in_which_it_forms():
    network, state = flying()
    with pytest.raises(ContactError, match="sites 0 and 1") as caught:
        simulate(network, state, 20.0, dt=1e-3, record=FEW)
    assert 2.0 - 1e-9 <= caught.value.run.t[-1] + 1e-3 <= 2.0 + 2e-3


@pytest.mark.parametrize("gap", [0.2, 0.6, 1.0, 1.3, 2.0])
def test_beads_that_move_towards_each_other_are_noticed_in_that_step(gap):
    """Both use up the gap, on the diagonal, where bounds of coordinates bound the way best."""
    along = np.array([1.0, 1.0]) / np.sqrt(2)
    network = Network([[0.0, 0.0], (1 + gap) * along], [], SPRING, radius=0.5)
    with pytest.raises(ContactError, match="sites 0 and 1") as caught:
        simulate(network, network.at_rest({0: along, 1: -along}), 10.0, dt=1e-3, record=FEW)
    assert gap / 2 - 1e-9 <= caught.value.run.t[-1] + 1e-3 <= gap / 2 + 2e-3


def test_a_graze_between_two_records_is_noticed():
    """Closest approach 0.9999 of the contact distance, for a moment in a long run."""
    network, state = flying(np.arcsin(0.9999 / 3))
    with pytest.raises(ContactError, match="overlap by"):
        simulate(network, state, 200.0, dt=1e-3, record=FEW)


def test_a_near_miss_is_none():
    network, state = flying(np.arcsin(1.0001 / 3))
    run = simulate(network, state, 20.0, dt=1e-3, record=FEW)
    assert run.steps == 20_000


def test_a_bead_far_away_is_found_when_it_comes():
    """Beyond the first list of neighbours: the list is made anew on the way."""
    network = Network([[0.0, 0.0], [30.0, 0.0]], [], SPRING, radius=0.5)
    with pytest.raises(ContactError, match="sites 0 and 1") as caught:
        simulate(network, network.at_rest({0: (1.0, 0.0)}), 50.0, dt=0.01, record=FEW)
    assert caught.value.run.final.u[0, 0] == pytest.approx(29.0, abs=0.02)


def test_an_unlisted_wall_is_noticed():
    wall = Wall.between((2.0, -1.0), (2.0, 1.0), (0.0, 0.0))
    network = Network([[0.0, 0.0]], [], SPRING, radius=0.5, walls=[wall])
    with pytest.raises(ContactError, match="site 0 and wall 0"):
        simulate(network, network.at_rest({0: (1.0, 0.0)}), 5.0, dt=1e-2)
    past = simulate(network, network.at_rest({0: (1.0, 1.2)}), 5.0, dt=1e-2)
    assert past.complete


@pytest.mark.parametrize("load", [0.0, -1.0])
def test_a_bead_may_leave_its_wall_only_without_touching_it(load):
    wall = Wall.between((-1.0, 0.0), (1.0, 0.0), (0.0, 1.0))
    network = Network(
        [[0.0, 0.5]], [], SPRING, radius=0.5, walls=[wall], wall_contacts=[(0, 0)],
        wall_spring=SPRING, wall_gaps=[0.0], loads=[[0.0, load]],
    )  # fmt: skip
    state = network.at_rest({0: (0.1, 0.001)})
    if load:
        with pytest.raises(ContactError, match="beyond its end") as caught:
            simulate(network, state, 30.0, dt=1e-2)
        assert caught.value.run.final.u[0, 0] == pytest.approx(1.0, abs=0.03)
    else:
        assert simulate(network, state, 30.0, dt=1e-2).complete


FLOOR = Wall((0, 0), (0, 1))


def on_floor(*places, **others):
    """Beads of radius 0.45 m that may touch the floor."""
    contacts = [(k, 0) for k in range(len(places))]
    return Network(
        places, [], [], radius=0.45, walls=[FLOOR], wall_contacts=contacts,
        wall_spring=SPRING, **others,
    )  # fmt: skip


def test_a_bead_behind_its_wall_is_refused_at_the_start():
    with pytest.raises(ContactError, match=r"site 1 is behind wall 0, 0.5 m beyond its plane at"):
        on_floor((1.0, 0.5), (0.0, -0.5))
    with pytest.raises(ContactError, match="site 0 is behind wall 0, 0 m"):
        on_floor((0.0, 0.0), (1.0, 0.5))
    network, u = on_floor((0.0, 0.5), (1.0, 0.5)), np.array([[0, 0], [0, -0.75]])
    with pytest.raises(ContactError, match=r"site 1 is behind wall 0, 0.25 m"):
        simulate(network, State(u, 0 * u), 1e-3, dt=1e-4)


def test_a_bead_driven_through_its_wall_is_noticed():
    """Fast enough to pass a soft wall: 2 J against the 0.02 J that its plane takes."""
    network = Network(
        [[0.0, 0.5]], [], [], radius=0.45, walls=[FLOOR], wall_contacts=[(0, 0)],
        wall_spring=PowerLaw(0.1, 1.5),
    )  # fmt: skip
    with pytest.raises(ContactError, match=r"site 0 is behind wall 0") as caught:
        simulate(network, network.at_rest({0: (0.0, -2.0)}), 1.0, dt=1e-3, record=FEW)
    assert 0 < network.positions[0, 1] + caught.value.run.final.u[0, 1] < 2.1e-3


def test_wall_gaps_that_contradict_the_positions_are_refused():
    on_floor((0.0, 0.5), wall_gaps=[0.05 + 0.044])
    with pytest.raises(TensegrityError, match=r"gap 0.3 m of wall contact 1 .* 0.045 m.* 0.05 m"):
        on_floor((0.0, 0.5), (1.0, 0.5), wall_gaps=[0.05, 0.3])


def test_what_touches_at_the_start_must_be_listed():
    with pytest.raises(ContactError, match="sites 0 and 1, whose contact is not listed"):
        Network([[0.0, 0.0], [1.0, 0.0]], [], SPRING, radius=0.5)
    with pytest.raises(ContactError, match="wall 0, whose contact is not listed"):
        Network([[0.0, 0.5]], [], SPRING, radius=0.5, walls=[Wall((0, 0), (0, 1))])
    with pytest.raises(ContactError, match="wall"):
        fork(wall_contacts=False)


def test_the_watch_costs_little_where_nothing_is_near():
    """The same run, to the last bit, with and without a radius to watch."""
    guide = fork()
    free = Network(guide.positions, guide.bonds, PowerLaw(5e9, 1.5), mass=4.5e-4)
    watched = Network(guide.positions, guide.bonds, PowerLaw(5e9, 1.5), mass=4.5e-4, radius=2.38e-3)
    blow = {0: (0.5, 0.0)}
    one = simulate(free, free.at_rest(blow), 2e-4, dt=1e-7)
    two = simulate(watched, watched.at_rest(blow), 2e-4, dt=1e-7)
    np.testing.assert_array_equal(one.u, two.u)
