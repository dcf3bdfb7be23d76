"""Integration methods as data: rows of coefficients for shared loops.

A step of a `Splitting` is a sequence of kicks (velocities by kicks[i] dt) and drifts (positions
by drifts[i] dt), closed by a last kick.  Such methods are explicit, symplectic and, being
palindromes, time-reversible.  They keep their order where sites are driven or damped, or springs
change with time: see `keeps`.  A step of a `Nystrom` method evaluates accelerations at points
inside the step and sums them; it is none of the latter two.  `Gauss` methods are implicit,
symplectic and time-reversible, and stable with any step.
"""

from __future__ import annotations

import math
from collections.abc import Iterable
from dataclasses import dataclass, field
from fractions import Fraction
from functools import cached_property
from typing import TYPE_CHECKING, ClassVar

import numpy as np

from tensegrity import check
from tensegrity.engine.kept import kept
from tensegrity.errors import TensegrityError

if TYPE_CHECKING:
    from collections.abc import Sequence
    from typing import Any

    from tensegrity.typing import Array

    Matrix = tuple[Array, Array, Array, Array]  # xx, xv, vx, vv
    Rows = Iterable[Iterable[Any]]

ROUGH = 1e-3  # for tolerances above it the simplest method is cheapest
ROUND_OFF = 1e-9  # in the trace of a step's matrix, beyond the bound of a stable one
GAIN = 1e-12  # in the amplification of a step, beyond 1
EXACT = 1e-12  # in the sums of coefficients, and between those that mirror each other
MOST_STAGES = 250  # pieces of a long chain overlap by no more sites


@dataclass(frozen=True)
class Method:
    """What all methods have.

    `simulate` takes any `Splitting` or `Nystrom`, also one that `METHODS` does not list.

    Attributes
    ----------
    name : str
    order : int
        Global error ~ dt^order on smooth springs.
    step : float
        Default dt over the stability limit, or over 1/omega where there is none.
    reference : str, optional
    when_not : str, optional
        Where another method serves better.
    keeps : str
        What it keeps in scenes that are driven, damped or tuned.
    """

    name: str
    order: int
    step: float
    reference: str = field(default="", kw_only=True)
    when_not: str = field(default="", kw_only=True)

    explicit = True
    reversible = True
    processor: ClassVar[tuple[Splitting, Splitting] | None] = None
    keeps: ClassVar[str] = "not for scenes that are driven, damped or tuned"
    opening_share: ClassVar[float] = 0.0  # of `step` that serves where contacts open, whatever else
    if TYPE_CHECKING:  # what each kind of method brings
        symplectic: ClassVar[bool]
        _slack: ClassVar[float]
        _bisected: ClassVar[float]

        @property
        def stages(self) -> int: ...
        def step_matrix(self, z: Array | float) -> Matrix: ...
        def _excess(self, z: Array) -> Array: ...

    def __post_init__(self) -> None:
        for name in ("name", "reference", "when_not"):
            check.kind(f"{name} of a method", getattr(self, name), str)
        self._set("order", check.whole(f"order of {self.name!r}", self.order, least=1))
        self._set("step", check.number(f"step of {self.name!r}", self.step, above=0))

    def _set(self, name: str, value: Any) -> None:
        object.__setattr__(self, name, value)

    def _set_rows(self, *names: str) -> None:
        for name in names:
            self._set(name, _row(f"{name} of {self.name!r}", getattr(self, name)))

    def _require(self, holds: bool, words: str) -> None:
        if not holds:
            raise TensegrityError(f"method {self.name!r}: {words}")

    def _require_sum(self, words: str, row: Iterable[float], wanted: float) -> None:
        total = math.fsum(row)
        self._require(abs(total - wanted) <= EXACT, f"{words} is {total:.15g}, must be {wanted:g}")

    def _require_stages(self) -> None:
        self._require(
            1 <= self.stages <= MOST_STAGES, f"{self.stages} stages must be 1 to {MOST_STAGES}"
        )

    @property
    def scale(self) -> float:
        """The dt * omega that `step` is a fraction of."""
        return self.stability_limit

    @cached_property
    def stability_limit(self) -> float:
        """Largest stable dt * omega on the harmonic oscillator, found from the coefficients."""
        return kept(("stability limit", repr(self)), self._stability_limit)

    def _stability_limit(self) -> float:
        z = np.linspace(0, 2.0 * self.stages + 1, 200_001)[1:]
        first = int(np.flatnonzero(self._excess(z) > self._slack)[0])
        low, high = (z[first - 1] if first else 0.0), z[first]
        for _ in range(60):
            middle = (low + high) / 2
            stable = self._excess(np.array(middle)) <= self._bisected
            low, high = (middle, high) if stable else (low, middle)
        return float(low)


