"""Random scenes with forces of velocity, drives, grounds and dashpots, and their exact motions.

{kind: function of a generator}, each of which gives a scene, its initial state, a duration, and the
exact motion: a function of instants (times,) that returns u and v (times, sites).  Transients are
up to hundreds of times faster than the run, at its start or later.  Half of the scenes are in the
units of a laboratory: masses of 1e-9 to 1e6 kg, velocities of lengths of 1e-5 to 1e2 m in times of
1e-6 to 1 s.
"""

from itertools import pairwise
from typing import NamedTuple

import numpy as np
import sympy as sp
from scipy.integrate import solve_ivp
from scipy.linalg import expm

from tensegrity import Chain, Damping, Drive, Force, Potential, State

R, K, L = sp.symbols("r k l")
T, U, V, RATE, C, W, P, B, S = sp.symbols("t u v rate c w p b s")
LINEAR = Potential(K * R**2 / 2, R, {"k": 1.0})
DRAG = {"linear": -C * V, "friction": -C * sp.tanh(V / W), "quadratic": -C * V * sp.Abs(V)}
PULSE = P * sp.exp(-(((T - B) / S) ** 2))


def linear(k):
    return LINEAR.varied({"k": float(k)})


def scale(rng, low, high):
    """A number whose logarithm is uniform."""
    return float(10 ** rng.uniform(np.log10(low), np.log10(high)))


class Units(NamedTuple):
    """Units of mass [kg], length [m] and time [s] of a scene."""

    mass: float
    length: float
    time: float

    speed = property(lambda of: of.length / of.time)
    stiffness = property(lambda of: of.mass / of.time**2)
    damping = property(lambda of: of.mass / of.time)
    force = property(lambda of: of.stiffness * of.length)


def row(rng):
    """Masses and stiffnesses of a short chain, its matrix of stiffness, and units."""
    n, units = int(rng.integers(2, 5)), Units(1.0, 1.0, 1.0)
    if rng.random() < 0.5:
        units = Units(scale(rng, 1e-9, 1e6), scale(rng, 1e-5, 1e2), scale(rng, 1e-6, 1.0))
    m, k = (np.array([scale(rng, 0.1, 3) for _ in range(size)]) for size in (n, n - 1))
    m, k, d = m * units.mass, k * units.stiffness, np.diff(np.eye(n), axis=0)
    return n, m, k, d.T @ (k[:, None] * d), d, units


def moving(rng, n, units):
    """Initial velocities, of which the first is not 0."""
    v = rng.normal(0, 1, n) * (rng.random(n) < 0.6)
    v[0] = rng.choice([-1, 1]) * rng.uniform(0.5, 1.5)
    return v * units.speed


def by_exponential(m, stiffness, loss, u, v, units, omega=0.0, pull=0.0):
    """Motion of a linear scene, with a force pull sin(omega t); in units in which numbers are 1."""
    n, m = len(m), m[:, None] / units.mass
    a, y = np.zeros((2 * n + 2, 2 * n + 2)), np.zeros(2 * n + 2)
    a[:n, n : 2 * n] = np.eye(n)
    a[n : 2 * n, :n], a[n : 2 * n, n : 2 * n] = (
        -stiffness / m / units.stiffness, -loss / m / units.damping,
    )  # fmt: skip
    y[:n], y[n : 2 * n], y[-1] = u / units.length, v / units.speed, 1.0
    a[2 * n, 2 * n + 1], a[2 * n + 1, 2 * n] = omega * units.time, -omega * units.time
    a[n : 2 * n, 2 * n] = pull / m[:, 0] / units.force

    def exact(t):
        at = expm(np.asarray(t)[:, None, None] / units.time * a) @ y
        return at[:, :n] * units.length, at[:, n : 2 * n] * units.speed

    return exact


def by_steps(n, rates, u, v, t_end, breaks=()):
    """Motion by the method of Dormand and Prince, of order 8, from break to break."""
    least = 1e-16 * np.repeat([np.max(np.abs(v)) * t_end, np.max(np.abs(v))], n)
    edges = [0.0, *sorted(x for x in breaks if 0 < x < t_end), t_end]

    def exact(t):
        y, found, t = np.concatenate([u, v]), np.full((len(t), 2 * n), np.nan), np.minimum(t, t_end)
        for low, high in pairwise(edges):
            here = (t >= low) & (t <= high)
            at = np.unique(np.append(t[here], high))
            made = solve_ivp(rates, (low, high), y, "DOP853", at, rtol=3e-14, atol=least)
            assert made.success, made.message
            found[here] = made.y.T[np.searchsorted(at, t[here])]
            y = made.y[:, -1]
        return found[:, :n], found[:, n:]

    return exact


