"""C text of a loop over bonds of given laws: forward, and reverse with derivatives.

CasADi writes the C of the functions of a law, and `simd` that for several bonds in SIMD registers;
both are inserted unchanged between `prelude.c` and the text of a loop.
"""

from __future__ import annotations

from tensegrity.engine import geometry, simd
from tensegrity.engine.law import DERIVATIVES, Change, applied, functions, interpret, law_properties
from tensegrity.engine.native import concatenated
from tensegrity.once import once

LONG = 500  # least instructions of a law that is compiled as a function, not inlined in the loop
STEPS = {  # files for each kind of steps
    "": (),
    "nystrom": ("nystrom.c",),
    "openings": ("overlaps.c", "openings.c"),
    "implicit": ("implicit.c",),
    "driven": ("driven.c",),
}


def c_text(laws, own=None, dim=0, steps="", helpers=()):
    """C source of a loop over bonds of the given laws, numbered in their order.

    Parameters
    ----------
    laws : sequence of Law
        Or, of springs of which some change in time, the `Change` of each.
    own : sequence of (tuple of int or None), optional
        For each law the indices of parameters that each bond of a run has of its own; None where
        the bonds of all runs are equal.
    dim : int, optional
        Number of coordinates of a site in a network; 0 for a chain.  The files are `<loop>_law.c`,
        once for each kind of run, and `<loop>.c`, of the loop "line" or "net".
    steps : str, optional
        The kind of steps, a key of `STEPS`, besides those of `steps.c`.
    helpers : sequence of (casadi.Function, str), optional
        Further functions, and the C by which they are called.

    Returns
    -------
    str
    """
    own, loop = own or (None,) * len(laws), "net" if dim else "line"
    changes = any(isinstance(law, Change) for law in laws)
    names = ["energy"] if changes else ["tension", *["stiffness"] * (steps == "implicit")]
    scalars = [
        scalar(number, name, functions(law)[name])
        for number, law in enumerate(laws)
        for name in names
    ]
    runs, parts = [], ["scene.h"]
    packed = _contacts(laws, own, dim) if dim else []
    for k, law in enumerate(laws):
        in_simd = bool(dim or changes) or law_properties(law)["packed"]
        for kind in kinds(law, own[k]):
            runs.append((k, kind))
            count, text = _tensions(k, kind, law, own[k], dim) if in_simd else (0, "")
            packed.append(text)
            flags = {"K": k, "OWNED": kind, "IS_LONG": is_long(law), "IN_SIMD": in_simd}
            flags["WAITING"] = max(1, count)
            parts += [*_defined(flags), f"{loop}_law.c", *(f"#undef {x}" for x in flags)]
    lists = {"RUNS": runs, "LAWS": zip(range(len(laws)))}
    flags = {"CHANGES": changes}
    parts += [f"{loop}.c", "steps.c", *STEPS[steps]]
    more = ("tangent",) * (steps == "implicit")
    return whole(laws, own, [*scalars, *helpers], dim, packed, lists, flags, parts, more)


def stepper_text(dim, steps, forces=()):
    """C source of steps that are the same for all laws, and take the stages of their loop.

    Parameters
    ----------
    dim, steps
        As of `c_text`.
    forces : sequence of ForceLaw, optional
        Forces of time, displacement and velocity, which steps of the kind "nystrom" then take.

    Returns
    -------
    str
    """
    packed = geometry.side_by_side(dim, None) if dim else []
    rows, hooks, before = _forces(forces)
    parts = ["#define STEPPER", "scene.h", f"{'net' if dim else 'line'}.c", *before, "steps.c"]
    return whole((), (), hooks, dim, packed, rows, {}, [*parts, *STEPS[steps]])


def evaluate_text(law):
    """C source of a law outside of loops: `evaluate.c`.

    Parameters
    ----------
    law : Law
        Or a `Change`.

    Returns
    -------
    str
    """
    names = law.compiled
    hooks = [scalar(0, name, functions(law)[name]) for name in names]
    in_packs = law_properties(law)["packed_energy"]
    packed = ["#if WIDE == 8", _energies(law), "#endif"] * in_packs
    lists = {"EVALUATIONS": [(DERIVATIVES.index(name), name) for name in names]}
    return whole((law,), (None,), hooks, 0, packed, lists, {"IN_PACKS": in_packs}, ["evaluate.c"])


