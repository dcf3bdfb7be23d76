"""Speed against peak of exact solitary waves, with the predicted limits of each family."""

from __future__ import annotations

import math

import numpy as np

from figures._families import springs
from tensegrity import predict

NAME = "softening_families"
GROUP = "softening_limits"


def data():
    """Peaks and speeds over that of sound of each family, and what is predicted of it."""
    columns = ("spring", "family", "ends", "peak", "speed ratio", "residual")
    table = {key: [] for key in columns}
    limits = {key: [] for key in ("spring", "family", "starts", "ends", "first peak",
                                  "last peak", "lowest", "highest", "certain")}  # fmt: skip
    for name, spring in springs().items():
        prediction = predict(spring)
        for family in prediction.families:
            for wave in family.curve().waves:
                row = (name, family.name, family.ends, wave.amplitude, wave.speed_ratio,
                       wave.residual)  # fmt: skip
                for key, value in zip(columns, row, strict=True):
                    table[key].append(value)
            low, high = (c / prediction.sound_speed for c in family.speeds)
            row = (name, family.name, family.starts, family.ends, *family.peaks, low, high,
                   family.certain)  # fmt: skip
            for key, value in zip(limits, row, strict=True):
                limits[key].append(value)
    return {"waves": table, "limits": limits}


def table(tables):
    """Each family: predicted limits, and the range of the computed waves."""
    limits, found = tables["limits"], tables["waves"]
    rows = []
    for k, (name, family) in enumerate(zip(limits["spring"], limits["family"], strict=True)):
        own = [j for j, pair in enumerate(zip(found["spring"], found["family"], strict=True))
               if pair == (name, family)]  # fmt: skip
        speeds = [found["speed ratio"][j] for j in own]
        rows.append({
            "spring": name.replace("$", ""), "family": family, "starts": limits["starts"][k],
            "ends": limits["ends"][k], "last peak": float(limits["last peak"][k]),
            "limit c/cs": float(limits["highest"][k]), "fastest found": max(speeds),
            "waves": len(own), "largest residual": max(found["residual"][j] for j in own),
        })  # fmt: skip
    return rows


def draw(figure, tables):
    """One panel per spring."""
    found, limits = tables["waves"], tables["limits"]
    names = list(dict.fromkeys(limits["spring"]))
    figure.set_size_inches(14, 11)
    panels = figure.subplots(math.ceil(len(names) / 4), 4).ravel()
    for axes, name in zip(panels, names, strict=False):
        kinds = [k for k, spring in enumerate(limits["spring"]) if spring == name]
        for color, k in enumerate(kinds):
            family = limits["family"][k]
            own = [j for j, pair in enumerate(zip(found["spring"], found["family"], strict=True))
                   if pair == (name, family)]  # fmt: skip
            x, y = (np.array([found[c][j] for j in own]) for c in ("peak", "speed ratio"))
            order = np.argsort(np.abs(x))
            axes.plot(x[order], y[order], ".-", color=f"C{color}", label=family)
            if math.isfinite(limits["highest"][k]):
                axes.axhline(limits["highest"][k], color=f"C{color}", ls="--", lw=1)
            if math.isfinite(limits["last peak"][k]):
                axes.axvline(limits["last peak"][k], color=f"C{color}", ls=":", lw=1)
            if limits["starts"][k] == "threshold":
                axes.axvline(limits["first peak"][k], color=f"C{color}", ls="-.", lw=0.8)
        fast = max(y for y, s in zip(found["speed ratio"], found["spring"], strict=True)
                   if s == name)  # fmt: skip
        if fast > 6:
            axes.set_yscale("log")
        axes.set_title(name, fontsize=10)
        axes.set(xlabel="peak r [m], extension > 0", ylabel="c/c$_s$")
        axes.legend(fontsize=8)
    for axes in panels[len(names) :]:
        axes.set_visible(False)
    figure.suptitle(
        "Dashed: predicted limit of the speed.  Dotted: of the peak.  Dash-dotted: estimate of "
        "the first peak above a threshold.",
        fontsize=10,
    )