@dataclass(frozen=True)
class Splitting(Method):
    """A palindrome of kicks and drifts.

    Attributes
    ----------
    kicks : tuple, (stages + 1,)
        Of sum 1; 0 at both ends for a step that begins and ends with a drift.
    drifts : tuple, (stages,)
        Of sum 1.

    Examples
    --------
    Suzuki's fourth-order composition of five steps of Verlet, in a run:

    >>> from tensegrity import Chain, Prism, simulate
    >>> a = 1 / (4 - 4 ** (1 / 3))
    >>> parts = (a, a, 1 - 4 * a, a, a)
    >>> kicks = [(x + y) / 2 for x, y in zip((0, *parts), (*parts, 0))]
    >>> suzuki = Splitting("suzuki4", order=4, step=0.1, kicks=kicks, drifts=parts)
    >>> chain = Chain(Prism(1.0, 0.7, 0.01, 1.0).potential(), 20)
    >>> simulate(chain, chain.at_rest({0: 0.01}), 5.0, method=suzuki).method
    'suzuki4'
    """

    kicks: tuple[float, ...]
    drifts: tuple[float, ...]
    symplectic = True
    keeps = (
        "its order under drives, springs that change, and dashpots, which drifts solve exactly, "
        "or, where damped bonds of a network turn, to that order; it is symplectic, with time as "
        "one more coordinate, as long as there are no dashpots; with them volumes shrink at the "
        "exact rate, or at that to its order.  Drifts backwards in time let velocities grow: dt "
        "times the largest drift and the fastest decay must be at most 2"
    )
    _slack, _bisected = ROUND_OFF, 0.0

    def __post_init__(self) -> None:
        super().__post_init__()
        self._set_rows("kicks", "drifts")

    def check(self) -> None:
        """Refuse rows that are no step of time dt, or not the palindrome that they should be."""
        kicks, drifts = self.kicks, self.drifts
        self._require(
            len(kicks) == len(drifts) + 1,
            f"{len(kicks)} kicks and {len(drifts)} drifts: there must be one kick more",
        )
        self._require_stages()
        self._require_sum("sum of the kicks", kicks, 1)
        self._require_sum("sum of the drifts", drifts, 1)
        if self.reversible:
            self._require(
                _mirrors(kicks) and _mirrors(drifts),
                "kicks and drifts must be palindromes for the method to be reversible in time",
            )

    @property
    def stages(self) -> int:
        """Force evaluations per step."""
        return len(self.drifts)

    def step_matrix(self, z: Array | float) -> Matrix:
        """Entries (xx, xv, vx, vv) of a step's matrix for (x, v/omega), z = dt * omega."""
        one, nil = np.ones_like(z, dtype=float), np.zeros_like(z, dtype=float)
        x, v = [one, nil], [nil, one]  # rows: dependence on the initial (x, v)
        for kick, drift in zip(self.kicks, (*self.drifts, 0.0), strict=True):
            v = [b - kick * z * a for a, b in zip(x, v, strict=True)]
            x = [a + drift * z * b for a, b in zip(x, v, strict=True)]
        return *x, *v

    def _excess(self, z: Array) -> Array:
        """Beyond stability if positive: the determinant is 1, the trace must be in [-2, 2]."""
        xx, _, _, vv = self.step_matrix(z)
        return np.abs(xx + vv) - 2


