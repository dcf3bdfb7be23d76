"""Forces that depend on velocity: the cost of a dissipative contact over an elastic one.

CPU time, all in turn in one run.  A force evaluation is a stage of one contact, at equal fixed
steps of "rk8"; from call to answer, the elastic row has the default method of a tolerance.  The
error is the largest difference of u and of v from 1e5 steps, over the largest value.
"""

from __future__ import annotations

import numpy as np

from benchmarks import lammps
from benchmarks._timing import cpu, table
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
LADDER = (100, 30, 10, 3, 1, 0.3, 0.1)  # tolerances that are tried, over that of the elastic row
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


def error_of(run, best):
    """Largest difference of u and of v at the end, over the largest value."""
    pairs = ((run.final.u, best.final.u), (run.final.v, best.final.v))
    return max(np.abs(a - b).max() / np.abs(b).max() for a, b in pairs)


def answers():
    """Print call to answer over the elastic row, at the error that it has at a tolerance: of each
    law by the loosest tolerance that attains it."""
    record = Record(times=[T_END])
    for tol, names in TOLERANCES.items():
        calls, found, target = {}, {}, None
        for name in names:
            scene = row_of({"elastic": hertz, **LAWS}[name])
            method = "rkn6" if name == "elastic" else "rk8"
            best = simulate(scene, scene.start(), T_END, dt=T_END / 100_000, method=method,
                            record=record)  # fmt: skip
            for loose in LADDER if target else (1,):
                wanted = min(tol * loose, 0.05)
                calls[name] = lambda scene=scene, wanted=wanted: simulate(
                    scene, scene.start(), T_END, tol=wanted, record=record
                )
                run = calls[name]()
                found[name] = run.steps, error_of(run, best)
                if target is None or found[name][1] <= target:
                    break
            target = target or found[name][1]
        times = cpu(calls)
        rows = [(name, 1e3 * times[name], times[name] / times["elastic"], *found[name], "<= 3")
                for name in names]  # fmt: skip
        heads = ["", "ms", "over elastic", "steps", "error", "target"]
        table(f"call to answer, elastic tol {tol:g}", heads, rows, ours=["over elastic"])


def against_lammps():
    """Print the time of a row with Kuwabara-Kono's contacts over that of LAMMPS at equal error: its
    step is halved until it has the error of our run to a tolerance."""
    module = lammps.library()
    if module is None:
        return
    scene, record = row_of(LAWS["Kuwabara-Kono"]), Record(times=[T_END])
    best = simulate(scene, scene.start(), T_END, dt=T_END / 100_000, method="rk8", record=record)
    loss, rows = scene.contacts[0].dissipation.constant, []
    x = lammps.STEEL.diameter * np.arange(scene.sites)
    for tol in (5e-2, 1e-2):

        def ours(tol=tol):
            return simulate(scene, scene.start(), T_END, tol=tol, record=record)

        error, steps, other = error_of(ours(), best), 100, np.inf
        while other > error:
            steps *= 2
            peer = lammps.Peer(module, x[:, None], loss=loss)
            peer.core.command(f"timestep {T_END / steps:.17g}")
            peer.run(steps)
            v = best.final.v
            other = np.abs(peer.velocities()[:, 0] - v).max() / np.abs(v).max()
        times = cpu({"ours": ours, "LAMMPS": lambda: peer.run(steps)})  # noqa: B023
        rows.append((error, 1e3 * times["ours"], 1e3 * times["LAMMPS"], steps,
                     times["ours"] / times["LAMMPS"], "<= 0.1"))  # fmt: skip
    heads = ["error", "ours, ms", "LAMMPS, ms", "its steps", "ours over LAMMPS", "target"]
    table("with damping, against LAMMPS", heads, rows, ours=["ours over LAMMPS"])


def main():
    """Print all tables."""
    evaluations()
    answers()
    against_lammps()
