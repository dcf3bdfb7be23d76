"""Prisms in closed form: numbers to many decimals, and the potential of those with rigid members.

The forms are those of `derivations`, at a prism's fields taken as exact.  Source: seeds/000, part
III.
"""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import replace
from typing import TYPE_CHECKING

import numpy as np

from tensegrity.engine.kept import kept
from tensegrity.engine.law import DerivedLaw, Law
from tensegrity.engine.programs import derived as program_of
from tensegrity.engine.programs import run
from tensegrity.errors import EquilibriumError
from tensegrity.once import once
from tensegrity.root import root
from tensegrity.springs.potential import Potential, call

if TYPE_CHECKING:
    from collections.abc import Callable
    from typing import Any

DIGITS = 40  # decimals in which numbers are computed before they are rounded
NOTHING = 1e-30  # of a number with some prestrain: none without
SAMPLES = 4000  # elongations among which a limit point is looked for


@once
def _decimals() -> Any:
    """Arithmetic with `DIGITS` decimals, apart from mpmath's own, which all threads share."""
    import mpmath

    context = mpmath.MPContext()
    context.dps = DIGITS
    return context


def exact(name: str, prism: Any, height: float = 1.0, preload: float = 0.0) -> list[Any]:
    """Values of a quantity of `_of_fields` to `DIGITS` decimals, the prism's fields taken as
    exact."""
    fields = (prism.base, prism.height, prism.prestrain, prism.k_cross, prism.k_base, prism.k_bar)
    own = _decimals()
    angle = own.pi / prism.sides
    sides = (own.mpf(prism.sides), own.sin(angle), own.cos(angle))
    values = [own.mpf(x) for x in (*fields, height, preload)]
    return run(program_of(_of_fields, name, prism.sides != 3), own, (*values, *sides))


def _of_fields(name: str, any_sides: bool) -> tuple[list[Any], tuple[Any, ...]]:
    """Expressions and the symbols of the fields, loaded height, preload and sides."""
    from derivations import elastic, rigid_parameters
    from derivations import prism as p
    from derivations import rigid_elastic as r

    forms: dict[str, Callable[[Any], Any]] = {
        "natural lengths": p.natural_lengths,  # of cross strings, base strings and bars [m]
        "least k_base": p.least_k_base,  # at which the natural length of the bases is 0 [N/m]
        "locking height squared": r.locking_height_squared,  # [m^2]; below 0 if flat before that
        "axial stiffness": elastic.axial_stiffness_of_prism,  # at the reference state [N/m]
        "parameters": rigid_parameters.parameter_expressions,  # of `rigid_law`
    }
    found = forms[name](polygon(any_sides))
    found = found.values() if isinstance(found, dict) else found
    fields = (p.base, p.reference_height, p.prestrain, p.k_cross, p.k_base, p.k_bar)
    symbols = (*fields, r.loaded_height, r.preload, *r.SIDES)
    return list(found) if isinstance(found, Iterable) else [found], symbols


def polygon(any_sides: bool) -> Any:
    """What `derivations` takes for triangles, or for any number of sides."""
    from derivations import regular

    return regular.ANY if any_sides else regular.TRIANGLE


def rigid_potential(prism: Any, preload: float) -> Potential:
    """See `Prism.potential`."""
    unloaded = _about(prism, prism.height, 0.0)
    if preload == 0:
        return unloaded
    return _about(prism, prism.height + _loaded_shift(unloaded, preload), preload)


def _about(prism: Any, height: float, preload: float) -> Potential:
    law, role = rigid_law(prism.sides != 3), _roles()
    numbers = exact("parameters", prism, height, preload)
    if prism.prestrain == 0:  # what is proportional to it is round-off of many decimals
        sizes = exact("parameters", replace(prism, prestrain=0.1), height, preload)
        pairs = zip(numbers, sizes, strict=True)
        numbers = [x if abs(x) > NOTHING * abs(y) else x * 0 for x, y in pairs]
    values = dict(zip(law.parameters, numbers, strict=True))
    (locking_squared,) = exact("locking height squared", prism)
    if locking_squared <= 0:
        values |= {role["lock"]: height, role["far_lock"]: height}
        values |= {role["no_lock"]: -locking_squared}
    ends = (
        "the bars meet (twist pi)" if locking_squared > 0 else "the prism is flat (height 0)",
        "the bars stand upright (twist 0)",
    )
    numbers = [float(value) for value in values.values()]
    domain = -float(values[role["lock"]]), float(values[role["stroke"]])
    origin = call(f"{prism}.potential", preload=preload)
    return Potential.from_law(law, numbers, height, domain, ends, origin, (prism, preload))


def _loaded_shift(unloaded: Potential, preload: float) -> float:
    """Elongation of the unloaded potential at which it carries the preload, on its first branch."""
    lowest = _first_limit(unloaded)
    largest = -float(unloaded.tension(lowest))
    if preload >= largest:
        raise EquilibriumError(
            f"preload {preload:g} N is beyond {largest:g} N, the largest axial load of this prism "
            f"(at height {unloaded.length + lowest:g} m)"  # type: ignore[operator]
        )
    return root(lambda r: float(unloaded.tension(r)) + preload, lowest, 0.0)


def _first_limit(potential: Potential) -> float:
    """Elongation of the first limit point in compression, or next to the end of the domain."""
    low = potential.domain[0]
    r = low * np.sin(np.linspace(0, np.pi / 2, SAMPLES + 1)[1:-1])  # closer towards the end
    falling = np.flatnonzero(potential.stiffness(r) < 0)
    if falling.size == 0:
        return np.nextafter(low, 0) * (1 - 1e-15)
    first = falling[0]
    before = r[first - 1] if first else 0.0
    return root(lambda x: float(potential.stiffness(x)), r[first], before)


def rigid_law(any_sides: bool = False) -> Law:
    """Of triangular prisms, or of those with any number of sides, which is a parameter then."""
    return DerivedLaw(_rigid_law, bool(any_sides))


def _rigid_law(any_sides: bool) -> Law:
    from derivations import rigid_elastic as derived

    of = polygon(any_sides)
    symbols, tension = derived.parameters_of(of), derived.tension(of)
    return Law(derived.energy(of), derived.elongation, symbols, tension, derived.THROUGH)


def rigid_programs() -> dict[str, Any]:
    """What `Prism.potential` computes for a rigid triangular prism, for other arithmetics.

    Returns
    -------
    dict
        "parameters" of `rigid_law` and "locking", the square of the locking height, as programs
        (`tensegrity.engine.programs`) of base, height, prestrain, k_cross, k_base, k_bar, loaded
        height and preload; "places" of the parameters {role: place} that it tells apart.
    """
    names = [str(name) for name in rigid_law().parameters]
    return {
        "parameters": program_of(_of_fields, "parameters", False),
        "locking": program_of(_of_fields, "locking height squared", False),
        "places": {role: names.index(name) for role, name in _roles().items()},
    }


@once
def _roles() -> dict[str, str]:
    """Names of parameters of the rigid law that `Prism.potential` needs to tell apart."""

    def make() -> dict[str, str]:
        from derivations import rigid_elastic as derived

        return {x: str(getattr(derived, x)) for x in ("lock", "far_lock", "no_lock", "stroke")}

    return kept(("roles of the rigid law",), make)
