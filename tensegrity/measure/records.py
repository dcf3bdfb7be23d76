"""Peaks of a quantity recorded over time, such as the force of a sensor.

Peaks lie between the recorded instants; they are located by interpolating splines of degree 5, the
first one by the polynomial through the rows around it, as SciPy takes longer to import than most
first calls of this package.  Interpolation is for computed rows.  Rows with noise are fitted, see
`tensegrity.measure.peaks`.
"""

from __future__ import annotations

import math
from typing import Annotated, Any, Generic, NamedTuple, TypeVar

import numpy as np
from numpy.typing import ArrayLike

from tensegrity import check
from tensegrity.checked import checked
from tensegrity.errors import TensegrityError
from tensegrity.measure.peaks import DISTINCT, PEAK_FRACTION, fitted_peaks, refuse_plateau
from tensegrity.measure.series import TimeSeries
from tensegrity.root import root
from tensegrity.typing import Array, Duration, Flags, Fraction

CLOCK = 3e-6  # s: sampling interval of the paper's density plots
LEVEL = 0.05  # of the largest peak: smaller ones do not count
AROUND = 7  # rows by which the first peak is located
ROUND_OFF = 1e-9  # of the clock, by which rows may be farther apart
NOISE = 1e-9  # of the largest force: maxima below it are round-off

Number = TypeVar("Number")


class _Pair(NamedTuple, Generic[Number]):
    instant: Number
    height: Number


class Peak(_Pair[Number]):
    """Instant [s] and height [N] of a peak, or of several as arrays, and what noise leaves open.

    Attributes
    ----------
    instant_error, height_error : float or ndarray
        Standard deviations of both; 0 where the rows are interpolated.
    noise : float
        Standard deviation of each row, given or estimated; 0 of computed rows.
    """

    instant_error: Number
    height_error: Number
    noise: float

    def __new__(
        cls, instant: Any, height: Any, instant_error: Any = None, height_error: Any = None,
        noise: float = 0.0,
    ) -> Peak[Number]:  # fmt: skip
        self = super().__new__(cls, instant, height)
        none = np.zeros(np.shape(instant)) if np.ndim(instant) else 0.0
        self.__dict__.update(
            instant_error=none if instant_error is None else instant_error,
            height_error=none if height_error is None else height_error,
            noise=noise,
        )
        return self

    def __setattr__(self, name: str, value: object) -> None:
        raise AttributeError(f"{name} of a peak cannot be set")


@checked
def first_peak(
    t: ArrayLike | TimeSeries,
    force: ArrayLike | None = None,
    between: tuple[float, float] = (-math.inf, math.inf),
    *,
    noise: Annotated[float, ">= 0", "N"] | None = None,
) -> Peak[float]:
    """Instant and height of the first large peak of a recorded force.

    Parameters
    ----------
    t, force : ndarray, (T,)
        [s], [N]; or a `TimeSeries` alone.
    between : (float, float)
        Interval of time that is searched [s].
    noise : float, optional
        Standard deviation of each row [N]; by default estimated, 0 if the rows are smooth.

    Returns
    -------
    instant, height : float
        Located between the rows by the polynomial through the seven rows around; of a record with
        noise, as by `peaks`, with the attributes `instant_error` and `height_error`.

    Raises
    ------
    TensegrityError
        Fewer than 12 rows in that time, or no maximum; an invalid record, as for `peaks`.

    Examples
    --------
    >>> import numpy as np
    >>> from tensegrity import first_peak
    >>> t = np.linspace(0, 1, 101)
    >>> force = np.exp(-(((t - 0.303) / 0.05) ** 2)) + 0.5 * np.exp(-(((t - 0.702) / 0.05) ** 2))
    >>> [round(x, 4) for x in first_peak(t, force, between=(0.5, 1.0))]
    [0.702, 0.5]
    """
    t, force, noise = _record(t, force, noise)
    inside = _within(t, between)
    if inside.sum() < 12:
        raise TensegrityError(f"{inside.sum()} instants between {between} s are too few for a peak")
    t, force = t[inside], force[inside]
    if noise:
        instant, height, *errors = fitted_peaks(t, force, noise, PEAK_FRACTION, DISTINCT)[:, 0]
        return Peak(float(instant), float(height), *map(float, errors), noise=noise)
    _refuse_no_peak(t, force)
    large = force >= PEAK_FRACTION * force.max()
    tops = np.flatnonzero((np.diff(force[:-1]) >= 0) & (np.diff(force[1:]) < 0) & large[1:-1])
    if not len(tops):
        raise TensegrityError(f"the force has no peak between {between} s")
    top, first = tops[0] + 1, min(max(tops[0] - 2, 0), len(t) - AROUND)
    part, unit = slice(first, first + AROUND), t[top + 1] - t[top - 1]
    curve = np.linalg.solve(np.vander((t[part] - t[top]) / unit), force[part])
    flat = np.roots(np.polyder(curve))
    flat = np.append(flat.real[(flat.imag == 0) & (np.abs(flat) < 1)], 0.0)
    heights = np.polyval(curve, flat)
    return Peak(float(t[top] + flat[heights.argmax()] * unit), float(heights.max()))


