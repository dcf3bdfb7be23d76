"""Waves on a lattice of masses and springs: sound speed, dispersion, sech^2, tent, largest speed.

Masses m and springs V(r) with V(0) = V'(0) = 0 have the spacing h0; x is in sites unless a formula
contains h0.  Source: the talk, part III, "Properties of the elastic potential"
(after Friesecke & Pego 1999, Friesecke & Matthies 2002).
"""

from __future__ import annotations

import math
from functools import cache

import sympy as sp

from derivations import hardening
from derivations.argument import Step

TITLE = "Waves: sound speed, dispersion, sech² and its correction, tent, largest speed"

mass, spacing, gamma, speed, acoustic_speed = sp.symbols("m h_0 gamma c c_s", positive=True)
stiffness = sp.Symbol("a", positive=True)  # V''(0)
slope, bend = sp.symbols("b e", real=True)  # V'''(0), V''''(0)
fifth, sixth = sp.symbols("f g", real=True)  # the next derivatives at 0
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
def expansion(even: bool = False) -> tuple[tuple[sp.Expr, ...], ...]:
    """Coefficients of R_1, R_2, ... in r = sum gamma^(2 n) R_n, R_n = sum_k p_k S^k, k = 1 to n.

    S = sech^2(X/2), X = gamma x, with S'^2 = S^2 - S^3.  If V is even: gamma^(2 n - 1) and S^(2 k -
    1), S = sech X, with S'^2 = S^2 - S^4.  The travelling wave c^2 m r'' = V'(r+) - 2 V'(r) +
    V'(r-), divided by D^2 = d^2/dx^2, is m c^2 r = 2 (cosh D - 1)/D^2 V'(r), where m c^2/a =
    2 (cosh gamma - 1)/gamma^2 as in `speed_of_decay`.  Here gamma is the rate of decay; with the
    definition c = cs (1 + gamma^2/24) by the speed, R_2 would contain a secular term x S'.

    Returns
    -------
    tuple of tuple of Expr
        Of R_1 to R_4, in a, b, e, f, g, the second to sixth derivatives of V at 0, b not 0; if V is
        even of the two with e > 0 (the third has an eighth derivative).
    """
    steep = sp.Symbol("e", positive=True)
    unit = sp.sqrt(stiffness / steep) if even else stiffness / slope
    powers = {3: steep, 5: sixth} if even else {2: slope, 3: bend, 4: fifth, 5: sixth}
    # V' = a unit (q + sum_k B_k q^k/k!) of r = unit q, where the first B is 1
    values = {sp.Symbol(f"B_{k}"): v * unit ** (k - 1) / stiffness for k, v in powers.items()}
    force = {k: b if v != 1 else v for k, (b, v) in zip(powers, values.items(), strict=True)}
    found = _balanced(force, *((2, 2) if even else (1, 4)))
    return tuple(tuple(sp.factor(unit * p.subs(values)) for p in one) for one in found)


def _balanced(force: dict[int, sp.Expr], width: int, orders: int) -> list[list[sp.Expr]]:
    """Coefficients of q = sum gamma^(2/width + 2 n) R_n(S), S'^2 = S^2 - S^(2 + width), for the
    scaled force q + sum_k force[k] q^k/k!, from the lowest order of the balance on."""
    parameters = sorted(set().union(*(x.free_symbols for x in force.values())), key=str)
    names = sp.symbols(f"p_:{orders}")
    ring, small, s, *of = sp.ring([gamma, sp.Symbol("S"), *parameters, *names], sp.QQ)
    unknown = of[len(parameters) :]

    def curved(q):  # d^2/dX^2
        curvature = s - sp.QQ(2 + width, 2) * s ** (1 + width)
        return q.diff(s).diff(s) * (s**2 - s ** (2 + width)) + q.diff(s) * curvature

    wave, profiles = ring(0), []
    for n in range(orders):
        own, power = unknown[: n + 1], 2 // width + 2 * n
        trial = wave + small**power * sum(p * s ** (1 + width * k) for k, p in enumerate(own))
        tension, raised = trial, ring(1)
        for k in range(1, max(force) + 1):
            raised = _cut(raised * trial, power + 2)
            tension += raised * ring.from_expr(force.get(k, sp.Integer(0)) / sp.factorial(k))
        balance, derived = ring(0), tension
        for k in range(n + 2):  # 2 (cosh D - 1)/D^2 in powers of D
            term = sp.QQ(2, math.factorial(2 * k + 2)) * small ** (2 * k)
            balance, derived = balance + term * (trial - derived), curved(derived)
        last = sp.Poly(balance.as_expr(), gamma).coeff_monomial(gamma ** (power + 2))
        solutions = sp.solve(sp.Poly(last, sp.Symbol("S")).coeffs(), names[: n + 1], dict=True)
        (values,) = (v for v in solutions if n or v[names[0]] > 0)  # R_1 is not 0
        profiles.append([values[name] for name in names[: n + 1]])
        wave += small**power * sum(
            ring.from_expr(sp.expand(p)) * s ** (1 + width * k) for k, p in enumerate(profiles[-1])
        )
    return profiles


def _cut(q, top: int):
    """A polynomial without powers of gamma above one."""
    return q.ring.from_dict({powers: x for powers, x in q.items() if powers[0] <= top})


@cache
def profiles() -> tuple[sp.Expr, ...]:
    """R_1 to R_3 of r = gamma^2 R_1 + gamma^4 R_2 + gamma^6 R_3; see `expansion`."""
    wave = sp.sech(gamma * position / (2 * spacing)) ** 2
    return tuple(_polynomial(one, 1).subs(sp.Symbol("S"), wave) for one in expansion()[:3])


def _polynomial(coefficients: tuple[sp.Expr, ...], width: int) -> sp.Expr:
    """R_n as a polynomial in S."""
    return sum(p * sp.Symbol("S") ** (1 + width * k) for k, p in enumerate(coefficients))


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
        Step("The order gamma^8 gives another, with S = sech^2(gamma x/2) and f the fifth "
             "derivative. Each correction over the one before is the error that remains:",
             sp.Eq(sp.Symbol("R_3"), _polynomial(expansion()[2], 1))),
        Step("If V is even, waves of both signs begin with gamma S, S = sech(gamma x), where g is "
             "the sixth derivative:",
             sp.Eq(elongation, sum(gamma ** (2 * n + 1) * _polynomial(one, 2)
                                   for n, one in enumerate(expansion(even=True))))),
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
