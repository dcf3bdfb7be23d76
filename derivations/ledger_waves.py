"""Ledger of the talk, part III from "Properties of the elastic potential" on, and of
results that are not in the sources: the families of localised waves and their ends."""

from random import Random

import sympy as sp

from derivations import bistable as unit
from derivations import hardening, one_well, prism, regular, rigid_response, waves
from derivations import softening as own
from derivations.argument import Entry, Verdict

CONV, SLIP, NO_DATA = Verdict.CONVENTION, Verdict.SLIP, Verdict.NO_DATA
PLACE = 'talk, part III, "Properties of the elastic potential"'
OWN = "not in the sources: stated and derived here"
slender, stressed, fast = sp.symbols("slender stressed fast")  # conditions, true or false
V, V_0, V_2, V_3, mirrored = sp.symbols("V V(0) V''(0) V'''(r) V(-r)", real=True)
f, g = sp.symbols("f g", positive=True)  # lengths of strings
r, c_0, d = sp.symbols("r c_0 d", positive=True)
a, b, h_0, m = waves.stiffness, waves.slope, waves.spacing, waves.mass
e = waves.bend
gamma, c, c_s, x = waves.gamma, waves.speed, waves.acoustic_speed, waves.position
locks = ((prism.reference_height, (0.6, 2.0)), (prism.base, (0.5, 1.0)))


def _samples(slender, count=50):
    """Random values {eta0, q, a, k1} of admissible prisms, with or without eta0^2 > sqrt3/6."""
    random = Random(1)
    hard, locks = hardening.hardening_slenderness_squared(), hardening.locking_slenderness_squared()
    bound, width = (hard, 2) if slender else (locks, hard - locks)
    for _ in range(count):
        square_ = bound + width * sp.Rational(random.randint(1, 999), 1000)
        values = {
            hardening.eta: sp.sqrt(square_),
            hardening.extension: sp.Rational(random.randint(1, 500), 1000),
        }
        yield {x: v.evalf(30) for x, v in values.items()} | {
            hardening.radius: 1,
            prism.k_cross: 1,
        }


def _turned(values, turns):
    """V - V(0) over (3/2) k1 a^2 at some changes of twist of a sampled prism."""
    eta, q = values[hardening.eta], values[hardening.extension]
    at_rest = prism.at_reference(prism.cross_length_squared(sp.Integer(1)))
    rest = sp.sqrt(at_rest.subs(prism.reference_height, eta).evalf(30))
    natural = (1 - q) * rest
    for turn in turns:
        length = sp.sqrt(rest**2 + hardening.path()[1].subs(hardening.turn, turn).evalf(30))
        yield (length - natural) ** 2 - (rest - natural) ** 2


def _never_negative():
    turns = [sp.Rational(k, 10) for k in range(-20, 6)]
    return [({V: value}, True) for p in _samples(True, 10) for value in _turned(p, turns)]


def _zero_at_rest():
    return [({V_0: next(_turned(p, [0]))}, True) for p in _samples(True)]


def _curvature():
    second = hardening.derivatives()[0]
    cases = [({V_2: second.subs(p), stressed: True}, True) for p in _samples(True)]
    return [*cases, ({V_2: second.subs(hardening.extension, 0), stressed: False}, True)]


def _domain():
    lock = sp.sqrt(rigid_response.locking_height_squared())
    ends = (lock, rigid_response.stretched_height())
    return sp.Tuple(*(end - prism.reference_height for end in ends))


def _read_domain(form):
    low, high = _domain()
    return sp.Tuple(*(sp.sympify(x).subs({d: -low, sp.oo: high}) for x in form))


def _growth():
    """The power of the distance to locking with which the energy diverges, which is zero."""
    grows = min(rigid_response.lock_order()[0] + 1, sp.Integer(0))
    return c_0 * (r + d) ** grows


