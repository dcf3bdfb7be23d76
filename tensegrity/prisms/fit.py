"""Prisms fitted to measured curves of load against shortening, with errors.

Model: the equilibrium path of the elastic prism, read at a shortening that may be offset; errors
of the loads independent and of one size.  Least squares on the logarithms of what is positive, by
SciPy, with the exact derivatives of `tensegrity.prisms.curve`; standard errors from the Jacobian
at the solution (Gauss-Newton covariance).  Source:
seeds/000, part III, "Experimental validation of the constitutive response".
"""

from __future__ import annotations

import math
from dataclasses import dataclass, replace
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np

from tensegrity import check
from tensegrity.errors import EquilibriumError, TensegrityError
from tensegrity.prisms.curve import NAMES, Curve, loads
from tensegrity.prisms.prism import Prism

if TYPE_CHECKING:
    from collections.abc import Sequence
    from os import PathLike
    from typing import Any

    from matplotlib.axes import Axes
    from numpy.typing import ArrayLike

    from tensegrity.typing import Array

LARGE = 0.3  # relative standard error from which a parameter counts as not identified
FEW = 5e-3  # of the height, the size of offsets
OFF = 1e3  # misfit of parameters that have no such curve, over the largest load
SAME = 1e-9  # of the largest load: two ways to the loads agree