def _forces(forces):
    """The list of forces, their functions, and the file that applies them."""
    if not forces:
        return {}, [], []
    rows = [(k, *one.macro) for k, one in enumerate(forces)]
    hooks = [_force(k, one) for k, one in enumerate(forces)]
    hooks += [_onset(k, one) for k, one in enumerate(forces) if one.onset is not None]
    return {"FORCES": rows}, hooks, ["forced.c"]


def _onset(number, force):
    """How a force begins where a contact closes, and the C that calls it."""
    import casadi as ca

    unique, function = f"begin{number}", force.onset.function(force.parameters)
    sx = function.sx_in()
    return ca.Function(unique, sx, [function(*sx)]), (
        f"static inline real onset_{number}(real q, const real *p) {{ real y; "
        f"const real *arg[] = {{&q, p}}; real *res[] = {{&y}}; {unique}(arg, res, 0, 0, 0); "
        "return y; }"
    )


def _force(number, force):
    """The function of a force for CasADi to write, and the C that calls it."""
    import casadi as ca

    unique, function = f"force{number}", force.function()
    sx = function.sx_in()
    none = f"static inline real onset_{number}(real q, const real *p) {{ return 0; }}"
    return ca.Function(unique, sx, [function(*sx)]), (
        f"static inline void force_{number}(real t, const real *x, const real *p, real *y) {{ "
        f"const real *arg[] = {{&t, x, p}}; real *res[] = {{y}}; {unique}(arg, res, 0, 0, 0); }}\n"
        f"{none if force.onset is None else ''}"
    )


def reverse_text(laws, own, wanted, dim):
    """C source of the reverse loop: `reverse.c` and `reverse_nystrom.c`.

    Parameters
    ----------
    laws, own, dim
        As of `c_text`.
    wanted : sequence of tuple of int
        For each law the indices of the parameters with respect to which to differentiate.

    Returns
    -------
    str
    """
    arguments = (
        "integer stride, const real *r, real *f, real *k, real *d, const real *shared, "
        "const real *own, integer all"
    )
    hooks, packed, runs, scalars = [], [], [], []
    for number, law in enumerate(laws):
        function, count = law_function(law, wanted[number]), len(wanted[number])
        mine = [(number, kind) for kind in (0, 1)[: 1 + (own[number] is not None)]]
        runs += mine
        if not law_properties(law)["packed"]:
            scalars += [(*run, count) for run in mine]
            hooks.append(scalar(number, "slopes", function))
            continue
        targets = [f"INTO({x} + g * WIDE)" for x in ("f", "k")]
        targets += [f"INTO(d + {m} * stride + g * WIDE)" for m in range(count)]
        for _, kind in mine:
            p = _packs(law, own[number] if kind else (), "wide(shared[{}])")
            given, name = [["load(r + g * WIDE)"], p], f"slopes_{number}_{kind}"
            packed.append(simd.text(function, name, arguments, given, [targets]))
    lists = {"RUNS": runs, "SCALARS": scalars}
    parts = ["reverse.c", "reverse_nystrom.c"]
    if geometry.own(laws) is not None:
        packed.append("#define ENDS")
        lists["WANTED"] = enumerate(wanted[0])
    return whole(laws, own, hooks, dim, packed, lists, {}, parts, ("turned",))


def _contacts(laws, own, dim):
    """C of the elongations of contacts, or energies of both ends, for each kind of run."""
    law = geometry.own(laws)
    kinds_of = () if law is None else kinds(law, own[0])
    packs = [
        (f"0_{kind}", _packs(law, own[0] if kind else (), "p[{}]", "GROUP")) for kind in kinds_of
    ]
    return geometry.side_by_side(dim, law, packs)


