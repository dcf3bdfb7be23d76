"""Fits of a prism to a measured curve of load against shortening, with confidence intervals.

The model is the equilibrium path of the elastic prism at a shortening with an unknown offset; the
errors of the loads are independent, with one standard deviation.  SciPy minimises the squared
residuals over the logarithms of the parameters, with the exact derivatives of
`tensegrity.prisms.curve`.  Standard errors follow from the Jacobian at the solution (Gauss-Newton
covariance), intervals from the profile likelihood.  Sources:
the talk, part III, "Experimental validation of the constitutive response"; Bates & Watts,
Nonlinear Regression Analysis and Its Applications, 1988, chapter 6.
"""

from __future__ import annotations

import math
from dataclasses import dataclass, replace
from typing import TYPE_CHECKING, Annotated

import numpy as np

from tensegrity import check, plotting
from tensegrity.checked import checked
from tensegrity.errors import EquilibriumError, TensegrityError
from tensegrity.likelihood import RESOLVED, UNDEFINED, covariance, intervals, quantile
from tensegrity.printing import Lines, Printed
from tensegrity.prisms.curve import NAMES, Misfit, traced_loads
from tensegrity.prisms.measured import read_curve
from tensegrity.prisms.prism import Prism
from tensegrity.typing import Fraction, Sampled
from tensegrity.unit_names import in_units

if TYPE_CHECKING:
    from collections.abc import Sequence
    from os import PathLike
    from typing import Any

    from matplotlib.axes import Axes
    from numpy.typing import ArrayLike

    from tensegrity.typing import Array

LARGE = 0.3  # relative standard error above which a parameter counts as not identified
SAME = 1e-9  # of the largest load: tolerance between the two computations of the loads
POOR = 0.5  # residual over total sum of squares above which a fit has failed
CLEAR = 5.0  # standard deviations by which the points fit better with both signs reversed
FOREIGN = 10  # ratio to the loads of the given prism that suggests another unit
EXPLAINED = 3.0  # residual over given noise that noise may explain
CONTRADICTED = 1e4  # residual over given noise above which the noise is refused


