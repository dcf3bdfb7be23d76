"""A prism as a unit, and its equilibrium equations in CasADi.

Base and twist are the inner coordinates, the height is the controlled one.  Lengths are in units of
the base and forces in units of k_cross times base, so that one set of functions serves all prisms.
"""

from __future__ import annotations

import math
from dataclasses import replace
from typing import Any

from tensegrity.branches.problem import DerivedProblem, Problem
from tensegrity.checked import checked
from tensegrity.engine.law import to_casadi
from tensegrity.errors import TensegrityError
from tensegrity.once import once
from tensegrity.prisms.closed import polygon
from tensegrity.typing import Members, Sides
from tensegrity.unit.forms import Mixed, changes, mixed_of
from tensegrity.unit.member import Member
from tensegrity.unit.unit import Unit

LEAST = 1e-5  # force over k_cross base that scales residuals if all members are unloaded
TENSIONS = ("cross_tension", "base_tension", "bar_tension")
STIFF = (False, True, True)  # whose tensions are unknowns
UNKNOWNS = ("half turn", "base tension", "bar tension", "rise")


@once
def unit(any_sides: bool) -> Unit:
    """The prism of base 1 and k_cross 1, its other numbers as symbols."""
    from derivations.elastic import bar_compliance, base_compliance

    return _unit(polygon(any_sides), 1, (1, 1 / base_compliance, 1 / bar_compliance))


@checked
def symbolic_unit(
    sides: Sides, connectivity: int = 1, rigid_base: bool = False, rigid_bars: bool = False
) -> Unit:
    """A prism all of whose sizes are symbols, for its formulas.

    Parameters
    ----------
    sides : int
        Sides n of the polygons, at least 3.
    connectivity : int, optional
        Nodes from the upper end of a bar back to that of the cross string from the same lower
        node; below n/2, beyond which are the mirror images.  At rest the twist is
        pi/2 + connectivity pi/n.
    rigid_base, rigid_bars : bool, optional
        Whether base strings, or bars, are rigid; their spring constants are symbols otherwise.

    Returns
    -------
    Unit
        In l_0, h_0, p_0 and k_1, k_2, k_3 of cross strings, base strings and bars.  The angle
        alpha = pi/n and its sine S are parameters, unless they are simple: for 3, 4 and 6 sides.

    Raises
    ------
    TensegrityError
        An argument is outside its bounds.
    """
    import sympy as sp

    from derivations import prism as derived
    from derivations.regular import Polygon, half_angle, half_sine

    most = (sides - 1) // 2
    if not 1 <= connectivity <= most:
        raise TensegrityError(
            f"connectivity {connectivity} of a prism with {sides} sides must be from 1 to {most}"
        )
    of = Polygon(sides)
    values = {}
    if not (of.sine**2).is_rational:
        values = {half_angle: of.angle, half_sine: of.sine}
        of = Polygon(sides, half_angle, half_sine)
    base = sp.Symbol("l_0", positive=True)
    k_base, k_bar = sp.oo if rigid_base else derived.k_base, sp.oo if rigid_bars else derived.k_bar
    return _unit(of, base, (derived.k_cross, k_base, k_bar), connectivity, values)


def _unit(of: Any, base: Any, stiffness: Any, connectivity: int = 1, values: Any = None) -> Unit:
    from derivations import prism as derived

    cross, *others = (
        Member(one.length(of), k, one.count(of))
        for one, k in zip(derived.members(connectivity), stiffness, strict=True)
    )
    twist = of.reference_twist + (connectivity - 1) * of.angle
    rest = {derived.base: base, derived.twist: twist, derived.height: derived.reference_height}
    return Unit([derived.base, derived.twist], derived.height, [cross, *others], parameters=values,
                rest=rest, prestrain={cross: derived.prestrain})  # fmt: skip


def numbers_of(any_sides: bool, stiff: tuple[bool, ...] = STIFF) -> Any:
    """Parameters of the mixed energy of a prism as a unit, and the symbols in which they are."""
    from derivations import prism as derived
    from derivations.elastic import bar_compliance, base_compliance
    from derivations.regular import SIDES

    of, made = polygon(any_sides), unit(any_sides)
    values = [x.subs(made.rest) for x in changes(made).values]
    values = [of.expanded(x) if any_sides else x for x in values]
    ease = [1 / m.k if one else m.k for m, one in zip(made.members, stiff, strict=True)]
    counts = [m.count for m in made.members]
    symbols = derived.reference_height, derived.prestrain, base_compliance, bar_compliance
    return (
        [*values, *derived.reference_tensions(of), *ease, 1, 1, 1, *counts],
        symbols + (SIDES if any_sides else ()),
    )


