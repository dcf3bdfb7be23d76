"""Loads of a prism at given shortenings, their misfit to a measured curve, profile likelihoods.

The inner unknowns of `tensegrity.prisms.equations` are eliminated by Newton's method and the
implicit function theorem; CasADi differentiates in the parameters.  Each evaluation starts from
the previous one, extrapolated along its derivatives, or from a traced branch if that fails.  A
confidence interval by profile likelihood ends where the misfit, minimised over all other unknowns,
has grown to the bound set by a quantile.  Source: Bates & Watts, Nonlinear Regression Analysis and
Its Applications, 1988, chapter 6.
"""

from __future__ import annotations

import math
from dataclasses import replace
from typing import TYPE_CHECKING

import numpy as np

from tensegrity.errors import EquilibriumError, LockingError, TensegrityError
from tensegrity.once import once
from tensegrity.prisms.condensed import ElasticPotential
from tensegrity.prisms.equations import kind_of, numbers, problem

if TYPE_CHECKING:
    from typing import Any

    from tensegrity.prisms.prism import Prism
    from tensegrity.typing import Array

NAMES = ("prestrain", "k_cross", "k_base", "k_bar")
ENDS = ("contact", "unloaded", "flat")  # functions that are positive on the branch
FARTHEST = 60.0  # largest change of a logarithm; half of it amounts to 0 or infinity
ITERATIONS = 10
ROUND_OFF = 1e-11
SETTLED = 1e-14  # change at which Newton's method has converged
FEW = 5e-3  # scale of offsets over the height
NO_CURVE = 1e3  # misfit, over the largest load, where a prism has no such curve
RESOLVED = 1e-12  # smallest resolved noise over the largest load
STEPS = 200  # largest number of steps to the end of an interval; usually three to five
MOVES = 1000  # largest number of iterations to the least misfit
ENDED = 1e-4  # relative tolerance of the end of an interval
FAINT = 0.05  # change by a factor e in a parameter, over the noise, that is noticeable
FINEST = 1e-5  # smallest resolved relative change of the residuals
STUCK = 1e-6  # fraction of the required decrease below which damped steps have failed
BORDER = 0.1  # distance of a fit from the minimum, over the noise, that is accepted


def traced_loads(prism: Prism, x: Array) -> Array:
    """Loads [N] at shortenings x [m], (points,), on a branch traced from the reference."""
    return -_potential_within(prism, x).tension(-x)


def _potential_within(prism: Prism, x: Array) -> Any:
    potential = prism.potential()
    try:
        potential.tension(-x)
    except LockingError as error:
        raise TensegrityError(
            f"shortening {x.min():.6g} to {x.max():.6g} m (compression > 0) exceeds the range of "
            f"this prism: {error}"
        ) from None
    return potential