def _third_derivative():
    """Sign of V''' in compression, by exact differentiation along the path."""
    hardening.prove_hardening()
    delta = hardening.turn
    eta, q = hardening.eta, hardening.extension
    gained, strings = hardening.path()
    at_rest = prism.at_reference(prism.cross_length_squared(sp.Integer(1)))
    rest = sp.expand(at_rest.subs(prism.reference_height, eta))
    energy = (sp.sqrt(rest + strings) - (1 - q) * sp.sqrt(rest)) ** 2
    height = sp.sqrt(eta**2 + gained)
    for _ in range(3):
        energy = sp.diff(energy, delta) / sp.diff(height, delta)
    value = sp.lambdify((delta, eta, q), energy, "mpmath", cse=True)
    turns = [sp.Rational(k, 10) for k in range(1, 6)]
    cases = [({V_3: value(t, p[eta], p[q]), slender: True}, True)
             for p in _samples(True, 10) for t in turns]  # fmt: skip
    first = hardening.derivatives()[1]
    for kind in (True, False):
        cases += [({V_3: first.subs(p), slender: kind}, True) for p in _samples(kind)]
    return cases


def _asymmetry(kind):
    """V(r) and V(-r) at equal strokes, with the opposite change of twist solved for."""
    import mpmath

    hardening.prove_hardening()
    cases = []
    for p in _samples(kind, 10):
        eta = p[hardening.eta]
        rise = sp.lambdify(hardening.turn, hardening.path()[0], "mpmath")
        for turn in (0.001, 0.1, 0.3, 0.5) if kind else (0.001,):
            with mpmath.workdps(30):
                stroke = eta - mpmath.sqrt(eta**2 + rise(mpmath.mpf(turn)))

                def stretched(t, eta=eta, stroke=stroke, rise=rise):
                    return mpmath.sqrt(eta**2 + rise(t)) - eta - stroke

                back = mpmath.findroot(stretched, (-turn, -1.01 * turn), tol=1e-45)
            pushed, pulled = _turned(p, [sp.Float(str(turn), 30), sp.Float(back, 30)])
            cases.append(({V: pulled, mirrored: pushed, slender: kind}, True))
    return cases


def _prism_derivative(order):
    """Derivative of V(h) at the reference, in the symbols of `hardening`."""
    eta, q, radius = hardening.eta, hardening.extension, hardening.radius
    lengths = {prism.base: sp.sqrt(3), prism.reference_height: eta}
    bars = prism.at_reference(prism.bar_length_squared()).subs(lengths)
    strings = prism.at_reference(prism.cross_length_squared()).subs(lengths)
    values = {rigid_response.bar: sp.sqrt(bars), rigid_response.circumradius: 1,
              rigid_response.natural_cross: (1 - q) * sp.sqrt(strings)}  # fmt: skip
    value = rigid_response.force(order).subs(values).subs(rigid_response.height, eta)
    return sp.simplify(value / radius ** (order - 2))


strain = -a / (b * h_0) * (gamma / 2 * sp.sech(gamma * x / (2 * h_0))) ** 2
tent = sp.Piecewise((0, x / h_0 <= -1), (d / h_0 * (1 - sp.Abs(x / h_0)), x / h_0 <= 1), (0, True))

