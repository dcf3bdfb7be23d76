"""Other programs on the same scene, each given the law that our loop has.

SciPy's DOP853 calls our forces and takes any scene; numba, heyoka and JAX are handed the tension of
a chain's spring as an expression, and are run as an expert would.  What a program compiles before
its first run is timed apart.
"""

from __future__ import annotations

import importlib.util
import itertools
import math
import operator
import time
from collections.abc import Callable, Iterable, Iterator
from dataclasses import dataclass
from functools import cache, partial
from typing import Any

import numpy as np

from tensegrity import check
from tensegrity.engine.law import functions, interpret
from tensegrity.errors import TensegrityError
from tensegrity.scenes.chain import Chain
from tensegrity.scenes.dynamics import dynamics
from tensegrity.scenes.scene import State
from tensegrity.typing import Array

TAYLOR = 1e-4, 1e-6, 1e-9, 1e-12, 1e-15
TOLERANCES = 1e-3, 1e-5, 1e-7, 1e-9, 1e-11, 1e-13, 3e-14
HALVINGS = 5  # runs of a method of second order, each with a fourth of the steps of the next
SAME = "sqrt sin cos exp log sign"  # functions of SymPy with CasADi's names
NOT_COUNTED = partial(float, math.nan)
Tension = tuple[Any, Any]  # elongation and expression, of SymPy


def _package(name: str) -> Any:
    return check.package(name, f"the peer {name}", "bench")


def _same(call: Any) -> Any:
    return call


@dataclass(frozen=True)
class Entry:
    """One run of a program.

    Attributes
    ----------
    setting : str
        Its tolerance, or number of steps.
    prepare : callable () -> callable () -> (u, v)
        The inner call is timed.
    compiled : float
        Seconds spent before any run, once.
    evaluations : callable () -> float
        Evaluations of all forces in the last run, nan if they are not counted.
    """

    setting: str
    prepare: Callable[[], Callable[[], tuple[Array, Array]]]
    compiled: float = 0.0
    evaluations: Callable[[], float] = NOT_COUNTED


@dataclass(frozen=True)
class Peer:
    """A program to compare with.

    Attributes
    ----------
    name : str
    entries : callable (scene, state, t_end) -> iterable of Entry
        Its runs, the coarsest first; none of scenes that it cannot take.
    """

    name: str
    entries: Callable[[Any, State, float], Iterable[Entry]]


def runs_of(peers: Any) -> Iterator[Peer]:
    """The programs that are installed, of names and programs.

    Parameters
    ----------
    peers : sequence of str or Peer

    Raises
    ------
    TensegrityError
        An unknown name.
    """
    for one in check.sequence("peers", peers, "names of programs"):
        if isinstance(one, Peer):
            yield one
        elif not isinstance(one, str) or one not in PEERS:
            raise TensegrityError(
                f"peer {check.shown(one)} is not one of {', '.join(PEERS)}, nor a Peer"
            )
        elif importlib.util.find_spec(PACKAGE.get(one, one)) is not None:
            yield Peer(one, PEERS[one])


def chain_tension(scene: Any) -> Tension | None:
    """The tension of a chain's one spring by its elongation, or None if there is none that a
    program can be handed."""
    import sympy as sp

    if not isinstance(scene, Chain) or dynamics(scene).is_driven or dynamics(scene).is_loaded:
        return None
    if len(dynamics(scene).springs.different) != 1:
        return None
    import casadi as ca

    spring = dynamics(scene).springs.different[0]
    tension, r = functions(spring.law)["tension"], sp.Symbol("r", real=True)
    table: Any = {getattr(ca, f"OP_{x.upper()}"): getattr(sp, x) for x in SAME.split()}
    table |= {ca.OP_FMAX: sp.Max, ca.OP_FMIN: sp.Min, ca.OP_FABS: sp.Abs, ca.OP_NEG: operator.neg}
    table |= {ca.OP_ADD: operator.add, ca.OP_SUB: operator.sub, ca.OP_MUL: operator.mul}
    table |= {ca.OP_DIV: operator.truediv, ca.OP_POW: operator.pow, ca.OP_CONSTPOW: operator.pow}
    table |= {ca.OP_SQ: lambda a: a * a, ca.OP_TWICE: lambda a: 2 * a, ca.OP_INV: lambda a: 1 / a}

    def apply(operation: int, *values: Any) -> Any:
        return table[operation](
            *(sp.Float(float(x)) if isinstance(x, ca.SX) else x for x in values)
        )

    values = [sp.Float(x) for x in spring.values.tolist()]
    try:
        (found,) = interpret(tension, [[r], values], apply)
    except (KeyError, TypeError):
        return None
    return r, found


def of_chains(make: Callable[..., Iterable[Entry]]) -> Callable[[Any, State, float], Any]:
    """Entries of a program that is handed a tension."""

    def entries(scene: Any, state: State, t_end: float) -> Iterable[Entry]:
        tension = chain_tension(scene)
        return () if tension is None else make(scene, state, t_end, tension)

    return entries


