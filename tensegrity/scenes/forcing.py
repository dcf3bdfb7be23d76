"""Forcing: prescribed motions of sites, forces that depend on time, and viscous damping.

A `Drive` is a function of time that prescribes the motion of one site, or a force on it.  A dashpot
resists in proportion to the rate of elongation of its bond, or to the velocity of its site.  Scenes
take them as `drive={site: Drive}` and `damping=Damping(...)`; `forcing_of` puts them into the
arrays of the time-stepping loop.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from contextlib import suppress
from dataclasses import dataclass, field, replace
from typing import TYPE_CHECKING

import numpy as np

from tensegrity import check
from tensegrity.engine.driven import Forcing
from tensegrity.engine.inertia import Ties
from tensegrity.errors import TensegrityError
from tensegrity.printing import concise, printed
from tensegrity.readonly import FixedDict, fixed
from tensegrity.scenes.acting import per_coordinate, signals_of_force
from tensegrity.scenes.dynamics import dynamics
from tensegrity.scenes.force import Force, place_counts
from tensegrity.springs.signals import (
    KINK_ORDER,
    RTOL,
    check_signals,
    in_columns,
    largest_frequency,
    signals_of,
)

if TYPE_CHECKING:
    from typing import Any, TypeAlias

    import sympy as sp
    from numpy.typing import ArrayLike

    from tensegrity.typing import Array, Sampled

    Signal: TypeAlias = sp.Expr | float | tuple[ArrayLike, ArrayLike] | Sampled

ATOL = 1e-12  # m: tolerance on the initial position of a driven site


@dataclass(frozen=True, eq=False)
class Drive:
    """A prescribed motion of a site, or a force on it, as a function of time.

    Exactly one of the two must be given, either as a SymPy expression of `t` [s] or as samples
    (t, values), also a `TimeSeries`, which are interpolated by a cubic spline.  In the plane and in
    space it has one component per coordinate: a sequence of expressions, with None for a coordinate
    that is free, or values of shape (samples, dim).

    Parameters
    ----------
    displacement : sympy.Expr, float, (t, values), TimeSeries, or sequence of expressions, optional
        Displacement u(t) from the reference position [m], which the site follows exactly.
    force : sympy.Expr, float, (t, values), TimeSeries, or sequence of expressions, optional
        Force [N], > 0 along the axis, in addition to the forces of the bonds and loads.
    parameters : dict of str to float, optional
        Values of further symbols, which `orbit_path` can follow and `varied` changes.

    Raises
    ------
    TensegrityError
        Neither or both given; an expression of symbols other than t and the parameters; a parameter
        that does not occur or is not finite; samples that are not finite, or whose times do not
        increase.  The run refuses values that are not finite, and jumps.

    Examples
    --------
    >>> import sympy as sp
    >>> from tensegrity import Chain, Drive, PowerLaw
    >>> t = sp.Symbol("t")
    >>> shaker = Drive(displacement=0.01 * sp.sin(2 * t))
    >>> float(shaker.at(0.0, order=1)[0])
    0.02
    >>> chain = Chain(PowerLaw(1.0, 1.5), sites=10, drive={0: shaker})
    """

    displacement: Any = None
    force: Any = None
    parameters: Mapping[str, float] = field(default_factory=FixedDict)
    signals: tuple[Any, ...] = field(init=False, repr=False)  # per coordinate; None if free
    prescribes: bool = field(init=False, repr=False)

    __str__ = concise

    if TYPE_CHECKING:  # what converts is taken

        def __init__(
            self,
            displacement: Signal | Sequence[sp.Expr | float | None] | None = None,
            force: Signal | Sequence[sp.Expr | float | None] | None = None,
            parameters: Mapping[str, float] = ...,
        ) -> None: ...

    def __post_init__(self) -> None:
        given = [name for name in ("displacement", "force") if getattr(self, name) is not None]
        if len(given) != 1:
            raise TensegrityError(f"a drive needs one of displacement and force, not {len(given)}")
        if not isinstance(self.parameters, Mapping):
            raise TensegrityError(f"parameters {check.shown(self.parameters)} must be a dict")
        values = {
            str(name): check.number(f"parameter {name} of the drive", value)
            for name, value in self.parameters.items()
        }
        if "t" in values:
            raise TensegrityError("parameter t of a drive is the time")
        signals = signals_of(given[0], getattr(self, given[0]), values)
        idle = sorted(values.keys() - {k for s in signals if s is not None for k in s.parameters})
        if idle:
            raise TensegrityError(f"{given[0]} of the drive does not contain {', '.join(idle)}")
        object.__setattr__(self, "parameters", FixedDict(values))
        object.__setattr__(self, "signals", signals)
        object.__setattr__(self, "prescribes", given[0] == "displacement")

    def varied(self, values: Mapping[str, float]) -> Drive:
        """The same drive with other values of some of its parameters, as for a sweep."""
        if not isinstance(values, Mapping):
            raise TensegrityError(f"parameters {check.shown(values)} must be a dict")
        return replace(self, parameters={**self.parameters, **values})

    def at(self, t: ArrayLike, order: int = 0) -> Array:
        """Values [m] or [N] at times t [s], or their rates for order 1.

        Parameters
        ----------
        t : array_like
            Times [s].
        order : {0, 1}, optional
            Order of the derivative in time.

        Returns
        -------
        ndarray, (coordinates, *shape of t)
            0 for a coordinate that is free.
        """
        t = check.floats("t", t)
        if check.whole("order", order, least=0) > 1:
            raise TensegrityError(f"order {order} must be 0 or 1")
        return np.array([np.zeros(t.shape) if s is None else s(t, order) for s in self.signals])


@dataclass(frozen=True, eq=False)
class Damping:
    """Viscous damping: dashpots in the bonds and between the sites and the ground.

    Parameters
    ----------
    bond : float or array_like, (bonds,), optional
        Damping coefficient of each bond [N s/m], >= 0: its force is proportional to the rate of
        elongation, also while a contact is open.  A network's contacts with walls are not damped;
        the contacts of a chain of beads with its end walls are bonds.
    ground : float or array_like, (sites,), optional
        Damping coefficient of each site [N s/m], >= 0: its force is proportional to the velocity.

    Raises
    ------
    TensegrityError
        A coefficient that is negative or not finite, or an array of more than one axis.

    Examples
    --------
    Two masses of 1 kg in contact, slowed by the ground with the time constant m/c = 5 s:

    >>> from tensegrity import Chain, Damping, PowerLaw, simulate
    >>> pair = Chain(PowerLaw(1.0, 1.5), sites=2, damping=Damping(ground=0.2))
    >>> run = simulate(pair, pair.at_rest({0: 1.0, 1: 1.0}), t_end=5.0, tol=1e-8)
    >>> run.final.v.round(4)  # exp(-1)
    array([0.3679, 0.3679])
    """

    bond: Array = 0.0  # type: ignore[assignment]
    ground: Array = 0.0  # type: ignore[assignment]

    __str__ = printed(bond="N s/m", ground="N s/m")

    if TYPE_CHECKING:  # what converts is taken, arrays are kept

        def __init__(self, bond: ArrayLike = 0.0, ground: ArrayLike = 0.0) -> None: ...

    def __post_init__(self) -> None:
        for name in ("bond", "ground"):
            values = check.floats(f"{name} damping", getattr(self, name))
            if values.ndim > 1:
                raise TensegrityError(f"{name} damping has shape {values.shape}, must be (n,)")
            bad = values[~(np.isfinite(values) & (values >= 0))]
            if bad.size:
                raise TensegrityError(
                    f"{name} damping {bad.flat[0]:g} N s/m must be at least 0 and finite"
                )
            object.__setattr__(self, name, fixed(values))

    def each(self, name: str, count: int) -> Array:
        """Damping coefficients [N s/m] of all bonds or sites (`name`); (count,)."""
        values = getattr(self, name)
        if values.ndim and values.shape != (count,):
            raise TensegrityError(f"{name} damping has shape {values.shape}, must be ({count},)")
        return np.broadcast_to(values, (count,)).copy()


def checked_forcing(scene: Any, drive: Any, damping: Any, forces: Any = ()) -> dict[str, Any]:
    """Validate the forcing of a scene.

    Parameters
    ----------
    scene : Scene
    drive : dict of int to Drive, or None
    damping : Damping or None
    forces : sequence of Force

    Returns
    -------
    dict
        The attributes `drive`, `damping` (None if all coefficients are 0) and `_forces` of the
        scene.

    Raises
    ------
    TensegrityError
        A drive of a held or missing site or with a wrong number of components, damping of another
        number of bonds or sites, or what is no force.
    """
    drive = {} if drive is None else drive
    if not isinstance(drive, Mapping):
        raise TensegrityError(f"drive {check.shown(drive)} must be a dict {{site: Drive}}")
    for site, one in drive.items():
        number = check.whole("driven site", site, least=0, below=scene.sites)
        check.kind(f"drive of site {number}", one, Drive)
        if len(one.signals) != scene.dim:
            raise TensegrityError(
                f"drive of site {number} has {len(one.signals)} components, must have {scene.dim}"
            )
        if number in scene.held:
            raise TensegrityError(f"site {number} is held and cannot be driven")
    if damping is not None:
        check.kind("damping", damping, Damping)
        damping.each("bond", place_counts(scene)["bonds"])
        damping.each("ground", scene.sites)
        if not (damping.bond.any() or damping.ground.any()):
            damping = None
    given = check.sequence("forces", forces, "forces")
    for one in given:
        check.kind("a force", one, Force)
    return {"drive": FixedDict(drive), "damping": damping, "_forces": given}


def refuse_driven(scene: Any, what: str) -> None:
    """Refuse a scene that is driven, damped or changes, in an analysis of conservative scenes."""
    if dynamics(scene).is_driven:
        raise TensegrityError(
            f"{what}: not for scenes that are driven or damped, or have springs that change, "
            "further forces or springs to the ground"
        )
    refuse_heavy_bonds(scene, what)


def refuse_heavy_bonds(scene: Any, what: str) -> None:
    """Refuse a network whose bonds have mass, where masses must be those of sites."""
    if scene.bond_mass is not None:
        raise TensegrityError(f"{what}: not for networks whose bonds have mass")


def time_signals(scene: Any) -> list[Any]:
    """All functions of time that drive or change a scene, or the scenes of an ensemble."""
    signals: list[Any] = []
    for one in getattr(scene, "scenes", (scene,)):
        for spring in dynamics(one).springs.changing:
            signals += spring.signals.values()
        for drive in one.drive.values():
            signals += [signal for signal in drive.signals if signal is not None]
    return signals


def frequency_of_drives(scene: Any, state: Any, t_end: float) -> float:
    """Largest estimate of an angular frequency of drives, of springs and forces that change.

    Parameters
    ----------
    scene : Scene
    state : State
        Forces are estimated at displacements and velocities like these.
    t_end : float
        [s]

    Returns
    -------
    float
        [rad/s]
    """
    largest = largest_frequency(time_signals(scene), t_end)
    x, rate = (float(np.max(np.abs(values))) or 1.0 for values in (state.u, state.v))
    for one in getattr(scene, "scenes", (scene,)):
        for force in dynamics(one).acting.forces:
            if force.law.varies:
                each = signals_of_force(force, x, rate)
                signals = {s.key: s for place in each for s in place}.values()
                with suppress(TensegrityError):  # infinite at these displacements
                    largest = max(largest, largest_frequency([*signals], t_end))
    return largest


def _components(scene: Any, prescribed: bool) -> Iterator[tuple[int, int, int, Any]]:
    """Of each coordinate with a prescribed motion, or with a prescribed force: site, axis, index in
    the flattened u, and function of time."""
    for site, drive in scene.drive.items():
        for axis, signal in enumerate(drive.signals):
            if drive.prescribes == prescribed and signal is not None:
                yield site, axis, site * scene.dim + axis, signal


def start_driven_sites(scene: Any, u: Array, v: Array) -> None:
    """Set driven sites to the displacements and velocities of their drives at t = 0, in place.

    Parameters
    ----------
    scene : Scene
    u, v : ndarray, (sites[, dim])
        [m], [m/s].
    """
    for _, _, entry, signal in _components(scene, True):
        u.reshape(-1)[entry], v.reshape(-1)[entry] = (signal(np.array(0.0), k) for k in (0, 1))


def driven_entries(scene: Any, prescribed: bool) -> tuple[Any, Any]:
    """Indices in the flattened u with a prescribed motion, or with a force, and their functions."""
    found = [(entry, signal) for _, _, entry, signal in _components(scene, prescribed)]
    return np.array([x for x, _ in found], dtype=int), tuple(signal for _, signal in found)


def check_start(scene: Any, u: Array) -> None:
    """Refuse displacements of driven sites that differ from their drives at t = 0."""
    for site, axis, entry, signal in _components(scene, True):
        prescribed, actual = float(signal(np.array(0.0))), float(u.reshape(-1)[entry])
        if abs(actual - prescribed) > ATOL + RTOL * abs(prescribed):
            raise TensegrityError(
                f"site {site} is at {actual:.9g} m, its drive {signal} begins at "
                f"{prescribed:.9g} m (axis {axis}): start from `at_rest`, or let the drive "
                "begin there"
            )


def forcing_of(scene: Any, t_end: float, timed: Any = None, as_forces: bool = False) -> Forcing:
    """The forcing of a scene as arrays for the loop; see `tensegrity.engine.driven`.

    Parameters
    ----------
    scene : Scene
    t_end : float
        End of the run [s].
    timed : TimedSprings, optional
        The springs, if some change with time.
    as_forces : bool, optional
        Whether dashpots are further forces, as Runge-Kutta methods take them.

    Returns
    -------
    Forcing

    Raises
    ------
    TensegrityError
        A drive that is not finite, has a jump, or is not defined up to `t_end`.
    """
    dyn = dynamics(scene)
    (moved, motions), (forced, pulls) = (driven_entries(scene, x) for x in (True, False))
    held = np.repeat(np.isin(np.arange(scene.sites), scene.held), scene.dim)
    acting = dyn.acting
    ground, bond = (x.copy() for x in acting.dashpots)
    ground[held] = 0.0
    if applied := acting.applied(as_forces):  # dashpots are among them
        ground[:], bond[:] = 0.0, 0.0
    else:
        fixed_entries = {*moved.tolist(), *np.flatnonzero(held).tolist()}
        more = [pair for pair in acting.of_time() if pair[0] not in fixed_entries]
        forced = np.append(forced, [entry for entry, _ in more]).astype(int)
        pulls = (*pulls, *(signal for _, signal in more))
    check_signals((*motions, *pulls), t_end)
    bonds, mass = dyn.loop_bonds, per_coordinate(scene, dyn.diagonal_mass).flatten()
    ties = _ties(dyn, motions, moved, np.flatnonzero(held))
    driven_mass = mass[moved]
    mass[moved] = 0.0
    if timed is not None:
        bonds = replace(
            bonds, laws=timed.laws, law=timed.law, parameters=timed.columns.astype(float),
            group=timed.group, kinks=None,
        )  # fmt: skip
    return Forcing(
        bonds,
        moved,
        forced,
        in_columns(motions),
        in_columns(pulls),
        mass,
        driven_mass,
        ground,
        bond,
        timed,
        applied,
        ties,
    )


def _ties(dyn: Any, motions: Any, moved: Any, held: Any) -> Ties | None:
    """Mass of bonds between driven sites and others; refuses motions whose velocity may jump."""
    if dyn.loop_bonds.coupling is None or not len(moved):
        return None
    ties = Ties.of(dyn.mass_matrix, moved, held, dyn.dim)
    for number in [*ties.free[:, 0].tolist(), *np.unique(ties.among.nonzero()[0]).tolist()]:
        if motions[number].order_limit <= KINK_ORDER:
            site = int(moved[number]) // dyn.dim
            raise TensegrityError(
                f"the velocity of site {site}, driven by {motions[number]}, may jump, and a bond "
                "with mass there would transmit an impulse: give a smooth expression, or samples"
            )
    return ties
