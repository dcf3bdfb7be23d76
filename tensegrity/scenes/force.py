"""User-defined forces: SymPy expressions of time, displacement and velocity, on sites, in bonds, or
at walls.

A `Force` adds to the springs of a scene: drag, friction, gravity, dashpots, contacts that
dissipate.  It is compiled with the force laws, and its work is part of the energy budget.
"""

from __future__ import annotations

import itertools
from collections.abc import Mapping, Sequence
from copy import copy
from dataclasses import dataclass, field
from typing import TYPE_CHECKING, Any

import numpy as np

from tensegrity import check
from tensegrity.engine.force_law import BOND, SITE, AppliedForce, ForceLaw
from tensegrity.errors import TensegrityError
from tensegrity.printing import concise
from tensegrity.readonly import FixedDict, fixed
from tensegrity.springs.potential import Potential

if TYPE_CHECKING:
    import sympy as sp
    from numpy.typing import ArrayLike

    from tensegrity.typing import Array, Indices

KINDS = {"sites": SITE, "bonds": BOND, "walls": BOND}
AXES = "xyz"
PROBES = [(t, x, v) for t in (0.0, 0.7) for x in (0.0, 1e-3) for v in (-0.1, 0.0, 0.1)]


@dataclass(frozen=True, eq=False)
class Force:
    """A force on sites, in bonds or at walls, given as an expression.

    Parameters
    ----------
    expression : sympy.Expr, float, or sequence of these
        [N].  On sites it may contain `t` [s], the displacement `u` [m], the velocity `v` [m/s] and
        the `speed` |v|, and is > 0 towards higher sites.  In a plane or in space it is a sequence
        with one expression for each axis, of `t`, `u_x`, `u_y`, .., `v_x`, `v_y`, .. and `speed`.
        In bonds it may contain `t`, the elongation `r` [m] and its `rate` [m/s], and is a tension.
        At walls it is a compressive force, `r` being the gap.  In bonds and at walls of a plane or
        of space a second expression may follow, for the force along the slip, against which
        friction is < 0; both may then contain `slip`, the relative speed along the surface [m/s].
        All other symbols are parameters.  A `Potential` of u is a spring between a site of a chain
        and the ground: its energy counts as energy of the scene.
    on : {"sites", "bonds", "walls"}, optional
    at : sequence of int, optional
        The sites, bonds or contacts with walls; by default all.
    parameters : dict of str to float or array_like (places,), optional
        Values of the parameters, in common or of each place; by default those of a potential.

    Raises
    ------
    TensegrityError
        A symbol that is neither listed above nor a parameter, a parameter that does not occur or
        is not finite, or an expression that cannot be translated.

    Notes
    -----
    The work of a force that contains a velocity counts as a loss of energy (`Run.loss`), that of
    other forces, without a potential, as work done on the scene.

    Examples
    --------
    Quadratic drag on a chain of two masses that move together: 1/v grows by c t/m.

    >>> import sympy as sp
    >>> from tensegrity import Chain, Force, PowerLaw, simulate
    >>> v, c = sp.symbols("v c")
    >>> drag = Force(-c * abs(v) * v, parameters={"c": 0.5})
    >>> pair = Chain(PowerLaw(1.0, 1.5), sites=2, forces=(drag,))
    >>> run = simulate(pair, pair.at_rest({0: 1.0, 1: 1.0}), t_end=2.0, tol=1e-9)
    >>> run.final.v.round(6)  # 1/(1 + 0.5 2)
    array([0.5, 0.5])
    """

    expression: Any
    on: str = "sites"
    at: Any = None
    parameters: Mapping[str, Any] = field(default_factory=dict)
    law: ForceLaw = field(init=False, repr=False)

    __str__ = concise

    if TYPE_CHECKING:  # what converts is taken

        def __init__(
            self,
            expression: sp.Expr | float | Sequence[sp.Expr | float] | Potential,
            on: str = "sites",
            at: Sequence[int] | None = None,
            parameters: Mapping[str, ArrayLike] = ...,
        ) -> None: ...

    def __post_init__(self) -> None:
        if not isinstance(self.on, str) or self.on not in KINDS:
            raise TensegrityError(f"a force acts on {check.shown(self.on)}, must be {list(KINDS)}")
        object.__setattr__(self, "law", self._checked_law())
        if self.at is not None:
            given = check.sequence("places of a force", self.at, "numbers")
            at = [check.whole(f"place of a force on {self.on}", x, least=0) for x in given]
            if not at or len(set(at)) < len(at):
                raise TensegrityError(f"places {check.shown(at)} of a force must differ, and exist")
            object.__setattr__(self, "at", tuple(at))
        self._probe()

    def placed(self, at: Sequence[int], parameters: Mapping[str, ArrayLike]) -> Force:
        """The same force on other places, with values of each; unchecked."""
        placed = copy(self)
        values = {name: fixed(np.asarray(x, dtype=float)) for name, x in parameters.items()}
        for name, value in (("at", tuple(at)), ("parameters", FixedDict(values))):
            object.__setattr__(placed, name, value)
        return placed

    def refuse_open(self, skin: float) -> None:
        """Refuse what cannot act in all contacts of a list that changes: values of each contact,
        and a force in contacts that are open, by up to a skin [m]."""
        if self.on == "sites" or self.at is not None:
            return
        for name, values in self.parameters.items():
            if values.ndim:
                raise TensegrityError(
                    f"parameter {name} of a force on {self.on} has a value for each, but contacts "
                    "come and go: give `at`, or one value"
                )
        p = [float(x) for x in self._values]
        for t, fraction, rate in itertools.product((0.0, 0.7), (1e-6, 0.1, 1.0), (-0.1, 0.1)):
            force = np.array(self.law.function()(t, [fraction * skin, rate, abs(rate)], p))
            if force.any():
                raise TensegrityError(
                    f"force {self.expression} on all {self.on} of a scene whose contacts come and "
                    f"go must be 0 where they are open: it is {np.abs(force).max():.3g} N at a gap "
                    f"of {fraction * skin:.3g} m"
                )

    @property
    def stores(self) -> bool:
        """Whether it is the force of a potential."""
        return isinstance(self.expression, Potential)

    @property
    def _state(self) -> tuple[str, ...]:
        """Names of the displacements and velocities that the expressions may contain."""
        if self.on != "sites":
            return ("r", "rate", "slip")
        if not self._along_axes:
            return ("u", "v", "speed")
        axes = AXES[: len(self._expressions)]
        return (*(f"u_{k}" for k in axes), *(f"v_{k}" for k in axes), "speed")

    @property
    def _values(self) -> tuple[Any, ...]:
        """Values of all parameters of the law."""
        return (*self.parameters.values(), *self.law.numbers)

    @property
    def _along_axes(self) -> bool:
        """Whether there is one expression for each axis, or for each direction of a contact."""
        return isinstance(self.expression, (tuple, list))

    @property
    def _expressions(self) -> tuple[Any, ...]:
        return tuple(self.expression) if self._along_axes else (self.expression,)

    def _checked_expressions(self) -> tuple[Any, ...]:
        import sympy as sp

        given, most = self._expressions, 3 if self.on == "sites" else 2
        if not 1 <= len(given) <= most:
            raise TensegrityError(f"{len(given)} expressions of a force on {self.on}: 1 to {most}")
        try:
            return tuple(
                one if isinstance(one, sp.Expr) else sp.Float(check.number("force", one, unit="N"))
                for one in given
            )
        except TensegrityError as error:
            raise TensegrityError(f"{error}, and no SymPy expression") from error

    def _checked_law(self) -> ForceLaw:
        """The law, after the parameters are converted."""
        import sympy as sp

        if not isinstance(self.parameters, Mapping):
            raise TensegrityError(f"parameters {check.shown(self.parameters)} must be a dict")
        values = {str(name): _values(str(name), x) for name, x in self.parameters.items()}
        if isinstance(self.expression, Potential):
            return self._on_site_law(self.expression, values)
        given = self._checked_expressions()
        known = ("t", *self._state)
        clash = sorted(values.keys() & {*known})
        if clash:
            raise TensegrityError(f"parameter {clash[0]} of a force is one of {', '.join(known)}")
        of = {str(symbol): symbol for one in given for symbol in one.free_symbols}
        allowed = {*known} - ({"slip"} if len(given) == 1 else set())
        other = sorted(of.keys() - allowed - values.keys())
        if other:
            raise TensegrityError(
                f"force {self.expression} contains {', '.join(other)}: on {self.on} it may contain "
                f"{', '.join(x for x in known if x in allowed)} and parameters"
            )
        idle = sorted(values.keys() - of.keys())
        if idle:
            raise TensegrityError(f"force {self.expression} does not contain {', '.join(idle)}")
        symbols = [sp.Symbol(name, real=True) for name in (*known, *values)]
        same = {old: new for one in given for old in one.free_symbols for new in symbols
                if old.name == new.name}  # fmt: skip
        first = -1 if self.on == "walls" else 1  # a compressive force is a negative tension
        named = [one.xreplace(same) for one in given]
        law = ForceLaw(
            (first * named[0], *named[1:]),
            symbols[0],
            tuple(symbols[1 : len(known)]),
            tuple(symbols[len(known) :]),
            KINDS[self.on],
        ).lifted()
        object.__setattr__(self, "parameters", FixedDict(values))
        return law

    def _on_site_law(self, spring: Potential, values: dict[str, Array]) -> ForceLaw:
        """The law of an on-site spring, whose parameters are then complete."""
        import sympy as sp

        known = spring.parameters
        unknown = sorted(values.keys() - known.keys())
        if unknown or self.on != "sites":
            words = f"parameter {unknown[0]} of it does not exist" if unknown else "on other places"
            raise TensegrityError(f"a force of {spring!r} acts on sites: {words}")
        if not getattr(spring.law, "is_expression", False):
            raise TensegrityError(f"{spring!r} is no expression and holds no site to the ground")
        every = {name: _values(name, x) for name, x in known.items()} | values
        object.__setattr__(self, "parameters", FixedDict(every))
        law, more = spring.law, sp.symbols("t v speed")
        return ForceLaw(
            (law.energy,), more[0], (law.elongation, *more[1:]), law.parameters, SITE, law,
            tuple(spring.numbers.tolist()),
        )  # fmt: skip

    def _probe(self) -> None:
        """Refuse an expression that cannot be translated, or is complex or infinite at rest."""
        if self.stores:
            return
        names, samples = self._state, []
        count = len(names) // 2
        try:
            function = self.law.function()
            p = [float(np.ravel(x)[0]) for x in self._values]
            for t, x, v in PROBES:
                state = [x] * count + [v] * (len(names) - count - 1) + [abs(v)]
                samples.append((t, state, np.array(function(t, state, p)).ravel()))
        except Exception as error:  # SymPy's printer and CasADi raise many kinds of errors
            raise TensegrityError(
                f"force {self.expression} cannot be translated: {error}"
            ) from error
        for t, state, value in samples:
            if not np.isfinite(value).all():
                where = ", ".join(
                    f"{name} = {x:g} {'m' if k < count else 'm/s'}"
                    for k, (name, x) in enumerate(zip(names, state, strict=True))
                )
                raise TensegrityError(
                    f"force {self.expression} is {value[~np.isfinite(value)][0]} at t = {t:g} s, "
                    f"{where}"
                )

    def values(self, x: ArrayLike, rate: ArrayLike, t: float = 0.0) -> Array:
        """The force [N] at displacements or elongations x [m] and their rates [m/s] at time t [s].

        Parameters
        ----------
        x, rate : array_like, (..., places)
        t : float, optional

        Returns
        -------
        ndarray, (..., places)
            On sites > 0 towards higher sites; in bonds a tension; at walls compressive.

        Raises
        ------
        TensegrityError
            A force with a sequence of expressions; numbers that are not finite, of shapes that do
            not fit together, or too large.
        """
        if self._along_axes:
            raise TensegrityError(f"values of {len(self._expressions)} expressions: give one")
        t = check.number("t", t, unit="s")
        given = [
            check.finite(name, check.floats(name, y)) for name, y in (("x", x), ("rate", rate))
        ]
        try:
            x, rate, *values = np.broadcast_arrays(*given, *self._values)
        except ValueError as error:
            raise TensegrityError(f"x, rate and parameters of a force: {error}") from error
        if not x.size:
            raise TensegrityError("x and rate of a force must not be empty")
        columns = [one.ravel() for one in values]
        p = np.reshape(columns, (len(columns), x.size))
        last = np.abs(rate) if self.on == "sites" else np.zeros(x.shape)
        force = self.law.function()(t, np.stack([y.ravel() for y in (x, rate, last)]), p)
        sign = -1 if self.on == "walls" else 1
        return check.finite("force", sign * np.array(force).reshape(x.shape))

    def _applied(self, scene: Any) -> AppliedForce:
        """The force on all places of a scene.

        Parameters
        ----------
        scene : Scene

        Returns
        -------
        AppliedForce

        Raises
        ------
        TensegrityError
            A place that does not exist, a number of values other than that of places, or of
            expressions other than that of axes.
        """
        counts, given = place_counts(scene), len(self._expressions)
        needed = scene.dim if self.on == "sites" else min(scene.dim, given)
        if given != needed or (scene.dim > 1 and self.on == "sites") > self._along_axes:
            raise TensegrityError(
                f"{given} expressions of a force on {self.on} of a scene with {scene.dim} "
                f"coordinates per site: give {needed}"
            )
        count = counts[self.on]
        places: Indices = np.arange(count) if self.at is None else np.array(self.at, dtype=int)
        if places.max(initial=-1) >= count:
            raise TensegrityError(
                f"a force acts on number {places.max()} of the {self.on}, there are {count}"
            )
        for name, values in self.parameters.items():
            if values.ndim and values.shape != places.shape:
                raise TensegrityError(
                    f"parameter {name} of a force has {len(values)} values for {len(places)} "
                    f"{self.on}"
                )
        rows = [np.broadcast_to(x, places.shape) for x in self._values]
        first = counts["bonds"] if self.on == "walls" else 0
        return AppliedForce(self.law, first + places, np.reshape(rows, (len(rows), len(places))))


def place_counts(scene: Any) -> dict[str, int]:
    """Numbers of sites, bonds and contacts with walls of a scene."""
    bonds = len(scene.springs) - len(getattr(scene, "wall_contacts", ()))
    return {"sites": scene.sites, "bonds": bonds, "walls": len(scene.springs) - bonds}


def _values(name: str, given: Any) -> Array:
    values = check.floats(f"parameter {name} of a force", given)
    if values.ndim > 1 or not np.isfinite(values).all():
        raise TensegrityError(f"parameter {name} {check.shown(given)} must be finite, (places,)")
    return fixed(values)
