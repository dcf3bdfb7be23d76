"""Families of solitary waves of a chain: small waves, flat-topped waves, waves near a wall.

Masses m and springs V(r) with V(0) = V'(0) = 0, r > 0 in extension; the spacing is 1; Q = 2V/r^2.
Existence where Q increases: G. Friesecke, J. Wattis, Commun. Math. Phys. 161, 391 (1994).
"""

from __future__ import annotations

from functools import cache

import sympy as sp

from derivations import waves
from derivations.argument import Step

TITLE = "Localised waves of softening and Lennard-Jones lattices: families and their ends"

a, b, e, c, m = waves.stiffness, waves.slope, waves.bend, waves.speed, waves.mass
excess = sp.Symbol("epsilon", positive=True)  # c/c_s - 1
peak = sp.Symbol("r_c", real=True)
top, level = sp.symbols("r_* Q_*", real=True)  # state behind a front; m c^2 there
top_stiffness = sp.Symbol("K_*", positive=True)  # V''(r_*)
rate, gap = sp.symbols("k_t g", positive=True)
power, strength, left = sp.symbols("n A s", positive=True)  # V = A y^-n at a wall; least y
exponent, growth = sp.symbols("p d", positive=True)  # V' = a r + d |r|^p next to rest
stroke = waves.stroke
tension, energy = sp.Function("T"), sp.Function("V")
r, x = sp.symbols("r x", real=True)


@cache
def small_peak() -> sp.Expr:
    """Peak of a small wave to second order in c/cs - 1, if V'''(0) is not 0."""
    gamma = waves.gamma
    first, second = (p.subs(waves.position, 0) for p in waves.profiles()[:2])
    speed = sp.series(waves.speed_of_decay(), gamma, 0, 6).removeO() - 1
    one, two = speed.coeff(gamma, 2), speed.coeff(gamma, 4)
    gamma_squared = excess / one - two / one**3 * excess**2  # the inverse series
    wave = gamma_squared * first + gamma_squared**2 * second
    series = sp.series(sp.expand(wave), excess, 0, 3).removeO()
    return sp.collect(sp.expand(series), excess, lambda k: sp.factor(sp.simplify(k)))


@cache
def small_peak_squared() -> sp.Expr:
    """Square of the peak to leading order in c/cs - 1, if V'''(0) = 0 < V''''(0).

    With q = sech X, X = gamma x: q'' = q - 2 q^3, and m c^2 r = T + T''/12 to that order.
    """
    q, squared = sp.symbols("q z")
    wave = waves.gamma**2
    series = sp.series(waves.speed_of_decay() ** 2, waves.gamma, 0, 3).removeO() - 1
    # r^2 = z q^2; the balance is divided by r
    curved = a * wave * (1 - 2 * q**2) / 12
    balance = sp.expand(a * series - curved - e / 6 * squared * q**2)
    (value,) = sp.solve(balance, squared)
    (rise,) = sp.solve(series - 2 * excess, wave)
    return sp.simplify(value.subs(wave, rise))


@cache
def front() -> tuple[sp.Expr, sp.Expr]:
    """m c^2 and V behind a front that advances into rest and leaves the state r, velocity -c r.

    In the time 1/c one more site gains the momentum -m c r, due to the tension behind the front,
    and the energy m (c r)^2/2 + V, due to the power of that tension on the moving masses.
    """
    force, stored, squared = sp.symbols("T V mu", real=True)  # mu = m c^2
    momentum = sp.Eq(squared * r, force)
    power_ = sp.Eq(squared * r**2 / 2 + stored, force * r)
    (solution,) = sp.solve([momentum, power_], [squared, stored], dict=True)
    return solution[squared], solution[stored]


@cache
def level_slope() -> sp.Expr:
    """dQ/dr, which vanishes at the states behind fronts."""
    return sp.simplify(sp.diff(2 * energy(r) / r**2, r).subs(sp.diff(energy(r), r), tension(r)))


@cache
def level_curvature() -> sp.Expr:
    """Q'' at a front, in terms of V''(r*) and m c*^2."""
    second = sp.diff(2 * energy(r) / r**2, r, 2)
    known = {sp.diff(energy(r), r, 2): top_stiffness, sp.diff(energy(r), r): level * r}
    for form, value in known.items():
        second = second.subs(form, value)
    return sp.factor(second.subs(energy(r), level * r**2 / 2).subs(r, top))


@cache
def top_rate() -> sp.Expr:
    """c*/sqrt(V''(r*)/m) as a function of the rate k at which small deviations from r* grow."""
    return waves.speed_of_decay().subs(waves.gamma, rate)


@cache
def top_width() -> sp.Expr:
    """Increase of the width when the gap between r* and the peak decreases to a fraction g.

    The plateau is r* - gap cosh(k x); it ends where gap exp(k x)/2 has a given size.
    """
    x_ = sp.Symbol("x", positive=True)
    (place,) = sp.solve(sp.Eq(gap * sp.exp(rate * x_), 1), x_)
    return 2 * sp.expand_log(place)


@cache
def long_wave() -> sp.Expr:
    """m c^2 of a wave with peak r in the long-wave equation m c^2 r = T + T''/12.

    Multiplied by dT and integrated it is m c^2 (r T - V) = T^2/2 + T'^2/24; T' = 0 at the peak.
    """
    squared, t, v = sp.symbols("mu T V")
    (value,) = sp.solve(sp.Eq(squared * (r * t - v), sp.integrate(t, t)), squared)
    return value.subs({t: tension(r), v: energy(r)})


