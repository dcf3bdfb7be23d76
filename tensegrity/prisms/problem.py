"""The problem that a prism under axial load poses, and its equilibrium path as a table.

One set of `equations` serves all prisms.  Rigid bases leave one unknown less; rigid bars have their
tension as the multiplier of a constant length.  Where all members are rigid the load grows without
bound towards contact, so that the path ends at a large load and the contact follows in closed form.
Beyond the twist at which base strings unload, the upright cross strings alone carry the load, in
closed form.  Source: the talk, part III, "Numerical approach".
"""

from __future__ import annotations

import math
from collections.abc import Mapping
from typing import TYPE_CHECKING, Any, ClassVar

import numpy as np

from tensegrity.branches.continuation import Located, Part, Settings
from tensegrity.branches.problem import DerivedProblem, Joined
from tensegrity.branches.table import Table
from tensegrity.engine.programs import derived, run
from tensegrity.printing import Lines
from tensegrity.prisms.condensed import stable
from tensegrity.prisms.equations import TENSIONS, kind_of, numbers, problem

if TYPE_CHECKING:
    from tensegrity.typing import Array, Flags

ROWS = 200  # number of rows where base strings are slack
SETTINGS = Settings(tolerance=1e-8, largest=0.05)
LARGEST = 1e6  # load over k_cross times base, at which rigid members are at contact or upright
STATE = ("height", "twist", "base", "load")
UNITS = {"height": "m", "twist": "rad", "base": "m", "load": "N", "shortening": "m"}
UNITS |= dict.fromkeys(TENSIONS, "N")
ENDS = {
    "contact": "the bars meet on the axis (twist pi)",
    "flat": "the prism is flat (height 0)",
}
UPRIGHT = "the bars stand upright: no equilibrium has a larger height"
CONTACT = "the bars meet; cross strings go slack"
PASSED = "the bars pass through each other; beyond, cross strings carry compression"
SLACK = "base strings and bars unload; beyond, upright cross strings alone carry the load"
UNLOADED = "base strings and bars unload; beyond, base strings carry compression"
UNSTRESSED = "without prestrain no member is stressed here"


class EquilibriumPath(Table):
    """Equilibria of a prism as a table, from the reference state into compression.

    If the tension side was requested, its states precede the reference, the largest height first.
    Columns are attributes; `path[3]` is a row as a dict, `path[:10]` a path of the first ten rows.

    Attributes
    ----------
    height, twist, base : ndarray, (rows,)
        [m], [rad], [m].
    load : ndarray, (rows,)
        Total axial load [N], compression > 0.
    shortening : ndarray, (rows,)
        Reference height less height [m].
    cross_tension, base_tension, bar_tension : ndarray, (rows,)
        Tension of a member of each kind [N]: positive in strings, negative in bars.
    stable_load, stable_height : ndarray of bool, (rows,)
        Whether the equilibrium is stable under given (dead) load, and under given height, between
        flat plates, against motions with the symmetry of the polygons only.
    events : tuple of Event
        Located points, each with `kind`, `row` and the columns as attributes.  The kinds are
        "fold" (limit point in load, dF = 0), "turn" (limit point in displacement, dh = 0),
        "slack", "contact", "flat", "bifurcation", and names of columns given in `at`.
    prism : Prism
    end, begin : str
        Why the path ends; why the tension side is shorter than requested, empty if it is not.

    Examples
    --------
    >>> from tensegrity import Prism, equilibrium_path
    >>> path = equilibrium_path(Prism(1.0, 0.7, 0.1, 1.0, k_base=20.0, k_bar=20.0))
    >>> fold, contact = path.events
    >>> fold.kind, round(fold.load, 5), round(fold.height, 5)
    ('fold', 1.23989, 0.35545)
    >>> bool(path[0]["stable_load"]), bool(path[-1]["stable_load"])
    (True, False)
    >>> len(path[: fold.row + 1].events)
    1
    """

    height: Array
    twist: Array
    base: Array
    load: Array
    shortening: Array
    cross_tension: Array
    base_tension: Array
    bar_tension: Array
    stable_load: Flags
    stable_height: Flags
    prism: Any  # a Prism, which imports this module
    begin: str
    _units: ClassVar = UNITS

    def _lines(self) -> Lines:
        first, last = self[0], self[-1]
        yield f"{self.prism}"
        yield (
            f"  {len(self)} equilibria from height {first['height']:.6g} m, "
            f"load {first['load']:.6g} N to height {last['height']:.6g} m, "
            f"load {last['load']:.6g} N"
        )
        if self.begin:
            yield f"  begins: {self.begin}"
        for event in self.events:
            yield f"  {event.kind} at {self._quantities(event.at, STATE)}"
            yield from [f"    {event.note}"] * bool(event.note)
        yield f"  ends: {self.end}"


