"""What is read off a run: arrivals, speed and width of the leading pulse."""

from __future__ import annotations

import numpy as np

from tensegrity import check
from tensegrity.errors import TensegrityError

CREST = 0.5  # an extremum counts as the pulse if it is this part of the largest
NEIGHBOURS = 4  # recorded instants on either side that locate a crest


def passage(t, elongation, rate):
    """Instant at which the first large extremum of an elongation passes.

    Parameters
    ----------
    t, elongation, rate : ndarray, (T,)
        Recorded instants [s], elongation of one bond [m] and its time derivative [m/s].

    Returns
    -------
    float
        The root of the rate [s], by a spline through the instants around it: the error is of
        fourth order in the recording interval.
    """
    from scipy.interpolate import CubicSpline

    size = np.abs(elongation)
    large = size >= CREST * size.max()
    turns = (rate[:-1] * rate[1:] <= 0) & (large[:-1] | large[1:]) & (size.max() > 0)
    if not turns.any():
        raise TensegrityError("no crest passes this bond within the run")
    first = int(np.argmax(turns))
    part = slice(max(first - NEIGHBOURS, 0), first + NEIGHBOURS + 2)
    roots = CubicSpline(t[part], rate[part]).roots(extrapolate=False)
    middle = (t[first] + t[first + 1]) / 2
    return float(roots[np.argmin(np.abs(roots - middle))])


def arrival(run, bond):
    """Instant [s] at which the crest of the leading pulse passes a bond.

    Parameters
    ----------
    run : Run
        With both sites of the bond recorded often enough to resolve the pulse.
    bond : int
        Bond j joins sites j and j + 1.
    """
    bond = check.whole("bond", bond, least=0)
    try:
        left, right = run.sites.index(bond), run.sites.index(bond + 1)
    except ValueError:
        raise TensegrityError(f"sites {bond} and {bond + 1} of bond {bond} not recorded") from None
    return passage(run.t, run.u[:, right] - run.u[:, left], run.v[:, right] - run.v[:, left])


def speed(run, bonds):
    """Speed of the leading pulse between two bonds of a run, in sites per second."""
    first, second = bonds
    return (second - first) / (arrival(run, second) - arrival(run, first))


def crest(elongation):
    """Place of the foremost large extremum along a chain, in bonds, and its elongation.

    Parameters
    ----------
    elongation : ndarray, (bonds,)
        At one instant [m].  The parabola through the extremum and its neighbours refines both.
    """
    r = np.asarray(elongation, dtype=float)
    size = np.abs(r)
    inner = size[1:-1]
    peaks = 1 + np.flatnonzero(
        (inner >= size[:-2]) & (inner > size[2:]) & (inner >= CREST * size.max())
    )
    if peaks.size == 0:
        raise TensegrityError("no crest within the chain")
    j = int(peaks[-1])
    bend = r[j - 1] - 2 * r[j] + r[j + 1]
    shift = (r[j - 1] - r[j + 1]) / (2 * bend)
    return j + shift, r[j] - bend * shift**2 / 2


def width(x, profile, level=0.05):
    """Distance between the outermost points around the crest where a profile has fallen to a level.

    Parameters
    ----------
    x, profile : ndarray, (n,)
        Place, increasing, and value.
    level : float
        Part of the extreme value, between 0 and 1.
    """
    level = check.number("level", level, above=0)
    if level >= 1:
        raise TensegrityError(f"level {level:g} must be below 1")
    size = np.abs(np.asarray(profile, dtype=float))
    top = int(np.argmax(size))
    left = np.flatnonzero(size[: top + 1] < level * size[top])
    right = top + np.flatnonzero(size[top:] < level * size[top])
    if left.size == 0 or right.size == 0:
        raise TensegrityError(f"the profile does not fall to {level:g} of its crest on both sides")

    def crossing(low, high):
        share = (level * size[top] - size[low]) / (size[high] - size[low])
        return x[low] + share * (x[high] - x[low])

    return float(crossing(right[0], right[0] - 1) - crossing(left[-1], left[-1] + 1))
