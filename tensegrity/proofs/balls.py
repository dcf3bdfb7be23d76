"""Springs in ball arithmetic: numbers with bounds on their errors, by Arb (python-flint).

The energy of a spring is evaluated as a program of its operations (`engine.programs`), in balls, in
power series of balls, and in boxes of the complex plane: roots and logarithms that touch a branch
cut, and choices that are not certain in a box, give no number there.  An energy that is a number in
boxes that cover a disc is analytic in it, and Cauchy's bounds hold for its Taylor coefficients.
Source: F. Johansson, IEEE Trans. Comput. 66, 1281 (2017) (Arb).
"""

from __future__ import annotations

import math
import threading
from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import dataclass
from fractions import Fraction
from functools import cached_property
from types import SimpleNamespace
from typing import TYPE_CHECKING, Any

import numpy as np

from tensegrity import check
from tensegrity.engine.programs import program, run
from tensegrity.errors import TensegrityError
from tensegrity.once import once
from tensegrity.prisms.closed import rigid_law, rigid_parameters
from tensegrity.springs.provenance import provenance

if TYPE_CHECKING:
    from tensegrity.springs.potential import Potential

BITS = 128  # of the precision of balls, unless more is asked for
HALVINGS = 7  # of the boxes that cover a disc
DYADIC = 20  # bits of their size, so that all their corners are exact
_ONE_THREAD = threading.RLock()


def flint() -> Any:
    """The module flint, or an error that says how to install it."""
    return check.package("flint", "a proof", "prove")


@contextmanager
def precision(bits: int, terms: int = 2) -> Iterator[None]:
    """Balls of so many bits, and power series of so many terms; in one thread at a time, as both
    are settings of the whole process."""
    with _ONE_THREAD:
        context = flint().ctx
        before = context.prec, context.cap
        context.prec, context.cap = bits, terms
        try:
            yield
        finally:
            context.prec, context.cap = before


def ball(text: str) -> Any:
    """The exact number of a text such as 7/10."""
    exact = Fraction(text)
    return flint().fmpq(exact.numerator, exact.denominator)


def fraction(value: float, read: str) -> Fraction:
    """The number that a float stands for: its shortest decimal form, or its binary value."""
    return Fraction(repr(float(value))) if read == "decimals" else Fraction(float(value))


@dataclass(frozen=True)
class Enclosure:
    """A number that lies within a radius of another.

    Attributes
    ----------
    mid : str
        Decimals.
    radius : float
        A bound.
    """

    mid: str
    radius: float

    @classmethod
    def of(cls, value: Any) -> Enclosure:
        """That of a ball, whose middle is rounded to the digits it has."""
        digits = max(3, int(value.rel_accuracy_bits() * math.log10(2)))
        mid = value.mid().str(digits, radius=False)
        return cls(mid, above((value - ball(str(Fraction(mid)))).abs_upper()))

    def __float__(self) -> float:
        return float(self.mid)

    def contains(self, value: str | float | Fraction) -> bool:
        """Whether a number, such as a text of decimals, lies within."""
        return abs(Fraction(value) - Fraction(self.mid)) <= Fraction(self.radius)

    def __str__(self) -> str:
        return f"{self.mid} +- {self.radius:.2g}"


def above(bound: Any) -> float:
    """A float that is not below a bound."""
    return float(np.nextafter(float(bound), math.inf)) if bound.is_finite() else math.inf


