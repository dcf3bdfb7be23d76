"""Families of solitary waves end where their prediction says.

Speed against peak of exact waves; dashed the predicted limit of the speed, dotted that of the peak,
dash-dotted an estimate of the first peak above a threshold.
"""

import math

import numpy as np
import sympy as sp

from figures._draw import note
from figures._files import lines, side_by_side
from tensegrity import Potential, Prism, predict

GROUP = "softening_limits"

R = sp.Symbol("r")
SHOWN = {
    "rigid prism (0.7, 0.01)": "the bars meet",
    "elastic prism, preload 0": "slack strings",
    "elastic prism, preload 0.1": "preloaded, softening",
    "Lennard-Jones 12-6": "Lennard-Jones 12-6",
    "$V' = r + r^2 - r^3$": "$V' = r + r^2 - r^3$",
    "$V' = r + 0.914\\,r^3 - 0.01\\,r^4 - 0.375\\,r^5$": "a quintic with two families",
}


def force(*coefficients):
    """V' = r + c0 r^2 + c1 r^3 + ..."""
    terms = (sp.nsimplify(c) * R ** (k + 3) / (k + 3) for k, c in enumerate(coefficients))
    return Potential(R**2 / 2 + sum(terms), R)


def lennard_jones(n, m):
    """V''(0) = 1, zero distance at r = -1."""
    energy = ((1 + R) ** -n / n - (1 + R) ** -m / m) / (n - m)
    return Potential(energy, R, domain=(-1.0, math.inf))


def springs():
    """{name: potential} of those whose families are drawn."""
    softening = Prism(1.0, 0.5, 0.4, 1.0, 2.0, 20.0)
    return {
        "Toda": Potential(sp.exp(-R) + R - 1, R),
        "Lennard-Jones 12-6": lennard_jones(12, 6),
        "Lennard-Jones 6-3": lennard_jones(6, 3),
        "rigid prism (0.7, 0.01)": Prism(1.0, 0.7, 0.01, 1.0).potential(),
        "elastic prism, preload 0": softening.potential(),
        "elastic prism, preload 0.05": softening.potential(preload=0.05),
        "elastic prism, preload 0.1": softening.potential(preload=0.1),
        "elastic prism, preload 0.15": softening.potential(preload=0.15),
        "$V' = r + r^2 - r^3$": force(1, -1),
        "$V' = r + r^3 - r^5$": force(0, 1, 0, -1),
        "$V' = r + 0.914\\,r^3 - 0.01\\,r^4 - 0.375\\,r^5$": force(0, 0.914, -0.01, -0.375),
        "$V' = r + r^2 - 1.2\\,r^3 + 0.3\\,r^4$": force(1, -1.2, 0.3),
    }


def data():
    """Peaks and speeds over that of sound of each family, and what is predicted of it."""
    waves, limits = [], []
    for name, spring in springs().items():
        prediction = predict(spring)
        for family in prediction.families:
            of = {"spring": name, "family": family.name}
            waves += [of | {"ends": family.ends, "peak": wave.amplitude,
                            "speed ratio": wave.speed_ratio, "residual": wave.residual}
                      for wave in family.curve().waves]  # fmt: skip
            first, last = family.crests
            low, high = (c / prediction.sound_speed for c in family.speeds)
            limits.append(of | {
                "starts": family.starts, "ends": family.ends, "first peak": first,
                "last peak": last, "lowest": low, "highest": high, "certain": family.certain,
            })  # fmt: skip
    return {"waves": side_by_side(waves), "limits": side_by_side(limits)}


def families(tables):
    """What is predicted of each family, with its waves."""
    waves = lines(tables["waves"])
    for limit in lines(tables["limits"]):
        of = limit["spring"], limit["family"]
        yield limit, [wave for wave in waves if (wave["spring"], wave["family"]) == of]


def table(tables):
    """Each family: predicted limits, and the range of the computed waves."""
    for limit, waves in families(tables):
        yield {
            "spring": limit["spring"].replace("$", ""), "family": limit["family"],
            "starts": limit["starts"], "ends": limit["ends"],
            "last peak": float(limit["last peak"]), "limit c/cs": float(limit["highest"]),
            "fastest found": max(wave["speed ratio"] for wave in waves),
            "waves": len(waves), "largest residual": max(wave["residual"] for wave in waves),
        }  # fmt: skip


def draw(figure, tables):
    """One panel for each of six springs; the table has all."""
    figure.set_size_inches(9, 6.5)
    panels = dict(zip(SHOWN, figure.subplots(2, 3).flat, strict=True))
    for name, axes in panels.items():
        shown, fastest = [one for one in families(tables) if one[0]["spring"] == name], []
        for color, (limit, waves) in zip(("C0", "C1"), shown, strict=False):
            x, y = (np.array([wave[c] for wave in waves]) for c in ("peak", "speed ratio"))
            order = np.argsort(np.abs(x))
            axes.plot(x[order], y[order], ".-", color=color)
            wanted = (y.max() / y.min()) ** (0.75 if limit["family"] == "compression" else 0.4)
            middle = int(np.argmin(np.abs(y - wanted * y.min())))
            place = x[middle], y[middle]
            note(axes, limit["family"], place, (6, -10 if place[0] > 0 else 4), color=color,
                 fontsize=9)  # fmt: skip
            if math.isfinite(limit["highest"]):
                axes.axhline(limit["highest"], color=color, ls="--", lw=1)
            if math.isfinite(limit["last peak"]):
                axes.axvline(limit["last peak"], color=color, ls=":", lw=1)
            if limit["starts"] == "threshold":
                axes.axvline(limit["first peak"], color=color, ls="-.", lw=0.8)
            fastest.append(y.max())
        axes.set(yscale="log" if max(fastest) > 6 else "linear", title=SHOWN[name])
    figure.supxlabel("peak elongation [m], extension > 0", fontsize=10)
    figure.supylabel("speed / sound speed", fontsize=10)
    figure.suptitle("Families of solitary waves end where predicted: dashed the speed, dotted the "
                    "peak;\ndash-dotted a first peak (estimate)", fontsize=10)  # fmt: skip
