"""Bonds whose energy is a function of all coordinates of both ends, V(q_i, q_j), as users write it.

Sites may have displacements, rotations or other coordinates, each with an inertia of its own.  A
coordinate on whose difference q_j - q_i alone the energy depends is free: it has momentum and a
branch of waves that begins at 0.  The energy W(q) of a site is shared by its bonds.
"""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from copy import copy
from typing import TYPE_CHECKING, Any

import numpy as np

from tensegrity import check
from tensegrity.engine.law import is_piecewise
from tensegrity.engine.pair import PairForms
from tensegrity.errors import TensegrityError
from tensegrity.printing import number_text
from tensegrity.readonly import fixed
from tensegrity.springs.potential import Potential
from tensegrity.springs.written import valued

if TYPE_CHECKING:
    import sympy as sp

    from tensegrity.typing import Array

MOST = 3  # coordinates of a site
POINTS = {1: 129, 2: 33, 3: 13, 4: 7, 5: 5, 6: 4}  # of a box each way, by its dimensions
BALANCED = 1e-9  # gradient at rest over the largest second derivative, per unit of a coordinate
TRIALS, AROUND = 4, 0.1  # places at which energies are compared, and their distance from rest
DIGITS, FREE = 40, 1e-30  # of their values, and relative differences that are round-off
ENDS = ("the energy is not a number",) * 2


