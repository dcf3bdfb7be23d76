"""Likelihood of parameters: covariances, and confidence intervals by profile likelihood.

A `Misfit` has residuals over the largest measured value, with derivatives, as a function of
unknowns: changes of the logarithms of parameters, or of other parameters in units of their own.  An
interval by profile likelihood ends where the misfit, minimised over all other unknowns, has grown
to the bound set by a quantile.  Source: Bates & Watts, Nonlinear Regression Analysis and Its
Applications, 1988, chapter 6.
"""

from __future__ import annotations

import math
from typing import Any, Protocol

import numpy as np

from tensegrity.errors import EquilibriumError
from tensegrity.typing import Array

FARTHEST = 60.0  # largest change of a logarithm; half of it amounts to 0 or infinity
UNDEFINED = 1e3  # misfit, over the largest value, where the model has none
RESOLVED = 1e-12  # smallest resolved noise over the largest value
STEPS = 200  # largest number of steps to the end of an interval; usually three to five
MOVES = 1000  # largest number of iterations to the least misfit
ENDED = 1e-4  # relative tolerance of the end of an interval
FAINT = 0.05  # change by a factor e in a parameter, over the noise, that is noticeable
FINEST = 1e-5  # smallest resolved relative change of the residuals
STUCK = 1e-6  # fraction of the required decrease below which damped steps have failed
BORDER = 0.1  # distance of a fit from the minimum, over the noise, that is accepted


class Misfit(Protocol):
    """Residuals of a model; `model` names, in messages, those for which there are any."""

    names: tuple[str, ...]
    size: float  # the largest measured value
    model: str

    def __call__(self, z: Array) -> tuple[Array, Array]:
        """Residuals over `size`, (points,), all `UNDEFINED` where the model has none; (points,
        unknowns)."""

    def around(self, z: Array) -> Misfit:
        """The same misfit, with unknowns that count from z."""

    def value(self, k: int, z: float) -> float:
        """The parameter whose unknown, number k, is z."""


def covariance(slopes: Array) -> tuple[Array, Array, float]:
    """Uncertainty of unknowns by derivatives of the residuals.

    Parameters
    ----------
    slopes : ndarray, (points, unknowns)

    Returns
    -------
    covariance, correlation : ndarray, (unknowns, unknowns)
        For residuals of standard deviation 1.
    condition : float
        Of the derivatives.
    """
    _, sizes, right = np.linalg.svd(slopes, full_matrices=False)
    large = np.maximum(sizes, 1e-14 * sizes[0])
    one = (right.T / large**2) @ right
    alone = np.sqrt(np.diag(one))
    return one, one / np.outer(alone, alone), float(sizes[0] / large[-1])


def quantile(level: float, degrees: float) -> float:
    """Standard errors to either side of an estimate at a confidence level, by Student's
    distribution with `degrees` degrees of freedom, or the normal one if they are infinite."""
    from scipy.special import ndtri, stdtrit

    tail = (1 - level) / 2
    return -float(ndtri(tail) if math.isinf(degrees) else stdtrit(degrees, tail))


def intervals(at: Misfit, noise: float, quantile: float) -> dict[str, tuple[float, float]]:
    """Confidence intervals by profile likelihood; see `tensegrity.prisms.fit.Fit.intervals`.

    Parameters
    ----------
    at : Misfit
        Of unknowns that are 0 at the fit.
    noise : float
        Standard deviation of the measured values.
    quantile : float
        Half-width of an interval in standard errors.

    Returns
    -------
    dict of str to (float, float)

    Raises
    ------
    EquilibriumError
        If the fit is not a minimum of the misfit, or an end is not found.
    """
    noise = max(noise / at.size, RESOLVED)
    r, slopes = at(np.zeros(len(at.names)))
    move = _step(slopes, slice(None), r)
    better = r + slopes @ move / max(1.0, np.abs(move).max())
    if r @ r - better @ better > (BORDER * noise) ** 2:
        raise EquilibriumError(
            f"the fit lies at the border of {at.model}, where the residuals are not least: no "
            "intervals"
        )
    width = max(quantile * noise, FINEST * float(np.linalg.norm(r)))
    at = at.around(_kept_sensitive(at, FAINT * noise))
    ends = {}
    for k, name in enumerate(at.names):
        low, high = (at.value(k, _interval_end(at, k, side, width)) for side in (-1, 1))
        ends[name] = low, high
    return ends


