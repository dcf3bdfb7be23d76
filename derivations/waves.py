"""Waves on a lattice of masses and springs: sound speed, dispersion, sech^2, tent, largest speed.

Masses m and springs V(r) with V(0) = V'(0) = 0 have the spacing h0; x is in sites unless a formula
contains h0.  Source: the talk, part III, "Properties of the elastic potential"
(after Friesecke & Pego 1999, Friesecke & Matthies 2002).
"""

from __future__ import annotations

from functools import cache

import sympy as sp

from derivations import hardening
from derivations.argument import Step

TITLE = "Waves: sound speed, dispersion, sech² and its correction, tent, largest speed"

mass, spacing, gamma, speed, acoustic_speed = sp.symbols("m h_0 gamma c c_s", positive=True)
stiffness = sp.Symbol("a", positive=True)  # V''(0)
slope, bend = sp.symbols("b e", real=True)  # V'''(0), V''''(0)
elongation, position = sp.symbols("r x", real=True)
stroke, locking_energy = sp.symbols("d V_lock", positive=True)
wave_number, time = sp.symbols("k t", positive=True)


@cache
def equation_of_motion() -> sp.Expr:
    """Force m u'' on an inner mass from Lagrange's equation; W are external potentials."""
    u = [sp.Function(f"u_{j}")(time) for j in (0, 1, 2)]
    spring = sp.Function("V")
    external = [sp.Function(f"W_{j}") for j in (0, 1, 2)]
    kinetic = mass / 2 * sum(sp.diff(x, time) ** 2 for x in u)
    potential = sum(spring(u[j + 1] - u[j]) for j in (0, 1))
    potential += sum(w(x) for w, x in zip(external, u, strict=True))
    lagrangian = kinetic - potential
    momentum = sp.diff(lagrangian, sp.diff(u[1], time))
    balance = sp.diff(momentum, time) - sp.diff(lagrangian, u[1])
    right = (mass * sp.diff(u[1], time, 2) - balance).doit()
    tension, force = sp.Function("V'"), sp.Function("W'")
    right = right.replace(sp.Subs, lambda form, old, new: tension(new[0]))
    right = right.subs(sp.diff(external[1](u[1]), u[1]), force(u[1]))
    places = sp.symbols("u_0:3")
    return sp.expand(right.subs(dict(zip(u, places, strict=True))))


@cache
def dispersion() -> sp.Expr:
    """omega^2(k) of a plane wave in the linear lattice m u'' = a (u+ - 2 u + u-), k per site."""
    shift = sp.exp(sp.I * wave_number)
    symbol = stiffness * (shift - 2 + 1 / shift) / mass
    return sp.simplify(-symbol.rewrite(sp.cos))


def sound_speed() -> sp.Expr:
    """h0 times the long-wave limit of omega/k."""
    return spacing * sp.sqrt(sp.limit(dispersion() / wave_number**2, wave_number, 0))


def speed_of_decay() -> sp.Expr:
    """c/cs of a travelling wave with tail exp(-gamma x), from the dispersion at k = i gamma."""
    squared = (-dispersion() / wave_number**2).subs(wave_number, sp.I * gamma)
    limit = sp.limit(dispersion() / wave_number**2, wave_number, 0)
    return sp.sqrt(sp.simplify(-squared.rewrite(sp.cosh) / limit).rewrite(sp.cosh))


def gamma_squared() -> sp.Expr:
    """Leading term of gamma^2 in c/cs - 1."""
    ratio = sp.Symbol("y", positive=True)
    series = sp.series(sp.simplify(speed_of_decay() ** 2), gamma, 0, 4).removeO()
    leading = sp.expand(series - 1).coeff(gamma, 2) / 2  # c/cs = 1 + half of it gamma^2
    return sp.solve(leading * ratio - (speed - acoustic_speed) / acoustic_speed, ratio)[0]


