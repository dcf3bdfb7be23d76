"""Methods that were tried and are not in `tensegrity.engine.methods`.

Splittings run in the compiled loop, for rows of coefficients are all it needs.  Kicks with a
force gradient, v += b dt a + c dt^3 a' a (a' a the derivative of the accelerations along
themselves), run in NumPy on the same compiled forces and stiffnesses; such a kick counts as
`GRADIENT` evaluations, what it was measured to cost against a plain one.
"""

from __future__ import annotations

import itertools
from dataclasses import dataclass

import numpy as np

from tensegrity import Splitting
from tensegrity.engine.methods import palindrome
from tensegrity.scenes.dynamics import dynamics

GRADIENT = 1.9


def _composition(half):
    """Verlet composed with itself: rows from the first half of its substeps."""
    steps = palindrome(half, odd=True)
    ends = [0.0, *steps, 0.0]
    return tuple((a + b) / 2 for a, b in itertools.pairwise(ends)), steps


def _drift_first(drifts, kicks, odd_drifts):
    """Rows of a method that begins with a drift."""
    return (0.0, *palindrome(kicks, not odd_drifts), 0.0), palindrome(drifts, odd_drifts)


_SUZUKI = 1 / (4 - 4 ** (1 / 3))
_BLANES_MOAN = "S. Blanes, P. C. Moan, J. Comput. Appl. Math. 142, 313 (2002)"
_KAHAN_LI = "W. Kahan, R.-C. Li, Math. Comput. 66, 1089 (1997)"
_ORDER_8 = "S. Blanes, F. Casas, A. Escorihuela-Tomas, Appl. Numer. Math. 182, 14 (2022)"
_ROWS = {
    "yoshida 4": (
        4,
        _composition((1 / (2 - 2 ** (1 / 3)),)),
        "H. Yoshida, Phys. Lett. A 150, 262 (1990)",
    ),
    "suzuki 4": (4, _composition((_SUZUKI, _SUZUKI)), "M. Suzuki, Phys. Lett. A 146, 319 (1990)"),
    "blanes-moan rkn4 6b": (
        4,
        (
            palindrome((0.0829844064174052, 0.396309801498368, -0.0390563049223486), True),
            palindrome((0.245298957184271, 0.604872665711080), False),
        ),
        _BLANES_MOAN,
    ),
    "kahan-li 6": (
        6,
        _composition(
            (
                0.39216144400731413928, 0.33259913678935943860, -0.70624617255763935981,
                0.082213596293550800230,
            )
        ),
        _KAHAN_LI,
    ),
    "kahan-li 8": (
        8,
        _composition(
            (
                0.13020248308889008088, 0.56116298177510838456, -0.38947496264484728641,
                0.15884190655515560090, -0.39590389413323757734, 0.18453964097831570709,
                0.25837438768632204729, 0.29501172360931029887,
            )
        ),
        _KAHAN_LI,
    ),
    "blanes-moan rkn6 14a": (
        6,
        _drift_first(
            (
                0.03785931984061157, 0.102635633102435, -0.02586788826655869, 0.314241403071447,
                -0.130144459517415, 0.106417700369543, -0.008794243128510581,
            ),
            (
                0.09171915262446165, 0.183983170005006, -0.05653436583288827,
                0.004914688774712854, 0.143761127168358, 0.328567693746804,
            ),
            odd_drifts=True,
        ),
        _BLANES_MOAN,
    ),
    "rkn8 19a": (
        8,
        _drift_first(
            (
                0.0505805, 0.149999, -0.0551795510771615573511026950361,
                0.423755898835337951482264998051, -0.213495353584659048059672194633,
                -0.0680769774574032619111630736274, 0.227917056974013435948887201671,
                -0.235373619381058906524740047732, 0.387413869179878047816794031058,
            ),
            (
                0.129478606560536730662493794395, 0.222257260092671143423043559581,
                -0.0577514893325147204757023246320, -0.0578312262103924910221345032763,
                0.103087297437175356747933252265, -0.140819612554090768205554103887,
                0.0234462603492826276699713718626, 0.134854517356684096617882205068,
                0.0287973821073779306345172160211,
            ),
            odd_drifts=False,
        ),
        _ORDER_8,
    ),
    "rkn8 19b": (
        8,
        (
            palindrome(
                (
                    0.036132460472136313416730168194, 0.012697863961074113381675193011,
                    0.201318391240629276109068041836, 0.135683350134504233201330671671,
                    -0.0579071833999963041504740663015, -0.0772509501792649549463874931821,
                    -0.00264758266409925952822161203471, -0.0329844384945603065320797537355,
                    0.0476781560950366927530646289755,
                ),
                False,
            ),
            palindrome(
                (
                    0.337548675291317241942440116575, -0.223647977575409990331768222380,
                    0.168949714872223740906385138015, 0.171179938816205886154783136334,
                    -0.349765168067292877221144631312, 0.523808861006312397712070357524,
                    -0.194208871063049124066394765282, -0.323496751337931087309823477561,
                    0.322817287614899749216601693799,
                ),
                True,
            ),
        ),
        _ORDER_8,
    ),
}  # fmt: skip

SPLITTINGS = {
    name: Splitting(name, order, 0.1, *rows, reference=reference)
    for name, (order, rows, reference) in _ROWS.items()
}


@dataclass(frozen=True)
class GradientSplitting:
    """A palindrome of kicks b with gradients c, and drifts."""

    order: int
    kicks: tuple[float, ...]
    gradients: tuple[float, ...]
    drifts: tuple[float, ...]
    limit: float  # about, of dt omega

    @property
    def evaluations(self):
        """Force evaluations per step; the last kick of a step serves the next."""
        return evaluations(self.kicks) + (GRADIENT - 1) * sum(c != 0 for c in self.gradients)


def evaluations(kicks):
    """Kicks of a step that are not 0; the last one serves the next step too."""
    return sum(b != 0 for b in kicks) - (kicks[0] != 0)


GRADIENTS = {
    # S. A. Chin, Phys. Lett. A 226, 344 (1997)
    "chin 4a": GradientSplitting(4, (1 / 6, 2 / 3, 1 / 6), (0, 1 / 36, 0), (0.5, 0.5), 3.4),
    # found here: nine kicks, the middle one with a gradient
    "gradient 6": GradientSplitting(
        6,
        palindrome(
            (0.05207161406656671, 0.2502628202274777, 0.2825545105261253, -0.009349925863685944),
            True,
        ),
        (0, 0, 0, 0, 0.0036886862201606727, 0, 0, 0, 0),
        palindrome((0.15786350194429255, 0.27217510438522063, 0.535840375693438), False),
        2.5,
    ),
}  # fmt: skip


def run_gradient(chain, state, method, dt, steps):
    """u and v after some steps, in NumPy."""
    u, v, w = state.u.copy(), state.v.copy(), dynamics(chain).inverse_mass
    spring = chain.springs[0]

    def pull(tension):
        return w * np.diff(tension, prepend=0.0, append=0.0)

    for _ in range(steps):
        rows = zip(method.kicks, method.gradients, (*method.drifts, 0.0), strict=True)
        for b, c, d in rows:
            if b or c:
                r = np.diff(u)
                a = pull(spring.tension(r))
                v += b * dt * a
            if c:
                v += c * dt**3 * pull(spring.stiffness(r) * np.diff(a))
            u += d * dt * v
    return u, v
