"""How well a lens focuses: alignment, where on the axis pressure is largest, gain, energy.

That all pulses come to the focus at the same instant makes the pressure there as large as these
ends can make it, the sum of what each makes alone: alignment.  It is not the largest pressure on
the axis: a place before the focus is nearer to the ends, whose pressures fall like 1/R.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

if TYPE_CHECKING:
    from collections.abc import Callable
    from typing import Any

    from tensegrity.typing import Array

FINE, COARSE = 0.02, 0.1  # of the pulse, between instants among which a peak is looked for
AXIS = 0.5, 1.5  # of the way to the focus: where on the axis it is looked for
PLACES = 81  # there
SIMPLEX = ((0.0, 0.0), (0.5, 0.0), (0.0, 0.5))  # in steps of place and instant


@dataclass(frozen=True)
class Focusing:
    """What a lens makes of its blows; `Lens.focusing` finds it.

    Attributes
    ----------
    peak : float
        Largest pressure at the focus [Pa].
    alignment : float
        That over the sum of the largest pressures that each end makes there alone: 1 where all
        pulses come at the same instant, however weak they are.
    gain : float
        `peak` over that of the same chains with equal prestrains, the median of those chosen.
    place : float
        y [m] on the line through the focus at right angles to the ends, between half and one and
        a half of that of the focus, where the pressure comes to be largest.
    largest : float
        The pressure there [Pa].
    transmitted : float
        Energy that the ends radiate until 1.25 times the last arrival, over that of all blows.
    focus : float
        y of the focus [m].
    """

    peak: float
    alignment: float
    gain: float
    place: float
    largest: float
    transmitted: float
    focus: float

    def __str__(self) -> str:
        low, high = (part * self.focus for part in AXIS)
        more = 100 * (self.largest / self.peak - 1)
        return (
            f"peak at the focus {self.peak:.4g} Pa, {self.gain:.3g} times that of equal chains\n"
            f"alignment: 1 - {1 - self.alignment:.1e} of the sum of the peaks of each end alone\n"
            f"largest on the axis, y = {low:.4g} to {high:.4g} m: {self.largest:.4g} Pa at y = "
            f"{self.place:.4g} m, {more:.2f} % above the focus at y = {self.focus:g} m\n"
            f"transmitted: {100 * self.transmitted:.3g} % of the energy of the blows"
        )


def focusing(lens: Any, transmitted: float) -> Focusing:
    """Measure it in the pressures of a lens; `transmitted` as in `Focusing`."""
    x, y = lens.focus
    pulse = float(lens.pulse_widths.min())
    peak = _top(lambda t: lens.pressure(lens.focus, t), lens.focus_time, 2 * pulse, FINE * pulse)
    each = np.diagonal(lens.pressures(lens.focus, lens.focus_arrivals), axis1=0, axis2=1)
    equal = np.full(lens.chains, np.median(lens.chain_prestrains))
    seen = lens.arrivals_of(equal).t + lens.distances / lens.host_speed
    middle, within = (seen.max() + seen.min()) / 2, np.ptp(seen) / 2 + 2 * pulse
    gain = peak / _top(lambda t: lens.pressure(lens.focus, t, equal), middle, within, FINE * pulse)
    place, largest = _largest(lens, x, y, pulse)
    return Focusing(peak, min(peak / float(each.sum()), 1.0), gain, place, largest, transmitted, y)


def _top(pressure: Callable[[Array], Array], middle: float, within: float, step: float) -> float:
    """The largest of a function of the instant."""
    from scipy.optimize import minimize_scalar

    t = np.arange(middle - within, middle + within, step)
    best = float(t[np.argmax(pressure(t))])
    ends = (best - step, best + step)
    found = minimize_scalar(
        lambda t: -float(pressure(t)), bounds=ends, method="bounded", options={"xatol": 1e-6 * step}
    )
    return -float(found.fun)


def _largest(lens: Any, x: float, y: float, pulse: float) -> tuple[float, float]:
    """Where on the axis, and how large [m, Pa]."""
    from scipy.optimize import minimize

    low, high = AXIS
    places = np.linspace(low * y, high * y, PLACES)
    way = (high - low) * y / lens.host_speed
    t = lens.focus_time + np.arange(-way / 2 - 2 * pulse, way / 2 + 2 * pulse, COARSE * pulse)
    found = lens.pressure(np.stack([np.full(PLACES, x), places], axis=-1), t)
    i, k = np.unravel_index(np.argmax(found), found.shape)
    start, steps = np.array([places[k], t[i]]), np.array([places[1] - places[0], COARSE * pulse])

    def lower(moved: Array) -> float:
        place, instant = start + moved * steps
        return -float(lens.pressure((x, place), instant)) / found[i, k]

    ends = (places[[0, -1]] - start[0]) / steps[0]
    bounds, options = [tuple(ends), (-2.0, 2.0)], {"initial_simplex": SIMPLEX, "xatol": 1e-4}
    top = minimize(lower, [0.0, 0.0], method="Nelder-Mead", bounds=bounds, options=options)
    return float(start[0] + top.x[0] * steps[0]), float(-top.fun * found[i, k])
