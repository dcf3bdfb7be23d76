"""Structures on floors: nodes press walls, not each other, and fall under their weight.

The numbers of the octahedra are those of DOP853, restarted at every kink, at two tolerances.
"""

import math

import numpy as np
import pytest
import sympy as sp
from numpy.testing import assert_array_equal
from scipy.integrate import solve_ivp

from tensegrity import (
    Lattice,
    Network,
    PowerLaw,
    Record,
    Run,
    Structure,
    TensegrityError,
    Wall,
    simulate,
)

GRAVITY = 9.81
FLOOR = Wall((0, 0, 0), (0, 0, 1))
DROPS = [  # height, time, largest force on the floor and compression, centre of mass, node 0
    (0.1, 0.39278431229270644, 142.26285647306486, 71.96222814694596, 0.4370300106370104,
     (0.33277319260458604, 0.34064911213667187, 0.728183701269993)),
    (0.5, 0.5692754284070505, 254.28794395825113, 103.38322390980045, 0.4625818149316294,
     (0.25744056838677515, 0.20793598391846188, 0.9093174439097422)),
    (1.0, 0.7015236409857308, 249.2359031902616, 120.4663668288662, 0.4773359746096148,
     (0.13723706877257547, 0.22239037951991156, 0.9868585319707022)),
    (2.0, 0.888550856814101, 286.15713071112424, 169.2211456701042, 0.4909025839027928,
     (-0.038589991450967066, 0.30626543064782913, 0.988647437326309)),
]  # fmt: skip
TILTED = [  # nodes of the octahedron whose lowest node is at 0
    (0.3428652067627709, 0.38174822163368327, 0.7287358633129316),
    (0.5485236588366962, 0.053045290408751694, 0.41304775125501003),
    (-0.5485236588366962, -0.053045290408751694, 0.6007495665030774),
    (-0.3428652067627709, -0.38174822163368327, 0.28506145444515585),
    (-0.1580636160570821, 0.17484176533536325, 1.0137973177580875),
    (-0.2532532880907684, 0.4825640971145, 0.6313762241158432),
    (0.2532532880907684, -0.4825640971145, 0.3824210936422443),
    (0.1580636160570821, -0.17484176533536325, 0.0),
    (0.3180368884335531, -0.19902395376852797, 0.9213163267237515),
    (-0.12765754436618043, -0.41642070978974544, 0.8573231783188244),
    (0.12765754436618043, 0.41642070978974544, 0.15647413943926303),
    (-0.3180368884335531, 0.19902395376852797, 0.09248099103433594),
]
BARS = [(0, 2), (1, 3), (4, 6), (5, 7), (8, 10), (9, 11)]
STRINGS = [(0, 4), (2, 4), (0, 5), (2, 5), (1, 6), (3, 6), (1, 7), (3, 7), (0, 8), (1, 8), (4, 8),
           (6, 8), (2, 9), (3, 9), (4, 9), (6, 9), (0, 10), (1, 10), (5, 10), (7, 10), (2, 11),
           (3, 11), (5, 11), (7, 11)]  # fmt: skip


def octahedron(height, **masses):
    """Six bars, tilted, of 1 m and 20 kN/m, with strings of 200 N/m under prestress."""
    return Structure(
        np.add(TILTED, (0, 0, height)), bars=BARS, strings=STRINGS, k_bar=2e4, k_string=200.0,
        natural_lengths=[1.0013636363636365] * 6 + [0.556702214268904] * 24, **masses,
    )  # fmt: skip


@pytest.mark.parametrize(
    ("steps", "within"), [(2048, 2e-4), pytest.param(16384, 2e-6, marks=pytest.mark.slow)]
)
def test_a_robot_whose_strings_are_wound_kicks_itself_off_the_floor(steps, within):
    """Sixteen of 24 strings, each with its own frequency; EA is kept.  Through 34 kinks, at which
    steps are not corrected: their error falls with the square of dt."""
    natural, t = np.repeat([1.0013636363636365, 0.556702214268904], [6, 24]), sp.Symbol("t")
    robot = Structure(
        TILTED, bars=BARS, strings=STRINGS, EA_bar=2e4 * natural[0], EA_string=200.0 * natural[6],
        natural_lengths=natural, mass=0.02, bar_mass=0.2,
    )  # fmt: skip
    omega = dict(zip(range(6, 30), np.linspace(1.5, 4, 24).tolist(), strict=True))
    wound = {m: natural[m] * (1 - sp.sin(omega[m] * t) ** 2 / 4) for m in omega if m % 3}
    scene = robot.network(natural_lengths=wound, walls=[FLOOR], wall_law=1e4, gravity=GRAVITY)
    run = simulate(scene, scene.at_rest(), 1.0, dt=1 / steps, method="rkn6")
    wanted = [
        (-0.14197222625033495, 0.2483140308879159, 1.061368655557312),
        (0.5505503908701553, -0.06911261053961607, 0.4192729509265935),
    ]
    np.testing.assert_allclose((robot.positions + run.final.u)[[0, 7]], wanted, atol=within)
    assert run.work[-1] == pytest.approx(19.188630225877674, abs=within)
    assert run.energy[-1] - run.energy[0] == pytest.approx(run.work[-1], abs=within)


