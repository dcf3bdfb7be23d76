"""Laws with their derivatives by parameters, for the loop backwards.

They come from the same energies as those of the loop: tension, stiffness and derivatives by
parameters in one function, with common parts computed once and one division for each denominator.
"""

from __future__ import annotations

from tensegrity.engine.law import applied, interpret
from tensegrity.once import once


@once
def law_function(law, wanted):
    """CasADi function (r, p) -> tension, stiffness, derivatives of the tension by p[wanted]."""
    import casadi as ca

    r, p, (_, tension, stiffness, _) = law.forms()
    slopes = ca.gradient(tension, p) if law.parameters else ca.SX(0, 1)
    forms = ca.cse(ca.vertcat(tension, stiffness, slopes[list(wanted)]))
    values, found = _without_divisions(ca.Function("law", [r, p], [forms]), r, p)
    q, inner = [x for x, _ in found], ca.vertcat(*(symbol for _, symbol in found))
    for _ in found:  # a denominator may have others in it
        q = [ca.substitute(x, inner, 1 / ca.vertcat(*q)) for x in q]
    return ca.Function("law", [r, p], [ca.substitute(values, inner, 1 / ca.vertcat(*q))])


def _without_divisions(function, r, p):
    """Outputs with symbols for reciprocals, and pairs of a denominator and its symbol.

    A reciprocal of a factor of another denominator is made from that: where nothing is chosen, so
    that one that is 0 spoils the others anyhow.
    """
    import casadi as ca

    inputs = [[r], ca.vertsplit(p) if p.numel() else []]
    known = {}
    operations = map(function.instruction_id, range(function.n_instructions()))
    chosen = {ca.OP_IF_ELSE_ZERO, ca.OP_NOT, ca.OP_AND, ca.OP_OR}.intersection(operations)

    def reciprocal(x):
        key = x.element_hash()
        if key not in known:
            if x.is_op(ca.OP_TWICE):
                return 0.5 * reciprocal(x.dep(0))
            if x.is_op(ca.OP_ADD) and x.dep(0).is_op(ca.OP_LE) and x.dep(1).is_op(ca.OP_LE):
                return 1.5 - 0.5 * x  # of 1 or 2: how an extremum chooses
            known[key] = x, ca.SX.sym(f"i{len(known)}")
        return known[key][1]

    def apply(operation, *values):
        if operation == ca.OP_DIV and not values[1].is_constant():
            return values[0] * reciprocal(values[1])
        return reciprocal(*values) if operation == ca.OP_INV else applied(operation, *values)

    values = ca.vertcat(*interpret(function, inputs, apply))
    if chosen:
        return values, list(known.values())
    kept = []
    for x, symbol in known.values():
        for whole, other in known.values():
            rest = None if whole is x else _rest(whole, x)
            if rest is not None:
                values = ca.substitute(values, symbol, rest * other)
                break
        else:
            kept.append((x, symbol))
    return values, kept


def _rest(product, factor):
    """What is left of a product without a factor, or None where it has no such factor."""
    import casadi as ca

    if product.element_hash() == factor.element_hash():
        return ca.SX(1)
    if product.is_op(ca.OP_MUL):
        one, other = product.dep(0), product.dep(1)
        for mine, left in ((one, other), (other, one)):
            rest = _rest(mine, factor)
            if rest is not None:
                return rest * left
    return None


@once
def depends_on(law):
    """Numbers of the parameters that the tension of a law depends on."""
    import casadi as ca

    _, p, (_, tension, _, _) = law.forms()
    return frozenset(k for k in range(p.numel()) if ca.depends_on(tension, p[k]))


@once
def energy_function(law, wanted):
    """CasADi function (r, p) -> energy, tension, derivatives of the energy by p[wanted]."""
    import casadi as ca

    r, p, (energy, tension, _, _) = law.forms()
    slopes = ca.gradient(energy, p) if law.parameters else ca.SX(0, 1)
    return ca.Function("stored", [r, p], [ca.vertcat(energy, tension, slopes[list(wanted)])])
