"""Scenes of one shape that run together, with one step: a batch, the last axis of every array.

A processor works on several chains in the time of one where their sites stand next to each other,
so a batch of short chains takes less time than one chain after the other.  Networks run one after
the other, and so do all with an implicit method, or where springs have different laws.
"""

from __future__ import annotations

from collections.abc import Sequence
from functools import cached_property
from typing import TYPE_CHECKING

import numpy as np

from tensegrity import check
from tensegrity.errors import TensegrityError
from tensegrity.scenes.batch import BatchDynamics
from tensegrity.scenes.dynamics import HasDynamics, dynamics
from tensegrity.scenes.scene import PER_SITE, Scene, State, known_state, refuse_other, velocities

if TYPE_CHECKING:
    from collections.abc import Mapping

    from numpy.typing import ArrayLike


class Ensemble(HasDynamics):
    """Several scenes of one shape, for `simulate` and `gradient`.

    States have u [m] and v [m/s] of shape (sites[, dim], lanes), runs of shape (T, sites[, dim],
    lanes): see `RunBatch`.

    Parameters
    ----------
    scenes : Scene, or sequence of Scene
        The scene of every lane, or one for each lane, with masses and springs of its own.
    lanes : int, optional
        Number of scenes that run together, at least 1, where one scene is given.

    Examples
    --------
    >>> from tensegrity import Chain, Prism, simulate
    >>> chain = Chain(Prism(1.0, 0.7, 0.01, 1.0).potential(), 40)
    >>> blows = Ensemble(chain, 8)
    >>> runs = simulate(blows, blows.at_rest({0: np.linspace(0.01, 0.03, 8)}), 10.0, tol=1e-8)
    >>> runs.final.u.shape
    (40, 8)
    >>> len(runs), runs[7].u.shape[1:]
    (8, (40,))
    """

    def __init__(self, scenes: Scene | Sequence[Scene], lanes: int | None = None) -> None:
        if isinstance(scenes, Scene) and lanes is not None:
            lanes = check.whole("lanes", lanes, least=1)
            check.room(
                f"a run of {scenes.sites} sites in {lanes} lanes", PER_SITE * scenes.sites * lanes
            )
            scenes = (scenes,) * lanes
        elif lanes is not None or isinstance(scenes, Scene) or not isinstance(scenes, Sequence):
            raise TensegrityError(
                f"scenes {check.shown(scenes)}, lanes {check.shown(lanes)}: give a scene and "
                "lanes, or several scenes"
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
    def lanes(self) -> int:
        """Number of scenes."""
        return len(self.scenes)

    @cached_property
    def shape(self) -> tuple[int, ...]:
        """Shape of the displacements of a state."""
        return (*self.scenes[0].shape, self.lanes)

    @property
    def sites(self) -> int:
        """Number of sites of each scene."""
        return self.scenes[0].sites

    @property
    def dim(self) -> int:
        """Coordinates of a site."""
        return self.scenes[0].dim

    def _dynamics(self) -> BatchDynamics:
        return BatchDynamics(self)

    def at_rest(self, velocity: Mapping[int, ArrayLike] | None = None) -> State:
        """The undeformed state, some sites given a velocity [m/s]: {site: one or each lane's}.

        Sites whose motion is prescribed are where their drive begins.
        """
        wanted, each = (*self.shape[1:-1], self.lanes), [{} for _ in self.scenes]  # type: ignore
        for site, values in velocities(velocity):
            try:
                given = check.floats("velocity", values)
                if given.shape == self.shape[1:-1]:
                    given = given[..., None]
                given = np.broadcast_to(given, wanted)
            except ValueError:
                raise TensegrityError(
                    f"velocity {check.shown(values)} of site {site} must be one number or "
                    f"{self.lanes}"
                ) from None
            for lane, mine in enumerate(each):
                one = given[..., lane]
                mine[site] = one if one.ndim else float(one)
        states = [scene.at_rest(mine) for scene, mine in zip(self.scenes, each, strict=True)]
        state = State(*(np.stack([getattr(x, k) for x in states], axis=-1) for k in "uv"))
        self.check(state)
        return state

    def check(self, state: State) -> None:
        """Refuse a state of another shape, or one that a scene alone refuses."""
        dynamics(self).checked(state)

    def lane(self, state: State, number: int) -> State:
        """The state of one of the scenes, by its number from 0."""
        refuse_other(state, self.shape, f"ensemble has {self.shape}, lanes last")
        number = check.whole("lane", number, least=0, below=self.lanes)
        return known_state(*(np.ascontiguousarray(x[..., number]) for x in (state.u, state.v)))

    def __repr__(self) -> str:
        same = all(scene is self.scenes[0] for scene in self.scenes)
        what = repr(self.scenes[0]) if same else f"{self.scenes[0]!r}, ..."
        return f"Ensemble({what}, {self.lanes} lanes)"


def _form(scene: Scene) -> tuple[object, ...]:
    """What scenes have in common whose states fit each other, bond for bond."""
    of = dynamics(scene)
    return scene.shape, len(scene.springs), of.wall_count, of.turns
