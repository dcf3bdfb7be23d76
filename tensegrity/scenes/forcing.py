"""What time does to a scene: prescribed motions and forces of sites, and dashpots.

A `Drive` is a function of time for one site; it moves the site exactly, or pulls at it.  A
dashpot resists the rate of elongation of its bond, or the velocity of its site, in proportion.
Scenes take them as `drive={site: Drive}` and `damping=Damping(...)`; `forcing_of` is what the
loop makes of them.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field, replace
from typing import TYPE_CHECKING

import numpy as np

from tensegrity import check
from tensegrity.engine.driven import Forcing
from tensegrity.errors import TensegrityError
from tensegrity.readonly import FixedDict, fixed
from tensegrity.scenes.dynamics import dynamics
from tensegrity.scenes.signals import RTOL, check_signals, expression_of, signals_of
from tensegrity.springs.tuned import spring_at

if TYPE_CHECKING:
    from typing import Any, TypeAlias

    import sympy as sp
    from numpy.typing import ArrayLike

    from tensegrity.springs.potential import Potential
    from tensegrity.typing import Array

    Signal: TypeAlias = sp.Expr | float | tuple[ArrayLike, ArrayLike]
    Tune: TypeAlias = Mapping[str, sp.Expr | float] | Callable[[float], Potential]

ATOL = 1e-12  # m: a site that is where its drive begins


@dataclass(frozen=True, eq=False)
class Drive:
    """A prescribed motion of a site, or a force on it, as a function of time.

    Exactly one of the two is given: as a SymPy expression of `t` [s], or as samples
    (t, values), joined by a cubic spline.  In the plane and in space it has a component for each
    coordinate: a sequence of expressions, None where the site is left free, or values of
    shape (samples, dim).

    Parameters
    ----------
    displacement : sympy.Expr, float, (t, values), or sequence of expressions, optional
        u(t) [m] from the reference place.  The site moves so exactly, whatever pulls at it.
    force : the same, optional
        [N], > 0 along the axis; besides the forces of bonds and loads.

    Raises
    ------
    TensegrityError
        None or both given; an expression of other symbols; samples that are not finite, or whose
        times do not increase.  A value that is not finite, and a jump, is refused by the run.

    Examples
    --------
    >>> import sympy as sp
    >>> t = sp.Symbol("t")
    >>> shaker = Drive(displacement=0.01 * sp.sin(2 * t))
    >>> float(shaker.at(0.0, order=1)[0])
    0.02
    """

    displacement: Any = None
    force: Any = None
    signals: tuple[Any, ...] = field(init=False, repr=False)  # of each coordinate, or None
    prescribes: bool = field(init=False, repr=False)

    if TYPE_CHECKING:  # what converts is taken

        def __init__(
            self,
            displacement: Signal | Sequence[sp.Expr | float | None] | None = None,
            force: Signal | Sequence[sp.Expr | float | None] | None = None,
        ) -> None: ...

    def __post_init__(self) -> None:
        given = [name for name in ("displacement", "force") if getattr(self, name) is not None]
        if len(given) != 1:
            raise TensegrityError(f"a drive has {len(given)} of displacement and force, must be 1")
        signals = signals_of(given[0], getattr(self, given[0]))
        object.__setattr__(self, "signals", signals)
        object.__setattr__(self, "prescribes", given[0] == "displacement")

    def at(self, t: ArrayLike, order: int = 0) -> Array:
        """Values at instants t [s], or their rates for order 1; (coordinates, *shape of t)."""
        t = check.floats("t", t)
        if check.whole("order", order, least=0) > 1:
            raise TensegrityError(f"order {order} must be 0 or 1")
        return np.array([np.zeros(t.shape) if s is None else s(t, order) for s in self.signals])


@dataclass(frozen=True, eq=False)
class Damping:
    """Dashpots: forces in proportion to velocities.

    Parameters
    ----------
    bond : float or array_like, (bonds,), optional
        Of the rate of elongation of each bond [N s/m], >= 0, also where a contact is open; contacts
        with walls of a network have none, those with the ends of a chain of beads are bonds.
    ground : float or array_like, (sites,), optional
        Of the velocity of each site [N s/m], >= 0.
    """

    bond: Array = 0.0  # type: ignore[assignment]
    ground: Array = 0.0  # type: ignore[assignment]

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
        """Those of all bonds or sites; (count,)."""
        values = getattr(self, name)
        if values.ndim and values.shape != (count,):
            raise TensegrityError(f"{name} damping has shape {values.shape}, must be ({count},)")
        return np.broadcast_to(values, (count,)).copy()


def checked_forcing(scene: Any, drive: Any, damping: Any, tune: Any = None) -> dict[str, Any]:
    """What a scene is driven and damped by, if it fits: attributes of it."""
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
            raise TensegrityError(f"site {number} is held: nothing drives it")
    if damping is not None:
        check.kind("damping", damping, Damping)
        damping.each("bond", _bonds(scene))
        damping.each("ground", scene.sites)
        if not (damping.bond.any() or damping.ground.any()):
            damping = None
    found = {"drive": FixedDict(drive), "damping": damping}
    return found | {"tune": _checked_tune(scene, {} if tune is None else tune)}


def _checked_tune(scene: Any, tune: Any) -> Any:
    """What changes the springs of a scene in time, if it fits."""
    if not callable(tune) and not isinstance(tune, Mapping):
        raise TensegrityError(
            f"tune {check.shown(tune)} must be a dict {{name: expression of t}}, or a function of t"
        )
    # the same spring of other lengths is another there
    different = dynamics(scene).springs.different
    if tune and (len(scene.springs) > _bonds(scene) or any(x != different[0] for x in different)):
        raise TensegrityError(
            f"tune needs one spring for all bonds, there are {len(set(different))}, and no "
            f"contacts with walls, there are {len(scene.springs) - _bonds(scene)}"
        )
    if callable(tune):
        if (first := spring_at(tune, 0.0)) != different[0]:
            raise TensegrityError(f"tune begins with {first!r}, the spring is {different[0]!r}")
        return tune
    names = [name for name in tune if not isinstance(name, str)]
    if names:
        raise TensegrityError(f"tune {check.shown(names[0])} is not the name of an argument")
    signals = {name: expression_of(name, one) for name, one in tune.items()}
    for name, signal in signals.items():
        spring, begin = different[0], float(signal(np.array(0.0)))
        spring.varied({name: begin})  # refuses what it has not
        if abs(spring.argument(name) - begin) > RTOL * abs(begin):
            raise TensegrityError(
                f"tune begins at {name} {begin:.9g}, the spring has {spring.argument(name):.9g}"
            )
    return FixedDict(signals)


def _bonds(scene: Any) -> int:
    """Number of bonds, without contacts with walls."""
    return len(getattr(scene, "bonds", scene.springs))


def refuse_driven(scene: Any, what: str) -> None:
    """Refuse a driven or damped scene, for what knows conservative ones only."""
    if dynamics(scene).is_driven:
        raise TensegrityError(f"{what}: not for scenes that are driven, damped or tuned")


def start_driven_sites(scene: Any, u: Array, v: Array) -> None:
    """Put driven sites where they begin, with the velocity that they have there; in place."""
    for site, drive in scene.drive.items():
        if drive.prescribes:
            _, prescribed, here = driven_components(scene, site, drive)
            u.reshape(-1)[here] = drive.at(0.0)[prescribed]
            v.reshape(-1)[here] = drive.at(0.0, 1)[prescribed]


def driven_components(
    scene: Any, site: int, drive: Drive
) -> tuple[list[Any], list[int], list[int]]:
    """Functions of a drive, the coordinates that they are for, and the entries of u."""
    axes = [k for k, signal in enumerate(drive.signals) if signal is not None]
    return [drive.signals[k] for k in axes], axes, [site * scene.dim + k for k in axes]


def driven_entries(scene: Any, prescribed: bool) -> tuple[Any, Any]:
    """Entries of u that are moved, or that get a force, and the functions of t for them."""
    numbers: list[int] = []
    signals: list[Any] = []
    for site, drive in scene.drive.items():
        if drive.prescribes == prescribed:
            found, _, here = driven_components(scene, site, drive)
            numbers += here
            signals += found
    return np.array(numbers, dtype=int), tuple(signals)


def time_signals(scene: Any) -> list[Any]:
    """All that drives or tunes a scene, or the lanes of an ensemble."""
    found: list[Any] = []
    for lane in getattr(scene, "scenes", (scene,)):
        found += () if callable(lane.tune) else lane.tune.values()
        for drive in lane.drive.values():
            found += [signal for signal in drive.signals if signal is not None]
    return found


def check_start(scene: Any, u: Array) -> None:
    """Refuse displacements from which driven sites would have to jump."""
    for site, drive in scene.drive.items():
        if not drive.prescribes:
            continue
        signals, axes, here = driven_components(scene, site, drive)
        for signal, axis, entry in zip(signals, axes, here, strict=True):
            wanted, found = float(signal(np.array(0.0))), float(u.reshape(-1)[entry])
            if abs(found - wanted) > ATOL + RTOL * abs(wanted):
                raise TensegrityError(
                    f"site {site} is at {found:.9g} m, its drive {signal} begins at {wanted:.9g} m "
                    f"(axis {axis}): start from `at_rest`, or have it begin there"
                )


def forcing_of(scene: Any, t_end: float, tuning: Any = None) -> Forcing:
    """What time does to a scene, for the loop; see `tensegrity.engine.driven`.

    Raises
    ------
    TensegrityError
        A drive that is not finite, jumps, or does not reach to `t_end`.
    """
    (moved, motions), (forced, scattered_forces) = (
        driven_entries(scene, True),
        driven_entries(scene, False),
    )
    check_signals((*motions, *scattered_forces), t_end)

    def together(signals: tuple[Any, ...]) -> Any:
        def values(t: Array, order: int) -> Array:
            return np.stack([signal(t, order) for signal in signals], axis=-1)

        return values

    bonds, mass = dynamics(scene).loop_bonds, np.repeat(scene.mass, scene.dim)
    driven_mass = mass[moved]
    mass[moved] = 0.0
    damping = scene.damping or Damping()
    ground = np.repeat(damping.each("ground", scene.sites), scene.dim)
    bond = np.zeros(len(scene.springs))
    bond[: _bonds(scene)] = damping.each("bond", _bonds(scene))
    held = np.repeat(dynamics(scene).inverse_mass == 0, scene.dim)
    ground[held] = 0.0
    if tuning is not None:
        bonds = replace(
            bonds, laws=(tuning.law,), law=np.zeros(1, int), parameters=tuning.at(np.zeros(1)),
            group=np.zeros(len(bonds.group), int), openings=None,
        )  # fmt: skip
    return Forcing(
        bonds,
        moved,
        forced,
        together(motions),
        together(scattered_forces),
        mass,
        driven_mass,
        ground,
        bond,
        tuning,
    )