class Balls:
    """The context of `programs.run` whose numbers are fractions, balls, series and boxes."""

    def __init__(self) -> None:
        self._flint = flint()

    def mpf(self, x: Any) -> Any:
        """A number without error, or inf; a ball remains what it is."""
        if isinstance(x, (self._flint.arb, self._flint.fmpq)):
            return x
        if not math.isfinite(x):
            return self._flint.arb(str(x))
        return ball(str(Fraction(x)))

    @property
    def pi(self) -> Any:
        return self._flint.arb.pi()

    def _ball(self, x: Any) -> Any:
        return self._flint.arb(x) if isinstance(x, (int, self._flint.fmpq)) else x

    def _cut(self, name: str, x: Any, *others: Any) -> Any:
        """A function with a branch cut along the axis below 0."""
        known = {"analytic": True} if isinstance(x, self._flint.acb) else {}
        return getattr(self._ball(x), name)(*others, **known)

    def sqrt(self, x: Any) -> Any:
        return self._cut("sqrt", x)

    def log(self, x: Any) -> Any:
        return self._cut("log", x)

    def raised(self, x: Any, power: Any) -> Any:
        if isinstance(power, int):
            return self._ball(x) ** power
        return (
            self._cut("pow", x, power) if isinstance(x, self._flint.acb) else self._ball(x) ** power
        )

    def exp(self, x: Any) -> Any:
        return self._ball(x).exp()

    def sin(self, x: Any) -> Any:
        return self._ball(x).sin()

    def cos(self, x: Any) -> Any:
        return self._ball(x).cos()

    def tan(self, x: Any) -> Any:
        return self._ball(x).tan()

    def acos(self, x: Any) -> Any:
        return self._inside("acos", x, lambda z: z.imag, lambda z: z.real)

    def asin(self, x: Any) -> Any:
        return self._inside("asin", x, lambda z: z.imag, lambda z: z.real)

    def atan(self, x: Any) -> Any:
        return self._inside("atan", x, lambda z: z.real, lambda z: z.imag)

    def _inside(self, name: str, x: Any, across: Any, along: Any) -> Any:
        """A function with branch cuts beyond -1 and 1 along an axis."""
        of_box = isinstance(x, self._flint.acb)
        if of_box and not (abs(along(x)) < 1 or not across(x).contains(0)):
            return x * math.nan
        return getattr(self._ball(x), name)()

    def _sign(self, x: Any) -> int:
        """The sign of a number, of its real part in a box, or 0 where it is not certain."""
        of = self._flint
        x = x[0] if isinstance(x, (of.arb_series, of.acb_series)) else x
        x = x.real if isinstance(x, of.acb) else x
        return 1 if x > 0 else -1 if x < 0 else 0

    def _chosen(self, sign: int, above: Any, below: Any) -> Any:
        return above if sign > 0 else below if sign < 0 else self._ball(above) * math.nan

    def maximum(self, x: Any, y: Any) -> Any:
        return self._chosen(self._sign(x - y), x, y)

    def minimum(self, x: Any, y: Any) -> Any:
        return self._chosen(self._sign(y - x), x, y)

    def absolute(self, x: Any) -> Any:
        return self._chosen(self._sign(x), x, -x)

    def heaviside(self, x: Any, at_0: Any) -> Any:
        return self._chosen(self._sign(x), 0 * x + 1, 0 * x)


def exact_prism(prism: Any, numbers: list[Any]) -> Any:
    """The numbers of a rigid prism in place of its floats; base, height, prestrain, k_cross."""
    base, height, prestrain, k_cross = numbers
    return SimpleNamespace(
        base=base, height=height, prestrain=prestrain, k_cross=k_cross, k_base=math.inf,
        k_bar=math.inf, sides=prism.sides,
    )  # fmt: skip


@once
def _energy(law: Any) -> dict[str, list[Any]]:
    """The program of the energy of a law, of the elongation and its parameters."""
    energy, r = law.energy, law.elongation
    symbols = {str(x): x for x in energy.free_symbols}
    of = [r, *(symbols.get(str(name), name) for name in law.parameters)]
    try:
        return program([energy], of)
    except TypeError as error:
        raise TensegrityError(f"energy is not analytic: {error}") from None


