"""Enclosures of folds of prisms, by Krawczyk's test of a bordered system.

The equilibria of a prism are stationary points of its mixed energy in the unknowns z: base, twist,
height, and the tensions of the members, which rigid members have as multipliers.  With the load p
on the height, at a fold

    g(z) + p e = 0,  K(z) v = 0,  w v = 1,

where g and K are the first and second derivatives of the energy, e the direction of the height, v
the null vector and w an approximation of it.  It is a limit point of the load as v e is not 0.  Of
F(x) = 0 and an approximate inverse A of its Jacobian, the box X about m contains exactly one root
where m - A F(m) + (1 - A F'(X)) (X - m) is in its interior, and the root is in that image.
Sources: R. Krawczyk, Computing 4, 187 (1969); R. E. Moore, SIAM J. Numer. Anal. 14, 611 (1977);
the energy is that of `derivations.prism`.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass
from typing import Any

import numpy as np

from tensegrity.engine.programs import derived, run
from tensegrity.errors import TensegrityError
from tensegrity.prisms.problem import EquilibriumPath
from tensegrity.proofs.balls import Balls, Enclosure, ball, flint, fraction, precision

FOLD_BITS = 256
WIDTHS = [10.0**-k for k in range(2, 11)]  # of the box in which the root is the only one
NEWTON, SHRINKS = 4, 8  # steps to the middle of the box, and of its image
UNKNOWNS = 6  # of the mixed energy


@dataclass(frozen=True)
class Fold:
    """A limit point of a prism, enclosed.

    Attributes
    ----------
    height, load, twist, base : Enclosure
        [m], [N] with compression > 0, [rad], [m].
    unique : float
        Half the range of heights in which it is the only one [m], with the other unknowns as near
        in the same units: the base at rest, k_cross times it.
    """

    height: Enclosure
    load: Enclosure
    twist: Enclosure
    base: Enclosure
    unique: float

    @property
    def radius(self) -> float:
        """The largest of the radii."""
        return max(x.radius for x in (self.height, self.load, self.twist, self.base))

    def __str__(self) -> str:
        return (
            f"proved: a fold at height {self.height} m, load {self.load} N, twist {self.twist} "
            f"rad, base {self.base} m, the only one within {self.unique:.2g} m"
        )


def folds(path: EquilibriumPath, read: str) -> tuple[Fold, ...]:
    """Enclosures of the folds of a prism.

    Parameters
    ----------
    path : EquilibriumPath
    read : {"decimals", "double"}
        What floats stand for.

    Returns
    -------
    tuple of Fold

    Raises
    ------
    TensegrityError
        A fold cannot be proved, as where it is one of a family or two are nearly one.
    """
    prism, own = path.prism, Balls()
    if not any(event.kind == "fold" for event in path.events):
        return ()
    system, found = derived(_system, prism.sides), []
    with precision(FOLD_BITS):
        unit = [ball(str(fraction(x, read))) for x in (prism.base, prism.k_cross)]
        numbers = [ball(str(fraction(x, read))) for x in (prism.height, prism.prestrain)]
        eases = [_ease(unit[1], k, read) for k in (prism.k_base, prism.k_bar)]
        given = [numbers[0] / unit[0], numbers[1], *eases]
        force = unit[0] * unit[1]

        def values(z: list[Any], v: list[Any]) -> tuple[list[Any], Any, Any]:
            every = run(system, own, [*z, *v, *map(flint().arb, given)])
            n = UNKNOWNS
            square = [flint().arb_mat(n, n, every[n + k * n * n :][: n * n]) for k in (0, 1)]
            return every[:n], *square

        for event in path.events:
            if event.kind == "fold":
                start = _start(event, prism)
                box, width = _enclosed(values, start)
                if box[UNKNOWNS + 3].contains(0):
                    raise TensegrityError(
                        f"the critical mode at height {event.at['height']:.9g} m is not shown to "
                        "change it: no fold is proved"
                    )
                at = [Enclosure.of(x) for x in (box[2] * unit[0], box[UNKNOWNS] * force, box[1],
                                                box[0] * unit[0])]  # fmt: skip
                found.append(Fold(*at, width * prism.base))
    return tuple(found)


def _ease(k_cross: Any, k: float, read: str) -> Any:
    """k_cross over a spring constant; 0 of rigid members."""
    return flint().fmpq(0) if math.isinf(k) else k_cross / ball(str(fraction(k, read)))


def _start(event: Any, prism: Any) -> list[float]:
    at, force = event.at, prism.k_cross * prism.base
    state = [at["base"] / prism.base, at["twist"], at["height"] / prism.base]
    tensions = [at[f"{kind}_tension"] / force for kind in ("cross", "base", "bar")]
    return [*state, *tensions, at["load"] / force]


def _enclosed(values: Callable[..., Any], start: list[float]) -> tuple[list[Any], float]:
    """A box with one fold, unknowns, load and null vector, and the width in which it is alone."""
    arb, arb_mat, n = flint().arb, flint().arb_mat, UNKNOWNS
    z = [arb(x) for x in start[:n]]
    stiff = np.array([float(x) for x in values(z, [arb(0)] * n)[1].entries()]).reshape(n, n)
    weight = [arb(x) for x in np.linalg.svd(stiff)[2][-1].tolist()]

    def residual(x: list[Any]) -> list[Any]:
        z, load, v = x[:n], x[n], x[n + 1 :]
        g, stiff, _ = values(z, v)
        g[2] = g[2] + load
        moved = (stiff * arb_mat(n, 1, v)).entries()
        return [*g, *moved, sum((a * b for a, b in zip(weight, v, strict=True)), arb(-1))]

    def jacobian(x: list[Any]) -> Any:
        _, stiff, bent = values(x[:n], x[n + 1 :])
        rows = [[arb(0)] * (2 * n + 1) for _ in range(2 * n + 1)]
        for k in range(n):
            for j in range(n):
                rows[k][j], rows[n + k][j], rows[n + k][n + 1 + j] = (
                    stiff[k, j], bent[k, j], stiff[k, j],
                )  # fmt: skip
            rows[2 * n][n + 1 + k] = weight[k]
        rows[2][n] = arb(1)
        return arb_mat(rows)

    return krawczyk(residual, jacobian, [*z, arb(start[n]), *weight])


def krawczyk(
    residual: Callable[[list[Any]], list[Any]], jacobian: Callable[[list[Any]], Any],
    start: list[Any],
) -> tuple[list[Any], float]:  # fmt: skip
    """A box with exactly one root of a system near a point.

    Parameters
    ----------
    residual : callable (x) -> list of arb, (n,)
    jacobian : callable (x) -> arb_mat, (n, n)
        Both of lists of arb.
    start : list of arb, (n,)

    Returns
    -------
    box : list of arb, (n,)
    width : float
        Each unknown of the root is the only one within so much of the middle.

    Raises
    ------
    TensegrityError
        No root is proved.
    """
    arb, arb_mat, n = flint().arb, flint().arb_mat, len(start)
    middle = [x.mid() for x in start]
    try:
        for _ in range(NEWTON):
            slope = arb_mat(n, n, [x.mid() for x in jacobian(middle).entries()])
            inverse = arb_mat(n, n, [x.mid() for x in slope.inv().entries()])
            step = (inverse * arb_mat(n, 1, residual(middle))).entries()
            middle = [(x - d).mid() for x, d in zip(middle, step, strict=True)]
    except ZeroDivisionError:
        raise TensegrityError("no fold is proved: the system is singular") from None
    newton = (inverse * arb_mat(n, 1, residual(middle))).entries()

    def image(box: list[Any]) -> list[Any]:
        left = (inverse * jacobian(box)).tolist()
        for k in range(n):
            left[k][k] = left[k][k] - 1
        apart = arb_mat(n, 1, [x - m for x, m in zip(box, middle, strict=True)])
        moved = (arb_mat(left) * apart).entries()
        return [m - d - e for m, d, e in zip(middle, newton, moved, strict=True)]

    for width in WIDTHS:
        box = [m + arb(0, width) for m in middle]
        found = image(box)
        if all(y.is_finite() and x.contains_interior(y) for x, y in zip(box, found, strict=True)):
            break
    else:
        raise TensegrityError(
            f"no root is proved near {', '.join(f'{float(x):.9g}' for x in middle[:3])}: it is "
            "one of several, nearly, or no equilibrium is there"
        )
    for _ in range(SHRINKS):
        found = [x.intersection(y) for x, y in zip(found, image(found), strict=True)]
    return found, width


def _system(sides: int) -> tuple[list[Any], list[Any]]:
    """g, K and the derivatives of K v, and the symbols z, v and height, prestrain and compliances
    in units of the base and of k_cross."""
    import sympy as sp

    from derivations import prism
    from derivations.elastic import bar_compliance, base_compliance
    from derivations.regular import Polygon

    of, eases = Polygon(sides), (1, base_compliance, bar_compliance)
    tensions, v = sp.symbols("T:3", real=True), sp.symbols(f"v:{UNKNOWNS}", real=True)
    energy = sp.Integer(0)
    for one, t, rest, ease in zip(
        prism.members(), tensions, prism.reference_tensions(of), eases, strict=True
    ):
        length = one.length(of)
        at_rest = prism.at_reference(length, of).subs(prism.base, 1)
        energy += one.count(of) * (t * (length - at_rest) - ease * (t - rest) ** 2 / 2)
    z = [prism.base, prism.twist, prism.height, *tensions]
    g = [sp.diff(energy, x) for x in z]
    stiff = [[sp.diff(f, x) for x in z] for f in g]
    moved = [sum(k * x for k, x in zip(row, v, strict=True)) for row in stiff]
    bent = [sp.diff(f, x) for f in moved for x in z]
    symbols = [*z, *v, prism.reference_height, prism.prestrain, base_compliance, bar_compliance]
    return [*g, *(k for row in stiff for k in row), *bent], symbols