def whole(laws, own, hooks, dim, packed, lists, flags, parts, of_ends=()):
    """Assemble a C source.

    Parameters
    ----------
    laws, own, dim
        As of `c_text`.
    hooks : sequence of (casadi.Function, str)
        Functions for CasADi to write, and the C by which they are called.
    packed : sequence of str
        C of SIMD functions.
    lists : dict of str to sequence of tuples
        Arguments X(...) of list macros.
    flags : dict of str to int or bool
        Macros.
    parts : sequence of str
        Names of files, and C text.
    of_ends : sequence of str, optional
        Functions of a law of both ends besides "pair"; see `PairForms.functions`.

    Returns
    -------
    str
    """
    import casadi as ca

    generator = ca.CodeGenerator("laws.c")
    if dim:
        hooks = [*hooks, *geometry.helpers(dim, geometry.own(laws), ("pair", *of_ends))]
    for function, _ in hooks:
        generator.add(function)
    takes = [_take(k, law, own[k]) for k, law in enumerate(laws) if own[k] is not None]
    defines = {"PARAMETERS": max((len(law.parameters) for law in laws), default=0)}
    defines |= flags
    for name, rows in lists.items():
        defines[f"{name}(X)"] = " ".join(f"X({', '.join(map(str, row))})" for row in rows)
    begin = ["prelude.c", generator.dump(), *(hook for _, hook in hooks), *takes, "simd.c"]
    return concatenated([*begin, *packed, *_defined(defines), *parts])


def _defined(values):
    return [f"#define {x} {int(y) if isinstance(y, bool) else y}" for x, y in values.items()]


def scalar(number, name, function):
    """A function of a law for CasADi to write, and the C that calls it.

    Parameters
    ----------
    number : int
        Number of the law.
    name : str
    function : casadi.Function
        Of r and p.

    Returns
    -------
    casadi.Function, str
        The C defines `<name>_<number>(r, p)`; for several results with their address after p.
    """
    import casadi as ca

    unique, sx = f"law{number}_{name}", function.sx_in()
    takes, begin, to, end = "real r, const real *p", "real y; ", "&y", " return y;"
    if function.numel_out() > 1:
        takes, begin, to, end = f"{takes}, real *y", "", "y", ""
    return ca.Function(unique, sx, [function(*sx)]), (
        f"static inline {'real' if end else 'void'} {name}_{number}({takes}) {{ {begin}const real "
        f"*arg[] = {{&r, p}}; real *res[] = {{{to}}}; {unique}(arg, res, 0, 0, 0);{end} }}"
    )


def cost(law):
    """Estimate of the time of a tension in a compiled loop [s], from a count of operations."""
    return law_properties(law)["cost"]


def is_long(law):
    """Whether a law is compiled once as a function, instead of inlined in the loop."""
    law = law.law if isinstance(law, Change) else law
    return law_properties(law)["instructions"] > LONG


def kinds(law, own):
    """Kinds of runs compiled for a law: 0 where bonds share all parameters, 1 where not."""
    if own is None:
        return (0,)
    return (1,) if is_long(law) else (0, 1)


def _packs(law, own, one, wide="WIDE"):
    """C of SIMD vector number g of each parameter: `one` formatted with its index, or a load from
    the column of bonds' own values."""
    return [
        f"load(own + {own.index(k)} * all + g * {wide})" if k in own else one.format(k)
        for k in range(len(law.parameters))
    ]


