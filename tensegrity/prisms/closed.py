"""Closed forms of prisms: exact quantities, potential of rigid ones, assembly of members.

The forms of `derivations` are evaluated in multiple precision, at the values of a prism taken as
exact.  With rigid bases and bars the potential is a closed form as well.  Source:
the talk, part III; for the assembly from natural lengths `derivations.polygon`, "From cut
lengths".
"""

from __future__ import annotations

import math
from collections.abc import Iterable
from functools import partial
from types import SimpleNamespace
from typing import TYPE_CHECKING, Annotated

import numpy as np

from tensegrity import check
from tensegrity.checked import checked
from tensegrity.engine.disk_cache import cached
from tensegrity.engine.law import DerivedLaw, Law
from tensegrity.engine.programs import derived as program_of
from tensegrity.engine.programs import run
from tensegrity.errors import EquilibriumError
from tensegrity.once import once
from tensegrity.printing import call
from tensegrity.root import root
from tensegrity.springs.potential import Potential
from tensegrity.springs.provenance import potential_of_law
from tensegrity.typing import Length

if TYPE_CHECKING:
    from collections.abc import Callable, Sequence
    from typing import Any


DIGITS = 40  # decimal digits of the computation before rounding
NEGLIGIBLE = 1e-30  # parameter over its value with prestrain, below which it is zero
SAMPLES = 4000  # elongations at which a limit point is searched for


@once
def _decimals() -> Any:
    """A context of `DIGITS` decimal digits, separate from mpmath's global one."""
    import mpmath

    context = mpmath.MPContext()
    context.dps = DIGITS
    return context


def exact(
    name: str, prism: Any, height: float = 1.0, preload: float = 0.0, own: Any = None
) -> list[Any]:
    """Values of a quantity of `_of_fields` to `DIGITS` decimal digits, or in another context.

    Parameters
    ----------
    name : str
        One of the quantities of `_of_fields`.
    prism : Prism
        Its values are taken as exact.
    height : float, optional
        Loaded height [m], for "parameters".
    preload : float, optional
        Axial load at rest [N], compression > 0, for "parameters".
    own : mpmath.MPContext or proofs.balls.Balls, optional
        What numbers are computed in.

    Returns
    -------
    list of mpmath.mpf, or of numbers of the context
        In SI units.
    """
    fields = (prism.base, prism.height, prism.prestrain, prism.k_cross, prism.k_base, prism.k_bar)
    own = own or _decimals()
    angle = own.pi / prism.sides
    sides = (own.mpf(prism.sides), own.sin(angle), own.cos(angle))
    values = [own.mpf(x) for x in (*fields, height, preload)]
    return run(program_of(_of_fields, name, prism.sides != 3), own, (*values, *sides))


def _of_fields(name: str, any_sides: bool) -> tuple[list[Any], tuple[Any, ...]]:
    """Expressions of a quantity, and the symbols of fields, loaded height, preload and sides."""
    from derivations import elastic, regular, rigid_response
    from derivations import prism as p
    from derivations import rigid_elastic as r

    forms: dict[str, Callable[[Any], Any]] = {
        "natural lengths": p.natural_lengths,  # of cross strings, base strings and bars [m]
        "least k_base": p.least_k_base,  # at which the natural length of the bases is 0 [N/m]
        "locking height squared": r.locking_height_squared,  # [m^2]; below 0 if flat before that
        "axial stiffness": elastic.axial_stiffness_of_prism,  # at the reference state [N/m]
        "parameters": r.parameter_expressions,  # of `rigid_law`
        "twist": rigid_response.loaded_twist,  # at the loaded height [rad]
    }
    form = forms[name](polygon(any_sides))
    form = form.values() if isinstance(form, dict) else form
    fields = (p.base, p.reference_height, p.prestrain, p.k_cross, p.k_base, p.k_bar)
    symbols = (*fields, r.loaded_height, r.preload, *regular.SIDES)
    return list(form) if isinstance(form, Iterable) else [form], symbols


def polygon(any_sides: bool) -> Any:
    """The polygon of `derivations` for triangles, or for any number of sides."""
    from derivations import regular

    return regular.ANY if any_sides else regular.TRIANGLE


def rigid_potential(prism: Any, preload: float) -> Potential:
    """Potential of a prism with rigid bases and bars at a preload [N]; see `Prism.potential`."""
    unloaded = _about(prism, prism.height, 0.0)
    if preload == 0:
        return unloaded
    return _about(prism, prism.height + _loaded_shift(unloaded, preload), preload)


