"""Prisms with elastic bases or bars: potential and stability.

The potential eliminates tensions and twist from the `equations` at given height by Newton's
method.  The iteration starts from a traced branch or, in the compiled loop, from polynomials of the
elongation.
"""

from __future__ import annotations

from collections.abc import Hashable, Sequence
from dataclasses import dataclass
from functools import partial
from typing import Any

import numpy as np

from tensegrity.branches.continuation import Settings
from tensegrity.branches.problem import trace
from tensegrity.engine.compiled import Functions
from tensegrity.engine.law import horner
from tensegrity.errors import EquilibriumError
from tensegrity.once import once
from tensegrity.printing import call
from tensegrity.prisms.equations import UNKNOWNS, inner, kind_of, numbers, problem, tangent
from tensegrity.typing import Array, Flags, Members
from tensegrity.unit.condensed import EXACT, GUESS, CondensedPotential

ROUND_OFF = 1e-13


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
    rows, m = z.shape
    matrices = function("tangent", rigid_base, len(p) > 6)(z, p).reshape(rows, m, m)

    matrices = (matrices + matrices.transpose(0, 2, 1)) / 2

    def only_multiplier(part):
        return (np.linalg.eigvalsh(part) < -ROUND_OFF).sum(axis=1) == 1

    by_load = only_multiplier(matrices)
    by_height = by_load.copy()  # of fewer motions not more are unstable
    if not by_load.all():
        by_height[~by_load] = only_multiplier(matrices[~by_load, :-1, :-1])
    return by_load, by_height


@dataclass(frozen=True)
class ElasticLaw:
    """Law of a prism with elastic members, whose inner unknowns take a fixed number of iterations.

    It has neither state nor branches, so that the compiled loop evaluates many bonds at a time.

    Attributes
    ----------
    rigid_base : bool
    steps : int
        Number of Newton iterations, which start from polynomials of the elongation.
    any_sides : bool
        Whether the number of sides is a parameter; otherwise it is three.
    """

    rigid_base: bool
    steps: int
    any_sides: bool = False
    compiled = ("energy",)
    name = property(repr)

    @property
    def parameters(self) -> tuple[str, ...]:
        """Names of scales, state at rest, `numbers` of the prism, interval and coefficients."""
        names = ("per_base", "force", "preload", "rise_at_rest", "energy_at_rest")
        names += ("height", "prestrain", "k_cross/k_base", "k_cross/k_bar", "middle", "per_half")
        unknowns = UNKNOWNS[self.rigid_base : -1]
        names += tuple(f"{name} {k}" for name in unknowns for k in range(GUESS + 1))
        return names + (("sides", "sine", "cosine") if self.any_sides else ())

    @property
    def kind(self) -> tuple[bool, bool]:
        """Arguments of `equations.problem`: `rigid_base` and `any_sides`."""
        return self.rigid_base, self.any_sides

    def guess(self) -> tuple[Any, ...]:
        """Symbols r and p, and expressions of the initial unknowns and the parameters of
        `equations.problem`."""
        import casadi as ca

        r, p = ca.SX.sym("r"), ca.SX.sym("p", len(self.parameters))
        per_base, _, _, at_rest, _, *prism = ca.vertsplit(p)[:9]
        middle, per_half, *coefficients = ca.vertsplit(p)[9:]
        count = len(coefficients) - 3 * self.any_sides
        coefficients, sides = coefficients[:count], coefficients[count:]
        t = (r - middle) * per_half
        rows = range(0, len(coefficients), GUESS + 1)  # at rest, then the slope from there
        guess = [
            coefficients[row] + r * horner(coefficients[row + 1 : row + GUESS + 1], t)
            for row in rows
        ]
        z = ca.vertcat(*guess, at_rest + r * per_base)
        prism = ca.vertcat(*prism, 0, 0, *sides)  # the units of columns are not used here
        return r, p, z, prism

    def forms(self) -> tuple[Any, Any, Sequence[Any]]:
        """Symbols and expressions of the law in CasADi; see `law.Law.forms`."""
        r, p, z, prism = self.guess()
        for _ in range(self.steps):
            z = inner(*self.kind)[0](z, prism)
        per_base, force, preload, energy_at_rest = p[0], p[1], p[2], p[4]
        energy, tension, stiffness, slope = (v(z, prism) for v in inner(*self.kind)[1])
        return r, p, (
            force / per_base * (energy - energy_at_rest) + preload * r,
            force * tension + preload,
            force * per_base * stiffness,
            force * per_base**2 * slope,
        )  # fmt: skip


