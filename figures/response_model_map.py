"""Validity of the symmetric model: where a prism with a free top tilts before its limit load."""

from __future__ import annotations

import math

import numpy as np

from tensegrity import Prism, equilibrium_path
from tensegrity.prisms.stability import first_loss

NAME = "response_model_map"
GROUP = "response"

SLENDERNESS = np.geomspace(0.3, 3.0, 13)
PRESTRAINS = np.geomspace(1e-3, 0.4, 10)
STIFFNESS = {"k_base": 10.0, "k_bar": 100.0}


def data(progress=iter):
    """Load at the first tilt over the largest load of the symmetric path; nan without tilt."""
    rows = []
    for slenderness in progress(SLENDERNESS.tolist()):
        for prestrain in PRESTRAINS.tolist():
            prism = Prism(1.0, slenderness, prestrain, k_cross=1.0, **STIFFNESS)
            path = equilibrium_path(prism)
            loss = first_loss(prism, "tilting")
            tilts = not (math.isnan(loss.load) or loss.symmetric)
            folds = [e.load for e in path.events if e.kind == "fold"]
            largest = max([path.load.max(), *folds])
            fraction = loss.load / largest if tilts else math.nan
            rows.append((slenderness, prestrain, fraction, bool(folds)))
    names = ("slenderness", "prestrain", "tilt_fraction", "has_fold")
    return {"map": dict(zip(names, map(list, zip(*rows, strict=True)), strict=True))}


def draw(figure, tables):
    """Colour: tilting comes first; circles: the symmetric path loses stability at its fold."""
    table = {name: np.array(column) for name, column in tables["map"].items()}
    axes = figure.subplots()
    tilts = np.isfinite(table["tilt_fraction"])
    marks = axes.scatter(
        table["slenderness"][tilts], table["prestrain"][tilts], c=table["tilt_fraction"][tilts],
        marker="s", s=110, vmin=0, vmax=1, cmap="viridis",
    )  # fmt: skip
    for fold, style, label in (
        (True, {"facecolors": "none", "edgecolors": "C3"}, "symmetric fold first"),
        (False, {"color": "0.6", "marker": "."}, "stable up to contact"),
    ):
        shown = ~tilts & (table["has_fold"] == fold)
        axes.scatter(table["slenderness"][shown], table["prestrain"][shown], label=label, **style)
    axes.set(
        xscale="log", yscale="log", xlabel="slenderness, height / base",
        ylabel="prestrain of the cross strings",
    )  # fmt: skip
    figure.colorbar(marks, label="load at first tilt / largest load of the symmetric path")
    figure.legend(loc="outside upper left", ncols=2, fontsize=8)
    axes.set_xticks([0.3, 0.5, 1, 2, 3], ["0.3", "0.5", "1", "2", "3"], minor=False)
    axes.set_xticks([], minor=True)
