"""What `work_precision` found: runs as a table and a picture, and the cheapest for an error."""

from __future__ import annotations

import math
from dataclasses import asdict, dataclass, field
from typing import TYPE_CHECKING, Any, NamedTuple

import numpy as np

from tensegrity import check, plotting
from tensegrity.errors import TensegrityError
from tensegrity.precision.stability import Drift, Limit
from tensegrity.printing import Lines, Printed, drawn
from tensegrity.scenes.scene import State

if TYPE_CHECKING:
    from matplotlib.axes import Axes

CALL = "simulate(tol=)"
COSTS = {"evaluations": "evaluations of all forces", "seconds": "CPU time of a run [s]"}
SHOWN = 10.0 ** -np.arange(2, 13, 2)  # errors whose best method is printed
NEAR = 1.25  # cost over that of a run, of finer ones that must keep an error too
ZERO = 1e-18  # least error, on logarithmic scales


@dataclass(frozen=True)
class WorkRow:
    """One run.

    Attributes
    ----------
    method : str
        Of ours, "simulate(tol=)", or the name of another program.
    setting : str
    dt : float
        [s], nan where the step varies or is not known.
    evaluations : int or float
        Evaluations of all forces, of all trial runs together; nan if they are not counted.
    error : float
        Of the last state: max(|du|/max|u|, |dv|/max|v|), maxima over the reference run.
    seconds : float
        CPU time, minimum of repeats [s].
    compiled : float
        CPU time of another program before its first run [s].
    """

    method: str
    setting: str
    dt: float
    evaluations: float
    error: float
    seconds: float
    compiled: float = 0.0


class Best(NamedTuple):
    """The cheapest method and step for an error, what they cost, and the reason in words."""

    method: str
    dt: float
    evaluations: int
    seconds: float
    error: float
    why: str


