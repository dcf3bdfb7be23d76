"""Ledger of the paper: equations (1) to (7) and the numbers that follow from them."""

import sympy as sp

from derivations import contact, junction
from derivations.argument import Entry, Verdict
from derivations.ledger_talk import distance, normal, surface_i, surface_j

CONV, NO_DATA = Verdict.CONVENTION, Verdict.NO_DATA
alpha, n = contact.constant, contact.exponent
E_i, E_j, r_i, r_j = contact.modulus_1, contact.modulus_2, contact.radius_1, contact.radius_2
nu_i, nu_j = contact.poisson_1, contact.poisson_2
pressed, gap = sp.Symbol("delta_ij^+", positive=True), sp.Symbol("delta_ij", real=True)
m, m_i, m_1, m_2, v = sp.symbols("m m_i m_1 m_2 v", positive=True)
momenta, velocities = sp.symbols("p_1:5", real=True), sp.symbols("v_1:5", real=True)
p, q, k, V_12 = sp.symbols("p q k V_12", real=True)
theta_1, theta_2 = sp.symbols("theta_1 theta_2", real=True)
f_1, f_2 = sp.symbols("f_1 f_2", positive=True)
I_0, waves = junction.incident, junction.waves
oscillator = p**2 / (2 * m) + k * q**4 / 4
rate = sp.Symbol("dH/dt", real=True)


def _hamiltonian():
    """Legendre transform of T - V for two beads in the plane."""
    masses = (m_1, m_1, m_2, m_2)
    lagrangian = sum(mass * w**2 / 2 for mass, w in zip(masses, velocities, strict=True)) - V_12
    definitions = [sp.diff(lagrangian, w) - x for x, w in zip(momenta, velocities, strict=True)]
    total = sum(x * w for x, w in zip(momenta, velocities, strict=True)) - lagrangian
    return sp.expand(total.subs(sp.solve(definitions, velocities)))


def _section_force():
    """Force across the middle plane of a bead, normal to its motion, with a contact on each side.

    The force across the section accelerates the front half of the mass against the contact ahead.
    """
    ahead, behind = f_1 * sp.cos(theta_1), -f_2 * sp.cos(theta_2)
    section, acceleration = sp.symbols("S A")
    balances = [m_i * acceleration - (behind - ahead),
                m_i / 2 * acceleration - (section - ahead)]  # fmt: skip
    return sp.solve(balances, [section, acceleration])[section]


def _newton():
    """Newton's law for the force of the oscillator, and the definition of momentum."""
    return sp.Tuple(-sp.diff(oscillator.subs(p, 0), q), p / m)


def _energy_rate():
    force, velocity = _newton()
    change = sp.diff(oscillator, q) * velocity + sp.diff(oscillator, p) * force
    return [({rate: sp.expand(change)}, True)]


def _rounded(value, digits):
    """A derived number, rounded to the printed digits."""
    return sp.Rational(str(round(float(value), digits)))


def _half(pair, index):
    return pair()[index].subs(n, sp.Rational(3, 2))


