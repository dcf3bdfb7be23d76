"""Peaks of profiles; peaks of records with noise, by least squares, with their errors.

Model: each row of a record is a smooth signal plus independent noise of one standard deviation, or
a multiple of the quantum of a converter.  A row deviates from the polynomial through its neighbours
by its noise and that of these; the lower quartile of the deviations tells noise, which is
everywhere, from the corners of computed rows.  Peaks are sought in a record smoothed over half
their width (Savitzky and Golay); each is then fitted with a polynomial, of degree 6 down to half
its height where there are 12 rows, in the rows as they are.  Its covariance gives the errors of
instant and height.
"""

from __future__ import annotations

import math

import numpy as np

from tensegrity.errors import TensegrityError
from tensegrity.typing import Array

QUARTILE = 0.31863936396437514  # of |x| for a standard normal x
MEDIAN = 0.6744897501960817
SEVERAL = 40  # rows, of fewer of which noise cannot be estimated
NOISY = 1e-4  # of the largest value: noise below it is left to interpolation
STEADY = 0.5  # ratio of the estimates from 8 and from 4 neighbours, below which they see a signal
QUANTUM = 3e-5  # of the largest value: multiples of less are not those of a converter
PEAK_FRACTION = 0.5  # of the largest extremum, from which an extremum counts as the pulse
FLAT = 3  # equal rows at the top that are a plateau
SHARP = 8.0  # quanta or three deviations of the noise, by which a record falls beside a plateau
CERTAIN = 6.0  # standard deviations of the smoothed noise, from which a peak is one
FITS = ((6, 12, 0.5), (6, 12, 0.2), (4, 8, 0.4), (2, 5, 0.7))  # degree, rows, fraction of height
DISTINCT = 0.25  # of its height, by which a peak stands above what surrounds it
RIPPLE = 1e-6  # of a peak: an elongation that increases by less counts as decreasing


def peak_bonds(r: Array, fraction: float, least: float = 0.0) -> list[int]:
    """Bonds of the distinct peaks of |elongation| above a fraction of the largest.

    Parameters
    ----------
    r : ndarray, (bonds,)
        [m].
    fraction : float
        Of the largest |r|.
    least : float, optional
        Smallest |r| of a peak [m]; below it is round-off.

    Returns
    -------
    list of int
        Bonds, in ascending order.
    """
    from scipy.signal import find_peaks

    height = max(fraction * float(np.abs(r).max(initial=0.0)), least)
    if not height > 0:
        return []
    bonds = []
    for sign in (-1, 1):
        padded = np.concatenate([[0.0], np.maximum(sign * r, 0.0), [0.0]])
        places, facts = find_peaks(padded, height=height, prominence=0)
        distinct = facts["prominences"] >= DISTINCT * facts["peak_heights"]
        bonds += (places[distinct] - 1).tolist()
    return sorted(bonds)


def sites_around(r: Array, peak: int) -> tuple[int, int]:
    """First and last site of the pulse with a peak at a bond."""
    size = np.sign(r[peak]) * r
    ripple, ends = RIPPLE * size[peak], []
    for step in (-1, 1):
        bond = peak
        while 0 <= bond + step < len(r) and 0 < size[bond + step] <= size[bond] + ripple:
            bond += step
        ends.append(bond)
    low, high = ends
    return low + (low > 0), high + (high == len(r) - 1)


def noise_of(t: Array, force: Array) -> float:
    """Standard deviation of the noise of a record, 0 where its rows are smooth or too few.

    Parameters
    ----------
    t, force : ndarray, (T,)

    Returns
    -------
    float
        In the unit of the record.
    """
    size = float(np.abs(force).max())
    quantum = quantum_of(force)
    if len(t) < SEVERAL or size == 0:
        return 0.0
    few, many = (_deviations(t, force, count) for count in (2, 4))
    noise = float(np.median(many)) / MEDIAN
    steady = np.quantile(many, 0.25) >= STEADY * np.quantile(few, 0.25)
    everywhere = np.quantile(many, 0.25) / QUARTILE
    if not (steady and everywhere > NOISY * size):
        noise = 0.0
    return max(noise, quantum / math.sqrt(12))


def quantum_of(force: Array) -> float:
    """The step of which all differences in a record are multiples; 0 if finer than 15 bits."""
    gaps = np.diff(np.unique(force))
    if not len(gaps) or gaps.min() <= QUANTUM * np.abs(force).max():
        return 0.0
    multiples = gaps / gaps.min()
    whole = np.abs(multiples - multiples.round()).max() < 0.01
    return float(gaps.min()) if whole and len(gaps) < len(force) / 2 else 0.0


def _deviations(t: Array, force: Array, count: int) -> Array:
    """Size of the deviation of each row from the polynomial through `count` rows on either side,
    over that of independent noise of deviation 1."""
    rows = np.arange(count, len(t) - count)
    offsets = [k for k in range(-count, count + 1) if k]
    near = np.stack([t[rows + k] for k in offsets])
    weights = np.ones_like(near)
    for j in range(len(offsets)):
        for i in range(len(offsets)):
            if i != j:
                weights[j] *= (t[rows] - near[i]) / (near[j] - near[i])
    through = sum(w * force[rows + k] for w, k in zip(weights, offsets, strict=True))
    return np.abs(force[rows] - through) / np.sqrt(1 + (weights**2).sum(axis=0))


