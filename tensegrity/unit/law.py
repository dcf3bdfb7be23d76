"""Laws of which some unknowns are in equilibrium, by a fixed number of Newton's iterations.

They start from polynomials of the elongation.  Derivatives by parameters are those at constant
unknowns, corrected by the change of the unknowns; the iterations are not differentiated.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import Any

from tensegrity.engine.compiled import Functions
from tensegrity.engine.law import horner, named
from tensegrity.once import once
from tensegrity.unit.forms import Mixed

GUESS = 23  # degree of the polynomials from which the compiled iteration starts
EXACT = ("-ffp-contract=off", "-O1")
"""Exact cancellation: the load of a flat prism is zero; optimisation then changes no bit."""
SCALES = ("per_base", "force", "preload", "at rest", "energy at rest")


@dataclass(frozen=True)
class CondensedLaw:
    """Law of a potential, the inner unknowns of which take a fixed number of iterations.

    It has neither state nor branches, so that the compiled loop evaluates many bonds at a time.

    Attributes
    ----------
    of : Any
        What its equations are made of.
    steps : int
        Number of Newton iterations, which start from polynomials of the elongation.
    """

    of: Any
    steps: int
    compiled = ("energy",)
    name = ""

    def mixed(self) -> Mixed:
        """The equations."""
        raise NotImplementedError

    @property
    def sizes(self) -> tuple[int, int]:
        """Numbers of parameters and of unknowns of the equations."""
        of = self.mixed()
        return of.p.numel(), of.z.numel()

    @property
    def parameters(self) -> tuple[str, ...]:
        """Names of scales, state at rest, parameters of the equations, interval, coefficients."""
        numbers, unknowns = self.sizes
        names = (*SCALES, *(f"number {k}" for k in range(numbers)), "middle", "per_half")
        return names + tuple(f"unknown {j} {k}" for j in range(unknowns) for k in range(GUESS + 1))

    def guess(self) -> tuple[Any, ...]:
        """Symbols r and p, and expressions of the initial unknowns and of the parameters of the
        equations."""
        import casadi as ca

        r, p = ca.SX.sym("r"), ca.SX.sym("p", len(self.parameters))
        end = len(SCALES) + self.sizes[0]
        middle, per_half, *coefficients = ca.vertsplit(p[end:])
        t = (r - middle) * per_half
        guess = [  # at rest, then the slope from there
            coefficients[row] + r * horner(coefficients[row + 1 : row + GUESS + 1], t)
            for row in range(0, len(coefficients), GUESS + 1)
        ]
        return r, p, ca.vertcat(*guess, p[3] + r * p[0]), p[len(SCALES) : end]

    def forms(self) -> tuple[Any, Any, Sequence[Any]]:
        """Symbols and expressions of the law in CasADi; see `law.Law.forms`."""
        r, p, x, given = self._solved()
        per_base, force, preload, energy_at_rest = p[0], p[1], p[2], p[4]
        energy, tension, stiffness, slope = (v(x, given) for v in condensed(self.start)[1])
        return r, p, (
            force / per_base * (energy - energy_at_rest) + preload * r,
            force * tension + preload,
            force * per_base * stiffness,
            force * per_base**2 * slope,
        )  # fmt: skip

    def by_parameters(self, elongation: Any, parameters: Any) -> Any:
        """Derivatives of energy and tension by the parameters at constant elongation, those of the
        unknowns by implicit differentiation."""
        import casadi as ca

        r, p, x, given = self._solved()
        per_base, force, change = p[0], p[1], -p[4]
        _, values, slopes = condensed(self.start)
        energy, tension, stiffness = (v(x, given) for v in values[:3])
        change += energy
        by_energy, by_tension = slopes(x, given)
        zero = ca.SX.zeros(p.numel() - len(SCALES) - given.numel())
        size = force / per_base
        energy = ca.vertcat(size * (tension * r - change / per_base), change / per_base, r,
                            size * tension, -size, size * by_energy, zero)  # fmt: skip
        tension = ca.vertcat(force * stiffness * r, tension, 1, force * stiffness, 0,
                             force * by_tension, zero)  # fmt: skip
        return ca.Function("slopes", [r, p], [energy, tension])(elongation, parameters)

    @property
    def start(self) -> CondensedLaw:
        """The same without iterations, which has the same equations."""
        return replace(self, steps=0)

    def _solved(self) -> tuple[Any, ...]:
        r, p, x, given = self.guess()
        step, *_ = condensed(self.start)
        for _ in range(self.steps):
            x = step(x, given)
        return r, p, x, given


@once
def condensed(law: CondensedLaw) -> Any:
    """A Newton step at given last unknown, the energy and its derivatives by that, and derivatives
    of energy and force by the parameters, as functions of unknowns and parameters."""
    import casadi as ca

    of = law.mixed()
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
def compiled_functions(law: CondensedLaw) -> Functions:
    """The compiled functions that a `CondensedPotential` needs, of the `start` of its law."""

    def make() -> dict[str, Any]:
        import casadi as ca

        step, values, _ = condensed(law)
        r, p, guess, _ = law.guess()
        functions = {"step": step, "guess": ca.Function("guess", [r, p], [guess])}
        return functions | {f"value_{k}": value for k, value in enumerate(values)}

    return Functions(named("condensed", (law,)), make, flags=EXACT)
