"""Random scenes with forces of velocity, drives, grounds and dashpots, and their exact motions.

{kind: function of a generator}, each of which gives a scene, its initial state, a duration, and the
exact motion: a function of instants (times,) that returns u and v (times, sites).  Transients are
up to hundreds of times faster than the run, at its start or later.
"""

import numpy as np
import sympy as sp
from scipy.integrate import solve_ivp
from scipy.linalg import expm

from tensegrity import Chain, Damping, Drive, Force, Potential, PowerLaw, State

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


def row(rng):
    """Masses and stiffnesses of a short chain, and its matrix of stiffness."""
    n = int(rng.integers(2, 5))
    m, k = (np.array([scale(rng, 0.1, 3) for _ in range(size)]) for size in (n, n - 1))
    d = np.diff(np.eye(n), axis=0)
    return n, m, k, d.T @ (k[:, None] * d), d


def moving(rng, n):
    """Initial velocities, of which the first is not 0."""
    v = rng.normal(0, 1, n) * (rng.random(n) < 0.6)
    v[0] = rng.choice([-1, 1]) * rng.uniform(0.5, 1.5)
    return v


def by_exponential(m, stiffness, loss, u, v, omega=None, pull=None):
    """Motion of a linear scene, with a force pull sin(omega t)."""
    n = len(m)
    a = np.zeros((2 * n + 2, 2 * n + 2))
    a[:n, n : 2 * n] = np.eye(n)
    a[n : 2 * n, :n], a[n : 2 * n, n : 2 * n] = -stiffness / m[:, None], -loss / m[:, None]
    y = np.concatenate([u, v, [0.0, 0.0]])
    if omega:
        a[2 * n, 2 * n + 1], a[2 * n + 1, 2 * n], y[-1] = omega, -omega, 1.0
        a[n : 2 * n, 2 * n] = pull / m

    def exact(t):
        at = expm(np.asarray(t)[:, None, None] * a) @ y
        return at[:, :n], at[:, n : 2 * n]

    return exact


def by_steps(n, rates, u, v, t_end, breaks=()):
    """Motion by the method of Dormand and Prince, of order 8, from break to break."""
    edges = [0.0, *sorted(x for x in breaks if 0 < x < t_end), t_end]

    def exact(t):
        y, found, t = np.concatenate([u, v]), np.full((len(t), 2 * n), np.nan), np.minimum(t, t_end)
        for low, high in zip(edges[:-1], edges[1:], strict=True):
            here = (t >= low) & (t <= high)
            at = np.unique(np.append(t[here], high))
            made = solve_ivp(rates, (low, high), y, "DOP853", at, rtol=3e-14, atol=1e-16)
            assert made.success, made.message
            found[here] = made.y.T[np.searchsorted(at, t[here])]
            y = made.y[:, -1]
        return found[:, :n], found[:, n:]

    return exact


def dragged(rng):
    """Linear drag on some masses, of a force."""
    n, m, k, stiffness, _ = row(rng)
    at = sorted(rng.choice(n, int(rng.integers(1, n + 1)), replace=False).tolist())
    c = np.array([scale(rng, 0.03, 30) for _ in at])
    scene = Chain([linear(x) for x in k], n, m, forces=(Force(-C * V, at=at, parameters={"c": c}),))
    loss, v = np.zeros(n), moving(rng, n)
    loss[at] = c
    t_end = scale(rng, 0.3, 12)
    u = np.zeros(n)
    return scene, State(u, v), t_end, by_exponential(m, stiffness, np.diag(loss), u, v)


def grounded(rng):
    """Linear drag and springs to the ground, one of which may be stiff."""
    n, m, k, stiffness, _ = row(rng)
    ground = np.array([scale(rng, 0.1, 30) for _ in m])
    c = np.array([scale(rng, 0.03, 30) for _ in m])
    scene = Chain(
        [linear(x) for x in k], n, m, ground=[linear(x) for x in ground],
        forces=(Force(-C * V, parameters={"c": c}),),
    )  # fmt: skip
    u, v = 0.1 * rng.normal(size=n), moving(rng, n)
    exact = by_exponential(m, stiffness + np.diag(ground), np.diag(c), u, v)
    return scene, State(u, v), scale(rng, 0.3, 12), exact