class PairLaw(Potential):
    """The energy V(q_i, q_j) of a bond between sites of one to three coordinates.

    Parameters
    ----------
    energy : sympy.Expr
        V [J], smooth.
    first, second : sequence of sympy.Symbol, (dim,)
        Coordinates of the two ends: of the site of lower number, and of the other one.
    parameters : dict of str or sympy.Symbol to float, optional
        Values of the other symbols; `gradient(...).by` differentiates by these.
    site : sympy.Expr, optional
        Energy W of each site [J], written in the symbols of `first`; its bonds share it.
    rest : dict of sympy.Symbol to float, optional
        Values of coordinates at rest, 0 by default.  Displacements are measured from there.

    Raises
    ------
    TensegrityError
        Arguments that are not as described; a symbol without value; a coordinate that no energy
        contains; an energy that is not smooth, not a number at rest, or has a gradient there.

    Notes
    -----
    `Chain(pair, sites, mass=(m, J))` joins sites in a row, and `Network` in any pattern;
    displacements then have the shape (sites, dim).  Instead of elongations a run notes the ranges
    of the differences of free coordinates and of the values of others, over which the stiffness is
    bounded by its values at points of a grid.

    Examples
    --------
    Squares on hinges in a row, of elongation, shear and bending:

    >>> import sympy as sp
    >>> from tensegrity import Chain, PairLaw, simulate
    >>> (u, a), (U, A) = first, second = sp.symbols("u a"), sp.symbols("U A")
    >>> stretch = U - u + 2 - sp.cos(a) - sp.cos(A)
    >>> shear, bend = sp.sin(A) - sp.sin(a), A + a
    >>> energy = (stretch**2 + sp.Symbol("k") * shear**2 + bend**2) / 2
    >>> pair = PairLaw(energy, first, second, {"k": 0.5})
    >>> pair.free
    (True, False)
    >>> chain = Chain(pair, sites=10, mass=(1.0, 0.2))
    >>> run = simulate(chain, chain.at_rest({0: (0.1, 0.0)}), t_end=10.0, tol=1e-8)
    >>> run.u.shape[1:], chain.momentum(run.final).round(9)
    ((10, 2), array([0.1]))
    """

    law: Any
    of_prism: dict[str, Any] | None = None  # what that of a prism is made of
    _inner: tuple[Any, ...] = ()  # unknowns in equilibrium

    def __init__(
        self,
        energy: sp.Expr,
        first: Sequence[sp.Symbol],
        second: Sequence[sp.Symbol],
        parameters: Mapping[Any, float] | None = None,
        site: sp.Expr | float = 0,
        rest: Mapping[Any, float] | None = None,
    ) -> None:
        first, second = (_symbols(*x) for x in (("first", first), ("second", second)))
        if len(first) != len(second) or {*first} & {*second}:
            raise TensegrityError(
                f"first {first} and second {second} must be as many symbols, all different"
            )
        unknown = {*first, *second, *self._inner}
        shapes, symbols, values, numbers = valued([energy, site], unknown, parameters)
        (bond, of_site), parts = shapes, ()
        if {*second} & of_site.free_symbols:
            raise TensegrityError(f"site {site} must be written in the symbols {first} of `first`")
        for name, one in (("energy", bond), ("site", of_site)):
            if is_piecewise(one):
                raise TensegrityError(f"{name} {one} must be smooth")
        at = _rest(rest, (*first, *second))
        known = dict(zip(symbols, values, strict=True))
        for one, other in zip(first, second, strict=True):
            if not {one, other} & (bond.free_symbols | of_site.free_symbols):
                raise TensegrityError(f"coordinate {one} occurs in no energy")
        ends = list(zip(first, second, strict=True))
        free = _shift_free(shapes, dict.fromkeys(unknown, 0.0) | at | known, ends)
        whole = bond
        if not of_site.is_zero:
            parts = _fractions()
            whole = bond + parts[0] * of_site
            whole += parts[1] * of_site.xreplace(dict(zip(first, second, strict=True)))
        whole, moved, places = _from_rest(whole, at)
        law: Any = PairForms(whole, first, second, (*symbols, *moved, *parts), free, self._inner)
        values = [*values, *places, *(1.0 for _ in parts)]
        self._set(law, values, None, (-math.inf, math.inf), ENDS)
        self._numbers = (*numbers, *places, *(1 for _ in parts))
        self._written = energy, first, second, site, rest or {}
        _refuse_unbalanced(self)

    def sound_speed(self, mass: float = 1.0) -> float:
        """Refused: there is one speed for each free coordinate, see `dispersion`."""
        raise TensegrityError("a pair law has no sound speed of its own: see `dispersion`")

    def over_time(self, **arguments: Any) -> Potential:
        """Refused: pair laws do not change with time."""
        raise TensegrityError("a pair law does not change with time")

    def to_c(self, path: Any) -> Any:
        """Refused: only laws of one elongation are written as C."""
        raise TensegrityError("a pair law is no function of one elongation, as files of C hold")

    @property
    def coordinates(self) -> tuple[str, ...]:
        """Names of the coordinates of a site, those of `first`."""
        return tuple(map(str, self.law.first))

    @property
    def free(self) -> tuple[bool, ...]:
        """Whether the energy depends on the difference of a coordinate alone; (dim,)."""
        return tuple(self.law.free)

    def shared(self, one: float, other: float) -> PairLaw:
        """The same bond with other parts of the energies of its two sites.

        Parameters
        ----------
        one, other : float
            Parts of the first and the second site.

        Returns
        -------
        PairLaw
        """
        if self.law.parameters[-2:] != _fractions():
            return self
        made = copy(self)
        made.__dict__.pop("_hash", None)
        made.values = fixed(np.array([*self.values[:-2], one, other]))
        return made

    def evaluate(self, kind: str, first: Array, second: Array) -> list[Array]:
        """Results of a function of `PairForms.functions`.

        Parameters
        ----------
        kind : str
            Its key.
        first, second : ndarray, (states, dim)
            Displacements of both ends.

        Returns
        -------
        list of ndarray, (states, size)
        """
        function = self.law.functions()[kind]
        given = first.T, second.T, np.tile(self.values[:, None], len(first))
        outputs = function.map(len(first)).call(given)
        return [np.array(x).ravel(order="F").reshape(len(first), -1) for x in outputs]

    def tangent(self, first: Array, second: Array) -> Array:
        """Second derivatives of the energy by the coordinates of both ends.

        Parameters
        ----------
        first, second : ndarray, (states, dim)
            Displacements of both ends.

        Returns
        -------
        ndarray, (states, 2 dim, 2 dim)
        """
        (found,) = self.evaluate("tangent", first, second)
        return found.reshape(len(first), 2 * self.law.dim, -1)

    def largest_stiffness(self, box: Array, weights: Array) -> float:
        """Largest eigenvalue of M^-1/2 V'' M^-1/2 at points of a box [1/s^2].

        Parameters
        ----------
        box : ndarray, (dim, 2)
            Smallest and largest difference of free coordinates, and value of others.
        weights : ndarray, (dim,)
            Inverse inertias.

        Returns
        -------
        float
            At least 0, of points where the energy is a number.
        """
        rows = [k for k, free in enumerate(self.free) for _ in range(1 if free else 2)]
        points = POINTS[len(rows)]
        lines = np.linspace(box[:, 0], box[:, 1], points)
        grid = np.meshgrid(*(np.append(lines[:, k], 0.0) for k in rows))
        values, ends = iter(x.ravel() for x in grid), np.zeros((2, self.law.dim, grid[0].size))
        for k, free in enumerate(self.free):
            if not free:
                ends[0, k] = next(values)
            ends[1, k] = next(values)
        root = np.sqrt(np.tile(weights, 2))
        blocks = self.tangent(*ends.swapaxes(1, 2)) * root[:, None] * root
        blocks = blocks[np.isfinite(blocks).all(axis=(1, 2))]
        return max(float(np.linalg.eigvalsh(blocks)[:, -1].max(initial=0.0)), 0.0)

    def reachable(self, energy: float) -> Array:
        """Values of each coordinate, and differences of it, that take less than an energy [J] while
        all others rest; (dim, 2), 0 where there is no end."""
        dim, sizes = self.law.dim, np.concatenate([[0.0], np.geomspace(1e-12, 1e3, 500)])
        box = np.zeros((dim, 2))
        for k in range(dim):
            for side, sign in enumerate((-1, 1)):
                for one, other in ((0, 1), (1, 0), (1, 1))[: 1 if self.free[k] else 3]:
                    ends = np.zeros((2, len(sizes), dim))
                    ends[0, :, k], ends[1, :, k] = one * sign * sizes, other * sign * sizes
                    with np.errstate(all="ignore"):
                        beyond = ~(self.evaluate("pair", *ends)[0][:, 0] <= energy)
                    if beyond.any():
                        reached = sign * sizes[np.argmax(beyond)]
                        box[k, side] = (max if sign > 0 else min)(box[k, side], reached)
        return box

    def __repr__(self) -> str:
        if self._origin:
            return self._origin
        energy, first, second, site, rest = self._written
        given = {name: float(number_text(value)) for name, value in self.parameters.items()}
        more = "".join(f", {name}={x}" for name, x in (("site", site), ("rest", rest)) if x)
        return f"PairLaw({energy}, {first}, {second}, {given}{more})"