class PrismProblem(DerivedProblem):
    """Equilibria of a prism from the self-stressed state into compression, or into tension.

    Parameters
    ----------
    prism : Prism
    direction : {-1, 1}
        Sense of the height.
    until : dict of str to float
        Values of columns at which the path ends.
    past_contact : bool
        Whether the smooth energy is followed beyond contact and unloading.
    before : PrismProblem, optional
        The tension side, whose rows precede those of compression.
    """

    prism: Any
    start: Array
    parameters: list[float]
    past_contact: bool
    locks: bool  # whether it ends at a load that stands for an unlimited one
    names = (*STATE, "shortening", *TENSIONS)

    def __init__(
        self,
        prism: Any,
        direction: int,
        until: Mapping[str, float],
        past_contact: bool,
        before: PrismProblem | None = None,
    ) -> None:
        rigid_base, _ = kind = kind_of(prism)
        until = {name: value for name, value in until.items() if math.isfinite(value)}
        locks = prism.is_rigid and "load" not in until
        if locks:
            until["load"] = -direction * LARGEST * prism.k_cross * prism.base
        slack = () if rigid_base else ("unloaded",)
        ends = () if past_contact else ("contact",) if direction < 0 else slack
        self.__dict__.update(problem(*kind).__dict__)
        self.__dict__.update(
            prism=prism, direction=direction, until=until, past_contact=past_contact,
            before=before, locks=locks, stop=("flat", *ends), start=np.zeros(4 - rigid_base),
            parameters=numbers(prism), settings=SETTINGS,
        )  # fmt: skip

    def followed(self, until: Mapping[str, Any], at: Mapping[str, Any]) -> Part:
        """See `Problem.followed`; events have their names in a path."""
        part = super().followed(until, at)
        height, load = (len(self.start) + STATE.index(name) for name in ("height", "load"))
        part.data[0, load] = 0.0  # the self-stressed state
        if part.end == "flat":
            for point in (part.data[-1], part.events[-1].point):
                point[[height, load]] = 0.0  # exact by symmetry
        if part.end == "load" and self.locks and "load" not in until:
            part.end = "contact" if self.direction < 0 else UPRIGHT
            if self.direction < 0:
                part.events.append(Located("contact", len(part.data) - 1, self._locked()))
        part.events = [named for event in part.events if (named := self._named(event))]
        if part.end == "unloaded":
            part.following = _Upright(self, float(part.data[-1, height]))
        return part

    def _locked(self) -> Array:
        """Unknowns and columns of rigid members in contact."""
        infinite = (math.inf, math.inf, math.inf, -math.inf)  # load and tensions
        state = (self.prism.locking_height(), math.pi, self.prism.base, *infinite)
        return np.array([*(0.0 for _ in self.start), *state])

    def _named(self, event: Located) -> Located | None:
        """An event by its name in a path, with its note; None if it is none there."""
        kind = event.kind
        if kind == "unloaded":
            rigid_base, at_start = math.isinf(self.prism.k_base), event.row == 0
            if rigid_base or at_start:
                return None
            return event._replace(kind="slack", note=UNLOADED if self.past_contact else SLACK)
        if kind == "contact" and event.row == 0:
            return event._replace(kind="slack", note=UNSTRESSED)
        if kind == "contact":
            return event._replace(note=PASSED if self.past_contact else CONTACT)
        return event

    def measure(self, data: Array) -> dict[str, Array]:
        """See `Problem.measure`."""
        values = zip((*STATE, *TENSIONS), data[:, len(self.start) :].T.copy(), strict=True)
        columns = dict(values)
        columns["shortening"] = self.prism.height - columns["height"]
        columns["load"] += 0.0  # no negative zero
        return {name: columns[name] for name in self.names}

    def rows(self, part: Part) -> dict[str, Any]:
        """See `Problem.rows`."""
        z, rigid_base = part.data[:, : len(self.start)], math.isinf(self.prism.k_base)
        by_load, by_height = stable(z, self.parameters, rigid_base)
        return {"stable_load": by_load, "stable_height": by_height}

    def table(self, path: Joined) -> EquilibriumPath:
        """See `Problem.table`."""
        tensions = {name: path.columns.pop(name) for name in TENSIONS}
        columns = path.columns | tensions  # these last
        about = {"prism": self.prism, "begin": path.begin if path.begin == UPRIGHT else ""}
        return EquilibriumPath(columns, path.events, ENDS.get(path.end, path.end), **about)


