"""Effect of the stiffness of bases and bars on the response, towards the rigid prism."""

from __future__ import annotations

import math

from tensegrity import Prism, equilibrium_path

NAME = "response_rigidity"
GROUP = "response"

STIFFNESSES = (2.0, 5.0, 20.0, 100.0, 1e3, math.inf)
OTHER = 100.0  # stiffness of the members that are not varied [N/m]
LARGEST = 3.0  # load shown [N]


def data(progress=iter):
    """Path columns with the bases, and with the bars, of varied stiffness."""
    tables = {}
    for member, k in progress([(m, k) for m in ("base", "bar") for k in STIFFNESSES]):
        given = {"k_base": OTHER, "k_bar": OTHER, f"k_{member}": k}
        path = equilibrium_path(Prism(1.0, 0.8, 0.05, k_cross=1.0, **given), max_load=LARGEST)
        tables[f"{member}_k{k:g}"] = path.columns
    return tables


def draw(figure, tables):
    """Two panels: bases, bars."""
    axes = figure.subplots(1, 2, sharey=True)
    for ax, member in zip(axes, ("base", "bar"), strict=True):
        for index, k in enumerate(STIFFNESSES):
            table = tables[f"{member}_k{k:g}"]
            style = {"color": "k", "ls": "--"} if math.isinf(k) else {"color": f"C{index}"}
            label = "rigid" if math.isinf(k) else f"{k:g} N/m"
            ax.plot(table["shortening"], table["load"], label=label, **style)
        ax.set_xlabel("shortening [m]")
        ax.set_title(f"k_{member} varied, k_cross 1 N/m, the other {OTHER:g} N/m", fontsize=10)
        ax.legend(fontsize=8, title=f"k_{member}")
    axes[0].set_ylabel("axial load [N] (compression > 0)")