@dataclass(frozen=True)
class Processed(Splitting):
    """A palindrome whose steps are of the order said in other variables only.

    The rows of its processor lead into these variables before the first step; the same rows
    backwards lead out, once wherever the motion is looked at.  A run from one state to another is
    a palindrome as a whole.

    Attributes
    ----------
    entry : (kicks, drifts)
    """

    entry: tuple[tuple[float, ...], tuple[float, ...]]

    def __post_init__(self) -> None:
        super().__post_init__()
        rows = _tuple(f"entry of {self.name!r}", self.entry)
        self._set("entry", tuple(_row(f"entry of {self.name!r}", row) for row in rows))

    def check(self) -> None:
        """Refuse rows as `Splitting` does, and an entry that is no pair of such rows."""
        super().check()
        lengths = [len(row) for row in self.entry]
        self._require(
            len(lengths) == 2 and 2 <= lengths[0] == lengths[1] + 1 <= MOST_STAGES,
            f"rows of {lengths} in the entry must be kicks and drifts, one kick more",
        )

    @cached_property
    def processor(self) -> tuple[Splitting, Splitting]:  # type: ignore[override]
        """Splittings that lead into the variables of the steps, and out."""
        rows = self.entry, tuple(row[::-1] for row in self.entry)
        common = self.name, self.order, self.step
        return tuple(Splitting(*common, *pair) for pair in rows)  # type: ignore[return-value]


@dataclass(frozen=True)
class Corrected(Method):
    """A splitting whose error where contacts open or close is known, and taken off.

    Its kicks are a quadrature of the forces.  Where the overlap of a contact passes zero in a
    step, the closed form of the quadrature's error goes to the two sites as an equal and opposite
    impulse, and the moment of that error as a shift: `derivations.openings`.  Contacts of
    exponents from 1 to 2.5 are treated.

    Attributes
    ----------
    base : Splitting
        Without a processor.
    """

    base: Splitting
    symplectic = reversible = False
    opening_share = 1 / 8

    def __post_init__(self) -> None:
        super().__post_init__()
        check.kind(f"base of {self.name!r}", self.base, Splitting)

    def check(self) -> None:
        """Refuse what the base refuses, and a base in other variables than the scene's."""
        self.base.check()
        self._require(self.base.processor is None, "its base has a processor, must have none")

    @property
    def stages(self) -> int:
        """Force evaluations per step."""
        return self.base.stages

    @property
    def stability_limit(self) -> float:
        """Largest stable dt * omega on the harmonic oscillator."""
        return self.base.stability_limit

    @cached_property
    def rule(self) -> tuple[Array, Array, Array]:
        """The quadrature that a step is: nodes and weights of its kicks over dt, and by how much a
        kick's position is ahead of the motion of a constant acceleration, over that and dt^2."""
        weights = np.array(self.base.kicks)
        nodes = np.concatenate([[0.0], np.cumsum(self.base.drifts)])
        nodes[np.abs(nodes - 1) < EXACT] = 1.0
        since = nodes[:, None] - nodes  # of each kick since each other
        moved = np.tril(since, -1) @ weights
        return nodes, weights, moved - nodes**2 / 2

    def step_matrix(self, z: Array | float) -> Matrix:
        """Entries (xx, xv, vx, vv) of a step's matrix for (x, v/omega), z = dt * omega."""
        return self.base.step_matrix(z)