def point(stiffness=5e4, mass=2.0, height=0.3, wall=FLOOR):
    """A point above a floor."""
    return Network([(0.0, 0.0, height)], np.zeros((0, 2), dtype=int), PowerLaw(1.0, 1.0),
                   mass=mass, walls=[wall], wall_spring=PowerLaw(stiffness, 1.0), contacts="walls",
                   loads=[(0, 0, -mass * GRAVITY)])  # fmt: skip


def test_a_fall_from_rest_is_measured_by_its_kinetic_energy():
    """Its energy is 0 at the start and stays round-off, of which a ratio says nothing."""
    scene = point(height=0.3)
    run = simulate(scene, scene.at_rest(), 0.2, dt=1e-3)
    assert run.energy[0] == 0
    assert np.abs(run.energy).max() > 0
    largest = 0.5 * 2.0 * np.max(run.v[:, 0, 2] ** 2)
    assert run.energy_error == pytest.approx(np.abs(run.energy).max() / largest)
    assert run.energy_error < 1e-13
    assert "1 wall with 1 contacts" in repr(scene)


def test_the_kinetic_energy_counts_where_some_sites_are_recorded_and_bonds_have_mass():
    scene = Network([(0.0, 0.0), (1.0, 0.0)], [(0, 1)], PowerLaw(1.0, 1.0), bond_mass=6.0,
                    mass=1.0, loads=[(0, -1.0), (0, -1.0)])  # fmt: skip
    run = simulate(scene, scene.at_rest(), 0.5, dt=0.01, record=Record(sites=[1]))
    largest = 0.5 * (1.0 + 6.0 / 3) * np.max(run.v[..., 1] ** 2)
    assert run.energy[0] == 0
    assert run.energy_error * largest == pytest.approx(np.abs(run.energy).max())


def heights(scene, u):
    return (scene.positions + u)[..., 2]


def test_a_point_mass_presses_the_floor_as_in_closed_form():
    """Peak m g (1 + sqrt(1 + 2 k h/(m g))), contact for 2/w (pi - atan(w v/g))."""
    mass, k, height = 2.0, 5e4, 0.3
    scene, w, v = point(k, mass, height), math.sqrt(k / mass), math.sqrt(2 * GRAVITY * height)
    fall, contact = v / GRAVITY, 2 / w * (math.pi - math.atan(w * v / GRAVITY))
    assert contact == pytest.approx(0.0201925871063, rel=1e-11)
    middle = fall + contact / 2
    times = [fall + 1e-4 * contact, middle, fall + contact]
    run = simulate(scene, scene.at_rest(), times[-1] + 0.01, tol=1e-9,
                   record=Record(times=[*times, times[-1] + 0.01]))  # fmt: skip
    force = scene.wall_load(run.u)[:, 0]
    assert force[1] == pytest.approx(787.073545435, rel=1e-10)
    assert heights(scene, run.u[2])[0] == pytest.approx(0, abs=1e-9)  # leaves the floor
    assert run.v[2, 0, 2] == pytest.approx(v, rel=1e-9)
    assert force[3] == 0
    assert np.ptp(run.energy) < 1e-9 * mass * GRAVITY * height


def by_scipy(s, t_end, k_floor):
    """Final positions by DOP853, whose error control sees the kinks."""
    i, j = s.ends.T

    def rate(t, y):
        x, v = y[:36].reshape(-1, 3), y[36:]
        d = x[j] - x[i]
        length = np.linalg.norm(d, axis=1)
        tension = s.stiffnesses * (length - s.natural_lengths)
        tension = np.where(s.is_string, np.maximum(tension, 0), tension)
        pull = (tension / length)[:, None] * d
        f = np.zeros_like(x)
        np.add.at(f, i, pull)
        np.add.at(f, j, -pull)
        f[:, 2] += k_floor * np.maximum(-x[:, 2], 0) - GRAVITY * s.mass
        return np.concatenate([v, (f / s.mass[:, None]).ravel()])

    start = np.concatenate([s.positions.ravel(), np.zeros(36)])
    run = solve_ivp(rate, (0, t_end), start, "DOP853", rtol=1e-11, atol=1e-12, max_step=1e-3)
    return run.y[:36, -1].reshape(-1, 3)


