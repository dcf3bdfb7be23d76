"""Equilibria of members under constant loads: minima of the energy, and stiff strings from afar.

A steel string stretches by a millionth of its length under its load: to first order a step across
it changes its tension by k times an error of the second order, and Newton's method in positions
takes steps as small as its stretch.  In positions and tensions it does not: the next tangent
contains the tensions that the last step predicted.  It starts from a shape of equal force
densities (Schek 1974), or from the equilibrium of softer members, which stiffen by degrees.
"""

from __future__ import annotations

from collections.abc import Callable
from contextlib import suppress
from dataclasses import dataclass, replace
from typing import Any

import numpy as np

from tensegrity.engine import forces
from tensegrity.errors import EquilibriumError
from tensegrity.minimum import FIRST, ROUND_OFF, STEPS, downhill, refuse_unbalanced, settle
from tensegrity.root import root
from tensegrity.springs.kinks import TAUT
from tensegrity.structures.members import Members
from tensegrity.structures.supports import Freedom
from tensegrity.typing import Array

QUICK = 400  # steps tried first where strings are slack: they stay on the side of the start
SOFT, SOFT_BARS = 0.1, 3.0  # stiffness times natural length, over the loads, of softer members
ROUGH = 1e-2  # unbalanced forces, over the largest, where members are not yet as stiff as given
STIFFER, LEAST = 100.0, 1.5  # factor by which softer members stiffen at first, and the least one
FEW, MANY = 8, 20  # steps in positions and tensions of softer members, and of those given
STEP, FARTHEST = 0.2, 100.0  # largest step and largest size, over the structure's own size
TOGETHER = 1e-6  # of the size of the structure: length of a cable's segment that counts as 0
BALANCED = 1e-6  # forces left over, over the tensions, of a shape under prestress


@dataclass
class LoadedMembers:
    """Members under constant loads, over the permitted motions: a `minimum.Energy`."""

    members: Members
    freedom: Freedom
    start: Array
    loads: Array

    @property
    def span(self) -> float:
        """Size of the structure [m]."""
        return float(np.ptp(self.start, axis=0).max())

    @property
    def longest(self) -> float:
        return STEP * self.span

    def freedom_at(self, x: Array) -> Freedom:
        """The permitted motions; only those on which the loads do no work count as rigid.

        None does if there is none at the start: a cable that is straight between its ends may turn
        about them once it hangs.
        """
        return self.freedom.at(x).under(self.loads) if self.freedom.rigid.size else self.freedom

    def energy(self, x: Array) -> tuple[float, float]:
        stored, work = self.members.energy(x), float(np.sum(self.loads * (x - self.start)))
        pull = np.abs(self.members.tensions(x)).sum() + np.abs(self.loads).sum()
        return stored - work, float(pull * self.members.reach(x))

    def forces(self, x: Array) -> Array:
        motions, rigid = self.freedom.motions, self.freedom_at(x).rigid
        left = motions.T @ (self.loads - self.members.gradient(x)).ravel()
        return np.asarray(motions @ (left - rigid @ (rigid.T @ left))).reshape(x.shape)

    def largest(self, x: Array) -> float:
        return float(max(np.abs(self.members.tensions(x)).max(), np.abs(self.loads).max()))

    def allowed(self, x: Array) -> float:
        return self.members.unbalanced(x, self.largest(x))

    def newton(self, x: Array, f: Array) -> Callable[[float], Array | None]:
        # the margin makes the first step frame-independent; later it would slow convergence down
        within = TAUT if x is self.start else 0.0
        return self.newton_with(self.members.tangent(x, within), x, f)

    def newton_with(self, tangent: Any, x: Array, f: Array) -> Callable[[float], Array | None]:
        """As `newton`, with a given tangent.

        Parameters
        ----------
        tangent : ndarray or sparse array, (nodes dim, nodes dim)
            [N/m]
        x, f : ndarray, (nodes, dim)
            Positions [m] and forces [N].

        Returns
        -------
        callable (float) -> ndarray or None
        """
        from scipy.sparse import eye_array

        freedom = self.freedom_at(x)
        force = freedom.motions.T @ f.ravel()
        tangent = freedom.reduced(tangent)
        softest = float(self.members.stiffness.min()) * eye_array(len(force))

        def step(shift: float) -> Array | None:
            move = downhill(tangent + shift * softest, freedom.rigid, force)
            return None if move is None else (freedom.motions @ move).reshape(x.shape)

        return step

    @property
    def prestressed(self) -> bool:
        """Whether the start is in equilibrium without the loads, and under tension."""
        tensions = self.members.tensions(self.start)
        left = replace(self, loads=np.zeros_like(self.loads)).forces(self.start)
        return bool(np.abs(left).max() < BALANCED * np.abs(tensions).max())

    def refuse(self, x: Array, f: Array) -> None:
        members = self.members
        if len(members.segments.cables):
            lengths = members.separations(x)[1]
            members.segments.refuse_together(lengths, members.ends, TOGETHER * self.span)
        if np.ptp(x, axis=0).max() > FARTHEST * self.span:
            raise EquilibriumError(
                "no equilibrium: under these loads the structure grows beyond "
                f"{FARTHEST * self.span:g} m"
            )


