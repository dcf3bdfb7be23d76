"""Ledger of the talk, parts I to III up to the rigid-elastic prism, as printed."""

import sympy as sp

from derivations import contact, elastic, equilibrium, prism, rigid_response
from derivations.argument import Entry, Verdict

half, third = sp.Rational(1, 2), sp.Rational(1, 3)
root3 = sp.sqrt(3)
l, phi, h, F, f = prism.base, prism.twist, prism.height, equilibrium.load, elastic.third_load  # noqa: E741
k1, k2, k3 = prism.k_cross, prism.k_base, prism.k_bar
sN, lN, bN = prism.natural_cross, prism.natural_base, prism.natural_bar
s, b, a = sp.symbols("s b a", positive=True)
eta0, p0, h0 = sp.symbols("eta_0 p_0 h_0", positive=True)
x1, x2, x3 = equilibrium.densities
sin, cos, sqrt = sp.sin, sp.cos, sp.sqrt
taut = ((phi, (2.15, 3.1)),)

# --- part II ---------------------------------------------------------------------------------

n, alpha, gap = contact.exponent, contact.constant, sp.Symbol("delta_ij", real=True)
pressed = sp.Symbol("delta_ij^-", negative=True)
E_i, E_j, r_i, r_j = contact.modulus_1, contact.modulus_2, contact.radius_1, contact.radius_2
nu_i, nu_j = contact.poisson_1, contact.poisson_2
X_i, X_j, Y_i, Y_j = sp.symbols("X_i X_j Y_i Y_j", real=True)
centre_i, centre_j = sp.Matrix([X_i, Y_i]), sp.Matrix([X_j, Y_j])
distance = (centre_j - centre_i).norm()
normal = (centre_j - centre_i) / distance
surface_i, surface_j = centre_i + r_i * normal, centre_j - r_j * normal
V_01, V_02, V_12 = sp.symbols("V_01 V_02 V_12")
W_0, W_1, W_2 = sp.symbols("W_0 W_1 W_2")
negative = ((pressed, (-2.0, -0.5)),)
PART_II = 'talk, part II, "Discrete element modeling"'


def _total_potential():
    """Potential energies of contacts and of external forces, as in `waves`."""
    return V_01 + V_02 + V_12 + W_0 + W_1 + W_2


# --- part III --------------------------------------------------------------------------------

D = root3 * sin(phi) + cos(phi)
lower_root = sqrt(3 * h**2 - 2 * l**2 * cos(phi) + 2 * l**2)
upper_root = sqrt(3 * h**2 - root3 * l**2 * sin(phi) + l**2 * cos(phi) + 2 * l**2)
q = p0 / (1 + p0)
stiffness_numerator = 36 * k1 * eta0**2 * (
    (3 + 2 * root3 + root3 * eta0**2) * k1 * k2
    + (-2 + root3 - eta0**2) * k1 * k1 * q
    - 6 * k2 * k1 * q
    + k3 * (2 * root3 * k1 + (-3 + 2 * root3 + root3 * eta0**2) * k2
            - (2 + root3 + eta0**2) * k1 * q)
)  # fmt: skip
stiffness_denominator = (
    6 * k1 * q * (root3 * (1 + 8 * eta0**2 + 2 * eta0**4) * k2 - 2 * eta0**4 * k1 * q)
    + k1 * (3 * (2 + root3 + eta0**2) * k2
            + (-3 + 2 * root3 + (-24 + 13 * root3) * eta0**2) * k1 * q)
    + k3 * (6 * k1 + 3 * (2 - root3 + eta0**2) * k2
            + (3 + 2 * root3 + (24 + 13 * root3) * eta0**2) * k1 * q)
)  # fmt: skip
first_root = sqrt(-(h**2 - b**2) * (4 * a**2 + h**2 - b**2) / a**4)
rigid_first = 3 * k1 * (s - sN) * h / (2 * s) * (
    3 + root3 * (2 * a**2 + h**2 - b**2) / (a**2 * first_root)
)  # fmt: skip
rigid_second = (
    k1 * sp.csc(phi) * (3 * sin(phi) + root3 * cos(phi))
    * sqrt(3 * b**2 + 2 * l**2 * cos(phi) - 2 * l**2)
    / (2 * sqrt(3 * b**2 - root3 * l**2 * sin(phi) + 3 * l**2 * cos(phi)))
    * (sqrt(9 * b**2 - 3 * root3 * l**2 * sin(phi) + 9 * l**2 * cos(phi)) - 3 * sN)
)  # fmt: skip
locking_range = ((h, (1.0, 1.4)), (b, (1.5, 1.9)), (a, (1.0, 2.0)), (sN, (0.1, 0.5)))
upright = ((phi, (2.15, 3.1)), (b, (2.0, 3.0)), (l, (0.5, 1.0)))


