"""C text of a loop over bonds, from their laws.

CasADi writes the C of a law's functions; the text is used as CasADi writes it, between `prelude.c`
and the text of a loop.
"""

from __future__ import annotations

from importlib.resources import files
from typing import TYPE_CHECKING

from tensegrity.engine import lanes
from tensegrity.engine.law import DERIVATIVES, Change, facts, functions

if TYPE_CHECKING:
    from typing import Any

LONG = 500  # instructions from which a law is compiled apart from the loop


def c_text(
    laws, loop="line", own=None, helpers=(), packed=(), openings=False, extra=(), implicit=False
):
    """C source of a loop over bonds of the given laws, numbered in their order.

    Parameters
    ----------
    laws : sequence of Law
        Or one law whose parameters change in time, and its `Change`.
    loop : str
        "line" or "net": the files `<loop>.h`, `<loop>_law.c`, once for each kind of run, and
        `<loop>.c`.
    own : sequence of (tuple of int or None), optional
        For each law the numbers of the parameters that bonds of a run may each have their own of;
        None where no run has bonds that the loop tells apart.
    helpers : sequence of (casadi.Function, str)
        What the loop needs besides, and the C by which it is called.
    packed : sequence of str
        C of what the loop needs besides for several contacts side by side.
    openings : bool, optional
        Whether the steps of corrected methods are among it.
    extra : sequence of str
        Files, or C, behind the loop.
    implicit : bool, optional
        Whether implicit steps are among it, and the stiffness of every law.
    """
    import casadi as ca

    own = own or (None,) * len(laws)
    pulling = [law for law in laws if not isinstance(law, Change)]
    change = laws[-1] if len(pulling) < len(laws) else None
    generator = ca.CodeGenerator("laws.c")
    hooks = []
    for number, law in enumerate(laws):
        more = ["stiffness"] if implicit and "stiffness" not in law.compiled else []
        for name in law.compiled if law is change else (*law.compiled, *more, "head", "tail"):
            hooks.append(scalar(generator, number, name, functions(law)[name]))
        if own[number] is not None:
            hooks.append(take(number, len(law.parameters), own[number]))
    for function, hook in helpers:
        generator.add(function)
        hooks.append(hook)
    beside = [bool(packed or change) or is_packed(law) for law in pulling]
    hooks += ["lanes.c", *packed, *_lanes(pulling, own, beside, change, line=not packed)]
    hooks += ["#if WIDE == 8", *_energy_lanes(laws), "#endif"]
    energies = " ".join(
        f"X({number}, {int(facts(law)['packed_energy'])})"
        for number, law in enumerate(laws)
        if "energy" in law.compiled
    )
    runs = [
        (number, kind) for number, law in enumerate(pulling) for kind in kinds(law, own[number])
    ]
    evaluations = " ".join(
        f"X({number}, {DERIVATIVES.index(name)}, {name})"
        for number, law in enumerate(laws)
        for name in law.compiled
    )
    parts = ["subnormal.c", "prelude.c", generator.dump(), *hooks]
    parts += [
        f"#define PARAMETERS {max((len(law.parameters) for law in laws), default=0)}",
        f"#define RUNS(X) {' '.join(f'X({number}, {kind})' for number, kind in runs)}",
        f"#define CHANGES {change is not None:d}",
        f"#define EVALUATIONS(X) {evaluations}",
        f"#define ENERGIES(X) {energies}",
        f"{loop}.h",
    ]
    for number, kind in runs:
        long = int(is_long(laws[number]))
        parts += run_text(f"{loop}_law.c", number, kind, beside[number], IS_LONG=long)
    parts += [f"{loop}.c", "stages.h", "steps.c"]
    parts += ["openings.h", f"{loop}_openings.c", "openings.c"] * openings
    parts += ["evaluate.c", *["values.c"] * (loop == "line" and own == (None,))]
    if implicit:
        parts += [f"#define LAWS(X) {' '.join(f'X({k})' for k in range(len(laws)))}", "implicit.c"]
    return joined([*parts, *extra])