def _exact(any_sides: bool, base_compliance: float | None, stiff: tuple[bool, ...] = STIFF) -> Any:
    """Symbols of `numbers`, and the parameters of the mixed energy in them."""
    import casadi as ca

    p = ca.SX.sym("p", 9 if any_sides else 6)
    given = [p[i] for i in range(p.numel()) if i not in (4, 5)]  # without the units of columns
    given[2] = given[2] if base_compliance is None else ca.SX(base_compliance)
    values, symbols = numbers_of(any_sides, stiff)
    return p, ca.vertcat(*to_casadi(values, symbols)(*given))


@once
def mixed(rigid_base: bool, any_sides: bool) -> Mixed:
    """The mixed energy of a prism in the parameters of `numbers`.

    Rigid bases have their length as no unknown, and as tension what holds it.
    """
    import casadi as ca

    made = unit(any_sides)
    of = mixed_of(made, STIFF, (made.control,), True).at(
        *_exact(any_sides, 0 if rigid_base else None)
    )
    if not rigid_base:
        return of
    turn, tension, bar = ca.vertsplit(of.z)
    base, *equations = ca.vertsplit(of.equations)
    held = -ca.substitute(base, tension, 0) / ca.jacobian(base, tension)
    tensions = ca.substitute(of.tensions, tension, held)
    return replace(of, z=ca.vertcat(turn, bar), equations=ca.vertcat(*equations),
                   tensions=tensions)  # fmt: skip


@once
def problem(rigid_base: bool = False, any_sides: bool = False) -> Problem:
    """Equilibria of a prism as a branch in the rise h - h0.

    The unknowns are the tangent of half the change of twist, the changes of the tensions of a base
    string (absent if the bases are rigid) and of a bar, and the rise.  For rigid bars the
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

    of = mixed(rigid_base, any_sides)
    z, p = [*ca.vertsplit(of.z), of.h], of.p
    reference = math.pi / 2 + math.pi / p[6] if any_sides else float(REFERENCE_TWIST)
    base, twist, rise = ca.vertsplit(of.changes)
    force, height = ca.norm_2(of.tensions) + LEAST, p[0] + rise
    columns = {
        "height": height * p[4],
        "twist": reference + twist,
        "base": (1 + base) * p[4],
        "load": of.loads * p[5],
    }
    tensions = dict(zip(TENSIONS, ca.vertsplit(of.tensions), strict=True))
    columns |= {name: tension * p[5] for name, tension in tensions.items()}
    forces = [force] * (len(z) - 2)
    return Problem(
        dict(zip(UNKNOWNS[:1] + UNKNOWNS[1 + rigid_base :], z, strict=True)),
        of.equations,
        p=p,
        size=ca.vertcat(*forces, 1 + p[0]),
        events={
            "contact": tensions["cross_tension"],
            "unloaded": tensions["bar_tension" if rigid_base else "base_tension"],
            "flat": height,
        },
        folds={"fold": of.loads, "turn": rise},
        columns=columns,
    )


def kind_of(prism: Members) -> tuple[bool, bool]:
    """Arguments `rigid_base` and `any_sides` of `problem` for a prism."""
    return math.isinf(prism.k_base), prism.sides != 3


def numbers(prism: Members) -> list[float]:
    """Parameters of `problem` for a prism, (6,) or (9,)."""
    n, angle = prism.sides, math.pi / prism.sides
    sides = (float(n), math.sin(angle), math.cos(angle)) if n != 3 else ()
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
    """Second derivatives of the mixed energy by base, unless it is rigid, twist, bar tension and
    height, as a function of the unknowns of `problem` and its parameters."""
    import casadi as ca

    few, made, stiff = mixed(rigid_base, any_sides), unit(any_sides), (False, False, True)
    base, twist, rise = ca.vertsplit(few.changes)
    held = made.inner[:rigid_base]
    of = mixed_of(made, stiff, (made.control, *held), False)
    of = of.at(*_exact(any_sides, 1 if rigid_base else None, stiff))
    matrix, _ = ca.hessian(of.energy, ca.vertcat(of.z, of.h[0]))
    inner = [twist] if rigid_base else [base, twist]
    symbols, values = ca.vertcat(of.z, of.h), [*inner, few.z[-1], rise, *[0] * rigid_base]
    at = ca.substitute([ca.vec(matrix)], [symbols, of.p], [ca.vertcat(*values), few.p])
    return ca.Function("tangent", [ca.vertcat(few.z, few.h), few.p], at)
