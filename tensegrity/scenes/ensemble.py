"""Ensembles: scenes of one shape that run as a batch with one time step.

The scenes are the last axis of every array, so that the values of one site in all scenes are
contiguous in memory and the processor advances several of them with one vector instruction: a batch
of short chains takes less time than the chains one after the other.  Networks have a loop each, as
do all scenes with an implicit method or with springs of different force laws.  The loops of a large
ensemble run on several threads; no result depends on their number.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from functools import cached_property

import numpy as np
from numpy.typing import ArrayLike

from tensegrity import check
from tensegrity.errors import TensegrityError
from tensegrity.printing import concise
from tensegrity.scenes.batch_dynamics import BatchDynamics
from tensegrity.scenes.dynamics import HasDynamics, dynamics
from tensegrity.scenes.scene import (
    BYTES_PER_SITE,
    Scene,
    State,
    refuse_other,
    unchecked_state,
    velocities,
)


class Ensemble(HasDynamics):
    """Several scenes of one shape, which run as a batch, for `simulate` and `gradient`.

    States have u [m] and v [m/s] of shape (sites[, dim], scenes), and runs have shape
    (T, sites[, dim], scenes); see `RunBatch`.

    Parameters
    ----------
    scenes : Scene, or sequence of Scene
        One scene, which is repeated, or several, each with masses and springs of its own.
    count : int, optional
        Number of repetitions, at least 1; required with a single scene, excluded with a sequence.

    Raises
    ------
    TensegrityError
        No scene, scenes of different shapes, or networks with contacts="follow".

    Examples
    --------
    Eight chains of prisms, struck at different velocities:

    >>> import numpy as np
    >>> from tensegrity import Chain, Ensemble, Prism, simulate
    >>> chain = Chain(Prism(1.0, 0.7, 0.01, 1.0).potential(), 40)
    >>> impacts = Ensemble(chain, 8)
    >>> runs = simulate(impacts, impacts.at_rest({0: np.linspace(0.01, 0.03, 8)}), 10.0, tol=1e-8)
    >>> runs.final.u.shape
    (40, 8)
    >>> len(runs), runs[7].u.shape[1:]
    (8, (40,))
    """

    def __init__(self, scenes: Scene | Sequence[Scene], count: int | None = None) -> None:
        if isinstance(scenes, Scene) and count is not None:
            count = check.whole("count", count, least=1)
            check.memory(
                f"a run of {scenes.sites} sites in {count} scenes",
                BYTES_PER_SITE * scenes.sites * count,
            )
            scenes = (scenes,) * count
        elif count is not None or not isinstance(scenes, Sequence):
            raise TensegrityError(
                f"scenes {check.shown(scenes)}, count {check.shown(count)}: give a scene and "
                "its count, or several scenes"
            )
        self.scenes = tuple(scenes)
        for number, scene in enumerate(self.scenes):
            if not isinstance(scene, Scene) or dynamics(scene).follows:
                raise TensegrityError(
                    f"scene {number} is {check.shown(scene)}, not a Chain or a Network of fixed "
                    "contacts"
                )
        if not self.scenes:
            raise TensegrityError("scenes is empty")
        one = self.scenes[0]
        for number, scene in enumerate(self.scenes):
            if _form(one) != _form(scene):
                raise TensegrityError(f"scene {number}, {scene!r}, differs in shape from {one!r}")

    @property
    def count(self) -> int:
        """Number of scenes in the batch."""
        return len(self.scenes)

    @cached_property
    def shape(self) -> tuple[int, ...]:
        """Shape of the displacements of a state."""
        return (*self.scenes[0].shape, self.count)

    @property
    def sites(self) -> int:
        """Number of sites of each scene."""
        return self.scenes[0].sites

    @property
    def dim(self) -> int:
        """Number of coordinates of each site."""
        return self.scenes[0].dim

    def _dynamics(self) -> BatchDynamics:
        return BatchDynamics(self)

    def at_rest(self, velocity: Mapping[int, ArrayLike] | None = None) -> State:
        """The undeformed state, in which the given sites have a velocity and all others rest.

        {site: velocity} [m/s]: one velocity for all scenes, or one per scene along the last axis.
        A site whose motion is prescribed has the displacement and velocity of its drive at t = 0.
        """
        wanted, each = (*self.shape[1:-1], self.count), [{} for _ in self.scenes]  # type: ignore
        for site, values in velocities(velocity):
            try:
                given = check.floats("velocity", values)
                if given.shape == self.shape[1:-1]:
                    given = given[..., None]
                given = np.broadcast_to(given, wanted)
            except ValueError:
                raise TensegrityError(
                    f"velocity {check.shown(values)} of site {site} must be one number or "
                    f"{self.count}"
                ) from None
            for number, mine in enumerate(each):
                one = given[..., number]
                mine[site] = one if one.ndim else float(one)
        states = [scene.at_rest(mine) for scene, mine in zip(self.scenes, each, strict=True)]
        state = State(*(np.stack([getattr(x, k) for x in states], axis=-1) for k in "uv"))
        self.check(state)
        return state

    def check(self, state: State) -> None:
        """Refuse a state of another shape, or one that a scene of the ensemble refuses."""
        dynamics(self).checked(state)

    def select(self, state: State, number: int) -> State:
        """The state of one scene, by its index from 0."""
        refuse_other(state, self.shape, f"ensemble has {self.shape}, scenes last")
        number = check.whole("scene", number, least=0, below=self.count)
        return unchecked_state(*(np.ascontiguousarray(x[..., number]) for x in (state.u, state.v)))

    __str__ = concise

    def __repr__(self) -> str:
        same = all(scene is self.scenes[0] for scene in self.scenes)
        what = repr(self.scenes[0]) if same else f"{self.scenes[0]!r}, ..."
        return f"Ensemble({what}, {self.count} scenes)"


def _form(scene: Scene) -> tuple[object, ...]:
    """What the scenes of an ensemble must have in common."""
    of = dynamics(scene)
    return scene.shape, len(scene.springs), of.wall_count, of.turns