@dataclass(frozen=True)
class Fit:
    """What a curve says about a prism.

    Attributes
    ----------
    prism : Prism
        With the estimated parameters.
    names : tuple of str
        The free ones, then "offset" where it is one.
    values, errors : dict of str to float
        Estimates and standard errors, in the units of the parameters; offset in m.
    correlation : ndarray, (parameters, parameters)
    condition : float
        Of the Jacobian, columns scaled to relative changes.
    offset : float
        Shortening of the prism where the curve says 0 [m].
    residuals : ndarray, (points,)
        Measured less computed load [N].
    noise : float
        Standard deviation of the loads [N]: as given, or that of the residuals.
    unidentified : tuple of str
        Parameters that this curve does not determine, and why, in words.
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
    unidentified: tuple[str, ...]
    shortening: Array
    load: Array
    covariance: Array
    jacobian: Array

    def computed(self) -> Array:
        """Loads of the fitted prism at the points [N], (points,)."""
        return self.load - self.residuals

    def band(self) -> Array:
        """Standard error of the computed loads [N], (points,)."""
        inside = np.einsum("ij,jk,ik->i", self.jacobian, self.covariance, self.jacobian)
        return np.asarray(np.sqrt(np.maximum(inside, 0.0)))

    def __str__(self) -> str:
        lines = [f"{self.prism}"]
        for name in self.names:
            lines.append(f"  {name} = {self.values[name]:.6g} +- {self.errors[name]:.2g}")
        size = np.sqrt(np.mean(self.residuals**2))
        runs, expected = _runs(self.residuals)
        lines.append(
            f"  residuals {size:.3g} N for a noise of {self.noise:.3g} N; {runs} runs of one sign, "
            f"{expected:.0f} expected; condition {self.condition:.3g}"
        )
        lines.append(
            f"  {len(self.load)} points, shortening {self.shortening.min():.6g} to "
            f"{self.shortening.max():.6g} m"
        )
        return "\n".join([*lines, *(f"  not identified: {word}" for word in self.unidentified)])

    def plot(self, axes: Axes | None = None) -> Axes:
        """Points, fitted curve and its 95 % band; returns the Matplotlib axes."""
        if axes is None:
            import matplotlib.pyplot as plt

            axes = plt.figure().add_subplot()
        order = np.argsort(self.shortening)
        x, y, w = self.shortening[order], self.computed()[order], 1.96 * self.band()[order]
        axes.plot(self.shortening, self.load, "o", ms=3, color="0.4", label="points")
        axes.plot(x, y, "-", color="C0", label="fitted prism")
        axes.fill_between(x, y - w, y + w, color="C0", alpha=0.25, label="95 % band")
        axes.set(xlabel="shortening [m]", ylabel="axial load [N], compression > 0")
        axes.legend(frameon=False)
        return axes


def fit(
    shortening: ArrayLike | str | PathLike[str],
    load: ArrayLike | None = None,
    prism: Prism | None = None,
    free: Sequence[str] = ("prestrain", "k_base"),
    offset: bool = True,
    noise: float | None = None,
) -> Fit:
    """A prism fitted to a measured curve.

    Parameters
    ----------
    shortening : array_like (points,) or path
        [m], compression > 0; or a CSV file of two columns, shortening and load, one header line.
    load : array_like (points,), optional
        [N], compression > 0; None with a file.
    prism : Prism
        Where to start; what is not free stays as it is.  With elastic bases or bars.
    free : sequence of str, optional
        Of "prestrain", "k_cross", "k_base", "k_bar".
    offset : bool, optional
        Whether the zero of shortening is unknown too.
    noise : float, optional
        Standard deviation of the loads [N]; by default that of the residuals.

    Returns
    -------
    Fit

    Raises
    ------
    TensegrityError
        If there are fewer points than unknowns, or points beyond contact of this prism.
    """
    from scipy.optimize import least_squares

    x, y = _points(shortening, load)
    if not isinstance(prism, Prism):
        raise TensegrityError(f"prism {check.shown(prism)} is not a Prism: where the fit starts")
    if prism.is_rigid:
        raise TensegrityError("k_base inf and k_bar inf: the prism must have elastic members")
    offset = check.truth("offset", offset)
    names = _free(free, prism)
    if noise is not None:
        noise = check.number("noise", noise, above=0, unit="N")
        if noise > 1e100:
            raise TensegrityError(f"noise {noise:g} N must be at most 1e100 N")
    count = len(names) + offset
    if len(x) < count + (noise is None):
        raise TensegrityError(
            f"{len(x)} points are fewer than {count + (noise is None)}: {count} unknowns"
            + (" and the noise" if noise is None else "")
        )
    if np.ptp(x) <= 0:
        raise TensegrityError("all points have one shortening: no curve")
    scale = FEW * prism.height
    size = max(float(np.abs(y).max()), 1e-300)
    curve = Curve(prism, x)
    places = [NAMES.index(name) for name in names] + [len(NAMES)] * offset
    weights = np.ones(count)
    known: dict[bytes, tuple[Array, Array]] = {}  # the last: SciPy asks twice
    if offset:
        weights[-1] = scale

    def at(z: Array) -> tuple[Array, Array]:
        """Misfits and their derivatives, over the largest load."""
        key = z.tobytes()
        if key in known:
            return known[key]
        known.clear()
        theta = np.zeros(len(NAMES) + 1)
        theta[places] = z * weights
        try:
            computed, slopes = curve(theta)
        except TensegrityError:
            known[key] = np.full(len(x), OFF), np.zeros((len(x), count))
        else:
            known[key] = (computed - y) / size, slopes[:, places] * weights / size
        return known[key]

    found = least_squares(
        lambda z: at(z)[0], np.zeros(count), lambda z: at(z)[1], method="lm",
        xtol=1e-12, ftol=1e-12,
    )  # fmt: skip
    theta = np.zeros(len(NAMES) + 1)
    theta[places] = found.x * weights
    best, shift = curve.made(theta), float(theta[-1])
    if np.abs(found.fun).max() >= OFF or (
        np.abs(loads(best, x + shift) - y - found.fun * size).max() > SAME * size
    ):
        raise EquilibriumError("no prism near the given one has equilibria at all these points")
    jacobian = at(found.x)[1] * size
    residuals = -found.fun * size
    spread = noise
    if spread is None:
        spread = float(np.sqrt(np.sum(residuals**2) / (len(x) - count)))
    _, sizes, right = np.linalg.svd(jacobian, full_matrices=False)
    kept = np.maximum(sizes, 1e-14 * sizes[0])
    covariance = spread**2 * (right.T / kept**2) @ right
    deviation = np.sqrt(np.diag(covariance))
    values = {n: float(getattr(best, n)) for n in names}
    errors = {n: float(values[n] * d) for n, d in zip(names, deviation, strict=False)}
    if offset:
        values["offset"], errors["offset"] = shift, float(deviation[-1] * scale)
    everything = (*names, "offset") if offset else names
    return Fit(
        best, everything, values, errors, covariance / np.outer(deviation, deviation),
        float(sizes[0] / kept[-1]), shift, residuals, float(spread),
        _unidentified(best, names, deviation, x + shift, spread), x, y, covariance, jacobian,
    )  # fmt: skip


def _unidentified(
    prism: Prism, names: tuple[str, ...], deviation: Array, x: Array, noise: float
) -> tuple[str, ...]:
    """Free parameters with large errors; and held ones of which the curve says nothing."""
    words = []
    for name, error in zip(names, deviation, strict=False):
        if error > LARGE:
            words.append(f"{name}: its standard error is {100 * error:.0f} % of it")
    loose = [n for n, error in zip(names, deviation, strict=False) if error > LARGE]
    if {"prestrain", "k_cross"} <= {*loose}:
        force = prism.k_cross * prism.prestrain / (1 + prism.prestrain)
        words.append(f"only k_cross p0/(1 + p0) is known of both, {force:.4g} N/m")
    for name in NAMES:
        value = getattr(prism, name)
        if name in names or math.isinf(value) or name == "k_cross":
            continue
        try:
            doubled = loads(replace(prism, **{name: 2 * value}), x)
            change = np.abs(doubled - loads(prism, x)).max()
        except TensegrityError:
            continue
        if change < 3 * noise / math.sqrt(len(x)):
            words.append(f"{name}: doubled, it changes loads by {change:.2g} N only")
    return tuple(words)


def _free(free: Any, prism: Prism) -> tuple[str, ...]:
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


def _points(shortening: Any, load: Any) -> tuple[Array, Array]:
    if load is None:
        path = check.path("shortening", shortening)
        try:
            table = np.loadtxt(Path(path), delimiter=",", skiprows=1, ndmin=2)
        except (OSError, ValueError) as error:
            raise TensegrityError(f"{path} is no CSV file of numbers: {error}") from None
        if table.shape[1] != 2:
            raise TensegrityError(f"{path} has {table.shape[1]} columns, must be 2")
        shortening, load = table.T
    x = check.floats("shortening", shortening)
    y = check.floats("load", load)
    if x.ndim != 1 or y.shape != x.shape:
        raise TensegrityError(f"shortening {x.shape} and load {y.shape} must be of one length")
    return check.vector("shortening", x, x.shape), check.vector("load", y, x.shape)


def _runs(residuals: Array) -> tuple[int, float]:
    """Runs of residuals of one sign, and how many independent ones would have on average."""
    up = residuals > 0
    above, below = int(up.sum()), int((~up).sum())
    return 1 + int(np.sum(up[1:] != up[:-1])), 1 + 2 * above * below / max(len(up), 1)