def _tensions(number, kind, law, own, dim):
    """C of the tensions of several contacts, `tension_lanes_<law>_<kind of run>`; for a chain in
    two functions, with the rates of energies of changing bonds in the block after the tensions.
    Also the number of vectors that are stored between the two functions."""
    shared, one = ("pack", "p[{}]") if dim else ("real", "wide(p[{}])")
    arguments = f"const pack *r, const {shared} *p, const real *own, integer all, pack *f"
    p = _packs(law, own if kind else (), one, "GROUP" if dim else "WIDE")
    changes = isinstance(law, Change)
    function, targets = functions(law.law if changes else law)["tension"], [["f[g]"]]
    if changes and dim:
        p = p[: len(p) // 2]
    elif changes:
        function, targets = law.both(), [["f[g]"], ["f[BLOCK / WIDE + g]"]]
    name = f"tension_lanes_{number}_{kind}"
    given = [["r[g]"], p]
    if dim:
        return 0, simd.text(function, name, arguments, given, targets)
    return simd.two_functions(function, name, "", arguments, given, targets)


def _energies(law):
    """C of the energies of several bonds in SIMD registers, `energy_lanes_0`."""
    arguments, p = "const pack *r, const real *p, pack *e", _packs(law, (), "wide(p[{}])")
    return simd.text(
        functions(law)["energy"], "energy_lanes_0", arguments, [["r[g]"], p], [["e[g]"]]
    )


def _take(number, law, own):
    """C that gathers the parameters of bond q of a run, its own from columns of length `all`."""
    each = " ".join(
        f"p[{k}] = own[{own.index(k)} * all + q];" if k in own else f"p[{k}] = shared[{k}];"
        for k in range(len(law.parameters))
    )
    return (
        f"static inline void take_{number}(real *p, const real *restrict shared, "
        f"const real *restrict own, integer all, integer q) {{ {each} }}"
    )


@once
def law_function(law, wanted):
    """CasADi function (r, p) -> tension, stiffness, derivatives of the tension in p[wanted]."""
    import casadi as ca

    r, p, (_, tension, stiffness, _) = _differentiated(law, wanted).forms()
    _, slopes = _slopes(law, r, p, tension)
    forms = ca.cse(ca.vertcat(tension, stiffness, slopes[list(wanted)]))
    values, divisors = _without_divisions(ca.Function("law", [r, p], [forms]), r, p)
    q, inner = [x for x, _ in divisors], ca.vertcat(*(symbol for _, symbol in divisors))
    for _ in divisors:  # a denominator may contain others
        q = [ca.substitute(x, inner, 1 / ca.vertcat(*q)) for x in q]
    return ca.Function("law", [r, p], [ca.substitute(values, inner, 1 / ca.vertcat(*q))])


def _without_divisions(function, r, p):
    """Outputs with symbols for reciprocals, and pairs of a denominator and its symbol.

    The reciprocal of a factor of another denominator is computed from the reciprocal of the latter;
    only in functions without conditions, where a denominator of 0 invalidates all results anyway.
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
                return 1.5 - 0.5 * x  # of 1 or 2, in the derivative of an extremum
            known[key] = x, ca.SX.sym(f"i{len(known)}")
        return known[key][1]

    def apply(operation, *values):
        if operation == ca.OP_DIV and not values[1].is_constant():
            return values[0] * reciprocal(values[1])
        return reciprocal(*values) if operation == ca.OP_INV else applied(operation, *values)

    values = ca.vertcat(*interpret(function, inputs, apply))
    if chosen:
        return values, list(known.values())
    pairs = []
    for x, symbol in known.values():
        for whole, other in known.values():
            rest = None if whole is x else _rest(whole, x)
            if rest is not None:
                values = ca.substitute(values, symbol, rest * other)
                break
        else:
            pairs.append((x, symbol))
    return values, pairs


def _rest(product, factor):
    """The other factors of a product, or None where it does not contain a factor."""
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
    """Numbers of the parameters in the tension of a law, or in its gradient by both ends."""
    if geometry.own((law,)):
        return frozenset(range(len(law.parameters)))
    return _occurring(getattr(law, "general", None) or law)


@once
def _occurring(law):
    import casadi as ca

    _, p, (_, tension, _, _) = law.forms()
    return frozenset(k for k in range(p.numel()) if ca.depends_on(tension, p[k]))


def _differentiated(law, wanted):
    """The law itself, or its general one where parameters that it is compiled for are wanted."""
    general = getattr(law, "general", None)
    return law if general is None or {*wanted} <= _occurring(law) else general


def _slopes(law, r, p, form):
    """Derivatives of energy and tension by the parameters, the law's own or those of a form."""
    import casadi as ca

    if hasattr(law, "by_parameters"):
        return law.by_parameters(r, p)
    return [ca.gradient(form, p) if law.parameters else ca.SX(0, 1)] * 2


@once
def energy_function(law, wanted):
    """CasADi function (r, p) -> energy, tension, derivatives of the energy in p[wanted]."""
    import casadi as ca

    r, p, (energy, tension, _, _) = _differentiated(law, wanted).forms()
    slopes, _ = _slopes(law, r, p, energy)
    return ca.Function("stored", [r, p], [ca.vertcat(energy, tension, slopes[list(wanted)])])
