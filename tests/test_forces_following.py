"""Forces and contacts that dissipate in scenes whose contacts come and go."""

import itertools
import math

import numpy as np
import pytest
import sympy as sp

from granular import (
    Bead,
    Material,
    carretero_gonzalez,
    hunt_crossley,
    kuwabara_kono,
    pack,
    power,
    sensor_force,
    simulate,
    viscous,
    wall_force,
)
from tensegrity import (
    Damping,
    Drive,
    Force,
    Network,
    PowerLaw,
    Record,
    TensegrityError,
    Wall,
    resume,
)

STEEL = Material("steel", density=0.45e-3 / (math.pi / 6 * 4.76e-3**3), modulus=193e9, poisson=0.3)
BEAD = Bead(4.76e-3, STEEL)
D = BEAD.diameter
LAWS = {
    "kuwabara_kono": kuwabara_kono(1e-6),
    "hunt_crossley": hunt_crossley(0.2),
    "viscous": viscous(2.0),
    "carretero_gonzalez": carretero_gonzalez(2.0, 1.5),
}
SIDE = 3.4 * D
SIDES = {
    "floor": Wall([0, 0], [0, 1]),
    "left": Wall([0, 0], [1, 0]),
    "right": Wall([SIDE, 0], [-1, 0]),
    "top": Wall([0, SIDE], [0, -1]),
}
T, R, RATE, U_X, V_X, V_Y, SPEED, C = sp.symbols("t r rate u_x v_x v_y speed c")
KELVIN = Force(-C * sp.Max(-R, 0) * sp.Max(-RATE, 0), "bonds", parameters={"c": 2e7})


def written_out(name, stiffness, on):
    """What a law adds to a Hertz contact, by its formula."""
    d, rate = sp.Max(-R, 0), -RATE
    elastic = stiffness * d ** sp.Rational(3, 2)
    loss = {
        "kuwabara_kono": sp.Rational(3, 2) * 1e-6 * stiffness * sp.sqrt(d) * rate,
        "hunt_crossley": 0.2 * elastic * rate,
        "viscous": sp.Piecewise((2.0 * rate, d > 0), (0, True)),
        "carretero_gonzalez": sp.Piecewise(
            (2.0 * sp.sign(rate) * sp.Abs(rate) ** sp.Rational(3, 2), d > 0), (0, True)
        ),
    }[name]
    added = sp.Max(elastic + loss, 0) - elastic
    return Force(added if on == "walls" else -added, on)


def loose(count, seed, **more):
    """Beads apart from each other in the plane, and their velocities."""
    draw = np.random.default_rng(seed)
    places = np.stack(np.meshgrid(*[np.arange(count)] * 2), -1).reshape(-1, 2) * 1.1 * D + 0.6 * D
    places += draw.uniform(-0.04, 0.04, places.shape) * D
    scene = pack(places, BEAD, **more)
    return scene, scene.at_rest({i: draw.uniform(-3, 3, 2) for i in range(count**2)})


@pytest.mark.parametrize(
    "name",
    [pytest.param(name, marks=pytest.mark.slow) for name in LAWS if name != "kuwabara_kono"]
    + ["kuwabara_kono"],
)
def test_a_list_that_changes_gives_what_a_list_of_all_pairs_gives(name):
    """Nine beads in a box, every one with all others and all walls; sensors of the walls too."""
    law = LAWS[name]
    scene, state = loose(3, 1, walls={key: (w, STEEL) for key, w in SIDES.items()}, law=law)
    pairs = list(itertools.combinations(range(9), 2))
    touched = list(itertools.product(range(9), range(4)))
    between, at_wall = law(BEAD, BEAD), law(BEAD, STEEL)
    losses = [
        written_out(name, between.constant, "bonds"), written_out(name, at_wall.constant, "walls")
    ]  # fmt: skip
    net = Network(
        scene.places, pairs, between.spring(), lengths=D, mass=BEAD.mass, radius=D / 2,
        walls=[*SIDES.values()], wall_contacts=touched, wall_spring=at_wall.spring(), forces=losses,
    )  # fmt: skip
    record = Record(every=5)
    one, two = (
        simulate(x, state, 5e-4, dt=2e-7, method="rk8", record=record) for x in (scene, net)
    )
    lists = {tuple(map(tuple, scene.listed(u).bonds.tolist())) for u in one.u}
    assert len(lists) > 4
    np.testing.assert_allclose(one.u, two.u, rtol=0, atol=1e-11 * abs(two.u).max())
    np.testing.assert_allclose(one.loss, two.loss, rtol=1e-9)
    assert one.loss[-1] > 0.1 * one.energy[0]
    load = net.wall_load(two.u)
    load += losses[-1].values(*_at_walls(two))
    expected = load[:, [k for k, (_, wall) in enumerate(touched) if wall == 0]].sum(axis=1)
    np.testing.assert_allclose(wall_force(one, "floor"), expected, rtol=0, atol=1e-7 * load.max())


