"""Kinds of methods: rows of coefficients, and the properties that follow from them alone.

The methods themselves are in `tensegrity.engine.methods`.
"""

from __future__ import annotations

import math
from collections.abc import Iterable
from dataclasses import dataclass, field
from functools import cached_property
from typing import TYPE_CHECKING, ClassVar

import numpy as np

from tensegrity import check
from tensegrity.engine.disk_cache import cached
from tensegrity.engine.openings import TREATED, is_treated
from tensegrity.errors import TensegrityError
from tensegrity.printing import filled

if TYPE_CHECKING:
    from collections.abc import Sequence
    from typing import Any

    from tensegrity.typing import Array

    Matrix = tuple[Array, Array, Array, Array]  # xx, xv, vx, vv
    Rows = Iterable[Iterable[Any]]

ROUND_OFF = 1e-9  # in the trace of a step's matrix, beyond the bound of a stable one
GAIN = 1e-12  # in the amplification of a step, beyond 1
KINKED = 1 / 16  # fraction of a default step where a kink of the force lowers the order
ENERGY_ERROR = 2e-9  # relative error of the energy at which default steps aim at kinks
# Largest error of the energy in hundreds of random rows of 2 to 39 contacts, for the exponent 1 and
# for steeper ones, which have so many decades less per unit of the exponent.
LINEAR, STEEPEST, DECADES = 5e-6, 2.7e-5, 3.6
EXACT = 1e-12  # in the sums of coefficients, and between mirrored coefficients
MOST_STAGES = 250  # the width of the overlap of the parts of a long chain


