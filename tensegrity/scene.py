"""What every scene that `simulate` runs is made of: states, and what its parts have in common."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from functools import cached_property

import numpy as np

from tensegrity import check
from tensegrity.errors import TensegrityError
from tensegrity.readonly import ReadOnly, fixed

SMALLEST_MASS = 1e-300  # kg: its inverse is still a number
KINK_SHARE = 1 / 16  # of a default step where contacts open: the force has a kink there


@dataclass(frozen=True, eq=False)
class State:
    """Displacements and velocities of all sites.

    Parameters
    ----------
    u : array_like, (sites,) or (sites, dim)
        Displacement [m]; of a chain, > 0 towards higher sites.  Kept as an array of float64,
        C-contiguous: integers, other floats, views and lists are converted, what is right already
        is not copied.
    v : array_like, shape of u
        Velocity [m/s], likewise.

    Raises
    ------
    TensegrityError
        What is not made of real numbers (complex ones, truth values, text), or not finite, or of
        another shape.
    """

    u: np.ndarray
    v: np.ndarray

    def __post_init__(self):
        u = check.floats("displacement", self.u)
        if u.ndim not in (1, 2):
            raise TensegrityError(f"displacement has {u.ndim} dimensions, must have 1 or 2")
        object.__setattr__(self, "u", check.vector("displacement", u, u.shape))
        object.__setattr__(self, "v", check.vector("velocity", self.v, u.shape))

    def __add__(self, other):
        """Superposition, for waves too far apart to act on each other."""
        if not isinstance(other, State):
            return NotImplemented
        if self.u.shape != other.u.shape:
            raise TensegrityError(f"states of {self.u.size} and {other.u.size} sites do not add")
        return State(self.u + other.u, self.v + other.v)

    def reversed(self):
        """The state from which time runs backwards."""
        return State(self.u.copy(), -self.v)


class Scene(ReadOnly):
    """Base of scenes; `mass` (sites,), `held` and `shape` are theirs.

    What a scene is built from cannot be changed; make another one.

    Attributes
    ----------
    step_share : float
        Of the default step that a method takes for smooth springs.
    closing : float or ndarray
        Elongation [m] at which the ends of each bond meet, -inf where they cannot.
    """

    step_share = 1.0
    closing = -np.inf

    @cached_property
    def inverse_mass(self):
        """1/m [1/kg], 0 for a held site; (sites,)."""
        w = 1 / self.mass
        w[list(self.held)] = 0
        return fixed(w)

    def available_energy(self, state):
        """What one spring could get of the energy [J]: all of it."""
        return self.energy(state)

    def finer_share(self, met):
        """Share of a default step for a second run, from the elongations that the first met.

        None where the first run stands.
        """
        return None

    def _refuse_other(self, state):
        """Refuse what is no state of this shape."""
        if not isinstance(state, State):
            raise TensegrityError(f"state is {type(state).__name__}, not a State")
        if state.u.shape != self.shape:
            raise TensegrityError(f"state has shape {state.u.shape}, the {self._words}")


def velocities(given):
    """Pairs of a site and its velocity, from a dict or None."""
    given = {} if given is None else given
    if not isinstance(given, Mapping):
        raise TensegrityError(f"velocity {check.shown(given)} must be a dict {{site: velocity}}")
    return given.items()


def law_table(springs):
    """The different laws, the number of each spring's, and its parameters; (springs, most)."""
    laws = tuple(dict.fromkeys(spring._law for spring in springs))
    width = max((len(spring._values) for spring in springs), default=0)
    parameters = np.zeros((len(springs), width))
    for row, spring in zip(parameters, springs, strict=True):
        row[: len(spring._values)] = spring._values
    law = np.array([laws.index(spring._law) for spring in springs], dtype=int)
    return laws, fixed(law), fixed(parameters)
