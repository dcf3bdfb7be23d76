"""C text of a loop over bonds, from their laws: forwards, and backwards with derivatives.

CasADi writes the C of a law's functions, and `simd` that for several bonds side by side; both are
used as they are written, between `prelude.c` and the text of a loop.
"""

from __future__ import annotations

from typing import TYPE_CHECKING

from tensegrity.engine import geometry, simd
from tensegrity.engine.law import DERIVATIVES, Change, facts, functions
from tensegrity.engine.native import joined
from tensegrity.engine.slopes import law_function

if TYPE_CHECKING:
    from typing import Any

LONG = 500  # instructions from which a law is compiled apart from the loop
STEPS = {  # files of what advances, by the steps that a text is made for
    "": (),
    "openings": ("openings.h", "{}_openings.c", "openings.c"),
    "implicit": ("implicit.c",),
    "driven": ("driven.c",),
}


def c_text(laws, own=None, dim=0, steps="", helpers=()):
    """C source of a loop over bonds of the given laws, numbered in their order.

    Parameters
    ----------
    laws : sequence of Law
        Or one law whose parameters change in time, and its `Change`.
    own : sequence of (tuple of int or None), optional
        For each law the numbers of the parameters that bonds of a run may each have their own of;
        None where no run has bonds that the loop tells apart.
    dim : int, optional
        Coordinates of a site in a network; 0 for a line.  What is taken are the files `<loop>.h`,
        `<loop>_law.c`, once for each kind of run, and `<loop>.c`, of the loop "line" or "net".
    steps : str, optional
        The steps in `STEPS` that are among it, besides those of `steps.c`.
    helpers : sequence of (casadi.Function, str), optional
        What is needed besides, and the C by which it is called.
    """
    own, loop = own or (None,) * len(laws), "net" if dim else "line"
    pulling = [law for law in laws if not isinstance(law, Change)]
    change = laws[-1] if len(pulling) < len(laws) else None
    scalars = [
        scalar(number, name, functions(law)[name])
        for number, law in enumerate(laws)
        for name in _names(law, steps)
    ]
    beside = [bool(dim or change) or is_packed(law) for law in pulling]
    packed = [
        *(geometry.side_by_side(dim) if dim else ()),
        *_tensions(pulling, own, beside, change, dim),
    ]
    packed += ["#if WIDE == 8", *_energies(laws), "#endif"]
    compiled = [(k, law, name) for k, law in enumerate(laws) for name in law.compiled]
    runs = [(k, kind) for k, law in enumerate(pulling) for kind in kinds(law, own[k])]
    lists = {
        "RUNS": runs,
        "EVALUATIONS": [(k, DERIVATIVES.index(name), name) for k, _, name in compiled],
        "ENERGIES": [
            (k, int(facts(law)["packed_energy"])) for k, law, name in compiled if name == "energy"
        ],
        "LAWS": [(k,) for k in range(len(laws))],
    }
    flags = {"CHANGES": change is not None, "VALUES": not dim and own == (None,)}
    parts = [f"{loop}.h"]
    for k, kind in runs:
        told = {"K": k, "OWNED": kind, "IS_LONG": int(is_long(laws[k]))}
        told["BESIDE"] = f"({int(beside[k])} && (WIDE == 8 || CHANGES))"
        parts += [*_defined(told), f"{loop}_law.c", *(f"#undef {x}" for x in told)]
    parts += [f"{loop}.c", "steps.c", *(file.format(loop) for file in STEPS[steps]), "evaluate.c"]
    return _text(laws, own, [*scalars, *helpers], dim, packed, lists, flags, parts)


def reverse_text(laws, own, wanted, dim, exact):
    """C source of the loop backwards: `reverse.c`.

    Parameters
    ----------
    laws, own, dim
        As of `c_text`.
    wanted : sequence of tuple of int
        For each law the numbers of the parameters by which derivatives are wanted.
    exact : bool
        Whether states are whole units of a grid; then it goes forwards too.
    """
    arguments = (
        "integer apart, const real *r, real *f, real *k, real *d, const real *shared, "
        "const real *own, integer all"
    )
    hooks, packed, runs, scalars = [], [], [], []
    for number, law in enumerate(laws):
        function, count = law_function(law, wanted[number]), len(wanted[number])
        mine = [(number, kind) for kind in (0, 1)[: 1 + (own[number] is not None)]]
        runs += mine
        if exact or not is_packed(law):
            scalars += [(*run, count) for run in mine]
            hooks.append(scalar(number, "slopes", function))
            hooks += [scalar(number, "tension", functions(law)["tension"])] * exact
            continue
        found = [f"INTO({x} + g * WIDE)" for x in ("f", "k")]
        found += [f"INTO(d + {m} * apart + g * WIDE)" for m in range(count)]
        for _, kind in mine:
            p = _packs(law, own[number] if kind else (), "wide(shared[{}])")
            given, name = [["load(r + g * WIDE)"], p], f"slopes_{number}_{kind}"
            packed.append(simd.text(function, name, arguments, given, [found]))
    parts, lists = ["reverse.c", *["steps.c"] * exact], {"RUNS": runs, "SCALARS": scalars}
    return _text(laws, own, hooks, dim, packed, lists, {"EXACT": exact}, parts)