@cache
def profiles() -> tuple[sp.Expr, sp.Expr]:
    """R1 and R2 of r = gamma^2 R1 + gamma^4 R2, polynomials in S = sech^2(X/2), X = gamma x.

    The travelling wave c^2 m r'' = V'(r+) - 2 V'(r) + V'(r-), divided by D^2 = d^2/dx^2, is
    m c^2 r = (1 + D^2/12 + D^4/360 + ...) V'(r).  Here gamma is the rate of decay; with the
    definition c = cs (1 + gamma^2/24) by the speed, R2 would contain a secular term x S'.
    """
    s, p1, p2, q2 = sp.symbols("S p_1 p_2 q_2")

    def second(f):  # d^2/dX^2, with S'^2 = S^2 - S^3 and S'' = S - 3/2 S^2
        first_squared, curvature = s**2 - s**3, s - sp.Rational(3, 2) * s**2
        return sp.expand(sp.diff(f, s, 2) * first_squared + sp.diff(f, s) * curvature)

    r = gamma**2 * p1 * s + gamma**4 * (p2 * s + q2 * s**2)
    tension = sp.expand(stiffness * r + slope * r**2 / 2 + bend * r**3 / 6)
    d2 = gamma**2 * second(tension)
    d4 = gamma**4 * second(second(tension))
    series = sp.series(2 * (sp.cosh(gamma) - 1), gamma, 0, 8).removeO()
    c4, c6 = (series.coeff(gamma, k) for k in (4, 6))
    speed_squared = 1 + c4 * gamma**2 + c6 * gamma**4  # m c^2/a, as in `speed_of_decay`
    balance = sp.expand(stiffness * speed_squared * r - tension - c4 * d2 - c6 * d4)
    first = sp.Poly(balance.coeff(gamma, 4), s).coeffs()
    (p1_value,) = {v for (v,) in sp.solve(first, [p1]) if v != 0}
    rest = sp.Poly(sp.expand(balance.coeff(gamma, 6).subs(p1, p1_value)), s).coeffs()
    ((p2_value, q2_value),) = sp.linsolve(rest, [p2, q2])
    wave = sp.sech(gamma * position / (2 * spacing)) ** 2
    first_profile = (p1_value * s).subs(s, wave)
    return first_profile, sp.factor(p2_value * s + q2_value * s**2).subs(s, wave)


def sech_strain() -> sp.Expr:
    """Leading strain r/h0, extension > 0."""
    return gamma**2 * profiles()[0] / spacing


def error_order() -> int:
    """Power of gamma in the error of `sech_strain`, that of the first nonzero correction."""
    corrections = enumerate(profiles()[1:], 2)
    return next(2 * k for k, profile in corrections if sp.simplify(profile) != 0)


@cache
def tent() -> sp.Expr:
    """Strain of the fast limit, extension > 0, where V' acts on a bond only at x = 0, its shortest.

    Then m c^2 r'' = J (delta(x + 1) - 2 delta(x) + delta(x - 1)), with J from r(0) = -d.
    """
    impulse = sp.Symbol("J", real=True)
    ramp = [sp.Abs(position + 1), -2 * sp.Abs(position), sp.Abs(position - 1)]
    r = impulse * sum(ramp) / 2  # |x|'' = 2 delta(x); it vanishes beyond one site
    (value,) = sp.solve(r.subs(position, 0) + stroke, impulse)
    return (r.subs(impulse, value) / spacing).subs(position, position / spacing)


def largest_speed() -> sp.Expr:
    """Estimate of the largest speed [sites/s], from masses that collide one after the other.

    In the tent a mass moves with velocity c d while its neighbour is at rest.  The energy of their
    relative motion, with reduced mass m/2, equals the energy of the bond up to locking.
    """
    relative = mass / 2 * (speed * stroke) ** 2 / 2
    return sp.solve(relative - locking_energy, speed)[0]


def argument() -> list[Step]:
    strain = sp.Symbol("epsilon")
    return [
        Step("Lagrange's equation of an inner mass reads as follows. W are potentials of external "
             "forces (for gravity along the chain -m g u); a precompression F0 at both ends adds "
             "F0 r to each V.",
             sp.Eq(mass * sp.Symbol("u_1''"), equation_of_motion())),
        Step("A plane wave in the linear lattice has the dispersion relation (k per site)",
             sp.Eq(sp.Symbol("omega") ** 2, dispersion())),
        Step("and, for long waves, the sound speed", sp.Eq(acoustic_speed, sound_speed())),
        Step("A travelling wave decays like exp(-gamma x), where k = i gamma:",
             sp.Eq(speed / acoustic_speed, speed_of_decay())),
        Step("so that near the sound speed", sp.Eq(gamma**2, gamma_squared())),
        Step("With r = gamma^2 R1 + gamma^4 R2 + ..., and a, b, e the second to fourth derivatives "
             "of V, the order gamma^4 of the equation of the travelling wave gives",
             sp.Eq(sp.Symbol("R_1"), profiles()[0])),
        Step("The order gamma^6 gives the next correction, so that the error is O(gamma^4):",
             sp.Eq(sp.Symbol("R_2"), profiles()[1])),
        Step("In the fast limit the force of a bond is an impulse, and the strain is the tent",
             sp.Eq(strain, tent())),
        Step("The energy that a bond can store gives an estimate of the largest speed before "
             "locking, in sites per second:", sp.Eq(speed, largest_speed())),
    ]  # fmt: skip


def breather_extension() -> sp.Expr:
    """The q, as a function of eta0, below which small breathers exist above the band.

    There V'' V'''' / 2 exceeds V'''^2; where q is 1 or more they exist for every prestrain.
    Source: G. James, J. Nonlinear Sci. 13, 27 (2003), for the condition.
    """
    second, third, fourth = hardening.derivatives()
    condition = sp.together((second * fourth / 2 - third**2) / hardening.extension)
    (extension,) = sp.solve(sp.numer(condition), hardening.extension)
    return extension
