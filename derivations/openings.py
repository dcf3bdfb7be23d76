"""Contacts that open or close: the order that fixed steps lose there, and how to give it back.

A step of a splitting sums the forces at its kicks: it is a quadrature, with weights b_i at nodes
c_i of the step.  Where forces are smooth its error is that of the method's order.  The force of a
contact is a power n of its overlap on one side of a root and 0 on the other, and such a power
next to its root no quadrature sums well.  But the error is known: summed over all steps, as far
as the power goes, it is Hurwitz' zeta function of where in its step the root lies (the
generalised Euler-Maclaurin formula: I. Navot, J. Math. Phys. 40, 271, 1961; J. N. Lyness,
B. W. Ninham, Math. Comp. 21, 162, 1967).  What the steps before an opening, or after a closing,
will have got wrong in all can be taken off at once, in the step of the event.

Times count from the event in steps, overlaps and their rates of change per step.
"""

from __future__ import annotations

from functools import cache

import sympy as sp

from derivations.argument import Step

TITLE = "Openings: what a step gets wrong where a contact opens, in closed form"

exponent, strength = sp.symbols("n k", positive=True)
rate, step, mass = sp.symbols("v h m", positive=True)
curvature, pull, offset = sp.symbols("a a_f epsilon_i", real=True)
since = sp.Symbol("tau", positive=True)  # steps since a closing, or until an opening
after = sp.Symbol("rho", positive=True)  # the part of the step behind the event
far = sp.Symbol("d", positive=True)  # from the end of a step to the event
turning = sp.Symbol("omega", real=True)  # of the line of contact in a step
place = sp.Symbol("q", positive=True)
way = sp.Symbol("s")  # 1 where a contact closes, -1 where it opens
own, force_now, force_slope = sp.symbols("kappa g g_t", positive=True)  # per step, squared; cubed
zeta_n, zeta_up, zeta_down = sp.symbols("Z_0 Z_2 Z_3", real=True)
SUMS = {0: zeta_n, 1: zeta_up, -1: zeta_down}
"""Sums over the kicks: of b_i zeta(-n - k, q_i) for k = 0, 1, and of b_i epsilon_i
zeta(1 - n, q_i) for k = -1; q_i from a node to the event, in steps, without its whole part."""


def quadrature_error(power: int) -> sp.Expr:
    """What h sum f(h (q + j)) of f(t) = t^power, j = 0, 1, ..., has more than the integral, over
    h^(power + 1), apart from what belongs to its far end."""
    count, j = sp.symbols("N j", positive=True, integer=True)
    total = sp.summation(sp.expand((place + j) ** power), (j, 0, count - 1))
    far = sp.Symbol("far")
    ended = sp.expand(total.subs(count, far - place))
    return sp.factor(ended.subs(far, 0))


def zeta() -> sp.Expr:
    """The same for any power n: the zeta function that continues it, of order -n."""
    return sp.zeta(-exponent, place, evaluate=False)


def offsets(stages: int = 3) -> list[sp.Expr]:
    """How far a splitting's positions at its kicks are ahead of a constant acceleration a, over
    a h^2: the kicks b_j before c_i move it there, and not the parabola."""
    kicks, drifts = (sp.symbols(f"{x}_0:{stages}") for x in "bd")
    u, v, node, found = sp.Integer(0), sp.Integer(0), sp.Integer(0), []
    for kick, drift in zip(kicks, drifts, strict=True):
        found.append(sp.expand(u - node**2 / 2))
        v += kick
        u += drift * v
        node += drift
    return found


