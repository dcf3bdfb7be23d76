"""Contacts that come and go: found before they act, the same as if listed from the start."""

import itertools
import math
import pickle

import numpy as np
import pytest
from scenes import ctrl_c

from granular import Bead, hertz, materials
from tensegrity import (
    ContactError,
    Ensemble,
    Network,
    PowerLaw,
    Record,
    StabilityError,
    TensegrityError,
    Wall,
    resume,
    simulate,
)

D = 9.53e-3
STEEL = Bead(D, materials["steel"])
PAIR, ON_WALL = hertz(STEEL, STEEL).spring(), hertz(STEEL, materials["steel"]).spring()
WIDTH, HEIGHT = 18 * D, 12 * D


def law(site, other):
    return ON_WALL if isinstance(other, Wall) else PAIR


def box(width, height):
    """Four walls about a rectangle."""
    return [
        Wall((0, height / 2), (1, 0)), Wall((width, height / 2), (-1, 0)),
        Wall((width / 2, 0), (0, 1)), Wall((width / 2, height), (0, -1)),
    ]  # fmt: skip


def rack(offset=0.0):
    """A triangle of fifteen touching beads, its apex first, and a cue before it."""
    places = [(12 * D + k * D * math.sqrt(3) / 2, 6 * D + (i - k / 2) * D)
              for k in range(5) for i in range(k + 1)]  # fmt: skip
    return np.array([*places, (10.5 * D, 6 * D + offset * D)])


def followed(places, walls, **options):
    options = {"contacts": "follow", "law": law} | options
    return Network(
        places, (), PAIR, mass=STEEL.mass, radius=D / 2, walls=walls, **options
    )  # fmt: skip


def listed(places, walls):
    """The same with every pair and every wall in the list from the start."""
    pairs = list(itertools.combinations(range(len(places)), 2))
    touches = [(site, wall) for site in range(len(places)) for wall in range(len(walls))]
    return Network(
        places, pairs, PAIR, lengths=D, mass=STEEL.mass, radius=D / 2, walls=walls,
        wall_contacts=touches, wall_spring=ON_WALL,
    )  # fmt: skip


@pytest.mark.parametrize("offset", [0.0, 0.3])
def test_a_break_shot_is_that_of_a_list_of_all_pairs_to_the_last_bit(offset):
    """Three directions, walls and all: what is not near adds nothing, in the same order."""
    places, walls = rack(offset), box(WIDTH, HEIGHT)
    few, all_ = followed(places, walls), listed(places, walls)
    runs = [simulate(x, x.at_rest({15: (5.0, 0.0)}), 4e-3, dt=2e-7) for x in (few, all_)]
    assert runs[0].u.tobytes() == runs[1].u.tobytes()
    assert runs[0].v.tobytes() == runs[1].v.tobytes()
    np.testing.assert_allclose(runs[0].energy, runs[1].energy, rtol=1e-12)
    assert np.abs(runs[0].u[-1]).max() > D / 2  # so that lists were made anew


def test_energy_is_kept_through_every_new_contact():
    scene = followed(rack(), box(WIDTH, HEIGHT))
    run = simulate(scene, scene.at_rest({15: (5.0, 0.0)}), 1.2e-3)
    assert run.energy_error < 1e-8
    assert run.force_model == "exact"
    cue, corners = run.v[-1, 15], run.v[-1, [10, 14]]
    assert abs(cue[1]) < 1e-9
    np.testing.assert_allclose(corners[0] * [1, -1], corners[1], rtol=1e-9)
    momentum = run.v[-1].sum(axis=0) * STEEL.mass
    np.testing.assert_allclose(momentum, [5.0 * STEEL.mass, 0], atol=1e-9 * STEEL.mass)


def test_the_gap_is_crossed_at_the_striker_s_speed():
    scene = followed(rack(), ())
    record = Record(interval=1e-6, sites=[0, 15])
    run = simulate(scene, scene.at_rest({15: (5.0, 0.0)}), 1.1e-3, record=record)
    first = run.t[np.flatnonzero(np.abs(run.v[:, 0, 0]) > 1e-9)[0]]
    assert first == pytest.approx(0.5 * D / 5.0, abs=2e-6)