@checked
def largest_peak(
    t: ArrayLike | TimeSeries,
    force: ArrayLike | None = None,
    between: tuple[float, float] = (-math.inf, math.inf),
    *,
    noise: Annotated[float, ">= 0", "N"] | None = None,
) -> Peak[float]:
    """Instant and height of the largest force of a record, at a row or between two rows.

    Where the first large peak is the largest, the result is that of `first_peak`.  A pulse must
    extend over ten rows or more: the spline overshoots a step.

    Parameters
    ----------
    t, force : ndarray, (T,)
        [s], [N]; or a `TimeSeries` alone.
    between : (float, float)
        Interval of time that is searched [s]; a maximum at its end is that of the last row there,
        if the record has no noise.
    noise : float, optional
        Standard deviation of each row [N]; by default estimated, 0 if the rows are smooth.

    Returns
    -------
    instant, height : float
        [s], [N]; of a record with noise as by `peaks`, with the attributes `instant_error` and
        `height_error`.

    Raises
    ------
    TensegrityError
        No row in that time; an invalid record, as for `peaks`.

    Examples
    --------
    >>> import numpy as np
    >>> from tensegrity import largest_peak
    >>> t = np.linspace(0, 1, 101)
    >>> force = np.exp(-(((t - 0.303) / 0.05) ** 2)) + 0.5 * np.exp(-(((t - 0.702) / 0.05) ** 2))
    >>> [round(x, 4) for x in largest_peak(t, force)]
    [0.303, 1.0]
    """
    t, force, noise = _record(t, force, noise)
    inside = _within(t, between)
    if not inside.any():
        raise TensegrityError(f"no instant of the record lies between {between} s")
    if noise:
        found = fitted_peaks(t[inside], force[inside], noise, PEAK_FRACTION, DISTINCT)
        instant, height, *errors = found[:, found[1].argmax()]
        return Peak(float(instant), float(height), *map(float, errors), noise=noise)
    refuse_plateau(t[inside], force[inside], 0.0)
    t, force = _with_maxima(t, force)
    inside = _within(t, between)
    top = int(np.argmax(force[inside]))
    return Peak(float(t[inside][top]), float(force[inside][top]))


def _with_maxima(t: Array, force: Array) -> tuple[Array, Array]:
    """A record with the maxima between its rows, by a spline of degree 5, as further rows."""
    from scipy.interpolate import make_interp_spline

    spline = make_interp_spline(t, force, k=min(5, len(t) - 1))
    slope = spline.derivative()
    rate = slope(t)
    large = np.maximum(force[:-1], force[1:]) > NOISE * force.max(initial=0.0)
    rows = np.flatnonzero(large & (rate[:-1] > 0) & (rate[1:] < 0))
    instants = [root(slope, t[k], t[k + 1]) for k in rows.tolist()]
    return np.insert(t, rows + 1, instants), np.insert(force, rows + 1, spline(instants))


def _within(t: Array, between: tuple[float, float]) -> Flags:
    """Which instants lie in an interval, its ends included."""
    if not isinstance(between, (tuple, list)) or len(between) != 2:
        raise TensegrityError(f"between {check.shown(between)} must be two instants")
    first, last = (check.number("end of between", x, finite=False, unit="s") for x in between)
    return (t >= first) & (t <= last)


@checked
def sampled(
    t: ArrayLike | TimeSeries,
    force: ArrayLike | None = None,
    interval: Duration = CLOCK,
    phase: Annotated[float, ">= 0", "s"] = 0.0,
) -> tuple[Array, Array]:
    """A recorded force as an oscilloscope samples it.

    Parameters
    ----------
    t, force : ndarray, (T,)
        Recorded more often than every `interval`; or a `TimeSeries` alone.
    interval, phase : float
        Of the clock [s]: it reads at phase, phase + interval, ... after the first row; the phase
        is >= 0 and shorter than the record.

    Returns
    -------
    times, values : ndarray, (samples,)
        [s], [N].

    Raises
    ------
    TensegrityError
        The record is coarser than the clock, or invalid, as for `peaks`; a phase out of range.
    """
    from scipy.interpolate import CubicSpline

    t, force, _ = _record(t, force)
    if phase >= t[-1] - t[0]:
        raise TensegrityError(
            f"phase {phase:g} s must be below the length of the record, {t[-1] - t[0]:g} s"
        )
    if np.diff(t).max() > interval * (1 + ROUND_OFF):
        raise TensegrityError(
            f"rows at intervals of up to {np.diff(t).max():.3g} s, must be at most {interval:.3g} s"
        )
    times = np.arange(t[0] + phase, t[-1], interval)
    try:
        return times, CubicSpline(t, force)(times)
    except ValueError as error:
        raise TensegrityError(f"forces to {np.abs(force).max():g} N: {error}") from error


