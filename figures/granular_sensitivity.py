"""Data not given in the paper change forces by up to 17 %, the trapped energy by up to a third.

Open are the angle of the fork, gaps to the walls, the far end, and the radius of coated beads. The
half guide has no stem 2: what differs there is not computed for it. Half-angles below 30 degrees
are impossible: the first beads of the branches would overlap.
"""

import math
from dataclasses import replace

import numpy as np

from figures import _guide
from figures._guide import PARYLENE, PTFE, STEEL
from granular import diamond_guide, energies, materials, sensor_force, y_guide
from tensegrity import first_peak, largest_peak

NAME = "granular_sensitivity"
GROUP = "granular"

AT = 1.2e-3  # s
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


NOT_THERE = (math.nan,) * len(HALF)
LEAST = 0.05  # %: smaller changes count as zero
MARKS = "osD^v*"  # of the six quantities


def data():
    """Each quantity in each case: Fig. 2's half guide, the same with a PTFE branch, Fig. 5.

    The half guide has neither stem 2 nor Parylene: variations of these are not computed there.
    """
    rows = [
        # the end and the Parylene bead are not in the half guide
        [*(NOT_THERE if "end" in given or coated is not PARYLENE else _half(given)),
         *_full(given, coated)]
        for given, coated in CASES.values()
    ]  # fmt: skip
    columns = dict(zip((*HALF, *FULL), np.array(rows).T, strict=True))
    return {"cases": {"case": list(CASES), **columns}}


def changes(column):
    """Changes against the first case [%], nan where the quantity was not computed."""
    return 100 * (np.asarray(column) / column[0] - 1)


def _run(guide, t_end):
    return _guide.followed(guide, t_end, 0.4e-6, every=2)


def _half(keywords):
    given = {"bead": STEEL, "striker": _guide.light(0.585), **keywords}
    run = _run(y_guide(**given), 420e-6)
    stem = sensor_force(run, "stem 1", 16)
    instant, incident = first_peak(run.t, stem)
    there = first_peak(run.t, sensor_force(run, "branch 1", 4))[1]
    back = first_peak(run.t, stem, (instant + BEYOND, math.inf))[1]
    soft = _run(y_guide(branches=(STEEL, PTFE), **given), 0.6e-3)
    peak = largest_peak(soft.t, sensor_force(soft, "branch 2", 7))[1]
    return incident / there, incident / back, peak


def _full(keywords, coated):
    given = {"bead": STEEL, "striker": _guide.light(0.5), **keywords}
    run = _run(diamond_guide(branches=(STEEL, coated), **given), 1.4e-3)
    forces = [
        largest_peak(run.t, sensor_force(run, *s))[1] for s in (("branch 2", 7), ("stem 2", 5))
    ]
    held = energies(run).parts["branch 2"] / run.energy[0]
    return *forces, float(np.interp(AT, run.t, held))


def table(tables):
    """Relative changes against our reading, in percent."""
    cases, lines = tables["cases"], {}
    for k, case in enumerate(cases["case"]):
        for name in (*HALF, *FULL):
            value, change = cases[name][k], changes(cases[name])[k]
            if k == 0 or abs(change) > LEAST:
                shown = "" if k == 0 else f" ({change:+.1f} %)"
                lines[f"{case}: {name}"] = f"{value:.4g}{shown}"
    return _guide.rows("sensitivity", lines)


def draw(figure, tables):
    """All changes on one axis, a mark for each quantity."""
    figure.set_size_inches(9, 5.6)
    axes, cases = figure.subplots(), tables["cases"]
    names, rows = (*HALF, *FULL), np.arange(len(CASES) - 1)[::-1]
    for k, (name, mark) in enumerate(zip(names, MARKS, strict=True)):
        change = changes(cases[name])[1:]
        label = name.removesuffix(" [N]").replace("F_i/F_t", "$F_i/F_t$")
        axes.plot(change, rows + 0.11 * (2.5 - k), mark, ms=8, mew=0,
                  label=label.replace("F_i/F_r", "$F_i/F_r$"))  # fmt: skip
    axes.axvline(0, color="k", lw=0.8)
    for edge in rows[:-1] - 0.5:
        axes.axhline(edge, color="0.8", lw=0.6)
    axes.set(xlabel="change against our reading of the paper [%]", ylabel="what differs",
             ylim=(-0.5, rows[0] + 0.5))  # fmt: skip
    axes.set_yticks(rows, [case.replace(" deg", "°") for case in cases["case"][1:]])
    figure.legend(loc="outside lower center", ncols=2, fontsize=9)
