"""Gravity and preload on packs and guides: the static equilibrium, stated and kept."""

import math

import numpy as np
import pytest
import sympy as sp

from granular import (
    Bead,
    Striker,
    chain,
    diamond_guide,
    fcc_pack,
    hexagonal_pack,
    materials,
    pack,
    simulate,
    wall_force,
    y_guide,
)
from granular.contact_network import wall_forces
from tensegrity import Drive, EquilibriumError, Record, TensegrityError, Wall

D, G = 9.53e-3, 9.81
WALL, SOFT = materials["steel"], materials["ptfe"]
STEEL, PTFE = Bead(D, WALL), Bead(D, SOFT)
BOX = {"bead": STEEL, "floor": WALL, "sides": SOFT}


def on_wall(scene, name):
    return float(wall_forces(scene, scene.at_rest().u, name).sum())


@pytest.mark.parametrize("contacts", ["fixed", "follow"])
def test_the_floor_carries_the_weight_and_the_preload(contacts):
    scene = fcc_pack(5, 4, **BOX, gravity=G, preload=0.5, contacts=contacts)
    weight = 80 * STEEL.mass * G + 16 * 0.5
    assert on_wall(scene, "floor") == pytest.approx(weight, rel=1e-10)
    assert on_wall(scene, "left") == pytest.approx(on_wall(scene, "right"), rel=1e-10)
    assert on_wall(scene, "left") > weight / 20
    assert scene.equilibrium.residual < 1e-11 * weight
    run = simulate(scene, scene.at_rest(), 1e-4, dt=5e-7)
    assert np.abs(run.v).max() < 1e-10
    np.testing.assert_allclose(wall_force(run, "floor"), weight, rtol=1e-9)


def test_a_column_of_a_pack_rests_and_swings_as_a_chain():
    count = 8
    places = (D / 2 + D * np.arange(count)[::-1])[:, None]
    floor = {"floor": (Wall((0,), (1,)), WALL)}
    scene = pack(places, [STEEL, PTFE] * 4, floor, gravity=G, preload={0: (-2.0,)})
    line = chain([STEEL, PTFE] * 4, gravity=G, preload=2.0, end=WALL)
    expected = line.contact_forces(line.start().u)[-1]
    assert on_wall(scene, "floor") == pytest.approx(expected, rel=1e-12)
    how = {"method": "verlet", "dt": 5e-7}
    run = simulate(scene, scene.at_rest({0: (-0.1,)}), 1e-3, **how)
    other = simulate(line, line.at_rest({0: 0.1}), 1e-3, **how)
    forces = wall_force(run, "floor"), wall_force(other, "end")
    assert forces[1].max() > 2 * expected
    np.testing.assert_allclose(*forces, rtol=0, atol=1e-9 * forces[1].max())


def test_a_striker_hits_a_pack_at_rest_without_overlap():
    scene = hexagonal_pack(
        6, 9, **BOX, gravity=G, preload=1.0, striker=Striker(STEEL, 1.0),
        offset=(-0.5, math.sqrt(0.75)), direction=(0.5, -math.sqrt(0.75)),
    )  # fmt: skip
    state = scene.start()
    apart = np.linalg.norm(
        (scene.positions + state.u)[:-1] - (scene.positions + state.u)[-1], axis=1
    )
    assert apart.min() == pytest.approx(D, rel=1e-12)
    still = simulate(scene, scene.at_rest(), 1e-6, dt=1e-7)
    assert np.abs(still.v[:, :-1]).max() < 1e-10
    run = simulate(scene, state, 2e-4)
    assert run.energy_error < 1e-7
    beads = len(scene.places)
    assert wall_force(run, "floor")[0] == pytest.approx(beads * STEEL.mass * G + 9, rel=1e-10)


@pytest.mark.parametrize("guide", [y_guide, diamond_guide])
def test_a_guide_rests_on_its_end_until_struck(guide):
    how = {"bead": STEEL, "end": WALL, "gap": 1e-6, "gravity": G, "preload": 1.0}
    scene = guide(6, 7, **how, striker=Striker(STEEL, 0.3))
    beads = scene.sites - 1
    load = beads * STEEL.mass * G + 1.0
    u = scene.at_rest().u
    normals = np.array([wall.normal for wall in scene.walls])[scene.wall_contacts[:, 1]]
    carried = (scene.wall_load(u)[:, None] * normals).sum(axis=0)
    np.testing.assert_allclose(carried, [-load, 0], atol=1e-10 * load)
    run = simulate(scene, scene.start(), 2e-5, dt=2e-7)
    last = list(scene.parts.values())[-1][-1]
    assert np.abs(run.v[:, last]).max() < 1e-9
    assert np.abs(run.v[:, 2]).max() > 1e-2