@dataclass(frozen=True)
class Nystrom(Method):
    """An explicit Runge-Kutta-Nystrom method.

    Stage i evaluates a_i at u + nodes[i] dt v + dt^2 sum_j matrix[i][j] a_j; then
    u += dt v + dt^2 sum positions[j] a_j and v += dt sum velocities[j] a_j.

    Attributes
    ----------
    nodes, positions, velocities : tuple, (stages,)
    matrix : tuple of tuples, (stages, stages)
    """

    nodes: tuple[float, ...]
    matrix: tuple[tuple[float, ...], ...]
    positions: tuple[float, ...]
    velocities: tuple[float, ...]
    symplectic = reversible = False
    _slack = _bisected = GAIN

    def __post_init__(self) -> None:
        super().__post_init__()
        self._set_rows("nodes", "positions", "velocities")
        rows = _tuple(f"matrix of {self.name!r}", self.matrix)
        self._set("matrix", tuple(_row(f"matrix of {self.name!r}", row) for row in rows))

    def check(self) -> None:
        """Refuse rows that are no step of time dt of the order said, or of the kind said."""
        count = self.stages
        shape = {len(self.matrix), len(self.positions), len(self.velocities)}
        self._require(
            shape | {len(row) for row in self.matrix} == {count},
            f"matrix, positions and velocities must have {count} entries a row, as the nodes",
        )
        self._require_stages()
        self._require_sum("sum of the velocities", self.velocities, 1)
        if self.order > 1:
            turned = [a * b for a, b in zip(self.velocities, self.nodes, strict=True)]
            self._require_sum("sum of the positions", self.positions, 0.5)
            self._require_sum("sum of velocities times nodes", turned, 0.5)
        ahead = any(a for i, row in enumerate(self.matrix) for a in row[i:])
        self._require(
            not (self.explicit and ahead),
            "the matrix must be 0 on its diagonal and above for the method to be explicit",
        )

    @property
    def stages(self) -> int:
        """Force evaluations per step."""
        return len(self.nodes)

    def step_matrix(self, z: Array | float) -> Matrix:
        """Entries (xx, xv, vx, vv) of a step's matrix for (x, v/omega), z = dt * omega."""
        entries = []
        for x, v in ((1.0, 0.0), (0.0, 1.0)):
            slopes: list[Any] = []
            for node, row in zip(self.nodes, self.matrix, strict=True):
                place = x + node * z * v + sum(a * k for a, k in zip(row, slopes, strict=False))
                slopes.append(-(z**2) * place)
            moved = sum(b * k for b, k in zip(self.positions, slopes, strict=True))
            turned = sum(b * k for b, k in zip(self.velocities, slopes, strict=True))
            entries.append((x + z * v + moved, v + turned / z))
        (xx, vx), (xv, vv) = entries
        return xx, xv, vx, vv

    def _excess(self, z: Array) -> Array:
        """Beyond stability if positive: both eigenvalues are within the unit circle where the
        determinant is at most 1 and the trace at most 1 + determinant, in size."""
        xx, xv, vx, vv = self.step_matrix(z)
        determinant = xx * vv - xv * vx
        return np.maximum(np.abs(determinant) - 1, np.abs(xx + vv) - 1 - determinant)


@dataclass(frozen=True)
class Gauss(Nystrom):
    """Gauss collocation: the Nystrom form with a full matrix, stages solved for."""

    symplectic = reversible = True
    explicit = False
    scale = 1.0
    stability_limit = math.inf

    def step_matrix(self, z: Array | float) -> Matrix:
        """Entries (xx, xv, vx, vv) of a step's matrix for (x, v/omega), z = dt * omega."""
        z = np.asarray(z, dtype=float)
        squared = z[..., None, None] ** 2
        left = np.eye(self.stages) + squared * np.array(self.matrix)
        right = np.stack(np.broadcast_arrays(1.0, z[..., None] * self.nodes), axis=-1)
        places = np.linalg.solve(left, right)  # (..., stages, 2): for x = 1 and v = 1
        moved, turned = (np.array(b) @ places for b in (self.positions, self.velocities))
        xx, xv = 1 - z**2 * moved[..., 0], z - z**2 * moved[..., 1]
        return xx, xv, -z * turned[..., 0], 1 - z * turned[..., 1]


