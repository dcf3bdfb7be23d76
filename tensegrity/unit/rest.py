"""A unit at rest, in multiple precision: values, self-stress, and the Hessian of the mixed energy.

With n members of a kind, of length L and tension T, the forces on the coordinates q at rest are
sum n T dL/dq + dE/dq.  They vanish for the tensions T of the self-stress: the known ones are those
of members whose prestrain or natural length is given, the others follow from equilibrium.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any, NamedTuple, TypeAlias

import numpy as np

from tensegrity.errors import EquilibriumError, TensegrityError
from tensegrity.once import once

Described: TypeAlias = Any  # a `tensegrity.Unit`, which imports this module
DIGITS = 40  # of numbers at rest
BALANCED = 1e-9  # forces at rest that count as zero, over the sum of their parts
ROUND_OFF = 1e-12  # the same, over the forces that would change all lengths by themselves
MOST = 4  # forces named in a message
SINGULAR = 1e-11  # singular value over the largest, below which it is zero


class Rest(NamedTuple):
    """Numbers of the members of a unit at rest, of type mpf."""

    lengths: list[Any]
    tensions: list[Any]
    stiffness: list[Any]  # inf of a rigid member
    rates: list[list[Any]]  # of each member's length by the coordinates
    forces: list[Any]  # dE/dq
    bends: list[Any]  # |d2E/dq2| times the size of the coordinate


def values(unit: Described, expressions: Sequence[Any]) -> list[Any]:
    """Values at rest of expressions of coordinates and parameters.

    Returns
    -------
    list of mpf

    Raises
    ------
    TensegrityError
        A symbol has no value, or a value is not a finite real number.
    """
    import mpmath
    import sympy as sp

    known = {symbol: _exact(value) for symbol, value in unit.parameters.items()}
    given = known | {q: _exact(sp.sympify(x)).xreplace(known) for q, x in unit.rest.items()}
    forms = tuple(sp.sympify(x) for x in expressions)
    free = set().union(*(x.free_symbols for x in (*forms, *given.values()))) - set(given)
    if free:
        names = ", ".join(sorted(map(str, free)))
        raise TensegrityError(f"no value for the symbol {names}: parameters must have one")
    with mpmath.workdps(DIGITS):
        at = [number(x) for x in given.values()]
        try:
            found = [mpmath.mpmathify(x) for x in _function(forms, tuple(given))(*at)]
        except (ZeroDivisionError, OverflowError, ValueError, TypeError, NameError) as error:
            if len(forms) > 1:  # find the one
                return [x for form in forms for x in values(unit, [form])]
            raise TensegrityError(f"{forms[0]} is not defined at rest") from error
    for form, x in zip(forms, found, strict=True):
        if mpmath.isnan(x) or mpmath.im(x) or (mpmath.isinf(x) and form != sp.oo):
            raise TensegrityError(f"{form} is {mpmath.nstr(x, 6)} at rest, must be a finite number")
    return found


@once
def coordinates(unit: Described) -> tuple[float, ...]:
    """The coordinates at rest, the controlled one last."""
    return tuple(float(x) for x in values(unit, unit.coordinates))


def as_rational(value: Any) -> Any:
    """A number of type mpf as the SymPy number that it is."""
    import sympy as sp

    return sp.Rational(sp.Float(value, DIGITS + 5))


def number(value: Any) -> Any:
    """A number of SymPy as an mpf."""
    import mpmath
    import sympy as sp

    with mpmath.workdps(DIGITS):
        return mpmath.mpmathify(sp.N(value, DIGITS + 5))


@once
def _function(forms: Any, symbols: Any) -> Any:
    import sympy as sp

    return sp.lambdify(symbols, [_exact(x) for x in forms], "mpmath", cse=True)


def _exact(expression: Any) -> Any:
    """An expression with every float replaced by its exact rational value."""
    import sympy as sp

    floats = {x: sp.Rational(float(x)) for x in expression.atoms(sp.Float)}
    return expression.xreplace(floats)


@once
def at_rest(unit: Described) -> Rest:
    """Lengths, tensions and spring constants of the members of a unit at rest.

    Raises
    ------
    TensegrityError
        The unit is not defined at rest, a rigid member does not have its natural length there, or a
        string is in compression.
    EquilibriumError
        The rest is no equilibrium, or the prestrain leaves the self-stress open.
    """
    import mpmath
    import sympy as sp

    members, q = unit.members, unit.coordinates
    flat = [sp.diff(m.length, x) for m in members for x in q]
    flat += [sp.diff(unit.energy, x, order) for order in (1, 2) for x in q]
    flat += q
    values(unit, [*(m.length for m in members), unit.energy])  # these are named if they are wrong
    found = values(unit, [*(m.length for m in members), *(m.k for m in members), *flat])
    count, dim = len(members), len(q)
    lengths, stiffness, flat = found[:count], found[count : 2 * count], found[2 * count :]
    rates = [flat[i * dim : (i + 1) * dim] for i in range(count)]
    forces, bends, at = (flat[(count + k) * dim :][:dim] for k in range(3))
    bends = [abs(bend) * (abs(x) or 1) for bend, x in zip(bends, at, strict=True)]
    rest = Rest(lengths, [None] * count, stiffness, rates, forces, bends)
    with mpmath.workdps(DIGITS):
        _give_tensions(unit, rest)
        _solve_tensions(unit, rest)
    for number, (member, tension) in enumerate(zip(members, rest.tensions, strict=True)):
        if member.string and tension < -ROUND_OFF * _size(rest, number):
            raise TensegrityError(
                f"string {member.length}: tension {float(tension):g} N at rest must be at least 0"
            )
    return rest


def _size(rest: Rest, number: int) -> Any:
    """A force of the size that a member may have."""
    k, length = rest.stiffness[number], abs(rest.lengths[number])
    elastic = [x for x in rest.stiffness if x < float("inf")]
    return (k if k < float("inf") else max(elastic, default=1)) * (length or 1)


def _give_tensions(unit: Described, rest: Rest) -> None:
    """Put in the tensions of members whose prestrain or natural length is given."""
    for number, member in enumerate(unit.members):
        k, length = rest.stiffness[number], rest.lengths[number]
        rigid = k == float("inf")
        if member in unit.prestrain:
            (prestrain,) = values(unit, [unit.prestrain[member]])
            if not prestrain > -1:
                raise TensegrityError(
                    f"prestrain {float(prestrain):g} of {member.length} must be above -1"
                )
            if rigid:
                raise TensegrityError(
                    f"prestrain {float(prestrain):g} of {member.length}: a rigid member has none"
                )
            rest.tensions[number] = k * length * prestrain / (1 + prestrain)
        elif member.natural is not None:
            (natural,) = values(unit, [member.natural])
            if not rigid:
                rest.tensions[number] = k * (length - natural)
            elif abs(length - natural) > BALANCED * abs(natural):
                raise TensegrityError(
                    f"length {float(length):g} m of the rigid member {member.length} at rest must "
                    f"be its natural length {float(natural):g} m"
                )


def _solve_tensions(unit: Described, rest: Rest) -> None:
    """Put in the other tensions, those that equilibrium at rest demands."""
    import mpmath

    count = values(unit, [m.count for m in unit.members])
    missing = [i for i, t in enumerate(rest.tensions) if t is None]
    known = [i for i in range(len(count)) if i not in missing]
    loads = _unbalanced(unit, rest, count, known)
    for i in missing:
        rest.tensions[i] = mpmath.mpf(0)
    if not any(loads):
        return
    rank = 0
    if missing:
        rows = [[count[i] * rest.rates[i][k] for i in missing] for k in range(len(loads))]
        sizes = np.linalg.svd(np.array(rows, dtype=np.float64), compute_uv=False)
        rank = int((sizes > SINGULAR * max(sizes.max(), 1e-300)).sum())
        if rank < len(missing):
            names = ", ".join(str(unit.members[i].length) for i in missing[:MOST])
            raise EquilibriumError(
                f"the prestrain leaves {len(missing) - rank} states of self-stress open: give "
                f"prestrain or natural of {names}"
            )
        solved = mpmath.lu_solve(mpmath.matrix(rows), -mpmath.matrix(loads))
        for i, tension in zip(missing, solved, strict=True):
            rest.tensions[i] = tension
    left = _unbalanced(unit, rest, count, range(len(count)))
    pairs = [(q, x) for q, x in zip(unit.coordinates, left, strict=True) if x]
    if pairs:
        forces = ", ".join(f"{q} {float(x):.6g} N" for q, x in pairs[:MOST])
        if any(unit.prestrain.values()):
            raise EquilibriumError(
                f"no self-stress at rest: the lengths of the {len(missing)} members without "
                f"prestrain have rank {rank}, and a force is left on {forces}"
            )
        raise EquilibriumError(f"rest is no equilibrium: a force is left on {forces}")


def _unbalanced(unit: Described, rest: Rest, count: list[Any], of: Sequence[int]) -> list[Any]:
    """Forces on the coordinates by the further energy and some of the members, 0 where it is
    round-off of its parts."""
    left = []
    for k, force in enumerate(rest.forces):
        parts = [count[i] * rest.tensions[i] * rest.rates[i][k] for i in of]
        whole = force + sum(parts)
        sizes = [abs(n * x[k]) * _size(rest, i)
                 for i, (n, x) in enumerate(zip(count, rest.rates, strict=True))]  # fmt: skip
        limit = BALANCED * (sum(map(abs, parts)) + abs(force))
        limit += ROUND_OFF * (sum(sizes) + rest.bends[k])
        left.append(whole if abs(whole) > limit else whole * 0)
    return left


@once
def hessian(unit: Described) -> Any:
    """Second derivatives of the mixed energy at rest, by the coordinates and then the tensions.

    Returns
    -------
    mpmath.matrix
    """
    import mpmath
    import sympy as sp

    rest, q = at_rest(unit), unit.coordinates
    dim, size = len(q), len(q) + len(unit.members)
    places = [(i, j) for i in range(dim) for j in range(i, dim)]
    curvatures = [sp.diff(m.length, q[i], q[j]) for m in unit.members for i, j in places]
    curvatures += [sp.diff(unit.energy, q[i], q[j]) for i, j in places]
    found = values(unit, [*curvatures, *(m.count for m in unit.members)])
    with mpmath.workdps(DIGITS):
        matrix, step = mpmath.zeros(size, size), len(places)
        counts = found[len(found) - len(unit.members) :]
        weights = [n * t for n, t in zip(counts, rest.tensions, strict=True)]
        for k, (i, j) in enumerate(places):
            parts = [w * found[m * step + k] for m, w in enumerate(weights)]
            matrix[i, j] = matrix[j, i] = sum(parts) + found[len(weights) * step + k]
        for m, n in enumerate(counts):
            for i in range(dim):
                matrix[i, dim + m] = matrix[dim + m, i] = n * rest.rates[m][i]
            matrix[dim + m, dim + m] = -n / rest.stiffness[m]
    return matrix


def condensed_stiffness(unit: Described) -> Any:
    """Stiffness of the one controlled coordinate, the others in equilibrium; of type mpf.

    Raises
    ------
    TensegrityError
        The others have a motion without stiffness.
    """
    import mpmath

    check_inner(unit)
    whole, at = hessian(unit), len(unit.inner)
    with mpmath.workdps(DIGITS):
        rows = [k for k in range(whole.rows) if k != at]
        inner = mpmath.matrix([[whole[i, j] for j in rows] for i in rows])
        if not rows:
            return whole[at, at]
        column = mpmath.matrix([whole[i, at] for i in rows])
        return whole[at, at] - (column.T * mpmath.lu_solve(inner, column))[0]


@once
def check_inner(unit: Described) -> None:
    """Refuse a unit whose inner coordinates have a motion without stiffness at rest."""
    whole, at = hessian(unit), len(unit.inner)
    rows = [k for k in range(whole.rows) if not at <= k < len(unit.coordinates)]
    matrix = np.array([[float(whole[i, j]) for j in rows] for i in rows], dtype=np.float64)
    if not rows:
        return
    scale = 1 / np.sqrt(np.maximum(np.abs(matrix).max(axis=1), 1e-300))
    _, sizes, modes = np.linalg.svd(matrix * scale * scale[:, None])
    if sizes[-1] > SINGULAR * sizes[0]:
        return
    names = [*map(str, unit.inner), *(f"tension of {m.length}" for m in unit.members)]
    mode = modes[-1] * scale
    mode = mode / mode[np.argmax(np.abs(mode) > 0.999 * np.abs(mode).max())]
    parts = [f"{name} {x:.3g}" for name, x in zip(names, mode, strict=True) if abs(x) > 1e-6]
    raise TensegrityError(
        f"the inner coordinates have a motion without stiffness at rest: {', '.join(parts)}"
    )
