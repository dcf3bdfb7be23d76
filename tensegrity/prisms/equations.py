"""The equilibrium equations of prisms with elastic bases or bars, in CasADi.

The forms of `derivations.mixed` make a problem for `tensegrity.trace`.  Lengths are in units of the
base and forces in units of k_cross times base, so that one set of functions serves all prisms.
"""

from __future__ import annotations

import math
from typing import Any

from tensegrity.branches.problem import DerivedProblem, Problem
from tensegrity.engine.law import to_casadi
from tensegrity.once import once
from tensegrity.prisms.closed import polygon
from tensegrity.typing import Members

LEAST = 1e-5  # force over k_cross base that scales residuals if all members are unloaded
TENSIONS = ("cross_tension", "base_tension", "bar_tension")
UNKNOWNS = ("base tension", "bar tension", "half turn", "rise")


@once
def _forms(rigid_base: bool, any_sides: bool) -> Any:
    """The forms of `derivations.mixed` as CasADi expressions of unknowns z and parameters p."""
    import casadi as ca

    from derivations import mixed as derived
    from derivations.regular import SIDES

    of = polygon(any_sides)
    z, p = ca.SX.sym("z", 4 - rigid_base), ca.SX.sym("p", 9 if any_sides else 6)
    unknowns = (ca.SX(0), *ca.vertsplit(z)) if rigid_base else ca.vertsplit(z)
    symbols = (*derived.UNKNOWNS, *derived.PARAMETERS, *(SIDES if any_sides else ()))
    forms = {
        "base": derived.base_equilibrium(of),
        "twist": derived.twist_equilibrium(of),
        "bar": derived.bar_compatibility(of),
        "load": derived.load(of),
        "energy": derived.stored_energy(of),
    }
    forms |= dict(
        zip(("cross_tension", "base_tension", "bar_tension"), derived.tensions(of), strict=True)
    )
    forms |= dict(zip(("cross_length", "width", "bar_length"), derived.lengths(of), strict=True))
    given = [p[i] for i in range(p.numel()) if i not in (4, 5)]  # without the units of columns

    def at(*unknowns: Any) -> dict[str, Any]:
        values = to_casadi(list(forms.values()), symbols)(*unknowns, *given)
        return {name: ca.SX(value) for name, value in zip(forms, values, strict=True)}

    form = at(*unknowns) | {"half_turn": unknowns[2], "rise": unknowns[3]}
    if rigid_base:  # the tension of the bases is what holds their length
        tension = ca.SX.sym("tension")
        held = at(tension, *unknowns[1:])
        there = -form["base"] / ca.substitute(ca.jacobian(held["base"], tension), tension, 0)
        form["held"] = ca.substitute(held["base_tension"], tension, there)
    return z, p, form


@once
def problem(rigid_base: bool = False, any_sides: bool = False) -> Problem:
    """Equilibria of a prism as a branch in the rise h - h0.

    The unknowns are the changes of the tensions of a base string (absent if the bases are rigid)
    and of a bar, the tangent of half the change of twist, and the rise.  For rigid bars the
    tension is the Lagrange multiplier of their constant length.  The parameters are h0, p0, k1/k2,
    k1/k3, and the base [m] and the force k_cross times base [N], in which columns are; then n,
    sin(pi/n) and cos(pi/n) if `any_sides`, otherwise the prism is triangular.  The events are
    contact (cross strings unload at twist pi), unloaded (base strings and bars unload at twist
    2 pi/n) and flat, and the limit points in load ("fold") and in displacement ("turn").
    """
    return DerivedProblem(_problem, rigid_base, any_sides)


