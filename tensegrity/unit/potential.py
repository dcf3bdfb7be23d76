"""The potential of a unit: its energy against the elongation of the controlled coordinate.

Angles enter by the tangents of half their changes, so that the law is algebraic where lengths are.
"""

from __future__ import annotations

from collections.abc import Hashable, Mapping, Sequence
from dataclasses import dataclass, replace
from functools import partial
from typing import Any

import numpy as np

from tensegrity import check
from tensegrity.branches.continuation import Settings
from tensegrity.branches.problem import trace
from tensegrity.engine.compiled import Functions
from tensegrity.engine.law import horner
from tensegrity.errors import EquilibriumError, TensegrityError
from tensegrity.once import once
from tensegrity.springs.potential import Potential
from tensegrity.typing import Array
from tensegrity.unit import rest as at_rest
from tensegrity.unit.condensed import EXACT, GUESS, CondensedPotential
from tensegrity.unit.forms import exact_numbers, mixed, numbers
from tensegrity.unit.path import equations
from tensegrity.unit.rest import Described
from tensegrity.unit.states import box_of

SETTINGS = Settings(tolerance=1e-7, largest=0.2)
REACH = 5.0  # changes of the controlled coordinate, over its size at rest
MOVED = 1e-15  # relative change of a parameter, for a derivative in 40 digits
TRIED = 1e-4  # change at which the rest has to be in equilibrium still
SCALES = ("per_base", "force", "preload", "at rest", "energy at rest")


@dataclass(frozen=True)
class UnitLaw:
    """Law of a unit, whose inner unknowns take a fixed number of iterations.

    Attributes
    ----------
    unit : Unit
    steps : int
        Number of Newton iterations, which start from polynomials of the elongation.
    """

    unit: Any
    steps: int
    compiled = ("energy",)
    name = ""

    @property
    def parameters(self) -> tuple[str, ...]:
        """Names of scales, state at rest, `forms.numbers`, interval and coefficients."""
        of, names = mixed(self.unit, (self.unit.control,), True), SCALES
        names += (*(f"number {k}" for k in range(of.p.numel())), "middle", "per_half")
        return names + tuple(f"unknown {j} {k}" for j in range(of.z.numel())
                             for k in range(GUESS + 1))  # fmt: skip

    def guess(self) -> tuple[Any, ...]:
        """Symbols r and p, and expressions of the initial unknowns and the `forms.numbers`."""
        import casadi as ca

        r, p = ca.SX.sym("r"), ca.SX.sym("p", len(self.parameters))
        count = mixed(self.unit, (self.unit.control,), True).p.numel()
        given = p[len(SCALES) : len(SCALES) + count]
        middle, per_half = ca.vertsplit(p[len(SCALES) + count :][:2])
        coefficients = ca.vertsplit(p)[len(SCALES) + count + 2 :]
        t = (r - middle) * per_half
        guess = [
            coefficients[row] + r * horner(coefficients[row + 1 : row + GUESS + 1], t)
            for row in range(0, len(coefficients), GUESS + 1)
        ]
        return r, p, ca.vertcat(*guess, p[3] + r), given

    def forms(self) -> tuple[Any, Any, Sequence[Any]]:
        """Symbols and expressions of the law in CasADi; see `law.Law.forms`."""
        r, p, z, given = self.guess()
        step, values, _ = _forms(self.unit)
        for _ in range(self.steps):
            z = step(z, given)
        energy, tension, stiffness, slope = (v(z, given) for v in values)
        return r, p, (energy - p[4] + p[2] * r, tension + p[2], stiffness, slope)

    def by_parameters(self, elongation: Any, parameters: Any) -> Any:
        """Derivatives of energy and tension by the parameters at constant elongation, those of the
        unknowns by implicit differentiation."""
        import casadi as ca

        r, p, z, given = self.guess()
        step, _, slopes = _forms(self.unit)
        for _ in range(self.steps):
            z = step(z, given)
        count, before = given.numel(), len(SCALES)
        zero = ca.SX.zeros(p.numel() - before - count)
        by_energy, by_tension = slopes(z, given)
        energy = ca.vertcat(0, 0, r, 0, -1, by_energy, zero)
        tension = ca.vertcat(0, 0, 1, 0, 0, by_tension, zero)
        return ca.Function("slopes", [r, p], [energy, tension])(elongation, parameters)


