"""From derivatives by the parameters of a law to those by what a user built a spring from.

The parameters of a law follow from the arguments of a prism or a power law by formulas, which SymPy
differentiates.
"""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from tensegrity.engine.law import Law
from tensegrity.errors import TensegrityError
from tensegrity.once import once
from tensegrity.prisms.closed import polygon, rigid_law
from tensegrity.prisms.condensed import ElasticPotential
from tensegrity.springs.polynomial import Polynomial
from tensegrity.springs.potential import PowerLaw

if TYPE_CHECKING:
    from collections.abc import Sequence
    from typing import Any

    from tensegrity.springs.potential import Potential
    from tensegrity.typing import Array

PRISM = ("prestrain", "height", "k_cross")
POWER = ("stiffness", "preload")


def refuse(spring: Potential) -> None:
    """Refuse a spring through which there is no derivative, saying why."""
    if isinstance(spring, Polynomial):
        raise TensegrityError(
            f"{spring!r} stands for another spring: a gradient would be that of the fit, give the "
            "spring itself"
        )
    if isinstance(spring, ElasticPotential):
        raise TensegrityError(
            f"{spring!r} has elastic members: the inner equilibrium that its tension solves for is "
            "not differentiated by its parameters; take k_base = k_bar = inf"
        )
    if isinstance(spring, PowerLaw) and spring.exponent < 1:
        raise TensegrityError(
            f"exponent {spring.exponent:g} of {spring!r} is below 1: its stiffness has no bound "
            "where the contact opens, and no derivative passes there"
        )
    if not isinstance(spring.law, Law):
        raise TensegrityError(f"{spring!r} is no law whose parameters have a meaning")


def names(spring: Potential) -> tuple[str, ...]:
    """What a gradient can be asked for, by the arguments of this spring."""
    if spring.law in _rigid():
        return PRISM
    if isinstance(spring, PowerLaw):
        preload = spring.values[1]
        return POWER if preload > 0 or spring.exponent == 1 else POWER[:1]
    return tuple(spring.parameters)


@once
def _rigid() -> tuple[Law, Law]:
    """Of triangular prisms, and of those with any number of sides."""
    return rigid_law(), rigid_law(any_sides=True)


def slopes(springs: Sequence[Potential], name: str, most: int) -> Array:
    """Derivatives of the parameters of springs by one of their `names`.

    Returns
    -------
    ndarray, (springs, most)
        0 for springs that have no such argument.
    """
    found = np.zeros((len(springs), most))
    mine = [k for k, spring in enumerate(springs) if name in names(spring)]
    prisms: list[int] = []
    for any_sides, law in enumerate(_rigid()):
        some = [k for k in mine if springs[k].law == law]
        if some:
            values = np.array([springs[k].values for k in some])
            found[some, : values.shape[1]] = _of_prisms(values, name, bool(any_sides))
            prisms += some
    powers = [k for k in mine if isinstance(springs[k], PowerLaw)]
    if powers:
        found[powers, :3] = _of_power_laws([springs[k] for k in powers], name)
    for k in set(mine) - {*prisms, *powers}:
        found[k, list(springs[k].parameters).index(name)] = 1
    return found


def _of_power_laws(springs: Sequence[Any], name: str) -> Array:
    """At a fixed preload the overlap at rest depends on the stiffness, and on the preload."""
    found = np.zeros((len(springs), 3))
    found[:, POWER.index(name)] = 1
    stiffness, preload, _ = np.array([spring.values for spring in springs]).T
    exponent = np.array([spring.exponent for spring in springs])
    loaded = (preload > 0) | (name == "preload")
    given = (x[loaded] for x in (stiffness, preload, exponent))
    found[loaded, 2] = _overlap_slopes()[name](*given)
    return found


@once
def _overlap_slopes() -> dict[str, Any]:
    import sympy as sp

    stiffness, preload, n = sp.symbols("stiffness preload n", positive=True)
    overlap = (preload / stiffness) ** (1 / n)
    by = {"stiffness": stiffness, "preload": preload}
    symbols = (stiffness, preload, n)
    return {k: sp.lambdify(symbols, sp.simplify(overlap.diff(x)), "numpy") for k, x in by.items()}


