"""Solitary waves in the limit of zero prestrain: the width remains a few prisms."""

from __future__ import annotations

import numpy as np

from figures import _measure, _scenes
from tensegrity import PowerLaw, simulate, solitary_wave

NAME = "wave_supercompact"
GROUP = "waves"

HEIGHT = 0.8
PRESTRAINS = (0.1, 0.03, 0.01, 3e-3, 1e-3, 1e-4, 1e-5, 0.0)
PART = 0.5  # of the locking stroke
CHECKED = (0.1, 0.01, 0.0)  # run along a chain as well


def at_amplitude(prestrain, part=PART):
    """The wave whose peak is a part of the locking stroke."""
    spring = _scenes.rigid(HEIGHT, prestrain)
    return solitary_wave(spring, amplitude=part * spring.domain[0])


def data():
    """Widths at fixed amplitude and at fixed energy; profiles; a density at no prestrain."""
    energy = at_amplitude(0.0).energy
    rows, profiles = [], {"x": (x := np.linspace(-4, 4, 401))}
    for prestrain in PRESTRAINS:
        same_peak = at_amplitude(prestrain)
        same_energy = solitary_wave(_scenes.rigid(HEIGHT, prestrain), energy=energy)
        error = _checked(same_peak) if prestrain in CHECKED else np.nan
        peak = same_energy.amplitude / same_energy.potential.domain[0]
        rows.append(
            (prestrain, same_peak.width(), same_energy.width(), error, peak, same_peak.speed)
        )
        profiles[f"{prestrain:g}"] = same_peak.elongation(x) / same_peak.amplitude
    names = ("prestrain", "at amplitude", "at energy", "difference on a chain", "peak over stroke")
    columns = zip(*rows, strict=True)
    tables = {"widths": dict(zip((*names, "speed"), columns, strict=True)), "profiles": profiles}
    cubic = solitary_wave(PowerLaw(1.0, 3.0), amplitude=-1.0)
    small = at_amplitude(0.0, 1e-3)
    tables["limit"] = {
        "case": ["pure cubic force", "no prestrain, peak 1e-3 of the stroke"],
        "width": [cubic.width(), small.width()],
    }
    wave = at_amplitude(0.0)
    run = simulate(*_scenes.launched(wave, 60, 8, 44), method="rkn6")
    return tables | {"density": _measure.density(run)}


def _checked(wave):
    run_along = _measure.launched_width(wave)
    return max(abs(run_along.value - wave.width()), run_along.error)


def draw(figure, tables):
    """Widths, profiles on a logarithmic scale, and the density in the sonic vacuum."""
    figure.set_size_inches(13, 4.2)
    axes = figure.subplots(1, 3)
    widths = tables["widths"]
    p0 = np.array(widths["prestrain"], dtype=float)
    shown = np.where(p0 > 0, p0, p0[p0 > 0].min() / 10)
    axes[0].semilogx(shown, widths["at amplitude"], "o-", label=f"peak {PART:g} of the stroke")
    axes[0].semilogx(
        shown, widths["at energy"], "s-", label="energy of that wave at zero prestrain"
    )
    axes[0].axhline(tables["limit"]["width"][0], color="0.5", ls=":", label="pure cubic force")
    axes[0].set(xlabel="prestrain (leftmost: 0)", ylabel="width at 5 % of the peak [sites]")
    axes[0].legend(fontsize=8)
    for name, profile in tables["profiles"].items():
        if name != "x" and float(name) in (0.1, 0.01, 1e-3, 0.0):
            y = np.maximum(profile, 1e-17)
            axes[1].semilogy(tables["profiles"]["x"], y, label=f"prestrain {name}")
    axes[1].set(xlabel="distance from the peak [sites]", ylabel="elongation over peak")
    axes[1].set_ylim(1e-12, 2)
    axes[1].legend(fontsize=8)
    _measure.draw_density(axes[2], tables["density"], "no prestrain")


def table(tables):
    """Rows for the table of the group."""
    widths = tables["widths"]
    error = float(np.nanmax(np.array(widths["difference on a chain"], dtype=float)))
    claim = "super-compact waves as the prestrain goes to 0"
    rows = []
    for name, what in (
        ("at amplitude", f"peak {PART:g} of the stroke"),
        ("at energy", "fixed energy"),
    ):
        found = ", ".join(f"{w:.4f}" for w in widths[name])
        rows.append(
            _measure.row(
                f"prestrain {', '.join(f'{p:g}' for p in PRESTRAINS)}; {what}",
                claim,
                f"widths {found} sites",
                f"{error:.0e} (run along a chain)",
            )
        )
    cubic, small = tables["limit"]["width"]
    rows.append(
        _measure.row(
            "no prestrain, small waves",
            claim,
            f"width {small:.7f} sites, that of a pure cubic force {cubic:.7f}: not a point",
            abs(cubic - small),
        )
    )
    return rows
