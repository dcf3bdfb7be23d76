"""Scenes at rest, whose motion is round-off: runs to a tolerance have nothing to compare."""

from __future__ import annotations

import sys

import numpy as np

from tensegrity.engine.force_law import BOND, SITE
from tensegrity.engine.forces import scattered_forces
from tensegrity.scenes.force import applied_forces

FAINT = 1e-6  # largest motion over a length in the first steps of a scene that may be at rest
# Distance from the equilibrium over a length that counts as round-off.
REST = 64 * sys.float_info.epsilon


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
    stiffness = dyn.stiffness_bounds(dyn.ranges_at(u))
    forces = _static_forces(dyn, u) if dyn.has_forces else dyn.forces(u)
    largest_force = np.max(np.abs(forces), initial=0.0)
    return length if largest_force <= REST * np.max(stiffness, initial=0.0) * length else None


def _changes(dyn):
    """Whether sites are driven, or springs or forces of a scene depend on time; also for scenes of
    an ensemble with forces."""
    scene = dyn.scene
    return (
        dyn.batch or scene.drive or scene.tune or any(one.law.varies for one in dyn.further_forces)
    )


def _static_forces(dyn, u):
    """Forces on all sites with further forces, at rest at t = 0 [N]; not for ensembles."""
    scene = dyn.scene
    _, r, along = scene._elongated(u)
    tension, sites = np.zeros(r.shape), np.zeros((scene.sites, scene.dim))
    for one in applied_forces(scene, as_forces=True):
        x = u.reshape(sites.shape).T if one.law.on == SITE else r[None]
        state = np.zeros((len(one.law.state), len(one.places)))
        state[: len(x)] = x[:, one.places]
        found = np.array(one.law.function()(0.0, state, one.values))
        if one.law.on == BOND:
            tension[one.places] += found[0]
        elif one.law.law is None:  # that of a potential is among the forces of the scene
            sites[one.places] += found.T
    total = scattered_forces(dyn.contact_bonds, tension, along)[: scene.sites]
    total = total.reshape(u.shape) + sites.reshape(u.shape)
    total[list(scene.held)] = 0
    return total + dyn.forces(u)