def _of_prisms(values: Array, name: str, any_sides: bool) -> Array:
    """The loaded height moves with the others, so that the preload stays.

    The numbers of a prism are read from those of its law: no more is kept of it.
    """
    from derivations import rigid_elastic as derived

    of = polygon(any_sides)
    known = dict(zip(derived.parameters_of(of), values.T, strict=True))
    loaded, preload = known[derived.length_at_rest], known[derived.preload]
    prestrain = np.sqrt(known[derived.squared_0]) / known[derived.natural] - 1
    shape = (of.sides, of.sine, of.cosine)  # of a triangle numbers
    sides = [known[x] if any_sides else np.full(loaded.shape, float(x)) for x in shape]
    given = (2 * sides[1] * np.sqrt(known[derived.area]), loaded - known[derived.shift],
             np.maximum(prestrain, 0), known[derived.stiffness], loaded, preload,
             *sides)  # fmt: skip
    found = np.empty(values.shape)
    collapsed, carrying = known[derived.no_lock] != 0, preload > 0
    for kind in (False, True):
        mine = collapsed == kind
        if mine.any():
            own = [x[mine] for x in given]
            direct, by_loaded = (_prism_slopes(kind, x, any_sides) for x in (name, "loaded"))
            moved = np.full(int(mine.sum()), float(name == "height"))
            load = [function(*own) for function in _load_slopes(name, any_sides)]
            moved = np.where(carrying[mine], -load[0] / load[1], moved)
            found[mine] = _columns(direct, own) + moved[:, None] * _columns(by_loaded, own)
    return found


def _columns(function: Any, given: Sequence[Array]) -> Array:
    return np.stack([np.broadcast_to(x, given[0].shape) for x in function(*given)], axis=1)


def _prism_symbols() -> tuple[Any, dict[str, Any]]:
    from derivations import prism, regular
    from derivations import rigid_elastic as derived

    by = {"prestrain": prism.prestrain, "height": prism.reference_height, "k_cross": prism.k_cross}
    by["loaded"] = derived.loaded_height
    symbols = (prism.base, prism.reference_height, prism.prestrain, prism.k_cross,
               derived.loaded_height, derived.preload, *regular.SIDES)  # fmt: skip
    return symbols, by


@once
def _prism_slopes(collapses: bool, name: str, any_sides: bool) -> Any:
    """Derivatives of the parameters by one argument, the others fixed."""
    import sympy as sp

    from derivations import rigid_elastic as derived
    from derivations.rigid_parameters import parameter_expressions

    symbols, by = _prism_symbols()
    of = polygon(any_sides)
    forms = dict(parameter_expressions(of))
    if collapses:  # as `Prism.potential` has it
        forms |= {derived.lock: derived.loaded_height, derived.far_lock: derived.loaded_height}
        forms |= {derived.no_lock: -derived.locking_height_squared(of)}
    return sp.lambdify(symbols, [sp.diff(x, by[name]) for x in forms.values()], "numpy", cse=True)


@once
def _load_slopes(name: str, any_sides: bool) -> tuple[Any, Any]:
    """Derivatives of dU/dh at the loaded height, by one argument and by that height."""
    import sympy as sp

    from derivations import rigid_elastic as derived
    from derivations.rigid_parameters import parameter_expressions

    symbols, by = _prism_symbols()
    of = polygon(any_sides)
    forms = parameter_expressions(of)
    load = derived.force(of=of).subs({
        derived.height: derived.loaded_height,
        derived.circumradius: sp.sqrt(forms[derived.area]),
        derived.bar: (forms[derived.far_stroke] + forms[derived.stroke]) / 2,
        derived.natural_cross: forms[derived.natural],
    })  # fmt: skip
    return tuple(sp.lambdify(symbols, sp.diff(load, by[x]), "numpy", cse=True)
                 for x in (name, "loaded"))  # fmt: skip
