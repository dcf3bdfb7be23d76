"""Scenes at rest, whose motion is round-off."""

from __future__ import annotations

import numpy as np

from tensegrity.errors import TensegrityError
from tensegrity.runs.run import changed
from tensegrity.runs.step import default_step

EPSILON = float(np.finfo(float).eps)
FAINT = 1e-6  # of a length: motion in the first steps of what may be at rest
REST = 64 * EPSILON  # of a length, by which a place may be off its equilibrium


def rests(problem, seen):
    """The length [m] beside which a scene is in equilibrium to round-off: the shortest bond; None
    where forces, or time, will move it.

    Parameters
    ----------
    problem : Problem
    seen : ndarray, (instants + 1, *shape)
        Displacements of a run [m], of which the first ones tell whether it is worth a look.
    """
    of, u = problem.dynamics.listed(problem.state.u), problem.state.u
    if of.is_driven or np.count_nonzero(problem.state.v):
        return None
    given = of.spring_lengths
    lengths = [s.length for s in of.springs.different] if given is None else np.ravel(given)
    length = min((x for x in lengths if x), default=0.0)
    if np.max(np.abs(seen[1] - u)) > FAINT * length:
        return None
    stiffness = of.stiffness_within(of.present_ranges(u))
    pull = np.max(np.abs(of.forces(u)), initial=0.0)
    return length if pull <= REST * np.max(stiffness, initial=0.0) * length else None


def resting(problem, length, tol):
    """The run of a scene at rest, whose motion is round-off, and tells nothing of an error."""
    run = default_step(problem)
    moved = float(np.max(np.abs(run.u - run.u[0]))) / length
    if moved > tol:
        raise TensegrityError(
            f"tol {tol:g}: the scene is at rest, and leaves it by round-off alone, as far as "
            f"{moved:.1e} of its shortest bond"
        )
    return changed(run, error_estimate=moved if run.complete else None)