def _problem(rigid_base: bool, any_sides: bool) -> Problem:
    import casadi as ca

    from derivations.prism import REFERENCE_TWIST

    z, p, form = _forms(rigid_base, any_sides)
    reference = math.pi / 2 + math.pi / p[6] if any_sides else float(REFERENCE_TWIST)
    tensions = ca.vertcat(form["cross_tension"], form["base_tension"], form["bar_tension"])
    force = ca.norm_2(tensions) + LEAST
    names = ("twist", "bar") if rigid_base else ("base", "twist", "bar")
    sizes = {"base": force, "twist": force, "bar": form["bar_length"] ** 2}
    height = p[0] + form["rise"]
    kinds = ("cross_tension", "held" if rigid_base else "base_tension", "bar_tension")
    columns = {
        "height": height * p[4],
        "twist": reference + 2 * ca.atan(form["half_turn"]),
        "base": form["width"] * p[4],
        "load": form["load"] * p[5],
    }
    columns |= {name: form[kind] * p[5] for name, kind in zip(TENSIONS, kinds, strict=True)}
    return Problem(
        dict(zip(UNKNOWNS[rigid_base:], ca.vertsplit(z), strict=True)),
        ca.vertcat(*(form[name] for name in names)),
        p=p,
        size=ca.vertcat(*(sizes[name] for name in names)),
        events={
            "contact": form["cross_tension"],
            "unloaded": form["bar_tension"] if rigid_base else form["base_tension"],
            "flat": height,
        },
        folds={"fold": form["load"], "turn": form["rise"]},
        columns=columns,
    )


def kind_of(prism: Members) -> tuple[bool, bool]:
    """Arguments `rigid_base` and `any_sides` of `problem` for a prism."""
    return math.isinf(prism.k_base), prism.sides != 3


def numbers(prism: Members) -> list[float]:
    """Parameters of `problem` for a prism, (6,) or (9,)."""
    n, angle = prism.sides, math.pi / prism.sides
    sides = (float(n), math.sin(angle), math.cos(angle)) if kind_of(prism)[1] else ()
    return [
        prism.height / prism.base,
        prism.prestrain,
        prism.k_cross / prism.k_base,
        prism.k_cross / prism.k_bar,
        prism.base,
        prism.k_cross * prism.base,
        *sides,
    ]


@once
def tangent(rigid_base: bool, any_sides: bool) -> Any:
    """Symmetric tangent of the mixed (Hellinger-Reissner) energy.

    The variables are base, twist, bar tension and height.  The bar tension is the multiplier of a
    compatibility condition, to which one negative eigenvalue belongs; the base is scaled by the
    square root of its stiffness.
    """
    import casadi as ca

    z, p, form = _forms(rigid_base, any_sides)
    softness, sides = ca.sqrt(p[2]), p[6] if any_sides else 3
    rows = [form["twist"], sides * form["bar"] / (2 * form["bar_length"]), -form["load"]]
    columns = [(1 + form["half_turn"] ** 2) / 2, 1, 1]
    order = [1, 0, 2]  # columns of z: bar tension, half turn, rise
    if not rigid_base:
        rows, columns = [softness * form["base"], *rows], [1 / softness, *columns]
        order = [0, 2, 1, 3]
    matrix = ca.jacobian(ca.vertcat(*rows), z)[:, order] @ ca.diag(ca.vertcat(*columns))
    # the equations take the bar length from its tension, the energy from the coordinates
    multiplier = matrix[-2, :]
    coupling = multiplier.T * form["bar_tension"] / (sides * form["bar_length"])
    coupling[-2] = 0
    return ca.Function("tangent", [z, p], [matrix - coupling @ multiplier])


@once
def inner(rigid_base: bool, any_sides: bool) -> Any:
    """A Newton step at given height, and the energy and its derivatives in the height."""
    import casadi as ca

    z, p, form = _forms(rigid_base, any_sides)
    g = problem(rigid_base, any_sides).equations
    v, rise = z[:-1], z[-1]
    move = ca.solve(ca.jacobian(g, v), g)
    rate = ca.vertcat(-ca.solve(ca.jacobian(g, v), ca.jacobian(g, rise)), 1)
    orders = [form["energy"], -form["load"]]
    for _ in range(2):
        orders.append(ca.jtimes(orders[-1], z, rate))
    return (
        ca.Function("step", [z, p], [ca.vertcat(v - move, rise)]),
        [ca.Function("value", [z, p], [order]) for order in orders],
    )