def heyoka_system(chain: Chain, tension: Tension, parameters: Any = None) -> list[tuple[Any, Any]]:
    """Equations of motion of a chain in heyoka's expressions.

    Parameters
    ----------
    chain : Chain
    tension : (elongation, expression)
    parameters : dict, optional
        What symbols of the tension other than the elongation are.

    Returns
    -------
    list of (expression, expression)
    """
    hy = _package("heyoka")
    import sympy as sp

    def root(x: Any) -> Any:
        return hy.sqrt(x) if isinstance(x, hy.expression) else math.sqrt(x)

    given = parameters or {}
    law = sp.lambdify([tension[0], *given], tension[1], [{"sqrt": root}, "math"], cse=True)
    n, w = chain.sites, dynamics(chain).inverse_mass
    x = [hy.expression(f"x{i}") for i in range(n)]
    v = [hy.expression(f"v{i}") for i in range(n)]
    f = [law(x[i + 1] - x[i], *given.values()) for i in range(n - 1)]
    pulls = [f[0], *(b - a for a, b in itertools.pairwise(f)), -f[-1]]
    rates = [p * float(m) if m != 1 else p for p, m in zip(pulls, w, strict=True)]
    return [*zip(x, v, strict=True), *zip(v, rates, strict=True)]


def heyoka(
    chain: Chain, state: State, t_end: float, tension: Tension, tolerances: Any = TAYLOR
) -> Iterator[Entry]:
    """Taylor's method in compact mode, on smooth springs; the other mode takes minutes to compile a
    hundred sites.

    Parameters
    ----------
    chain, state, t_end
        As of `simulate`.
    tension : (elongation, expression)
    tolerances : sequence, optional

    Yields
    ------
    Entry
    """
    hy = _package("heyoka")

    if not dynamics(chain).smooth:
        return
    n, start = chain.sites, np.concatenate([state.u, state.v])
    system = heyoka_system(chain, tension)
    for tol in tolerances:
        began = time.perf_counter()
        solver = hy.taylor_adaptive(system, start.copy(), tol=tol, compact_mode=True)
        compiled = time.perf_counter() - began

        def prepare(solver: Any = solver) -> Any:
            solver.time, solver.state[:] = 0.0, start

            def run() -> tuple[Array, Array]:
                solver.propagate_until(t_end)
                return solver.state[:n].copy(), solver.state[n:].copy()

            return run

        yield Entry(f"{tol:g}", prepare, compiled)


def _dop853(scene: Any, state: State, t_end: float, side: Any = None) -> Iterator[Entry]:
    """SciPy's DOP853 with another right-hand side (t, y), with one in NumPy for chains of a smooth
    spring, or with our forces."""
    import sympy as sp
    from scipy.integrate import solve_ivp

    of = dynamics(scene)
    if of.batch or (side is None and (of.is_driven or of.follows or of.mass_matrix is not None)):
        return
    shape, start = state.u.shape, np.concatenate([state.u.ravel(), state.v.ravel()])
    half, size = state.u.size, float(np.abs([state.u, state.v]).max()) or 1.0
    weight = np.asarray(of.inverse_mass).reshape(len(state.u), *[1] * (len(shape) - 1))
    counted = [0]

    tension = chain_tension(scene) if side is None and not of.batch and of.smooth else None
    law: Any = tension and sp.lambdify(*tension, "numpy", cse=True)
    pulls = np.zeros(half + 1)

    def plain(_: float, y: Array) -> Array:
        with np.errstate(invalid="ignore"):  # a trial step too large, to be refused
            pulls[1:-1] = law(np.diff(y[:half]))
        return np.concatenate([y[half:], weight * np.diff(pulls)])

    def ours(_: float, y: Array) -> Array:
        try:
            forces = scene.forces(y[:half].reshape(shape))
        except TensegrityError:  # a trial step too large, to be refused
            return np.full(y.shape, np.nan)
        return np.concatenate([y[half:], (weight * forces).ravel()])

    for tol in TOLERANCES:

        def run(tol: float = tol) -> tuple[Array, Array]:
            options = {"method": "DOP853", "rtol": tol, "atol": tol * size}
            found = solve_ivp(side or (plain if law else ours), (0.0, t_end), start, **options)
            counted[0] = found.nfev
            y = found.y[:, -1] if found.success else np.full(start.shape, np.nan)
            return y[:half].reshape(shape), y[half:].reshape(shape)

        yield Entry(f"{tol:g}", partial(_same, run), evaluations=lambda: counted[0])


def numba_side(tension: Tension, w: Array) -> Any:
    """A right-hand side (t, y) of a chain with these inverse masses."""
    numba = _package("numba")
    import sympy as sp

    force = numba.njit(sp.lambdify(*tension, "math", cse=True), error_model="numpy")

    @numba.njit(error_model="numpy")  # type: ignore[untyped-decorator]
    def side(t: float, y: Array) -> Array:
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


def _dop853_compiled(chain: Chain, state: State, t_end: float, tension: Tension) -> Iterator[Entry]:
    """DOP853 with a right-hand side compiled by numba."""
    side, start = numba_side(tension, dynamics(chain).inverse_mass), np.append(state.u, state.v)
    began = time.perf_counter()
    side(0.0, start)
    compiled = time.perf_counter() - began
    for entry in _dop853(chain, state, t_end, side):
        yield Entry(entry.setting, entry.prepare, compiled, entry.evaluations)