def viscous(rng):
    """Kelvin and Voigt: dashpots beside the springs, of a force."""
    n, m, k, stiffness, d = row(rng)
    c = np.array([scale(rng, 0.03, 10) for _ in k])
    scene = Chain(
        [linear(x) for x in k], n, m,
        forces=(Force(C * RATE, "bonds", parameters={"c": c}),),
    )  # fmt: skip
    u, v = np.zeros(n), moving(rng, n)
    exact = by_exponential(m, stiffness, d.T @ (c[:, None] * d), u, v)
    return scene, State(u, v), scale(rng, 0.3, 12), exact


def damped(rng):
    """Dashpots in bonds and to the ground."""
    n, m, k, stiffness, d = row(rng)
    bond, ground = (np.array([scale(rng, 0.03, 10) for _ in range(size)]) for size in (n - 1, n))
    scene = Chain([linear(x) for x in k], n, m, damping=Damping(bond, ground))
    u, v = np.zeros(n), moving(rng, n)
    exact = by_exponential(m, stiffness, d.T @ (bond[:, None] * d) + np.diag(ground), u, v)
    return scene, State(u, v), scale(rng, 0.3, 12), exact


def shaken(rng):
    """A force that oscillates, as a drive or as a force, with drag."""
    n, m, k, stiffness, _ = row(rng)
    c, omega, p = scale(rng, 0.03, 30), scale(rng, 0.3, 100), scale(rng, 0.1, 10)
    drag = Force(-C * V, at=[1], parameters={"c": c})
    more = {"forces": (drag,)}
    if rng.random() < 0.5:
        more["drive"] = {0: Drive(force=P * sp.sin(W * T), parameters={"p": p, "w": omega})}
    else:
        forced = Force(P * sp.sin(W * T), at=[0], parameters={"p": p, "w": omega})
        more["forces"] = (drag, forced)
    scene = Chain([linear(x) for x in k], n, m, **more)
    u, v, loss = np.zeros(n), moving(rng, n), np.zeros((n, n))
    loss[1, 1] = c
    pull = p * np.eye(n)[0]
    exact = by_exponential(m, stiffness, loss, u, v, omega, pull)
    return scene, State(u, v), scale(rng, 0.3, 12), exact


def rubbed(rng):
    """Smoothed dry friction, or quadratic drag."""
    n, m, k, stiffness, _ = row(rng)
    at, c, w = int(rng.integers(0, n)), scale(rng, 0.1, 10), scale(rng, 0.03, 1)
    kind = "friction" if rng.random() < 0.7 else "quadratic"
    values = {"c": c, "w": w} if kind == "friction" else {"c": c}
    scene = Chain(
        [linear(x) for x in k], n, m, forces=(Force(DRAG[kind], at=[at], parameters=values),)
    )

    def rates(_t, y):
        a = -stiffness @ y[:n]
        v = y[n + at]
        a[at] -= c * np.tanh(v / w) if kind == "friction" else c * v * abs(v)
        return np.concatenate([y[n:], a / m])

    u, v, t_end = np.zeros(n), moving(rng, n), scale(rng, 0.3, 8)
    return scene, State(u, v), t_end, by_steps(n, rates, u, v, t_end)


def pulsed(rng):
    """A short pulse, early or late, with drag."""
    n, m, k, stiffness, _ = row(rng)
    t_end = scale(rng, 0.5, 12)
    s = t_end * scale(rng, 3e-3, 0.1)
    b, c, p = rng.uniform(0, t_end), scale(rng, 0.03, 10), scale(rng, 0.1, 3) / s
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

    u, v = np.zeros(n), moving(rng, n)
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
    count = len(run.t)
    chosen = np.unique(
        np.append(np.arange(min(500, count)), np.linspace(0, count - 1, 1000, dtype=int))
    )
    return max(
        float(np.max(np.abs(found[chosen] - right)) / np.max(np.abs(right)))
        for found, right in zip((run.u, run.v), exact(run.t[chosen]), strict=True)
    )