def gauss_rows(stages: int) -> dict[str, Any]:
    """Rows of the Nystrom form of Gauss collocation with that many stages, order 2 stages."""
    import numpy.polynomial.legendre as legendre
    from numpy.polynomial import Polynomial

    nodes, weights = legendre.leggauss(stages)
    nodes, weights = (1 + nodes) / 2, weights / 2
    matrix = np.empty((stages, stages))
    for j, node in enumerate(nodes):
        others = np.delete(nodes, j)
        basis = Polynomial.fromroots(others) / np.prod(node - others)
        matrix[:, j] = basis.integ()(nodes)
    return nystrom_of(matrix, weights)


def nystrom_of(matrix: Rows, weights: Iterable[Any]) -> dict[str, Any]:
    """Rows of the Nystrom form of a Runge-Kutta method, on (u, v)' = (v, a(u)).

    Its stages' velocities are v + dt sum_j matrix[i][j] a_j; put into the stages' positions they
    leave the square of the matrix, and likewise in the sum.
    """
    a, b = np.array(matrix, dtype=object), np.array(weights, dtype=object)
    return {
        "nodes": tuple(map(float, a.sum(axis=1))),
        "matrix": tuple(tuple(map(float, row)) for row in a @ a),
        "positions": tuple(map(float, b @ a)),
        "velocities": tuple(map(float, b)),
    }


def palindrome(half: tuple[float, ...], odd: bool) -> tuple[float, ...]:
    """A full row of an odd or even number of entries, from its first half without the last
    entry of it, which makes the sum 1."""
    half = (*half, 1 - 2 * sum(half) if odd else 0.5 - sum(half))
    return half + half[-2::-1] if odd else half + half[::-1]


def _tuple(name: str, values: Any) -> tuple[Any, ...]:
    if isinstance(values, (str, bytes)) or not isinstance(values, Iterable):
        raise TensegrityError(f"{name} {check.shown(values)} must be a sequence")
    return tuple(values)


def _row(name: str, values: Any) -> tuple[float, ...]:
    """Coefficients as plain floats."""
    return tuple(check.number(name, value) for value in _tuple(name, values))


def _mirrors(row: Sequence[float]) -> bool:
    return all(abs(a - b) <= EXACT for a, b in zip(row, row[::-1], strict=True))


_BLANES_MOAN_KICKS = palindrome(
    (
        0.041464998518262400,
        0.198128671918067,
        -0.0400061921041533,
        0.0752539843015807,
        -0.0115113874206879,
    ),
    odd=False,
)
_BLANES_MOAN_DRIFTS = palindrome(
    (
        0.123229775946271,
        0.290553797799558,
        -0.127049212625417,
        -0.246331761062075,
        0.357208872795928,
    ),
    odd=True,
)


def there_and_back(
    kicks: tuple[float, ...], drifts: tuple[float, ...]
) -> tuple[tuple[float, ...], tuple[float, ...]]:
    """Rows of a step followed by the same step with its time reversed in sign."""
    back = (-kick for kick in kicks[1:])
    return (*kicks[:-1], kicks[-1] - kicks[0], *back), (*drifts, *(-drift for drift in drifts))


_KERNEL_KICKS = palindrome(
    (
        0.11622889655878751,
        0.16411612123409744,
        0.2010987789763164,
        -0.03731535289759017,
    ),
    odd=True,
)
_KERNEL_DRIFTS = palindrome(
    (
        0.2001071043568385,
        0.17607573745201222,
        0.2954944223860612,
    ),
    odd=False,
)
_ENTRY = there_and_back(
    kicks=(
        0.3846400304648697,
        -0.43605479986672124,
        0.07565091778891464,
        -0.011614836506709629,
        0.14963336163881982,
        -0.0012439736569434608,
        -0.16101069986223182,
    ),
    drifts=(
        0.014784495484724299,
        -0.0946213058154778,
        -0.20440295053226323,
        0.3641786132389647,
        0.4904231911847777,
        -0.5703620435607111,
    ),
)

