"""The geometry of contacts in CasADi and in C, from `derivations.geometry`."""

from __future__ import annotations

from tensegrity.engine import simd
from tensegrity.engine.law import to_casadi
from tensegrity.once import once


def own(laws):
    """The law that has a geometry of its own, `law.geometry()`, in place of the distance of two
    points: its "pair" is a function as in `functions`, its "tangent" (D, w, g, L) -> second
    derivatives of the elongation in w.  Such a law is the only one of a network.  None for others.
    """
    return laws[0] if laws and hasattr(laws[0], "geometry") else None


@once
def functions(dim, law=None):
    """CasADi functions (D, w, g, L) -> (elongation, its gradient in w), of pairs and of walls.

    On a line D is the direction from the first site to the second, 1 or -1.  A law with a geometry
    of its own gives that of pairs.
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
    return by_kind if law is None else by_kind | {"pair": law.geometry()["pair"]}


def helpers(dim, law):
    """Functions of contacts, and the C by which they are called, for `codegen.whole`."""
    for kind, function in functions(dim, law).items():
        yield (
            function,
            f"static inline void {kind}_contact(const real *d, const real *w, real g, real length, "
            "real *r, real *along) { const real *arg[] = {d, w, &g, &length}; "
            f"real *res[] = {{r, along}}; geometry_{kind}(arg, res, 0, 0, 0); }}",
        )


def tangents(laws, needed=True):
    """The function of second derivatives of a law's own geometry, and the C by which it is called,
    if `needed`."""
    law = own(laws) if needed else None
    return [] if law is None else [(
        law.geometry()["tangent"],
        "static inline void pair_tangent(const real *d, const real *w, real g, real length, "
        "real *second) { const real *arg[] = {d, w, &g, &length}; real *res[] = {second}; "
        "geometry_tangent(arg, res, 0, 0, 0); }\n#define OWN_TANGENT",
    )]  # fmt: skip


def side_by_side(dim, law):
    """C text of the same for several contacts in SIMD registers; see `simd.two_functions`."""
    axes = [[f"{name}[{k}]" for k in range(dim)] for name in ("d", "w")]
    along = [f"along[{k}][g]" for k in range(dim)]
    each = [["load(gap + g * each_gap)"], ["load(length + g * each_length)"]]
    arguments = (
        "const real *gap, integer each_gap, const real *length, integer each_length, pack *r, "
        "pack (*along)[ROOM]"
    )
    texts = [
        simd.two_functions(
            function, kind, "const pack *d, const pack *w, ", arguments, [*axes, *each],
            [["r[g]"], along],
        )
        for kind, function in functions(dim, law).items()
    ]  # fmt: skip
    stored = max(1, *(count for count, _ in texts))
    return [f"#define STORED {stored}", *(text for _, text in texts)]