def test_a_gas_meets_the_pairs_that_a_list_of_all_meets():
    side = np.array([(i, j) for i in range(6) for j in range(6)])
    places, walls = (1 + 1.5 * side) * D, box(9.5 * D, 9.5 * D)
    angle = math.pi * (3 - math.sqrt(5)) * np.arange(36)
    velocity = dict(enumerate(2.0 * np.stack([np.cos(angle), np.sin(angle)], axis=1)))
    scene = followed(places, walls)
    run = simulate(scene, scene.at_rest(velocity), 3e-3, dt=2e-7, record=Record(every=20))
    touched = set()
    for u in run.u:
        x = places + u
        apart = np.linalg.norm(x[:, None] - x, axis=-1)
        touched |= {tuple(pair) for pair in np.argwhere(np.triu(apart < D, 1)).tolist()}
    assert len(touched) > 14
    other = listed(places, walls)
    again = simulate(other, other.at_rest(velocity), 3e-3, dt=2e-7, record=Record(every=20))
    assert run.u.tobytes() == again.u.tobytes()


def test_beads_in_space_and_on_a_line_are_followed_too():
    for axis in (np.array([1.0]), np.array([1.0, 2.0, -0.5]) / math.sqrt(5.25)):
        places = np.array([0.0, 1.5, 3.5])[:, None] * D * axis
        scene = followed(places, ())
        run = simulate(scene, scene.at_rest({0: 2.0 * axis}), 3e-2)
        assert run.energy_error < 1e-8
        along = run.final.v @ axis
        np.testing.assert_allclose(along, [0, 0, 2.0], atol=1e-6)  # handed on from bead to bead


def test_bonds_stay_beside_what_is_followed():
    """A dumbbell that flies at a wall: its bond is no contact, and pulls."""
    places, walls = np.array([[2.0, 2.0], [3.2, 2.0]]) * D, [Wall((0, 0), (1, 0))]
    bond = PowerLaw(1e6, 1.0, preload=20.0)
    scene = Network(
        places, [(0, 1)], bond, mass=STEEL.mass, radius=D / 2, walls=walls, contacts="follow",
        law=law,
    )  # fmt: skip
    run = simulate(scene, scene.at_rest({0: (-1.0, 0.0), 1: (-1.0, 0.0)}), 3e-2)
    assert run.energy_error < 1e-8
    assert run.impulse[-1, 0, 0] < 0 < run.final.v[:, 0].sum()


def test_following_survives_a_file_and_a_pickle(tmp_path):
    scene = followed(rack(), (), law=PAIR)
    assert pickle.loads(pickle.dumps(scene)) == scene
    options = {"dt": 2e-7, "record": Record(path=tmp_path / "a.npy", checkpoint=0.0, every=500)}
    run = simulate(scene, scene.at_rest({15: (5.0, 0.0)}), 1.2e-3, **options)
    again = resume(tmp_path / "a.npy")
    assert again.final.u.tobytes() == run.final.u.tobytes()


def test_what_cannot_be_followed_is_refused():
    places = np.array([[0.0, 0.0], [3.0, 0.0]]) * D
    for options, why in (
        ({"contacts": "some"}, "contacts 'some' must be"),
        ({"law": None}, "law None is not a Potential"),
        ({"law": 1.0}, r"law 1\.0 is not"),
        ({"contacts": "fixed"}, "contacts are 'fixed'"),
    ):
        with pytest.raises(TensegrityError, match=why):
            followed(places, (), **options)
    with pytest.raises(TensegrityError, match="need the radius"):
        Network(places, (), PAIR, contacts="follow", law=law)
    odd = followed(places, (), law=lambda site, other: None)
    with pytest.raises(TensegrityError, match="law of 0 and 1 None is not a Potential"):
        simulate(odd, odd.at_rest({0: (1.0, 0.0)}), 3e-2)
    with pytest.raises(TensegrityError, match="fixed contacts"):
        Ensemble([followed(places, ())] * 2)


def test_steps_that_jump_over_what_is_near_are_refused():
    scene = followed(np.array([[0.0, 0.0], [30.0, 0.0]]) * D, ())
    with pytest.raises(StabilityError, match=r"a site moved .* m in one step"):
        simulate(scene, scene.at_rest({0: (5.0, 0.0)}), 1e-2, dt=1e-3)