class Curve:
    """Loads at given shortenings as a function of logarithms of parameters and an offset.

    Parameters
    ----------
    prism : Prism
        With elastic bases or bars; parameters are relative to its values.
    shortening : ndarray, (points,)
        [m].
    """

    def __init__(self, prism: Prism, shortening: Array) -> None:
        self.prism, self.x = prism, shortening
        self._p = numbers(prism)
        self._step, self._last = _functions(*kind_of(prism))
        self._at, self._inner, self._rates = self._traced(np.zeros(len(NAMES) + 1))

    def prism_at(self, theta: Array) -> Prism:
        """The prism with parameters multiplied by exp(theta[:4]), in the order of `NAMES`."""
        changed = {
            name: getattr(self.prism, name) * math.exp(value)
            for name, value in zip(NAMES, theta[:-1].tolist(), strict=True)
            if value
        }
        return replace(self.prism, **changed)

    def __call__(self, theta: Array) -> tuple[Array, Array]:
        """Loads [N], (points,), and their derivatives in theta, (points, 5).

        `theta` contains the changes of the logarithms of the parameters `NAMES`, and the offset [m]
        that is added to the shortenings.
        """
        if np.abs(theta[:-1]).max() > FARTHEST:
            raise TensegrityError(f"parameters change by more than a factor e^{FARTHEST:g}")
        inner = self._inner + np.einsum("ijk,k->ij", self._rates, theta - self._at)
        solved = self._solved(theta, inner)
        if solved is None:
            self._at, self._inner, self._rates = self._traced(theta)
            solved = self._solved(theta, self._inner)
        if solved is None:
            raise TensegrityError("the curve of this prism was not found")
        self._at, (self._inner, load, slopes, self._rates) = theta.copy(), solved
        return load, slopes

    def _traced(self, theta: Array) -> tuple[Array, Array, Array]:
        potential = _potential_within(self.prism_at(theta), self.x + theta[-1])
        if not isinstance(potential, ElasticPotential):
            raise TensegrityError("k_base inf and k_bar inf: the prism must have elastic members")
        inner = potential.states(-(self.x + theta[-1]))[:, :-1]
        return theta.copy(), inner, np.zeros((*inner.shape, len(theta)))

    def _solved(self, theta: Array, inner: Array) -> Any:
        """Inner unknowns, loads and derivatives; None if Newton's method leaves the branch."""
        given = np.concatenate([theta, [self.prism.base, self.prism.k_cross], self._p])
        z, before = inner.T, math.inf
        for _ in range(ITERATIONS):
            new = np.array(self._step(z, self.x[None, :], given))
            moved = float(np.abs(new - z).max() / (1 + np.abs(new).max()))
            z = new
            if moved <= SETTLED or (moved <= ROUND_OFF and moved >= before / 4):
                break
            before = moved
        else:
            return None
        parts = (np.array(part) for part in self._last(z, self.x[None, :], given))
        new, load, slopes, rates, inside = parts
        if not (inside > 0).all():
            return None
        rates = rates.T.reshape(len(self.x), len(theta), len(z)).transpose(0, 2, 1)
        return new.T, load.ravel(), slopes.T, rates


@once
def _functions(rigid_base: bool, any_sides: bool) -> tuple[Any, Any]:
    """A Newton step, and the results at its end, as functions with one column per point."""
    import casadi as ca

    of = problem(rigid_base, any_sides)
    v, x, theta = ca.SX.sym("v", len(of.unknowns) - 1), ca.SX.sym("x"), ca.SX.sym("t", 5)
    base, k_cross, p = ca.SX.sym("l"), ca.SX.sym("k"), ca.SX.sym("p", of.p.numel())
    prestrain, cross, k_base, k_bar, offset = ca.vertsplit(theta)
    moved = ca.SX(p)
    for place, change in ((1, prestrain), (2, cross - k_base), (3, cross - k_bar)):
        moved[place] = p[place] * ca.exp(change)
    moved[4:6] = 1  # columns without units
    z = ca.vertcat(v, -(x + offset) / base)
    natural = of.columns["base"] - of.p[2] * of.events["unloaded"]  # of base strings, positive
    g, load, *inside = (
        ca.substitute(form, ca.vertcat(of.z, of.p), ca.vertcat(z, moved))
        for form in (of.equations, of.columns["load"], natural, *(of.events[x] for x in ENDS))
    )
    if rigid_base:
        inside[2] = -inside[2]  # tension of the bars, negative on the branch
    load = load * k_cross * ca.exp(cross) * base
    matrix = ca.jacobian(g, v)
    at_rest = ca.substitute(ca.det(matrix), ca.vertcat(v, x, theta), ca.DM.zeros(v.numel() + 6))
    rates = -ca.solve(matrix, ca.jacobian(g, theta))
    slopes = ca.jacobian(load, theta) + ca.jacobian(load, v) @ rates
    given = [v, x, ca.vertcat(theta, base, k_cross, p)]
    inside = ca.vertcat(*inside, ca.det(matrix) * at_rest)
    return (
        ca.Function("step", given, [v - ca.solve(matrix, g)]),
        ca.Function("last", given, [v, load, slopes.T, ca.vec(rates), inside]),
    )