def _about(prism: Any, height: float, preload: float) -> Potential:
    law, role = rigid_law(prism.sides != 3), _roles()
    values, locks = rigid_parameters(prism, height, preload)
    ends = (
        "the bars meet (twist pi)" if locks else "the prism is flat (height 0)",
        "the bars stand upright (twist 0)",
    )
    numbers = [float(value) for value in values.values()]
    domain = -float(values[role["lock"]]), float(values[role["stroke"]])
    origin = call(f"{prism!r}.potential", preload=preload)
    return potential_of_law(law, numbers, height, domain, ends, origin, (prism, preload))


def rigid_parameters(
    prism: Any, height: float, preload: float, own: Any = None
) -> tuple[dict[str, Any], bool]:
    """Values of the parameters of `rigid_law`, and whether the bars can meet.

    Parameters
    ----------
    prism, height, preload, own
        As of `exact`.

    Returns
    -------
    dict of str to number
    bool
    """
    role, numbers = _roles(), exact("parameters", prism, height, preload, own)
    if prism.prestrain == 0:  # terms proportional to it are round-off
        other = SimpleNamespace(**{**vars(prism), "prestrain": 0.1})
        sizes = exact("parameters", other, height, preload, own)
        pairs = zip(numbers, sizes, strict=True)
        numbers = [x if abs(x) > NEGLIGIBLE * abs(y) else x * 0 for x, y in pairs]
    names = map(str, rigid_law(prism.sides != 3).parameters)
    values = dict(zip(names, numbers, strict=True))
    (locking_squared,) = exact("locking height squared", prism, own=own)
    locks = bool(locking_squared > 0)
    if not locks:
        values |= {role["lock"]: height, role["far_lock"]: height}
        values |= {role["no_lock"]: -locking_squared}
    return values, locks


def _loaded_shift(unloaded: Potential, preload: float) -> float:
    """Elongation at which the unloaded potential carries the preload, before its limit point."""
    lowest = _first_limit(unloaded)
    largest = -float(unloaded.tension(lowest))
    if preload >= largest:
        raise EquilibriumError(
            f"preload {preload:g} N is beyond {largest:g} N, the largest axial load of this prism "
            f"(at height {unloaded.length + lowest:g} m)"  # type: ignore[operator]
        )
    return root(lambda r: float(unloaded.tension(r)) + preload, lowest, 0.0)


def _first_limit(potential: Potential) -> float:
    """Elongation of the first limit point in compression; the end of the domain if none."""
    low = potential.domain[0]
    r = low * np.sin(np.linspace(0, np.pi / 2, SAMPLES + 1)[1:-1])  # closer towards the end
    falling = np.flatnonzero(potential.stiffness(r) < 0)
    if falling.size == 0:
        return np.nextafter(low, 0) * (1 - 1e-15)
    first = falling[0]
    before = r[first - 1] if first else 0.0
    return root(lambda x: float(potential.stiffness(x)), r[first], before)


def rigid_law(any_sides: bool = False) -> Law:
    """The law of triangular prisms, or of any prisms, with the number of sides a parameter."""
    return DerivedLaw(_rigid_law, bool(any_sides))


def _rigid_law(any_sides: bool) -> Law:
    from derivations import rigid_elastic as derived

    of = polygon(any_sides)
    symbols, tension = derived.parameters_of(of), derived.tension(of)
    return Law(derived.energy(of), derived.elongation, symbols, tension, derived.THROUGH)


def rigid_programs() -> dict[str, Any]:
    """The computations of `Prism.potential` for a rigid triangular prism, as programs.

    Returns
    -------
    dict
        "parameters" of `rigid_law` and "locking", the square of the locking height, as programs
        (`tensegrity.engine.programs`) of base, height, prestrain, k_cross, k_base, k_bar, loaded
        height and preload; "places", {role: place} of the parameters with a role of their own.
    """
    names = [str(name) for name in rigid_law().parameters]
    return {
        "parameters": program_of(_of_fields, "parameters", False),
        "locking": program_of(_of_fields, "locking height squared", False),
        "places": {role: names.index(name) for role, name in _roles().items()},
    }


@once
def _roles() -> dict[str, str]:
    """Names of the parameters of the rigid law to which `Prism.potential` gives a role."""

    def make() -> dict[str, str]:
        from derivations import rigid_elastic as derived

        return {x: str(getattr(derived, x)) for x in ("lock", "far_lock", "no_lock", "stroke")}

    return cached(("roles of the rigid law",), make)