def pair_of_law(law: Any, values: Sequence[float], of_prism: dict[str, Any]) -> PairLaw:
    """The pair law of a prism.

    Parameters
    ----------
    law : PairForms
    values : sequence of float
        Of its parameters, of which gradients have the first.
    of_prism : dict
        What it is made of.

    Returns
    -------
    PairLaw
    """
    made = PairLaw.__new__(PairLaw)
    made._set(law, values, None, (-math.inf, math.inf), ENDS)
    made._numbers, made.of_prism = tuple(values[1:]), of_prism
    made._origin = f"plate_law({', '.join(f'{name}={x!r}' for name, x in of_prism.items())})"
    return made


def pair_with_inner(
    energy: Any, first: Any, second: Any, parameters: dict[Any, float], inner: Sequence[Any]
) -> PairLaw:
    """A pair law of which some unknowns, 0 at rest, are in equilibrium.

    Parameters
    ----------
    energy, first, second, parameters
        As of `PairLaw`.
    inner : sequence of sympy.Symbol
        These unknowns.

    Returns
    -------
    PairLaw
    """
    made = PairLaw.__new__(PairLaw)
    made._inner = tuple(inner)
    made.__init__(energy, first, second, parameters)  # type: ignore[misc]
    return made


def _symbols(name: str, given: Any) -> tuple[Any, ...]:
    import sympy as sp

    symbols = (given,) if isinstance(given, sp.Symbol) else check.sequence(name, given, "symbols")
    for symbol in symbols:
        if not isinstance(symbol, sp.Symbol):
            raise TensegrityError(f"{name} {check.shown(symbol)} is not a SymPy symbol")
    if not 1 <= len(symbols) <= MOST:
        raise TensegrityError(f"{name} has {len(symbols)} coordinates, must have 1 to {MOST}")
    if len({*symbols}) < len(symbols):
        raise TensegrityError(f"{name} {tuple(symbols)} must be different symbols")
    return tuple(symbols)


