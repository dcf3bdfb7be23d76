"""Prisms with elastic bases or bars: potential and stability.

The potential eliminates tensions and twist from the `equations` at given height by Newton's
method.  The iteration starts from a traced branch or, in the compiled loop, from polynomials of the
elongation.
"""

from __future__ import annotations

import math
from collections.abc import Hashable, Sequence
from dataclasses import dataclass
from functools import cached_property, partial
from typing import Any

import numpy as np
from numpy.typing import ArrayLike

from tensegrity import check
from tensegrity.branches.continuation import Settings
from tensegrity.branches.problem import trace
from tensegrity.engine.compiled import Functions, evaluated
from tensegrity.engine.law import deflated, horner
from tensegrity.errors import EquilibriumError, LockingError, RangeError
from tensegrity.once import once
from tensegrity.printing import call
from tensegrity.prisms.equations import UNKNOWNS, inner, kind_of, numbers, problem, tangent
from tensegrity.springs.potential import Potential
from tensegrity.typing import Array, Flags, Members

STALLED = 1e-10  # size below which a step that no longer shrinks is round-off
ITERATIONS = 20
ROUND_OFF = 1e-13
GUESS = 23  # degree of the polynomials from which the compiled iteration starts
STEPS = (1, 2, 4)  # admissible numbers of its iterations
SETTLED = 1e-14  # largest change by a further iteration, over the largest unknown
SAMPLES = 512  # elongations at which this is checked
EXACT = ("-ffp-contract=off", "-O1")
"""Exact cancellation: the load of a flat prism is zero; optimisation then changes no bit."""
HALVINGS = 8  # bisections of the fraction of the domain


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


