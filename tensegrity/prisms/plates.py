"""Columns of prisms between rigid plates that move along the axis and turn about it.

Each plate is a polygon that two units share, with a mass and a moment of inertia; its coordinates
are the axial displacement and the rotation times the radius of gyration.  The energy of a unit is
that of its members as a function of its height and twist, its bases in equilibrium at each.
Source: the talk, part III, "Elastic problem", where the twist is in equilibrium too.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import Any

import numpy as np

from tensegrity import check
from tensegrity.engine.law import to_casadi
from tensegrity.errors import TensegrityError
from tensegrity.lattices.bloch import PeriodicBonds
from tensegrity.once import once
from tensegrity.prisms.closed import polygon
from tensegrity.scenes.network import Network
from tensegrity.springs.potential import Potential
from tensegrity.typing import Array, Members

SNAPPED = 1e-9  # of force times base: energy by which a unit is below its state at rest
GRID = 61  # points each way, at which the stiffness is bounded
FARTHEST = 0.8  # of the height and of the twist at rest: changes up to there
MARGIN = 4.0  # of the energy, between points
ITERATIONS = 5  # of Newton's method for the bases: to 1e-13 with heights halved


@dataclass(frozen=True)
class PlateLaw:
    """Law of a unit between two plates.

    The engine's elongation is the unit's energy over `force`, in the plane of both coordinates, so
    that the force on the plates is `force` times its gradient.

    Attributes
    ----------
    slenderness, prestrain, base_compliance, bar_compliance, sides : float, int
        Height over base, prestrain of the cross strings, k_cross over k_base and over k_bar, and
        number of sides.
    """

    slenderness: float
    prestrain: float
    base_compliance: float
    bar_compliance: float
    sides: int
    compiled = ("energy", "tension", "stiffness")
    name = property(repr)
    parameters = ("force",)

    def forms(self) -> tuple[Any, Any, Any]:
        """The law in CasADi: linear; see `law.Law.forms`."""
        import casadi as ca

        r, p = ca.SX.sym("r"), ca.SX.sym("p", 1)
        return r, p, (p * r, p, ca.SX(0), ca.SX(0))

    def geometry(self) -> Any:
        """CasADi functions "pair", of `engine.geometry`, and "tangent": (D, w, g, L) -> second
        derivatives of the elongation in w, (2, 2)."""
        return _geometry(self)


@once
def _geometry(law: Any) -> dict[str, Any]:
    import casadi as ca

    from derivations import mixed as derived
    from derivations.regular import SIDES

    of, angle = polygon(law.sides != 3), math.pi / law.sides
    d, w, more = ca.SX.sym("D", 2), ca.SX.sym("w", 2), [ca.SX.sym("g"), ca.SX.sym("L")]
    y = ca.SX.sym("y")
    numbers = law.slenderness, law.prestrain, law.base_compliance, law.bar_compliance
    base = ca.fabs(d[0]) / law.slenderness
    known = {derived.base_tension: y, derived.rise: w[0] / d[0] * law.slenderness}
    known[derived.half_turn] = ca.tan((math.pi / 4 + angle / 2) * w[1] / d[1])
    known |= dict(zip(derived.PARAMETERS, numbers, strict=True))
    known |= dict(zip(SIDES, (law.sides, math.sin(angle), math.cos(angle)), strict=True))
    energy = base * ca.SX(to_casadi(derived.energy_at_twist(of), list(known))(*known.values()))
    slope, across = ca.gradient(energy, y), ca.gradient(energy, w)
    curvature, mixed = ca.gradient(slope, y), ca.gradient(slope, w)
    whole, root = ca.jacobian(across, w), ca.SX(0)
    if law.base_compliance:
        step = ca.Function("step", [y, d, w], [y - slope / curvature])
        for _ in range(ITERATIONS):
            root = step(root, d, w)
        whole = whole - mixed @ mixed.T / curvature
    forms = {"pair": [energy, across], "tangent": [whole]}
    return {
        kind: ca.Function(f"geometry_{kind}", [d, w, *more],
                          [ca.substitute(form, y, root) for form in several])
        for kind, several in forms.items()
    }  # fmt: skip


class PlateSpring(Potential):
    """A unit between two plates of two coordinates each, for a `Network`.

    Parameters
    ----------
    prism : Prism
        With elastic bars.

    Notes
    -----
    The separation of two plates at rest is the height along the axis, and across it the twist of
    the unit times the radius of gyration of the plates, below 0 for the opposite handedness.
    The elongation is a measure of the energy only: `energy` and `tension` are linear in it.
    """

    def __init__(self, prism: Members) -> None:
        if math.isinf(prism.k_bar):
            raise TensegrityError("k_bar inf N/m must be finite: rigid bars leave no twist")
        self.prism, k = prism, prism.k_cross
        law: Any = PlateLaw(prism.height / prism.base, prism.prestrain, k / prism.k_base,
                       k / prism.k_bar, prism.sides)  # fmt: skip
        domain = -SNAPPED * prism.base, math.inf
        ends = "the unit has less energy than at rest", ""
        self._set(law, [k * prism.base], prism.height, domain, ends)
        self._origin = f"PlateSpring({prism!r})"

    def tangent(self, apart: Array, w: Array) -> Array:
        """Second derivatives of the energy [N/m].

        Parameters
        ----------
        apart, w : ndarray, (2,), (2, states)
            Separation of the plates at rest, and its changes [m].

        Returns
        -------
        ndarray, (states, 2, 2)
        """
        tangents = _geometry(self.law)["tangent"].map(w.shape[1])(apart, w, 0, 0)
        return self.values[0] * np.array(tangents).reshape(2, -1, 2).swapaxes(0, 1)

    def largest_stiffness(self, apart: Array, elongation: float) -> float:
        """Bound on the stiffness up to an elongation [N/m], for plates apart at rest by (2,) [m]:
        the largest one at points of a grid with up to `MARGIN` times the energy."""
        line = FARTHEST * np.linspace(-1, 1, GRID)
        w = apart[:, None] * np.stack(np.meshgrid(line, line)).reshape(2, -1)
        r = np.array(_geometry(self.law)["pair"].map(w.shape[1])(apart, w, 0, 0)[0])[0]
        inside = (r <= MARGIN * elongation) | ~w.any(axis=0)
        return float(np.linalg.eigvalsh(self.tangent(apart, w[:, inside])).max())


def plate_column(
    prism: Any, count: int, chirality: str, plates: Any, periodic: bool
) -> Network | PeriodicBonds:
    """A column between heavy plates; see `Prism.column`.

    Parameters
    ----------
    prism : Prism
    count : int
    chirality : {"alternate", "same"}
    plates : (float, float)
        Mass [kg] and radius of gyration [m].
    periodic : bool

    Returns
    -------
    Network or PeriodicBonds

    Raises
    ------
    TensegrityError
        Rigid bars, or numbers that are not above 0.
    """
    if len(plates) != 2:
        raise TensegrityError(f"{len(plates)} numbers of the plates must be 2, mass and gyration")
    mass, gyration = (
        check.number(f"{name} of the plates", x, above=0, unit=unit)
        for x, name, unit in zip(plates, ("mass", "radius of gyration"), ("kg", "m"), strict=True)
    )
    step = np.array([prism.height, gyration * prism.reference_twist])
    turns = np.where((chirality == "alternate") & (np.arange(count) % 2 == 1), -1, 1)
    apart = step * np.column_stack([np.ones(count), turns])
    positions = np.concatenate([np.zeros((1, 2)), np.cumsum(apart, axis=0)])
    each, spring = np.arange(count), PlateSpring(prism)
    ends = np.column_stack([each, each + 1])
    if not periodic:
        return Network(positions, ends, spring, mass=mass)
    blocks = np.array([spring.tangent(d, np.zeros((2, 1)))[0] for d in apart])
    offsets = np.zeros((count, 1), dtype=int)
    offsets[-1], ends[-1, 1] = 1, 0
    vectors = np.array([[count * prism.height, 0.0]])
    return PeriodicBonds(positions[:-1], vectors, ends, offsets, blocks, np.full(count, mass))
