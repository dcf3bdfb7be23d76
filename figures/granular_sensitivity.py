"""Sensitivity to data missing in the paper: angle, walls, far end and Parylene radius.

Half-angles below 30 degrees are impossible: the first beads of the branches would overlap.
"""

from __future__ import annotations

import math
from dataclasses import replace

import numpy as np

from figures import _guide
from figures._guide import PARYLENE, PTFE, STEEL, row
from granular import diamond_guide, energies, materials, sensor_force, simulate, y_guide
from tensegrity import Record, first_peak, largest_peak

NAME = "granular_sensitivity"
GROUP = "granular"

DT = 0.4e-6  # s
HALF_END, FULL_END, AT = 420e-6, 1.4e-3, 1.2e-3  # s
BEYOND = 40e-6  # s after the incident peak: the reflected one is on its way
CASES = {  # what differs: keywords of the guides, Parylene bead
    "as the paper (our reading)": ({}, PARYLENE),
    "half angle 31 deg": ({"half_angle": math.radians(31)}, PARYLENE),
    "half angle 32 deg": ({"half_angle": math.radians(32)}, PARYLENE),
    "wall gap 0.06 mm": ({"gap": 0.06e-3}, PARYLENE),
    "wall gap 0.12 mm": ({"gap": 0.12e-3}, PARYLENE),
    "walls run through the junction bead": ({"through": STEEL.radius / 2}, PARYLENE),
    "stem 2 stopped by steel": ({"end": materials["steel"]}, PARYLENE),
    "Parylene radius 2.38 mm": ({}, replace(PARYLENE, contact_radius=STEEL.radius)),
}
HALF = ("F_i/F_t", "F_i/F_r", "peak force in a PTFE branch, bead 7 [N]")
FULL = (
    "peak force in the Parylene branch, bead 7 [N]",
    "peak force in stem 2, bead 5 [N]",
    "fraction of energy in the Parylene branch at 1.2 ms",
)


NOT_COMPUTED = "not computed"
LEAST = 0.05  # %: smaller changes count as zero
SEEN = 0.05  # of the longest bar: shorter ones are labelled by numbers


def data():
    """Each quantity in each case: Fig. 2's half guide, the same with a PTFE branch, Fig. 5.

    The half guide has neither stem 2 nor Parylene: variations of these are not computed there.
    """
    columns = {"case": list(CASES)} | {name: [] for name in (*HALF, *FULL)}
    for keywords, coated in CASES.values():
        in_half = "end" not in keywords and coated is PARYLENE
        half = _half(keywords) if in_half else [NOT_COMPUTED] * len(HALF)
        for name, value in zip((*HALF, *FULL), (*half, *_full(keywords, coated)), strict=True):
            columns[name].append(value)
    return {"cases": columns}


def changes(column):
    """Changes against the first case [%], None where the quantity was not computed."""
    return [None if v == NOT_COMPUTED else 100 * (v / column[0] - 1) for v in column]


def _run(guide, t_end):
    how = {"dt": DT, "method": "rkn6", "record": Record(every=2)}
    return simulate(guide, guide.start(), t_end, **how)


def _half(keywords):
    run = _run(y_guide(bead=STEEL, striker=_guide.light(0.585), **keywords), HALF_END)
    stem = sensor_force(run, "stem 1", 16)
    instant, incident = first_peak(run.t, stem)
    there = first_peak(run.t, sensor_force(run, "branch 1", 4))[1]
    back = first_peak(run.t, stem, (instant + BEYOND, math.inf))[1]
    guide = y_guide(bead=STEEL, branches=(STEEL, PTFE), striker=_guide.light(0.585), **keywords)
    soft = _run(guide, 0.6e-3)
    return (
        incident / there,
        incident / back,
        largest_peak(soft.t, sensor_force(soft, "branch 2", 7))[1],
    )


def _full(keywords, coated):
    guide = diamond_guide(
        bead=STEEL, branches=(STEEL, coated), striker=_guide.light(0.5), **keywords
    )
    run = _run(guide, FULL_END)
    forces = [
        largest_peak(run.t, sensor_force(run, *s))[1] for s in (("branch 2", 7), ("stem 2", 5))
    ]
    held = energies(run).parts["branch 2"] / run.energy[0]
    return *forces, float(np.interp(AT, run.t, held))


def table(tables):
    """Relative changes against our reading, in percent."""
    cases, lines = tables["cases"], []
    for k, case in enumerate(cases["case"]):
        for name in (*HALF, *FULL):
            value, change = cases[name][k], changes(cases[name])[k]
            if k == 0 or (change is not None and abs(change) > LEAST):
                shown = "" if k == 0 else f" ({change:+.1f} %)"
                lines.append(row("sensitivity", f"{case}: {name}", f"{value:.4g}{shown}"))
    return lines


def draw(figure, tables):
    """Changes as bars, one panel per quantity; numbers or words where a bar is too short."""
    figure.set_size_inches(12, 5)
    cases = tables["cases"]
    places = np.arange(len(cases["case"]) - 1)[::-1]
    panels = figure.subplots(1, len(HALF) + len(FULL), sharey=True)
    for axes, name in zip(panels, (*HALF, *FULL), strict=True):
        found = changes(cases[name])[1:]
        change = np.array([one or 0.0 for one in found])
        axes.barh(places, change, color=np.where(change < 0, "C3", "C0"))
        for place, one in zip(places, found, strict=True):
            if one is None or abs(one) < SEEN * np.abs(change).max():
                text = NOT_COMPUTED if one is None else f"{one:+.1f}" if abs(one) > LEAST else "0.0"
                axes.annotate(text, (0.5, place), xycoords=("axes fraction", "data"), fontsize=6,
                              ha="center", va="center", color="0.3",
                              bbox={"fc": "w", "ec": "none", "pad": 1})  # fmt: skip
        axes.axvline(0, color="k", lw=0.6)
        axes.set_xlabel("change [%]", fontsize=8)
        axes.set_title("\n".join(_wrapped(name)), fontsize=8)
        axes.tick_params(labelsize=7)
        axes.set_axisbelow(True)
        if np.abs(change).max() < 1:
            axes.set_xlim(-1, 1)
    panels[0].set_yticks(places, cases["case"][1:], fontsize=8)


def _wrapped(text):
    import textwrap

    return textwrap.wrap(text, 25)