def _rest(rest: Any, coordinates: tuple[Any, ...]) -> dict[Any, float]:
    """Values of coordinates at rest other than 0."""
    if rest is not None and not isinstance(rest, Mapping):
        raise TensegrityError(f"rest {check.shown(rest)} must be a dict of coordinates")
    names = {str(x): x for x in coordinates}
    given = {str(key): check.number(f"rest of {key}", x) for key, x in (rest or {}).items()}
    unknown = [name for name in given if name not in names]
    if unknown:
        raise TensegrityError(f"rest {unknown[0]!r} is not one of the coordinates {coordinates}")
    return {names[name]: value for name, value in given.items() if value}


def _constant(name: str) -> Any:
    from tensegrity.engine.shape import Constant  # imports SymPy

    return Constant(name, real=True)


def _fractions() -> tuple[Any, Any]:
    """Symbols for the fractions of the energies of its two sites that a bond has."""
    return _constant("fraction of the first site"), _constant("fraction of the second site")


def _from_rest(energy: Any, at: dict[Any, float]) -> tuple[Any, tuple[Any, ...], list[float]]:
    """An energy in the changes of the coordinates from rest, with symbols for what they are there,
    and their values."""
    places = {x: _constant(f"rest of {x}") for x in at}
    moved = energy.xreplace({x: x + place for x, place in places.items()})
    return moved, tuple(places.values()), list(at.values())


def _shift_free(energies: Sequence[Any], at: Mapping[Any, float], pairs: Any) -> tuple[bool, ...]:
    """Whether equal changes of both symbols of a pair leave all energies as they are: to many
    digits, at places near rest, as formulas need not simplify."""
    import mpmath
    import sympy as sp

    generator, symbols = np.random.default_rng(0), list(at)
    whole: Any = sp.lambdify(symbols, energies, modules="mpmath", cse=True)
    near = {x: AROUND * generator.uniform(-1, 1, TRIALS) for pair in pairs for x in pair}
    free = [True] * len(pairs)
    with mpmath.workdps(DIGITS):
        for trial in range(TRIALS):
            place = {x: mpmath.mpf(at[x]) + (near[x][trial] if x in near else 0) for x in at}
            for k, pair in enumerate(pairs):
                moved = place | {x: place[x] + AROUND for x in pair}
                try:
                    both = zip(*(whole(*x.values()) for x in (place, moved)), strict=True)
                    free[k] &= all(abs(x - y) <= FREE * abs(x) for x, y in both)
                except (ArithmeticError, TypeError, ValueError):  # no number there
                    free[k] = False
                except Exception as error:  # SymPy's printer raises many kinds of errors
                    raise TensegrityError(f"energy cannot be evaluated: {error}") from error
    return tuple(free)


def _refuse_unbalanced(pair: PairLaw) -> None:
    """Refuse energies that are no number or have a gradient at rest."""
    rest = np.zeros((2, 1, pair.law.dim))
    (energy, gradient), (tangent,) = pair.evaluate("pair", *rest), pair.tangent(*rest)
    if not (np.isfinite(energy).all() and np.isfinite(gradient).all()):
        raise TensegrityError(f"energy of {check.shown(pair)} is not a finite number at rest")
    allowed = BALANCED * float(np.abs(tangent).max())
    for symbol, slope in zip((*pair.law.first, *pair.law.second), gradient[0], strict=True):
        if abs(slope) > allowed:
            raise TensegrityError(
                f"energy has the gradient {slope:g} in {symbol} at rest, which no load balances: "
                f"must be at most {allowed:g}"
            )
