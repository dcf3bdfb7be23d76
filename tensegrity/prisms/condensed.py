"""Prisms with elastic bases or bars: potential and stability.

A prism is a unit of which base and twist are in equilibrium at given height.  Its `equations` are
compiled once for all prisms.
"""

from __future__ import annotations

from collections.abc import Hashable, Sequence
from types import SimpleNamespace
from typing import Any

import numpy as np

from tensegrity.engine.compiled import Functions
from tensegrity.once import once
from tensegrity.printing import call
from tensegrity.prisms.equations import kind_of, mixed, numbers, problem, tangent
from tensegrity.typing import Array, Flags, Members
from tensegrity.unit.condensed import CondensedPotential
from tensegrity.unit.forms import Mixed
from tensegrity.unit.law import EXACT, CondensedLaw
from tensegrity.unit.path import few_unstable


def stable(z: Array, p: Sequence[float], rigid_base: bool) -> tuple[Flags, Flags]:
    """Whether equilibria are stable under given load, and under given height.

    Parameters
    ----------
    z : ndarray, (rows, m)
        Unknowns of `equations.problem`.
    p : sequence of float, (6,) or (9,)
        Its parameters; see `equations.numbers`.
    rigid_base : bool
        Whether the bases are rigid, which leaves one unknown less.

    Returns
    -------
    tuple of two ndarrays of bool, (rows,)
        Stability under given load, and under given height.
    """
    matrices = _tangent(rigid_base, len(p) > 6)("tangent", z, p)
    return few_unstable(matrices, 1)  # the tension of the bars


@once
def _tangent(rigid_base: bool, any_sides: bool) -> Functions:
    def make() -> dict[str, Any]:
        return {"tangent": tangent(rigid_base, any_sides)}

    return Functions(("tangent", rigid_base, any_sides), make, flags=EXACT)


TINY = 1e-30  # step of a derivative through the complex plane


class ElasticLaw(CondensedLaw):
    """Law of prisms with elastic members, `of` the arguments of `equations.problem`."""

    name = property(lambda self: f"ElasticLaw({self.of}, {self.steps})")

    def mixed(self) -> Mixed:
        """See `CondensedLaw.mixed`."""
        return mixed(*self.of)

    @property
    def sizes(self) -> tuple[int, int]:
        """See `CondensedLaw.sizes`."""
        rigid_base, any_sides = self.of
        return 9 if any_sides else 6, 3 - rigid_base


class ElasticPotential(CondensedPotential):
    """Potential of a prism with elastic bases or bars; twist and lengths are in equilibrium.

    Parameters
    ----------
    prism : Prism
        `k_base` or `k_bar` must be finite.
    preload : float, optional
        Axial load F0 at rest [N], compression > 0, >= 0.

    Notes
    -----
    The domain ends in compression where the bars meet (twist pi), where the prism is flat (height
    0) or where the equilibrium at given height becomes unstable, and in extension where base
    strings and bars unload (twist 2 pi/n).  The tension is finite at these ends, which belong to
    the domain.  Source: the talk, part III, "Elastic problem".
    """

    _given = "height"

    def __init__(self, prism: Members, preload: float = 0.0) -> None:
        self._made_of = (prism, preload)
        self._prism, self._preload = prism, preload
        self._origin = call(f"{prism!r}.potential", preload=preload)
        self._described, self._base, self._stiffness = repr(prism), prism.base, prism.k_cross
        self._p, self._scale = numbers(prism), np.ones(4 - kind_of(prism)[0])
        self._follow(("contact", "flat", "turn"), ("unloaded",), {}, {})
        if self.ends[0] == self._reason("flat"):
            self._rise[0] = -self._p[0]  # exact by symmetry
        self._measure(prism.height)

    @property
    def _problem(self) -> Any:
        return problem(*kind_of(self._prism))

    def _law(self, steps: int) -> ElasticLaw:
        return ElasticLaw(kind_of(self._prism), steps)

    def _reason(self, end: str) -> str:
        return {
            "contact": "the bars meet (twist pi)",
            "flat": "the prism is flat (height 0)",
            "unloaded": f"base strings and bars are unloaded (twist 2 pi/{self._prism.sides})",
        }[end]

    def _beyond(self, path: Any) -> str:
        where = f"is beyond {path.load[-1]:g} N, the largest axial load of this prism"
        return f"{where} (at height {path.height[-1]:g} m)"

    def _rates_by(self, name: str) -> tuple[Sequence[float], Array]:
        """By the complex-step method."""
        own = vars(self._prism)
        moved: Any = SimpleNamespace(**{x: y + TINY * 1j * (x == name) for x, y in own.items()})
        moved.sides = self._prism.sides
        scales = 1 / moved.base, moved.k_cross * moved.base, (name == "preload") * TINY * 1j
        by_scales, by_p = (np.imag(x) / TINY for x in (scales, numbers(moved)))
        return by_scales.tolist(), by_p

    @property
    def parameters(self) -> dict[str, float]:
        """Values of the prism and the preload, {name: float}."""
        names = ("base", "height", "prestrain", "k_cross", "k_base", "k_bar")
        return {name: getattr(self._prism, name) for name in names} | {"preload": self._preload}

    def _key(self) -> Hashable:
        return self._made_of
