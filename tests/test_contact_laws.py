"""Contact laws of an extender in every scene and observable, against plain NumPy and SciPy.

Sizes are those of a laboratory: diameters of 10 um to 0.8 m, overlaps of 1e-6 to 1e-3 radii.
"""

import math
from dataclasses import dataclass, replace
from itertools import pairwise

import numpy as np
import pytest
from contact_laws import DMT, KINDS, law_of
from scipy.integrate import solve_ivp

from granular import (
    Bead,
    Contact,
    Striker,
    chain,
    energies,
    fcc_pack,
    hertz,
    hexagonal_pack,
    hunt_crossley,
    kuwabara_kono,
    materials,
    overlaps,
    pack,
    power,
    sensor_force,
    simulate,
    viscous,
    wall_force,
    y_guide,
)
from granular.lammps import to_lammps
from tensegrity import (
    Potential,
    Record,
    Run,
    State,
    TensegrityError,
    Wall,
    gradient,
    objective,
)

LOSSES = {"Kuwabara-Kono": kuwabara_kono, "Hunt-Crossley": hunt_crossley, "viscous": viscous}
NAMES = ("steel", "ptfe", "glass", "nylon", "bronze")


class Drawn:
    """Beads, a law, and the units of their contacts: overlap s [m], time [s], speed and force."""

    def __init__(self, kind, seed):
        self.rng = np.random.default_rng(seed)
        of = [materials[x] for x in self.rng.choice(NAMES, 2)]
        self.wall = of[1]
        self.bead = Bead(min(10 ** self.rng.uniform(-5, 0), 0.8), of[0])
        self.s = self.bead.radius * 10 ** self.rng.uniform(-6, -3)
        self.law = law_of(kind, self.s)
        k = hertz(self.bead, self.bead).constant
        self.force = k * self.s**1.5
        self.time = math.sqrt(self.bead.mass * self.s / self.force)
        self.speed = self.s / self.time

    def places(self, count, dim=2):
        x = np.zeros((count, dim))
        x[:, 0] = self.bead.diameter * np.arange(count)
        return x


def pushed(contacts, r, d_rest, u):
    """Compressive forces of a row at displacements, by the plain law."""
    d = d_rest - np.diff(u)
    return np.array([float(c.force(x)) for c, x in zip(contacts, d, strict=True)])


def reference(row, state, t_end, loads, held):
    """Displacements and velocities at t_end of a row under loads, by DOP853."""
    contacts, carried = row.contacts, np.cumsum(loads)[: row.sites - 1]
    d_rest = np.array([c.rest(f) for c, f in zip(contacts, carried, strict=True)])
    n = row.sites
    scale = np.abs(state.u).max() + d_rest.max() + np.abs(state.v).max() * t_end
    units = np.append(np.full(n, scale), np.full(n, scale / t_end))

    def rates(t, y):
        u, v = np.split(y * units, 2)
        f = pushed(contacts, None, d_rest, u) - carried
        a = (np.append(0, f) - np.append(f, 0)) / row.mass
        a[held] = 0
        return np.append(v, a) / units

    start = np.append(state.u, state.v) / units
    run = solve_ivp(rates, (0, t_end), start, "DOP853", rtol=1e-11, atol=1e-13)
    return *np.split(run.y[:, -1] * units, 2), d_rest


def check_row(kind, seed):
    """A chain under gravity and preload before a wall: motion, overlaps, forces, energies."""
    at = Drawn(kind, seed)
    load = at.force * float(at.rng.choice([0.0, 1.0]))
    row = chain([at.bead] * 4, preload=load, gravity=load / at.bead.mass / 3, end=at.wall,
                law=at.law)  # fmt: skip
    v = at.speed * 0.2 * at.rng.standard_normal(4)
    state = row.at_rest(dict(enumerate(v)))
    t_end = 6 * at.time
    run = simulate(row, state, t_end, dt=t_end / 1000, method="rkn6", record=Record(every=50))
    weights = [load + load / 3, *[load / 3] * 3, 0.0]
    u, v, d_rest = reference(row, state, t_end, weights, [4])
    smooth = kind != "table"  # whose forces have corners within the steps
    np.testing.assert_allclose(run.final.v, v, rtol=0, atol=at.speed * (1e-8 if smooth else 1e-5))
    np.testing.assert_allclose(run.final.u, u, rtol=0, atol=at.s * (1e-8 if smooth else 1e-5))
    d = d_rest - np.diff(run.u, axis=1)
    np.testing.assert_allclose(row.overlaps(run.u), d, rtol=0, atol=1e-12 * d.max())
    force = np.stack([c.force(d[:, j]) for j, c in enumerate(row.contacts)], axis=1)
    bound = 1e-11 * np.abs(force).max()
    np.testing.assert_allclose(row.contact_forces(run.u), force, rtol=0, atol=bound)
    np.testing.assert_allclose(wall_force(run, "end"), force[:, -1], rtol=0, atol=bound)
    np.testing.assert_allclose(sensor_force(run, "chain", 2), force[:, :2].mean(axis=1),
                               rtol=0, atol=bound)  # fmt: skip
    stored = np.array(
        [[c.stored(x) for c, x in zip(row.contacts, line, strict=True)] for line in d]
    )
    found = energies(run)
    np.testing.assert_allclose(found.stored.sum(axis=1), stored.sum(axis=1), rtol=0,
                               atol=1e-11 * np.abs(stored).max())  # fmt: skip
    assert overlaps(run)[0] >= d[:, :3].max() * (1 - 1e-12)


