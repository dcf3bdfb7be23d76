"""A fit recovers prestrain and base stiffness of a prism from a noisy load curve."""

from __future__ import annotations

import numpy as np

from figures._files import lines
from tensegrity import Prism, fit, member_stiffness

NAME = "structures_fit"
GROUP = "structures"

LENGTHS = (0.13, 0.08, 0.1623)  # natural, of cross strings, base strings and bars [m]
STRING = {"modulus": 5.5e9, "area": np.pi / 4 * 0.76e-3**2}
BAR = {"modulus": 210e9, "area": 36.6e-6}
OFFSET = 2e-4  # [m]
NOISE = 0.01  # of the largest load
POINTS, LARGEST = 60, 4.8e-3
SEED = 0


def data(progress=iter):
    """Synthetic data points, and the fit to them."""
    k = [member_stiffness(length=length, **of)
         for length, of in zip(LENGTHS, (STRING, STRING, BAR), strict=True)]  # fmt: skip
    true = Prism.from_members(*LENGTHS, *k)
    shortening = np.linspace(0, LARGEST, POINTS + 1)[1:] - OFFSET
    clean = -true.potential().tension(-(shortening + OFFSET))
    noise = NOISE * clean.max()
    load = clean + noise * np.random.default_rng(SEED).standard_normal(POINTS)
    start = Prism(true.base, true.height, 0.03, true.k_cross, 0.7 * true.k_base, true.k_bar)
    found = fit(shortening, load, start, noise=noise)
    known = {"prestrain": true.prestrain, "k_base": true.k_base, "offset": OFFSET}
    return {
        "points": {
            "shortening": shortening, "load": load, "fitted": found.computed(),
            "band": 1.96 * found.band(), "residual": found.residuals, "true": clean,
        },
        "parameters": {
            "parameter": list(found.names), "true": [known[n] for n in found.names],
            "fitted": [found.values[n] for n in found.names],
            "error": [found.errors[n] for n in found.names],
        },
        "said": {"words": [*found.unidentified], "noise": [float(noise)],
                 "condition": [found.condition]},
    }  # fmt: skip


def draw(figure, tables):
    """Above, the curve with its 95 % band; below, the residuals and the noise."""
    points, noise = tables["points"], tables["said"]["noise"][0]
    above, below = figure.subplots(2, 1, sharex=True, height_ratios=(3, 1))
    x = 1e3 * points["shortening"]
    above.plot(x, points["load"], "o", ms=3, color="0.45", label="points, noise 1 % of the largest")
    above.plot(x, points["fitted"], color="C0", label="fitted prism")
    low, high = (points["fitted"] + side * points["band"] for side in (-1, 1))
    above.fill_between(x, low, high, color="C0", alpha=0.35, label="95 % band of the curve")
    rows = tables["parameters"]
    lines = [
        f"{name.replace('_', ' ')} = {value:.4g} ± {error:.2g}  (true {true:.4g})"
        for name, value, error, true in zip(
            rows["parameter"], rows["fitted"], rows["error"], rows["true"], strict=True
        )
    ]
    lines += [f"not identified: {word.replace('_', ' ')}" for word in tables["said"]["words"]]
    above.text(0.98, 0.04, "\n".join(lines), transform=above.transAxes, ha="right", fontsize=8)
    above.set_ylabel("load [N], compression > 0")
    above.legend(fontsize=8, loc="upper left")
    below.axhspan(-1.96 * noise, 1.96 * noise, color="0.9")
    below.plot(x, points["residual"], "o", ms=3, color="0.45")
    below.set(xlabel="shortening [mm]", ylabel="residual [N]")


def table(tables):
    """Estimated and true parameters."""
    return lines(tables["parameters"])
