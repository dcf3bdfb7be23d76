"""Scenes at rest, whose motion is round-off: runs to a tolerance have nothing to compare."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

import numpy as np

from tensegrity.engine.forces import scattered_forces
from tensegrity.errors import TensegrityError
from tensegrity.runs.run import unchecked_replace
from tensegrity.runs.step import EPSILON, default_step
from tensegrity.scenes.dynamics import dynamics

if TYPE_CHECKING:
    from tensegrity.typing import Array

FAINT = 1e-6  # largest motion over a length in the first steps of a scene that may be at rest
REST = 64 * EPSILON  # distance from the equilibrium over a length that counts as round-off


def length_at_rest(problem, seen):
    """The length of the shortest bond, or else the largest displacement [m], if the scene is in
    equilibrium to round-off relative to it; None where forces or drives will move the scene.

    Parameters
    ----------
    problem : Problem
    seen : ndarray, (instants + 1, *shape)
        Displacements of a run [m]; the first ones decide whether the forces are examined.
    """
    dyn, u = problem.dynamics.listed(problem.state.u), problem.state.u
    if np.count_nonzero(problem.state.v) or (dyn.is_driven and _changes(dyn)):
        return None
    given = dyn.spring_lengths
    lengths = [s.length for s in dyn.springs.different] if given is None else np.ravel(given)
    length = min((x for x in lengths if x), default=float(np.max(np.abs(u))))
    if np.max(np.abs(seen[1] - u)) > FAINT * length:
        return None
    stiffness, forces = dyn.stiffness_bounds(dyn.ranges_at(u)), dyn.forces(u)
    if dyn.has_forces:
        forces = forces + static_forces(dyn.scene, u)
        forces[list(dyn.scene.held)] = 0
    largest_force = np.max(np.abs(forces), initial=0.0)
    return length if largest_force <= REST * np.max(stiffness, initial=0.0) * length else None


def _changes(dyn):
    """Whether sites are driven, or springs or forces of a scene depend on time; also for scenes of
    an ensemble with forces."""
    scene = dyn.scene
    return dyn.batch or scene.drive or scene.tune or any(one.varies for one in dyn.further_forces)


def run_at_rest(problem, length, tol):
    """The run of a scene at rest, whose motion is round-off and gives no error estimate.

    Parameters
    ----------
    problem : Problem
    length : float
        From `length_at_rest` [m].
    tol : float

    Returns
    -------
    Run

    Raises
    ------
    TensegrityError
        Round-off moves the scene farther than the tolerance.
    """
    run = default_step(problem)
    moved = float(np.max(np.abs(run.u - run.u[0]))) / length
    if moved > tol:
        raise TensegrityError(
            f"tol {tol:g}: the scene is at rest and moves by round-off alone, by {moved:.1e} of "
            "its shortest bond"
        )
    return unchecked_replace(run, error_estimate=moved if run.complete else None)


def static_forces(scene: Any, u: Array) -> Array:
    """Forces on the sites of a scene at rest at t = 0 [N], those of springs and dashpots left out.

    Parameters
    ----------
    scene : Scene
    u : ndarray, shape of the scene
        [m]

    Returns
    -------
    ndarray, shape of u
    """
    _, r, along = scene._elongated(u)
    tension, sites = np.zeros(r.shape), np.zeros((scene.sites, scene.dim))
    for force in scene._forces:
        of, rows = force._applied(scene), u.reshape(sites.shape)
        x = rows[of.places].T if force.on == "sites" else r[None, of.places]
        state = np.zeros((len(of.law.state), len(of.places)))
        state[: len(x)] = x
        found = np.array(of.law.function()(0.0, state, of.values))
        if force.on == "sites" and not force.stores:
            sites[of.places] += found.T
        elif force.on != "sites":
            tension[of.places] += found[0]
    scattered = scattered_forces(dynamics(scene).contact_bonds, tension, along)[: scene.sites]
    return sites.reshape(u.shape) + scattered.reshape(u.shape)
