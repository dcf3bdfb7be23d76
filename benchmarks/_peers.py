"""Peers: the same chains in heyoka.py, SciPy, numba, JAX and LAMMPS.

Each function gives `Entry` values.  Compilation before a run is timed separately.  A tension is a
function of modules, because each peer requires it in its own: (elongation) -> tension, from
`lambdify`.
"""

from __future__ import annotations

import itertools
import math
import time
from collections.abc import Callable
from dataclasses import dataclass
from functools import cache, partial

import numpy as np
import sympy as sp

from benchmarks.chain import numba_loop
from tensegrity.scenes.dynamics import dynamics

HEYOKA = (1e-4, 1e-6, 1e-9, 1e-12, 1e-15)
SCIPY = (1e-3, 1e-5, 1e-7, 1e-9, 1e-11, 1e-13, 3e-14)


@dataclass(frozen=True)
class Entry:
    """One run of one contestant.

    Attributes
    ----------
    name, setting : str
    prepare : callable () -> callable () -> (u, v)
        The inner call is timed.
    compiled : float
        Seconds spent before any run, once.
    """

    name: str
    setting: str
    prepare: Callable
    compiled: float = 0.0


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


def polynomial_tension(fit):
    """A fitted tension by Horner's rule."""
    r = sp.Symbol("r")
    middle, per_half, at_rest, *q = fit.values.tolist()
    t, value = (r - middle) * per_half, sp.Float(0)
    for coefficient in q[::-1]:
        value = value * t + coefficient
    return r, at_rest + r * value


def heyoka_system(chain, tension, parameters=None):
    """Equations of motion of a chain in heyoka's expressions; `parameters`: what symbols of the
    tension other than the elongation are."""
    import heyoka as hy

    def root(x):
        return hy.sqrt(x) if isinstance(x, hy.expression) else math.sqrt(x)

    given = parameters or {}
    law = sp.lambdify([tension[0], *given], tension[1], [{"sqrt": root}, "math"], cse=True)
    force = partial(law, **{str(symbol): value for symbol, value in given.items()})
    n, w = chain.sites, dynamics(chain).inverse_mass
    x = [hy.expression(f"x{i}") for i in range(n)]
    v = [hy.expression(f"v{i}") for i in range(n)]
    f = [force(x[i + 1] - x[i]) for i in range(n - 1)]
    pulls = [f[0], *(b - a for a, b in itertools.pairwise(f)), -f[-1]]
    rates = [p * float(m) if m != 1 else p for p, m in zip(pulls, w, strict=True)]
    return [*zip(x, v, strict=True), *zip(v, rates, strict=True)]


def heyoka(chain, state, t_end, tension, tolerances=HEYOKA):
    """Taylor's method in compact mode; the other mode takes minutes to compile a hundred sites."""
    if not has("heyoka"):
        return
    import heyoka as hy

    n, start = chain.sites, np.concatenate([state.u, state.v])
    system = heyoka_system(chain, tension)
    for tol in tolerances:
        began = time.perf_counter()
        solver = hy.taylor_adaptive(system, start.copy(), tol=tol, compact_mode=True)
        compiled = time.perf_counter() - began

        def prepare(solver=solver):
            solver.time, solver.state[:] = 0.0, start

            def run():
                solver.propagate_until(t_end)
                return solver.state[:n].copy(), solver.state[n:].copy()

            return run

        yield Entry("heyoka", f"{tol:g}", prepare, compiled)


def heyoka_batch(chain, states, t_end, tension, tolerances=HEYOKA):
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

        yield Entry("heyoka batch 8", f"{tol:g}", prepare, compiled)