def _at_walls(run):
    """Gaps of contacts with walls through the origin or opposite to it, and their rates."""
    scene = run.scene
    normals, points = (np.array([getattr(w, x) for w in scene.walls]) for x in ("normal", "point"))
    sites, walls = scene.wall_contacts.T
    place = (scene.positions + run.u)[:, sites] - points[walls]
    gap, rate = (np.einsum("tsk,sk->ts", x, normals[walls]) for x in (place, run.v[:, sites]))
    return gap - D / 2, rate


@pytest.mark.parametrize("name", [None, "viscous"])
def test_sensors_read_contacts_that_come_and_go(name):
    """Eq. (5) of the paper written out, with all pairs and walls."""
    law = LAWS[name] if name else power(2e9, 1.5)
    scene, state = loose(3, 1, walls={key: (w, STEEL) for key, w in SIDES.items()}, law=law)
    run = simulate(scene, state, 5e-4, dt=5e-7, method="rk8", record=Record(every=20))
    found = sensor_force(run, range(9))
    for number in (0, 4, 8):
        for row in range(len(run.t)):
            place, v = scene.places + run.u[row], run.v[row]
            k = run.u[row, number] / (np.linalg.norm(run.u[row, number]) or 1.0)
            ends = [(place[j] - place[number], v[j] - v[number], D, BEAD)
                    for j in range(9) if j != number]  # fmt: skip
            ends += [((w.point - place[number]) @ w.normal * w.normal, -v[number], D / 2, STEEL)
                     for w in SIDES.values()]  # fmt: skip
            total = 0.0
            for apart, speed, touch, other in ends:
                n = apart / np.linalg.norm(apart)
                d, rate = touch - np.linalg.norm(apart), -(n @ speed)
                if d > 0:
                    force = law(BEAD, other).constant * d**1.5 + (2.0 * rate if name else 0.0)
                    total += max(force, 0.0) * abs(n @ k) / 2
            assert found[row, number] == pytest.approx(total, rel=1e-6, abs=1e-9 * found.max())
    assert found.max() > 10.0


@pytest.mark.parametrize("name", LAWS)
def test_momentum_is_kept_and_energy_only_lost(name):
    scene, state = loose(3, 5, law=LAWS[name])
    run = simulate(scene, state, 3e-4, dt=1e-7, method="rk8", record=Record(every=20))
    momentum = run.v.sum(axis=1) * BEAD.mass
    scale = np.abs(state.v).sum() * BEAD.mass
    np.testing.assert_allclose(momentum, momentum[:1] + 0 * momentum, rtol=0, atol=1e-14 * scale)
    assert run.loss[-1] > 0.02 * run.energy[0]
    assert np.diff(run.loss).min() >= 0  # passive
    balance = run.energy + run.loss - run.energy[0]
    assert np.abs(balance).max() < 2e-6 * run.energy[0]


@pytest.mark.parametrize("name", LAWS)
def test_two_beads_that_meet_have_their_restitution(name):
    law = LAWS[name]
    scene = pack([[0.0, 0.0], [1.2 * D, 0.0]], BEAD, law=law)
    assert not len(scene.listed(scene.at_rest().u).bonds)
    run = simulate(scene, scene.at_rest({0: [5.0, 0.0]}), 2.1e-4, dt=2e-8, method="rk8")
    e = run.final.v[1, 0] - run.final.v[0, 0]
    assert e / 5.0 == pytest.approx(law(BEAD, BEAD).restitution(BEAD.mass / 2, 5.0)[0], abs=1e-4)


