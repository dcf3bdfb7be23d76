"""Ledger of what is not in the sources: the families of localised waves and their ends."""

import sympy as sp

from derivations import softening as own
from derivations.entry import Entry

PLACE = "not in the sources: stated and derived here"
a, b, e = own.a, own.b, own.e
half = sp.Rational(1, 2)

ENTRIES = (
    Entry("ours.small_crest", PLACE, "softening", own.crest,
          a / b * (6 * own.excess
                   + (sp.Rational(6, 5) - 9 * a * e / b**2) * own.excess**2),
          own.small_crest, note="the sign of V'''(0) is that of small waves"),
    Entry("ours.even_crest", PLACE, "softening", own.crest**2, 24 * a * own.excess / e,
          own.small_crest_squared, note="V'''(0) = 0 < V''''(0): both signs"),
    Entry("ours.crest_of_power", PLACE, "softening", sp.Abs(own.crest),
          (a * own.excess * (own.exponent + 1) / own.growth) ** (1 / (own.exponent - 1)),
          own.small_crest_of_power, note="V' = a r + d |r|^p next to rest"),
    Entry("ours.front", PLACE, "softening", sp.Symbol("m c_*^2, V(r_*)"),
          sp.Tuple(sp.Symbol("T", real=True) / own.r, own.r * sp.Symbol("T", real=True) / 2),
          lambda: sp.Tuple(*own.front()), note="momentum and energy across a front"),
    Entry("ours.front_curvature", PLACE, "softening", sp.Symbol("Q''(r_*)"),
          2 * (own.top_stiffness - own.level) / own.top**2, own.level_curvature),
    Entry("ours.flat_top_rate", PLACE, "softening",
          "c_* over the speed of sound in a chain strained by r_*",
          sp.sinh(own.rate / 2) / (own.rate / 2), own.top_rate),
    Entry("ours.flat_top_width", PLACE, "softening", sp.Symbol("width"),
          2 * sp.log(1 / own.gap) / own.rate, own.top_width,
          note="what the width gains when the gap of the crest falls to a part g; with the gap "
          "of the speed, which goes like its square, half as much"),
    Entry("ours.long_wave", PLACE, "softening", sp.Symbol("m c^2"),
          sp.Symbol("T") ** 2 / (2 * (own.r * sp.Symbol("T") - sp.Symbol("V"))),
          lambda: own.long_wave().subs({own.tension(own.r): sp.Symbol("T"),
                                        own.energy(own.r): sp.Symbol("V")}),
          note="estimates the first crest of a family that does not start from zero",
          domain=((sp.Symbol("V"), (0.1, 0.2)),)),
    Entry("ours.wall_delay", PLACE, "softening", sp.Symbol("beta"),
          -sp.sqrt(sp.pi) * sp.gamma(-1 / own.power)
          / (own.power * sp.gamma(half - 1 / own.power)),
          own.delay, domain=((own.power, (2.5, 12.0)),)),
    Entry("ours.wall_speed", PLACE, "softening", sp.Symbol("w/c"),
          own.stroke - sp.Symbol("beta") * own.left, own.relative_speed),
)  # fmt: skip
