"""Families of solitary waves end where their prediction says.

Speed against peak of exact waves; dashed the predicted limit of the speed, dotted that of the peak,
dash-dotted an estimate of the first peak above a threshold.
"""

from __future__ import annotations

import math

import numpy as np

from figures._families import springs
from tensegrity import predict

NAME = "softening_families"
GROUP = "softening_limits"

SHOWN = {
    "rigid prism (0.7, 0.01)": "the bars meet",
    "elastic prism, preload 0": "slack strings",
    "elastic prism, preload 0.1": "preloaded, softening",
    "Lennard-Jones 12-6": "Lennard-Jones 12-6",
    "$V' = r + r^2 - r^3$": "$V' = r + r^2 - r^3$",
    "$V' = r + 0.914\\,r^3 - 0.01\\,r^4 - 0.375\\,r^5$": "a quintic with two families",
}


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
            row = (name, family.name, family.starts, family.ends, *family.crests, low, high,
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
    """One panel for each of six springs; the table has all."""
    found, limits = tables["waves"], tables["limits"]
    figure.set_size_inches(9, 6.5)
    pairs = list(zip(found["spring"], found["family"], strict=True))
    for axes, (name, words), letter in zip(
        figure.subplots(2, 3).flat, SHOWN.items(), "abcdef", strict=True
    ):
        kinds = [k for k, spring in enumerate(limits["spring"]) if spring == name]
        for color, k in enumerate(kinds):
            family = limits["family"][k]
            own = [j for j, pair in enumerate(pairs) if pair == (name, family)]
            x, y = (np.array([found[c][j] for j in own]) for c in ("peak", "speed ratio"))
            order = np.argsort(np.abs(x))
            axes.plot(x[order], y[order], ".-", color=f"C{color}")
            wanted = (y.max() / y.min()) ** (0.75 if family == "compression" else 0.4) * y.min()
            middle = int(np.argmin(np.abs(y - wanted)))
            axes.annotate(family, (x[middle], y[middle]), (6, -10 if x[middle] > 0 else 4),
                          textcoords="offset points", color=f"C{color}",
                          fontsize=9)  # fmt: skip
            if math.isfinite(limits["highest"][k]):
                axes.axhline(limits["highest"][k], color=f"C{color}", ls="--", lw=1)
            if math.isfinite(limits["last peak"][k]):
                axes.axvline(limits["last peak"][k], color=f"C{color}", ls=":", lw=1)
            if limits["starts"][k] == "threshold":
                axes.axvline(limits["first peak"][k], color=f"C{color}", ls="-.", lw=0.8)
        fast = max(y for y, s in zip(found["speed ratio"], found["spring"], strict=True)
                   if s == name)  # fmt: skip
        axes.set_yscale("log" if fast > 6 else "linear")
        axes.set_title(f"({letter}) {words}", fontsize=10)
    figure.supxlabel("peak elongation [m], extension > 0", fontsize=10)
    figure.supylabel("speed / sound speed", fontsize=10)
    figure.suptitle("Families of solitary waves end where predicted: dashed the speed, dotted the "
                    "peak;\ndash-dotted a first peak (estimate)", fontsize=10)  # fmt: skip
