"""The result of `gradient`, and the chain rule from parameters of laws to the arguments of springs.

The parameters of a law follow from the arguments of a prism by derived formulas, which are
differentiated by the complex-step method, and from those of a power law by its overlap at rest.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from math import isfinite
from typing import TYPE_CHECKING, Any

import numpy as np

from tensegrity import check, plotting
from tensegrity.engine.programs import derived as program_of
from tensegrity.engine.programs import run
from tensegrity.errors import TensegrityError
from tensegrity.printing import Lines, Printed, span
from tensegrity.prisms.closed import polygon, rigid_law
from tensegrity.scenes.dynamics import dynamics
from tensegrity.scenes.picture import Picture
from tensegrity.springs.polynomial import Polynomial
from tensegrity.springs.power_law import PowerLaw
from tensegrity.springs.pressed import Pressed
from tensegrity.structures.member_springs import MemberSpring
from tensegrity.typing import Array
from tensegrity.unit.condensed import CondensedPotential
from tensegrity.unit_names import unit_text

if TYPE_CHECKING:
    from matplotlib.axes import Axes

    from tensegrity.runs.run import Run
    from tensegrity.springs.collection import Springs
    from tensegrity.springs.potential import Potential

TINY = 1e-30  # step of a derivative through the complex plane
DIGITS = -np.log10(np.finfo(float).eps)
PRISM = ("prestrain", "height", "k_cross")
POWER = ("stiffness", "preload", "exponent")
UNITS = {"mass": "kg", "base": "m", "height": "m", "preload": "N", "diameter": "m", "modulus": "Pa"}
UNITS |= dict.fromkeys(("k_cross", "k_base", "k_bar"), "N/m") | {"bond_mass": "kg"}
OWN = Pressed, CondensedPotential, MemberSpring  # they give derivatives of the law's parameters
RIGID = rigid_law(), rigid_law(any_sides=True)  # of triangular prisms, and of any number of sides


@dataclass(frozen=True, eq=False, repr=False)
class Gradient(Printed):
    """The value of an objective and its derivatives.

    They are exact derivatives of the numerical scheme with its step, not of the equation of motion.

    Attributes
    ----------
    value : float
    run : Run
    u, v : ndarray, (sites[, dim])
        Derivatives with respect to the initial displacements and velocities; 0 at held sites.
    mass : ndarray, (sites,)
        Derivatives with respect to the masses; 0 at held sites.
    parameters : dict of str to ndarray, (bonds,)
        Derivatives with respect to the requested parameters of the springs' laws; of a network
        (springs,), the wall contacts after the bonds.
    shift : ndarray, (bonds,)
        Derivatives with respect to a constant added to each elongation; in a network only, where
        they are those with respect to the gaps of contacts.
    reversal : float
        Largest difference between a state recomputed by the reverse pass and that of the run
        [m, m/s].
    digits : float
        Decimal digits of the value that are not lost to round-off in the state.  In chaotic motion
        few are left, and the derivatives are of no use for design.
    """

    value: float
    run: Run = field(repr=False)
    u: Array = field(repr=False)
    v: Array = field(repr=False)
    mass: Array = field(repr=False)
    parameters: Mapping[str, Array] = field(repr=False)
    shift: Array = field(repr=False)
    reversal: float
    digits: float
    _scene: Any = field(repr=False)
    _names: tuple[str, ...] = field(repr=False)

    def by(self, name: str) -> Array:
        """Derivatives with respect to an argument of the springs or beads of the scene.

        Parameters
        ----------
        name : str
            "prestrain", "height", "k_cross" of prisms; "stiffness" and "exponent" (at fixed
            preload), "preload" of power laws; a symbol of a user's own `Potential`; a parameter of
            a `Force`, which in bonds may be that of the spring, or of a `Drive`, for each site that
            it drives; "bond", "ground" of a `Damping`; "bond_mass" of a network whose bonds have
            mass; "diameter", "modulus" of beads, at the same constants of dissipation.

        Returns
        -------
        ndarray, (bonds,), of beads, drives and forces on sites (sites,)
            0 where a bond has no such argument; (springs,) in a network.

        Raises
        ------
        TensegrityError
            A name that nothing in the scene has, or that was not requested.

        Examples
        --------
        The peak load of the last contact of five beads, and its change with each stiffness.

        >>> from tensegrity import Chain, PowerLaw, gradient, objective
        >>> chain = Chain(PowerLaw(1.0, 1.5), sites=5)
        >>> peak = objective.peak(objective.load(bond=3))
        >>> found = gradient(peak, chain, chain.at_rest({0: 1.0}), 6.0, dt=0.01)
        >>> print(found.by("stiffness").round(3))
        [0.02  0.034 0.069 0.133]
        """
        check.kind("name", name, str)
        if name in ("u", "v", "mass", "shift"):
            raise TensegrityError(f"by {name!r}: these derivatives are the attribute .{name}")
        if name not in self._names:
            known = ", ".join(self._names) or "nothing"
            raise TensegrityError(f"by {check.shown(name)}: this gradient has {known}")
        of = dynamics(self._scene)
        if name in of.arguments:
            return of.by_argument(name, self.mass, self._along, self.shift)
        if any(name in names(spring) for spring in of.springs.different):
            return self._along(name)
        return self.parameters[name]

    def plot(self, ax: Axes | None = None, by: str | None = None) -> Axes:
        """Draw derivatives by an argument, or by the masses.

        Parameters
        ----------
        ax : matplotlib.axes.Axes, optional
            By default of a new figure.
        by : str, optional
            A name that `by` accepts, or "mass"; by default the first that this gradient has.

        Returns
        -------
        matplotlib.axes.Axes
            For a chain the derivatives against sites or bonds, for a network a map.

        Raises
        ------
        TensegrityError
            `ax` is not a Matplotlib axes, or this gradient has no such derivatives.
        """
        name = by if by is not None else (*self._names, "mass")[0]
        values = self.mass if name == "mass" else self.by(name)
        one = self._scene[0] if isinstance(self._scene, tuple) else self  # of an ensemble
        scene, unit = one._scene, UNITS.get(name, "")
        label = f"derivative by {name}" + (f" [value per {unit_text(unit)}]" if unit else "")
        of_sites = name == "mass" or name in dynamics(scene).arguments
        if len(scene.shape) > 1:
            if values.ndim == 2:
                raise TensegrityError(f"a map shows one gradient, not {values.shape[1]}")
            picture = Picture(scene, ax, facecolors=None if of_sites else "0.95")
            image = picture.paint(values, of_sites)
            picture.scale(image, label)
            return picture.ax
        drawn: Axes = plotting.axes(ax)
        drawn.axhline(0.0, color="0.7", lw=0.8)
        drawn.plot(values, "o-", ms=3)
        drawn.set(xlabel="site" if of_sites else "bond", ylabel=label)
        return drawn

    def _along(self, name: str) -> Array:
        """Derivatives with respect to an argument of the springs."""
        table = dynamics(self._scene).springs
        laws, law, _ = table.table
        total, each = np.zeros(len(table.group)), slopes(table, name)[table.group]
        for number, one in enumerate(laws):
            mine = law[table.group] == number
            for k, symbol in enumerate(one.parameters):
                if each[mine, k].any() and str(symbol) in self.parameters:
                    total[mine] += self.parameters[str(symbol)][mine] * each[mine, k]
        return total

    def _lines(self) -> Lines:
        yield f"value {span(self.value)}, {self.digits:.3g} digits not lost to round-off"
        yield f"derivatives by u, v, mass, and by {', '.join(self._names) or 'nothing'}"
        yield f"the reverse pass returned to the initial state within {self.reversal:.1e} m, m/s"


def digits(value: float, by_u: Array, by_v: Array, largest: tuple[float, float]) -> float:
    """Decimal digits of a value that are left by one rounding error of the largest |u| and |v|.

    Parameters
    ----------
    value : float
    by_u, by_v : ndarray
        Derivatives of the value with respect to the initial state.
    largest : (float, float)
        Largest |u| [m] and |v| [m/s].

    Returns
    -------
    float
        From 0 to 15.7.
    """
    moved = zip((by_u, by_v), largest, strict=True)
    noise = np.finfo(float).eps * max(np.abs(x).max(initial=0) * scale for x, scale in moved)
    if noise == 0 or value == 0:
        return 0.0 if noise else float(DIGITS)
    return float(np.clip(np.log10(abs(value) / noise), 0, DIGITS))


def _given(spring: Potential) -> Potential:
    """The law that a member of a structure was given, whose parameters are its first; or itself."""
    return (spring.of if isinstance(spring, MemberSpring) else None) or spring


def refuse(spring: Potential) -> None:
    """Refuse a spring without derivatives, saying why."""
    spring = _given(spring)
    if isinstance(spring, Polynomial):
        raise TensegrityError(
            f"{spring!r} is a fit of another spring, of which it has no derivatives: give that "
            "spring itself"
        )
    if isinstance(spring, PowerLaw) and spring.exponent < 1:
        raise TensegrityError(
            f"exponent {spring.exponent:g} of {spring!r} is below 1: its stiffness has no bound "
            "where the contact opens, and no derivative exists there"
        )


def names(spring: Potential) -> tuple[str, ...]:
    """Names of the arguments of this spring for which `Gradient.by` has derivatives."""
    spring = _given(spring)
    if spring.law in RIGID:
        return PRISM
    if isinstance(spring, PowerLaw):
        loaded = spring.values[1] > 0 or spring.exponent == 1
        return POWER if loaded else (POWER[0], POWER[2])
    if isinstance(spring, CondensedPotential):
        known = spring.parameters.items()
        return tuple(x for x, value in known if isfinite(value) and (value or x != "preload"))
    if isinstance(spring, Pressed):
        return tuple(spring.parameters)[:-1]
    if isinstance(spring, MemberSpring):
        return spring.arguments
    return tuple(spring.parameters)


def usual(known: Mapping[str, Any], laws: Sequence[Any]) -> tuple[str, ...]:
    """Names by which springs are differentiated if none are given: not by exponents where the roots
    of a law would become powers."""
    dear = "exponent" if any(getattr(one, "general", None) for one in laws) else None
    return tuple(name for name in known if name != dear)


def slopes(table: Springs, name: str) -> Array:
    """Derivatives of the parameters of different springs with respect to one of their `names`.

    Returns
    -------
    ndarray, (springs, parameters)
        0 for springs without this argument.
    """
    springs: list[Any] = [*map(_given, table.different)]
    by_value = np.zeros(table.table[2].shape)
    alike: dict[Any, list[int]] = {}
    for k, spring in enumerate(springs):
        if name in names(spring):
            alike.setdefault((spring.law, isinstance(spring, (PowerLaw, *OWN))), []).append(k)
    for (law, _), mine in alike.items():
        one: Any = springs[mine[0]]
        values = np.array([springs[k].values for k in mine])
        if law in RIGID:
            rows = _of_prisms(values, name, law == RIGID[1])
        elif isinstance(one, PowerLaw):
            rows = _of_power_laws(values, name)
        elif isinstance(one, OWN):
            rows = np.array([springs[k].slopes(name) for k in mine])
        else:
            rows = np.eye(values.shape[1])[list(one.parameters).index(name)]
        by_value[mine, : values.shape[1]] = rows
    return by_value


def _of_power_laws(values: Array, name: str) -> Array:
    """Derivatives of the parameters of power laws, of which the overlap at rest,
    (preload/stiffness)^(1/exponent), depends on the others."""
    place = {"stiffness": 0, "preload": 1, "exponent": 3}[name]
    by_value = np.tile(np.eye(4)[place], (len(values), 1))
    loaded = (values[:, 1] > 0) | (name == "preload")
    stiffness, preload, overlap, exponent = values[loaded].T
    ratio = preload / stiffness
    if name == "exponent":
        by_value[loaded, 2] = -overlap * np.log(ratio) / exponent**2
        return by_value
    by_ratio = ratio ** (1 / exponent - 1) / exponent
    by_value[loaded, 2] = by_ratio * (1 if name == "preload" else -ratio) / stiffness
    return by_value


def _of_prisms(values: Array, name: str, any_sides: bool) -> Array:
    """Derivatives of the parameters of prisms, in which the loaded height changes such that the
    preload stays constant.

    The numbers of a prism are recovered from the parameters of its law.
    """
    from derivations import rigid_elastic as derived

    of = polygon(any_sides)
    known = dict(zip(derived.parameters_of(of), values.T, strict=True))
    loaded, preload = known[derived.length_at_rest], known[derived.preload]
    prestrain = np.sqrt(known[derived.squared_0]) / known[derived.natural] - 1
    shape = (of.sides, of.sine, of.cosine)  # of a triangle numbers
    sides = [known[x] if any_sides else np.full(loaded.shape, float(x)) for x in shape]
    arguments = np.maximum(prestrain, 0), loaded - known[derived.shift], known[derived.stiffness]
    base = 2 * sides[1] * np.sqrt(known[derived.area])
    given = np.array([*arguments, loaded, base, preload, *sides], dtype=complex)
    by_value, steps = np.empty(values.shape), np.eye(len(given))[:, [PRISM.index(name), len(PRISM)]]
    collapsed = known[derived.no_lock] != 0
    for kind in np.unique(collapsed).tolist():
        mine = collapsed == kind
        numbers = given[:, None, mine] + 1j * TINY * steps[..., None]
        forms = run(program_of(_prism_forms, kind, any_sides), np, numbers)
        slopes = [np.broadcast_to(x, numbers[0].shape).imag / TINY for x in forms]
        direct, by_loaded = np.array(slopes).swapaxes(0, 1)
        moved = np.where(preload[mine] > 0, -direct[-1] / by_loaded[-1], float(name == "height"))
        by_value[mine] = (direct[:-1] + moved * by_loaded[:-1]).T
    return by_value


def _prism_forms(collapses: bool, any_sides: bool) -> tuple[list[Any], tuple[Any, ...]]:
    """Expressions of all parameters of a rigid prism's law and of its load at the loaded height,
    dU/dh; and the symbols of the arguments `PRISM`, the loaded height and all others."""
    import sympy as sp

    from derivations import prism, regular
    from derivations import rigid_elastic as derived
    from derivations.rigid_elastic import parameter_expressions

    of = polygon(any_sides)
    forms = dict(parameter_expressions(of))
    load = derived.force(of=of).subs({
        derived.height: derived.loaded_height,
        derived.circumradius: sp.sqrt(forms[derived.area]),
        derived.bar: (forms[derived.far_stroke] + forms[derived.stroke]) / 2,
        derived.natural_cross: forms[derived.natural],
    })  # fmt: skip
    if collapses:  # the prism flattens before its bars meet; see `Prism.potential`
        forms |= {derived.lock: derived.loaded_height, derived.far_lock: derived.loaded_height}
        forms |= {derived.no_lock: -derived.locking_height_squared(of)}
    symbols = (prism.prestrain, prism.reference_height, prism.k_cross, derived.loaded_height,
               prism.base, derived.preload, *regular.SIDES)  # fmt: skip
    return [*forms.values(), load], symbols