@dataclass(frozen=True, repr=False)
class Fit(Printed):
    """A prism fitted to a measured curve, with its uncertainty.

    Attributes
    ----------
    prism : Prism
        The prism with the estimated parameters.
    names : tuple of str
        Names of the free parameters, and "offset" last if it is free.
    values, errors : dict of str to float
        Estimates and standard errors, in the units of the parameters; offset in m.
    correlation : ndarray, (parameters, parameters)
        Correlation matrix of the estimates.
    condition : float
        Condition number of the Jacobian with respect to relative changes of the parameters.
    offset : float
        Shortening of the prism at the zero of the measured shortening [m].
    residuals : ndarray, (points,)
        Measured minus computed load [N].
    noise : float
        Standard deviation of the loads [N], given or estimated from the residuals.
    degrees : float
        Degrees of freedom of the noise: points minus parameters, or inf if the noise is given.
    unidentified : tuple of str
        For each parameter that the curve does not determine, the reason in words.
    """

    prism: Prism
    names: tuple[str, ...]
    values: dict[str, float]
    errors: dict[str, float]
    correlation: Array
    condition: float
    offset: float
    residuals: Array
    noise: float
    degrees: float
    unidentified: tuple[str, ...]
    shortening: Array
    load: Array
    covariance: Array
    jacobian: Array

    def computed(self) -> Array:
        """Loads of the fitted prism at the measured points [N], (points,)."""
        return self.load - self.residuals

    def band(self) -> Array:
        """Standard error of the computed loads [N], (points,)."""
        inside = np.einsum("ij,jk,ik->i", self.jacobian, self.covariance, self.jacobian)
        return np.asarray(np.sqrt(np.maximum(inside, 0.0)))

    @checked
    def intervals(self, level: Fraction = 0.95) -> dict[str, tuple[float, float]]:
        """Confidence intervals of the parameters by profile likelihood.

        An interval holds the values of one parameter at which the sum of squared residuals,
        minimised over all other parameters, exceeds its overall minimum by at most (t noise)^2.
        Here t is the quantile of Student's distribution with `degrees` degrees of freedom, which
        is the normal distribution if the noise is given.

        Parameters
        ----------
        level : float, optional
            Confidence level, above 0 and below 1.

        Returns
        -------
        dict of str to (float, float)
            For each of `names` the lower and upper end of the interval, in the units of the
            parameter.  Where the curve sets no bound the end is 0 or inf, for the offset -inf or
            inf.  An interval also ends where no prism has equilibria at all points.

        Raises
        ------
        TensegrityError
            If the level is outside its bounds.
        EquilibriumError
            If the fit lies at the border of the prisms with equilibria at all points, where the
            residuals are not minimal; or if an end was not found.
        """
        fitted = self.prism, self.shortening + self.offset, self.load, self.names, self.offset
        return intervals(Misfit(*fitted), self.noise, quantile(level, self.degrees))

    def _lines(self) -> Lines:
        yield f"{self.prism}"
        for name in self.names:
            yield f"  {name} = {self.values[name]:.6g} +- {self.errors[name]:.2g}"
        size = np.sqrt(np.mean(self.residuals**2))
        runs, expected = _sign_runs(self.residuals)
        yield (
            f"  residuals {size:.3g} N for a noise of {self.noise:.3g} N; {runs} runs of one sign, "
            f"{expected:.0f} expected; condition {self.condition:.3g}"
        )
        yield (
            f"  {len(self.load)} points, shortening {self.shortening.min():.6g} to "
            f"{self.shortening.max():.6g} m, load {self.load.min():.6g} to {self.load.max():.6g} N"
        )
        yield from (f"  not identified: {word}" for word in self.unidentified)

    def plot(self, ax: Axes | None = None) -> Axes:
        """Draw points, fitted curve and its 95 % band; returns the Matplotlib axes."""
        drawn: Axes = plotting.axes(ax)
        order = np.argsort(self.shortening)
        x, y = self.shortening[order], self.computed()[order]
        w = quantile(0.95, self.degrees) * self.band()[order]
        drawn.plot(self.shortening, self.load, "o", ms=3, color="0.4", label="points")
        drawn.plot(x, y, "-", color="C0", label="fitted prism")
        drawn.fill_between(x, y - w, y + w, color="C0", alpha=0.25, label="95 % band")
        words = "shortening [m]", "axial load [N], compression > 0"
        drawn.set(xlabel=in_units(words[0]), ylabel=in_units(words[1]))
        drawn.legend(frameon=False)
        return drawn