def _text(laws, own, hooks, dim, packed, lists, flags, parts):
    """The whole: CasADi's functions with the C that calls them, those of packs, what is listed as
    macros, and the files of a loop."""
    import casadi as ca

    generator, hooks = ca.CodeGenerator("laws.c"), [*hooks, *(geometry.helpers(dim) if dim else ())]
    for function, _ in hooks:
        generator.add(function)
    takes = [_take(k, law, own[k]) for k, law in enumerate(laws) if own[k] is not None]
    defines = {"PARAMETERS": max((len(law.parameters) for law in laws), default=0)}
    defines |= {name: int(value) for name, value in flags.items()}
    for name, rows in lists.items():
        defines[f"{name}(X)"] = " ".join(f"X({', '.join(map(str, row))})" for row in rows)
    begin = ["prelude.c", generator.dump(), *(hook for _, hook in hooks), *takes, "simd.c"]
    return joined([*begin, *packed, *_defined(defines), *parts])


def _defined(values):
    return [f"#define {name} {value}" for name, value in values.items()]


def _names(law, steps):
    """What is compiled of a law, as numbers of one bond."""
    if isinstance(law, Change):
        return law.compiled
    more = steps == "implicit" and "stiffness" not in law.compiled
    return (*law.compiled, *["stiffness"] * more, "head", "tail")


def scalar(number, name, function):
    """A law's function of scalars for CasADi to write, and the C that calls it as
    `<name>_<number>(r, p)`; for several results with a place for them behind p."""
    import casadi as ca

    unique, sx = f"law{number}_{name}", function.sx_in()
    takes = ("real r, real h" if name == "tail" else "real r") + ", const real *p"
    gives = "&r, &h, p" if name == "tail" else "&r, p"
    begin, to, end = "real y; ", "&y", " return y;"
    if function.numel_out() > 1:
        takes, begin, to, end = f"{takes}, real *y", "", "y", ""
    return ca.Function(unique, sx, [function(*sx)]), (
        f"static inline {'real' if end else 'void'} {name}_{number}({takes}) {{ {begin}const real "
        f"*arg[] = {{{gives}}}; real *res[] = {{{to}}}; {unique}(arg, res, 0, 0, 0);{end} }}"
    )


def cost(law: Any) -> float:
    """Seconds that a tension takes in a compiled loop, roughly: counted, not measured."""
    return facts(law)["cost"]


def is_long(law):
    """Whether a law is compiled apart from the loop, once."""
    return facts(law)["instructions"] > LONG


def is_packed(law):
    """Whether a tension takes roots or quotients, and nothing that packs of numbers lack."""
    return facts(law)["packed"]


def kinds(law, own):
    """Kinds of runs compiled for a law: 0 where bonds share all parameters, 1 where not."""
    if own is None:
        return (0,)
    return (1,) if is_long(law) else (0, 1)


def _packs(law, own, one, wide="WIDE"):
    """C of pack number g of each parameter: `one` of its number, or of its own column."""
    return [
        f"load(own + {own.index(k)} * all + g * {wide})" if k in own else one.format(k)
        for k in range(len(law.parameters))
    ]


def _tensions(laws, own, beside, change, dim):
    """C of the tensions of several contacts, `tension_lanes_<law>_<kind of run>`; of bonds on a
    line that change the rates of their energies too, in packs behind."""
    shared, one = ("pack", "p[{}]") if dim else ("real", "wide(p[{}])")
    arguments = f"const pack *r, const {shared} *p, const real *own, integer all, pack *f"
    for number, law in enumerate(laws):
        for kind in kinds(law, own[number]) if beside[number] else ():
            p = _packs(law, own[number] if kind else (), one, "GROUP")
            function, found = functions(law)["tension"], [["f[g]"]]
            if change and not dim:
                p = _packs(change, (), one)
                function, found = change.both(), [["f[g]"], ["f[n + g]"]]
            name = f"tension_lanes_{number}_{kind}"
            yield simd.text(function, name, arguments, [["r[g]"], p], found)


def _energies(laws):
    """C of the energies of several bonds, `energy_lanes_<law>`."""
    for number, law in enumerate(laws):
        if facts(law)["packed_energy"]:
            p, energy = _packs(law, (), "wide(p[{}])"), functions(law)["energy"]
            arguments, name = "const pack *r, const real *p, pack *e", f"energy_lanes_{number}"
            yield simd.text(energy, name, arguments, [["r[g]"], p], [["e[g]"]])


def _take(number, law, own):
    """C that gathers the parameters of bond q of a run, those of its own from columns of `all`."""
    each = " ".join(
        f"p[{k}] = own[{own.index(k)} * all + q];" if k in own else f"p[{k}] = shared[{k}];"
        for k in range(len(law.parameters))
    )
    return (
        f"static inline void take_{number}(real *p, const real *restrict shared, "
        f"const real *restrict own, integer all, integer q) {{ {each} }}"
    )
