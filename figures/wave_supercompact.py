"""Without prestrain solitary waves are still two and a half prisms wide."""

import numpy as np

from figures import _measure, _scenes
from figures._draw import name_curves
from figures._measure import row
from figures._tables import arrays
from tensegrity import PowerLaw, solitary_wave

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
    """Widths at fixed amplitude and at fixed energy; profiles."""
    energy = at_amplitude(0.0).energy
    rows, profiles = [], {"x": (x := np.linspace(-4, 4, 401))}
    for prestrain in PRESTRAINS:
        wave = at_amplitude(prestrain)
        same = solitary_wave(_scenes.rigid(HEIGHT, prestrain), energy=energy)
        rows.append({
            "prestrain": prestrain, "at amplitude": wave.width(), "at energy": same.width(),
            "difference on a chain": _checked(wave) if prestrain in CHECKED else np.nan,
            "peak over stroke": same.amplitude / same.potential.domain[0], "speed": wave.speed,
        })  # fmt: skip
        profiles[f"{prestrain:g}"] = wave.elongation(x) / wave.amplitude
    cubic = solitary_wave(PowerLaw(1.0, 3.0), amplitude=-1.0).width()
    limit = {
        "case": ["pure cubic force", "no prestrain, peak 1e-3 of the stroke"],
        "width": [cubic, at_amplitude(0.0, 1e-3).width()],
    }
    return {"widths": arrays(rows), "profiles": profiles, "limit": limit}


def _checked(wave):
    run_along = _measure.launched_width(wave)
    return max(abs(run_along.value - wave.width()), run_along.error)


def draw(figure, tables):
    """Widths, and profiles on a logarithmic scale."""
    figure.set_size_inches(9, 4.2)
    left, right = figure.subplots(1, 2)
    widths, (x, *_) = tables["widths"], tables["profiles"].values()
    p0 = widths["prestrain"]
    shown = np.where(p0 > 0, p0, p0[p0 > 0].min() / 10)
    left.semilogx(shown, widths["at amplitude"], "o-", label=f"{PART:g} of the\nstroke")
    left.semilogx(shown, widths["at energy"], "s-", label="equal\nenergy")
    left.axhline(tables["limit"]["width"][0], color="0.5", ls=":")
    left.text(shown.min(), 3.2, "dotted: a pure cubic force")
    left.set(xlabel="prestrain (leftmost: 0)", ylabel="width at 5 % of the peak [sites]", ylim=0)
    for name in ("0.1", "0.01", "0.001", "0"):
        profile = tables["profiles"][name]
        y = np.where(profile > 1e-12, profile, np.nan)
        right.semilogy(x[x >= 0], y[x >= 0], label=f"prestrain {name}")
    right.set(xlabel="distance from the peak [sites]", ylabel="elongation over its peak")
    right.set_ylim(1e-12, 2)
    name_curves(left, at=0, spread=24)
    name_curves(right, at=lambda y: np.flatnonzero(np.isfinite(y))[-1])


def table(tables):
    """Rows for the table of the group."""
    widths, claim = tables["widths"], "super-compact waves as the prestrain goes to 0"
    error = f"{np.nanmax(widths['difference on a chain']):.0e} (run along a chain)"
    prestrains = ", ".join(f"{p:g}" for p in PRESTRAINS)
    for name, what in (("amplitude", f"peak {PART:g} of the stroke"), ("energy", "fixed energy")):
        found = ", ".join(f"{w:.4f}" for w in widths[f"at {name}"])
        yield row(f"prestrain {prestrains}; {what}", claim, f"widths {found} sites", error)
    cubic, small = tables["limit"]["width"]
    found = f"width {small:.7f} sites, that of a pure cubic force {cubic:.7f}: not a point"
    yield row("no prestrain, small waves", claim, found, abs(cubic - small))