@checked
def fit(
    shortening: ArrayLike | str | PathLike[str],
    load: ArrayLike | None,
    prism: Prism,
    free: Sequence[str] = ("prestrain", "k_base"),
    offset: bool = True,
    noise: Annotated[float, "> 0", "<= 1e100", "N"] | None = None,
) -> Fit:
    """Fit a prism to a measured curve of load against shortening by least squares.

    Parameters
    ----------
    shortening : array_like (points,), TimeSeries or path
        Measured shortening [m], compression > 0; or a file of shortening [m] and load [N], which
        `read_curve` reads.
    load : array_like (points,) or TimeSeries, or None with a file
        Measured axial load [N], compression > 0.
    prism : Prism
        Initial guess, with elastic bases or bars; parameters that are not free keep its values.
    free : sequence of str, optional
        Parameters to estimate, out of "prestrain", "k_cross", "k_base", "k_bar".
    offset : bool, optional
        Whether the zero of the measured shortening is to be estimated too.
    noise : float, optional
        Standard deviation of the loads [N]; by default it is estimated from the residuals.

    Returns
    -------
    Fit

    Raises
    ------
    TensegrityError
        If there are fewer points than unknowns, or points beyond contact of this prism; if the
        noise is below 1e-12 of the largest load, or the residuals exceed 10,000 times the noise.
    EquilibriumError
        If no prism near the given one has equilibria at all points.  Also if the loads have the
        opposite sign, or a tenth or ten times the size, of those of the given prism, and even the
        best fit leaves more than half of their sum of squares and 3 times a given noise: they are
        then most probably in another sign convention or unit.  Also if most points are of extension
        and a prism fits them clearly better, by 5 standard deviations, with both signs
        reversed.

    Examples
    --------
    >>> import numpy as np
    >>> from tensegrity import Prism, fit
    >>> made = Prism(1.0, 0.7, 0.1, 1.0, k_base=20.0, k_bar=20.0)
    >>> shortening = np.linspace(0.0, 0.3, 31)
    >>> load = -made.potential().tension(-shortening)
    >>> guess = Prism(1.0, 0.7, 0.05, 1.0, k_base=10.0, k_bar=20.0)
    >>> found = fit(shortening, load, guess, noise=1e-3)
    >>> {name: round(found.values[name], 4) for name in ("prestrain", "k_base")}
    {'prestrain': 0.1, 'k_base': 20.0}
    >>> [round(end, 4) for end in found.intervals()["prestrain"]]
    [0.0972, 0.1029]
    """
    x, y = _read_points(shortening, load)
    if prism.is_rigid:
        raise TensegrityError("k_base inf and k_bar inf: the prism must have elastic members")
    free = _checked_names(free, prism)
    names = (*free, "offset") if offset else free
    count = len(names)
    if len(x) < count + (noise is None):
        raise TensegrityError(
            f"{len(x)} points are fewer than {count + (noise is None)}: {count} unknowns"
            + (" and the noise" if noise is None else "")
        )
    if np.ptp(x) <= 0:
        raise TensegrityError("all points have one shortening: no curve")
    if not y.any():
        raise TensegrityError("all loads are 0 N: no curve")
    at = Misfit(prism, x, y, names)
    z = _least_squares(at, noise)
    misfit, slopes = at(z)
    _refuse_reversed(at, misfit, noise)
    degrees = len(x) - count if noise is None else math.inf
    spread = noise or at.size * float(np.sqrt(misfit @ misfit / degrees))
    one, correlation, condition = covariance(slopes)  # for a noise of the largest load
    alone, part = np.sqrt(np.diag(one)), spread / at.size
    best, shift = at.curve.prism_at(at.theta(z)), float(at.theta(z)[-1])
    values = {n: float(getattr(best, n)) for n in free}
    errors = {n: float(values[n] * part * d) for n, d in zip(free, alone, strict=False)}
    if offset:
        values["offset"], errors["offset"] = shift, float(part * alone[-1] * at.weights[-1])
    return Fit(
        best, names, values, errors, correlation, condition,
        shift, -misfit * at.size, spread, degrees,
        _unidentified(best, free, part * alone, x + shift, spread), x, y, part**2 * one,
        slopes * at.size,
    )  # fmt: skip


def _least_squares(at: Misfit, noise: float | None) -> Array:
    """The unknowns of least misfit; an error where that is no acceptable fit."""
    from scipy.optimize import least_squares

    z = np.zeros(len(at.places))
    words = _sign_or_unit_hint(at.curve(at.theta(z))[0], at.x, at.y)
    if np.abs(at(z)[0]).max() >= UNDEFINED:
        raise EquilibriumError(f"no prism near the given one has this curve{words}")
    z = least_squares(
        lambda z: at(z)[0], z, lambda z: at(z)[1], method="lm", xtol=1e-12, ftol=1e-12
    ).x
    misfit, theta = at(z)[0], at.theta(z)
    try:
        traced = traced_loads(at.curve.prism_at(theta), at.x + theta[-1])
        same = np.abs((traced - at.y) / at.size - misfit).max() <= SAME
    except TensegrityError:
        same = False
    if not same:
        raise EquilibriumError(
            f"no prism near the given one has equilibria at all these points{words}"
        )
    left = at.size * float(np.sqrt(np.mean(misfit**2)))
    poor = misfit @ misfit > POOR * np.sum((at.y / at.size) ** 2)
    if words and poor and not (noise and left <= EXPLAINED * noise):
        raise EquilibriumError(f"no prism near the given one has this curve{words}")
    least = max(left / CONTRADICTED, RESOLVED * at.size)
    if noise and noise < least:
        raise TensegrityError(
            f"noise {noise:g} N must be at least {least:g} N: loads of {at.size:g} N less those "
            f"of the best prism leave {left:g} N"
        )
    return z


