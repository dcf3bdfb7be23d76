"""Hertz's contact of spheres, and Nesterenko's waves on chains of power-law contacts.

The contact law follows from the elastic half space (Boussinesq's point load) and the parabolic gap
between two spheres, the waves from the long-wave expansion of the chain's energy.
Source: the talk, part II, "Discrete element modeling"; the paper, eqs. (1)-(5);
V. F. Nesterenko, Dynamics of Heterogeneous Materials (2001), chapter 1.
"""

from __future__ import annotations

from functools import cache

import sympy as sp

from derivations.argument import Step

TITLE = "Contact: Hertz's law, power laws, Nesterenko's wave and its scalings"

modulus_1, modulus_2, radius_1, radius_2 = sp.symbols("E_i E_j r_i r_j", positive=True)
poisson_1, poisson_2 = sp.symbols("nu_i nu_j", positive=True)
effective_modulus, effective_radius = sp.symbols("E_s R_s", positive=True)
contact_radius, pressure, place = sp.symbols("A p_m rho", positive=True)
overlap, exponent, constant = sp.symbols("delta n alpha", positive=True)
compression, wave, mass, speed, position = sp.symbols("xi xi_m m c x", positive=True)


@cache
def sinking() -> sp.Expr:
    """Displacement at rho under the pressure p_m sqrt(1 - rho^2/A^2), times the plane modulus.

    Boussinesq's solution p dA/(pi distance) is integrated along chords through the point; along a
    chord the pressure is a semicircle of squared radius A^2 - rho^2 sin^2(theta).
    """
    s, theta, half = sp.symbols("s theta half", positive=True)
    chord = sp.integrate(sp.sqrt(half**2 - s**2), (s, -half, half))
    chord = chord.subs(half**2, contact_radius**2 - place**2 * sp.sin(theta) ** 2)
    total = sp.integrate(sp.expand(chord), (theta, 0, sp.pi))
    return sp.expand(pressure / (sp.pi * contact_radius) * total)


@cache
def hertz() -> tuple[sp.Expr, sp.Expr]:
    """Overlap and force in the contact radius A; the displacement is the overlap minus
    rho^2/(2 R)."""
    depth = sp.Symbol("delta")
    mismatch = sinking() / effective_modulus - (depth - place**2 / (2 * effective_radius))
    form = sp.solve(sp.Poly(sp.expand(mismatch), place).coeffs(), [depth, pressure], dict=True)[0]
    load = sp.integrate(
        2 * sp.pi * place * pressure * sp.sqrt(1 - place**2 / contact_radius**2),
        (place, 0, contact_radius),
    )
    return form[depth], sp.simplify(load.subs(pressure, form[pressure]))


@cache
def hertz_constant() -> tuple[sp.Expr, sp.Expr]:
    """The constant alpha_ij and the exponent n of F = alpha delta^n."""
    depth, load = hertz()
    (radius,) = sp.solve(depth - overlap, contact_radius)
    force = sp.powsimp(load.subs(contact_radius, radius))
    n = sp.simplify(overlap * sp.diff(force, overlap) / force)
    compliance = (1 - poisson_1**2) / modulus_1 + (1 - poisson_2**2) / modulus_2
    curvature = 1 / radius_1 + 1 / radius_2
    pair = {effective_modulus: 1 / compliance, effective_radius: 1 / curvature}
    return sp.simplify(force / overlap**n).subs(pair), n


def wall_constant() -> sp.Expr:
    """alpha of a sphere i on a plane wall j, the limit of infinite r_j."""
    return sp.limit(hertz_constant()[0], radius_2, sp.oo)


def power_law_energy() -> sp.Expr:
    """Energy of a contact at overlap delta, the work of F = alpha delta^n."""
    return sp.integrate(constant * overlap**exponent, overlap)


@cache
def long_wave() -> tuple[sp.Expr, dict[str, sp.Expr]]:
    """Leading term and correction of m c^2 xi / alpha for slowly varying xi.

    The bond between sites x and x + 1 shortens by the mean of xi over it.  The difference of the
    forces, expanded about a site and integrated once, is lambda xi = xi^n + correction.
    """
    x, h = sp.symbols("x h")
    xi = sp.Function("xi")
    u = [sp.Derivative(xi(x), (x, k)) if k else xi(x) for k in range(4)]
    ahead = sum(h**k * u[k] / sp.factorial(k + 1) for k in range(4))  # mean of xi over (x, x + h)
    ratio = sp.expand(ahead / u[0] - 1)
    n, y = exponent, sp.Symbol("y")
    power = sp.series((1 + y) ** n, y, 0, 4).removeO().subs(y, ratio)
    power = sp.expand(power)
    odd = [2 * power.coeff(h, k) for k in (1, 3)]  # (forward - backward) force, even ones cancel
    correction = sp.Symbol("p") * u[1] ** 2 / u[0] ** 2 + sp.Symbol("q") * u[2] / u[0]
    ansatz = sp.diff(u[0] ** n * correction, x).doit()
    mismatch = sp.expand(sp.simplify(ansatz / u[0] ** n - odd[1]).doit())
    v = sp.symbols("v_0:4")
    for k in (3, 2, 1, 0):
        mismatch = mismatch.subs(u[k], v[k])
    equations = sp.Poly(sp.numer(sp.together(mismatch)), *v).coeffs()
    (powers,) = sp.solve(equations, sp.symbols("p q"), dict=True)
    return sp.expand(odd[0] * u[0] / u[1] / n), {str(k): sp.factor(w) for k, w in powers.items()}


