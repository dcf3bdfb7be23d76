"""Loss and onset of contact: the order that fixed steps lose there, and its restoration.

A step of a splitting method sums the forces at its kicks, which is a quadrature with weights b_i
at nodes c_i of the step.  For smooth forces its error has the order of the method.  The force of a
contact, however, is a power n of the overlap on one side of a root and 0 on the other, for which
quadrature errors are large.  Their sum over all steps is known: it is Hurwitz' zeta function of
the position of the root in its step (the generalised Euler-Maclaurin formula: I. Navot, J. Math.
Phys. 40, 271, 1961; J. N. Lyness, B. W. Ninham, Math. Comp. 21, 162, 1967).  The total error of
the steps before a loss, or after an onset, of contact is subtracted in the step of the event.

Times are measured from the event in steps, overlaps and their rates of change per step.
"""

from __future__ import annotations

from functools import cache

import sympy as sp

from derivations.argument import Step

TITLE = "Loss of contact: the error of a step in closed form"

exponent, strength = sp.symbols("n k", positive=True)
rate, step, mass = sp.symbols("v h m", positive=True)
curvature, pull, offset = sp.symbols("a a_f epsilon_i", real=True)
since = sp.Symbol("tau", positive=True)  # steps since the onset, or until the loss, of contact
after = sp.Symbol("rho", positive=True)  # fraction of the step after the event
far = sp.Symbol("d", positive=True)  # steps from an instant to the event
turning = sp.Symbol("omega", real=True)  # rotation of the line of contact per step
place = sp.Symbol("q", positive=True)
way = sp.Symbol("s")  # 1 at the onset of contact, -1 at its loss
own, force_now, force_slope = sp.symbols("kappa g g_t", positive=True)  # per step, squared; cubed
zeta_n, zeta_up, zeta_down = sp.symbols("Z_0 Z_2 Z_3", real=True)
SUMS = {0: zeta_n, 1: zeta_up, -1: zeta_down}
"""Sums over the kicks: of b_i zeta(-n - k, q_i) for k = 0, 1, and of b_i epsilon_i
zeta(1 - n, q_i) for k = -1; q_i is the fractional part of the time between node and event."""


def quadrature_error(power: int) -> sp.Expr:
    """h sum f(h (q + j)) over j = 0, 1, ... minus the integral of f(t) = t^power, over
    h^(power + 1), without the contribution of the far end."""
    count, j = sp.symbols("N j", positive=True, integer=True)
    total = sp.summation(sp.expand((place + j) ** power), (j, 0, count - 1))
    far = sp.Symbol("far")
    ended = sp.expand(total.subs(count, far - place))
    return sp.factor(ended.subs(far, 0))


def zeta() -> sp.Expr:
    """The quadrature error for any power n, Hurwitz' zeta function of order -n."""
    return sp.zeta(-exponent, place, evaluate=False)


def offsets(stages: int = 3) -> list[sp.Expr]:
    """Deviation of a splitting's positions at its kicks from the parabola of a constant
    acceleration a, over a h^2; they result from the kicks b_j before c_i."""
    kicks, drifts = (sp.symbols(f"{x}_0:{stages}") for x in "bd")
    u, v, node, terms = sp.Integer(0), sp.Integer(0), sp.Integer(0), []
    for kick, drift in zip(kicks, drifts, strict=True):
        terms.append(sp.expand(u - node**2 / 2))
        v += kick
        u += drift * v
        node += drift
    return terms


@cache
def force() -> dict[int, sp.Expr]:
    """Coefficients of tau^(n + k) in the force at a kick, up to the first power of the step.

    The overlap there is v tau + a tau^2/2 + a_f epsilon_i, with v of the order of the step and a
    of its square.  The part a_f of a is due to forces; it is all of a unless the line of contact
    rotates.
    """
    small = sp.Symbol("small")
    overlap = rate * small * since + small**2 * (curvature * since**2 / 2 + pull * offset)
    ratio = sp.expand(overlap / (rate * small * since))
    series = sp.series((1 + sp.Symbol("y")) ** exponent, sp.Symbol("y"), 0, 2).removeO()
    bracket = sp.expand(series.subs(sp.Symbol("y"), ratio - 1)).subs(small, 1)
    return {
        k: strength * rate**exponent * sp.simplify(bracket.coeff(since, k).subs(offset, 1))
        for k in (0, 1, -1)
    }


def summed(parts: dict[int, sp.Expr]) -> sp.Expr:
    """Error of the kicks of all steps for a sum of powers tau^(n + k)."""
    return sum((value * SUMS[k] for k, value in parts.items()), sp.Integer(0))


@cache
def impulse() -> sp.Expr:
    """Correction of the impulse along the line of contact, over h."""
    return -sp.collect(sp.expand(summed(force())), strength * rate**exponent)


@cache
def turned() -> sp.Expr:
    """Correction of the impulse normal to the line, which rotates by `turning` per step, over h."""
    return -way * turning * summed({1: force()[0]})


@cache
def shift() -> sp.Expr:
    """Correction of the displacement's moment at the end of the step, over h^2, to first order.

    An impulse at time t causes a displacement in proportion to the time from t to the end, which
    is the fraction of the step after the event minus s tau.
    """
    return after * impulse() - (-way) * summed({1: force()[0]})