@once
def _forms(unit: Described) -> Any:
    """A Newton step at given elongation, the energy and its derivatives, and derivatives of energy
    and force by the numbers, as functions of unknowns and numbers."""
    import casadi as ca

    of = mixed(unit, (unit.control,), True)
    x, p, g = ca.SX.sym("x", of.z.numel() + 1), of.p, of.equations
    v = ca.vertcat(of.z, of.h)
    inner = ca.jacobian(g, of.z)

    def solved(right: Any) -> Any:
        return ca.solve(inner, right) if of.z.numel() else ca.SX.zeros(right.shape)

    rate = ca.vertcat(-solved(ca.jacobian(g, of.h)), 1)
    orders = [of.energy, -of.loads]
    for _ in range(2):
        orders.append(ca.jtimes(orders[-1], v, rate))
    across = ca.jacobian(-of.loads, of.z)
    by_force = ca.jacobian(-of.loads, p)
    if of.z.numel():
        by_force -= ca.solve(inner.T, across.T).T @ ca.jacobian(g, p)

    def function(name: str, *forms: Any) -> Any:
        return ca.Function(name, [x, p], [ca.substitute(ca.densify(y), v, x) for y in forms])

    step = function("step", ca.vertcat(of.z - solved(g), of.h))
    values = [function("value", y) for y in orders]
    return step, values, function("slopes", ca.gradient(of.energy, p), by_force.T)


@once
def _functions(unit: Described) -> Functions:
    """The compiled functions that a `CondensedPotential` needs."""

    def make() -> dict[str, Any]:
        import casadi as ca

        step, values, _ = _forms(unit)
        r, p, guess, _ = UnitLaw(unit, 0).guess()
        named = {"step": step, "guess": ca.Function("guess", [r, p], [guess])}
        return named | {f"value_{k}": value for k, value in enumerate(values)}

    return Functions(None, make, flags=EXACT)