def _self_stress(kind, which):
    """The twist of the tensegrity, or the other one; or one of its ratios in terms of x1."""
    twist = equilibrium.tensegrity_twist()
    if not kind:
        (twist,) = set(equilibrium.self_stress()) - {twist}
    return twist if which is None else equilibrium.self_stress()[twist][which] * x1


def _stiffness():
    return elastic.axial_stiffness_of_prism().subs(prism.prestrain, p0)


def _rigid_load(in_twist):
    """Load (compression > 0) of the rigid-elastic prism."""
    if not in_twist:
        return -rigid_response.force()
    tension = rigid_response.force_of_twist().subs(s, prism.cross_length())
    at_height = sp.sqrt(sp.solve(prism.bar_length_squared() - b**2, h**2)[0])
    return -tension.subs(h, at_height)


Dh, Df, h_old, f_old, step, t = sp.symbols("Dh Df h_old f_old step t")


def _newton(function):
    """First-order change of a function of (h, f) along (Dh, Df)."""
    return sp.diff(function.subs({h: h + t * Dh, f: f + t * Df}), t).subs(t, 0)


g3 = elastic.equations()[2]
arc = (h - h_old) ** 2 + (f - f_old) ** 2 - step**2
COMPAT = 'talk, part III, "Compatibility equations"'
BALANCE = 'talk, part III, "Equilibrium problem"'
ELASTIC, RIGID = 'talk, part III, "Elastic problem"', 'talk, part III, "Rigid-elastic model"'
CONV, MISPRINT, NO_DATA = Verdict.CONVENTION, Verdict.MISPRINT, Verdict.NO_DATA

