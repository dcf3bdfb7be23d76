"""Periodic orbits of networks, guides and packs, and their multipliers."""

import numpy as np
import pytest
import sympy as sp
from scipy.integrate import solve_ivp

from granular import Bead, hexagonal_pack, materials, y_guide
from tensegrity import (
    Chain,
    Network,
    Potential,
    Prism,
    State,
    TensegrityError,
    floquet,
    orbit_path,
    periodic_orbit,
)
from tensegrity.orbits.flow import Flow

R = sp.Symbol("r")
STIFFENING = Potential(R**2 / 2 + 5 * R**4, R)
PRISM = Prism(1.0, 0.7, 0.1, 1.0).potential()
STEEL = materials["steel"]
BEAD = Bead(diameter=0.01, material=STEEL)


def pack():
    """Five beads in a box, pressed on by 20 N each from above."""
    return hexagonal_pack(3, 2, bead=BEAD, floor=STEEL, sides=STEEL, preload=20.0)


def guide():
    return y_guide(2, 2, bead=BEAD, end=STEEL, preload=10.0)


def ring(dim):
    """Five masses without supports, each tied to all others."""
    turn = 2 * np.pi * np.arange(5) / 5
    at = np.stack([np.cos(turn), np.sin(turn), 0.4 * np.cos(2 * turn)], axis=1)[:, :dim]
    pairs = [(i, j) for i in range(5) for j in range(i)]
    return Network(at, pairs, STIFFENING, mass=[1.0, 1.5, 0.8, 1.2, 1.0])


def held():
    """Masses on a square of which one site is held."""
    at = [[0, 0], [1, 0], [1, 1], [0, 1]]
    return Network(at, [[0, 1], [1, 2], [2, 3], [3, 0], [0, 2], [1, 3]], STIFFENING, held=[0])


def mode(scene, number, size):
    """The state at rest moved along a mode of small vibrations, and its frequency [Hz]."""
    rest, free = scene.at_rest(), np.setdiff1d(np.arange(scene.sites), scene.held)
    free = (scene.dim * free[:, None] + np.arange(scene.dim)).ravel()
    root = np.sqrt(np.repeat(scene.mass, scene.dim)[free])
    stiffness = scene.stiffness(rest.u).toarray()[np.ix_(free, free)]
    squares, shapes = np.linalg.eigh(stiffness / np.outer(root, root))
    u = np.zeros(rest.u.size)
    u[free] = shapes[:, number] / root
    u *= size / np.abs(u).max()
    return State(rest.u + u.reshape(rest.u.shape), 0 * rest.u), np.sqrt(squares[number]) / 2 / np.pi


def variational(orbit):
    """State and tangent after a period by SciPy, from the scene's forces and stiffness; (2 free),
    (2 free, 2 free)."""
    scene, n = orbit.scene, orbit.state.u.size
    mass = np.repeat(scene.mass, scene.dim)[:, None]

    def rates(_, y):
        y = y.reshape(2 * n, -1)
        u, columns = y[:n, 0].reshape(scene.shape), y[:n, 1:]
        force = scene.forces(u).reshape(-1, 1)
        bent = -scene.stiffness(u) @ columns
        return np.concatenate([y[n:], np.hstack([force, bent]) / mass]).ravel()

    start = np.zeros((2 * n, 1 + 2 * n))
    start[:n, 0], start[:, 1:] = orbit.state.u.ravel(), np.eye(2 * n)
    sizes = np.ones((2, n, 1 + 2 * n))  # of displacements, velocities and columns
    sizes[0, :, 0] = np.abs(orbit.state.u).max()
    sizes[1, :, 0] = sizes[0, :, 0] / orbit.period
    sizes[0, :, 1 + n :], sizes[1, :, 1 : 1 + n] = orbit.period, 1 / orbit.period
    options = {"method": "DOP853", "rtol": 1e-9, "atol": 1e-9 * sizes.ravel()}
    end = solve_ivp(rates, (0, orbit.period), start.ravel(), **options).y[:, -1].reshape(2 * n, -1)
    free = np.setdiff1d(np.arange(scene.sites), scene.held)
    free = (scene.dim * free[:, None] + np.arange(scene.dim)).ravel()
    here = np.append(free, n + free)
    return end[here, 0], end[np.ix_(here, 1 + here)]


def test_a_network_on_a_line_has_the_orbits_of_the_chain():
    x = np.arange(21) - 10.0
    guess = 0.02 * np.cos(np.pi * x) / np.cosh(0.63 * x)
    line = Network(PRISM.length * x[:, None], [[k, k + 1] for k in range(20)], PRISM)
    chain, period = Chain(PRISM, 21), 1 / 0.58
    first = periodic_orbit(chain, State(guess, 0 * x), period=period)
    second = periodic_orbit(line, State(guess[:, None], 0 * x[:, None]), period=period)
    assert np.abs(first.state.u - second.state.u[:, 0]).max() < 1e-14
    assert second.energy == pytest.approx(first.energy, rel=1e-13)
    pairs = [floquet(one).multipliers for one in (first, second)]
    assert np.abs(pairs[0] - pairs[1]).max() < 1e-10
    ends = [orbit_path(one, by="energy", until=0.02).period[-1] for one in (first, second)]
    assert ends[0] == pytest.approx(ends[1], rel=1e-12)