class UnitPotential(CondensedPotential):
    """Potential of a unit, the inner coordinates of which are in equilibrium.

    Parameters
    ----------
    unit : Unit
    preload : float
        Load at rest [N], compression > 0.
    given : Unit
        The unit before another state became its rest.

    Notes
    -----
    The domain ends where a string goes slack, where equilibrium at given elongation is lost or
    becomes unstable, or where the controlled coordinate has changed by five times its size.
    """

    def __init__(self, unit: Any, preload: float, given: Any, state: Any) -> None:
        at_rest.check_inner(unit)
        self._unit, self._preload, self._given = unit, preload, (given, preload, state)
        self._base = self._stiffness = 1.0
        self._p, self._scale = numbers(unit), np.array(equations(unit, True).scale)
        start = float(at_rest.values(unit, [unit.control])[0])
        self._origin = self._described = f"{unit!r}.potential(preload={preload:g})"
        low, high = (x - start for x in box_of(unit, reach=REACH)[-1])
        name = f"change of {unit.control}"
        self._at_rest = np.zeros(len(self._scale))
        if preload:
            self._at_rest = self._loaded(name)
        ends, branches = [], []
        for direction, most in ((-1, low), (1, high)):
            branch, end = self._followed(direction, name, most)
            branches.append(branch)
            ends.append(end)
        self.ends = ends[0], ends[1]
        down, up = branches
        z = np.concatenate([down.z[:0:-1], up.z])
        tangents = np.concatenate([-down.tangent[:0:-1], up.tangent]) * np.hypot(z, self._scale)
        self._rise, self._nodes = z[:, -1], np.arcsinh(z / self._scale)
        rates = tangents / np.hypot(z, self._scale)
        self._rates = rates[:, :-1] / tangents[:, -1:]
        length = start + float(self._at_rest[-1])
        self._size = max(abs(start), abs(length), float(np.abs(self._rise).max()))
        self._length = length if length > 0 else None
        self._domain = float(z[0, -1] - self._at_rest[-1]), float(z[-1, -1] - self._at_rest[-1])

    def _loaded(self, name: str) -> Array:
        """Unknowns under the preload, before the first limit point."""
        stop = ("fold", *(x for x in self._problem.events if x.startswith("string ")))
        branch = trace(self._problem, self._at_rest, self._p, SETTINGS, direction=-1, stop=stop,
                       until={"load": self._preload, name: -1e3 * self._scale[-1]})  # fmt: skip
        if branch.end != "the requested load is reached":
            raise EquilibriumError(
                f"preload {self._preload:g} N is beyond {branch.load[-1]:g} N, where the path of "
                f"the unit ends: {branch.end}"
            )
        return np.asarray(branch.z[-1])

    def _followed(self, direction: int, name: str, most: float) -> tuple[Any, str]:
        """The path in one sense from the state at rest, and why it ends."""
        strings = [x for x in self._problem.events if x.startswith("string ")]
        if not (most - self._at_rest[-1]) * direction > 0:
            raise EquilibriumError(f"the preload {self._preload:g} N leaves the range of {name}")
        branch: Any = trace(self._problem, self._at_rest, self._p, SETTINGS, direction=direction,
                            stop=("turn", *strings), until={name: most})  # fmt: skip
        end = str(branch.end)
        lost = [e.row for e in branch.events if e.kind == "bifurcation"]
        if lost:
            return branch[: lost[0] + 1], "equilibrium at given elongation becomes unstable"
        if end == "turn":
            return branch, "equilibrium at given elongation is lost"
        if end in strings:
            member = self._unit.members[int(end.split()[1])]
            return branch, f"the string {member.length} goes slack"
        return branch, f"{self._unit.control} leaves the range that is computed"

    @property
    def _problem(self) -> Any:
        return equations(self._unit, True)

    def _function(self, name: str) -> Any:
        return partial(_functions(self._unit), name)

    def _part(self) -> Any:
        low, high = self._domain
        parts = (self._widest(lambda x, y=y, z=z: (low * x**y, high * x**z))
                 for y, z in ((1, 0), (0, 1), (1, 1)))  # fmt: skip
        found = [part for part in parts if part]
        return max(found, key=lambda part: -part[2][0] * part[2][1], default=None)

    def _law(self, steps: int) -> UnitLaw:
        return UnitLaw(self._unit, steps)

    def _packed(self, scales: Sequence[float], interval: Sequence[float], guess: Array) -> Array:
        return np.array([*scales, *self._p, *interval, *guess.ravel()])

    @property
    def parameters(self) -> dict[str, float]:
        """Values of the parameters of the unit, and the preload, {name: float}."""
        of = self._given[0].parameters
        return {str(x): float(value) for x, value in of.items()} | {"preload": self._preload}

    def varied(self, values: Mapping[str, float]) -> Potential:
        """The same unit with other values of its parameters, or of the preload."""
        unit, preload, state = self._given
        known = self.parameters
        for name in check.kind("values", values, dict):
            if name not in known:
                raise TensegrityError(
                    f"{name!r} is not an argument of {check.shown(self)} that may change: "
                    f"{', '.join(known)}"
                )
        others = {x: values.get(str(x), value) for x, value in unit.parameters.items()}
        load = values.get("preload", preload)
        return replace(unit, parameters=others).potential(preload=load, at=state)

    def slopes(self, name: str) -> Array:
        """Derivatives of the values of the law's parameters by a parameter of the unit.

        Parameters
        ----------
        name : str

        Returns
        -------
        ndarray, (parameters of the law,)
            0 for what only the guess of the unknowns depends on.
        """
        unit, preload, state = self._given
        if preload or state is not None or name == "preload":
            raise TensegrityError(
                f"derivatives by {name} of a unit with preload {preload:g} N or about another "
                "state than its rest are not computed: the state would move"
            )
        (symbol,) = (x for x in unit.parameters if str(x) == name)
        import sympy as sp

        value = at_rest.as_rational(at_rest.values(unit, [symbol])[0])
        size = abs(value) or sp.Integer(1)

        def moved(part: float) -> Any:
            parameters = {**unit.parameters, symbol: value + size * sp.Rational(part)}
            return replace(unit, parameters=parameters)

        try:
            moved(TRIED)
        except EquilibriumError as error:
            raise TensegrityError(f"the rest of the unit moves with {name}: {error}") from error
        ends = [exact_numbers(moved(x)) for x in (-MOVED, MOVED)]
        slopes = [float((b - a) / (2 * at_rest.number(size * sp.Rational(MOVED))))
                  for a, b in zip(*ends, strict=True)]  # fmt: skip
        found = np.zeros(len(self.values))
        found[len(SCALES) : len(SCALES) + len(slopes)] = slopes
        return found

    def _shift_from(self, other: Potential) -> float:
        return float(self.length or 0.0) - float(other.length or 0.0)

    def _key(self) -> Hashable:
        unit, preload, state = self._given
        return "unit", unit, preload, None if state is None else tuple(state.items())


def unit_potential(unit: Any, preload: float, at: Any) -> UnitPotential:
    """The potential of a unit.

    Parameters
    ----------
    unit, preload, at
        See `Unit.potential`.

    Returns
    -------
    UnitPotential
    """
    about = unit if at is None else unit.about(at)
    state = None if at is None else {str(q): float(x) for q, x in about.rest.items()}
    return UnitPotential(about, check.number("preload", preload, unit="N"), unit, state)
