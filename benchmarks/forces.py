"""Forces that depend on velocity: the cost of a dissipative contact over an elastic one.

CPU time, all in turn in one run.  A force evaluation is a stage of one contact, at equal fixed
steps of "rk8"; from call to answer, the elastic row has the default method of a tolerance.  The
error is the largest difference of u and of v from 1e5 steps or more, over the largest value.
"""

from __future__ import annotations

import numpy as np

from benchmarks._timing import table
from benchmarks.ensembles import cpu
from granular import (
    Bead,
    Striker,
    carretero_gonzalez,
    chain,
    hertz,
    hunt_crossley,
    kuwabara_kono,
    materials,
    simulate,
    viscous,
)
from tensegrity import METHODS, Record

BEADS, STEPS, T_END = 200, 2000, 2e-4
AT = {"restitution": 0.93, "speed": 0.5}
LAWS = {
    "Kuwabara-Kono": kuwabara_kono(**AT),
    "Hunt-Crossley": hunt_crossley(**AT),
    "viscous": viscous(**AT),
    "Carretero-Gonzalez, a = 1.8": carretero_gonzalez(a=1.8, **AT),
}
CONTINUOUS = ("elastic", "Kuwabara-Kono", "Hunt-Crossley")  # the others jump where contacts close
TOLERANCES = {1e-3: ("elastic", *LAWS), 1e-5: CONTINUOUS}


def row_of(law):
    """A struck row of beads."""
    bead = Bead(4.76e-3, materials["steel"], mass=0.45e-3)
    return chain([bead] * BEADS, striker=Striker(bead, 0.585), law=law)


def evaluations():
    """Print the time of a force evaluation over that of an elastic contact."""
    record, calls = Record(times=[T_END]), {}
    for name, law in {"elastic": hertz, **LAWS}.items():
        scene = row_of(law)
        method = "rk8" if name != "elastic" else "rkn6"
        calls[name] = lambda scene=scene, method=method: simulate(
            scene, scene.start(), T_END, dt=T_END / STEPS, method=method, record=record
        )
    found = cpu(calls)
    stages = {name: len(METHODS["rkn6"].drifts) if name == "elastic" else 12 for name in found}
    each = {name: 1e9 * t / (BEADS * STEPS * stages[name]) for name, t in found.items()}
    rows = [(name, t, t / each["elastic"], "<= 1.6") for name, t in each.items()]
    table("time of a contact in a stage", ["", "ns", "over elastic", "target"], rows,
          ours=["over elastic"])  # fmt: skip


def answers():
    """Print the time of a call over that of the elastic chain, at tolerances, with the errors."""
    record = Record(times=[T_END])
    for tol, names in TOLERANCES.items():
        scenes = {name: row_of({"elastic": hertz, **LAWS}[name]) for name in names}
        calls = {
            name: lambda scene=scene: simulate(scene, scene.start(), T_END, tol=tol, record=record)  # noqa: B023
            for name, scene in scenes.items()
        }
        found, rows = cpu(calls), []
        for name, scene in scenes.items():
            steps = calls[name]().steps
            dt = T_END / max(100_000, 20 * steps)
            method = "rkn6" if name == "elastic" else "rk8"
            best = simulate(scene, scene.start(), T_END, dt=dt, method=method, record=record)
            end = calls[name]().final
            error = max(
                np.abs(a - b).max() / np.abs(b).max()
                for a, b in ((end.u, best.final.u), (end.v, best.final.v))
            )
            ratio = found[name] / found["elastic"]
            rows.append((name, 1e3 * found[name], ratio, steps, error / tol, "<= 3"))
        heads = ["", "ms", "over elastic", "steps", "error/tol", "target"]
        table(f"call to answer, tol {tol:g}", heads, rows, ours=["over elastic"])


def main():
    """Print all tables."""
    evaluations()
    answers()