thirds = ((nu_i, (0.1, 0.5)), (nu_j, (0.1, 0.5)))
ENTRIES = (
    Entry("paper.eq1", "paper, eq. (1)", "contact", gap, -(surface_j - surface_i).dot(normal),
          lambda: r_i + r_j - distance,
          note="overlap is positive, opposite to the particle strain of the talk"),
    Entry("paper.momenta", "paper, before eq. (2)", "contact", sp.Symbol("p_2i-1"), m * v,
          lambda: m_i * v, CONV, "m stands for m_i", lambda e: e.subs(m, m_i)),
    Entry("paper.eq2", "paper, eq. (2)", "contact", sp.Symbol("H"),
          (momenta[0] ** 2 + momenta[1] ** 2) / (2 * m_1)
          + (momenta[2] ** 2 + momenta[3] ** 2) / (2 * m_2) + V_12, _hamiltonian,
          note="written for two beads"),
    Entry("paper.eq3", "paper, eq. (3)", "contact", sp.Symbol("V_ij"),
          sp.Rational(2, 5) * alpha * pressed ** sp.Rational(5, 2),
          lambda: contact.power_law_energy().subs(
              {contact.overlap: pressed, n: contact.hertz_constant()[1]})),
    Entry("paper.eq4", "paper, eq. (4)", "contact", alpha,
          4 * E_i * E_j * sp.sqrt(r_i * r_j / (r_i + r_j))
          / (3 * E_i * (1 - nu_j**2) + 3 * E_j * (1 - nu_i**2)),
          lambda: contact.hertz_constant()[0], domain=thirds),
    Entry("paper.eq5", "paper, eq. (5)", "contact", sp.Symbol("F_i"),
          (f_1 * sp.Abs(sp.cos(theta_1)) + f_2 * sp.Abs(sp.cos(theta_2))) / 2, _section_force,
          note="the force across the middle plane of a rigid bead, normal to its displacement",
          domain=((theta_1, (0.1, 1.5)), (theta_2, (1.6, 3.1)))),
    Entry("paper.eq6", "paper, eq. (6)", "contact", sp.Symbol("(dp/dt, dq/dt)"),
          sp.Tuple(-sp.diff(oscillator, q), sp.diff(oscillator, p)), _newton,
          note="shown for p^2/2m + k q^4/4"),
    Entry("paper.energy", "paper, after eq. (6)", "contact", "energy", sp.Eq(rate, 0),
          _energy_rate),
    Entry("paper.energy_error", "paper, after eq. (6)", "contact",
          "relative energy error below 1e-5 at a step of 1e-6 s", verdict=NO_DATA,
          note="a result of runs, not of formulas"),
    Entry("paper.effective_mass", "paper, section IV", "contact", sp.Symbol("m_eff") / m,
          sp.Rational(7, 5), lambda: _rounded(contact.effective_mass(), 1),
          note="for the long wave, to the printed digits"),
    Entry("paper.eq7_reflected", "paper, eq. (7)", "junction", junction.reflected,
          (3 * waves - 2) / (2 + 3 * waves) * I_0, lambda: junction.at_thirty_degrees()[0],
          note="I1 is positive backwards; branches at 30 degrees, n waves in each"),
    Entry("paper.eq7_transmitted", "paper, eq. (7)", "junction", junction.transmitted,
          2 * sp.sqrt(3) / (2 + 3 * waves) * I_0, lambda: junction.at_thirty_degrees()[1]),
    Entry("paper.force_scaling", "paper, section IV", "contact", sp.Symbol("F_m"),
          I_0 ** sp.Rational(6, 5), lambda: I_0 ** _half(contact.scalings, 0),
          note="up to a constant"),
    Entry("paper.speed_scaling", "paper, section IV", "contact", sp.Symbol("V_s"),
          I_0 ** sp.Rational(1, 5), lambda: I_0 ** _half(contact.scalings, 1),
          note="up to a constant"),
    Entry("paper.force_ratio_transmitted", "paper, section IV", "junction",
          sp.Symbol("F_i") / sp.Symbol("F_t"), sp.Rational(16, 10),
          lambda: _rounded(junction.force_ratios()[0], 1)),
    Entry("paper.force_ratio_reflected", "paper, section IV", "junction",
          sp.Symbol("F_i") / sp.Symbol("F_r"), sp.Rational(69, 10),
          lambda: _rounded(junction.force_ratios()[1], 1)),
    Entry("paper.speed_ratio_transmitted", "paper, section IV", "junction",
          sp.Symbol("V_t") / sp.Symbol("V_i"), sp.Rational(894, 1000),
          lambda: _rounded(sp.Rational("506.64") / sp.Rational("566.96"), 3),
          note="from the measured speeds printed next to it"),
    Entry("paper.speed_ratio_reflected", "paper, section IV", "junction",
          sp.Symbol("V_r") / sp.Symbol("V_i"), sp.Rational(734, 1000),
          lambda: _rounded(sp.Rational("415.92") / sp.Rational("566.96"), 3),
          note="from the measured speeds printed next to it"),
    Entry("paper.speed_ratios_numerical", "paper, section IV", "junction",
          "V_t/V_i = 0.917, V_r/V_i = 0.688 from numerical runs", verdict=NO_DATA,
          note="a result of runs, not of formulas"),
    Entry("paper.steel_ptfe_speeds", "paper, section IV", "contact",
          "signal about 4 times faster in the steel branch than in the PTFE branch",
          verdict=NO_DATA, note="a result of runs, not of formulas"),
    Entry("paper.parylene_overlap", "paper, section IV", "contact",
          "overlaps of 10 micrometres, 5 and 2 on the mean", verdict=NO_DATA,
          note="a result of runs, not of formulas"),
)  # fmt: skip