ENTRIES = (
    Entry("talk.H1_domain", PLACE, "hardening", sp.Symbol("domain of V"), sp.Tuple(-d, sp.oo),
          _domain, SLIP, "the rigid prism locks in extension too: (-d, b - h0)", _read_domain,
          locks),
    Entry("talk.H1_positive", PLACE, "hardening", "H1", V >= 0, _never_negative),
    Entry("talk.H1_zero", PLACE, "hardening", "H1", sp.Eq(V_0, 0), _zero_at_rest),
    Entry("talk.H1_curvature", PLACE, "hardening", "H1", V_2 > 0, _curvature, CONV,
          "needs a positive prestrain: V''(0) is proportional to q",
          lambda e: sp.Implies(stressed, e)),
    Entry("talk.H2", PLACE, "hardening", sp.Symbol("lower bound of V"), c_0 * (r + d) ** -1,
          _growth, SLIP, "the energy stays finite at locking, only the force diverges; what holds "
          "is V >= c0 close to -d", lambda e: e.replace(c_0 / (r + d), c_0)),
    Entry("talk.H3_derivative", PLACE, "hardening", "H3", V_3 < 0,
          _third_derivative, CONV,
          "proved for slender prisms, eta0^2 > sqrt3/6; thicker ones soften first",
          lambda e: sp.Implies(slender, e)),
    Entry("talk.H3_asymmetry", PLACE, "hardening", "H3", sp.Lt(V, mirrored),
          lambda: _asymmetry(True) + _asymmetry(False), CONV,
          "proved for slender prisms, eta0^2 > sqrt3/6",
          lambda e: sp.Implies(slender, e)),
    Entry("talk.a", PLACE, "hardening", a, _prism_derivative(2),
          lambda: hardening.derivatives()[0],
          note="V''(0) of the rigid-elastic prism, derived in two ways"),
    Entry("talk.b", PLACE, "hardening", b, _prism_derivative(3),
          lambda: hardening.derivatives()[1],
          note="V'''(0) of the rigid-elastic prism, derived in two ways"),
    Entry("talk.error_order", PLACE, "waves", sp.Symbol("O(error)"), gamma**4,
          lambda: gamma ** waves.error_order(),
          note="the exact wave of the Toda lattice has the same order"),
    Entry("talk.sech2", PLACE, "waves", sp.Symbol("epsilon"), strain, waves.sech_strain, CONV,
          "epsilon is positive in compression; x and width in metres", lambda e: -e),
    Entry("talk.gamma", PLACE, "waves", gamma**2, 24 * (c - c_s) / c_s, waves.gamma_squared,
          note="to leading order, by which gamma is defined"),
    Entry("talk.sound_speed", PLACE, "waves", c_s, h_0 * sp.sqrt(a / m), waves.sound_speed),
    Entry("talk.tent_speed", PLACE, "waves", "speeds of the tent", sp.Ge(c, c_s),
          lambda: [({c: sp.Rational(21, 20) * c_s, fast: False}, False),
                   ({c: 100 * c_s, fast: True}, True)], SLIP,
          "requires c much larger than c_s: slightly above it the sech^2 wave is many sites wide",
          lambda e: sp.And(fast, e)),
    Entry("talk.tent", PLACE, "waves", sp.Symbol("epsilon"), tent,
          lambda: waves.tent().subs(waves.stroke, d), CONV, "epsilon is positive in compression",
          lambda e: -e, ((x, (-3.0, 3.0)), (h_0, (0.5, 2.0)))),
    Entry("talk.width_slow", 'talk, part III, "Numerical simulation"', "waves",
          "about 7 prisms at 1.05 c_s, 3 at 2 to 3 c_s", verdict=NO_DATA,
          note="the prism is not given"),
    Entry("talk.width_fast", 'talk, part III, "Numerical simulation"', "waves",
          "almost the tent at 12.16 c_s", verdict=NO_DATA, note="the prism is not given"),
    Entry("talk.rarefaction", "talk, part III, softening lattices", "waves",
          "leading rarefaction wave, supersonic; tail subsonic", verdict=NO_DATA,
          note="prism, preload and end condition are not given"),
    Entry("talk.composite", "talk, part III, composite systems", "waves",
          "reflected rarefaction wave, delayed compressive pulses", verdict=NO_DATA,
          note="the two lattices are not given"),
    Entry("talk.barrier", "talk, part III, applications", "waves",
          "units of 10 micrometres, a barrier of 1 cm", verdict=NO_DATA,
          note="no attenuation law is given"),
)  # fmt: skip

