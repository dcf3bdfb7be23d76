"""Gradients of networks: bonds that turn, walls, loads; guides and chains of beads."""

from dataclasses import replace

import numpy as np
import pytest
import sympy as sp
from complex_steps import derivative, net, run, tension_of

from granular import Bead, Striker, chain, fcc_pack, hertz, hexagonal_pack, materials, y_guide
from granular.contact import by_beads
from tensegrity import (
    Network,
    Potential,
    PowerLaw,
    State,
    TensegrityError,
    Wall,
    gradient,
    wall_gaps,
)
from tensegrity import objective as o

R, K = sp.symbols("r k")
ENERGY = K * R**2 / 2 + R**3 / 3
STEEL, PTFE = materials["steel"], materials["ptfe"]
BONDS = [(0, 1), (1, 2), (0, 3), (1, 4), (2, 5), (3, 4), (4, 5), (1, 3), (4, 2)]


def scene(dim, k, mass):
    """A strip that leans on a wall, under loads, a site held."""
    rng = np.random.default_rng(dim)
    places = np.array([[i % 3, i // 3, 0.3 * (i % 2)] for i in range(6)], float)[:, :dim]
    places = places + 0.05 * rng.standard_normal(places.shape)
    loads = 0.05 * rng.standard_normal(places.shape)
    normal = np.eye(dim)[1]
    wall = Wall(places[:3, 1].min() * normal - 0.2 * normal, normal)
    springs = [Potential(ENERGY, R, {"k": x}) for x in k]
    gaps = wall.height(places[:3]) - 0.2
    return Network(
        places, BONDS, springs, mass=mass, walls=[wall], wall_contacts=[(s, 0) for s in range(3)],
        wall_spring=PowerLaw(2.0, 1.5, 0.3), wall_gaps=gaps, radius=0.2, loads=loads, held=[5],
    )  # fmt: skip


def state_of(dim):
    rng = np.random.default_rng(7)
    u, v = 0.02 * rng.standard_normal((6, dim)), 0.1 * rng.standard_normal((6, dim))
    u[5] = v[5] = 0
    return u, v


CASES = [(2, "verlet"), (2, "rkn6"), (3, "rkn6")]


@pytest.mark.parametrize(("dim", "method"), CASES)
def test_gradients_of_networks_are_those_of_complex_steps(dim, method):
    k, mass = np.linspace(0.8, 1.6, len(BONDS)), np.linspace(1, 2, 6)
    network, (u, v) = scene(dim, k, mass), state_of(dim)
    dt, steps = 0.1, 30
    weights = np.random.default_rng(2).standard_normal((4, steps + 1))
    traces = [o.velocity(1, dim - 1), o.displacement(0, 1), o.load(wall=0), o.load(bond=3)]
    asked = o.of(traces, lambda t, y: (float(np.sum(weights * y)), weights))
    found = gradient(asked, network, State(u, v), steps * dt, dt=dt, method=method)
    tension = tension_of(ENERGY, R, K)
    normal = network.walls[0].normal
    gaps = wall_gaps(network, np.zeros((6, dim)))
    contact = network.springs[-1]
    constant, preload, overlap, _ = contact.values

    def push(r):
        return preload - constant * (overlap - r) ** 1.5

    def value(k=k, mass=mass, u=u, v=v):
        w = 1 / np.asarray(mass)
        w[5] = 0
        walls = [(s, normal, gaps[s], push) for s in range(3)]
        pulls = net(
            network.positions, BONDS, network.lengths, tension, (k,), w, walls, network.loads
        )
        x, y = run(pulls, u, v, method, dt, steps)
        apart = network.positions[4] + x[:, 4] - network.positions[1] - x[:, 1]
        load = -tension(np.sqrt(np.sum(apart**2, axis=1)) - network.lengths[3], k[3])
        walled = -sum(push(gaps[s] + x[:, s] @ normal) for s in range(3))
        return np.sum(weights * [y[:, 1, dim - 1], x[:, 0, 1], walled, load])

    assert found.value == pytest.approx(value(), rel=1e-10)
    for mine, name, array, places in (
        (found.u, "u", u, [(0, 0), (2, 1), (4, dim - 1)]),
        (found.v, "v", v, [(0, 1), (3, 0), (4, dim - 1)]),
        (found.mass, "mass", mass, [0, 3, 4]),
        (found.by("k"), "k", k, [0, 3, 8]),
    ):
        exact = [derivative(lambda x, n=name: value(**{n: x}), array, at) for at in places]
        ours = [mine[at] for at in places]
        assert np.abs(np.subtract(ours, exact)).max() < 1e-10 * np.abs(exact).max(), name
    assert found.reversal < 1e-12


def test_energy_of_all_sites_does_not_move_with_time():
    """But by what it began with: its derivatives are those of the start's energy."""
    k, mass = np.linspace(0.8, 1.6, len(BONDS)), np.linspace(1, 2, 6)
    network, state = scene(2, k, mass), State(*state_of(2))
    found = gradient(o.energy(), network, state, 1.0, dt=2e-3, method="rkn6")
    assert np.allclose(found.v[:5], (mass[:, None] * state.v)[:5], rtol=0, atol=1e-9)
    assert np.allclose(found.mass[:5], np.sum(state.v**2, axis=1)[:5] / 2, rtol=0, atol=1e-9)
    assert np.allclose(found.u, -network.forces(state.u), rtol=0, atol=1e-9)


def line_of(diameters, moduli, gravity=0.0):
    solids = [replace(STEEL if i % 2 else PTFE, modulus=e) for i, e in enumerate(moduli)]
    beads = [Bead(d, solid) for d, solid in zip(diameters, solids, strict=True)]
    return chain(beads[1:], striker=Striker(beads[0], 0.44), end=STEEL, gravity=gravity)


@pytest.mark.parametrize("gravity", [0.0, 9.81])
def test_diameters_and_moduli_of_a_chain_of_beads(gravity):
    diameters = np.linspace(5e-3, 9e-3, 5)
    moduli = np.array([(STEEL if i % 2 else PTFE).modulus for i in range(5)])
    beads = line_of(diameters, moduli, gravity)
    asked, run_of = o.p_norm(o.load(wall=0), 8), (beads.start(), 3e-4)
    found = gradient(asked, beads, *run_of, dt=4e-7)
    h = 1e-6
    for site in (0, 2, 4):
        step = 1 + h * np.eye(5)[site]
        for mine, own, moved in (
            (found.by("diameter"), diameters, lambda x: line_of(diameters * x, moduli, gravity)),
            (found.by("modulus"), moduli, lambda x: line_of(diameters, moduli * x, gravity)),
        ):
            values = [
                gradient(asked, moved(x), *run_of, dt=4e-7, wanted=()).value
                for x in (step, 2 - step)
            ]
            exact = (values[0] - values[1]) / (2 * h)
            assert mine[site] * own[site] == pytest.approx(exact, rel=1e-5, abs=1e-7)
    assert found.by("diameter").shape == (beads.sites,)


def guide():
    bead = Bead(4.76e-3, STEEL)
    return y_guide(4, 3, bead=bead, branches=(bead, bead), wall=STEEL,
                   striker=Striker(bead, 0.5), end=STEEL)  # fmt: skip


def plane():
    bead = Bead(9.53e-3, STEEL)
    return hexagonal_pack(3, 4, bead=bead, floor=STEEL, sides=STEEL, striker=Striker(bead, 1.0))


def space():
    bead = Bead(9.53e-3, STEEL)
    return fcc_pack(3, 3, bead=bead, floor=STEEL, sides=STEEL, striker=Striker(bead, 1.0))


@pytest.mark.parametrize(
    ("make", "wall", "t_end", "sites"),
    [(guide, -1, 1.2e-4, (0, 2, 6)), (plane, 0, 2e-4, (1, 5, 9)), (space, 0, 2e-4, (4, 13, 22))],
)
def test_diameters_of_beads_at_their_places_move_gaps_contacts_and_masses(make, wall, t_end, sites):
    """Against differences of networks with one bead smaller."""
    scene = make()
    wall %= len(scene.walls)
    asked, run_of = o.p_norm(o.load(wall=wall), 8), (scene.start(), t_end)
    found = gradient(asked, scene, *run_of, dt=2e-7, checkpoints=10)

    def other(site, less):
        """A bead smaller by `less` at its place."""
        beads = [Bead(b.diameter - less * (k == site), STEEL) for k, b in enumerate(scene.beads)]
        at, radius = scene.wall_contacts[:, 0], np.array([b.radius for b in beads])
        touching = np.array([b.radius for b in scene.beads])
        gaps = wall_gaps(scene, np.zeros(scene.shape)) + (touching - radius)[at]
        return Network(
            scene.positions, scene.bonds,
            [hertz(beads[i], beads[j]).spring() for i, j in scene.bonds],
            radius[scene.bonds].sum(axis=1), [b.mass for b in beads], scene.walls,
            wall_contacts=scene.wall_contacts, wall_gaps=gaps, radius=radius,
            wall_spring=[hertz(beads[i], STEEL).spring() for i in at],
        )  # fmt: skip

    h = 1e-12  # m: contacts touch, and any gap is a kink of higher order
    for site in sites:
        values = [
            gradient(asked, other(site, x), *run_of, dt=2e-7, wanted=()).value for x in (0.0, h)
        ]
        exact = (values[0] - values[1]) / h
        assert found.by("diameter")[site] == pytest.approx(exact, rel=2e-3)
        assert exact != 0


def test_beads_whose_contacts_are_not_hertz_do_not_say_how_they_depend_on_diameters():
    spring, bead = PowerLaw(1.0, 1.5), Bead(5e-3, STEEL)
    with pytest.raises(TensegrityError, match="not Hertz's"):
        by_beads("diameter", [bead] * 2, [(0, 1)], [spring], np.ones(1), np.ones(2), None)
    with pytest.raises(TensegrityError, match="not one of diameter, modulus"):
        by_beads("mass", [bead] * 2, [(0, 1)], [spring], np.ones(1), np.ones(2), None)
