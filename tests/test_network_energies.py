"""Energies of many states of a network in one call, against sums with 50 digits, and NumPy."""

import math

import mpmath
import numpy as np
import pytest

from tensegrity import LockingError, Network, PowerLaw, Prism, State, Wall, simulate
from tensegrity.engine import energies
from tensegrity.scenes.dynamics import dynamics
from tensegrity.springs import collection

SITES, STATES = 40, 5
CONTACT, STRING = PowerLaw(1e6, 1.5), PowerLaw(3e4, 1.0, preload=1.0)
PRISM = Prism(1e-2, 1e-2, 0.0, 1e3).potential()


def mixed(dim, radius=2e-3, loads=True):
    """A chain of sites with more bonds across, of unequal springs in turn, and walls."""
    rng = np.random.default_rng(dim)
    places = np.zeros((SITES, dim))
    places[:, 0] = 0.05 * np.arange(SITES)
    places[:, 1:] = 0.02 * rng.standard_normal((SITES, dim - 1))
    bonds = [(k, k + 1) for k in range(SITES - 1)] + [(k + 3, k) for k in range(SITES - 3)]
    kinds = CONTACT, STRING, PRISM, PowerLaw(2e6, 1.5), PowerLaw(2e6, 2.0)
    lengths = [math.dist(places[i], places[j]) * (1 - 1e-4 * (n % 3))
               for n, (i, j) in enumerate(bonds)]  # fmt: skip
    axis = np.eye(dim)
    walls = [Wall(-0.1 * axis[0], axis[0]), Wall(3 * axis[0], -axis[0])]
    touches = [(site, wall) for site in range(0, SITES, 3) for wall in (0, 1)]
    return Network(
        places, bonds, [kinds[n % 5] for n in range(len(bonds))], lengths,
        mass=rng.uniform(0.1, 0.2, SITES), walls=walls, wall_contacts=touches,
        wall_spring=[(CONTACT, STRING)[n % 2] for n in range(len(touches))],
        radius=radius / 1e3, loads=rng.standard_normal((SITES, dim)) if loads else None,
    )  # fmt: skip


def states(scene, size=1e-4):
    rng = np.random.default_rng(7)
    shape = STATES, *scene.shape
    return size * rng.standard_normal(shape), 1e-2 * rng.standard_normal(shape)


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


@pytest.mark.parametrize("part", [1024, 3])
@pytest.mark.parametrize("dim", [1, 2, 3])
def test_energies_of_rows_are_those_summed_by_hand(monkeypatch, dim, part):
    monkeypatch.setattr(energies, "PART", part)
    scene = mixed(dim)
    u, v = states(scene)
    found = dynamics(scene).energies_in_one_call(u, v)
    for k in range(STATES):
        wanted, size = by_hand(scene, u[k], v[k])
        assert found[k] == pytest.approx(wanted, abs=2e-15 * size)
    np.testing.assert_array_equal(dynamics(scene).energies(u, v), found)


@pytest.mark.parametrize("loads", [True, False])
@pytest.mark.parametrize("dim", [1, 2, 3])
def test_energies_without_a_compiler_are_the_same(monkeypatch, dim, loads):
    scene = mixed(dim, loads=loads)
    u, v = states(scene)
    found = dynamics(scene).energies(u, v)
    monkeypatch.setattr(collection, "single", lambda law: None)
    other = mixed(dim, loads=loads)
    assert dynamics(other).energies_in_one_call is None
    np.testing.assert_allclose(dynamics(other).energies(u, v), found, rtol=1e-13)


def test_energies_do_not_depend_on_how_many_are_asked_for():
    scene = mixed(3)
    u, v = states(scene)
    every = dynamics(scene).energies(u, v)
    each = [scene.energy(State(*pair)) for pair in zip(u, v, strict=True)]
    np.testing.assert_array_equal(every, each)
    apart = np.asfortranarray(u), v  # in another order in memory
    np.testing.assert_allclose(dynamics(scene).energies(*apart), every, rtol=1e-13)
    assert dynamics(scene).energies(u[:0], v[:0]).shape == (0,)


def test_an_elongation_out_of_its_domain_is_refused():
    scene = mixed(3)
    u, v = states(scene)
    u[3, 2] -= 0.049 * (scene.positions[2] - scene.positions[1]) / 0.05
    with pytest.raises(LockingError):
        dynamics(scene).energies(u, v)


def test_a_network_of_no_bonds_moves_freely():
    scene = Network(np.eye(3), np.zeros((0, 2), dtype=int), CONTACT, mass=2.0)
    state = scene.at_rest({1: (1.0, 2.0, 2.0)})
    assert scene.energy(state) == 9.0
    assert simulate(scene, state, 1.0, dt=0.1).energy[-1] == pytest.approx(9.0, rel=1e-15)