def from_force_densities(of: LoadedMembers) -> tuple[Array, Array] | None:
    """The shape and tensions of strings whose tensions over natural lengths are all alike, and
    their lengths together those of the strings; None where these do not reach between supports."""
    members, start = of.members, of.start
    density = np.linalg.norm(of.loads, axis=1).sum() / members.natural
    alike = replace(members, stiffness=density)
    matrix = alike.tangent(start, tensions=density * alike.separations(start)[1])
    pulls = -(matrix @ start.ravel()).reshape(start.shape)
    straight, sag = (of.newton_with(matrix, start, f)(0.0) for f in (pulls, of.loads))
    if straight is None or sag is None:
        return None

    def excess(softness: float) -> float:
        lengths = members.separations(start + straight + softness * sag)[1]
        return float(lengths.sum() - members.natural.sum())

    try:
        softness = root(excess, 0.0, 1 / ROUGH, relative=ROUGH)
    except ValueError:
        return None
    if not softness:
        return None
    x = start + straight + softness * sag
    return x, density / softness * members.separations(x)[1]


def in_positions(of: LoadedMembers, within: float) -> tuple[Array, Array]:
    """Positions and tensions of an equilibrium, by minimising the energy from the start."""
    x, _ = settle(of, of.start, within=within)
    return x, of.members.tensions(x)


def in_tensions(
    of: LoadedMembers, x: Array, tensions: Array, steps: int, within: float = 0.0
) -> tuple[Array, Array] | None:
    """Newton's method in positions and tensions.

    Parameters
    ----------
    of : LoadedMembers
    x, tensions : ndarray, (nodes, dim) and (members,)
        To start from [m], [N].
    steps : int
        Largest number of steps.
    within : float, optional
        Unbalanced forces at which to stop, over the largest; by default those of an equilibrium,
        once they no longer halve.

    Returns
    -------
    tuple of ndarray, (nodes, dim) and (members,), or None
        Positions and tensions; None where they are not found.
    """
    members, (first, second), left = of.members, of.members.ends.T, np.inf
    strings = members.tension_only
    for _ in range(steps):
        d, lengths = members.separations(x)
        along, over = d / lengths[:, None], members.stiffness * (lengths - members.natural)
        pull = np.where(strings & (tensions <= 0), 0.0, over)[:, None] * along
        f = of.loads + forces.scattered(first, second, pull, len(x))
        newton = of.newton_with(members.tangent(x, tensions=tensions), x, f)
        moves = (newton(shift) for shift in (0.0, FIRST**2, FIRST))  # nodes of slack strings
        move = next((move for move in moves if move is not None), None)
        if move is None or np.abs(move).max() > of.span:
            return None
        linear = over + members.stiffness * np.einsum("ij,ij->i", along, move[second] - move[first])
        x, tensions = x + move, np.where(strings, np.maximum(linear, 0.0), linear)
        before, left = left, float(np.abs(of.forces(x)).max(initial=0.0))
        if left <= within * of.largest(x) or (left <= of.allowed(x) and 2 * left > before):
            return x, tensions
    return None