def _refuse_reversed(at: Misfit, misfit: Array, noise: float | None) -> None:
    """Refuse points of extension that a prism fits much better as points of compression."""
    if np.median(at.x) >= 0 or np.median(at.y) >= 0:
        return
    other = Misfit(at.curve.prism, -at.x, -at.y, at.names)
    try:
        left = other(_least_squares(other, noise))[0]
    except TensegrityError:
        return
    square = left @ left
    if misfit @ misfit - square > CLEAR**2 * square / len(left):
        mirrored, given = (at.size * float(np.sqrt(np.mean(e**2))) for e in (left, misfit))
        raise EquilibriumError(
            f"shortening {at.x.min():.4g} to {at.x.max():.4g} m and load {at.y.min():.4g} to "
            f"{at.y.max():.4g} N are extension and tension; with both signs reversed the best "
            f"prism leaves {mirrored:.3g} N instead of {given:.3g} N: compression must count as "
            "positive in load and shortening"
        )


def _sign_or_unit_hint(start: Array, x: Array, y: Array) -> str:
    """A hint that signs or units of the points disagree with the given prism; empty if none."""
    known = f"{start.min():.4g} to {start.max():.4g} N"
    if (start / np.abs(start).max()) @ (y / np.abs(y).max()) < 0:
        return (
            f": loads {y.min():.4g} to {y.max():.4g} N oppose those of the given prism, {known} "
            f"at shortening {x.min():.4g} to {x.max():.4g} m; compression must count as positive "
            "in load and shortening"
        )
    worst = int(np.argmax(np.abs(y)))
    if 1 / FOREIGN < abs(y[worst]) / np.abs(start).max() < FOREIGN:
        return ""
    return (
        f": the largest load, {y[worst]:.4g} N at index {worst}, is far from those of the given "
        f"prism, {known}; loads must be in N, shortening in m"
    )


def _unidentified(
    prism: Prism, names: tuple[str, ...], deviation: Array, x: Array, noise: float
) -> tuple[str, ...]:
    """Free parameters with large errors, and fixed ones to which the curve is insensitive."""
    loose = {n: error for n, error in zip(names, deviation, strict=False) if error > LARGE}
    words = [f"{n}: its standard error is {100 * error:.3g} % of it" for n, error in loose.items()]
    if {"prestrain", "k_cross"} <= {*loose}:
        force = prism.k_cross * prism.prestrain / (1 + prism.prestrain)
        words.append(f"only the combination k_cross p0/(1 + p0) is known, {force:.4g} N/m")
    for name in NAMES:
        value = getattr(prism, name)
        if name in names or math.isinf(value) or name == "k_cross":
            continue
        try:
            doubled = traced_loads(replace(prism, **{name: 2 * value}), x)
            change = np.abs(doubled - traced_loads(prism, x)).max()
        except TensegrityError:
            continue
        if change < 3 * noise / math.sqrt(len(x)):
            words.append(f"{name}: doubling it changes the loads by only {change:.2g} N")
    return tuple(words)


def _checked_names(free: Any, prism: Prism) -> tuple[str, ...]:
    names = check.sequence("free", free, "names")
    for name in names:
        if not isinstance(name, str) or name not in NAMES or names.count(name) > 1:
            raise TensegrityError(
                f"free {check.shown(name)} must be one of {', '.join(NAMES)}, once"
            )
        value = getattr(prism, name)
        if not (value > 0 and math.isfinite(value)):
            raise TensegrityError(f"{name} {value:g} cannot be free: it must be finite and above 0")
    if not names:
        raise TensegrityError("free () names no parameter")
    return names


def _read_points(shortening: Any, load: Any) -> tuple[Array, Array]:
    if load is None:
        shortening, load = read_curve(shortening, "m", "N")
    each = [one.t for one in (shortening, load) if isinstance(one, Sampled)]
    if len(each) == 2 and not np.array_equal(each[0], each[1]):
        raise TensegrityError("shortening and load are time series of different instants")
    x, y = check.columns(shortening=shortening, load=load)
    return x, y


def _sign_runs(residuals: Array) -> tuple[int, float]:
    """Number of runs of residuals of one sign, and its mean for independent residuals."""
    up = residuals > 0
    above, below = int(up.sum()), int((~up).sum())
    return 1 + int(np.sum(up[1:] != up[:-1])), 1 + 2 * above * below / max(len(up), 1)
