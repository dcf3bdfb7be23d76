"""C text of the loop backwards, and the functions of laws that it is made of.

The laws come from the same energies as those of the loop: tension, stiffness and derivatives by
parameters in one function, with common parts computed once and one division for each denominator.
"""

from __future__ import annotations

import ctypes

from tensegrity.engine import geometry, lanes
from tensegrity.engine.codegen import add, is_packed, joined, packs, run_text, scalar, take
from tensegrity.engine.law import applied, functions, interpret
from tensegrity.engine.native import library
from tensegrity.once import once


@once
def law_function(law, wanted):
    """CasADi function (r, p) -> tension, stiffness, derivatives of the tension by p[wanted]."""
    import casadi as ca

    below, above = law_parts(law, wanted)
    r, p = below.sx_in()
    return ca.Function("law", [r, p], [above(r, p, 1 / below(r, p))])


@once
def law_parts(law, wanted):
    """The same in two: (r, p) -> denominators, and (r, p, their reciprocals) -> the values.

    Written as one, CasADi would turn every product with a reciprocal into a quotient again, and
    divisions are what a processor waits for.
    """
    import casadi as ca

    r, p, (_, tension, stiffness, _) = law.forms()
    slopes = ca.gradient(tension, p) if law.parameters else ca.SX(0, 1)
    forms = ca.cse(ca.vertcat(tension, stiffness, slopes[list(wanted)]))
    values, found = _without_divisions(ca.Function("law", [r, p], [forms]), r, p)
    i, q = ca.SX.sym("i", len(found)), [x for x, _ in found]
    symbols = [symbol for _, symbol in found]
    inner = ca.vertcat(*symbols)
    for _ in found:  # a denominator may have others in it
        q = [ca.substitute(x, inner, 1 / ca.vertcat(*q)) if found else x for x in q]
    below = ca.Function("below", [r, p], [ca.vertcat(*q)])
    above = ca.Function("above", [r, p, i], [ca.substitute(values, inner, i)])
    return below, above


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


HOOK = """static inline void reverse_{k}(real r, const real *p, real *y)
{{
    real i[{count} + 1];
    const real *given[] = {{&r, p, i}};
    real *below[] = {{i}}, *above[] = {{y}};
    law{k}_below(given, below, 0, 0, 0);
    for (int j = 0; j < {count}; j++) i[j] = 1 / i[j];
    law{k}_above(given, above, 0, 0, 0);
}}"""

PACKS = """typedef pack loose __attribute__((aligned(8), may_alias));
#define INTO(at) (*(loose *)(at))"""


def c_text(laws, own, wanted, dim, exact):
    """C source of the loop backwards; see `codegen.c_text`.  `wanted`: of each law."""
    import casadi as ca

    generator, hooks = ca.CodeGenerator("laws.c"), []
    for number, law in enumerate(laws):
        below, above = law_parts(law, wanted[number])
        add(generator, number, "below", below)
        add(generator, number, "above", above)
        hooks.append(HOOK.format(k=number, count=below.nnz_out(0)))
        if exact:
            hooks.append(scalar(generator, number, "tension", functions(law)["tension"]))
        if own[number] is not None:
            hooks.append(take(number, len(law.parameters), own[number]))
    for function, hook in geometry.helpers(dim) if dim else ():
        generator.add(function)
        hooks.append(hook)
    beside = [is_packed(law) and not exact for law in laws]
    hooks += ["lanes.c", PACKS]
    for number, law in enumerate(laws):
        if beside[number]:
            hooks += _lanes(number, law, own[number], wanted[number])
    runs = [(k, kind) for k in range(len(laws)) for kind in (0, 1)[: 1 + (own[k] is not None)]]
    listed = " ".join(f"X({number}, {kind})" for number, kind in runs)
    most = max((len(law.parameters) for law in laws), default=0)
    parts = ["subnormal.c", "prelude.c", generator.dump(), *hooks]
    parts += [f"#define PARAMETERS {most}", f"#define RUNS(X) {listed}", f"#define EXACT {exact:d}"]
    for number, kind in runs:
        asked = len(wanted[number])
        parts += run_text("reverse_law.c", number, kind, beside[number], WANTED=asked)
    loop = "reverse_net.c" if dim else "reverse_line.c"
    return joined([*parts, "reverse.h", loop, "stages.h", "reverse_steps.c", *["steps.c"] * exact])


def _lanes(number, law, own, wanted):
    """C of the same for packs of bonds, for each kind of run."""
    arguments = "integer apart, const real *r, real *f, real *k, real *d, const real *shared, "
    arguments += "const real *own, integer all"
    found = [f"INTO({x} + g * GROUP)" for x in ("f", "k")]
    found += [f"INTO(d + {m} * apart + g * GROUP)" for m in range(len(wanted))]
    for kind in (0, 1)[: 1 + (own is not None)]:
        given = [["load(r + g * GROUP)"], packs(law, own if kind else (), "wide(shared[{}])")]
        name = f"reverse_lanes_{number}_{kind}"
        yield lanes.text(law_function(law, wanted), name, arguments, given, [found])


class Library:
    """Compiled text for some laws."""

    def __init__(self, laws, own, wanted, dim, exact):
        flags = [f"-DDIM={dim}"] if dim else []
        found = library(c_text(laws, own, wanted, dim, exact), flags)
        address, number = ctypes.c_void_p, ctypes.c_longlong
        calls = {
            "sow": [address, address, number],
            "reverse": [address] + [number] * 3 + [address],
            "evaluate": [number, number, number, *[address] * 5],
        }
        if exact:
            calls |= {"advance": [address] * 2 + [number] * 2, "show": [address] * 4}
        for name, arguments in calls.items():
            function = found[name]
            function.argtypes, function.restype = arguments, None
            setattr(self, name, function)


@once
def compiled(laws, own, wanted, dim, exact):
    """The library."""
    return Library(laws, own, wanted, dim, exact)