@cache
def nesterenko() -> tuple[sp.Expr, sp.Expr, sp.Expr]:
    """lambda, kappa and power of xi = xi_m cos^power(kappa x), m c^2 = alpha lambda(xi_m).

    The equation lambda xi = xi^n + n/24 ((n - 1) xi^(n-2) xi'^2 + 2 xi^(n-1) xi''), with the
    coefficients of `long_wave`, is solved by xi = w^power with w = cos(kappa x).
    """
    _, c = long_wave()
    w, power, kappa2 = sp.symbols("w power kappa2", positive=True)
    lam = sp.Symbol("lambda", positive=True)
    power_value = 2 / (exponent - 1)
    # xi = w^power, w'^2 = kappa2 (1 - w^2), w'' = -kappa2 w: divide by xi^n
    first = power**2 * kappa2 * (1 / w**2 - 1)
    second = power * (power - 1) * kappa2 * (1 / w**2 - 1) - power * kappa2
    bracket = 1 + c["p"] * first + c["q"] * second  # = lambda xi^(1 - n) = lambda / w^2
    terms = sp.expand((bracket * w**2).subs(power, power_value))
    (kappa,) = sp.solve(sp.simplify(terms.coeff(w, 2)), kappa2)
    value = sp.simplify(terms.coeff(w, 0).subs(kappa2, kappa))
    del lam
    return sp.factor(value) * wave ** (exponent - 1), sp.sqrt(sp.factor(kappa)), power_value


def scalings() -> tuple[sp.Expr, sp.Expr]:
    """Exponents s, t in F_m ~ I^s and V ~ I^t, from I ~ c xi, c^2 ~ xi^(n-1) and F ~ xi^n."""
    wave_speed = (exponent - 1) / 2
    momentum = sp.simplify(wave_speed + 1)
    return sp.simplify(exponent / momentum), sp.simplify(wave_speed / momentum)


@cache
def effective_mass() -> sp.Expr:
    """P^2/(2 E m) of Nesterenko's wave for n = 3/2, with the energy from the virial theorem.

    Twice the mean kinetic energy is the mean sum of force times overlap, so that
    T/E = (n + 1)/(n + 3).
    """
    n = sp.Rational(3, 2)
    _, kappa, power = (x.subs(exponent, n) for x in nesterenko())
    y = sp.Symbol("y")
    mean = [sp.integrate(sp.cos(y) ** (k * power), (y, -sp.pi / 2, sp.pi / 2)) / kappa
            for k in (1, 2)]  # fmt: skip
    kinetic = mean[1] / 2
    return sp.simplify(mean[0] ** 2 / (2 * kinetic * (n + 3) / (n + 1)))


def rarefaction_sign() -> sp.Expr:
    """Sign of the strain of small waves under precompression, that of V''/V''' of the power law."""
    at_rest = sp.Symbol("delta_0", positive=True)
    energy = power_law_energy().subs(overlap, at_rest - sp.Symbol("r"))
    second, third = (sp.diff(energy, sp.Symbol("r"), k).subs(sp.Symbol("r"), 0) for k in (2, 3))
    return sp.sign(sp.simplify(second / third * (exponent - 1))) * sp.sign(exponent - 1)


def argument() -> list[Step]:
    lam, kappa, power = nesterenko()
    profile = wave * sp.cos(kappa * position) ** power
    return [
        Step("The surface displacement of a half space under the pressure p_m √(1 - rho^2/A^2), "
             "times its plane modulus E/(1 - nu^2), is", sinking()),
        Step("The displacements of two spheres add up to the overlap minus the gap rho^2/(2R) for "
             "every rho. Hence",
             sp.Eq(overlap, hertz()[0]), sp.Eq(sp.Symbol("F"), hertz()[1])),
        Step("Let 1/E_s and 1/R_s be the sums of both compliances and curvatures. Eliminating A "
             "gives F = alpha delta^n with",
             sp.Eq(constant, hertz_constant()[0]), sp.Eq(exponent, hertz_constant()[1])),
        Step("A plane wall is the limit of an infinite radius:", sp.Eq(constant, wall_constant())),
        Step("The energy of a power law is", sp.Eq(sp.Symbol("V"), power_law_energy())),
        Step("Under precompression small waves are compressive for n > 1 and rarefaction waves for "
             "n < 1: the sign of the strain is", rarefaction_sign()),
        Step("Without precompression, the strain of Nesterenko's long wave (in units of one "
             "spacing) and its speed are, for any n > 1,", sp.Eq(compression, profile),
             sp.Eq(mass * speed**2 / constant, lam)),
        Step("Momentum, force and speed of these waves are powers of the amplitude, so that "
             "F ~ I^s and V ~ I^t with", *scalings()),
        Step("and, for spheres,", *(s.subs(exponent, sp.Rational(3, 2)) for s in scalings())),
        Step("The effective mass P^2/(2E), in units of the mass of a bead, is",
             sp.Eq(effective_mass(), effective_mass().evalf(5), evaluate=False)),
    ]  # fmt: skip
