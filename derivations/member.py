"""A straight elastic member between two points: force and tangent stiffness from its energy.

The energy is E = k/2 (|d| - l_N)^2, with d from the first end to the second; the kinetic energy
that of a straight uniform rod, whose velocity is linear between its ends.  Forces and stiffness
of structures of bars and strings are its derivatives; a string shorter than l_N is slack and has
no energy.  Source: the talk, part III, "Elastic problem", for a single member.
"""

from __future__ import annotations

from functools import cache

import sympy as sp

from derivations import prism
from derivations.argument import Step

TITLE = "A member: force density and tangent from its energy"

stiffness, natural, length = sp.symbols("k l_N l", positive=True)
mass = sp.Symbol("m", positive=True)
VELOCITIES = sp.symbols("v w", real=True)
density = sp.Symbol("q", real=True)  # tension over length

POSITIONS = sp.symbols("x:18", real=True)
"""Coordinates of the lower nodes, then of the upper ones, x0 y0 z0 x1 ..."""

CONSTANTS = (
    *(member.stiffness for member in prism.MEMBERS),
    *(member.natural for member in prism.MEMBERS),
)


@cache
def separation(dim: int) -> tuple[sp.Symbol, ...]:
    """Symbols of the components of d."""
    return tuple(sp.symbols([f"d_{axis}" for axis in "xyz"[:dim]], real=True))


def length_of(dim: int) -> sp.Expr:
    """Length |d|."""
    return sp.sqrt(sum(d**2 for d in separation(dim)))


def kinetic() -> sp.Expr:
    """Kinetic energy of a straight uniform member of mass `mass` [J], whose velocity is linear
    from `VELOCITIES`[0] at one end to the other; in each direction."""
    along = sp.Symbol("s", real=True)
    first, second = VELOCITIES
    velocity = (1 - along) * first + along * second
    return sp.expand(sp.integrate(mass * velocity**2 / 2, (along, 0, 1)))


def inertia() -> sp.Matrix:
    """Mass matrix of a member by the velocities of both ends [kg]."""
    return sp.hessian(kinetic(), VELOCITIES)


def energy(length: sp.Expr = length) -> sp.Expr:
    """Energy E at a length [J]."""
    return stiffness * (length - natural) ** 2 / 2


def tension() -> sp.Expr:
    """Tension dE/dl at `length` [N]."""
    return sp.diff(energy(), length)


@cache
def pull(dim: int) -> list[sp.Expr]:
    """Gradient of E in d [N]: the force on the first end, minus that on the second."""
    return [sp.diff(energy(length_of(dim)), d) for d in separation(dim)]


@cache
def tangent(dim: int) -> sp.Matrix:
    """Hessian of E in d [N/m], as a function of d, `length` and `density`."""
    back = {stiffness * (length - natural): density * length}
    hessian = sp.hessian(energy(length_of(dim)), separation(dim))
    known = {length_of(dim): length, natural: length * (1 - density / stiffness)}
    return hessian.subs(known).applyfunc(sp.expand).subs(back)


def tangent_in_density(dim: int = 3) -> sp.Matrix:
    """The form (k - q) n n^T + q I of `tangent`, with n = d/l."""
    direction = sp.Matrix(separation(dim)) / length
    return (stiffness - density) * direction * direction.T + density * sp.eye(dim)


@cache
def prism_energy() -> sp.Expr:
    """Elastic energy U(`POSITIONS`) of a prism with six free nodes [J], without symmetry; at
    symmetric positions it equals that of `derivations.prism`."""

    def length(i, j):
        return sp.sqrt(sum((POSITIONS[3 * i + k] - POSITIONS[3 * j + k]) ** 2 for k in range(3)))

    return sum(
        member.energy(length(i, j)) / member.number
        for member in prism.MEMBERS
        for i, j in member.ends
    )


def symmetric_positions() -> list[sp.Expr]:
    """The 18 coordinates in terms of base, twist and height."""
    lower, upper = prism.nodes()
    return [x for node in (*lower, *upper) for x in node]


def argument() -> list[Step]:
    gap = (tangent(3) - tangent_in_density(3)).subs(length, length_of(3)).applyfunc(sp.simplify)
    if any(gap):
        raise ArithmeticError("the tangent of a member is not (k - q) n n^T + q I")
    n = sp.MatrixSymbol("n", 3, 1)
    return [
        Step("The energy of a member of spring constant k, natural length l_N and length l is",
             energy()),
        Step("and its tension", sp.Eq(sp.Symbol("T"), tension())),
        Step("With a mass m along it, and velocities v and w of its ends, its kinetic energy "
             "in each direction is", kinetic()),
        Step("Let d be the vector between both ends, l = |d|. With the force density q = T/l and "
             "n = d/l the gradient in d is q d, and the Hessian is",
             (stiffness - density) * n * n.T + density * sp.Identity(3)),
    ]  # fmt: skip
