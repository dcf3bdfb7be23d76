"""Exact solitary waves just above and far above the sound speed, with both asymptotic profiles."""

from __future__ import annotations

import numpy as np

from figures import _exact
from figures._measure import row
from tensegrity import Prism, predict, sech2, solitary_wave, tent

NAME = "solitary_profiles"
GROUP = "waves"

PRISMS = {(0.7, 0.01): "0.7", (0.6, 0.001): "0.6"}  # (height, prestrain)
RATIOS = (1.05, 2.0, 3.0, 12.16)
X = np.linspace(-6, 6, 961)


def data():
    """Strains by prism and speed; no row where the speed exceeds the largest of the prism."""
    tables = {}
    numbers = {"height": [], "prestrain": [], "speed_ratio": [], "largest_ratio": []}
    numbers |= {name: [] for name in ("stroke_used", "width", "residual")}
    for shape, label in PRISMS.items():
        spring = Prism(1.0, *shape, 1.0).potential()
        largest = predict(spring)["compression"].speeds[1] / spring.sound_speed()
        for ratio in RATIOS:
            line = [*shape, ratio, largest, np.nan, np.nan, np.nan]
            if ratio < largest:
                wave = solitary_wave(spring, speed_ratio=ratio)
                line[4:] = [wave.amplitude / spring.domain[0], wave.width(), wave.residual]
                tables[f"h{label}_c{ratio:g}"] = {
                    "x": X,
                    "exact": wave.elongation(X) / spring.length,
                    "sech2": sech2(spring, ratio, X) / spring.length,
                    "tent": tent(spring, X) / spring.length,
                }
            for name, value in zip(numbers, line, strict=True):
                numbers[name].append(value)
    return tables | {"numbers": numbers, "checks": _exact.checks()}


def table(tables):
    """Independent checks of the waves."""
    checks = tables["checks"]
    pairs = zip(checks["quantity"], checks["value"], strict=True)
    return [
        row(f"exact waves: {name}", "", f"{value:.12g}" if "constant" in name else f"{value:.1e}",
            "a finer grid, closed forms, a chain")
        for name, value in pairs
    ]  # fmt: skip


def draw(figure, tables):
    """One row per prism, one column per speed."""
    figure.set_size_inches(12, 6)
    axes = figure.subplots(len(PRISMS), len(RATIOS), sharex=True)
    numbers = tables["numbers"]
    for index, one in enumerate(axes.flat):
        height, ratio = numbers["height"][index], numbers["speed_ratio"][index]
        title = f"h$_0$/l = {height}, p$_0$ = {numbers['prestrain'][index]}: {ratio:g} c$_s$"
        table = tables.get(f"h{height:g}_c{ratio:g}")
        if table is None:
            one.set_title(title, fontsize=9)
            largest = numbers["largest_ratio"][index]
            text = f"none: the bars\nmeet at {largest:.2f} c$_s$"
            one.text(0.5, 0.5, text, ha="center", va="center", transform=one.transAxes)
            one.set_yticks([])
            continue
        one.plot(table["x"], -table["sech2"], "C1--", label="sech$^2$")
        one.plot(table["x"], -table["tent"], "C2:", lw=2, label="tent")
        one.plot(table["x"], -table["exact"], "C0", label="exact")
        peaks = [np.max(-table[name]) for name in ("exact", "sech2", "tent")]
        one.set_ylim(-0.05 * peaks[0], 1.1 * max(c for c in peaks if c < 4 * peaks[0]))
        used, wide = numbers["stroke_used"][index], numbers["width"][index]
        title += f"\n{used:.3f} of the stroke, {wide:.2f} sites at 5 %"
        one.set_title(title, fontsize=9)
    for one in axes[:, 0]:
        one.set_ylabel("compressive strain")
    for one in axes[-1]:
        one.set_xlabel("distance from the peak [sites]")
    axes[0, 2].legend(loc="upper right", fontsize=8)
