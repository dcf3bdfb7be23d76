"""What acts on the beads of a scene, and the law of their contacts: arguments of every builder."""

from __future__ import annotations

import inspect
import re
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, fields
from difflib import get_close_matches
from typing import TYPE_CHECKING, Any, TypedDict, TypeVar

from granular.contact import checked_law, hertz
from tensegrity import check

if TYPE_CHECKING:
    from numpy.typing import ArrayLike

    from granular.contact import ContactLaw
    from tensegrity import Damping, Drive, Force

Build = TypeVar("Build", bound=Callable[..., Any])
Given = TypeVar("Given")


@dataclass(frozen=True)
class Surroundings:
    """What acts on beads besides their partners, and the law of their contacts; checked.

    Parameters
    ----------
    gravity : float, optional
        [m/s^2], >= 0: along the axis of a chain, or of the first stem of a guide, away from the
        striker; downward in a pack, along the last axis.  Initial states are then those of the
        static equilibrium; if there is none near the given positions, an error is raised.
    preload : float, optional
        Constant force [N], >= 0, in the direction of gravity: on the first bead, not on the
        striker, of a chain or a guide; on each bead of the top layer or row of a pack on a lattice.
        At arbitrary places a dict {site: force of shape (dim,)}.
    gaps : float or array_like, (contacts,), optional
        Way by which partners approach each other before they touch [m], >= 0: one number, or one
        for each contact, that of the striker first, those with an end last.  In a chain they are
        initial displacements from the positions in which all beads touch, which `start` and
        `at_rest` contain; in a guide all centres and side walls are where they are without gaps.
        Gaps exclude gravity and preload, which would set the beads in motion, and walls at both
        ends of a chain, whose distance is that of the beads in contact.
    law : callable (Bead, Bead or Material) -> Contact, optional
        `hertz`, `power(constant, exponent)`, or one that dissipates, such as `kuwabara_kono(c)`.
    drive : dict of int to Drive, optional
        {site: Drive}: prescribed motions, and forces that depend on time.
    damping : Damping, optional
        Dashpots to the ground and between partners, which also act while contacts are open; in
        packs whose contacts follow, to the ground only.
    friction : (float, float), optional
        Coefficient of Coulomb friction between beads and walls, >= 0, and the speed of slip v0
        [m/s], > 0, over which it is regularised: the force is slip/sqrt(slip^2 + v0^2) of it.
        Beads do not roll.
    forces : sequence of Force, optional
        Forces of time, displacement and velocity, as of `tensegrity.Network`.
    """

    gravity: float = 0.0
    preload: Any = 0.0
    gaps: ArrayLike = 0.0
    law: ContactLaw = hertz
    drive: Mapping[int, Drive] | None = None
    damping: Damping | None = None
    friction: tuple[float, float] | None = None
    forces: Sequence[Force] = ()

    def __post_init__(self) -> None:
        gravity = check.number("gravity", self.gravity, least=0, unit="m/s^2")
        law, forces = checked_law(self.law), check.sequence("forces", self.forces, "forces")
        friction: Any = self.friction
        if friction is not None:
            coefficient, speed = check.vector("friction", friction, (2,)).tolist()
            friction = (
                check.number("coefficient of friction", coefficient, least=0),
                check.number("speed of slip", speed, above=0, unit="m/s"),
            )
        self.__dict__.update(gravity=gravity, law=law, friction=friction, forces=forces)

    @property
    def push(self) -> float:
        """The preload, if it is one number [N]."""
        return check.number("preload", self.preload, least=0, unit="N")


class OfAll(TypedDict, total=False):
    """What every builder takes."""

    gravity: float
    law: ContactLaw
    drive: Mapping[int, Drive] | None
    damping: Damping | None
    forces: Sequence[Force]


class OfPlaces(OfAll, total=False):
    """What a pack at arbitrary places takes."""

    preload: Mapping[int, ArrayLike] | None


class OfLattice(OfAll, total=False):
    """What a pack on a lattice takes."""

    preload: float


class OfChain(OfLattice, total=False):
    """What a chain takes."""

    gaps: ArrayLike


class OfGuide(OfChain, total=False):
    """What a guide takes."""

    friction: tuple[float, float] | None


def surrounded(kind: type, **defaults: Any) -> Callable[[Build], Build]:
    """A decorator of builders whose last parameter, `**surroundings`, is of a kind above.

    Their signatures and docstrings then name what it stands for.

    Parameters
    ----------
    kind : type
        A TypedDict.
    **defaults
        Values other than those of `Surroundings` where an argument is left out.

    Returns
    -------
    callable
    """

    def of(build: Build) -> Build:
        signature, given = inspect.signature(build), kind.__annotations__
        own = [one for one in signature.parameters.values() if one.kind is not one.VAR_KEYWORD]
        texts, names = _texts(), [one.name for one in fields(Surroundings) if one.name in given]
        more = [
            inspect.Parameter(
                name, inspect.Parameter.KEYWORD_ONLY,
                default=defaults.get(name, getattr(Surroundings, name)),
                annotation=given[name].__forward_arg__,
            )
            for name in names
        ]  # fmt: skip
        build.__signature__ = signature.replace(parameters=[*own, *more])  # type: ignore[attr-defined]
        if build.__doc__:
            build.__doc__ = build.__doc__.replace(PLACE, "".join(texts[name] for name in names))
        return build

    return of


def accepted(build: Any, surroundings: Given) -> Given:
    """The surroundings given to a builder, if it takes them all.

    Raises
    ------
    TypeError
        A name that is not among its arguments.
    """
    known = inspect.signature(build).parameters
    for name in surroundings:  # type: ignore[attr-defined]
        if name not in known:
            close = get_close_matches(name, known, 1)
            words = f": did you mean {close[0]!r}?" if close else ""
            raise TypeError(
                f"{build.__qualname__}() got an unexpected keyword argument {name!r}{words}"
            )
    return surroundings


PLACE = "    **surroundings\n        See `Surroundings`.\n"


def _texts() -> dict[str, str]:
    """What the docstring of `Surroundings` says about each of its parameters."""
    parts = re.split(r"^    (?=\w+ : )", (Surroundings.__doc__ or "").rstrip(" "), flags=re.M)[1:]
    return {part.split(" ")[0]: f"    {part}" for part in parts}