def test_lumped_masses_fall_as_another_integrator_has_it():
    s = octahedron(0.02, mass=0.12)
    scene = s.network(walls=[FLOOR], wall_law=1e4, gravity=GRAVITY)
    run = simulate(scene, scene.at_rest(), 0.12, tol=1e-9)
    assert scene.wall_load(run.u).sum(axis=1).max() > 20
    assert s.positions + run.final.u == pytest.approx(by_scipy(s, 0.12, 1e4), abs=1e-8)
    assert abs(run.energy_error) < 1e-9


def peak(values):
    """The largest of some values, by the parabola through it and its neighbours."""
    k = int(np.argmax(values))
    a, b, c = np.polyfit([-1, 0, 1], values[k - 1 : k + 2], 2)
    return c - b**2 / (4 * a)


@pytest.mark.parametrize("drop", DROPS, ids=[f"{drop[0]} m" for drop in DROPS])
def test_octahedra_land_as_by_dop853(drop):
    """Bars of 0.2 kg, nodes of 0.02 kg: peaks, and where the nodes are at the end."""
    height, t, floor, compression, centre, node = drop
    s = octahedron(height, mass=0.02, bar_mass=0.2)
    scene = s.network(walls=[FLOOR], wall_law=1e4, gravity=GRAVITY)
    run = simulate(scene, scene.at_rest(), t, tol=1e-8, record=Record(every=1))
    x = s.positions + run.final.u
    assert x[:, 2].mean() == pytest.approx(centre, abs=1e-9)  # all nodes carry alike
    assert x[0] == pytest.approx(node, abs=5e-9)
    assert peak(scene.wall_load(run.u).sum(axis=1)) == pytest.approx(floor, rel=1e-5)
    assert peak(-scene.bond_tension(run.u)[:, :6].min(axis=1)) == pytest.approx(
        compression, rel=1e-5)  # fmt: skip
    assert abs(run.energy_error) < 1e-9


def test_the_weight_is_that_of_the_masses_along_the_last_axis():
    s = octahedron(0.0, mass=np.linspace(0.1, 0.3, 12))
    scene = s.network(gravity=GRAVITY)
    assert scene.loads[:, :2].any() == 0
    assert scene.loads[:, 2] == pytest.approx(-GRAVITY * s.mass, rel=1e-15)
    heavy = octahedron(0.0, mass=0.02, bar_mass=0.2).network(gravity=GRAVITY)
    assert heavy.loads[:, 2] == pytest.approx(-GRAVITY * 0.12, rel=1e-15)  # half of each bar
    assert not s.network().loads.any()
    assert not scene.walls


def test_walls_far_away_change_no_bit():
    s = octahedron(1.0, mass=0.12)
    far = [Wall((0, 0, -50), (0, 0, 1)), Wall((60, 0, 0), (-1, 0, 0))]
    alone = s.network(gravity=GRAVITY)
    beside = s.network(walls=far, wall_law=1e4, gravity=GRAVITY)
    blow = {0: (0.3, 0.0, 0.0)}
    runs = [simulate(x, x.at_rest(blow), 0.1, dt=1e-4, method="rkn6") for x in (alone, beside)]
    assert_array_equal(*(run.u for run in runs))
    assert_array_equal(*(run.v for run in runs))


@pytest.mark.parametrize("turn", [0.7, 2.0])
def test_a_landing_is_the_same_against_a_wall_of_another_direction(turn):
    """About the axis of the weight, in other units of mass and force, and renumbered."""
    rotation = np.array([[math.cos(turn), -math.sin(turn), 0], [math.sin(turn), math.cos(turn), 0],
                         [0, 0, 1.0]])  # fmt: skip
    here = octahedron(0.05, mass=0.12)
    scenes = [here.network(walls=[FLOOR], wall_law=1e4, gravity=GRAVITY)]
    order = np.random.default_rng(3).permutation(12)
    number = np.argsort(order)
    there = Structure((here.positions @ rotation.T)[order], bars=number[BARS],
                      strings=number[STRINGS], k_bar=2e7, k_string=2e5, mass=120.0,
                      natural_lengths=here.natural_lengths)  # fmt: skip
    scenes.append(there.network(walls=[FLOOR], wall_law=PowerLaw(1e7, 1.0), gravity=GRAVITY))
    one, other = (simulate(x, x.at_rest(), 0.15, dt=2e-5, method="rkn6") for x in scenes)
    assert other.final.u[number] @ rotation == pytest.approx(one.final.u, abs=1e-9)