CASES = {
    "plane": (ring(2), -1, 0.05, 1.02, 3),
    "space": (ring(3), -2, 0.05, 1.02, 6),
    "held": (held(), -1, 0.05, 1.02, 1),
    "pack": (pack(), 3, 3e-7, 0.999, 0),
    "guide": (guide(), -1, 2e-7, 0.999, 0),
}


@pytest.mark.parametrize("name", CASES)
def test_orbits_return_and_have_the_multipliers_of_scipys_variational_equations(name):
    scene, number, size, detuned, symmetries = CASES[name]
    guess, frequency = mode(scene, number, size)
    orbit = periodic_orbit(scene, guess, period=1 / (detuned * frequency))
    moved = np.abs(orbit.state.u - scene.at_rest().u).max()
    assert 0.05 * size < moved < 20 * size
    run = orbit.run(1e-11)
    assert np.abs(run.final.u - orbit.state.u).max() < 1e-8 * moved
    assert orbit.energy == pytest.approx(run.energy[0] - scene.energy(scene.at_rest()), rel=1e-9)
    found = floquet(orbit)
    assert len(found.neutral) == 2 * (1 + symmetries)
    assert np.abs(found.neutral - 1).max() < 1e-7
    end, whole = variational(orbit)
    at = orbit.state.u[np.setdiff1d(np.arange(scene.sites), scene.held)].ravel()
    assert np.abs(end[: len(at)] - at).max() < 1e-7 * moved
    exact = np.linalg.eigvals(whole)
    assert len(exact) == len(found.multipliers) + len(found.neutral)
    assert np.abs(found.multipliers[:, None] - exact).min(axis=1).max() < 1e-7


def gap_modes(cells, frequencies):
    """Orbits centred on a heavy mass of a closed ring of cells, masses 2 and 1; the ring is a line
    whose ends are joined by a spring that is its own mirror image."""
    n = 2 * cells
    law, apart = Potential(R**2 / 2 + R**4 / 4, R), np.arange(n) - cells
    bonds = [[k, k + 1] for k in range(n - 1)] + [[0, n - 1]]
    ring = Network(10.0 * np.arange(n)[:, None], bonds, law, mass=np.tile([2.0, 1.0], cells))
    guess = np.where(apart % 2, 0.0, 0.5 * np.cos(np.pi * apart / 2) / np.cosh(apart / 4))
    found = [State(guess[:, None], np.zeros((n, 1)))]
    for w in frequencies:
        found.append(periodic_orbit(ring, found[-1], period=2 * np.pi / w))
    return found[1:]


def test_a_gap_mode_of_a_ring_of_cells_rises_from_the_acoustic_edge_with_its_amplitude():
    """The law stiffens, and the band below, which ends at 1 rad/s, lets a mode into its gap up to
    the root of 2, where the next one begins; localised, it hardly depends on the ring."""
    frequencies = 1.1, 1.15, 1.2, 1.25
    short, long = gap_modes(16, frequencies), gap_modes(24, frequencies)
    sizes = [np.ptp(orbit.state.u) for orbit in long]
    assert (np.diff(sizes) > 0.05).all()
    edge = [(w**2 - 1) / size**2 for w, size in zip(frequencies, sizes, strict=True)]
    assert np.ptp(edge) < 0.1 * max(edge)  # its square grows as that of the amplitude
    apart = [abs(np.ptp(one.state.u) / size - 1) for one, size in zip(short, sizes, strict=True)]
    assert (np.diff(apart) < 0).all()
    assert apart[-1] < 1e-4
    for orbit in long:
        off = np.abs(orbit.run(1e-11).final.u - orbit.state.u).max()
        assert off < 1e-11


def test_tangents_of_a_network_are_symplectic_and_derivatives_of_the_flow():
    scene, time = pack(), 7e-5
    n, rest = 2 * scene.sites, scene.at_rest().u.ravel()
    u, v = 3e-7 * np.random.default_rng(0).normal(size=(2, n)) * np.array([[1.0], [3e4]])
    flow = Flow(scene, 60)
    tangent = flow.tangents(rest + u, v, time)[2]
    rates = np.repeat([1.0, 3e4], n)  # velocities over displacements
    scaled, form = tangent / rates[:, None] * rates, np.kron([[0, 1], [-1, 0]], np.eye(n))
    assert np.ptp(scene.mass) == 0  # so that the form has no masses
    assert np.abs(scaled.T @ form @ scaled - form).max() < 1e-12
    assert np.array_equal(flow.tangents(rest + u, v, time, of_u=False)[2], tangent[n:])
    for direction in np.random.default_rng(1).normal(size=(3, 2, n)):
        du, dv = direction * np.array([[1e-11], [3e-7]])
        ends = [np.concatenate(flow.end(rest + u + s * du, v + s * dv, time)) for s in (1, -1)]
        exact = tangent @ np.concatenate([du, dv])
        off = np.abs((ends[0] - ends[1]) / 2 - exact).reshape(2, n).max(axis=1)
        assert np.all(off < [1e-16, 3e-12])


WRONG = [
    (
        hexagonal_pack(2, 2, bead=BEAD, floor=STEEL, contacts="follow"),
        "detected during a run, must be fixed",
    ),
]


@pytest.mark.parametrize(("scene", "words"), WRONG)
def test_scenes_without_an_orbit_are_refused(scene, words):
    with pytest.raises(TensegrityError, match=words):
        periodic_orbit(scene, scene.at_rest(), period=1.0)