def test_the_end_of_a_wall_is_no_contact():
    wall = Wall((0, 0), (0, 1), (2 * D, 0))
    scene = followed(np.array([[2.1 * D, 3 * D]]), [wall])
    with pytest.raises(ContactError, match="site 0 touches the end of wall 0"):
        simulate(scene, scene.at_rest({0: (0.0, -2.0)}), 3e-2, dt=1e-6)


@pytest.mark.parametrize("method", ["verlet", "rkn6", "corrected6"])
def test_what_is_recorded_changes_no_bit_while_lists_are_made_anew(method):
    """With all states at hand contacts are looked for in each, else by the way travelled."""
    scene = followed(rack(0.3), box(WIDTH, HEIGHT))
    state, how = scene.at_rest({15: (5.0, 0.0)}), {"dt": 1e-6, "method": method}
    every = simulate(scene, state, 4e-3, **how, record=Record(every=1))
    assert np.abs(every.u[-1]).max() > D / 2  # so that lists were made anew
    for record in (None, Record(every=7), Record(every=5, sites=[15, 3])):
        run = simulate(scene, state, 4e-3, **how, record=record)
        at, sites = np.isin(every.t, run.t), list(run.sites)
        for field in ("u", "v"):
            found, wanted = getattr(run, field), getattr(every, field)[at][:, sites]
            np.testing.assert_array_equal(found, wanted, field)
        np.testing.assert_array_equal(run.impulse, every.impulse[at])
        np.testing.assert_allclose(run.energy, every.energy[at], rtol=1e-12)
        np.testing.assert_array_equal(run.final.u, every.final.u)


def test_an_interrupted_run_goes_on_with_the_contacts_that_it_had_come_to(tmp_path):
    scene, path = followed(rack(0.3), box(WIDTH, HEIGHT), law=PAIR), tmp_path / "run.npy"
    state, how = scene.at_rest({15: (5.0, 0.0)}), {"dt": 1e-6, "method": "verlet"}
    whole = simulate(scene, state, 4e-3, **how, record=Record(every=100))
    record = Record(every=100, path=path, checkpoint=1e9)
    part = simulate(scene, state, 4e-3, **how, record=record, observe=ctrl_c(2e-3))
    assert 0 < part.steps < whole.steps
    run = resume(path)
    for field in ("t", "u", "v", "impulse"):
        np.testing.assert_array_equal(getattr(run, field), getattr(whole, field), field)


def test_an_attempt_that_passes_its_list_is_made_again():
    """A bead that is driven out of what was listed: its speed at the start does not tell."""
    loads = np.zeros((2, 2))
    loads[0, 0] = 4.0
    scene = followed(np.array([[0.0, 0.0], [2.2, 0.0]]) * D, (), loads=loads)
    run = simulate(scene, scene.at_rest(), 6e-3, dt=1e-5, method="verlet")
    assert run.v[-1, 1, 0] > 0.1  # it was met


@pytest.mark.parametrize("extent", [None, (20 * D, 0)])
def test_a_site_that_passes_through_a_wall_touches_no_end_of_it(extent):
    scene = followed(np.array([[0.0, D]]), [Wall((0, 0), (0, 1), extent)])
    with pytest.raises(ContactError, match=r"site 0 is behind wall 0, .* m beyond its plane at"):
        simulate(scene, scene.at_rest({0: (0.0, -2e4)}), 1e-5, dt=1e-9)


def test_a_run_in_one_call_sees_the_end_of_a_wall():
    wall = Wall((0, 0), (0, 1), (2 * D, 0))
    scene = followed(np.array([[2.1 * D, 0.52 * D]]), [wall])
    with pytest.raises(ContactError, match="site 0 touches the end of wall 0"):
        simulate(scene, scene.at_rest({0: (0.0, -1.0)}), 5e-4, dt=1e-6, method="verlet")


def test_a_list_is_that_of_what_is_near():
    scene = followed(rack(), box(WIDTH, HEIGHT))
    u = np.zeros(scene.shape)
    first = scene.listed(u)
    u[15, 0] = 0.4 * D
    assert len(scene.listed(u).bonds) > len(first.bonds)