def add(generator, number, name, function):
    """Have CasADi write a function of a law, of scalars; its name."""
    import casadi as ca

    unique, sx = f"law{number}_{name}", function.sx_in()
    generator.add(ca.Function(unique, sx, [function(*sx)]))
    return unique


def scalar(generator, number, name, function):
    """C that calls such a function, of one result, as `<name>_<number>(r, p)`."""
    unique = add(generator, number, name, function)
    takes = ("real r, real h" if name == "tail" else "real r") + ", const real *p"
    gives = "&r, &h, p" if name == "tail" else "&r, p"
    return (
        f"static inline real {name}_{number}({takes}) {{ real y; const real *arg[] = "
        f"{{{gives}}}; real *res[] = {{&y}}; {unique}(arg, res, 0, 0, 0); return y; }}"
    )


def run_text(file, number, kind, beside, **more):
    """Parts of the text of one kind of runs of a law, what it is told defined around them."""
    beside = f"({int(beside)} && (WIDE == 8 || CHANGES))"
    told = {"K": number, "OWNED": kind, **more, "BESIDE": beside}
    return [*(f"#define {x} {y}" for x, y in told.items()), file, *(f"#undef {x}" for x in told)]


def joined(parts):
    """C of parts, each a text or the name of a file of the loop, whose lines messages name."""
    folder = files(__package__)
    return "\n".join(
        f'#line 1 "{part}"\n{folder.joinpath(part).read_text()}'
        if part.endswith((".c", ".h")) else part for part in parts
    )  # fmt: skip


def cost(law: Any) -> float:
    """Seconds that a tension takes in a compiled loop, roughly: counted, not measured."""
    return facts(law)["cost"]


def is_long(law):
    """Whether a law is compiled apart from the loop, once."""
    return facts(law)["instructions"] > LONG


def kinds(law, own):
    """Kinds of runs compiled for a law: 0 where bonds share all parameters, 1 where not."""
    if own is None:
        return (0,)
    return (1,) if is_long(law) else (0, 1)


def is_packed(law):
    """Whether a tension takes roots or quotients, and nothing that packs of numbers lack."""
    return facts(law)["packed"]


def packs(law, own, one):
    """C of pack number g of each parameter: `one` of its number, or of its own column."""
    return [
        f"load(own + {own.index(k)} * all + g * GROUP)" if k in own else one.format(k)
        for k in range(len(law.parameters))
    ]


def _lanes(laws, own, beside, change, line):
    """C of the tensions of several contacts, `tension_lanes_<law>_<kind of run>`; of bonds on a
    line that change the rates of their energies too, in packs behind."""
    shared, one = ("real", "wide(p[{}])") if line else ("pack", "p[{}]")
    arguments = f"const pack *r, const {shared} *p, const real *own, integer all, pack *f"
    for number, law in enumerate(laws):
        if not beside[number]:
            continue
        for kind in kinds(law, own[number]):
            p = packs(law, own[number] if kind else (), one)
            function, found = functions(law)["tension"], [["f[g]"]]
            if change and line:
                p = packs(change, (), one)
                function, found = change.both(), [["f[g]"], ["f[n + g]"]]
            name = f"tension_lanes_{number}_{kind}"
            yield lanes.text(function, name, arguments, [["r[g]"], p], found)


def _energy_lanes(laws):
    """C of the energies of several bonds, `energy_lanes_<law>`."""
    for number, law in enumerate(laws):
        if facts(law)["packed_energy"]:
            p = packs(law, (), "wide(p[{}])")
            arguments, energy = "const pack *r, const real *p, pack *e", functions(law)["energy"]
            name = f"energy_lanes_{number}"
            yield lanes.text(energy, name, arguments, [["r[g]"], p], [["e[g]"]])


def take(number, count, own):
    """C that gathers the parameters of bond q of a run, those of its own from columns of `all`."""
    each = " ".join(
        f"p[{k}] = own[{own.index(k)} * all + q];" if k in own else f"p[{k}] = shared[{k}];"
        for k in range(count)
    )
    return (
        f"static inline void take_{number}(real *p, const real *restrict shared, "
        f"const real *restrict own, integer all, integer q) {{ {each} }}"
    )