def _kept_sensitive(at: Misfit, change: float) -> Array:
    """Unknowns of nearly least misfit, none so extreme that the misfit is insensitive to it."""
    z = np.zeros(len(at.names))
    r, slopes = at(z)
    for move in (*np.eye(len(z)), *-np.eye(len(z))):
        while (felt := np.linalg.norm(slopes @ move)) < change:
            new, there = at(z + move)
            if np.linalg.norm(there @ move) <= felt or new @ new > r @ r + change**2:
                break
            z, slopes = z + move, there
    return z


def _interval_end(at: Misfit, k: int, side: int, width: float) -> float:
    """Value of one unknown at which the profile misfit exceeds the least one by width^2.

    Bracketed Newton's method on the square root of the excess, which is almost linear in it.
    """
    inside, low, high = np.zeros(len(at.names)), 0.0, math.inf
    r, slopes = at(inside)
    least, others, held = r @ r, np.arange(len(inside)) != k, -math.inf
    along = _step(slopes, others, slopes[:, k])  # change of the others, were the model linear
    alone = slopes[:, k] + slopes @ along
    new = first = min(width / max(float(np.linalg.norm(alone)), width), 1.0)
    for _ in range(STEPS):
        z = inside + np.clip(along * (side * new - inside[k]), -1.0, 1.0)
        z[k] = side * new
        z, r, slopes = _least_misfit(at, others, z, ENDED * width**2)
        left = math.inf if r[0] == UNDEFINED else math.sqrt(max(float(r @ r - least), 0.0))
        if abs(left - width) <= ENDED * width:
            return float(z[k])
        if left > width:
            high = new
        elif new > FARTHEST / 2:
            return side * math.inf
        else:
            inside, low = z, new
            along = _step(slopes, others, slopes[:, k])
        small = ENDED * max(low, first)
        if high - low <= small:
            if low - held <= 50 * small:
                return side * low
            held, high, new = (
                low,
                math.inf,
                low + 100 * small,
            )  # the minimisation beyond may have left the valley
            continue
        rate = side * float(slopes[:, k] @ r)  # derivative of half of the squared excess
        aim = min(new + (width - left) * left / rate if rate > 0 else math.inf, low + 1.0)
        new = aim if low < aim < high else (low + min(high, low + 2.0)) / 2
    raise EquilibriumError(f"no end of the interval of {at.names[k]} found in {STEPS} steps")


def _least_misfit(at: Misfit, free: Any, z: Array, gain: float) -> tuple[Array, Array, Array]:
    """Minimum of the misfit in some unknowns, to `gain` of its square, with misfit and derivatives.

    Levenberg's method with changes of at most 1.  A damped step without decrease may only be too
    short: the iteration ends when an undamped one predicts none either, or no damping helps.
    """
    (r, slopes), least = at(z), 0.1 * math.sqrt(gain)
    damping = least
    for _ in range(MOVES):
        whole, move = (_step(slopes, free, r, part) for part in (least, damping))
        whole /= max(1.0, np.abs(whole).max())
        gains = [r @ r - np.sum((r + slopes @ step) ** 2) for step in (whole, move)]
        if gains[0] <= gain or gains[1] <= STUCK * gain:
            break
        new, there = at(z + move) if np.abs(move).max() <= 1.0 else (r, slopes)
        if new @ new < r @ r:
            z, r, slopes, damping = z + move, new, there, max(damping / 3, least)
        else:
            damping *= 2  # larger factors make steps along curved valleys too short
    return z, r, slopes


def _step(slopes: Array, free: Any, r: Array, damping: float = 0.0) -> Array:
    """Step of the linearised least-squares problem in some unknowns, with damping."""
    move = np.zeros(slopes.shape[1])
    some = slopes[:, free]
    rows = np.vstack([some, damping * np.eye(some.shape[1])])
    wanted = np.concatenate([-r, np.zeros(some.shape[1])])
    move[free] = np.linalg.lstsq(rows, wanted, rcond=1e-9)[0]
    return move