def dragged(rng):
    """Linear drag on some masses, of a force."""
    n, m, k, stiffness, _, units = row(rng)
    at = sorted(rng.choice(n, int(rng.integers(1, n + 1)), replace=False).tolist())
    c = units.damping * np.array([scale(rng, 0.03, 30) for _ in at])
    scene = Chain([linear(x) for x in k], n, m, forces=(Force(-C * V, at=at, parameters={"c": c}),))
    loss, v = np.zeros(n), moving(rng, n, units)
    loss[at] = c
    t_end = units.time * scale(rng, 0.3, 12)
    u = np.zeros(n)
    return scene, State(u, v), t_end, by_exponential(m, stiffness, np.diag(loss), u, v, units)


def grounded(rng):
    """Linear drag and springs to the ground, one of which may be stiff."""
    n, m, k, stiffness, _, units = row(rng)
    ground = units.stiffness * np.array([scale(rng, 0.1, 30) for _ in m])
    c = units.damping * np.array([scale(rng, 0.03, 30) for _ in m])
    scene = Chain(
        [linear(x) for x in k], n, m, ground=[linear(x) for x in ground],
        forces=(Force(-C * V, parameters={"c": c}),),
    )  # fmt: skip
    u, v = 0.1 * units.length * rng.normal(size=n), moving(rng, n, units)
    exact = by_exponential(m, stiffness + np.diag(ground), np.diag(c), u, v, units)
    return scene, State(u, v), units.time * scale(rng, 0.3, 12), exact


def viscous(rng):
    """Kelvin and Voigt: dashpots beside the springs, of a force."""
    n, m, k, stiffness, d, units = row(rng)
    c = units.damping * np.array([scale(rng, 0.03, 10) for _ in k])
    scene = Chain(
        [linear(x) for x in k], n, m,
        forces=(Force(C * RATE, "bonds", parameters={"c": c}),),
    )  # fmt: skip
    u, v = np.zeros(n), moving(rng, n, units)
    exact = by_exponential(m, stiffness, d.T @ (c[:, None] * d), u, v, units)
    return scene, State(u, v), units.time * scale(rng, 0.3, 12), exact


def damped(rng):
    """Dashpots in bonds and to the ground."""
    n, m, k, stiffness, d, units = row(rng)
    bond, ground = (
        units.damping * np.array([scale(rng, 0.03, 10) for _ in range(size)]) for size in (n - 1, n)
    )
    scene = Chain([linear(x) for x in k], n, m, damping=Damping(bond, ground))
    u, v = np.zeros(n), moving(rng, n, units)
    exact = by_exponential(m, stiffness, d.T @ (bond[:, None] * d) + np.diag(ground), u, v, units)
    return scene, State(u, v), units.time * scale(rng, 0.3, 12), exact


def shaken(rng):
    """A force that oscillates, as a drive or as a force, with drag."""
    n, m, k, stiffness, _, units = row(rng)
    c, omega = units.damping * scale(rng, 0.03, 30), scale(rng, 0.3, 100) / units.time
    p = units.force * scale(rng, 0.1, 10)
    drag = Force(-C * V, at=[1], parameters={"c": c})
    more = {"forces": (drag,)}
    if rng.random() < 0.5:
        more["drive"] = {0: Drive(force=P * sp.sin(W * T), parameters={"p": p, "w": omega})}
    else:
        forced = Force(P * sp.sin(W * T), at=[0], parameters={"p": p, "w": omega})
        more["forces"] = (drag, forced)
    scene = Chain([linear(x) for x in k], n, m, **more)
    u, v, loss = np.zeros(n), moving(rng, n, units), np.zeros((n, n))
    loss[1, 1] = c
    pull = p * np.eye(n)[0]
    exact = by_exponential(m, stiffness, loss, u, v, units, omega, pull)
    return scene, State(u, v), units.time * scale(rng, 0.3, 12), exact