class ElasticPotential(Potential):
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
        self._p = numbers(prism)
        self._at_rest = self._loaded() if preload else self._zero()
        rise, self._nodes, self._rates, end = self._traced()
        self._rise = rise
        base, start = prism.base, self._at_rest[-1]
        self._length = float(prism.height + start * base)
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

    @property
    def law(self) -> ElasticLaw:
        if self._in_loop[0] is None:
            raise EquilibriumError(
                f"the compiled loop finds no equilibria of {self._prism!r} about its length "
                f"{self._length:g} m under the preload: its members are too stiff or too soft"
            )
        return self._in_loop[0]

    @property
    def values(self) -> Array:
        return self._in_loop[1]

    @property
    def computable_domain(self) -> tuple[float, float]:
        """Range of elongations that the compiled loop can follow [m].

        It is the whole `domain`, with two exceptions.  For members so stiff that the bars of the
        rigid prism would meet far inside the domain, it ends shortly before that contact; for
        members so soft that they take most of the extension, it ends within the extension.
        """
        return self._in_loop[2]

    @cached_property
    def _in_loop(self):
        """Law, parameters and range: the widest range on which the iterations converge."""
        low, high = self._domain
        return (
            self._compiled_on(low, high)
            or self._widest(lambda part: (low * part, high))
            or self._widest(lambda part: (low, high * part))
            or (None, np.empty(0), (math.inf, -math.inf))
        )

    def _widest(self, ends):
        """The result of `_compiled_on` on the largest part of the domain where there is one."""
        widest, good, bad = None, 0.0, 1.0
        for _ in range(HALVINGS):
            part = (good + bad) / 2
            shorter = self._compiled_on(*ends(part))
            widest, good, bad = (shorter, part, bad) if shorter else (widest, good, part)
        return widest

    def _compiled_on(self, low, high):
        """Law, parameters and range for elongations in an interval; None if the iterations do not
        converge on it."""
        values = self._numbers(low, high, self._fitted(low, high))
        step, taken = function("step", *self._kind), 0
        guess = function("guess", *self._kind)
        z = guess(np.linspace(low, high, SAMPLES)[:, None], values)
        for steps in STEPS:
            for _ in range(taken, steps):
                z = step(z, self._p)
            taken, moved = steps, np.abs(step(z, self._p) - z)
            if (moved.max(axis=0) <= SETTLED * np.abs(z).max(axis=0)).all():
                return ElasticLaw(self._kind[0], steps, self._kind[1]), values, (low, high)
        return None

    def _fitted(self, low, high):
        """Coefficients of the initial unknowns: their values at rest, which are exact, and the
        polynomial in t = (r - middle)/half of their mean slope from there."""
        from numpy.polynomial import chebyshev

        t = chebyshev.chebpts1(2 * GUESS)
        middle, half = (low + high) / 2, (high - low) / 2
        z = self.states(middle + half * t)[:, :-1]
        fits = [chebyshev.cheb2poly(c) for c in chebyshev.chebfit(t, z, GUESS).T]
        slopes = np.array([deflated(fit, -middle / half) for fit in fits]) / half
        return np.column_stack([self._at_rest[:-1], slopes])

    def _numbers(self, low, high, coefficients):
        base, force = self._prism.base, self._prism.k_cross * self._prism.base
        (energy_at_rest,) = function("value_0", *self._kind)(self._at_rest, self._p)
        scales = [1 / base, force, self._preload, self._at_rest[-1], energy_at_rest]
        interval = [(low + high) / 2, 2 / (high - low)]
        return np.array([*scales, *self._p[:4], *interval, *coefficients.ravel(), *self._p[6:]])

    def _range_error(self, r: float) -> LockingError:
        """The error for an elongation at or beyond an end of either domain."""
        if not self._domain[0] < r < self._domain[1]:
            return super()._range_error(r)
        side = int(r > 0)
        way, what = (
            ("below", "stiff; take them as rigid (inf)"),
            ("above", "stiff, or this soft"),
        )[side]
        return RangeError(
            f"elongation {r:.6g} m is at or {way} {self.computable_domain[side]:.6g} m, as far as "
            f"the compiled loop can follow members this {what}"
        )

    @property
    def parameters(self) -> dict[str, float]:
        """Values of the prism and the preload, {name: float}."""
        names = ("base", "height", "prestrain", "k_cross", "k_base", "k_bar")
        return {name: getattr(self._prism, name) for name in names} | {"preload": self._preload}

    def states(self, r: Array) -> Array:
        """Unknowns of the equilibria at elongations r (r.size,) [m], (r.size, m)."""
        rise = self._at_rest[-1] + np.clip(r, *self._domain) / self._prism.base
        rise = np.clip(rise, self._rise[0], self._rise[-1])
        z = self._guess(rise)
        step, previous = function("step", *self._kind), math.inf
        for _ in range(ITERATIONS):
            new = step(z, self._p)
            moved = np.max(np.abs(new - z) / (1 + np.abs(z)), initial=0.0)
            z = new
            if moved <= 1e-15 or (moved <= STALLED and moved >= previous / 4):
                return z
            previous = moved
        raise EquilibriumError(
            f"no equilibrium found at heights {self._length + np.min(r):g} to "
            f"{self._length + np.max(r):g} m: the last iteration moved {moved:.3g}"
        )

    def _guess(self, rise):
        """Cubic interpolation of the traced branch."""
        at = np.clip(np.searchsorted(self._rise, rise, side="right"), 1, len(self._rise) - 1)
        length = self._rise[at] - self._rise[at - 1]
        u = ((rise - self._rise[at - 1]) / length)[:, None]
        w, length = 1 - u, length[:, None]
        z = self._nodes[:, :-1]
        z = w * w * (1 + 2 * u) * z[at - 1] + u * u * (1 + 2 * w) * z[at]
        z = z + length * u * w * (w * self._rates[at - 1] - u * self._rates[at])
        return np.column_stack([np.sinh(z), rise])

    def derivative(self, order: int, r: ArrayLike, closed: bool = False) -> Array:
        """Derivative of the energy in the elongation.

        Parameters
        ----------
        order : int
            0 for the energy, up to 3.
        r : array_like, any shape
            Elongation [m]; extension > 0.
        closed : bool, optional
            Without effect: the ends of the domain are included in any case.

        Returns
        -------
        ndarray, shape of r
            [N m^(1 - order)].

        Raises
        ------
        LockingError
            If an elongation is outside the domain.
        """
        r = check.numbers("elongation", r, "m")
        low, high = self._domain
        # the ends are computed roots: allow for their round-off, large at small prestrain
        slack = 64 * np.finfo(float).eps * max(self._length, self._prism.height)
        inside = (r >= low - slack) & (r <= high + slack)
        if not inside.all():
            raise super()._range_error(float(r[~inside].flat[0]))
        if r.size == 0:
            return np.empty(r.shape)
        flat = np.ascontiguousarray(r).reshape(-1)
        if (
            order == 0
            and self.computable_domain[0] <= flat.min()
            and flat.max() <= self.computable_domain[1]
        ):
            return evaluated(self.law, 0, self.values, flat).reshape(r.shape)
        return self._from_states(order, flat).reshape(r.shape)

    def _from_states(self, order, r):
        """The order-th derivative of the energy at elongations r (r.size,), (r.size,)."""
        value = function(f"value_{order}", *self._kind)
        result = value(self.states(r), self._p)[:, 0]
        result = result * self._prism.k_cross * self._prism.base ** (2 - order)
        if order == 0:
            (rest,) = value(self._at_rest, self._p)
            result = result - rest * self._prism.k_cross * self._prism.base**2 + self._preload * r
        return result + self._preload if order == 1 else result

    def _key(self) -> Hashable:
        return self._made_of