ENTRIES = (
    Entry("talk.power_law_waves", "talk, overview", "contact", sp.Symbol("sign(strain)"),
          -sp.sign(n - 1), contact.rarefaction_sign,
          note="compressive waves for n > 1, rarefaction waves for n < 1, under precompression"),
    Entry("talk.negative_effective_moduli", "talk, overview", "waves",
          "anomalous acoustics of linear metamaterials", verdict=NO_DATA),
    Entry("talk.soliton_properties", "talk, part I", "waves",
          "permanent form, localised, unchanged by collisions", verdict=NO_DATA,
          note="collisions on these lattices radiate: a result of runs"),
    Entry("talk.particle_strain", PART_II, "contact", gap,
          (surface_j - surface_i).dot(centre_j - centre_i) / distance,
          lambda: distance - r_i - r_j,
          note="y are the surface points that face each other; a gap is positive"),
    Entry("talk.total_potential", PART_II, "waves", sp.Symbol("V"),
          V_01 + V_02 + V_12 - (W_0 + W_1 + W_2), _total_potential, CONV,
          "the raised dash is a minus sign: W is then the work of the external forces, minus "
          "their potential energy", lambda e: e.subs({w: -w for w in (W_0, W_1, W_2)})),
    Entry("talk.contact_energy", PART_II, "contact", sp.Symbol("V_ij"),
          alpha * pressed ** (n + 1) / (n + 1),
          lambda: contact.power_law_energy().subs(contact.overlap, -pressed), MISPRINT,
          "delta^- <= 0 needs an absolute value before the power",
          lambda e: e.subs(pressed, sp.Abs(pressed)), negative),
    Entry("talk.contact_force", PART_II, "contact", sp.Symbol("F_ij"), alpha * pressed**n,
          lambda: sp.diff(contact.power_law_energy(), contact.overlap).subs(
              contact.overlap, -pressed), MISPRINT,
          "delta^- <= 0 needs an absolute value before the power; it is then the contact force, "
          "compression > 0, and -V'", lambda e: e.subs(pressed, sp.Abs(pressed)), negative),
    Entry("talk.negative_part", PART_II, "contact", pressed, sp.Min(0, gap),
          lambda: -sp.Max(0, -gap), domain=((gap, (-1.0, 1.0)),)),
    Entry("talk.hertz_constant", PART_II, "contact", alpha,
          4 * E_i * E_j / (3 * E_j * (1 - nu_i**2) + 3 * E_i * (1 - nu_j**2))
          * sqrt(r_i * r_j / (r_i + r_j)), lambda: contact.hertz_constant()[0],
          domain=((nu_i, (0.1, 0.5)), (nu_j, (0.1, 0.5)))),
    Entry("talk.hertz_exponent", PART_II, "contact", n, sp.Rational(3, 2),
          lambda: contact.hertz_constant()[1]),
    Entry("talk.mitigation", "talk, part II, 3D granular crystals", "contact",
          "force mitigation efficiency at the bottom wall: 70 %", verdict=NO_DATA,
          note="the efficiency is not defined"),
    Entry("talk.bar_length", COMPAT, "prism", b,
          sqrt(h**2 - 2 * third * l**2 * cos(phi) + 2 * l**2 / 3), prism.bar_length, domain=taut),
    Entry("talk.height", COMPAT, "prism", h, sqrt(b**2 - 2 * third * l**2 * (1 - cos(phi))),
          lambda: sp.sqrt(sp.solve(prism.bar_length_squared() - b**2, h**2)[0]), domain=upright),
    Entry("talk.cross_length", COMPAT, "prism", s, upper_root / root3, prism.cross_length,
          domain=taut),
    Entry("talk.density_cross", BALANCE, "equilibrium", x1,
          -2 * F * sin(phi) / (3 * root3 * h * D), lambda: equilibrium.force_densities()[0],
          note="F is positive in compression", domain=taut),
    Entry("talk.density_base", BALANCE, "equilibrium", x2,
          -F * (sin(phi) ** 2 - root3 * sin(phi) + cos(phi) ** 2 - cos(phi)) / (9 * h * D),
          lambda: equilibrium.force_densities()[1],
          note="F is positive in compression", domain=taut),
    Entry("talk.density_bar", BALANCE, "equilibrium", x3,
          F / (3 * h) - 2 * F * sin(phi) / (3 * root3 * h * D),
          lambda: equilibrium.force_densities()[2],
          note="F and x3 are positive in compression", domain=taut),
    Entry("talk.other_twist", BALANCE, "equilibrium", phi, -sp.pi / 6,
          lambda: _self_stress(False, None)),
    Entry("talk.other_twist_base", BALANCE, "equilibrium", x2, -x1 / root3,
          lambda: _self_stress(False, 0),
          note="base strings are compressed where cross strings are tensioned"),
    Entry("talk.other_twist_bar", BALANCE, "equilibrium", x3, x1, lambda: _self_stress(False, 1)),
    Entry("talk.twist", BALANCE, "equilibrium", phi, sp.Rational(5, 6) * sp.pi,
          lambda: _self_stress(True, None)),
    Entry("talk.twist_base", BALANCE, "equilibrium", x2, x1 / root3,
          lambda: _self_stress(True, 0)),
    Entry("talk.twist_bar", BALANCE, "equilibrium", x3, x1, lambda: _self_stress(True, 1)),
    Entry("talk.hooke_cross", ELASTIC, "elastic", x1, k1 * (s - sN) / s,
          lambda: sp.diff(k1 * (s - sN) ** 2 / 2, s) / s),
    Entry("talk.hooke_base", ELASTIC, "elastic", x2, k2 * (l - lN) / l,
          lambda: sp.diff(k2 * (l - lN) ** 2 / 2, l) / l),
    Entry("talk.hooke_bar", ELASTIC, "elastic", x3, k3 * (b - bN) / b,
          lambda: -sp.diff(k3 * (b - bN) ** 2 / 2, b) / b, CONV,
          "x3 is positive in tension here, in compression in the equilibrium problem",
          lambda e: -e),
    Entry("talk.g1", ELASTIC, "elastic", sp.Symbol("g_1"),
          l / 6 * (
              k3 * 4 * sin(phi / 2) ** 2 * (root3 - 3 * bN / lower_root)
              + k1 * (-3 * sin(phi) + root3 * cos(phi) + 2 * root3)
              + k2 * 6 * root3 * (l - lN) / l
              - k1 * 3 * sN * (-root3 * sin(phi) + cos(phi) + 2) / upper_root
          ), lambda: elastic.equations()[0], note="U_l/(2 sqrt 3)", domain=taut),
    Entry("talk.g2", ELASTIC, "elastic", sp.Symbol("g_2"),
          l / 6 * (
              k3 * 2 * sin(phi) * (3 * bN / lower_root - root3)
              + k1 * (root3 * sin(phi) + 3 * cos(phi))
              - k1 * 3 * sN * (sin(phi) + root3 * cos(phi)) / upper_root
          ), lambda: elastic.equations()[1], note="-U_phi/(sqrt 3 l)", domain=taut),
    Entry("talk.g3", ELASTIC, "elastic", sp.Symbol("g_3"),
          -f + k3 * h * (bN / sqrt(h**2 - 2 * third * l**2 * cos(phi) + 2 * l**2 / 3) - 1)
          + k1 * h * (root3 * sN / upper_root - 1),
          lambda: elastic.equations()[2].subs(f, F / 3), CONV,
          "-f - U_h/3: f is a third of the total axial force F, compression > 0",
          lambda e: e.subs(f, F / 3), taut),
    Entry("talk.newton_step", 'talk, part III, "Numerical approach"', "elastic",
          sp.Symbol("change of (g, psi)"),
          sp.Tuple(sp.diff(g3, h) * Dh + sp.diff(g3, f) * Df,
                   sp.diff(arc, h) * Dh + sp.diff(arc, f) * Df),
          lambda: sp.Tuple(_newton(g3), _newton(arc)), domain=taut,
          note="checked for g3, and the arc length as psi; equated to -(g, psi)"),
    Entry("talk.axial_stiffness", 'talk, part III, "Axial stiffness"', "elastic",
          sp.Symbol("K_h0"), q * stiffness_numerator / stiffness_denominator, _stiffness, CONV,
          "eta0 = h0/a0 with a0 = l0/sqrt 3, not h0/l0; there is one closing brace too many",
          lambda e: e.subs(eta0, h0 * root3 / l)),
    Entry("talk.rigid_height", RIGID, "rigid_response", h,
          sqrt(b**2 - 2 * third * l**2 * (1 - cos(phi))),
          lambda: sp.sqrt(sp.solve(prism.bar_length_squared() - b**2, h**2)[0]), domain=upright),
    Entry("talk.rigid_twist", RIGID, "rigid_response", phi,
          sp.acos(1 - (b**2 - h**2) / (2 * a**2)), lambda: sp.acos(rigid_response.cos_twist()),
          note="a = l/sqrt 3, which the slide does not define", domain=locking_range),
    Entry("talk.rigid_force", RIGID, "rigid_response", F, rigid_first,
          lambda: _rigid_load(False), CONV,
          "F is positive in tension here (dU/dh), in compression in the equilibrium problem",
          lambda e: -e.subs(s, rigid_response.cross_length()), locking_range),
    Entry("talk.rigid_force_of_twist", RIGID, "rigid_response", F, rigid_second,
          lambda: _rigid_load(True), CONV,
          "F is positive in tension here (dU/dh), in compression in the equilibrium problem",
          lambda e: -e, upright),
)  # fmt: skip