def scipy(chain, state, t_end, tension, tolerances=SCIPY):
    """DOP853 with the right-hand side in NumPy, and compiled by numba."""
    from scipy.integrate import solve_ivp

    n, w = chain.sites, dynamics(chain).inverse_mass
    start = np.concatenate([state.u, state.v])
    force = sp.lambdify(*tension, "numpy", cse=True)
    edges = np.zeros(n + 1)

    def plain(t, y):
        with np.errstate(invalid="ignore"):  # a trial step too large, to be refused
            edges[1:-1] = force(np.diff(y[:n]))
        return np.concatenate([y[n:], w * np.diff(edges)])

    sides, compiled = {"scipy DOP853, numpy": plain}, 0.0
    if has("numba"):
        began = time.perf_counter()
        sides["scipy DOP853, compiled"] = side = _numba_side(tension, w)
        side(0.0, start)
        compiled = time.perf_counter() - began
    size = float(np.abs(start).max())
    for name, side in sides.items():
        for tol in tolerances:

            def prepare(side=side, tol=tol):
                def run():
                    options = {"method": "DOP853", "rtol": tol, "atol": tol * size}
                    y = solve_ivp(side, (0.0, t_end), start, **options).y[:, -1]
                    return y[:n], y[n:]

                return run

            yield Entry(name, f"{tol:g}", prepare, compiled if name.endswith("d") else 0.0)


def _numba_side(tension, w):
    import numba

    force = numba.njit(sp.lambdify(*tension, "math", cse=True), error_model="numpy")

    @numba.njit(error_model="numpy")
    def side(t, y):
        n = len(y) // 2
        rate = np.empty(2 * n)
        left = 0.0
        for i in range(n - 1):
            right = force(y[i + 1] - y[i])
            rate[i] = y[n + i]
            rate[n + i] = w[i] * (right - left)
            left = right
        rate[n - 1] = y[2 * n - 1]
        rate[2 * n - 1] = -w[n - 1] * left
        return rate

    return side


def numba_verlet(chain, state, t_end, tension, counts):
    """Velocity Verlet in numba, as an expert writes it; chains of free unit masses."""
    if np.any(dynamics(chain).inverse_mass != 1) or not has("numba"):
        return
    r, expression = tension
    began = time.perf_counter()
    loop = _loop(r, expression)
    loop(state.u.copy(), state.v.copy(), 1, (0.0,), 0.0)
    compiled = time.perf_counter() - began
    for steps in counts:

        def prepare(steps=steps):
            u, v = state.u.copy(), state.v.copy()

            def run():
                loop(u, v, steps, (0.0,), t_end / steps)
                return u, v

            return run

        yield Entry("numba verlet", f"{steps} steps", prepare, compiled)


@cache
def _loop(r, expression):
    force = sp.lambdify((r, sp.Symbol("unused")), expression, "math", cse=True)
    return numba_loop(force, error_model="numpy")


def jax_verlet(chain, state, t_end, tension, counts):
    """Velocity Verlet in JAX; chains of equal masses 1."""
    if np.any(dynamics(chain).inverse_mass != 1) or not has("jax"):
        return
    import jax

    jax.config.update("jax_enable_x64", True)
    force = sp.lambdify(*tension, "jax", cse=True)

    def accelerations(u):
        return jax.numpy.diff(force(jax.numpy.diff(u)), prepend=0.0, append=0.0)

    for steps in counts:
        run = in_jax(accelerations, state.u, state.v, steps, t_end / steps)
        yield Entry("JAX verlet", f"{steps} steps", lambda run=run: run)


def in_jax(accelerations, u, v, steps, dt):
    """A call of velocity Verlet, compiled whole at the first: u and v."""
    import jax

    @jax.jit
    def whole(u, v):
        def step(_, now):
            u, v, a = now
            v = v + dt / 2 * a
            u = u + dt * v
            a = accelerations(u)
            return u, v + dt / 2 * a, a

        return jax.lax.fori_loop(0, steps, step, (u, v, accelerations(u)))[:2]

    return lambda: tuple(map(np.asarray, whole(u, v)))


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


def lammps(scene, t_end, steps, walls=()):
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

        yield Entry("LAMMPS", f"{count} steps", prepare)