@checked
def peaks(
    t: ArrayLike | TimeSeries,
    force: ArrayLike | None = None,
    level: Fraction = LEVEL,
    *,
    noise: Annotated[float, ">= 0", "N"] | None = None,
) -> Peak[Array]:
    """Instants and heights of all peaks above a fraction of the largest.

    Two neighbouring peaks count as two if the force between them falls below three quarters of
    the lower one; otherwise only the higher one counts.

    Parameters
    ----------
    t, force : ndarray, (T,)
        [s], [N]; or a `TimeSeries` alone.
    level : float
        Fraction of the largest peak below which peaks are ignored, between 0 and 1.
    noise : float, optional
        Standard deviation of each row [N]; by default estimated, 0 if the rows are smooth.

    Returns
    -------
    instants, heights : ndarray, (peaks,)
        [s], [N]; located between the rows by a spline.  Rows with noise are fitted by polynomials,
        down to half the height of each peak: the attributes `instant_error` and `height_error` are
        standard deviations, and peaks below six of those of the smoothed record do not count.

    Raises
    ------
    TensegrityError
        A level not between 0 and 1; instants that do not increase, forces that are not finite, or
        arrays of different lengths; forces of reversed polarity; a peak that is clipped; with
        noise, no peak that stands out from it, or one of fewer than five rows.

    Notes
    -----
    Heights count from 0: subtract an offset, or a drift, of the record before.  The noise is taken
    to be independent from row to row and equal in all rows; it is estimated from the deviations
    of each row from the polynomial through its neighbours, at least 40 rows and no smooth signal
    with fewer than about five rows to a peak.  A record whose values are all multiples of one
    step, as those of a converter of up to 15 bits, has the noise of its rounding, step/sqrt(12).

    Examples
    --------
    >>> import numpy as np
    >>> from tensegrity import peaks
    >>> t = np.linspace(0, 1, 101)
    >>> force = np.exp(-(((t - 0.303) / 0.05) ** 2)) + 0.5 * np.exp(-(((t - 0.702) / 0.05) ** 2))
    >>> instants, heights = peaks(t, force)
    >>> print(instants.round(4), heights.round(4))
    [0.303 0.702] [1.  0.5]

    With noise of 1 % the errors of both are known:

    >>> noisy = force + 0.01 * np.random.default_rng(1).normal(size=101)
    >>> found = peaks(t, noisy, noise=0.01)
    >>> print(found.instant.round(3), found.instant_error.round(4))
    [0.303 0.702] [0.0004 0.0007]
    """
    from scipy.signal import find_peaks

    t, force, noise = _record(t, force, noise)
    if noise:
        instant, height, *errors = fitted_peaks(t, force, noise, level, DISTINCT)
        return Peak(instant, height, *errors, noise=noise)
    _refuse_no_peak(t, force)
    t, force = _with_maxima(t, force)
    top = force.max()
    padded = np.concatenate([[0.0], force, [0.0]])
    peaks, facts = find_peaks(padded, height=level * top, prominence=0)
    distinct = facts["prominences"] >= DISTINCT * facts["peak_heights"]
    return Peak(t[peaks[distinct] - 1], facts["peak_heights"][distinct])


def _refuse_no_peak(t: Array, force: Array) -> None:
    """Refuse a record without noise of reversed polarity, or whose largest peak is clipped."""
    if force.max() <= 0 and force.min() < 0:
        raise TensegrityError(
            f"no force is above 0, the last one is {force[-1]:g} N: give -force where the polarity "
            "is reversed"
        )
    refuse_plateau(t, force, 0.0)


def _record(
    t: ArrayLike | TimeSeries, force: ArrayLike | None, noise: float | None = 0.0
) -> tuple[Array, Array, float]:
    """Instants and forces as arrays (T,), T >= 2, once they are found to form a record, and the
    standard deviation of its rows: given, or estimated if it is None."""
    if not isinstance(t, TimeSeries):
        t, force = check.columns(t=t, force=force)  # type: ignore[arg-type]
        t = TimeSeries(t, force, noise=noise)
    elif force is not None:
        raise TensegrityError("force is given beside a time series, which has its values")
    return t.t, t.values, t.noise if noise is None else noise
