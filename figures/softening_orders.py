"""Asymptotics of solitary waves near the sound speed, near a flat top, and near a hard wall."""

from __future__ import annotations

import numpy as np

from figures._families import force, lennard_jones, springs
from tensegrity import predict

NAME = "softening_orders"
GROUP = "softening_limits"

SMALL = ("Toda", "Lennard-Jones 12-6", "Lennard-Jones 6-3", "rigid prism (0.7, 0.01)",
         "elastic prism, preload 0.1", "$V' = r + r^2 - r^3$")  # fmt: skip
EXCESS = np.geomspace(1e-8, 1e-2, 7)
TOPS = {"$V' = r + r^2 - r^3$": ("rarefaction", force(1, -1)),
        "$V' = r + r^3 - r^5$": ("rarefaction", force(0, 1, 0, -1))}  # fmt: skip
GAPS = np.geomspace(1e-2, 1e-6, 7)
SPEEDS = 20.0 * 2.0 ** np.arange(6)


def order(x, y):
    """Exponent of y ~ x^p by least squares."""
    return float(np.polyfit(np.log(x), np.log(np.abs(y)), 1)[0])


def data():
    """Relative errors of the two-term law, gaps of speed and widths, distances to the wall."""
    known, tables = springs(), {}
    for number, name in enumerate(SMALL):
        families = predict(known[name]).families
        family = next(f for f in families if f.starts == "rest")
        peaks = family.curve(excess=EXCESS).amplitude
        law = [family.small_peak(e) for e in EXCESS.tolist()]
        tables[f"small_{number}"] = {"excess": EXCESS, "peak": peaks,
                                     "error": np.abs(peaks / law - 1)}  # fmt: skip
    for number, (name, spring) in enumerate(TOPS.values()):
        family = predict(spring)[name]
        curve = family.curve(amplitude=family.peaks[1] * (1 - GAPS))
        tables[f"top_{number}"] = {
            "gap": GAPS, "left": 1 - curve.speed / family.speeds[1], "width": curve.width,
            "rise": np.full(GAPS.size, 2 / family.top_rate),
        }  # fmt: skip
    for n, m in ((12, 6), (6, 3)):
        spring = lennard_jones(n, m)
        family = predict(spring)["compression"]
        left = 1 + family.curve(speed_ratio=SPEEDS).amplitude
        law = np.array([1 + family.wall_peak(c) for c in SPEEDS.tolist()])
        tent = (4 * family.wall[1] / SPEEDS**2) ** (1 / n)
        tables[f"wall_{n}"] = {"speed": SPEEDS, "left": left, "error": np.abs(left / law - 1),
                               "tent": np.abs(left / tent - 1)}  # fmt: skip
    return tables


def table(tables):
    """Orders by least squares over all waves."""
    rows = []
    for number, name in enumerate(SMALL):
        one = tables[f"small_{number}"]
        seen = one["error"] > 1e-11  # below, round-off
        rows.append({"limit": "small, two terms", "spring": name.replace("$", ""), "expected": 2.0,
                     "order": order(EXCESS[seen], one["error"][seen])})  # fmt: skip
    for number, name in enumerate(TOPS):
        one = tables[f"top_{number}"]
        rows.append({"limit": "flat top, c* - c", "spring": name.replace("$", ""),
                     "expected": 2.0, "order": order(GAPS[:5], one["left"][:5])})  # fmt: skip
        rows.append({"limit": "width per ln(1/gap)", "spring": name.replace("$", ""),
                     "expected": float(one["rise"][0]),
                     "order": float(np.polyfit(-np.log(GAPS), one["width"], 1)[0])})  # fmt: skip
    for n in (12, 6):
        one = tables[f"wall_{n}"]
        for key, expected in (("error", -1.0), ("left", -2 / n)):
            label = "wall, corrected" if key == "error" else "wall, distance left"
            rows.append({"limit": label, "spring": f"Lennard-Jones {n}-{n // 2}",
                         "expected": expected, "order": order(SPEEDS, one[key])})  # fmt: skip
    return rows


def draw(figure, tables):
    """Three limits, a panel each."""
    figure.set_size_inches(15, 4.6)
    small, top, wall = figure.subplots(1, 3)
    for number, name in enumerate(SMALL):
        one = tables[f"small_{number}"]
        small.loglog(one["excess"], np.maximum(one["error"], 1e-16), ".-", label=name)
    small.loglog(EXCESS, EXCESS**2, "k:", lw=1, label="slope 2")
    small.set(xlabel="c/c$_s$ - 1", ylabel="peak: relative error of the two-term law")
    for number, name in enumerate(TOPS):
        one = tables[f"top_{number}"]
        top.semilogx(one["gap"], one["width"], ".-", label=name)
        fit = one["width"][-1] + one["rise"][0] * np.log(GAPS[-1] / GAPS)
        top.semilogx(GAPS, fit, "k:", lw=1)
    top.plot([], [], "k:", lw=1, label="slope 2/k$_t$, predicted")
    top.set(xlabel="(r* - peak)/r*", ylabel="width at 5 % of the peak [sites]")
    for n in (12, 6):
        one = tables[f"wall_{n}"]
        label = f"Lennard-Jones {n}-{n // 2}"
        (line,) = wall.loglog(one["speed"], one["error"], ".-", label=f"{label}, corrected")
        wall.loglog(
            one["speed"], one["tent"], ".--", color=line.get_color(), label=f"{label}, tent"
        )
    wall.loglog(SPEEDS, 0.3 / SPEEDS, "k:", lw=1, label="slope -1")
    wall.xaxis.set_minor_formatter("")
    wall.set(xlabel="c/c$_s$", ylabel="distance to the wall: relative error")
    for axes in (small, top, wall):
        axes.legend(fontsize=8)