def _halvings(chain: Chain, state: State, t_end: float) -> list[int]:
    """Numbers of steps of velocity Verlet, from near its stability limit."""
    of = dynamics(chain)
    omega = of.frequency(of.ranges_at(state.u)) or 1 / t_end
    return [math.ceil(t_end * omega * 4.0**k) for k in range(HALVINGS)]


def numba_loop(force: Callable[..., Any], **options: Any) -> Any:
    """Velocity Verlet on a chain of unit masses: (u, v, steps, parameters of the force, dt)."""
    numba = _package("numba")

    force = numba.njit(force, **options)

    @numba.njit(**options)  # type: ignore[untyped-decorator]
    def loop(u: Array, v: Array, steps: int, p: Any, dt: float) -> None:
        last = len(u) - 1
        for k in range(steps + 1):
            kick = dt / 2 if k in (0, steps) else dt
            drift = dt if k < steps else 0.0
            left = 0.0
            for first in range(0, last, 32):
                f = np.empty(32)
                n = min(32, last - first)
                for i in range(n):
                    f[i] = force(u[first + i + 1] - u[first + i], *p)
                for i in range(n):
                    v[first + i] += kick * (f[i] - left)
                    u[first + i] += drift * v[first + i]
                    left = f[i]
            v[last] -= kick * left
            u[last] += drift * v[last]

    return loop


@cache
def _loop(r: Any, expression: Any) -> Any:
    import sympy as sp

    force = sp.lambdify((r, sp.Symbol("unused")), expression, "math", cse=True)
    return numba_loop(force, error_model="numpy")


def numba_verlet(
    chain: Chain, state: State, t_end: float, tension: Tension, counts: Any = None
) -> Iterator[Entry]:
    """Velocity Verlet in numba, as an expert writes it; chains of free unit masses.

    Parameters
    ----------
    chain, state, t_end
        As of `simulate`.
    tension : (elongation, expression)
    counts : sequence, optional

    Yields
    ------
    Entry
    """
    if np.any(dynamics(chain).inverse_mass != 1):
        return
    began = time.perf_counter()
    loop = _loop(*tension)
    loop(state.u.copy(), state.v.copy(), 1, (0.0,), 0.0)
    compiled = time.perf_counter() - began
    for steps in counts or _halvings(chain, state, t_end):

        def prepare(steps: int = steps) -> Any:
            u, v = state.u.copy(), state.v.copy()

            def run() -> tuple[Array, Array]:
                loop(u, v, steps, (0.0,), t_end / steps)
                return u, v

            return run

        yield Entry(f"{steps} steps", prepare, compiled, partial(float, steps))


def in_jax(accelerations: Any, u: Array, v: Array, steps: int, dt: float) -> Any:
    """A call of velocity Verlet, compiled whole at the first.

    Parameters
    ----------
    accelerations : callable (u) -> array
    u, v : ndarray
    steps : int
    dt : float
        [s]

    Returns
    -------
    callable () -> (u, v)
    """
    jax = _package("jax")

    @jax.jit  # type: ignore[untyped-decorator]
    def whole(u: Any, v: Any) -> Any:
        def step(_: Any, now: Any) -> Any:
            u, v, a = now
            v = v + dt / 2 * a
            u = u + dt * v
            a = accelerations(u)
            return u, v + dt / 2 * a, a

        return jax.lax.fori_loop(0, steps, step, (u, v, accelerations(u)))[:2]

    return lambda: tuple(map(np.asarray, whole(u, v)))


def jax_verlet(
    chain: Chain, state: State, t_end: float, tension: Tension, counts: Any = None
) -> Iterator[Entry]:
    """Velocity Verlet in JAX; chains of equal masses 1.

    Parameters
    ----------
    chain, state, t_end
        As of `simulate`.
    tension : (elongation, expression)
    counts : sequence, optional

    Yields
    ------
    Entry
    """
    if np.any(dynamics(chain).inverse_mass != 1):
        return
    jax = _package("jax")
    import sympy as sp

    jax.config.update("jax_enable_x64", True)
    force = sp.lambdify(*tension, "jax", cse=True)

    def accelerations(u: Any) -> Any:
        return jax.numpy.diff(force(jax.numpy.diff(u)), prepend=0.0, append=0.0)

    for steps in counts or _halvings(chain, state, t_end):
        run = in_jax(accelerations, state.u, state.v, steps, t_end / steps)
        yield Entry(f"{steps} steps", partial(_same, run), evaluations=partial(float, steps))


PEERS: dict[str, Callable[[Any, State, float], Iterable[Entry]]] = {
    "dop853": _dop853,
    "dop853, compiled": of_chains(_dop853_compiled),
    "numba": of_chains(numba_verlet),
    "heyoka": of_chains(heyoka),
    "jax": of_chains(jax_verlet),
}
PACKAGE = {"dop853": "scipy", "dop853, compiled": "numba"}