def test_forces_of_ones_own_act_in_contacts_that_form():
    """Drag on all sites, and a loss of one's own in contacts, against all pairs listed."""
    drag = Force((-C * SPEED * V_X, -C * SPEED * V_Y), parameters={"c": np.full(9, 1e-3)})
    scene, state = loose(3, 2, forces=(drag, KELVIN))
    pairs = list(itertools.combinations(range(9), 2))
    net = Network(
        scene.places, pairs, scene.listed(state.u).springs[0], lengths=D, mass=BEAD.mass,
        forces=(drag, KELVIN),
    )  # fmt: skip
    one, two = (simulate(x, state, 4e-4, dt=2e-7, method="rk8") for x in (scene, net))
    np.testing.assert_allclose(one.u, two.u, rtol=0, atol=1e-13 * abs(two.u).max())
    free = simulate(pack(scene.places, BEAD, forces=(drag,)), state, 4e-4, dt=2e-7, method="rk8")
    assert one.loss[-1] > 1.02 * free.loss[-1] > 0


def test_a_driven_bead_meets_others():
    """A bead on a prescribed way strikes one at rest far off: this leaves with twice the speed,
    and is slowed by the ground."""
    scene = pack(
        [[0.0, 0.0], [2 * D, 0.0]], BEAD, drive={0: Drive(displacement=(3.0 * T, 0.0 * T))},
        damping=Damping(ground=0.01),
    )  # fmt: skip
    run = simulate(scene, scene.at_rest(), 2.5e-3, dt=1e-7)
    decay = 0.01 / BEAD.mass
    begin = D / 3.0  # of the contact, which is short
    late = run.t > begin + 1e-4
    assert late.sum() > 10
    found = run.v[late, 1, 0] * np.exp(decay * (run.t[late] - begin))
    np.testing.assert_allclose(found, 6.0, rtol=2e-3)
    np.testing.assert_allclose(found, found[0], rtol=1e-5)
    balance = run.energy - run.energy[0] - run.work + run.loss
    assert np.abs(balance).max() < 2e-5 * run.energy.max()


def test_runs_resume_where_contacts_have_changed(tmp_path):
    scene, state = loose(3, 1, law=kuwabara_kono(1e-6))
    whole = simulate(scene, state, 3e-4, dt=3e-7, method="rk8")
    record = Record(every=1, path=tmp_path / "rows.npy", checkpoint=0.0)

    def stop(t, *_):
        if t > 2e-4:
            raise KeyboardInterrupt

    simulate(scene, state, 3e-4, dt=3e-7, method="rk8", record=record, observe=stop)
    ended = resume(tmp_path / "rows.npy", scene)
    np.testing.assert_array_equal(ended.final.u, whole.final.u)
    assert ended.loss[-1] == whole.loss[-1] > 0


def test_packs_without_dissipation_stay_as_they_were():
    scene, state = loose(2, 3, law=power(1e9, 1.5))
    run = simulate(scene, state, 1e-4, dt=1e-7)
    assert run.loss is None
    assert run.method != "rk8"


@pytest.mark.parametrize(
    ("words", "make"),
    [
        ("must be 0 where they are open", lambda: loose(2, 1, forces=[Force(RATE, "bonds")])),
        ("must be 0 where they are open", lambda: loose(2, 1, forces=[Force(R + 1, "walls")])),
        ("one value", lambda: pack([[0.0], [D]], BEAD, forces=[Force(KELVIN.expression, "bonds",
                                                                     parameters={"c": [1.0]})])),
        ("dashpots in bonds", lambda: loose(2, 1, damping=Damping(bond=0.1))),
        ("springs that change", lambda: Network(
            [[0.0], [1.0]], [(0, 1)], PowerLaw(1.0, 2.0).over_time(stiffness=1 + T), radius=0.1,
            contacts="follow", law=PowerLaw(1.0, 1.5))),
    ],
)  # fmt: skip
def test_what_depends_on_open_contacts_is_refused(words, make):
    with pytest.raises(TensegrityError, match=words):
        make()
