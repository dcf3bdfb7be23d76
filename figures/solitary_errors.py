"""Errors of the sech^2 and tent profiles towards sound speed, locking and zero prestrain."""

from __future__ import annotations

import numpy as np

from tensegrity import Prism, sech2, solitary_wave, tent

NAME = "solitary_errors"
GROUP = "waves"

SHAPES = ((0.7, 0.1), (0.7, 0.01), (0.6, 0.001))  # (height, prestrain)
GAMMAS = np.geomspace(0.05, 2.0, 8)
STROKES_LEFT = np.geomspace(0.001, 0.3, 9)
PRESTRAINS = (0.0, *np.geomspace(1e-6, 0.3, 8).tolist())
HEIGHTS = (0.6, 1.2)
USED = 0.95  # of the stroke, towards zero prestrain


def spring(height, prestrain):
    """Potential of the prism with unit base and cross strings."""
    return Prism(1.0, height, prestrain, 1.0).potential()


def sech2_error(wave):
    """Largest deviation of sech^2 over the peak."""
    x = np.linspace(0, 20 / np.sqrt(24 * (wave.speed_ratio - 1)), 801)
    gap = sech2(wave.potential, wave.speed_ratio, x) - wave.elongation(x)
    return float(np.max(np.abs(gap)) / abs(wave.amplitude))


def tent_error(wave):
    """Largest deviation of the tent over the stroke."""
    x = np.linspace(0, 3, 3001)
    gap = tent(wave.potential, x) - wave.elongation(x)
    return float(np.max(np.abs(gap)) / -wave.potential.domain[0])


def data():
    """Relative errors along the three limits."""
    tables = {}
    for shape in SHAPES:
        potential, name = spring(*shape), f"h{shape[0]:g}_p{shape[1]:g}"
        waves = [solitary_wave(potential, speed_ratio=1 + g**2 / 24) for g in GAMMAS.tolist()]
        tables[f"sech2_{name}"] = {"gamma": GAMMAS, "error": list(map(sech2_error, waves))}
        sizes = (1 - STROKES_LEFT) * potential.domain[0]
        waves = [solitary_wave(potential, amplitude=size) for size in sizes.tolist()]
        tables[f"tent_{name}"] = {
            "stroke_left": STROKES_LEFT,
            "speed_ratio": [wave.speed_ratio for wave in waves],
            "error": list(map(tent_error, waves)),
        }
    for height in HEIGHTS:
        errors = []
        for prestrain in PRESTRAINS:
            potential = spring(height, prestrain)
            errors.append(
                tent_error(solitary_wave(potential, amplitude=USED * potential.domain[0]))
            )
        tables[f"prestrain_h{height:g}"] = {"prestrain": PRESTRAINS, "error": errors}
    return tables


def draw(figure, tables):
    """sech^2 towards the sound speed; tent towards locking; tent towards no prestrain."""
    figure.set_size_inches(12, 4.2)
    near, locking, vacuum = figure.subplots(1, 3)
    for shape in SHAPES:
        name = f"h{shape[0]:g}_p{shape[1]:g}"
        label = f"h$_0$/l = {shape[0]}, p$_0$ = {shape[1]}"
        table = tables[f"sech2_{name}"]
        near.loglog(table["gamma"], table["error"], ".-", label=label)
        table = tables[f"tent_{name}"]
        locking.semilogx(table["stroke_left"], table["error"], ".-", label=label)
    gamma = np.asarray(table_of(tables, "sech2")["gamma"])
    near.loglog(gamma, 0.1 * gamma**2, "k:", lw=1, label="slope 2")
    locking.axhline(0, color="k", lw=0.8)
    for height in HEIGHTS:
        table = tables[f"prestrain_h{height:g}"]
        (line,) = vacuum.semilogx(
            table["prestrain"][1:], table["error"][1:], ".-", label=f"h$_0$/l = {height}"
        )
        vacuum.axhline(table["error"][0], color=line.get_color(), ls=":")
    vacuum.axhline(1 - USED, color="k", lw=0.8)
    near.set(xlabel="$\\gamma = (24 (c/c_s - 1))^{1/2}$", ylabel="largest error of sech$^2$ / peak")
    locking.set(xlabel="fraction of the stroke left", ylabel="largest error of the tent / stroke")
    locking.set_ylim(bottom=-0.01)
    vacuum.set(xlabel="prestrain p$_0$ (dotted: p$_0$ = 0)", ylabel="error of the tent / stroke")
    vacuum.set_ylim(bottom=0)
    vacuum.set_title(f"peak at {USED} of the stroke; line: error from that alone", fontsize=8)
    for one in (near, locking, vacuum):
        one.legend(fontsize=8)


def table_of(tables, start):
    """The first table whose name starts so."""
    return next(table for name, table in tables.items() if name.startswith(start))