def check_pack(kind, seed, contacts):
    """A pair, and three on a floor: overlaps and energies at rest, forces in balance."""
    at = Drawn(kind, seed)
    pair = pack(at.places(2), at.bead, law=at.law, contacts=contacts)
    contact, u = at.law(at.bead, at.bead), pair.at_rest().u[None]
    rest = contact.rest(0.0) if contact.attracts else 0.0
    np.testing.assert_allclose(pair.overlaps(u), [[rest]], rtol=1e-6, atol=1e-14 * at.bead.diameter)
    stored = energies(simulate(pair, pair.at_rest(), at.time, dt=at.time / 50)).stored[0].sum()
    wanted = contact.stored(rest)
    assert stored == pytest.approx(wanted, rel=1e-9, abs=1e-9 * at.force * at.s)
    side = at.bead.diameter * np.array([[0.0, 0.5], [1.0, 0.5], [0.5, 0.5 + math.sqrt(0.75)]])
    box = {"floor": (Wall((0, 0), (0, 1)), at.wall),
           "left": (Wall((-at.bead.radius, 0), (1, 0)), at.wall),
           "right": (Wall((3 * at.bead.radius, 0), (-1, 0)), at.wall)}  # fmt: skip
    g = at.force / at.bead.mass
    heap = pack(side, at.bead, box, contacts, gravity=g, law=at.law)
    x = side + heap.equilibrium.u
    pull = np.zeros((3, 2))
    wall = at.law(at.bead, at.wall)
    for i, j in ((0, 1), (0, 2), (1, 2)):
        apart = x[j] - x[i]
        size = np.linalg.norm(apart)
        pull[j] += contact.force(at.bead.diameter - size) * apart / size
        pull[i] -= contact.force(at.bead.diameter - size) * apart / size
    for i in (0, 1):
        pull[i, 1] += wall.force(at.bead.radius - x[i, 1])
    pull[0, 0] += wall.force(-x[0, 0])
    pull[1, 0] -= wall.force(x[1, 0] - at.bead.diameter)
    pull[:, 1] -= g * at.bead.mass
    np.testing.assert_allclose(pull, 0, atol=1e-16 / 1e-6 * at.force * at.bead.radius / at.s * 1e-3)


def check_following(kind, seed):
    """Two beads that meet, after a gap, as a plain integration in NumPy has it."""
    at = Drawn(kind, seed)
    places = at.places(2)
    places[1] += [2 * at.s, 0.3 * at.bead.diameter]
    places[1, 0] = math.sqrt((at.bead.diameter + 2 * at.s) ** 2 - places[1, 1] ** 2)
    scene = pack(places, at.bead, law=at.law)
    contact, m = at.law(at.bead, at.bead), at.bead.mass
    n = (places[1] - places[0]) / np.linalg.norm(places[1] - places[0])
    v = 0.7 * at.speed * n
    run = simulate(scene, scene.at_rest({0: v}), 8 * at.time, dt=8 * at.time / 20_000,
                   record=Record(every=500))  # fmt: skip
    touch = 2 * at.s / (0.7 * at.speed)

    def rates(t, y):
        f = float(contact.force(y[0] * at.s)) / at.force
        return y[1], -2 * f

    def apart(t, y):
        return y[0] + 1e-300

    apart.terminal, apart.direction = True, -1
    span = 8 - touch / at.time
    ends = solve_ivp(rates, (0, span), (0.0, 0.7), "DOP853", events=apart, rtol=1e-12, atol=1e-14)
    across = (run.final.v[0] - run.final.v[1]) @ n / at.speed
    assert across == pytest.approx(ends.y[1, -1], abs=2e-3)
    np.testing.assert_allclose(run.final.v.sum(axis=0), v, rtol=0, atol=1e-9 * at.speed)
    assert run.energy_error < 2e-3
    assert m > 0


@pytest.mark.parametrize("kind", KINDS)
def test_a_row_moves_and_is_measured_as_by_plain_numpy(kind):
    for seed in range(2):
        check_row(kind, seed)


@pytest.mark.parametrize("contacts", ["fixed", "follow"])
@pytest.mark.parametrize("kind", KINDS)
def test_packs_rest_where_the_law_says(kind, contacts):
    for seed in range(3):
        check_pack(kind, seed, contacts)


@pytest.mark.parametrize("kind", KINDS)
def test_contacts_that_form_obey_the_law(kind):
    check_following(kind, 1)


@pytest.mark.slow
@pytest.mark.parametrize("kind", KINDS)
def test_laws_hold_at_many_scales(kind):
    for seed in range(100, 200):
        check_row(kind, seed)
        check_pack(kind, seed, ["fixed", "follow"][seed % 2])
    for seed in range(100, 110):
        check_following(kind, seed)
    print(f"{kind}: 100 rows, 200 packs at rest, 10 collisions")