class _Upright(PrismProblem):
    """States above the point where base strings and bars unload, in closed form.

    These are the states of `derivations.equilibrium`, which are stable because their energy is a
    sum of squares with positive weights.
    """

    lowest: float

    def __init__(self, below: PrismProblem, height: float) -> None:
        self.__dict__.update(below.__dict__, start=np.zeros(0), lowest=height)

    def followed(self, until: Mapping[str, Any], at: Mapping[str, Any]) -> Part:
        """See `Problem.followed`; the unknown is the height."""
        most, bar = self.until["height"], self.prism.natural_lengths().bar
        height = np.linspace(self.lowest, min(most, bar), ROWS + 1)
        end = "height" if most <= bar else UPRIGHT
        return Part(height[:, None], height, height, height, [], end)

    def measure(self, data: Array) -> dict[str, Array]:
        """See `Problem.measure`."""
        prism, height = self.prism, data[:, 0]
        cross, _, bar = prism.natural_lengths()
        symbols = height, prism.k_cross, cross, bar
        twist, base_squared, load = run(derived(_upright_forms, prism.sides), np, symbols)
        none = np.zeros(len(height))
        base = np.sqrt(np.maximum(base_squared, 0.0))
        values = height, none + twist, base, load, prism.height - height, -load / prism.sides
        return dict(zip(self.names, (*values, none, none), strict=True))

    def rows(self, part: Part) -> dict[str, Any]:
        """See `Problem.rows`."""
        stable = np.ones(len(part.data), dtype=bool)
        return {"stable_load": stable, "stable_height": stable}


def _upright_forms(sides: int) -> tuple[list[Any], tuple[Any, ...]]:
    """Twist, squared base and load as forms in height, k_cross and natural lengths of cross
    string and bar."""
    from derivations import prism, regular
    from derivations.equilibrium import upright_base_squared, upright_load, upright_twist

    symbols = (prism.height, prism.k_cross, prism.natural_cross, prism.natural_bar)
    of = regular.TRIANGLE if sides == 3 else regular.ANY
    forms = [form(of) for form in (upright_twist, upright_base_squared, upright_load)]
    if sides != 3:
        import sympy as sp

        angle = sp.pi / sides
        known = {regular.half_angle: angle, regular.number_of_sides: sides}
        known |= {regular.half_sine: sp.sin(angle), regular.half_cosine: sp.cos(angle)}
        forms = [form.subs(known).evalf(30) for form in forms]
    return forms, symbols