def refuse_plateau(t: Array, force: Array, noise: float) -> None:
    """Refuse a record whose largest value is that of an amplifier or converter at its limit.

    A rounded top that is flat to one quantum falls by about three within half its length.

    Parameters
    ----------
    t, force : ndarray, (T,)
    noise : float
        Standard deviation of each row.

    Raises
    ------
    TensegrityError
    """
    top = np.concatenate([[False], force == force.max(), [False]])
    starts, ends = (np.flatnonzero(np.diff(top.astype(int)) == s) for s in (1, -1))
    for first, end in zip(starts.tolist(), ends.tolist(), strict=True):
        half = (end - first + 1) // 2
        if end - first < FLAT or first < half or end + half > len(t):
            continue
        fall = force[first] - max(force[first - half], force[end + half - 1])
        if fall > SHARP * max(quantum_of(force), 3 * noise):
            raise TensegrityError(
                f"the force is clipped: {end - first} rows from {t[first]:g} to {t[end - 1]:g} s "
                f"have its largest value, {force[first]:g} N"
            )


def fitted_peaks(t: Array, force: Array, noise: float, level: float, distinct: float) -> Array:
    """Peaks of a record with noise.

    Parameters
    ----------
    t, force : ndarray, (T,)
    noise : float
        Standard deviation of each row, > 0.
    level : float
        Fraction of the largest peak from which others count.
    distinct : float
        Fraction of its height by which a peak stands above what is around it.

    Returns
    -------
    ndarray, (4, peaks)
        Instants, heights and the standard deviations of both, in the order of time.

    Raises
    ------
    TensegrityError
        No peak stands out from the noise; the largest is negative, clipped, or has too few rows.
    """
    from scipy.signal import find_peaks, savgol_coeffs, savgol_filter

    if -force.min() > force.max() + 2 * CERTAIN * noise:
        raise TensegrityError(
            f"the largest force, {force.min():g} N at {t[force.argmin()]:g} s, is negative: give "
            "-force where the polarity is reversed"
        )
    refuse_plateau(t, force, noise)
    window = min(max(5, _width(force, noise) // 2 | 1), (len(t) - 1) | 1)
    window -= 2 * (window > len(t))
    smooth = savgol_filter(force, window, 3, mode="interp")
    left = noise * float(np.linalg.norm(savgol_coeffs(window, 3)))
    padded = np.concatenate([[0.0], smooth, [0.0]])
    least = max(level * smooth.max(), CERTAIN * left)
    tops, facts = find_peaks(padded, height=least, prominence=CERTAIN * left)
    tops = tops[facts["prominences"] >= distinct * facts["peak_heights"]] - 1
    if not len(tops):
        raise TensegrityError(
            f"no peak of the force, at most {force.max():g} N, stands out from its noise of "
            f"{noise:.3g} N"
        )
    found = [_fitted(t, force, smooth, tops, k, noise) for k in range(len(tops))]
    found = [one for one in found if one]
    if not found:
        raise TensegrityError(
            f"the force, at most {force.max():g} N, has no peak but at the ends of the record, in "
            f"its noise of {noise:.3g} N"
        )
    return np.array(found).T


def _width(force: Array, noise: float) -> int:
    """Rows of the largest peak above half its height."""
    top = int(force.argmax())
    low = np.flatnonzero(force < (force[top] - 2 * noise) / 2)
    before, after = low[low < top], low[low > top]
    return int((after[0] if len(after) else len(force)) - (before[-1] if len(before) else -1) - 1)


def _around(smooth: Array, tops: Array, number: int, fraction: float) -> slice:
    """Rows around a peak: above a fraction of its height, and not beyond the next valleys."""
    top, count = int(tops[number]), len(smooth)
    low = int(tops[number - 1]) if number else 0
    high = int(tops[number + 1]) if number + 1 < len(tops) else count - 1
    first = low + int(smooth[low : top + 1].argmin()) if number else 0
    last = top + int(smooth[top : high + 1].argmin()) if high < count - 1 else high
    below = np.flatnonzero(smooth < fraction * smooth[top])
    before, after = below[below < top], below[below > top]
    first = max([first, *before[-1:].tolist()])
    return slice(first, min([last, *after[:1].tolist()]) + 1)


def _fitted(
    t: Array, force: Array, smooth: Array, tops: Array, number: int, noise: float
) -> tuple[float, float, float, float] | None:
    """Instant, height and their errors of one peak; None where it has no maximum inside."""
    tried = [(degree, needed, _around(smooth, tops, number, part)) for degree, needed, part in FITS]
    degree, rows = next(
        ((degree, rows) for degree, needed, rows in tried if rows.stop - rows.start >= needed),
        (0, tried[0][-1]),
    )
    if not degree:
        raise TensegrityError(
            f"{rows.stop - rows.start} rows of the peak at {t[tops[number]]:g} s are above half "
            f"its height: too few in noise of {noise:.3g} N"
        )
    t, force = t[rows], force[rows]
    middle, half = (t[-1] + t[0]) / 2, (t[-1] - t[0]) / 2
    inverse = np.linalg.pinv(np.polynomial.legendre.legvander((t - middle) / half, degree))
    curve = np.polynomial.Legendre(inverse @ force)
    flat = curve.deriv().roots()
    flat = flat.real[(np.abs(flat.imag) < 1e-9) & (np.abs(flat.real) < 1)]
    flat = flat[curve.deriv(2)(flat) < 0]
    if not len(flat):
        return None
    at = float(flat[curve(flat).argmax()])
    terms = [np.polynomial.Legendre.basis(k) for k in range(degree + 1)]
    height, slope = (
        noise * float(np.linalg.norm([term.deriv(order)(at) for term in terms] @ inverse))
        for order in (0, 1)
    )
    bend = -float(curve.deriv(2)(at))
    return float(middle + half * at), float(curve(at)), half * slope / bend, height