@dataclass(frozen=True)
class BallSpring:
    """The energy of a spring in balls.

    Attributes
    ----------
    energy : dict
        The program of V [J] in the elongation and the parameters.
    parameters : tuple of fmpq or arb
    source : dict
        The numbers that define them, as texts, for files.
    """

    energy: dict[str, list[Any]]
    parameters: tuple[Any, ...]
    source: dict[str, Any]

    @classmethod
    def of(cls, potential: Potential, read: str) -> BallSpring:
        """That of a potential.

        Parameters
        ----------
        potential : Potential
        read : {"decimals", "double"}
            What its floats stand for; see `fraction`.

        Raises
        ------
        TensegrityError
            Its law is no expression of the elongation, or one that is not analytic.
        """
        law, made = potential.law, provenance(potential)[1]
        if not getattr(law, "is_expression", False):
            raise TensegrityError(
                f"{check.shown(potential)}: its energy is no expression of the elongation, as "
                "inner unknowns are in equilibrium"
            )
        if made:
            prism, preload = made
            numbers = prism.base, prism.height, prism.prestrain, prism.k_cross, prism.sides
            given = (*numbers, potential.length, preload)
            return cls.of_prism([str(fraction(x, read)) for x in map(float, given)])
        texts = [str(fraction(x, read)) for x in potential.values.tolist()]
        return cls.of_program(_energy(law), texts)

    @classmethod
    def of_program(cls, energy: Any, values: list[str]) -> BallSpring:
        """That of a program, and of values of its parameters as texts of fractions."""
        return cls(energy, tuple(map(ball, values)), {"energy": energy, "parameters": values})

    @classmethod
    def of_prism(cls, texts: list[str]) -> BallSpring:
        """That of a rigid prism: of base, height, prestrain, k_cross, sides, loaded height and
        preload as texts of fractions."""
        from tensegrity.prisms.prism import Prism

        *of, sides, height, preload = texts
        exact = [ball(x) for x in of]
        base, h, prestrain, k_cross = (float(Fraction(x)) for x in of)
        prism = Prism(base, h, prestrain, k_cross, sides=int(sides))
        values, _ = rigid_parameters(
            exact_prism(prism, exact), ball(height), ball(preload), Balls()
        )
        law = rigid_law(prism.sides != 3)
        return cls(_energy(law), tuple(values[str(x)] for x in law.parameters), {"prism": texts})

    @cached_property
    def _own(self) -> Balls:
        return Balls()

    def __call__(self, r: Any) -> Any:
        """V at an elongation: a ball, a box or a power series."""
        return run(self.energy, self._own, (r, *self.parameters))[0]

    def series(self, r: Any, terms: int, bits: int = BITS) -> list[Any]:
        """Taylor coefficients of V at an elongation.

        Parameters
        ----------
        r : arb
            [m]
        terms : int
            Their number.
        bits : int, optional
            Of the precision.

        Returns
        -------
        list of arb, (terms,)

        Raises
        ------
        TensegrityError
            An operation loses terms, such as a quotient of two series that begin at 0.
        """
        with precision(bits, terms):
            try:
                found = self(flint().arb_series([r, 1]))
            except ValueError as error:
                raise TensegrityError(f"the energy has no Taylor series: {error}") from error
        if found.prec < terms:
            raise TensegrityError(
                f"the energy has {found.prec} terms of its Taylor series, not {terms}: it divides "
                "by what begins at 0"
            )
        coefficients = found.coeffs()  # those after the last are exactly 0
        return [*coefficients, *[flint().arb(0)] * (terms - len(coefficients))]

    def largest(self, radius: Any) -> Any:
        """A bound on |V| on the disc about r = 0, in which V is analytic [J].

        Parameters
        ----------
        radius : arb
            [m]

        Returns
        -------
        arb or None
            None where the disc has a point at which V may not be analytic.
        """
        arb, acb = flint().arb, flint().acb
        mantissa, exponent = math.frexp(float(radius.abs_upper()) / 2)
        side = math.ldexp(math.floor(mantissa * 2**DYADIC) + 1, exponent - DYADIC)
        boxes = [(x, y, side) for x in (-side, side) for y in (0.0, side)]  # V(z*) = V(z)*
        greatest, halvings = arb(0), 0
        with precision(BITS):
            while boxes:
                open_ = []
                for x, y, half in boxes:
                    least = [max(0.0, abs(x) - half), max(0.0, abs(y) - half)]
                    if arb(least[0]) ** 2 + arb(least[1]) ** 2 > radius**2:
                        continue
                    value = self(acb(arb(x, half), arb(y, half)))
                    size = abs(value) if value.is_finite() else None
                    if size is None:
                        h = half / 2
                        open_ += [
                            (x + a, y + b, h) for a in (-h, h) for b in (-h, h) if y + b + h > 0
                        ]
                    else:
                        greatest = greatest.max(arb(size.abs_upper()))
                boxes, halvings = open_, halvings + 1
                if boxes and halvings > HALVINGS:
                    return None
        return greatest