@dataclass(frozen=True)
class Method:
    """Base of all methods.

    `simulate` takes any `Splitting` or `Nystrom`, also one that `METHODS` does not list.

    Attributes
    ----------
    name : str
    order : int
        Global error ~ dt^order on smooth springs.
    default_fraction : float
        Default dt over the stability limit, or over 1/omega where there is none.
    reference : str, optional
    limitations : str, optional
        Where another method is better.
    preserves : str
        Properties that remain in scenes that are driven, damped or change.
    """

    name: str
    order: int
    default_fraction: float
    reference: str = field(default="", kw_only=True)
    limitations: str = field(default="", kw_only=True)

    explicit = True
    reversible = True
    preserves: ClassVar[str] = "not for scenes that are driven, damped or change"
    if TYPE_CHECKING:  # defined by each kind of method
        symplectic: ClassVar[bool]
        _slack: ClassVar[float]
        _bisected: ClassVar[float]

        @property
        def stages(self) -> int: ...
        def step_matrix(self, z: Array | float) -> Matrix: ...
        def _excess(self, z: Array) -> Array: ...

    def __post_init__(self) -> None:
        for name in ("name", "reference", "limitations"):
            check.kind(f"{name} of a method", getattr(self, name), str)
        self._set("order", check.whole(f"order of {self.name!r}", self.order, least=1))
        self._set(
            "default_fraction",
            check.number(f"default_fraction of {self.name!r}", self.default_fraction, above=0),
        )

    def fraction(self, exponents: Iterable[float] = ()) -> float:
        """Default dt over the stability limit, or over 1/omega where there is none, for forces that
        grow from kinks with these exponents."""
        return self.default_fraction * min((self._kinked(n) for n in exponents), default=1.0)

    def __str__(self) -> str:
        limit = f"{self.stages} force evaluations per step, stable to dt omega = "
        parts = [f"{self.name}: order {self.order}, {limit}{self.stability_limit:.6g}"]
        parts += [f"  {words}" for words in (self.reference, self.limitations) if words]
        return filled("\n".join(parts))

    def _kinked(self, exponent: float) -> float:
        """Factor of the default step for a kink of this exponent, < 1 if it lowers the order."""
        return 1.0 if exponent + 1 >= self.order else KINKED

    def _set(self, name: str, value: Any) -> None:
        object.__setattr__(self, name, value)

    def _set_rows(self, *names: str) -> None:
        for name in names:
            self._set(name, row_of(f"{name} of {self.name!r}", getattr(self, name)))

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
        """The value of dt * omega of which `default_fraction` is a fraction."""
        return self.stability_limit

    @cached_property
    def stability_limit(self) -> float:
        """Largest stable dt * omega on the harmonic oscillator, found from the coefficients."""
        return cached(("stability limit", repr(self)), self._stability_limit)

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

    >>> from tensegrity import Chain, Prism, Splitting, simulate
    >>> a = 1 / (4 - 4 ** (1 / 3))
    >>> parts = (a, a, 1 - 4 * a, a, a)
    >>> kicks = [(x + y) / 2 for x, y in zip((0, *parts), (*parts, 0))]
    >>> suzuki = Splitting("suzuki4", order=4, default_fraction=0.1, kicks=kicks, drifts=parts)
    >>> chain = Chain(Prism(1.0, 0.7, 0.01, 1.0).potential(), 20)
    >>> simulate(chain, chain.at_rest({0: 0.01}), 5.0, method=suzuki).method
    'suzuki4'
    """

    kicks: tuple[float, ...]
    drifts: tuple[float, ...]
    symplectic = True
    preserves = (
        "its order under drives, springs that change, and dashpots, which drifts solve exactly, "
        "or to that order where damped bonds of a network turn; it is symplectic, with time as an "
        "additional coordinate, if there are no dashpots; with dashpots phase-space volume shrinks "
        "at the exact rate, or at that rate to its order.  Drifts backwards in time let velocities "
        "grow: dt times the largest drift and the fastest decay must be at most 2"
    )
    _slack, _bisected = ROUND_OFF, 0.0

    def __post_init__(self) -> None:
        super().__post_init__()
        self._set_rows("kicks", "drifts")

    def check(self) -> None:
        """Refuse rows that are not consistent with a step dt, or not palindromes."""
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
                mirrors(kicks) and mirrors(drifts),
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
        """Positive beyond stability: the determinant is 1, the trace must be in [-2, 2]."""
        xx, _, _, vv = self.step_matrix(z)
        return np.abs(xx + vv) - 2


@dataclass(frozen=True)
class Corrected(Method):
    """A splitting corrected for the known error of its quadrature at the loss or gain of contacts.

    Its kicks are a quadrature of the forces.  Where the overlap of a contact passes zero within a
    step, the closed form of the quadrature error is applied to the two sites as an equal and
    opposite impulse, and the first moment of the error as a shift: `derivations.openings`.
    Contacts and other kinks of exponents from 1 to 3 are treated, any number of them in one force.
    Output states near an event are copies without the correction of later kicks, and with the
    pending one of earlier kicks.

    Attributes
    ----------
    base : Splitting
    """

    base: Splitting
    symplectic = reversible = False

    def __post_init__(self) -> None:
        super().__post_init__()
        check.kind(f"base of {self.name!r}", self.base, Splitting)

    def check(self) -> None:
        """Refuse an invalid base."""
        self.base.check()

    def _kinked(self, exponent: float) -> float:
        """Factor that conserves the energy to `ENERGY_ERROR`, from its error at the full step."""
        if not is_treated(exponent):
            return super()._kinked(exponent)
        error = LINEAR if exponent == 1 else STEEPEST * 10.0 ** (DECADES * (1 - exponent))
        return min((ENERGY_ERROR / error) ** (1 / (exponent + TREATED)), 1.0)

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
        """The quadrature of a step: nodes and weights of its kicks over dt, and the difference of
        a kick's position from the motion at constant acceleration, over that and dt^2."""
        weights = np.array(self.base.kicks)
        nodes = np.concatenate([[0.0], np.cumsum(self.base.drifts)])
        nodes[np.abs(nodes - 1) < EXACT] = 1.0
        since = nodes[:, None] - nodes  # time of each kick after each other kick
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
    rates : tuple of tuples, (stages, stages), optional
        Forces that depend on velocity are evaluated at v + dt sum_j rates[i][j] a_j in stage i;
        without these rows a method does not take such forces.
    """

    nodes: tuple[float, ...]
    matrix: tuple[tuple[float, ...], ...]
    positions: tuple[float, ...]
    velocities: tuple[float, ...]
    rates: tuple[tuple[float, ...], ...] = ()
    symplectic = reversible = False
    _slack = _bisected = GAIN

    def __post_init__(self) -> None:
        super().__post_init__()
        self._set_rows("nodes", "positions", "velocities")
        for name in ("matrix", "rates"):
            words = f"{name} of {self.name!r}"
            rows = check.sequence(words, getattr(self, name), "rows")
            self._set(name, tuple(row_of(words, row) for row in rows))

    def check(self) -> None:
        """Refuse rows that are not consistent with a step dt and the order, or not explicit."""
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
        if self.rates:
            shape = {len(self.rates)} | {len(row) for row in self.rates}
            self._require(shape == {count}, f"rates must have {count} rows of {count} entries")
            for row, node in zip(self.rates, self.nodes, strict=True):
                self._require_sum("sum of a row of the rates", row, node)
        for name in ("matrix", "rates"):
            self._require(
                not any(a for i, row in enumerate(getattr(self, name)) for a in row[i:]),
                f"the {name} must be 0 on its diagonal and above for the method to be explicit",
            )

    @property
    def stages(self) -> int:
        """Force evaluations per step."""
        return len(self.nodes)

    @cached_property
    def decay_limit(self) -> float:
        """Largest stable dt times the rate of a decay, v' = -rate v."""
        a, b = np.array(self.rates), np.array(self.velocities)
        z = np.linspace(0, 2.0 * self.stages, 20_001)[1:, None, None]
        growth = np.linalg.solve(np.eye(len(b)) + z * a, np.ones((len(b), 1)))[..., 0] @ b
        stable = np.abs(1 - z[:, 0, 0] * growth) <= 1
        return float(z[np.argmin(stable) - 1, 0, 0])

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
        """Positive beyond stability: both eigenvalues are within the unit circle where the absolute
        value of the determinant is at most 1, and that of the trace at most 1 + determinant."""
        xx, xv, vx, vv = self.step_matrix(z)
        determinant = xx * vv - xv * vx
        return np.maximum(np.abs(determinant) - 1, np.abs(xx + vv) - 1 - determinant)


