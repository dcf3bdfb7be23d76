"""Springs of measured tensions: splines of a table.

A spline is a polynomial about r = 0 plus, for each knot where its pieces differ, one-sided powers
that grow outwards from it: terms of the form of a kink, of which place, strength and exponent are
known.  All numbers are parameters of the law, so that tables of as many bends share one kernel.
Knots at which the pieces agree to round-off are left out: the spline of a cubic is that cubic.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from functools import cached_property
from typing import TYPE_CHECKING, Any

import numpy as np

from tensegrity import check
from tensegrity.engine.law import DerivedLaw, horner
from tensegrity.errors import ResolutionError, TensegrityError
from tensegrity.printing import number_text
from tensegrity.springs.potential import Potential

if TYPE_CHECKING:
    from collections.abc import Sequence

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


def spline_law(bends: int, *powers: int) -> Any:
    """The law of `SplineForms`."""
    return SplineForms(bends, powers)


class Table(Potential):
    """A spring whose tension is a spline of a table: see `Potential.from_table`.

    Attributes
    ----------
    kind : {"cubic", "monotone", "linear", "smooth"}
    noise : float
        Root mean square of the difference from the table [N]; 0 unless smoothed.
    """

    kind: str
    noise: float

    def _take(self, kind, values, length, domain, noise):
        self.kind, self.noise = kind, noise
        powers = KINDS[kind][1]
        bends = (len(values) - len(HEAD)) // (2 + len(powers))
        law: Any = DerivedLaw(spline_law, bends, *powers)
        self._set(law, values, length, domain, ("the table ends",) * 2)

    @property
    def bends(self) -> Array:
        """Place [m], reciprocal of the size [1/m] and terms [N] of each bend; (bends, 3 or 4)."""
        return self.values[len(HEAD) :].reshape(2 + len(KINDS[self.kind][1]), -1).T

    @cached_property
    def kinks(self) -> tuple[Kink, ...]:
        """Kinks of the force: the bends, and the ends of a table that tangents continue."""
        found = [
            (place, math.copysign(c, c * per) * abs(per) ** n, float(n), math.copysign(1.0, per))
            for place, per, *terms in self.bends.tolist()
            for n, c in zip(KINDS[self.kind][1], terms, strict=True)
            if c
        ]
        for end in self.values[: 2 if math.isinf(self._domain[0]) else 0].tolist():
            side = math.copysign(1.0, end)  # the tangent lacks the second and third derivatives
            inner = max((side * x for x in self.bends[:, 0].tolist()), default=0.0)
            near = np.nextafter(end, 0.0)
            middle = (end + side * max(inner, 0.0)) / 2
            bent = self.derivative(3, np.array([near, middle])).tolist()
            third = (bent[0] - bent[1]) / float(near - middle)
            found += [(end, -side * bent[0] / 2, 2.0, side), (end, -third / 6, 3.0, side)]
        return tuple(kink for kink in found if kink[1])

    def __repr__(self) -> str:
        low, high = (number_text(x) for x in self.values[:2])
        noise = f", noise {self.noise:.3g} N" if self.kind == "smooth" else ""
        return f"Table({self.kind}, {len(self.bends)} bends from {low} to {high} m{noise})"


def table_of_values(
    kind: str, values: ArrayLike, length: float | None, domain: tuple[float, float], noise: float
) -> Table:
    """A spring from the numbers of one that was made from a table before.

    Parameters
    ----------
    kind : {"cubic", "monotone", "linear", "smooth"}
    values : array_like
        Parameters of its law.
    length : float or None
        Length at r = 0 [m].
    domain : (float, float)
        Range of elongation [m].
    noise : float
        Root mean square of the difference from the table [N], >= 0.

    Returns
    -------
    Table

    Raises
    ------
    TensegrityError
        Another kind, or values that do not match it.
    """
    values = check.finite("values", check.floats("values", values))
    terms = 2 + len(KINDS[_known(kind)][1])
    if values.ndim != 1 or len(values) < len(HEAD) or (len(values) - len(HEAD)) % terms:
        raise TensegrityError(f"{values.size} values do not make a {kind} table")
    made = Table.__new__(Table)
    made._take(kind, values, length, domain, check.number("noise", noise, least=0, unit="N"))
    return made


def _known(kind: object) -> str:
    if not isinstance(kind, str) or kind not in KINDS:
        raise TensegrityError(f"kind {check.shown(kind)} must be one of {', '.join(KINDS)}")
    return kind


def from_table(
    elongation: ArrayLike,
    tension: ArrayLike,
    kind: str,
    noise: float | None,
    preload: float | None,
    extrapolate: bool,
    length: float | None,
) -> Table:
    """See `tensegrity.Potential.from_table`."""
    x, y = _points(elongation, tension, kind)
    extrapolate = check.truth("extrapolate", extrapolate)
    if noise is not None:
        noise = check.number("noise", noise, above=0, unit="N")
        if kind != "smooth":
            raise TensegrityError(f"noise {noise:g} N of a {kind} table: give kind='smooth'")
    length = None if length is None else check.number("length", length, above=0, unit="m")
    check.number("largest elongation", float(np.abs(x).max()), least=NARROWEST, unit="m")
    size, peak = (float(2.0 ** (np.frexp(np.abs(z).max())[1] - 1)) for z in (x, y))  # exact
    x, y, left, rest = x / size, y / peak, 0.0, 0.0
    with np.errstate(all="ignore"):  # what overflows is refused
        if kind == "smooth":
            x, y, left = _smoothed(x, y, noise and noise / peak)
        if preload is not None:
            load = check.number("preload", preload, unit="N") / peak
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
    return table_of_values(kind, values, length, (low, high), peak * left)


def _points(elongation: ArrayLike, tension: ArrayLike, kind: str) -> tuple[Array, Array]:
    """The points of a table in ascending order."""
    x, y = check.floats("elongation", elongation), check.floats("tension", tension)
    if x.ndim != 1 or y.shape != x.shape:
        raise TensegrityError(f"elongation {x.shape} and tension {y.shape} must be of one length")
    least, most = KINDS[_known(kind)][0], RECORD if kind == "smooth" else MOST
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
    likely = misfit / noise**2 if noise else (count - 2) * np.log(misfit)
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
    x = np.sort(np.append(x, (x[1:] + x[:-1]) / 2))  # where it is compared
    y = spline(x)
    found = _without_round_off(x, y, a, bends, powers)
    if not _misfit(x, y, *found, powers) <= EXACT:
        found = a, bends
    if not (error := _misfit(x, y, *found, powers)) <= MISFIT:
        raise ResolutionError(
            f"a {kind} spline of this table has an error of {error:.2g} of its largest tension, "
            f"must be at most {MISFIT:g}: its spacings are too unequal, or its steps too steep"
        )
    head = [x[0], x[-1], spline(x[0], 1), spline(x[-1], 1), 1.0, *found[0]]
    return np.array(head, dtype=float), found[1]


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