def test_nodes_that_meet_pass_each_other_and_both_press():
    """Sites on one place at once: no contact is listed between them, and each presses the floor."""
    scene = Network([(-0.1, 1.0), (0.1, 1.0)], np.zeros((0, 2), int), PowerLaw(1.0, 1.0), mass=1.0,
                    walls=[Wall((0, 0), (0, 1))], wall_spring=PowerLaw(1e4, 1.5), contacts="walls",
                    radius=0.2, loads=[(0, -9.81)] * 2)  # fmt: skip
    run = simulate(scene, scene.at_rest({0: (0.5, 0), 1: (-0.5, 0)}), 0.55, tol=1e-7)
    x = scene.positions + run.final.u
    assert x[0, 0] == pytest.approx(0.175, abs=1e-6)
    assert scene.wall_load(run.u).max() > 0
    assert heights_of_first_touch(scene, run) == pytest.approx(0.2, abs=0.02)
    assert x[0, 1] == pytest.approx(x[1, 1], rel=1e-12)


def heights_of_first_touch(scene, run):
    """Height of site 0 at the first recorded instant at which it presses the floor."""
    touching = np.flatnonzero(scene.wall_load(run.u)[:, 0] > 0)[0]
    return (scene.positions + run.u[touching])[0, 1]


def test_a_landing_is_saved_and_read_again(tmp_path):
    s = octahedron(0.01, mass=0.12)
    scene = s.network(walls=[FLOOR], wall_law=1e4, gravity=GRAVITY)
    run = simulate(scene, scene.at_rest(), 0.06, dt=1e-4)
    run.save(tmp_path / "landing.npz")
    again = Run.load(tmp_path / "landing.npz")
    assert again.scene == scene
    assert_array_equal(again.final.u, run.final.u)


def test_lattices_press_walls_as_structures_do():
    row = Lattice([(0.0, 0.0), (0.5, 1.0)], [(1.0, 0.0)], bars=[(0, 0, 1), (1, 1, 1), (0, 1, 0),
                  (1, 0, 1)], k_bar=100.0)  # fmt: skip
    floor = Wall((0, -0.5), (0, 1))
    scene = row.network(3, walls=[floor], wall_law=50.0, gravity=1.0)
    assert scene.loads[:, 1] == pytest.approx(-1.0)
    assert len(scene.wall_contacts) == scene.sites


WALL = {"walls": [FLOOR], "wall_law": 1e4}


@pytest.mark.parametrize(
    ("given", "words"),
    [
        ({"walls": [FLOOR]}, "walls need a wall_law"),
        ({"wall_law": 1e4}, "wall_law given, but no walls"),
        ({"walls": [FLOOR], "wall_law": 0.0}, "wall_law 0 N/m must be above 0"),
        ({"walls": [FLOOR], "wall_law": "steel"}, "wall_law"),
        ({"walls": [Wall((0, 0, 0.3), (0, 0, 1))], "wall_law": 1e4},
         "wall 0 cuts the start: site 7 is 0.2 m behind it"),
        ({"walls": [Wall((0, 0, 0), (0, 0, 1), ((1, 0, 0), (0, 1, 0)))], "wall_law": 1e4},
         "wall 0 must be unbounded"),
        ({"walls": [Wall((0, 0), (0, 1))], "wall_law": 1e4}, "wall 0 has 2 coordinates"),
        (WALL | {"gravity": math.nan}, "gravity"),
        (WALL | {"gravity": "down"}, "gravity"),
        ({"walls": FLOOR, "wall_law": 1e4}, "walls"),
    ],
)  # fmt: skip
def test_what_is_no_floor_is_refused(given, words):
    with pytest.raises(TensegrityError, match=words):
        octahedron(0.1, mass=0.12).network(**given)


@pytest.mark.parametrize(
    ("given", "words"),
    [
        ({"contacts": "floor"}, "contacts 'floor' must be 'fixed', 'follow' or 'walls'"),
        ({"wall_contacts": [(0, 0)]}, "contacts 'walls' exclude wall_contacts"),
        ({"wall_gaps": [0.1, 0.1]}, "contacts 'walls' exclude wall_gaps"),
        ({"law": PowerLaw(1.0, 1.5), "radius": 0.01}, "law given, but contacts are 'walls'"),
        ({"wall_spring": None}, "is not a Potential"),
    ],
)
def test_what_presses_walls_excludes_is_named(given, words):
    good = {"walls": [FLOOR], "wall_spring": PowerLaw(1e4, 1.0), "contacts": "walls"}
    with pytest.raises(TensegrityError, match=words):
        Network([(0, 0, 1.0), (1, 0, 1.0)], [(0, 1)], PowerLaw(1.0, 1.5), **(good | given))
