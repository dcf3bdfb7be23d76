"""Springs of measured tensions: splines of a table.

A spline is a polynomial about r = 0 plus, for each knot where its pieces differ, one-sided powers
that grow outwards from it: terms of the form of a kink, of which place, strength and exponent are
known.  All numbers are parameters of the law, so that tables of as many bends share one kernel.
Knots at which the pieces agree to round-off are left out: the spline of a cubic is that cubic.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

import numpy as np

from tensegrity import check
from tensegrity.columns import read_columns, text_lines
from tensegrity.engine.law import DerivedLaw, horner
from tensegrity.errors import ResolutionError, TensegrityError
from tensegrity.printing import number_text

if TYPE_CHECKING:
    from collections.abc import Sequence
    from os import PathLike

    from numpy.typing import ArrayLike

    from tensegrity.springs.kinks import Kink
    from tensegrity.typing import Array

KINDS = {"cubic": (4, (3,)), "monotone": (3, (2, 3)), "linear": (2, (1,)), "smooth": (5, (3,))}
"""Least number of points, and powers of the terms of a bend."""
HEAD = ("low", "high", "stiffness_below", "stiffness_above", "per_size", "a0", "a1", "a2", "a3")
MOST, RECORD = 100, 100_000  # points that are interpolated, for the time to compile; smoothed
NARROWEST = 1e-100  # smallest size of the elongations [m]
ROUND_OFF = 1e-13  # term of a bend, one spacing from it, over the largest tension
EXACT, MISFIT = 1e-13, 1e-9  # error over the largest tension: of a spline without some bends, and
# admissible
FLOPPY, PENALTIES = 1e-9, 1000  # least weight of a penalty, and number of those that are tried


@dataclass(frozen=True)
class SplineForms:
    """A tension with bends.

    Attributes
    ----------
    bends : int
    powers : tuple of int
        Of the terms of each bend.
    """

    bends: int
    powers: tuple[int, ...]
    compiled = ("energy", "tension", "stiffness", "slope")

    @property
    def parameters(self) -> tuple[str, ...]:
        """Names of the ends and the polynomial; of the place of each bend, the reciprocal of its
        size, negative where it grows towards smaller elongations, and its terms [N]."""
        names = ("place", "per", *(f"c{p}" for p in self.powers))
        return (*HEAD, *(f"{name}_{k}" for name in names for k in range(self.bends)))

    def forms(self) -> tuple[Any, Any, Sequence[Any]]:
        """Elongation, parameters, and the energy with its derivatives as CasADi expressions; see
        `law.Law.forms`."""
        import casadi as ca

        r, p, count = ca.SX.sym("r"), ca.SX.sym("p", len(self.parameters)), self.bends
        low, high, below, above, per_size, *a = ca.vertsplit(p[: len(HEAD)])
        starts = range(len(HEAD), p.numel(), max(count, 1))
        place, per, *c = (p[k : k + count] for k in starts) if count else [ca.SX(0, 1)] * 3
        s, far = ca.SX.sym("s"), ca.SX.sym("far", count)  # far: from a bend, over its size
        t = per_size * s
        tension = horner(a, t)
        energy = t / per_size * horner([x / (k + 1) for k, x in enumerate(a)], t)
        for n, strength in zip(self.powers, c, strict=False):
            tension += ca.dot(strength, far**n)
            energy += ca.dot(strength / per, far ** (n + 1)) / (n + 1)

        def rate(value):
            return ca.gradient(value, s) + ca.dot(ca.gradient(value, far), per * (far > 0))

        stiffness = rate(tension)
        slope = rate(stiffness) * (r > low) * (r < high)
        under, over = ca.fmin(r - low, 0), ca.fmax(r - high, 0)  # a tangent continues the spline
        energy += tension * (under + over) + (below * under**2 + above * over**2) / 2
        tension += below * under + above * over
        at = ca.fmin(ca.fmax(r, low), high)
        forms = ca.substitute(
            [energy, tension, stiffness, slope], [s, far], [at, ca.fmax(per * (at - place), 0)]
        )
        return r, p, forms


def spline_forms(bends: int, *powers: int) -> Any:
    """The forms of a `SplineLaw`."""
    return SplineForms(bends, powers)


class SplineLaw(DerivedLaw):
    """The law of splines of as many bends, with terms of the same powers.

    Parameters
    ----------
    bends : int
    *powers : int
    """

    is_expression = False

    def __init__(self, bends: int, *powers: int) -> None:
        super().__init__(spline_forms, bends, *powers)

    def kinks(self, values: Array, domain: tuple[float, float]) -> tuple[Kink, ...]:
        """Kinks of the force: the bends, and the ends of a table that tangents continue."""
        count, *powers = self.__dict__["arguments"]
        low, high, _, _, per_size, _, _, a2, a3 = values[: len(HEAD)].tolist()
        place, per, *terms = values[len(HEAD) :].reshape(2 + len(powers), count)
        found = []
        for n, c in zip(powers, terms, strict=True):
            side = np.sign(per)
            rows = zip(place, side * c * np.abs(per) ** n, [n] * count, side, strict=True)
            found += [tuple(map(float, row)) for row in rows]
        for side, end in ((-1.0, low), (1.0, high)) if math.isinf(domain[0]) else ():
            # the tangent lacks the second and third derivatives
            bent = per_size**2 * (2 * a2 + 6 * a3 * per_size * end)
            third, mine = 6 * a3 * per_size**3, side * per > 0
            for n, c in zip(powers, terms, strict=True):
                far = per[mine] * (end - place[mine])
                bent += float(np.sum(n * (n - 1) * c[mine] * per[mine] ** 2 * far ** max(n - 2, 0)))
                third += 6 * float(np.sum(c[mine] * per[mine] ** 3)) * (n == 3)
            found += [(end, -side * bent / 2, 2.0, side), (end, -third / 6, 3.0, side)]
        return tuple(kink for kink in found if kink[1])


def from_table(
    elongation: ArrayLike | str | PathLike[str],
    tension: ArrayLike | None,
    kind: str,
    noise: float | None,
    preload: float | None,
    extrapolate: bool,
    length: float | None,
) -> tuple[SplineLaw, Array, float | None, tuple[float, float], float, str]:
    """What a spring is made of.

    Parameters
    ----------
    elongation, tension, kind, noise, preload, extrapolate, length
        As of `tensegrity.Potential.from_table`.

    Returns
    -------
    law, values, length, domain, noise, printed form

    Raises
    ------
    TensegrityError
        As there.
    """
    x, y = _points(elongation, tension, kind)
    if noise is not None and kind != "smooth":
        raise TensegrityError(f"noise {noise:g} N of a {kind} table: give kind='smooth'")
    check.number("largest elongation", float(np.abs(x).max()), least=NARROWEST, unit="m")
    size, peak = (float(2.0 ** (np.frexp(np.abs(z).max())[1] - 1)) for z in (x, y))  # exact
    x, y, left, rest = x / size, y / peak, 0.0, 0.0
    with np.errstate(all="ignore"):  # what overflows is refused
        if kind == "smooth":
            x, y, left = _smoothed(x, y, noise and noise / peak)
        if preload is not None:
            load = preload / peak
            rest = _rest(_spline(x, y, kind), load, peak)
            x, y = x - rest, y + load
        if not x[0] < 0 < x[-1]:
            ends = f"from {size * x[0]:g} m to {size * x[-1]:g} m"
            raise TensegrityError(f"elongations {ends} must contain 0 m inside")
        head, bends = _parameters(x, y, kind, preload is not None)
        head *= [size, size, peak / size, peak / size, 1 / size, *[peak] * 4]
        bends.T[:] *= np.array([size, 1 / size, *[peak] * (len(bends.T) - 2)])[:, None]
        values = np.concatenate([head, bends.T.ravel()])
    low, high = (-math.inf, math.inf) if extrapolate else values[:2].tolist()
    if length is not None:
        length += rest * size
    check.finite("spline of the table", values)
    ends = " to ".join(map(number_text, values[:2]))
    noises = f", noise {number_text(peak * left)} N" if kind == "smooth" else ""
    origin = f"Potential.from_table({kind}, {len(bends)} bends from {ends} m{noises})"
    return SplineLaw(len(bends), *KINDS[kind][1]), values, length, (low, high), peak * left, origin


def _points(elongation: Any, tension: Any, kind: str) -> tuple[Array, Array]:
    """The points of a table, or of a file, in ascending order."""
    if tension is None:
        elongation, tension = read_columns(*text_lines(elongation), (0, 1)).values.T
    x, y = check.floats("elongation", elongation), check.floats("tension", tension)
    if x.ndim != 1 or y.shape != x.shape:
        raise TensegrityError(f"elongation {x.shape} and tension {y.shape} must be of one length")
    least, most = KINDS[kind][0], RECORD if kind == "smooth" else MOST
    check.whole(f"number of points of a {kind} table", len(x), least=least, below=most + 1)
    x, y = check.finite("elongation", x), check.finite("tension", y)
    if x[-1] < x[0]:
        x, y = x[::-1], y[::-1]
    for k in np.flatnonzero(~(np.diff(x) > 0))[:1]:
        raise TensegrityError(
            f"elongation {x[k + 1]:g} m follows {x[k]:g} m: a table must be sorted, with one "
            "tension for each elongation"
        )
    return x, y


def _spline(x: Array, y: Array, kind: str) -> Any:
    """The spline through points, of degree 3; a `scipy.interpolate.PPoly`."""
    from scipy.interpolate import CubicSpline, PchipInterpolator, PPoly

    if kind == "monotone":
        return PchipInterpolator(x, y)
    if kind == "linear":
        zero = np.zeros(len(x) - 1)
        return PPoly(np.array([zero, zero, np.diff(y) / np.diff(x), y[:-1]]), x)
    return CubicSpline(x, y, bc_type="natural" if kind == "smooth" else "not-a-knot")


def _smoothed(x: Array, y: Array, noise: float | None) -> tuple[Array, Array, float]:
    """Points of the smoothing spline, and an estimate of the standard deviation of the noise.

    The spline, natural with knots at some of the points, minimizes its squared distance from all of
    them plus a penalty times the integral of its squared curvature (Reinsch 1967; Eilers and Marx
    1996); the modes of both forms give it for all penalties.  The likelihood of the points decides
    (Wahba, Annals of Statistics 13, 1378, 1985).
    """
    from scipy.interpolate import CubicSpline
    from scipy.linalg import eigh

    count, most = len(x), min(len(x), MOST)
    at = x[np.linspace(0, count - 1, most).round().astype(int)]
    unit = CubicSpline(at, np.eye(most), bc_type="natural")
    values, bent, third = unit(x), unit(at, 2), np.diff(at)[:, None] / 3
    one, other = bent[:-1], bent[1:]
    both = one.T @ (third * other) / 2
    curved = one.T @ (third * one) + other.T @ (third * other) + both + both.T
    stiff, modes = eigh(curved, values.T @ values)
    stiff[:2] = 0.0  # lines are not curved
    z = modes.T @ (values.T @ y)
    outside = float(np.sum((y - values @ (modes @ z)) ** 2))  # of what such splines can be
    ends = FLOPPY / stiff[-1], 1 / (FLOPPY * stiff[2])
    penalty = np.geomspace(*ends, PENALTIES)[:, None] * stiff
    lost = penalty / (1 + penalty)
    variance = (outside + lost**2 @ z**2) / (count - most + lost.sum(axis=1))
    misfit = outside + lost @ z**2
    likely = misfit / noise / noise if noise else (count - 2) * np.log(misfit)
    best = int(np.argmin(likely - np.log(lost[:, 2:]).sum(axis=1)))
    return at, modes @ ((1 - lost[best]) * z), math.sqrt(variance[best])


def _rest(spline: Any, load: float, peak: float) -> float:
    """The elongation nearest to 0 at which a spline carries a load."""
    ends = spline.x[[0, -1]]
    rests = [x for x in spline.solve(-load, extrapolate=False).tolist() if ends[0] < x < ends[1]]
    if not rests:
        raise TensegrityError(
            f"preload {peak * load:g} N: the table has no tension {-peak * load:g} N inside"
        )
    return float(min(rests, key=abs))


def _parameters(x: Array, y: Array, kind: str, rests: bool) -> tuple[Array, Array]:
    """The numbers of `HEAD`, and those of the bends, (bends, 2 + powers), of a spline."""
    spline, powers, spacing = _spline(x, y, kind), KINDS[kind][1], np.diff(x)
    a = np.array([float(spline(0.0, k)) / math.factorial(k) for k in range(4)])
    a[0] *= not rests
    side = np.where(x[1:-1] > 0, 1.0, -1.0)
    per = side / np.minimum(spacing[:-1], spacing[1:])
    left, right = spline.c[::-1, :-1], spline.c[::-1, 1:]
    bends = np.column_stack([x[1:-1], per])
    for p in powers:
        before = sum(math.comb(m, p) * left[m] * spacing[:-1] ** (m - p) for m in range(p, 4))
        bends = np.column_stack([bends, side * (right[p] - before) / per**p])
    x = np.interp(np.arange(4 * len(x) - 3) / 4, np.arange(len(x)), x)  # where it is compared
    y = spline(x)
    fewer = _without_round_off(x, y, a, bends, powers)
    if _misfit(x, y, fewer[0], fewer[1], powers) <= EXACT:
        a, bends = fewer
    if not (error := _misfit(x, y, a, bends, powers)) <= MISFIT:
        raise ResolutionError(
            f"a {kind} spline of this table has an error of {error:.2g} of its largest tension, "
            f"must be at most {MISFIT:g}: its spacings are too unequal, or its steps too steep"
        )
    head = [x[0], x[-1], spline(x[0], 1), spline(x[-1], 1), 1.0, *a]
    return np.array(head, dtype=float), bends


def _basis(x: Array, bends: Array, powers: Sequence[int]) -> Array:
    """Powers of x, and of the distances from bends over their sizes, at the points."""
    far = np.maximum(bends[:, 1] * (x[:, None] - bends[:, 0]), 0)
    return np.hstack([x[:, None] ** range(4), *(far**p for p in powers)])


def _misfit(x: Array, y: Array, a: Array, bends: Array, powers: Sequence[int]) -> float:
    """Largest difference from the tensions y."""
    found = _basis(x, bends, powers) @ np.concatenate([a, bends[:, 2:].T.ravel()])
    return float(np.max(np.abs(found - y)))


def _without_round_off(x: Array, y: Array, a: Array, bends: Array, powers: Any) -> Any:
    """The spline of least squares with the same value at 0 and without the bends that may be
    round-off."""
    bends = bends[np.abs(bends[:, 2:]).max(axis=1) > ROUND_OFF].copy()
    columns = _basis(x, bends, powers)[:, 1:] * (np.append(a[1:] != 0, [True] * bends[:, 2:].size))
    size = np.abs(columns).max(axis=0)
    if np.isfinite(size).all():
        size[size == 0] = 1.0
        few = np.linalg.lstsq(columns / size, y - a[0])[0] / size
        a, bends[:, 2:] = np.append(a[0], few[:3]), few[3:].reshape(len(powers), -1).T
    return a, bends
