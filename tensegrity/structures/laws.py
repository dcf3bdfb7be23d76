"""Members whose tension is a potential's, and the kinks of all members.

A kink is an elongation at which the stiffness of a member jumps: strings slacken at 0, bars give
way at minus their buckling load over their stiffness, and a law has its own.  Between its kinks a
law is smooth; a path continues it beyond them by its tangents, and never follows that part.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from functools import cached_property
from typing import Any

import numpy as np

from tensegrity import check
from tensegrity.errors import LockingError, TensegrityError
from tensegrity.springs.collection import Springs
from tensegrity.springs.kinks import TAUT
from tensegrity.springs.potential import Potential
from tensegrity.springs.pressed import crossing
from tensegrity.typing import Array, Flags, Indices

SMOOTH = 2.0  # exponent from which a term of the tension leaves the stiffness smooth
AT_REST = 1e-9  # tension at the natural length, over stiffness times this length, that is round-off
KINDS = ("slack", "buckling", "kink", "end")  # of kinks: of strings, bars and laws, and their end


@dataclass(frozen=True)
class Kinks:
    """The kinks of all members, sorted by member and place.

    Attributes
    ----------
    member : ndarray of int, (kinks,)
    place : ndarray, (kinks,)
        Elongations [m].
    kind : ndarray of int, (kinks,)
        Index into `KINDS`.
    """

    member: Indices
    place: Array
    kind: Indices

    @classmethod
    def of(cls, tension_only: Flags, least: Array | None, laws: Laws | None) -> Kinks:
        """The kinks of strings, bars and laws.

        Parameters
        ----------
        tension_only : ndarray of bool, (members,)
            Which members are strings.
        least : ndarray, (members,), or None
            Elongations at which bars give way [m].
        laws : Laws or None

        Returns
        -------
        Kinks
        """
        rows = [(m, 0.0, 0) for m in np.flatnonzero(tension_only).tolist()]
        if least is not None:
            bars = np.flatnonzero(~tension_only).tolist()
            rows += [(m, float(least[m]), 1) for m in bars]
        for m, law in laws.of.items() if laws else ():
            places = {float(place) for place, *_, exponent, _ in law.kinks if exponent < SMOOTH}
            ends = [end for end in law.domain if np.isfinite(end)]
            both = [(x, 2) for x in places - {*ends}] + [(x, 3) for x in ends]
            rows += [(m, x, kind) for x, kind in both if x > 0 or not tension_only[m]]
        rows.sort()
        member, place, kind = zip(*rows, strict=True) if rows else ((), (), ())
        return cls(np.array(member, dtype=np.int64), np.array(place), np.array(kind, dtype=int))


@dataclass(frozen=True, eq=False)
class Laws:
    """Potentials of the elongation of some members.

    Attributes
    ----------
    of : dict of int to Potential
        By the number of the member.
    natural : ndarray, (members,)
        Natural lengths [m], of all members.
    tension_only : ndarray of bool, (members,)
        Which are strings.
    """

    of: Mapping[int, Potential]
    natural: Array
    tension_only: Flags

    @cached_property
    def member(self) -> Indices:
        """Numbers of the members with a law, (laws,)."""
        return np.array([*self.of], dtype=np.int64)

    @cached_property
    def _springs(self) -> Springs:
        return Springs(tuple(self.of.values()))

    @cached_property
    def _margin(self) -> Array:
        return TAUT * self.natural[self.member]

    @cached_property
    def _at_rest(self) -> Array:
        """Energies of strings that just slacken [J], (laws,); bars keep those of their law."""
        energy = self._springs.evaluate("energy", np.zeros(len(self.of)))
        return np.where(self.tension_only[self.member], energy, 0.0)

    @cached_property
    def domain(self) -> tuple[Array, Array]:
        """Least and largest elongations [m], of strings from 0, (laws,) each."""
        low, high = np.array([law.domain for law in self.of.values()]).reshape(-1, 2).T
        return np.where(self.tension_only[self.member], 0.0, low), high

    @cached_property
    def stiffness(self) -> Array:
        """Stiffness at the natural length [N/m], of strings when lengthened, (laws,)."""
        return self.values(np.zeros(len(self.natural)), *self.domain)[2]

    def values(self, r: Array, low: Array, high: Array) -> tuple[Array, Array, Array]:
        """Energies [J], tensions [N] and stiffnesses [N/m], each (..., laws).

        Parameters
        ----------
        r : ndarray, (..., members)
            Elongations of all members [m].
        low, high : ndarray, (laws,)
            Elongations beyond which tangents continue the law [m].

        Returns
        -------
        tuple of three ndarray, (..., laws)
        """
        r = r[..., self.member]
        inside = np.clip(r, low + self._margin, high - self._margin)
        energy, tension, stiffness = (
            self._springs.evaluate(name, inside) for name in ("energy", "tension", "stiffness")
        )
        beyond = r - inside
        energy = energy - self._at_rest + tension * beyond + stiffness * beyond**2 / 2
        return energy, tension + stiffness * beyond, stiffness

    def between(self, kinks: Kinks, above: Flags) -> tuple[Array, Array]:
        """The kinks on either side of the members with laws.

        Parameters
        ----------
        kinks : Kinks
        above : ndarray of bool, (kinks,)
            Which kinks the members are above.

        Returns
        -------
        low, high : ndarray, (laws,)
            [m]; infinite where there is none.
        """
        low, high = np.full((2, len(self.natural)), np.inf) * [[-1.0], [1.0]]
        np.maximum.at(low, kinks.member[above], kinks.place[above])
        np.minimum.at(high, kinks.member[~above], kinks.place[~above])
        return low[self.member], high[self.member]

    def refuse_beyond(self, r: Array, name_of: Any) -> None:
        """Refuse elongations outside the domains of the laws.

        Parameters
        ----------
        r : ndarray, (members,)
            Of all members [m].
        name_of : callable int -> str
            Names of members, for messages.

        Raises
        ------
        LockingError
        """
        (low, high), mine = self.domain, r[self.member]
        low = np.where(self.tension_only[self.member], -np.inf, low)
        out = np.flatnonzero((mine < low - self._margin) | (mine > high + self._margin))
        if out.size:
            member = int(self.member[out[0]])
            try:
                self.of[member].energy(float(r[member]))
            except LockingError as error:
                raise LockingError(f"{name_of(member)}: {error}") from None


def elongation_under(law: Potential, tension: float, name: str) -> float:
    """The elongation of least size at which a law has a tension.

    Parameters
    ----------
    law : Potential
    tension : float
        [N]
    name : str
        Of the member, for messages.

    Returns
    -------
    float
        [m]

    Raises
    ------
    TensegrityError
        A tension that the law never has.
    """
    side = 1 if tension > 0 else -1
    values = lambda x: side * law.derivative(1, side * x)  # noqa: E731
    found = crossing(law, values, abs(tension), side) if tension else 0.0
    if found is None:
        raise TensegrityError(f"tension {tension:.6g} N of {name} is never reached by its law")
    return side * found


def laws_of(given: Any, strings: Flags, name_of: Any) -> dict[int, Potential]:
    """The laws of members by number, checked: one potential for all strings, or a dict.

    Parameters
    ----------
    given : Potential or dict of int to Potential
    strings : ndarray of bool, (members,)
        Which members are strings.
    name_of : callable int -> str
        Names of members, for messages.

    Returns
    -------
    dict of int to Potential

    Raises
    ------
    TensegrityError
        If these are no potentials, a member does not exist, or a law changes with time, jumps or
        has tension at the natural length, or does not resist there.
    """
    if isinstance(given, Potential):
        each: Mapping[Any, Any] = dict.fromkeys(np.flatnonzero(strings).tolist(), given)
    elif isinstance(given, Mapping):
        each = given
    else:
        raise TensegrityError(
            f"law {check.shown(given)} must be a Potential, or a dict {{member: Potential}}"
        )
    found = {}
    for key, law in each.items():
        member = check.whole("member with a law", key, least=0, below=len(strings))
        words = f"law of {name_of(member)}"
        check.kind(words, law, Potential)
        law.energy(0.0)  # refuses what changes with time
        if not all(kink[2] > 0 for kink in law.kinks) or any(np.isnan(k[0]) for k in law.kinks):
            raise TensegrityError(f"{words} jumps, or its kinks are not known: {check.shown(law)}")
        found[member] = law
    return dict(sorted(found.items()))


def checked(laws: Laws, name_of: Any) -> Laws:
    """Laws, refused if they have tension at the natural length or do not resist there.

    Parameters
    ----------
    laws : Laws
    name_of : callable int -> str
        Names of members, for messages.

    Returns
    -------
    Laws

    Raises
    ------
    TensegrityError
    """
    stiffness = laws.stiffness
    for member, law, k in zip(laws.member.tolist(), laws.of.values(), stiffness, strict=True):
        rest = float(law.tension(0.0))
        if not k > 0 or not np.isfinite(k):
            raise TensegrityError(
                f"law of {name_of(member)} has stiffness {k:g} N/m at the natural length, must be "
                "finite and above 0"
            )
        if abs(rest) > AT_REST * k * laws.natural[member]:
            raise TensegrityError(
                f"law of {name_of(member)} has tension {rest:g} N at the natural length, must be 0"
            )
    return laws