@checked
def member_stiffness(
    modulus: Annotated[float, "> 0", "Pa"], area: Annotated[float, "> 0", "m^2"], length: Length
) -> float:
    """Spring constant of a member, EA over its natural length.

    Parameters
    ----------
    modulus : float
        Young's modulus [Pa], > 0.
    area : float
        Area of the cross section [m^2], > 0.
    length : float
        Natural (unstressed) length [m], > 0.

    Returns
    -------
    float
        Spring constant [N/m].

    Raises
    ------
    TensegrityError
        If a value, or the result, is not finite and positive.

    Examples
    --------
    A steel bar of 0.1623 m:

    >>> from tensegrity import member_stiffness
    >>> f"{member_stiffness(modulus=210e9, area=36.6e-6, length=0.1623):.6g} N/m"
    '4.73567e+07 N/m'
    """
    return check.number("stiffness", modulus * area / length, above=0, unit="N/m")


def assembled(
    lengths: Sequence[float], stiffness: Sequence[float], sides: int
) -> tuple[float, float, float]:
    """Base, height and prestrain of the prism assembled from members.

    Parameters
    ----------
    lengths, stiffness : sequence of 3 floats
        Natural lengths [m] and spring constants [N/m] of cross strings, base strings and bars.
    sides : int
        Sides of the polygons.

    Returns
    -------
    tuple of 3 floats
        Base [m], height [m] and prestrain of the self-stressed state.

    Raises
    ------
    EquilibriumError
        If the members have no self-stressed state of positive height.
    """
    sine = math.sin(math.pi / sides)
    cross, base, bar = lengths
    if not 1e-100 < min(lengths) <= max(lengths) < 1e100:
        raise EquilibriumError(
            f"natural lengths {min(lengths):g} to {max(lengths):g} m must be within 1e-100 to 1e100"
        )
    needed = cross**2 + base**2 / sine
    if not bar**2 > needed:
        raise EquilibriumError(
            f"bars of natural length {bar:g} m leave all strings slack: bN^2 = {bar**2:.9g} m^2 "
            f"must be above sN^2 + lN^2/sin(pi/{sides}) = {needed:.9g} m^2"
        )
    if not 1e-100 < min(stiffness) <= stiffness[0] < 1e100:
        raise EquilibriumError(
            f"stiffness {min(stiffness):g} N/m must be above 1e-100 and k_cross {stiffness[0]:g} "
            "N/m below 1e100"
        )
    condition, stressed_lengths, squared_height = (
        partial(run, program_of(_of_members, name), math) for name in ("gap", "lengths", "height")
    )
    given = (*lengths, *(1 / k for k in stiffness), sine)
    most = min(stiffness[0], 2 * sine * stiffness[1])

    def gap(x: float) -> float:
        return float(condition((x, *given))[0])

    high = most * (1 - 1e-16)
    if not gap(0.0) * gap(high) < 0:
        raise EquilibriumError(
            f"bar {lengths[2]:g} m is too long for cross {lengths[0]:g} m and base "
            f"{lengths[1]:g} m: the stress of the strings is not resolved in floating point"
        )
    density = root(gap, 0.0, high)
    length, side = stressed_lengths((density, *given))
    (squared,) = squared_height((length, side, sine))
    if not squared > 0:
        raise EquilibriumError(
            f"these members form no prism: h^2 = {squared:.6g} m^2 must be above 0 (cross strings "
            f"of {length:g} m with a base of {side:g} m)"
        )
    return side, math.sqrt(squared), density / (stiffness[0] - density)


def _of_members(name: str) -> tuple[list[Any], tuple[Any, ...]]:
    """The assembly condition and the lengths at self-stress in natural lengths and compliances,
    or the squared height in the lengths."""
    import sympy as sp

    from derivations import polygon, prism, regular

    if name == "height":
        cross = sp.Symbol("s", positive=True)
        return [polygon.height_squared()], (cross, prism.base, regular.half_sine)
    softness = sp.symbols("c_1:4", nonnegative=True)
    constants = (prism.k_cross, prism.k_base, prism.k_bar)
    condition, lengths = polygon.members_condition()
    soft = dict(zip(constants, (1 / c for c in softness), strict=True))
    symbols = (polygon.cross_density, *polygon.natural_lengths, *softness, regular.half_sine)
    forms = [sp.cancel(length.subs(soft)) for length in lengths]
    squares = [form**2 for form in forms]
    gap = squares[2] - squares[0] - squares[1] / regular.half_sine
    if sp.simplify(gap - condition.subs(soft)) != 0:
        raise ArithmeticError("the condition on members is not that of their lengths")
    return {"gap": [gap], "lengths": forms[:2]}[name], symbols