@once
def function(name: str, rigid_base: bool, any_sides: bool = False) -> Any:
    """A compiled function of the unknowns and the parameters of `equations.problem`.

    Parameters
    ----------
    name : str
        "step", a Newton step at given height; "value_0" to "value_3", the energy and its
        derivatives in the height; "tangent"; or "guess", a function of elongation and parameters of
        an `ElasticLaw`.
    rigid_base, any_sides : bool
        Which equations.

    Returns
    -------
    function
        Compiled when it is first needed.
    """

    def make() -> dict[str, Any]:
        import casadi as ca

        if name == "guess":
            r, p, guess, _ = ElasticLaw(rigid_base, 0, any_sides).guess()
            return {name: ca.Function(name, [r, p], [guess])}
        if name == "tangent":
            matrix = tangent(rigid_base, any_sides)
            symbols = matrix.sx_in()
            return {name: ca.Function(name, symbols, [ca.vec(matrix(*symbols).T)])}
        step, values = inner(rigid_base, any_sides)
        return {name: step if name == "step" else values[int(name[-1])]}

    key = "condensed", name, bool(rigid_base), bool(any_sides)
    return partial(Functions(key, make, flags=EXACT), name)


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

    _length: float
    _domain: Any

    def __init__(self, prism: Members, preload: float = 0.0) -> None:
        self._made_of = (prism, preload)
        self._prism, self._preload = prism, preload
        self._origin = call(f"{prism!r}.potential", preload=preload)
        self._kind = kind_of(prism)
        self._p, self._scale = numbers(prism), np.ones(4 - self._kind[0])
        self._described, self._base, self._stiffness = repr(prism), prism.base, prism.k_cross
        self._at_rest = self._loaded() if preload else self._zero()
        rise, self._nodes, self._rates, end = self._traced()
        self._rise = rise
        base, start = prism.base, self._at_rest[-1]
        self._length = float(prism.height + start * base)
        self._size = max(self._length, prism.height)
        self._domain = tuple(float(x - start) * base for x in (rise[0], rise[-1]))
        self.ends = end, "base strings and bars are unloaded (twist 2 pi/" + f"{prism.sides})"

    def _loaded(self):
        """Unknowns under the preload, on the branch up to its first limit point."""
        of, stop = problem(*self._kind), ("fold", "contact", "flat")
        until = {"load": self._preload}
        branch = trace(of, self._zero(), self._p, direction=-1, stop=stop, until=until)
        if branch.end in stop:
            raise EquilibriumError(
                f"preload {self._preload:g} N is beyond {branch.load[-1]:g} N, the largest axial "
                f"load of this prism (at height {branch.height[-1]:g} m)"
            )
        return branch.z[-1]

    def _zero(self):
        return np.zeros(4 - self._kind[0])

    def _traced(self):
        """Rises in ascending order, asinh of the unknowns and rates there, and why it ends."""
        of, settings = problem(*self._kind), Settings(tolerance=1e-7, largest=0.2)
        stop = ("contact", "flat", "turn")
        down = trace(of, self._zero(), self._p, settings, direction=-1, stop=stop)
        reasons = {
            "contact": "the bars meet (twist pi)",
            "flat": "the prism is flat (height 0)",
            "turn": "equilibrium at given height is lost",
        }
        end = reasons[down.end]
        lost = [e.row for e in down.events if e.kind == "bifurcation"]
        if lost:
            down, end = down[: lost[0] + 1], "equilibrium at given height becomes unstable"
        up = trace(of, self._zero(), self._p, settings, direction=1, stop=("unloaded",))
        z = np.concatenate([down.z[:0:-1], up.z])
        tangents = np.concatenate([-down.tangent[:0:-1], up.tangent])
        if down.end == "flat":
            z[0, -1] = -self._p[0]  # exact by symmetry
        tangents[:, -1] *= np.sqrt(1 + z[:, -1] ** 2)
        return z[:, -1], np.arcsinh(z), tangents[:, :-1] / tangents[:, -1:], end

    def _function(self, name: str) -> Any:
        return function(name, *self._kind)

    def _law(self, steps: int) -> ElasticLaw:
        return ElasticLaw(self._kind[0], steps, self._kind[1])

    def _packed(self, scales: Sequence[float], interval: Sequence[float], guess: Array) -> Array:
        return np.array([*scales, *self._p[:4], *interval, *guess.ravel(), *self._p[6:]])

    @property
    def parameters(self) -> dict[str, float]:
        """Values of the prism and the preload, {name: float}."""
        names = ("base", "height", "prestrain", "k_cross", "k_base", "k_bar")
        return {name: getattr(self._prism, name) for name in names} | {"preload": self._preload}

    def _key(self) -> Hashable:
        return self._made_of
