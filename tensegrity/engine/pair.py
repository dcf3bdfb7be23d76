"""The law of a bond whose energy is a function of all coordinates of its two ends, V(a, b; p).

The engine's elongation of such a bond is its energy over 1 N, and its law is linear, so that the
forces on the ends are the gradient, (2 dim,): that of the first end, then that of the second.  A
coordinate on whose difference alone the energy depends is free: the forces on both ends are then
opposite to the last bit.  Inner unknowns are in equilibrium, W_z = 0, found by Newton's method; the
derivatives hold them fixed (envelope theorem), and none is taken through the iteration.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

from tensegrity.engine.law import to_casadi
from tensegrity.once import once, undisturbed

if TYPE_CHECKING:
    import sympy as sp

ITERATIONS = 5  # of Newton's method for inner unknowns
# Square of the last step over that of the unknowns beyond which there is no value, and what is
# added to the latter.
SETTLED, ADDED = 1e-12, 1e-12


@dataclass(frozen=True)
class PairForms:
    """The energy of a bond, and by which symbols it is written.

    Attributes
    ----------
    energy : sympy.Expr
        [J]
    first, second : tuple of sympy.Symbol, (dim,)
        Coordinates of the two ends, 0 at rest.
    parameters : tuple of sympy.Symbol
    free : tuple of bool, (dim,)
        Whether the energy depends on the difference of a coordinate alone.
    inner : tuple of sympy.Symbol, optional
        Unknowns in equilibrium, 0 at rest.
    """

    energy: sp.Expr
    first: tuple[sp.Symbol, ...]
    second: tuple[sp.Symbol, ...]
    parameters: tuple[sp.Symbol, ...]
    free: tuple[bool, ...]
    inner: tuple[sp.Symbol, ...] = ()
    compiled = ("energy", "tension", "stiffness")

    @property
    def dim(self) -> int:
        """Number of coordinates of an end."""
        return len(self.first)

    @property
    def name(self) -> str:
        """Identifies the law in other processes."""
        return _name(self)

    def forms(self) -> tuple[Any, Any, tuple[Any, ...]]:
        """The law in CasADi: linear; see `law.Law.forms`."""
        import casadi as ca

        r = ca.SX.sym("r")
        return r, ca.SX.sym("p", len(self.parameters)), (r, ca.SX(1), ca.SX(0), ca.SX(0))

    def functions(self) -> dict[str, Any]:
        """CasADi functions of the coordinates a and b of both ends and of the parameters p.

        Returns
        -------
        dict of casadi.Function
            "pair": (a, b, p) -> energy, and its gradient (2 dim,); "gradient": that alone;
            "tangent": second derivatives (2 dim, 2 dim); "slopes": derivatives of the energy by the
            parameters; "turned": (a, b, p, y) -> product of the second derivatives with y (2 dim,),
            and the derivatives of gradient times y by the parameters.
        """
        with undisturbed():
            return _functions(self)


@once
def _name(law: PairForms) -> str:
    import sympy as sp

    parts = law.energy, *law.first, *law.second, *law.parameters, *law.inner
    return f"pair {law.free} {' '.join(map(sp.srepr, parts))}"


@once
def _functions(law: PairForms) -> dict[str, Any]:
    import casadi as ca

    a, b, y = (ca.SX.sym(*of) for of in (("a", law.dim), ("b", law.dim), ("y", 2 * law.dim)))
    ends, reduced = _reduced(law), law.dim + law.free.count(False)
    x, turn = ca.SX.sym("x", reduced), ca.SX.sym("turn", reduced)
    p, z = ca.SX.sym("p", len(law.parameters)), ca.SX.sym("z", len(law.inner))
    energy, inner = _energy(law, x, p, z), ca.SX(0, 1)
    inward, follow = ca.gradient(energy, z), ca.SX(len(law.inner), reduced)
    if law.inner:
        follow = -_solved(ca.jacobian(inward, z), ca.jacobian(inward, x))
        step = ca.Function("step", [x, p, z], [z - _solved(ca.jacobian(inward, z), inward)])
        inner = ca.SX(len(law.inner), 1)
        for _ in range(ITERATIONS):
            before, inner = inner, step(x, p, inner)
        settled = ca.sumsqr(inner - before) <= SETTLED * (ADDED + ca.sumsqr(inner))
    slope, moved = ca.gradient(energy, x), ca.SX.sym("moved", len(law.inner))
    along = ca.dot(slope, turn) + ca.dot(inward, moved)
    bent = ca.vertcat(ends.T @ ca.gradient(along, x), ca.gradient(along, p))
    whole = ca.jacobian(slope, x) + ca.jacobian(slope, z) @ follow
    forms = {"pair": [energy, ends.T @ slope], "tangent": [ends.T @ whole @ ends]}
    forms |= {"gradient": forms["pair"][1:], "slopes": [ca.gradient(energy, p)], "turned": [bent]}

    def placed(form: Any) -> Any:
        if law.inner:
            form = ca.if_else(settled, form, math.nan)
        for symbol, value in ((moved, follow @ turn), (z, inner), (turn, ends @ y),
                              (x, _ends_of(law, a, b))):  # fmt: skip
            form = ca.substitute(form, symbol, ca.densify(value))
        return ca.cse(ca.densify(form))

    return {
        kind: ca.Function(
            f"pair_{kind}", [a, b, p, *[y] * (kind == "turned")], [placed(form) for form in several]
        )
        for kind, several in forms.items()
    }


def _ends_of(law: PairForms, a: Any, b: Any) -> Any:
    """What the energy depends on: the differences of free coordinates, of others both values."""
    import casadi as ca

    rows = [[b[k] - a[k]] if free else [a[k], b[k]] for k, free in enumerate(law.free)]
    return ca.vertcat(*(x for row in rows for x in row))


def _reduced(law: PairForms) -> Any:
    """The derivatives of `_ends_of` by both ends, (reduced, 2 dim)."""
    import casadi as ca

    a, b = ca.SX.sym("a", law.dim), ca.SX.sym("b", law.dim)
    return ca.sparsify(ca.DM(ca.evalf(ca.jacobian(_ends_of(law, a, b), ca.vertcat(a, b)))))


def _energy(law: PairForms, x: Any, p: Any, z: Any) -> Any:
    import casadi as ca

    values, known = iter(ca.vertsplit(x)), {}
    for one, other, free in zip(law.first, law.second, law.free, strict=True):
        known[one] = ca.SX(0) if free else next(values)
        known[other] = next(values)
    for symbols, given in ((law.parameters, p), (law.inner, z)):
        known |= dict(zip(symbols, ca.vertsplit(given) if symbols else [], strict=True))
    return ca.SX(to_casadi(law.energy, list(known))(*known.values()))


def _solved(matrix: Any, right: Any) -> Any:
    """The solution of symmetric equations by elimination, in CasADi."""
    import casadi as ca

    pivot = matrix[0, 0]
    if matrix.shape[0] == 1:
        return right / pivot
    column, rest = matrix[1:, 0] / pivot, matrix[1:, 1:]
    last = _solved(rest - column @ matrix[0, 1:], right[1:, :] - column @ right[0, :])
    return ca.vertcat((right[0, :] - matrix[0, 1:] @ last) / pivot, last)
