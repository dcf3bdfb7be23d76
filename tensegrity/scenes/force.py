"""Forces of one's own: SymPy expressions of time, displacement and velocity, on sites or in bonds.

A `Force` adds to the springs of a chain: drag, friction, gravity, dashpots, contacts that
dissipate.  It is compiled with the force laws, and its work is part of the energy budget.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from typing import TYPE_CHECKING, Any

import numpy as np

from tensegrity import check
from tensegrity.engine.forced import BOND, SITE, AppliedForce, ForceLaw
from tensegrity.errors import TensegrityError
from tensegrity.printing import concise
from tensegrity.readonly import FixedDict, fixed

if TYPE_CHECKING:
    import sympy as sp
    from numpy.typing import ArrayLike

    from tensegrity.typing import Array, Indices

STATE = {"sites": ("u", "v"), "bonds": ("r", "rate")}
KINDS = {"sites": SITE, "bonds": BOND}
PROBES = np.array([(t, x, v) for t in (0.0, 0.7) for x in (0.0, 1e-3) for v in (-0.1, 0.0, 0.1)])


@dataclass(frozen=True, eq=False)
class Force:
    """A force on sites or in bonds, given as an expression.

    Parameters
    ----------
    expression : sympy.Expr
        [N].  On sites it may contain `t` [s], the displacement `u` [m] and the velocity `v` [m/s],
        and is > 0 towards higher sites.  In bonds it may contain `t`, the elongation `r` [m] and
        its `rate` [m/s], and is a tension.  All other symbols are parameters.
    on : {"sites", "bonds"}, optional
    at : sequence of int, optional
        The sites or bonds; by default all.
    parameters : dict of str to float or array_like (places,), optional
        Values of the parameters, in common or of each place.

    Raises
    ------
    TensegrityError
        A symbol that is neither listed above nor a parameter, a parameter that does not occur or
        is not finite, or an expression that cannot be translated.

    Notes
    -----
    The work of a force that contains `v` or `rate` counts as a loss of energy (`Run.loss`), that of
    other forces as work done on the scene.

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
            expression: sp.Expr,
            on: str = "sites",
            at: Sequence[int] | None = None,
            parameters: Mapping[str, ArrayLike] = ...,
        ) -> None: ...

    def __post_init__(self) -> None:
        object.__setattr__(self, "law", self._checked_law())
        if self.at is not None:
            given = check.sequence("places of a force", self.at, "numbers")
            at = [check.whole(f"place of a force on {self.on}", x, least=0) for x in given]
            if not at or len(set(at)) < len(at):
                raise TensegrityError(f"places {check.shown(at)} of a force must differ, and exist")
            object.__setattr__(self, "at", tuple(at))
        self._probe()

    def _checked_law(self) -> ForceLaw:
        """The law, after the parameters are converted."""
        import sympy as sp

        if not isinstance(self.on, str) or self.on not in STATE:
            raise TensegrityError(f"a force acts on {check.shown(self.on)}, must be {list(STATE)}")
        if not isinstance(self.expression, sp.Expr):
            raise TensegrityError(f"force {check.shown(self.expression)} is no SymPy expression")
        if not isinstance(self.parameters, Mapping):
            raise TensegrityError(f"parameters {check.shown(self.parameters)} must be a dict")
        known = ("t", *STATE[self.on])
        values = {str(name): _values(str(name), x) for name, x in self.parameters.items()}
        clash = sorted(values.keys() & {*known})
        if clash:
            raise TensegrityError(f"parameter {clash[0]} of a force is one of {', '.join(known)}")
        of = {str(symbol): symbol for symbol in self.expression.free_symbols}
        other = sorted(of.keys() - {*known} - values.keys())
        if other:
            raise TensegrityError(
                f"force {self.expression} contains {', '.join(other)}: on {self.on} it may contain "
                f"{', '.join(known)} and parameters"
            )
        idle = sorted(values.keys() - of.keys())
        if idle:
            raise TensegrityError(f"force {self.expression} does not contain {', '.join(idle)}")
        symbols = [sp.Symbol(name, real=True) for name in (*known, *values)]
        same = dict.fromkeys(of.values()) and {of[s.name]: s for s in symbols if s.name in of}
        law = ForceLaw(
            self.expression.xreplace(same),
            symbols[0],
            (symbols[1], symbols[2]),
            tuple(symbols[3:]),
            KINDS[self.on],
        )
        object.__setattr__(self, "parameters", FixedDict(values))
        return law

    def _probe(self) -> None:
        """Refuse an expression that cannot be translated, or is complex or infinite at rest."""
        try:
            function = self.law.function()
            p = [float(np.ravel(x)[0]) for x in self.parameters.values()]
            found = [float(function(t, [x, v], p)) for t, x, v in PROBES]
        except Exception as error:  # SymPy's printer and CasADi raise many kinds of errors
            raise TensegrityError(
                f"force {self.expression} cannot be translated: {error}"
            ) from error
        for (t, x, v), value in zip(PROBES, found, strict=True):
            if not np.isfinite(value):
                first, second = STATE[self.on]
                raise TensegrityError(
                    f"force {self.expression} is {value} at t = {t:g} s, {first} = {x:g} m, "
                    f"{second} = {v:g} m/s"
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
            On sites > 0 towards higher sites; in bonds a tension.

        Raises
        ------
        TensegrityError
            Numbers that are not finite, of shapes that do not fit together, or too large.
        """
        t = check.number("t", t, unit="s")
        given = [
            check.finite(name, check.floats(name, y)) for name, y in (("x", x), ("rate", rate))
        ]
        try:
            x, rate, *values = np.broadcast_arrays(*given, *self.parameters.values())
        except ValueError as error:
            raise TensegrityError(f"x, rate and parameters of a force: {error}") from error
        if not x.size:
            raise TensegrityError("x and rate of a force must not be empty")
        columns = [one.ravel() for one in values]
        p = np.reshape(columns, (len(columns), x.size))
        found = self.law.function()(t, np.stack([x.ravel(), rate.ravel()]), p)
        return check.finite("force", np.array(found).reshape(x.shape))

    def _applied(self, count: int) -> AppliedForce:
        """The force on all places of a scene.

        Parameters
        ----------
        count : int
            Number of sites or bonds of the scene.

        Returns
        -------
        AppliedForce

        Raises
        ------
        TensegrityError
            A place that does not exist, or a number of values other than that of places.
        """
        places: Indices = np.arange(count) if self.at is None else np.array(self.at)
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
        rows = [np.broadcast_to(x, places.shape) for x in self.parameters.values()]
        return AppliedForce(self.law, places, np.reshape(rows, (len(rows), len(places))))


def _values(name: str, given: Any) -> Array:
    values = check.floats(f"parameter {name} of a force", given)
    if values.ndim > 1 or not np.isfinite(values).all():
        raise TensegrityError(f"parameter {name} {check.shown(given)} must be finite, (places,)")
    return fixed(values)


def checked_forces(scene: Any, forces: Any, bonds: int) -> tuple[Force, ...]:
    """Validate the forces of a scene.

    Parameters
    ----------
    scene : Scene
    forces : sequence of Force
    bonds : int
        Number of its bonds.

    Returns
    -------
    tuple of Force

    Raises
    ------
    TensegrityError
        Not a sequence of forces, or a force on a place that does not exist.
    """
    given = check.sequence("forces", forces, "forces")
    for one in given:
        check.kind("a force", one, Force)
        one._applied(scene.sites if one.on == "sites" else bonds)
    return given


def dashpots(damping: Any, sites: int, bonds: int) -> list[Force]:
    """The dashpots of `Damping` as forces.

    Parameters
    ----------
    damping : Damping
    sites, bonds : int
        Numbers of sites and bonds of the scene.

    Returns
    -------
    list of Force
    """
    import sympy as sp

    c, v, rate = sp.symbols("c v rate")
    found = []
    if damping.ground.any():
        found.append(Force(-c * v, parameters={"c": damping.each("ground", sites)}))
    if damping.bond.any():
        found.append(Force(c * rate, "bonds", parameters={"c": damping.each("bond", bonds)}))
    return found
