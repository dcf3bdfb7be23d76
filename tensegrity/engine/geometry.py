"""The geometry of contacts in CasADi and in C, from `derivations.geometry`."""

from __future__ import annotations

from tensegrity.engine import simd
from tensegrity.engine.law import to_casadi
from tensegrity.once import once


def own(laws):
    """The law whose energy is a function of all coordinates of both ends (`pair.PairForms`), in
    place of the distance of two points.  Such a law is the only one of a network.  None for others.
    """
    return laws[0] if laws and hasattr(laws[0], "free") else None


@once
def functions(dim):
    """CasADi functions (D, w, g, L) -> (elongation, its gradient in w), of pairs and of walls.

    On a line D is the direction from the first site to the second, 1 or -1.
    """
    import casadi as ca

    from derivations import geometry as derived

    symbols = [ca.SX.sym("D", dim), ca.SX.sym("w", dim), ca.SX.sym("g"), ca.SX.sym("L")]
    names = (*(x for v in derived.vectors(dim) for x in v), derived.initial, derived.length)
    values = [x for symbol in symbols for x in ca.vertsplit(symbol)]
    gap, normal = derived.wall_gap(dim)
    wall = [gap, *normal]
    pair = wall if dim == 1 else [derived.elongation(dim), *derived.direction(dim)]
    by_kind = {}
    for kind, form in {"pair": pair, "wall": wall}.items():
        r, *along = to_casadi(form, names)(*values)
        by_kind[kind] = ca.Function(f"geometry_{kind}", symbols, [r, ca.vertcat(*along)])
    return by_kind


def helpers(dim, law, kinds=("pair",)):
    """Functions of contacts, and the C by which they are called, for `codegen.whole`.

    Parameters
    ----------
    dim : int
    law : PairForms or None
        That of both ends.
    kinds : sequence of str, optional
        Which of its functions.

    Yields
    ------
    casadi.Function, str
    """
    for kind, function in functions(dim).items():
        yield (
            function,
            f"static inline void {kind}_contact(const real *d, const real *w, real g, real length, "
            "real *r, real *along) { const real *arg[] = {d, w, &g, &length}; "
            f"real *res[] = {{r, along}}; geometry_{kind}(arg, res, 0, 0, 0); }}",
        )
    for kind in kinds if law is not None else ():
        function = law.functions()[kind]
        more, results = (", const real *y", "y, ") if function.n_in() > 3 else ("", "")
        out = [f"out{k}" for k in range(function.n_out())]
        yield (
            function,
            f"static inline void {kind}_of_ends(const real *a, const real *b, const real *p{more}, "
            f"{', '.join(f'real *{x}' for x in out)}) {{ const real *arg[] = {{a, b, p, {results}"
            f"}}; real *res[] = {{{', '.join(out)}}}; pair_{kind}(arg, res, 0, 0, 0); }}",
        )


def side_by_side(dim, law, runs=()):
    """C text of the same for several contacts in SIMD registers; see `simd.two_functions`.

    Parameters
    ----------
    dim : int
    law : PairForms or None
        That of both ends.
    runs : sequence of (str, sequence of str)
        For each kind of run of such a law the ending of its name, and C of its parameters.

    Returns
    -------
    list of str
    """
    axes = [[f"{name}[{k}]" for k in range(dim)] for name in ("d", "w")]
    each = [["load(gap + g * each_gap)"], ["load(length + g * each_length)"]]
    lengths = "const real *gap, integer each_gap, const real *length, integer each_length, "
    ends, given = "const pack *d, const pack *w, ", functions(dim)
    calls = [(given[kind], kind, ends, f"{lengths}pack *r, ", [*axes, *each], [["r[g]"]])
             for kind in ("pair", "wall")]  # fmt: skip
    for ending, values in runs if law is not None else ():
        more = f"{ends}const pack *p, const real *own, integer all, "
        gradient = law.functions()["gradient"]
        calls.append((gradient, f"ends_{ending}", more, "", [*axes, list(values)], []))
    texts = []
    for function, name, takes, arguments, inputs, results in calls:
        along = [f"along[{k}][g]" for k in range(function.numel_out(function.n_out() - 1))]
        arguments += "pack (*along)[ROOM]"
        outputs = [*results, along]
        texts.append(simd.two_functions(function, name, takes, arguments, inputs, outputs))
    stored = max(1, *(count for count, _ in texts))
    flags = [f"#define STORED {stored}"]
    if law is not None:
        free = ", ".join(str(int(x)) for x in law.free)
        flags.append(f"#define ENDS\nstatic const int free_ends[] = {{{free}}};")
    return [*flags, *(text for _, text in texts)]