def touch() -> sp.Expr:
    """Impulse over h of a contact that begins and ends within a step, on a parabola."""
    y, length = sp.Symbol("y", positive=True), sp.Symbol("l", positive=True)
    overlap = sp.Abs(curvature) / 2 * length**2 * y * (1 - y)
    power = sp.expand_power_base(overlap**exponent, force=True)
    constant, shape = power.as_independent(y)
    beta = sp.beta(exponent + 1, exponent + 1)
    if sp.simplify(shape / (y**exponent * (1 - y) ** exponent)) != 1:
        raise ArithmeticError(f"{shape} is no power of y (1 - y)")
    return strength * sp.powsimp(constant * length) * beta


@cache
def linear() -> tuple[sp.Expr, sp.Expr]:
    """Integral of a linear contact's overlap over the time `far` after its onset, and that of the
    overlap times the remaining time; kappa is k h^2 over the reduced mass."""
    w = sp.Function("w")(since)
    motion = w.diff(since, 2) - force_now - force_slope * since + own * w
    growth = sp.dsolve(motion, w, ics={w.subs(since, 0): 0, w.diff(since).subs(since, 0): rate}).rhs
    weighted = growth, sp.expand(growth * (far - since))
    return tuple(sp.simplify(sp.integrate(x, (since, 0, far))) for x in weighted)


def rest() -> sp.Expr:
    """Integral over h of the force between an instant and an event at the distance `far`."""
    parts = force()
    power = sum(parts[k] * since ** (exponent + k) for k in (0, 1))
    return sp.integrate(sp.expand(power), (since, 0, far))


def left() -> sp.Expr:
    """Order of the corrected steps, if nothing else reduces it."""
    return exponent + 2 + max(SUMS)


def argument() -> list[Step]:
    square = sp.Eq(sp.Symbol("E_2"), quadrature_error(2), evaluate=False)
    third = offsets(3)[2]
    return [
        Step("A rule with one value per step, at the fraction q, integrates the square of the time "
             "since the event with an error, without that of the far end, of h^3 times", square),
        Step("This is minus a Bernoulli polynomial over 3. For any power n it is h^(n+1) times "
             "Hurwitz' zeta function, the continuation of the sum of (q + j)^n:",
             sp.Eq(sp.Symbol("E_n"), zeta(), evaluate=False)),
        Step("The error of a run is thus of order n + 1 in the step, 5/2 for Hertz's contacts, "
             "for every order p of the method, which only determines how fast the contribution of "
             "distant steps decays. The kicks of a splitting act at positions that deviate from "
             "the motion: at the third kick, under a constant acceleration a, by a h^2 times",
             sp.Eq(sp.Symbol("epsilon_2"), third, evaluate=False)),
        Step("The overlap at a time tau from the event is v tau + a tau^2/2, plus a_f epsilon_i at "
             "a kick, where a_f is the part of a due to forces and not to the rotation of the "
             "line. The force there is k v^n tau^n and, in the next order of the step,",
             *(sp.Eq(sp.Symbol(f"F_{name}"), force()[k] * since ** (exponent + k)
                     * (offset if k < 0 else 1), evaluate=False)
               for k, name in ((1, "1"), (-1, "2")))),
        Step("The error of each power is its own zeta function. Let Z_0 and Z_2 be the sums of "
             "b_i zeta(-n, q_i) and b_i zeta(-n - 1, q_i), and Z_3 that of b_i epsilon_i "
             "zeta(1 - n, q_i), where q_i is the fractional part of the time between node and "
             "event. The missing impulse along the line of contact is, over h,",
             sp.Eq(sp.Symbol("J"), impulse(), evaluate=False)),
        Step("If the line rotates by omega per step, the missing impulse normal to it is, with "
             "s = 1 at the onset of contact and -1 at its loss,",
             sp.Eq(sp.Symbol("J_t"), turned(), evaluate=False)),
        Step("The errors arise at times around the event rather than at it. At the end of the "
             "step, a fraction rho of a step after the event, the missing displacement is, times "
             "the mass and over h^2,",
             sp.Eq(sp.Symbol("G"), shift(), evaluate=False)),
        Step("Kicks on both sides of an instant contribute to J. In the step before a loss of "
             "contact J has not been applied yet, and after its onset the errors of later kicks "
             "have already been subtracted, so that velocities there have errors of order n + 1. "
             "The output state is a copy to which J is applied without the contribution of the "
             "kicks up to the event, d steps away, which is their sum minus",
             sp.Eq(sp.Symbol("I"), rest(), evaluate=False)),
        Step("A contact lost in the first step of a run had no kicks before it: there J is I minus "
             "the sum of its kicks, with d the time since the beginning."),
        Step("For n = 1 the zeta functions of integer q vanish outside the step, and the motion is "
             "known. With g + g_t tau for all other forces, which follow from the ends of the "
             "step, the impulse of a closed contact is k over h times", linear()[0]),
        Step("while its kicks are summed directly. Corrections of both bodies are opposite. A "
             "contact within a step, lasting l steps, has the impulse over h", touch()),
        Step("and the contribution of the kicks to it is known. The remaining error is due to the "
             "next powers: the jerk, and the effect of the contact force on the positions at later "
             "kicks of the same step. With corrections the error decreases with the power", left()),
        Step("if the order of the method is higher. A contact that lasts for less than a step but "
             "across the end of one retains an error of order 2 n + 1. Steps that depend on the "
             "signs of overlaps are not time-reversible. For n < 1 (losses) order 2 is left."),
    ]  # fmt: skip