@dataclass(frozen=True, eq=False, repr=False)
class WorkPrecision(Printed):
    """Error against cost of one scene; see `work_precision`.

    Attributes
    ----------
    rows : tuple of WorkRow
    reference_error : float
        Own error of what the errors refer to.
    reference : str
        What that is.
    stability : tuple of Limit
        Of each explicit method: the largest stable step found, the predicted one, how the method
        fails beyond it, and why the two differ.
    energy : tuple of Drift
        Of each method: how far the energy is off in a run ten times as long.
    left_out : dict of str to str
        Methods that were not compared, and why.
    ended : str
        Why the comparison ended.
    final : State
        The last state that errors refer to.
    scale : tuple of two floats
        Largest |u| [m] and |v| [m/s] of the reference run.
    """

    scene: Any
    t_end: float
    rows: tuple[WorkRow, ...] = ()
    reference_error: float = math.nan
    reference: str = ""
    stability: tuple[Limit, ...] = ()
    energy: tuple[Drift, ...] = ()
    left_out: dict[str, str] = field(default_factory=dict)
    ended: str = ""
    final: State | None = None
    scale: tuple[float, float] = (1.0, 1.0)

    @property
    def methods(self) -> tuple[str, ...]:
        """Names of ours that were compared at given steps."""
        return tuple(dict.fromkeys(row.method for row in self.rows if row.dt > 0))

    def ladder(self, method: str) -> tuple[WorkRow, ...]:
        """Runs of one method or program, the cheapest first."""
        found = [row for row in self.rows if isinstance(method, str) and row.method == method]
        if not found:
            known = ", ".join(dict.fromkeys(row.method for row in self.rows))
            raise TensegrityError(f"method {check.shown(method)} did not run: there are {known}")
        return tuple(sorted(found, key=lambda row: (row.evaluations, row.seconds)))

    def _first(self, method: str, error: float) -> WorkRow | None:
        """The cheapest run of a method within an error, as are all finer ones that cost at most a
        quarter more, so that it is not so by chance; None if there is none."""
        rows = self.ladder(method)
        allowed = error - self.reference_error
        for k, row in enumerate(rows):
            near = [x for x in rows[k:] if not x.evaluations > NEAR * row.evaluations]
            if all(x.error <= allowed for x in near):
                return row
        return None

    def cost(self, method: str, error: float, counted: str = "seconds") -> float:
        """What a method or program costs for an error: between its first run that keeps it and the
        one before, along a power law, as settings of other programs are far apart.

        Parameters
        ----------
        method : str
        error : float
        counted : {"seconds", "evaluations"}, optional

        Returns
        -------
        float
            inf where it did not reach the error, or its evaluations are not counted.

        Raises
        ------
        TensegrityError
            Not an error, or something else to count.
        """
        error = check.number("error", error, above=0)
        _check_cost("counted", counted)
        rows = [row for row in self.ladder(method) if getattr(row, counted) > 0]
        rows.sort(key=lambda row: getattr(row, counted))
        kept = next((k for k, row in enumerate(rows) if row.error <= error), None)
        if kept is None:
            return math.inf
        cost, before = getattr(rows[kept], counted), rows[max(kept - 1, 0)]
        if before.error <= error:
            return float(cost)
        ratio = math.log(before.error / max(rows[kept].error, ZERO))
        share = math.log(before.error / error) / ratio
        return float(getattr(before, counted) * (cost / getattr(before, counted)) ** share)

    def best(self, error: float) -> Best:
        """The method and step that keep an error with the fewest evaluations of the forces.

        Parameters
        ----------
        error : float
            Of the last state, relative; that of the reference counts.

        Returns
        -------
        Best

        Raises
        ------
        TensegrityError
            No run kept it.
        """
        error = check.number("error", error, above=0)
        found = {name: self._first(name, error) for name in self.methods}
        kept = {name: row for name, row in found.items() if row is not None}
        if not kept:
            least = min((r for r in self.rows if r.dt > 0), key=lambda r: r.error, default=None)
            reached = f"; {least.method} reached {least.error:.1e}" if least else ""
            raise TensegrityError(
                f"error {error:g}: no run kept it{reached}, with a reference good to "
                f"{self.reference_error:.1e}; {self.ended}"
            )
        name, row = min(kept.items(), key=lambda pair: (pair[1].evaluations, pair[1].seconds))
        others = [self._words(other, error) for other in found if other != name]
        call = self._first(CALL, error) if any(row.method == CALL for row in self.rows) else None
        if call is not None:
            others.append(
                f"{CALL.replace('=', f'={call.setting[4:]}')} finds its step in "
                f"{call.evaluations:,.0f}"
            )
        why = f"{name}, dt {row.dt:.3g} s: {row.evaluations:,.0f} evaluations"
        why = "; ".join([why, *(words for words in others if words)])
        return Best(name, row.dt, int(row.evaluations), row.seconds, row.error, why)

    def _words(self, method: str, error: float) -> str:
        """What another method needs for an error: found, or extrapolated."""
        row = self._first(method, error)
        if row is not None:
            return f"{method} needs {row.evaluations:,.0f}"
        rows = [x for x in self.ladder(method) if 0 < x.error < 0.1]
        if len(rows) < 2 or rows[-1].error >= rows[0].error:
            return f"{method} did not reach it"
        span = math.log(rows[-1].evaluations / rows[0].evaluations)
        order = math.log(rows[0].error / rows[-1].error) / span
        needed = rows[-1].evaluations * max(rows[-1].error / error, 1.0) ** (1 / order)
        return f"{method} needs some {float(f'{needed:.1g}'):,.0f}"

    def to_dataframe(self) -> Any:
        """All runs as a table of pandas.

        Returns
        -------
        pandas.DataFrame
            A row for each run, with the columns of `WorkRow`.

        Raises
        ------
        TensegrityError
            If pandas is not installed.
        """
        pandas = check.package("pandas", "to_dataframe", "data")
        return pandas.DataFrame([asdict(row) for row in self.rows])

    def plot(self, ax: Axes | None = None, cost: str = "evaluations") -> Axes:
        """Cost against error, both logarithmic, a curve for each method and program.

        Parameters
        ----------
        ax : matplotlib.axes.Axes, optional
        cost : {"evaluations", "seconds"}, optional
            Programs whose evaluations are not counted appear with their seconds only.

        Returns
        -------
        matplotlib.axes.Axes

        Raises
        ------
        TensegrityError
            Another cost.
        """
        _check_cost("cost", cost)
        ax = plotting.axes(ax)
        for k, name in enumerate(dict.fromkeys(row.method for row in self.rows)):
            ours = name in self.methods
            points = [(x.error, getattr(x, cost)) for x in self.ladder(name) if 0 < x.error < 10]
            if not points or not np.isfinite([y for _, y in points]).all():
                continue
            style = {"lw": 1.6} if ours else {"lw": 1.0, "ls": "--", "marker": "osv^D"[k % 5]}
            if name == CALL:
                style = {"color": "k", "marker": "o", "lw": 0.8}
            ax.loglog(*zip(*points, strict=True), ms=3.5, label=name, **style)
        ax.axvspan(1e-17, max(self.reference_error, 2e-17), color="0.9", zorder=0)
        least = min((x.error for x in self.rows if x.error > 0), default=1e-12)
        ax.set_xlim(3, min(least, self.reference_error or least) / 3)
        ax.set(
            xlabel="error of the last state, relative (grey: of the reference)", ylabel=COSTS[cost]
        )
        ax.annotate(
            "better",
            (0.97, 0.04),
            (0.84, 0.12),
            xycoords="axes fraction",
            color="0.4",
            arrowprops={"arrowstyle": "->", "color": "0.4"},
        )
        ax.legend(fontsize=9, loc="upper left")
        return ax

    _draw = drawn

    def _lines(self) -> Lines:
        yield f"error against cost over {self.t_end:.6g} s, {len(self.rows)} runs; {self.ended}"
        yield f"reference: {self.reference}, good to {self.reference_error:.1e}"
        for error in SHOWN:
            try:
                yield f"for {error:.0e}: {self.best(float(error)).why}"
            except TensegrityError:
                continue
        for limit in self.stability:
            yield f"largest step of {limit}"
        for drift in self.energy:
            yield f"energy by {drift}"
        for name, words in self.left_out.items():
            yield f"left out: {name}, {words}"


def _check_cost(name: str, given: object) -> None:
    if not isinstance(given, str) or given not in COSTS:
        raise TensegrityError(f"{name} {check.shown(given)} must be one of {', '.join(COSTS)}")