@cache
def small_peak_of_power() -> sp.Expr:
    """Size of the peak to leading order in c/cs - 1, if V' = a r + d |r|^p near rest."""
    size, z = sp.symbols("s z", positive=True)  # z = s^(p - 1)
    force = size * (a + growth * z)
    stored = size**2 * (a / 2 + growth * z / (exponent + 1))
    squared = long_wave().subs({tension(r): force, energy(r): stored}).subs(r, size)
    change = sp.simplify(sp.diff(squared, z).subs(z, 0))  # m c^2 - a = 2 a excess, to first order
    return (2 * a * excess / change) ** (1 / (exponent - 1))


@cache
def delay() -> sp.Expr:
    """beta: two masses with V = A y^-n and least distance s separate as w t + beta s.

    By conservation of energy w t is the integral of dy/sqrt(1 - (s/y)^n) from s, so that
    beta = 1 - integral of (1/sqrt(1 - z^-n) - 1) dz from 1.  With t = z^-n this is Euler's integral
    of t^(p - 1) ((1 - t)^(-1/2) - 1) at p = -1/n, which is B(p, 1/2) - 1/p for p > -1.
    """
    p = sp.Symbol("p")
    euler = sp.gamma(p) * sp.gamma(sp.Rational(1, 2)) / sp.gamma(p + sp.Rational(1, 2)) - 1 / p
    return sp.simplify(1 - euler.subs(p, -1 / power) / power)


@cache
def relative_speed() -> sp.Expr:
    """w/c of masses that collide one after the other, each at the time 1/c after the last.

    A mass leaves the first collision with the displacement w t', where t' is the time since then.
    It approaches the next mass, at rest a stroke d ahead, at the distance -w t + beta s.
    """
    w, beta, time = sp.symbols("w beta t")
    own = w * (time + 1 / c)  # displacement from one meeting at -1/c to the next at 0
    other = stroke + w * time - beta * left  # by the meeting at 0: d less the distance
    (value,) = sp.solve(sp.Eq(own, other), w)
    return sp.simplify(value / c)


def wall_balance() -> sp.Eq:
    """The least distance s, where the energy of relative motion, reduced mass m/2, is A s^-n."""
    w = sp.Symbol("w")
    relative = m / 2 * w**2 / 2
    return sp.Eq(strength * left**-power, relative.subs(w, c * relative_speed()))


def argument() -> list[Step]:
    """The argument as sentences and formulas."""
    beta = sp.Symbol("beta")
    return [
        Step("Small waves: at the peak of the sech^2 wave r = gamma^2 R1 + gamma^4 R2, where gamma "
             "is replaced by epsilon = c/cs - 1. Their sign is that of V'''(0) = b (a and e are "
             "the second and the fourth derivative); no waves of the other sign start from zero.",
             sp.Eq(peak, small_peak())),
        Step("If V'''(0) = 0 < V''''(0), waves of both signs start from zero, and the peak is "
             "proportional to the square root of epsilon:", sp.Eq(peak**2, small_peak_squared())),
        Step("If V' = a r + d |r|^p near rest, with d > 0 on one side and p > 1, waves of that "
             "side start from zero, by the long-wave equation:",
             sp.Eq(sp.Abs(peak), small_peak_of_power())),
        Step("A front advances into rest at speed c and leaves the state r with velocity -c r. "
             "Momentum and energy determine m c^2 and V there:",
             sp.Eq(m * c**2, front()[0]), sp.Eq(energy(r), front()[1])),
        Step("Both hold if and only if Q = 2 V/r^2 is stationary, where m c^2 = Q:",
             sp.Eq(sp.Symbol("Q'"), level_slope())),
        Step("A wave can therefore develop a plateau at the first maximum of Q, where its family "
             "ends. Q'' must be negative there:", sp.Eq(sp.Symbol("Q''"), level_curvature())),
        Step("so that V''(r_*) < m c^2. If V''(r_*) > 0, the wave leaves the plateau at a real "
             "rate k_t; if V''(r_*) < 0, the rate is complex and the family ends differently.",
             sp.Eq(c / sp.sqrt(top_stiffness / m), top_rate())),
        Step("With r = r_* - g cosh(k_t x) on the plateau, the width increases by", top_width()),
        Step("when the gap between the peak and r_* decreases to a fraction g. As Q is "
             "stationary, c_* - c is proportional to the square of the gap. Further families start "
             "wherever Q exceeds all its values nearer to rest, with m c^2 above that level."),
        Step("The long-wave equation estimates its first peak: a wave with peak r has",
             sp.Eq(m * c**2, long_wave())),
        Step("Near a wall V = A y^-n at the distance y from the end of the domain. Two masses "
             "colliding with relative velocity w separate as w t + beta s, with least distance s:",
             sp.Eq(beta, delay())),
        Step("In a fast wave the masses collide one by one, each again after the time 1/c:",
             sp.Eq(sp.Symbol("w") / c, relative_speed())),
        Step("and the energy of the relative motion determines s. The tent, s = 0, is approached "
             "only as c^(-2/n); with this s the error is O(1/c).", wall_balance()),
    ]  # fmt: skip