@cache
def force() -> dict[int, sp.Expr]:
    """Coefficients of tau^(n + k) in the force at a kick, up to the first power of the step.

    The overlap there is v tau + a tau^2/2 and a_f epsilon_i: v is of the order of the step, a
    of that of its square.  On a line a_f, what the forces make of a, is all of it; where the line
    of contact turns, the rest needs no force.
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
    """What the kicks of all steps make too much of a sum of powers tau^(n + k)."""
    return sum((value * SUMS[k] for k, value in parts.items()), sp.Integer(0))


@cache
def impulse() -> sp.Expr:
    """Correction of the impulse along the line of contact, over h."""
    return -sp.collect(sp.expand(summed(force())), strength * rate**exponent)


@cache
def turned() -> sp.Expr:
    """The same across the line, which is `turning` away a step later: over h."""
    return -way * turning * summed({1: force()[0]})


@cache
def shift() -> sp.Expr:
    """Correction of the displacement's moment at the end of the step, over h^2, to first order.

    An impulse at time t moves by the time from t to the end: the part of the step behind the
    event, and s tau less.
    """
    return after * impulse() - (-way) * summed({1: force()[0]})


def touch() -> sp.Expr:
    """Impulse over h of a contact that closes and opens within a step, along a parabola."""
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
    """Integral of a linear contact's overlap for a time `far` from its closing, and that times the
    time left; kappa is k h^2 over the reduced mass."""
    w = sp.Function("w")(since)
    motion = w.diff(since, 2) - force_now - force_slope * since + own * w
    found = sp.dsolve(motion, w, ics={w.subs(since, 0): 0, w.diff(since).subs(since, 0): rate}).rhs
    weighted = found, sp.expand(found * (far - since))
    return tuple(sp.simplify(sp.integrate(x, (since, 0, far))) for x in weighted)


def rest() -> sp.Expr:
    """Integral over h of the force between an instant and an event that is `far` away."""
    parts = force()
    power = sum(parts[k] * since ** (exponent + k) for k in (0, 1))
    return sp.integrate(sp.expand(power), (since, 0, far))


def left() -> sp.Expr:
    """Order of the steps with the correction, where they do not lose it for other reasons."""
    return exponent + 2 + max(SUMS)


def argument() -> list[Step]:
    square = sp.Eq(sp.Symbol("E_2"), quadrature_error(2), evaluate=False)
    third = offsets(3)[2]
    return [
        Step("A rule that takes one value a step, at the part q of it, sums the square of the time "
             "since the event too high, but for what belongs to the far end, by h^3 times", square),
        Step("which is minus a Bernoulli polynomial over 3. For any power n it is h^(n+1) times "
             "Hurwitz' zeta function, the continuation of the sum of (q + j)^n:",
             sp.Eq(sp.Symbol("E_n"), zeta(), evaluate=False)),
        Step("So the error of a run is of order n + 1 in the step, 5/2 for Hertz's contacts, "
             "whatever the order p of the method: it only decides how fast steps farther away "
             "matter less. A splitting's kicks act at positions that are not those of the motion: "
             "at the third kick, under a constant acceleration a, ahead by a h^2 times",
             sp.Eq(sp.Symbol("epsilon_2"), third, evaluate=False)),
        Step("With the overlap v tau + a tau^2/2 at a time tau from the event, and a_f epsilon_i "
             "more at a kick, where a_f is what forces make of a, without the turn of the line, "
            "the force there is k v^n tau^n and, next in the step,",
             *(sp.Eq(sp.Symbol(f"F_{name}"), force()[k] * since ** (exponent + k)
                     * (offset if k < 0 else 1), evaluate=False)
               for k, name in ((1, "1"), (-1, "2")))),
        Step("Each power is summed wrong by its own zeta function. With Z_0, Z_2 the sums of "
             "b_i zeta(-n, q_i) and b_i zeta(-n - 1, q_i), and Z_3 that of b_i epsilon_i "
             "zeta(1 - n, q_i), q_i the time from a node to the event without its whole part, the "
             "impulse lacks, over h,", sp.Eq(sp.Symbol("J"), impulse(), evaluate=False)),
        Step("along the line of contact. Where that turns by omega in a step, it lacks across, "
             "s = 1 for a closing and -1 for an opening,",
             sp.Eq(sp.Symbol("J_t"), turned(), evaluate=False)),
        Step("The steps went wrong at times around the event, not at it. At the end of the step, "
             "rho of a step behind the event, the displacement lacks, times the mass, over h^2,",
             sp.Eq(sp.Symbol("G"), shift(), evaluate=False)),
        Step("Kicks on both sides of an instant have a share in J. Before a contact opens, in the "
             "step to come, J is still to be given, and after it closed what later kicks will get "
             "wrong was taken off already: velocities there are wrong to order n + 1. What is "
             "looked at is a copy that has J without the share of the kicks up to the event, d of "
             "a step away: their sum less",
             sp.Eq(sp.Symbol("I"), rest(), evaluate=False)),
        Step("A contact that opens in the first step of a run had no kicks before it: there J is "
             "I less the sum of its kicks, d being the time since the begin."),
        Step("Where n is 1 all zeta functions with whole numbers q vanish outside of the step, and "
             "the motion is known: with g + g_t tau for all other forces, which the ends of the "
             "step tell, the impulse of a closed contact is k over h times", linear()[0]),
        Step("and its kicks are summed. Both bodies get these with opposite signs. A contact that "
             "closes and opens in a step, l of it long, has the impulse, over h,",
             touch()),
        Step("and what the kicks made of it is known. What is left are the powers that come next: "
             "the jerk, and the force of the contact in the position at later kicks of the same "
             "step. With corrections the error falls with the power", left()),
        Step("as long as the method's order is higher. A contact that touches for less than a "
             "step across the end of one keeps an error of order 2 n + 1; and steps that look at "
             "signs of overlaps do not come back along the same states when time is reversed."),
    ]  # fmt: skip
