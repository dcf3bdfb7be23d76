"""The pictures: one module each, made from the public interface only.

A module without an underscore is a picture of its name.  It belongs to a GROUP; `data()` computes
its numbers, as tables {table: {column: array}}; `draw(figure, tables)` draws them and computes
nothing.  It may have `table(tables)`, lines {column: value} of a table that is printed, and
written as CSV, for the whole group; `text(tables)`, a section of a page on the group; and
`animate(tables, path)`, which writes a GIF.
"""

import importlib
import pkgutil

FIRST = (
    "prism_drawing",
    "constitutive_rigid",
    "derivations_ledger",
    "response_prestrain",
    "structures_icosahedron",
    "wave_supersonic",
    "wave_speeds",
    "solitary_families",
    "wave_collision",
    "granular_fig2",
    "granular_motion",
    "packs_space",
    "gradients_guide",
)
"""What `make figures` draws, the longest first: what somebody who is new here wants to see."""


def pictures():
    """{name: module} of all pictures, in the order of their names."""
    names = sorted(one.name for one in pkgutil.iter_modules(__path__) if one.name[0] != "_")
    return {name: importlib.import_module(f"{__name__}.{name}") for name in names}


def chosen(names):
    """The pictures of the given names or groups; all where none is given."""
    everything = pictures()
    if not names:
        return everything
    groups = {module.GROUP for module in everything.values()}
    unknown = sorted(set(names) - set(everything) - groups)
    if unknown:
        known = ", ".join([*everything, *sorted(groups)])
        raise ValueError(f"unknown picture {', '.join(unknown)}; there are {known}")
    return {n: m for n, m in everything.items() if n in names or m.GROUP in names}