_HALF, _SIXTH = Fraction(1, 2), Fraction(1, 6)
_CLASSICAL = ((0, 0, 0, 0), (_HALF, 0, 0, 0), (0, _HALF, 0, 0), (0, 0, 1, 0))
_CLASSICAL_WEIGHTS = (_SIXTH, 2 * _SIXTH, 2 * _SIXTH, _SIXTH)

_RKN6 = Splitting(
    name="rkn6",
    order=6,
    kicks=_BLANES_MOAN_KICKS,
    drifts=_BLANES_MOAN_DRIFTS,
    step=0.15,
    reference="S. Blanes, P. C. Moan, J. Comput. Appl. Math. 142, 313 (2002), SRKN 11b",
    when_not="springs whose stiffness jumps (opening contacts): the order falls below 3",
)

METHODS = {
    method.name: method
    for method in (
        Splitting(
            name="verlet",
            order=2,
            kicks=(0.5, 0.5),
            drifts=(1.0,),
            step=0.05,
            reference="L. Verlet, Phys. Rev. 159, 98 (1967)",
            when_not="errors below about 1e-3 are wanted: a method of higher order is cheaper",
        ),
        _RKN6,
        Processed(
            name="processed6",
            order=6,
            kicks=_KERNEL_KICKS,
            drifts=_KERNEL_DRIFTS,
            entry=_ENTRY,
            step=0.15,
            reference="own coefficients; the idea: S. Blanes, F. Casas, J. Ros, SIAM J. Sci. "
            "Comput. 21, 711 (1999)",
            when_not="contacts open, where rkn6 is cheaper; or every step of a long chain is "
            "recorded, since each record costs 12 more evaluations of the forces",
        ),
        Nystrom(
            name="rk4",
            order=4,
            **nystrom_of(_CLASSICAL, _CLASSICAL_WEIGHTS),
            step=0.05,
            reference="W. Kutta, Z. Math. Phys. 46, 435 (1901)",
            when_not="long runs, since it loses energy, or where cost counts: rkn6 is cheaper at "
            "every accuracy; it is here to compare with results that were made with it",
        ),
        Gauss(
            name="gauss4",
            order=4,
            **gauss_rows(2),
            step=0.25,
            reference="E. Hairer, C. Lubich, G. Wanner, Geometric Numerical Integration, II.1.3",
            when_not="motions at the highest frequency matter, or networks: a step costs some 100 "
            "evaluations of the forces, in NumPy; it is here for few bonds far stiffer than the "
            "rest, whose vibrations are not excited",
        ),
        Corrected(
            name="corrected6",
            order=6,
            base=_RKN6,
            step=0.15,
            reference="rkn6 and own corrections; the idea: I. Navot, J. Math. Phys. 40, 271 (1961)",
            when_not="no contact opens: steps are those of rkn6, which is reversible in time to "
            "round-off and symplectic.  Corrections are neither: run backwards, it comes back "
            "where it began to its error only",
        ),
    )
}


def find(method: str | Method) -> Method:
    """The method of that name, or the one given, if its rows can be run."""
    if isinstance(method, str) and method in METHODS:
        return METHODS[method]
    if not isinstance(method, (Splitting, Corrected, Nystrom)):
        raise TensegrityError(
            f"method {check.shown(method)} is not one of {', '.join(METHODS)}, nor a Splitting, a "
            "Corrected or a Nystrom of tensegrity.engine.methods"
        )
    method.check()
    return method


def default(dt: float | None, tol: float | None, smooth: bool, opens: bool = False) -> str:
    """Name of the method used where none is asked for.

    `smooth` where no contact can open; `opens` where one can whose opening is corrected.
    """
    if dt is not None or (tol is not None and tol > ROUGH):
        return "verlet"
    if opens:
        return "corrected6"
    return "processed6" if tol is not None and smooth else "rkn6"