def test_a_pack_with_small_gaps_settles_until_its_contacts_carry():
    places = fcc_pack(3, 3, **BOX).places
    d = D * (1 - 1e-5 * np.random.default_rng(0).random(27))
    walls = fcc_pack(3, 3, **BOX).named_walls
    scene = pack(places, [Bead(x, WALL) for x in d], walls, gravity=G)
    assert not len(scene.bonds)
    weight = G * sum(bead.mass for bead in scene.beads)
    assert on_wall(scene, "floor") == pytest.approx(weight, rel=1e-10)
    assert scene.equilibrium.contacts >= 3 * 27
    with pytest.raises(ValueError, match="read-only"):
        scene.equilibrium.u[0] = 0.0


@pytest.mark.parametrize(
    ("make", "words"),
    [
        (
            lambda: fcc_pack(2, 2, bead=STEEL, sides=SOFT, gravity=G),
            "of layer . finds no equilibrium",
        ),
        (lambda: fcc_pack(2, 2, bead=STEEL, floor=WALL, gravity=G), "finds no equilibrium under"),
        (
            lambda: fcc_pack(2, 2, bead=STEEL, floor=WALL, sides=SOFT, gravity=1e-40),
            "N are unbalanced, must be at most .* N, 1e-11 of the loads",  # overlaps << a guess
        ),
        (
            lambda: pack([(0.0, D)], STEEL, {"floor": (Wall((0, 0), (0, 1)), WALL)}, gravity=G),
            "bead 1 of beads finds no equilibrium under the loads: it moved .* m, must be below",
        ),
        (lambda: y_guide(3, 3, bead=STEEL, gravity=G), "need an end"),
        (lambda: fcc_pack(2, 2, **BOX, gravity=-1.0), "gravity -1 m/s.2 must be at least 0"),
        (lambda: fcc_pack(2, 2, **BOX, preload=-1.0), "preload -1 N must be at least 0"),
        (lambda: pack([(0.0, D)], STEEL, preload=1.0), "preload 1.0 must be a dict"),
        (lambda: pack([(0.0, D)], STEEL, preload={1: (0.0, 1.0)}), "site 1 of a preload must be"),
        (lambda: pack([(0.0, D)], STEEL, preload={0: 1.0}), "preload of site 0 has shape"),
    ],
)
def test_beads_without_support_and_bad_loads_are_refused(make, words):
    with pytest.raises(TensegrityError, match=words):
        make()


def test_overlaps_at_rest_grow_as_gravity_to_two_thirds_also_far_below_round_off_of_places():
    small, large = (
        fcc_pack(2, 2, bead=STEEL, floor=WALL, sides=SOFT, gravity=g).equilibrium.u
        for g in (1e-20, 1e-14)
    )
    np.testing.assert_allclose(large / small, 1e4, rtol=1e-6)


def test_what_finds_no_rest_says_so_by_its_class():
    with pytest.raises(EquilibriumError):
        fcc_pack(1, 1, bead=STEEL, gravity=G)


def test_rows_of_a_run_hold_the_beads_at_rest():
    scene = fcc_pack(2, 2, **BOX, gravity=G)
    run = simulate(scene, scene.at_rest(), 1e-5, dt=1e-6, record=Record(every=5))
    np.testing.assert_allclose(run.u[-1], scene.equilibrium.u, atol=1e-15)


@pytest.mark.parametrize("gravity", [0.0, G])
def test_a_driven_bead_starts_where_its_drive_begins(gravity):
    t = sp.Symbol("t")
    drive = {1: Drive(displacement=(None, -1e-7 * sp.cos(1e4 * t)))}
    scene = hexagonal_pack(3, 4, **BOX, gravity=gravity, drive=drive)
    free = hexagonal_pack(3, 4, **BOX, gravity=gravity).at_rest().u
    free[1, 1] = -1e-7
    start = scene.at_rest({0: (0.0, -0.01)})
    assert np.array_equal(start.u, free)
    assert start.v[0, 1] == -0.01
    run = simulate(scene, start, 1e-4, dt=5e-7, record=Record(times=[5e-5]))
    assert run.u[0, 1, 1] == pytest.approx(-1e-7 * math.cos(0.5), rel=1e-12)
