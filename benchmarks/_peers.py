"""Peers that the package does not know: heyoka's batch mode, LAMMPS, packs in JAX.

Those of single chains are `tensegrity.precision.peers`.
"""

from __future__ import annotations

import math
import time

import numpy as np
import sympy as sp

from tensegrity.precision.peers import TAYLOR, Entry, heyoka_system, in_jax


def has(name):
    """Whether a package can be imported; prints a message if not."""
    import importlib

    try:
        importlib.import_module(name)
    except ImportError as error:
        print(f"skipped: {name} ({error}); pip install '.[bench]'")
        return False
    return True


def prism_values(prism, r):
    """Values for the formulas in the height of a rigid-elastic prism, extended by r."""
    from derivations import rigid_elastic
    from derivations.prism import circumradius, k_cross, natural_cross

    radius = prism.base / math.sqrt(3)
    bar = math.sqrt(prism.height**2 + 2 * radius**2 * (1 - math.cos(5 * math.pi / 6)))
    return {
        circumradius: radius, rigid_elastic.bar: bar, k_cross: prism.k_cross,
        natural_cross: float(prism.natural_lengths().cross),
        rigid_elastic.height: prism.height + r,
    }  # fmt: skip


def prism_tension(prism):
    """The textbook form of the force of a rigid-elastic prism in terms of the height."""
    from derivations import rigid_elastic

    r = sp.Symbol("r")
    return r, rigid_elastic.force().subs(prism_values(prism, r))


def heyoka_batch(chain, states, t_end, tension, tolerances=TAYLOR):
    """Taylor's method with one chain in each lane of a vector; u and v of shape (sites, lanes)."""
    if not has("heyoka"):
        return
    import heyoka as hy

    n, start = chain.sites, np.concatenate([states.u, states.v])
    lanes = start.shape[1]
    system = heyoka_system(chain, tension)
    for tol in tolerances:
        began = time.perf_counter()
        solver = hy.taylor_adaptive_batch(system, start.copy(), tol=tol, compact_mode=True)
        compiled = time.perf_counter() - began

        def prepare(solver=solver):
            solver.set_time(np.zeros(lanes))
            solver.state[:] = start

            def run():
                solver.propagate_until([t_end] * lanes)
                return solver.state[:n].copy(), solver.state[n:].copy()

            return run

        yield Entry(f"{tol:g}", prepare, compiled)


def pack_in_jax(network, velocity, steps, dt):
    """Velocity Verlet of a pack of equal beads in JAX, with the sums of `network.in_numba`."""
    import jax

    jax.config.update("jax_enable_x64", True)
    jnp, x, (i, j) = jax.numpy, network.positions, network.bonds.T
    k, k_wall = (network.springs[at].values[0] for at in (0, -1))
    site, wall = network.wall_contacts.T
    normal = np.array([network.walls[w].normal for w in wall])
    offset = np.array([network.walls[w].normal @ network.walls[w].point for w in wall])
    radius, mass = network.radius[0], network.mass[0]

    def accelerations(u):
        apart = (x + u)[j] - (x + u)[i]
        distance = jnp.sqrt((apart**2).sum(axis=1))
        pull = -k * jnp.maximum(network.lengths - distance, 0.0) ** 1.5 / distance
        force, height = pull[:, None] * apart, (normal * (x + u)[site]).sum(axis=1) - offset
        push = (k_wall * jnp.maximum(radius - height, 0.0) ** 1.5)[:, None] * normal
        return jnp.zeros_like(u).at[i].add(force).at[j].add(-force).at[site].add(push) / mass

    return in_jax(accelerations, 0 * velocity, velocity, steps, dt)


def lammps(scene, state, t_end, steps, walls=()):
    """Velocity Verlet with rotation off; steel beads of `benchmarks.lammps` only."""
    from benchmarks import lammps as peer

    module = peer.library()
    if module is None:
        return
    flat = not hasattr(scene, "positions")
    line = peer.STEEL.diameter * np.arange(scene.sites)
    places = np.stack([line, 0 * line], axis=1) if flat else scene.positions
    for count in steps:

        def prepare(count=count):
            system = peer.Peer(module, places, walls, "history")
            system.core.command(f"timestep {t_end / count:.17g}")
            system.core.command("run 0")

            def run():
                system.run(count)
                u, v = system.positions() - places, system.velocities()
                return (u[:, 0], v[:, 0]) if flat else (u, v)

            return run

        yield Entry(f"{count} steps", prepare, evaluations=lambda count=count: count)
