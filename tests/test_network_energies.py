"""Energies of networks against sums with 50 digits, and of rows against each state alone."""

import math

import mpmath
import numpy as np
import pytest

from tensegrity import LockingError, Network, PowerLaw, Prism, Record, State, Wall, simulate

CONTACT, STRING = PowerLaw(1e6, 1.5), PowerLaw(3e4, 1.0, preload=1.0)
PRISM = Prism(1e-2, 1e-2, 0.0, 1e3).potential()


def mixed(dim, sites=40):
    """A chain of sites with more bonds across, of unequal springs in turn, and walls."""
    rng = np.random.default_rng(dim)
    places = np.zeros((sites, dim))
    places[:, 0] = 0.05 * np.arange(sites)
    places[:, 1:] = 0.02 * rng.standard_normal((sites, dim - 1))
    bonds = [(k, k + 1) for k in range(sites - 1)] + [(k + 3, k) for k in range(sites - 3)]
    kinds = CONTACT, STRING, PRISM, PowerLaw(2e6, 1.5), PowerLaw(2e6, 2.0)
    lengths = [math.dist(places[i], places[j]) * (1 - 1e-4 * (n % 3))
               for n, (i, j) in enumerate(bonds)]  # fmt: skip
    axis = np.eye(dim)
    walls = [Wall(-0.1 * axis[0], axis[0]), Wall((1 + 0.05 * sites) * axis[0], -axis[0])]
    touches = [(site, wall) for site in range(0, sites, 3) for wall in (0, 1)]
    return Network(
        places, bonds, [kinds[n % 5] for n in range(len(bonds))], lengths,
        mass=rng.uniform(0.1, 0.2, sites), walls=walls, wall_contacts=touches,
        wall_spring=[(CONTACT, STRING)[n % 2] for n in range(len(touches))],
        radius=2e-6, loads=rng.standard_normal((sites, dim)),
    )  # fmt: skip


def moved(scene, size=1e-4):
    rng = np.random.default_rng(7)
    u, v = rng.standard_normal((2, *scene.shape))
    return State(size * u, 1e-2 * v)


def by_hand(scene, u, v):
    """Total energy and the sum of the sizes of its terms; elongations with 50 digits."""
    with mpmath.workdps(50):
        x = [[mpmath.mpf(a) + mpmath.mpf(b) for a, b in zip(*rows, strict=True)]
             for rows in zip(scene.positions.tolist(), u.tolist(), strict=True)]  # fmt: skip
        r = [
            mpmath.sqrt(sum((a - b) ** 2 for a, b in zip(x[i], x[j], strict=True))) - length
            for (i, j), length in zip(scene.bonds.tolist(), scene.lengths.tolist(), strict=True)
        ]
        for site, wall in scene.wall_contacts.tolist():
            of = scene.walls[wall]
            each = zip(of.normal.tolist(), x[site], of.point.tolist(), strict=True)
            height = sum(mpmath.mpf(n) * (a - mpmath.mpf(p)) for n, a, p in each)
            r.append(height - mpmath.mpf(float(scene.radius[site])))
    terms = [float(s.energy(float(one))) for s, one in zip(scene.springs, r, strict=True)]
    terms += (0.5 * scene.mass[:, None] * v**2).ravel().tolist()
    terms += (-scene.loads * u).ravel().tolist()
    return math.fsum(terms), math.fsum(map(abs, terms))


@pytest.mark.parametrize(("dim", "sites"), [(1, 40), (2, 40), (2, 600), (3, 40)])
def test_energies_are_those_summed_by_hand(dim, sites):
    scene = mixed(dim, sites)
    state = moved(scene)
    wanted, size = by_hand(scene, state.u, state.v)
    assert scene.energy(state) == pytest.approx(wanted, abs=2e-15 * size)


@pytest.mark.parametrize("dim", [1, 2, 3])
def test_energies_of_rows_are_those_of_each_alone(dim):
    scene = mixed(dim)
    run = simulate(scene, moved(scene, 1e-5), 2e-5, dt=1e-6, record=Record(every=2))
    each = [scene.energy(State(u, v)) for u, v in zip(run.u, run.v, strict=True)]
    np.testing.assert_array_equal(run.energy, each)


def test_an_elongation_out_of_its_domain_is_refused():
    scene = mixed(3)
    state = moved(scene)
    state.u[2] -= 0.049 * (scene.positions[2] - scene.positions[1]) / 0.05
    with pytest.raises(LockingError):
        scene.energy(state)


def test_a_network_of_no_bonds_moves_freely():
    scene = Network(np.eye(3), np.zeros((0, 2), dtype=int), CONTACT, mass=2.0)
    state = scene.at_rest({1: (1.0, 2.0, 2.0)})
    assert scene.energy(state) == 9.0
    assert simulate(scene, state, 1.0, dt=0.1).energy[-1] == pytest.approx(9.0, rel=1e-15)