@dataclass(frozen=True)
class Midpoint(Method):
    """The implicit midpoint rule: u and v change by their rates at the mean of their values before
    and after the step."""

    symplectic = reversible = True
    explicit = False
    stages = 1
    scale = 1.0
    stability_limit = math.inf

    def check(self) -> None:
        """Nothing to check: there are no coefficients."""

    def step_matrix(self, z: Array | float) -> Matrix:
        """Entries (xx, xv, vx, vv) of a step's matrix for (x, v/omega), z = dt * omega."""
        square = np.asarray(z, dtype=float) ** 2 / 4
        cosine, sine = (1 - square) / (1 + square), z / (1 + square)
        return cosine, sine, -sine, cosine


def nystrom_of(matrix: Rows, weights: Iterable[Any]) -> dict[str, Any]:
    """Rows of the Nystrom form of a Runge-Kutta method, on (u, v)' = (v, a(u)).

    The velocities of its stages, v + dt sum_j matrix[i][j] a_j, substituted into the positions of
    the stages, give the square of the matrix; those of the step follow in the same way.
    """
    rows, b = [tuple(row) for row in matrix], np.array(weights, dtype=object)
    a = np.array([(*row, *[0] * (len(rows) - len(row))) for row in rows], dtype=object)
    return {
        "nodes": tuple(map(float, a.sum(axis=1))),
        "matrix": tuple(tuple(map(float, row)) for row in a @ a),
        "positions": tuple(map(float, b @ a)),
        "velocities": tuple(map(float, b)),
        "rates": tuple(tuple(map(float, row)) for row in a),
    }


def palindrome(half: tuple[float, ...], odd: bool) -> tuple[float, ...]:
    """A row of an odd or even number of entries, from its first half without the last entry, which
    follows from the sum 1."""
    half = (*half, 1 - 2 * sum(half) if odd else 0.5 - sum(half))
    return half + half[-2::-1] if odd else half + half[::-1]


def row_of(name: str, values: Any) -> tuple[float, ...]:
    """Coefficients as plain floats."""
    return tuple(check.number(name, x) for x in check.sequence(name, values, "numbers"))


def mirrors(row: Sequence[float]) -> bool:
    return all(abs(a - b) <= EXACT for a, b in zip(row, row[::-1], strict=True))
