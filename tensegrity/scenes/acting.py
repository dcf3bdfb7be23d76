"""What acts on a scene besides its springs and prescribed motions: forces on their places.

Splittings take forces of time alone in their kicks, and dashpots, forces linear in velocities, in
their drifts.  Others need a Runge-Kutta method, which takes all of them as they are.  Springs
between sites and the ground are forces that have an energy.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator
from functools import cached_property
from typing import Any

import numpy as np

from tensegrity import check
from tensegrity.engine.force_law import BOND, SITE, AppliedForce, ForceLaw
from tensegrity.errors import TensegrityError
from tensegrity.once import once
from tensegrity.scenes.force import AXES, Force, place_counts
from tensegrity.springs.potential import Potential
from tensegrity.springs.provenance import range_error
from tensegrity.springs.signals import Expression, expression_of
from tensegrity.typing import Array


class Acting:
    """The forces of a scene on their places.

    Parameters
    ----------
    scene : Scene

    Attributes
    ----------
    forces : tuple of AppliedForce
        All but the dashpots of `Damping`.
    """

    def __init__(self, scene: Any) -> None:
        self._scene = scene
        self.forces: tuple[AppliedForce, ...] = tuple(x._applied(scene) for x in scene._forces)

    @cached_property
    def _linear(self) -> list[Array | None]:
        bonds = place_counts(self._scene)["bonds"]
        return [coefficients(one, bonds) for one in self.forces]

    @cached_property
    def splits(self) -> bool:
        """Whether splittings take all forces."""
        pairs = zip(self.forces, self._linear, strict=True)
        return all(one.law.of_time or c is not None for one, c in pairs)

    def applied(self, as_forces: bool) -> tuple[AppliedForce, ...]:
        """All forces, the dashpots of `Damping` among them, and at least one, if a splitting does
        not take them or they shall be forces; else none."""
        return self._all if as_forces or not self.splits else ()

    @cached_property
    def _all(self) -> tuple[AppliedForce, ...]:
        more = dashpots(self._scene) or ([] if self.forces else [no_force(self._scene)])
        return (*self.forces, *(one._applied(self._scene) for one in more))

    @cached_property
    def dashpots(self) -> tuple[Array, Array]:
        """Coefficients of the dashpots [N s/m] from each coordinate to the ground, (entries,), and
        in bonds and at walls, (springs,)."""
        scene, bonds = self._scene, place_counts(self._scene)["bonds"]
        ground, bond = np.zeros((scene.sites, scene.dim)), np.zeros(len(scene.springs))
        if scene.damping is not None:
            ground += scene.damping.each("ground", scene.sites)[:, None]
            bond[:bonds] += scene.damping.each("bond", bonds)
        for one, c in zip(self.forces, self._linear, strict=True):
            if c is not None and one.law.on == SITE:
                ground[one.places] += c.T
            elif c is not None:
                bond[one.places] += c[0]
        return ground.ravel(), bond

    def of_time(self) -> Iterator[tuple[int, Expression]]:
        """Entries of u with a force of time alone, and this function of time."""
        for one in self.forces:
            for place, each in zip(one.places.tolist(), signals_of_force(one), strict=True):
                if one.law.of_time:
                    for k, signal in enumerate(each):
                        yield self._scene.dim * place + k, signal

    @property
    def stores(self) -> bool:
        """Whether some force has an energy."""
        return any(one.law.law is not None for one in self.forces)

    def stored(self, order: int, u: Array) -> Array:
        """Energies [J] of the springs to the ground, or their derivatives of a given order in u.

        Parameters
        ----------
        order : int
        u : ndarray, (..., *shape of the scene)
            Displacements [m].

        Returns
        -------
        ndarray, shape of u

        Raises
        ------
        LockingError
            A displacement outside the domain of its spring.
        """
        values, states = np.zeros(u.shape), u.shape[: u.ndim - len(self._scene.shape)]
        at_sites, sites = (x.reshape(*states, -1) for x in (values, u))
        for one, applied in zip(self._scene._forces, self.forces, strict=True):
            if one.stores:
                (low, high), at = one.expression.domain, sites[..., applied.places]
                outside = at[(at <= low) | (at >= high)]
                if outside.size:
                    raise range_error(one.expression, float(outside.flat[0]))
                at_sites[..., applied.places] += applied.stored(order, sites)
        return values


def coefficients(force: AppliedForce, bonds: int) -> Array | None:
    """Those of a force on sites or in one of so many bonds, if it is a dashpot: [N s/m], at least
    0, (components, places)."""
    if force.law.on == BOND and force.places.max(initial=-1) >= bonds:
        return None  # at a wall
    functions = _linear(force.law)
    if functions is None:
        return None
    count = len(force.places)
    found = np.array([np.broadcast_to(c(*force.values), count) for c in functions], dtype=float)
    return found if (found >= 0).all() else None


@once
def _linear(law: ForceLaw) -> list[Callable[..., Any]] | None:
    """The coefficients of a force linear in velocities as functions of its parameters."""
    import sympy as sp

    if law.law is not None or (law.on == BOND and len(law.expressions) > 1):
        return None
    found, sign = [], 1 if law.on == BOND else -1
    for force, rate in zip(law.expressions, law.rates, strict=False):
        slope = force.diff(rate)
        if slope.free_symbols & {law.time, *law.state} or sp.expand(force - slope * rate) != 0:
            return None
        found.append(sp.lambdify(law.parameters, sign * slope, "numpy"))
    return found


def signals_of_force(force: Any, x: float = 0.0, rate: float = 0.0) -> list[list[Expression]]:
    """The components of a force as functions of time in each of its places.

    Parameters
    ----------
    force : AppliedForce
    x, rate : float, optional
        Displacements or elongations [m], and velocities [m/s].

    Returns
    -------
    list of list of Expression
    """
    law, signals = force.law, []
    state = {s: rate if s in law.rates else x for s in law.state}
    components = [one.xreplace(state) for one in law.expressions]
    for values in force.values.T.tolist():
        of = dict(zip(map(str, law.parameters), values, strict=True))
        signals.append([expression_of("force", one, of) for one in components])
    return signals


def on_site_springs(ground: Any, sites: int) -> list[Force]:
    """Springs between the sites of a chain and the ground, as forces.

    Parameters
    ----------
    ground : Potential, sequence of Potential, or None
        One for all sites, or one for each.
    sites : int

    Returns
    -------
    list of Force
        One for each law and domain.

    Raises
    ------
    TensegrityError
        Neither of these, or another number of springs.
    """
    if ground is None or isinstance(ground, Potential):
        return [] if ground is None else [Force(ground)]
    springs = check.sequence("ground", ground, "potentials")
    if len(springs) != sites:
        raise TensegrityError(f"{len(springs)} springs to the ground for {sites} sites")
    groups: dict[Any, list[int]] = {}
    for site, one in enumerate(springs):
        check.kind(f"spring to the ground of site {site}", one, Potential)
        groups.setdefault((one.law, one.domain, one.numbers.tobytes()), []).append(site)
    return [
        Force(springs[at[0]], at=at, parameters={
            name: [springs[site].parameters[name] for site in at]
            for name in springs[at[0]].parameters
        })
        for at in groups.values()
    ]  # fmt: skip


def dashpots(scene: Any) -> list[Force]:
    """The dashpots of a scene as forces."""
    import sympy as sp

    ground, bond, rate = sp.symbols("ground bond rate")
    damping, counts = scene.damping, place_counts(scene)
    forces: list[Force] = []
    if damping is None:
        return forces
    if damping.ground.any():
        along = [-ground * sp.Symbol(f"v_{k}") for k in AXES[: scene.dim]]
        values = {"ground": damping.each("ground", counts["sites"])}
        forces.append(
            Force(along if scene.dim > 1 else -ground * sp.Symbol("v"), parameters=values)
        )
    if damping.bond.any():
        values = {"bond": damping.each("bond", counts["bonds"])}
        forces.append(Force(bond * rate, "bonds", parameters=values))
    return forces


def no_force(scene: Any) -> Force:
    """A force of 0 N, with which steps of a Runge-Kutta method are those of scenes with forces."""
    import sympy as sp

    along = [0 * sp.Symbol("v") for _ in AXES[: scene.dim]]
    return Force(along if scene.dim > 1 else along[0])


def per_coordinate(scene: Any, values: Array) -> Array:
    """Values of sites, or of their coordinates, for each coordinate; shape of the scene."""
    one = values.reshape(*values.shape, *[1] * (len(scene.shape) - values.ndim))
    return np.broadcast_to(one, scene.shape)
