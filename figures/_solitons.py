"""A strict detector of solitary waves.

A pulse counts as solitary where

* the exact wave of its peak exists, and elongations and velocities over the width of that wave
  (where it is above 5 % of its peak) differ from it by at most `MISFIT` of their largest;
* its peak is ahead of the acoustic front;
* it carries at least `LEAST` of the incident energy.

The velocities determine speed and direction.
"""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np

from tensegrity import TensegrityError

MISFIT = 0.05  # of the peak
LEAST = 1e-4  # of the incident energy, that a pulse carries
LEVEL = 0.05  # of a peak, between which a wave has its width
ROUNDS, SAME = 4, 1e-3  # in which peak and place of a pulse are found, and when they are


class Found(NamedTuple):
    """A pulse and the exact wave of its peak.

    Attributes
    ----------
    place : float
        Of the peak, in bonds from the interface.
    peak : float
        [m].
    misfit : float
        Of elongations and velocities, the larger one; inf where there is no exact wave.
    ahead : float
        Sites ahead of the acoustic front.
    ratio, width, energy, momentum : float
        Of the exact wave: speed over sound, sites at 5 %, [J], and of its motion [kg m/s].
    """

    place: float
    peak: float
    misfit: float
    ahead: float
    ratio: float = math.nan
    width: float = math.nan
    energy: float = 0.0
    momentum: float = 0.0

    def is_solitary(self, incident):
        """By the definition of the module; `incident` is an energy [J]."""
        return self.misfit <= MISFIT and self.ahead > 0 and self.energy >= LEAST * incident


def peaks(r, sign, least, limit):
    """Bonds with the `limit` largest maxima of sign * r above `least`, the largest first."""
    size = sign * r
    inner = size[1:-1]
    is_peak = (inner >= size[:-2]) & (inner > size[2:]) & (inner >= least)
    found = np.flatnonzero(is_peak) + 1
    return found[np.argsort(-size[found], kind="stable")[:limit]]


def matched(r, v, bond, exact):
    """The exact wave towards higher sites that is closest to a pulse.

    Parameters
    ----------
    r : ndarray, (bonds,)
    v : ndarray, (bonds + 1,)
    bond : int
        Of its peak.
    exact : callable
        exact(peak) is the exact wave of a peak [m].

    Returns
    -------
    wave : SolitaryWave
        Of the peak found.
    place : float
        [bonds].
    misfit : float

    Raises
    ------
    TensegrityError
        If there is no wave of that peak.
    """
    peak, place = _top(r, bond)
    for _ in range(ROUNDS):
        wave = exact(peak)
        place, factor = _placed(r, wave, place, bond)
        if abs(factor - 1) < SAME:
            break
        peak *= factor
    return wave, place, misfit(r, v, wave, place)


def _top(r, bond):
    """Peak and place by the parabola through three bonds."""
    left, top, right = r[bond - 1 : bond + 2]
    shift = (left - right) / (2 * (left - 2 * top + right))
    return float(top - (left - right) * shift / 4), bond + float(shift)


def _placed(r, wave, place, bond):
    """Place of the peak and factor of the wave's amplitude, by least squares over its width."""
    from scipy.optimize import least_squares

    half = wave.width(LEVEL) / 2
    low, high = max(math.ceil(place - half), 0), min(math.floor(place + half), len(r) - 1)
    x = np.arange(low, high + 1)

    def gap(unknown):
        return (unknown[1] * wave.elongation(x - unknown[0]) - r[x]) / wave.amplitude

    bounds = [bond - 1, 0.5], [bond + 1, 2.0]
    guess = np.clip([place, 1.0], *bounds)
    return least_squares(gap, guess, bounds=bounds, xtol=1e-10, ftol=1e-10, gtol=1e-10).x


def misfit(r, v, wave, place):
    """Largest difference from a wave, over its width, over its largest values; inf at an edge."""
    half = wave.width(LEVEL) / 2
    bonds = np.arange(math.ceil(place - half), math.floor(place + half) + 1)
    if bonds[0] < 0 or bonds[-1] >= len(r):
        return math.inf
    sites = np.append(bonds, bonds[-1] + 1)  # site j is half a site before bond j
    exact = -wave.speed * wave.rate(sites - place - 0.5)
    fastest = wave.speed * abs(float(wave.rate(0.0)))
    return float(
        max(
            np.abs(r[bonds] - wave.elongation(bonds - place)).max() / abs(wave.amplitude),
            np.abs(v[sites] - exact).max() / fastest,
        )
    )


def pulses(r, v, sign, exact, front, least, limit=4):
    """Pulses of one sign that move towards higher bonds, ahead of a place.

    Parameters
    ----------
    r, v : ndarray, (bonds,), (bonds + 1,)
        Of a part that begins at the interface.
    sign : int
        1 rarefaction, -1 compression.
    exact : callable
        exact(peak) is the exact wave of a peak [m].
    front : float
        [bonds].
    least : float
        Elongation from which a peak counts [m], > 0.
    limit : int, optional
        Largest number of pulses, the largest ones.

    Returns
    -------
    list of Found
        The largest first.
    """
    found = []
    begin = max(math.floor(front), 0)
    for bond in peaks(r[begin:], sign, least, limit) + begin:
        try:
            wave, place, gap = matched(r, v, int(bond), exact)
        except TensegrityError:
            found.append(Found(float(bond), float(r[bond]), math.inf, bond - front))
            continue
        exactly = wave.speed_ratio, wave.width(LEVEL), wave.energy, wave.momentum
        found.append(Found(place, wave.amplitude, gap, place - front, *exactly))
    return found