def softened(of: LoadedMembers, x: Array, most: Array) -> LoadedMembers:
    """The same from other positions, with members that are softer.

    Parameters
    ----------
    of : LoadedMembers
    x : ndarray, (nodes, dim)
        [m]
    most : ndarray, (members,)
        The largest stiffnesses [N/m].

    Returns
    -------
    LoadedMembers
    """
    members = replace(of.members, stiffness=np.minimum(of.members.stiffness, most))
    return replace(of, members=members, start=x)


def stiffened(of: LoadedMembers) -> Array:
    """The positions of a stable equilibrium of stiff members, from those of softer ones.

    Raises
    ------
    EquilibriumError
        If it is not found, or is not stable.
    """
    members, strings = of.members, bool(of.members.tension_only.all())
    hung = from_force_densities(of) if strings else None
    found = hung and in_tensions(of, *hung, MANY)
    if not found:
        unit = np.linalg.norm(of.loads, axis=1).sum() / members.natural
        level, top = SOFT if strings else SOFT_BARS, float((members.stiffness / unit).max())
        soft = softened(of, hung[0] if hung else of.start, level * unit)
        found, factor = in_positions(soft, ROUGH), STIFFER
        while level < top:
            last = level * factor >= top
            stiffer = softened(of, found[0], level * factor * unit)
            nearer = in_tensions(stiffer, *found, MANY if last else FEW, 0.0 if last else ROUGH)
            if nearer or factor < LEAST:
                level, factor = level * factor, max(factor, STIFFER**0.5)
                found = nearer or in_positions(stiffer, ROUND_OFF if last else ROUGH)
            else:
                factor = min(factor, top / level) ** 0.5
    x = found[0]
    f = of.forces(x)
    refuse_unbalanced(of, x, f)
    if of.newton(x, f)(0.0) is None:
        raise EquilibriumError("no equilibrium found: that of softer members is not stable")
    return x


def equilibrium_positions(
    members: Members, freedom: Freedom, positions: Array, loads: Array
) -> Array:
    """Equilibrium positions under constant loads, by minimising the energy from given positions.

    Parameters
    ----------
    members : Members
    freedom : Freedom
        The permitted motions.
    positions : ndarray, (nodes, dim)
        Initial positions [m].
    loads : ndarray, (nodes, dim)
        Forces on the nodes [N].

    Returns
    -------
    ndarray, (nodes, dim)
        Positions [m].

    Raises
    ------
    EquilibriumError
        If there is no equilibrium nearby: the loads do work on a rigid motion, or the energy has
        no lower bound.
    """
    freedom.refuse_unbalanced(positions, loads)
    of = LoadedMembers(members, freedom, positions, loads)
    loose = bool(loads.any() and (members.tension_only & (members.tensions(positions) <= 0)).any())
    convex = members.linear and members.tension_only.all()  # any equilibrium is the one then
    if loose and convex:
        with suppress(EquilibriumError):
            return stiffened(of)
    x, f = settle(of, positions, QUICK if loose else STEPS)
    try:
        refuse_unbalanced(of, x, f)
    except EquilibriumError:
        if not (loads.any() and members.linear) or of.prestressed:
            raise
        with suppress(EquilibriumError):
            return stiffened(of)
        x, f = settle(of, x)
        refuse_unbalanced(of, x, f)
    return x