OWN_ENTRIES = (
    Entry("ours.small_peak", OWN, "softening", own.peak,
          a / b * (6 * own.excess
                   + (sp.Rational(6, 5) - 9 * a * e / b**2) * own.excess**2),
          own.small_peak, note="small waves have the sign of V'''(0)"),
    Entry("ours.sech2_error", OWN, "waves", sp.Symbol("(r - gamma^2 R_1)/gamma^4"),
          -a * (3 * a * e - 5 * b**2) / (96 * b**3) * sp.sech(gamma * x / (2 * h_0)) ** 2
          + a * (a * e - 3 * b**2) / (64 * b**3) * sp.sech(gamma * x / (2 * h_0)) ** 4,
          lambda: waves.profiles()[1],
          note="the constant of the error O(gamma^4) of sech^2, as gamma tends to 0"),
    Entry("ours.even_peak", OWN, "softening", own.peak**2, 24 * a * own.excess / e,
          own.small_peak_squared, note="if V'''(0) = 0 < V''''(0), for both signs"),
    Entry("ours.peak_of_power", OWN, "softening", sp.Abs(own.peak),
          (a * own.excess * (own.exponent + 1) / own.growth) ** (1 / (own.exponent - 1)),
          own.small_peak_of_power, note="if V' = a r + d |r|^p near rest"),
    Entry("ours.front", OWN, "softening", sp.Symbol("m c_*^2, V(r_*)"),
          sp.Tuple(sp.Symbol("T", real=True) / own.r, own.r * sp.Symbol("T", real=True) / 2),
          lambda: sp.Tuple(*own.front()), note="momentum and energy across a front"),
    Entry("ours.front_curvature", OWN, "softening", sp.Symbol("Q''(r_*)"),
          2 * (own.top_stiffness - own.level) / own.top**2, own.level_curvature),
    Entry("ours.flat_top_rate", OWN, "softening",
          "c_* over the sound speed of a chain at the elongation r_*",
          sp.sinh(own.rate / 2) / (own.rate / 2), own.top_rate),
    Entry("ours.flat_top_width", OWN, "softening", sp.Symbol("width"),
          2 * sp.log(1 / own.gap) / own.rate, own.top_width,
          note="increase of the width when the gap of the peak decreases to a fraction g; half as "
          "much for the gap of the speed, which is proportional to its square"),
    Entry("ours.long_wave", OWN, "softening", sp.Symbol("m c^2"),
          sp.Symbol("T") ** 2 / (2 * (own.r * sp.Symbol("T") - sp.Symbol("V"))),
          lambda: own.long_wave().subs({own.tension(own.r): sp.Symbol("T"),
                                        own.energy(own.r): sp.Symbol("V")}),
          note="estimates the first peak of a family that does not start from zero",
          domain=((sp.Symbol("V"), (0.1, 0.2)),)),
    Entry("ours.wall_delay", OWN, "softening", sp.Symbol("beta"),
          -sp.sqrt(sp.pi) * sp.gamma(-1 / own.power)
          / (own.power * sp.gamma(sp.Rational(1, 2) - 1 / own.power)),
          own.delay, domain=((own.power, (2.5, 12.0)),)),
    Entry("ours.wall_speed", OWN, "softening", sp.Symbol("w/c"),
          own.stroke - sp.Symbol("beta") * own.left, own.relative_speed),
    Entry("ours.twin_strings", OWN, "bistable", sp.Symbol("p_c"),
          unit.base**2 * sp.cot(sp.pi / unit.sides) ** 2 / (2 * (unit.height**2 + unit.base**2)),
          unit.of_prism, note="prestrain beyond which a prism with strings of both hands has two "
          "stable twists", domain=((unit.sides, (3.0, 8.0)),)),
    Entry("ours.rotor", OWN, "bistable", sp.Symbol("p_c"),
          -unit.distance * unit.arm * sp.sin(unit.angle) ** 2 / sp.cos(unit.angle)
          / (unit.distance**2 + unit.arm**2 - 2 * unit.distance * unit.arm * sp.cos(unit.angle)),
          lambda: unit.threshold_of(unit.rotor(), unit.x), domain=((unit.angle, (1.7, 3.0)),)),
    Entry("ours.unequal_strings", OWN, "bistable", sp.Symbol("U(-x) - U(x)"),
          unit.stiffness * (unit.shorter - unit.longer),
          lambda: unit.released(unit.other).subs({unit.longer: f, unit.shorter: g}),
          reading=lambda form: form.subs({unit.longer: f, unit.shorter: g}), verdict=Verdict.HOLDS,
          note="per difference of the natural lengths, between wells at x and -x; f and g are the "
          "lengths of the strings at x"),
    Entry("ours.one_well", OWN, "one_well", sp.Symbol("S_q"),
          regular.ANY.sides * prism.base**2 * (1 + sp.sin(regular.half_angle - prism.twist))
          / sp.sin(regular.half_angle), one_well.stress_form,
          note="sum of squared lengths weighted with the self-stress: never negative, so that no "
          "prestressed prism has a state without forces"),
    Entry("ours.one_well_slope", OWN, "one_well", sp.Symbol("dQ/ds"),
          prism.k_cross * prism.natural_cross / (2 * one_well.sine * one_well.cross**2)
          + prism.k_base * prism.natural_base * one_well.sine / prism.base**3
          * (one_well.cross + one_well.bar**3 * prism.k_cross * prism.natural_cross
             / (prism.k_bar * prism.natural_bar * one_well.cross**2)),
          one_well.mismatch_slope, note="by how much the base strings miss the self-stress; it "
          "vanishes once, since this is positive"),
)  # fmt: skip
