"""Cost of the network loop: a double chain of 132 beads and a large lattice, against its peers.

Hertz contacts in the plane, velocity Verlet; nanoseconds per contact and step of the whole loop.
Peers do the same sums: NumPy with bincount, and a loop over contacts in numba where it is there.
"""

import warnings

import numpy as np

from benchmarks._timing import best, table
from tensegrity import Network, PowerLaw, State
from tensegrity.engine.compiled import Compiled
from tensegrity.engine.interpreted import Interpreted
from tensegrity.engine.kernel import bind
from tensegrity.engine.methods import METHODS

STIFFNESS, DT = 1.0, 1e-3
WORK = 3_000_000  # contact-steps of one call


def double_chain(beads=66):
    """Two rows of touching beads, joined side by side."""
    x = np.stack(np.meshgrid(np.arange(2.0), np.arange(float(beads))), -1).reshape(-1, 2)
    return _touching(x)


def lattice(side=224):
    """A square lattice of touching beads, about 1e5 contacts."""
    x = np.stack(np.meshgrid(*[np.arange(float(side))] * 2), -1).reshape(-1, 2)
    return _touching(x)


def _touching(x):
    from scipy.spatial import cKDTree

    pairs = np.sort(cKDTree(x).query_pairs(1.01, output_type="ndarray"), axis=1)
    pairs = pairs[np.lexsort(pairs.T[::-1])]
    return Network(x, pairs, PowerLaw(STIFFNESS, 1.5))


def _ours(kind, network, velocity, steps):
    bonds = network.loop_bonds
    u, v = network.arrays(State(np.zeros(network.shape), velocity))
    bound = bind(u, v, bonds, METHODS["verlet"], DT, kind.of(bonds))
    return lambda: bound.advance(steps)


def _numpy(network, velocity, steps):
    u, v, x = np.zeros_like(velocity), velocity.copy(), network.positions
    i, j = network.bonds.T
    sites, length = len(u), network.lengths

    def run():
        for _ in range(steps):
            apart = x[j] + u[j] - x[i] - u[i]
            distance = np.sqrt(apart[:, 0] ** 2 + apart[:, 1] ** 2)
            overlap = np.maximum(length - distance, 0)
            pull = -STIFFNESS * overlap * np.sqrt(overlap) / distance
            for axis in range(2):
                f = pull * apart[:, axis]
                v[:, axis] += DT * (np.bincount(i, f, sites) - np.bincount(j, f, sites))
            u[:] += DT * v

    return run


def _numba(network, velocity, steps):
    import numba

    @numba.njit(error_model="numpy")
    def loop(x, u, v, f, bonds, length, steps):
        for _ in range(steps):
            f[:] = 0
            for b in range(len(bonds)):
                i, j = bonds[b]
                dx = x[j, 0] + u[j, 0] - x[i, 0] - u[i, 0]
                dy = x[j, 1] + u[j, 1] - x[i, 1] - u[i, 1]
                distance = np.sqrt(dx * dx + dy * dy)
                overlap = max(length[b] - distance, 0.0)
                pull = -STIFFNESS * overlap * np.sqrt(overlap) / distance
                f[i, 0] += pull * dx
                f[i, 1] += pull * dy
                f[j, 0] -= pull * dx
                f[j, 1] -= pull * dy
            for k in range(len(u)):
                for axis in range(2):
                    v[k, axis] += DT * f[k, axis]
                    u[k, axis] += DT * v[k, axis]

    x, bonds, length = network.positions, network.bonds, network.lengths
    u, v, f = np.zeros_like(velocity), velocity.copy(), np.zeros_like(velocity)
    loop(x, u, v, f, bonds, length, 1)
    return lambda: loop(x, u, v, f, bonds, length, steps)


def rivals(network):
    """Calls of all contestants, and the contact-steps of one call of each."""
    velocity = 0.05 * np.random.default_rng(0).standard_normal(network.shape)
    contacts = len(network.bonds)
    steps = max(3, WORK // contacts)
    few = max(2, steps // 50)
    calls = {
        "compiled": _ours(Compiled, network, velocity, steps),
        "numpy bincount": _numpy(network, velocity, few),
        "interpreted": _ours(Interpreted, network, velocity, few),
    }
    work = {"compiled": steps * contacts}
    work |= dict.fromkeys(("numpy bincount", "interpreted"), few * contacts)
    try:
        calls["numba, error_model numpy"] = _numba(network, velocity, steps)
        work["numba, error_model numpy"] = steps * contacts
    except ImportError:
        warnings.warn("numba is not installed: pip install '.[bench]'", stacklevel=2)
    return calls, work


def main():
    """Print nanoseconds per contact-step and the ratios to the compiled loop."""
    cost = {}
    scenes = {"132 beads": double_chain(), "lattice": lattice()}
    for name, network in scenes.items():
        calls, work = rivals(network)
        cost[name] = {n: t / work[n] * 1e9 for n, t in best(calls).items()}
    names = list(cost["132 beads"])
    heads = [f"{name}, {len(network.bonds)} contacts" for name, network in scenes.items()]
    rows = [(n, *(cost[s][n] for s in scenes)) for n in names]
    table("ns per contact-step, velocity Verlet, Hertz contacts in the plane", ["", *heads], rows)
    rows = [(n, *(cost[s][n] / cost[s]["compiled"] for s in scenes)) for n in names]
    table("times the compiled loop", ["", *heads], rows)
