"""Load against shortening of elastic prisms, thick and slender, for several prestrains."""

from __future__ import annotations

from tensegrity import Prism, equilibrium_path

NAME = "response_prestrain"
GROUP = "response"

SHAPES = {"thick": 0.5, "slender": 1.5}  # height over base
PRESTRAINS = (0.01, 0.05, 0.1, 0.2, 0.4)
STIFFNESS = {"k_base": 5.0, "k_bar": 50.0}


def data(progress=iter):
    """Columns of the equilibrium path for each shape and prestrain, and its events."""
    tables = {}
    for shape, prestrain in progress([(s, p) for s in SHAPES for p in PRESTRAINS]):
        prism = Prism(1.0, SHAPES[shape], prestrain, k_cross=1.0, **STIFFNESS)
        path = equilibrium_path(prism, max_height=1.05 * prism.height)
        name = f"{shape}_p{prestrain:g}"
        tables[name] = path.columns
        tables[f"{name}_events"] = {
            "kind": [e.kind for e in path.events],
            "shortening": [e.shortening for e in path.events],
            "load": [e.load for e in path.events],
        }
    return tables


MARKS = {"fold": "^", "contact": "s", "flat": "v", "slack": "o", "turn": "<", "bifurcation": "*"}


def draw(figure, tables):
    """Two panels; states unstable under a prescribed load are dashed, events are marked."""
    axes = figure.subplots(1, len(SHAPES))
    for ax, shape in zip(axes, SHAPES, strict=True):
        shown = {}
        for index, prestrain in enumerate(PRESTRAINS):
            name = f"{shape}_p{prestrain:g}"
            table, events = tables[name], tables[f"{name}_events"]
            x, y, stable = table["shortening"], table["load"], table["stable_load"]
            ax.plot(x, y, color=f"C{index}", lw=0.9, ls="--")
            solid = [v if s else float("nan") for v, s in zip(y, stable, strict=True)]
            ax.plot(x, solid, color=f"C{index}", lw=1.7, label=f"prestrain {prestrain:g}")
            for kind, at, load in zip(*events.values(), strict=True):
                (shown[kind],) = ax.plot(at, load, MARKS[kind], color=f"C{index}", ms=5)
        ax.axhline(0, color="0.7", lw=0.8)
        ax.set_title(f"{shape}: height {SHAPES[shape]:g} m, base 1 m", fontsize=10)
        ax.set_xlabel("shortening [m]")
        if shape == "slender":
            ax.add_artist(ax.legend(fontsize=8, loc="center right"))
        ax.legend(shown.values(), shown, fontsize=8, loc="lower right")
    axes[0].set_ylabel("axial load [N] (compression > 0)")