def rubbed(rng):
    """Smoothed dry friction, or quadratic drag."""
    n, m, k, stiffness, _, units = row(rng)
    at, c, w = int(rng.integers(0, n)), scale(rng, 0.1, 10), units.speed * scale(rng, 0.03, 1)
    kind = "friction" if rng.random() < 0.7 else "quadratic"
    c *= units.force if kind == "friction" else units.mass / units.length
    values = {"c": c, "w": w} if kind == "friction" else {"c": c}
    scene = Chain(
        [linear(x) for x in k], n, m, forces=(Force(DRAG[kind], at=[at], parameters=values),)
    )

    def rates(_t, y):
        a = -stiffness @ y[:n]
        v = y[n + at]
        a[at] -= c * np.tanh(v / w) if kind == "friction" else c * v * abs(v)
        return np.concatenate([y[n:], a / m])

    u, v, t_end = np.zeros(n), moving(rng, n, units), units.time * scale(rng, 0.3, 8)
    return scene, State(u, v), t_end, by_steps(n, rates, u, v, t_end)


def pulsed(rng):
    """A short pulse, early or late, with drag."""
    n, m, k, stiffness, _, units = row(rng)
    t_end = units.time * scale(rng, 0.5, 12)
    s = t_end * scale(rng, 5e-4, 0.1)
    b, c = rng.uniform(0, t_end), units.damping * scale(rng, 0.03, 10)
    p = units.mass * units.speed * scale(rng, 0.1, 3) / s
    values, more = {"p": p, "b": b, "s": s}, {}
    drag = Force(-C * V, at=[1], parameters={"c": c})
    kind = rng.integers(0, 3)
    if kind:
        more["drive"] = {0: Drive(force=PULSE, parameters=values)}
    if kind < 2:
        more["forces"] = (drag,) if kind else (drag, Force(PULSE, at=[0], parameters=values))
    scene = Chain([linear(x) for x in k], n, m, **more)
    c = 0.0 if kind == 2 else c

    def rates(t, y):
        a = -stiffness @ y[:n]
        a[0] += p * np.exp(-(((t - b) / s) ** 2))
        a[1] -= c * y[n + 1]
        return np.concatenate([y[n:], a / m])

    u, v = np.zeros(n), moving(rng, n, units)
    breaks = [b + x * s for x in (-6, -1, 0, 1, 6)]
    return scene, State(u, v), t_end, by_steps(n, rates, u, v, t_end, breaks)


def softened(rng):
    """A contact with a smooth law, whose loss grows with the overlap, struck late or early."""
    m, s = rng.uniform(0.2, 2, 2), scale(rng, 3e-3, 0.1)
    p, c, gap = scale(rng, 0.3, 30), scale(rng, 0.1, 10), rng.uniform(0.05, 1.0)
    overlap = S * sp.log(1 + sp.exp(-(R - B) / S))
    law = P * overlap * (C * RATE - 1)
    scene = Chain(
        linear(1e-3), 2, m,
        forces=(Force(law, "bonds", parameters={"p": p, "c": c, "s": s, "b": -gap}),),
    )  # fmt: skip
    u, v = np.zeros(2), np.array([rng.uniform(0.5, 1.5), 0.0])
    t_end = 3 * (gap + s) / v[0]

    def rates(_t, y):
        r, rate = y[1] - y[0], y[3] - y[2]
        tension = 1e-3 * r + p * s * np.logaddexp(0, -(r + gap) / s) * (c * rate - 1)
        return np.array([y[2], y[3], tension / m[0], -tension / m[1]])

    return scene, State(u, v), t_end, by_steps(2, rates, u, v, t_end)


KINDS = {
    one.__name__: one
    for one in (dragged, grounded, viscous, damped, shaken, rubbed, pulsed, softened)
}


def errors(run, exact):
    """Largest errors in u and v over the largest values, at most 1,500 rows, all early ones."""
    count, grid = len(run.t), np.linspace
    chosen = np.unique(np.append(np.arange(min(500, count)), grid(0, count - 1, 1000, dtype=int)))
    return max(
        float(np.max(np.abs(found[chosen] - right)) / np.max(np.abs(right)))
        for found, right in zip((run.u, run.v), exact(run.t[chosen]), strict=True)
    )