class Misfit:
    """Computed minus measured loads over the largest one, and derivatives in the unknowns.

    The unknowns are those of `names`: changes of the logarithms of parameters from their values in
    the prism, and the offset in units of `FEW` heights.
    """

    def __init__(self, prism: Prism, x: Array, y: Array, names: tuple[str, ...]) -> None:
        self.curve, self.names = Curve(prism, x), names
        self.x, self.y, self.size = x, y, float(np.abs(y).max())
        self.places = [(*NAMES, "offset").index(name) for name in names]
        self.weights = [FEW * prism.height if name == "offset" else 1.0 for name in names]
        self._last: tuple[bytes, tuple[Array, Array]] = b"", (y, y)

    def theta(self, z: Array) -> Array:
        """The arguments theta of `Curve` for unknowns z."""
        theta = np.zeros(len(NAMES) + 1)
        theta[self.places] = z * self.weights
        return theta

    def __call__(self, z: Array) -> tuple[Array, Array]:
        """Misfits, (points,), all `NO_CURVE` where no such curve exists; (points, unknowns)."""
        key = z.tobytes()
        if key != self._last[0]:  # SciPy evaluates values and derivatives separately
            try:
                computed, slopes = self.curve(self.theta(z))
            except TensegrityError:
                result = np.full(len(self.y), NO_CURVE), np.zeros((len(self.y), len(z)))
            else:
                slopes = slopes[:, self.places] * self.weights / self.size
                result = (computed - self.y) / self.size, slopes
            self._last = key, result
        return self._last[1]


def intervals(
    prism: Prism,
    offset: float,
    x: Array,
    y: Array,
    names: tuple[str, ...],
    noise: float,
    quantile: float,
) -> dict[str, tuple[float, float]]:
    """Confidence intervals by profile likelihood; see `Fit.intervals`.

    Parameters
    ----------
    prism : Prism
        The fitted prism.
    offset : float
        The fitted offset [m].
    x, y : ndarray, (points,)
        Measured shortenings [m] and loads [N].
    names : tuple of str
        Free parameters.
    noise : float
        Standard deviation of the loads [N].
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
    at = Misfit(prism, x + offset, y, names)
    noise = max(noise / at.size, RESOLVED)
    r, slopes = at(np.zeros(len(names)))
    move = _step(slopes, slice(None), r)
    better = r + slopes @ move / max(1.0, np.abs(move).max())
    if r @ r - better @ better > (BORDER * noise) ** 2:
        raise EquilibriumError(
            "the fit lies at the border of prisms with equilibria at all these points, where "
            "the residuals are not least: no intervals"
        )
    width = max(quantile * noise, FINEST * float(np.linalg.norm(r)))
    shift = at.theta(_kept_sensitive(at, FAINT * noise))
    centre, offset = at.curve.prism_at(shift), offset + float(shift[-1])
    at, ends = Misfit(centre, x + offset, y, names), {}
    for k, name in enumerate(names):
        low, high = (_interval_end(at, k, side, width) for side in (-1, 1))
        if name == "offset":
            ends[name] = offset + at.weights[k] * low, offset + at.weights[k] * high
        else:
            value = getattr(centre, name)
            ends[name] = value * math.exp(low), value * math.exp(high)
    return ends


def _kept_sensitive(at: Misfit, change: float) -> Array:
    """Unknowns of nearly least misfit, none so extreme that the misfit is insensitive to it."""
    z = np.zeros(len(at.places))
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
    inside, low, high = np.zeros(len(at.places)), 0.0, math.inf
    r, slopes = at(inside)
    least, others, held = r @ r, np.arange(len(inside)) != k, -math.inf
    alone = slopes[:, k] + slopes @ _step(slopes, others, slopes[:, k])
    new = first = min(width / max(float(np.linalg.norm(alone)), width), 1.0)
    for _ in range(STEPS):
        z = inside.copy()
        z[k] = side * new
        z, r, slopes = _least_misfit(at, others, z, ENDED * width**2)
        left = math.inf if r[0] == NO_CURVE else math.sqrt(max(float(r @ r - least), 0.0))
        if abs(left - width) <= ENDED * width:
            return float(z[k])
        if left > width:
            high = new
        elif new > FARTHEST / 2:
            return side * math.inf
        else:
            inside, low = z, new
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
