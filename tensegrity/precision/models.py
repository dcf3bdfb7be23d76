"""What a simpler model of a scene costs in truth: the same job by several models.

A model is a scene and a state, run to a tolerance, or any function.  One number of the job, or an
array, is compared with that of the last model, or of another one that is named.  `prism_models` has
those of a column of prisms, from a rigid spring to bars with mass.
"""

from __future__ import annotations

import math
import time
from collections.abc import Callable, Mapping
from dataclasses import asdict, dataclass, replace
from typing import TYPE_CHECKING, Annotated, Any, NamedTuple

import numpy as np

from tensegrity import check, plotting
from tensegrity.checked import checked
from tensegrity.errors import TensegrityError
from tensegrity.notebook import progress
from tensegrity.printing import Lines, Printed, drawn
from tensegrity.prisms.prism import Prism
from tensegrity.runs.integrate import simulate
from tensegrity.runs.march import COUNTED
from tensegrity.runs.record import Record
from tensegrity.scenes.chain import Chain
from tensegrity.scenes.dynamics import dynamics
from tensegrity.scenes.scene import State
from tensegrity.springs.polynomial import Polynomial
from tensegrity.typing import Length, Mass

if TYPE_CHECKING:
    from matplotlib.axes import Axes

LOOSER = 100.0  # tolerance of the run that shows the error of a value
REPEATS, LONG = 3, 0.5  # runs that times are the least of, and seconds from which one has to do
ROWS = 1000  # instants that a run records
FIT = 1e-6  # error of the polynomial spring, over the largest tension


class Model(NamedTuple):
    """A scene and its state, and a run of it as one that all models share.

    Attributes
    ----------
    scene, state
        As of `simulate`.
    view : callable (run) -> run, optional
        What the quantity is taken of, such as a run whose u and v are those of plates along the
        axis; by default the run itself.
    """

    scene: Any
    state: State
    view: Callable[[Any], Any] | None = None


@dataclass(frozen=True)
class ModelRow:
    """One model.

    Attributes
    ----------
    model : str
    value : float or ndarray
        The quantity by it.
    error : float
        Largest difference from the reference, over the largest value of that.
    resolved : float
        Largest difference from the value at a tolerance a hundred times looser, as large a part;
        nan of a function.
    evaluations : float
        Evaluations of all forces, of all trial runs together; nan of a function.
    seconds : float
        CPU time, minimum of repeats [s].
    """

    model: str
    value: Any
    error: float
    resolved: float
    evaluations: float
    seconds: float


@dataclass(frozen=True, eq=False, repr=False)
class ModelComparison(Printed):
    """The same job by several models; see `compare_models`.

    Attributes
    ----------
    rows : tuple of ModelRow
        The simplest model first.
    reference : str
        The model that errors refer to.
    failed : dict of str to str
        Models that could not do the job, and why.
    """

    rows: tuple[ModelRow, ...]
    reference: str
    failed: dict[str, str]

    def __getitem__(self, model: str) -> ModelRow:
        for row in self.rows:
            if row.model == model:
                return row
        known = ", ".join(row.model for row in self.rows)
        raise TensegrityError(f"model {check.shown(model)} is not one of {known}")

    def simplest(self, error: float) -> ModelRow:
        """The first model within an error of the reference.

        Parameters
        ----------
        error : float
            Relative.

        Returns
        -------
        ModelRow
        """
        error = check.number("error", error, above=0)
        return next(row for row in self.rows if row.error <= error or row.model == self.reference)

    def to_dataframe(self) -> Any:
        """The models as a table of pandas.

        Returns
        -------
        pandas.DataFrame
            A row for each, with the columns of `ModelRow`.

        Raises
        ------
        TensegrityError
            If pandas is not installed.
        """
        pandas = check.package("pandas", "to_dataframe", "data")
        return pandas.DataFrame([asdict(row) for row in self.rows])

    def plot(self, ax: Axes | None = None) -> Axes:
        """Error of each model, the simplest above, with the time that it took.

        Parameters
        ----------
        ax : matplotlib.axes.Axes, optional

        Returns
        -------
        matplotlib.axes.Axes
        """
        ax = plotting.axes(ax)
        errors = np.array([row.error for row in self.rows])
        least = errors.min(initial=1.0, where=errors > 0) / 10
        at = np.arange(len(errors))
        ax.hlines(at, least, np.maximum(errors, least), color="0.8", lw=1)
        ax.semilogx(np.maximum(errors, least), at, "C0o")
        for k, row in enumerate(self.rows):
            words = "reference, " if row.model == self.reference else ""
            place = max(row.error, least), k
            ax.annotate(
                f"{words}{row.seconds:.2g} s",
                place,
                (8, 0),
                textcoords="offset points",
                va="center",
                fontsize=9,
            )
        ax.set_yticks(at, [row.model for row in self.rows])
        ax.invert_yaxis()
        ax.margins(x=0.25, y=0.1)
        ax.set(xlabel=f"largest difference from {self.reference}, relative; CPU time beside")
        return ax

    _draw = drawn

    def _lines(self) -> Lines:
        yield f"{len(self.rows)} models, compared with {self.reference}"
        for row in self.rows:
            value = f"{row.value:.6g}" if np.ndim(row.value) == 0 else "an array"
            off = "reference" if row.model == self.reference else f"off by {row.error:.2g}"
            yield f"{row.model}: {value}, {off}, {row.seconds:.2g} s of CPU"
        for name, words in self.failed.items():
            yield f"failed: {name}, {words}"


@checked
def compare_models(
    models: Mapping[str, Any],
    quantity: Callable[[Any], Any] | None = None,
    t_end: Annotated[float, "> 0", "s"] | None = None,
    *,
    reference: str | None = None,
    tol: Annotated[float, "> 0", "< 1"] = 1e-8,
    record: Record | None = None,
) -> ModelComparison:
    """The same job by several models: values, differences and costs.

    Parameters
    ----------
    models : dict of str to Model, (scene, state), or callable () -> value
        The simplest first; those of `prism_models`, or of your own.
    quantity : callable (run) -> float or array, optional
        The number that matters, such as a peak, a speed, an arrival: of a run, or of a model's
        `view` of it.  Not needed where all models are functions.
    t_end : float, optional
        Duration of runs [s].
    reference : str, optional
        The model that the others are compared with; by default the last one.
    tol : float, optional
        Tolerance of the runs.  A run at a hundred times of it shows the error of each value.
    record : Record, optional
        What runs record; by default 1,000 instants, the same for all models.

    Returns
    -------
    ModelComparison
        After Ctrl-C, or where a model fails, of the others.

    Raises
    ------
    TensegrityError
        Invalid input, before any work; the reference, or all models, failed.

    Examples
    --------
    >>> from tensegrity import Chain, PowerLaw, compare_models
    >>> chains = {n: Chain(PowerLaw(1.0, 1.5), n) for n in (3, 20)}
    >>> models = {f"{n} beads": (c, c.at_rest({0: 1.0})) for n, c in chains.items()}
    >>> found = compare_models(models, lambda run: run.v[:, 1].max(), 4.0)
    >>> found.simplest(1e-3).model, found.simplest(1e-9).model
    ('3 beads', '20 beads')
    """
    jobs = _jobs(models, quantity, t_end)
    name = list(jobs)[-1] if reference is None else reference
    if not isinstance(name, str) or name not in jobs:
        raise TensegrityError(
            f"reference {check.shown(name)} is not one of {', '.join(map(str, jobs))}"
        )
    done: dict[str, tuple[Any, Any, float, float]] = {}
    failed: dict[str, str] = {}
    with progress(len(jobs), "model") as bar:
        try:
            for one, model in jobs.items():
                try:
                    done[one] = _measured(model, quantity, t_end, tol, record)
                except TensegrityError as error:
                    failed[one] = str(error)
                bar.update()
        except KeyboardInterrupt:
            failed |= dict.fromkeys([one for one in jobs if one not in done], "interrupted")
    if name not in done:
        if not done or failed[name] != "interrupted":
            raise TensegrityError(f"reference {name}: {failed.get(name, 'no model was run')}")
        name = list(done)[-1]
    true = done[name][0]
    size = float(np.max(np.abs(true))) or 1.0
    rows = []
    for one, (value, loose, count, seconds) in done.items():
        if np.shape(value) != np.shape(true):
            failed[one] = f"shape {np.shape(value)} of its value is not {np.shape(true)}"
            continue
        resolved = math.nan if loose is None else _largest(value, loose) / size
        rows.append(ModelRow(one, value, _largest(value, true) / size, resolved, count, seconds))
    return ModelComparison(tuple(rows), name, failed)


def _largest(value: Any, other: Any) -> float:
    return float(np.max(np.abs(np.subtract(value, other))))


def _jobs(models: Any, quantity: Any, t_end: float | None) -> dict[str, Any]:
    """The models, checked."""
    if not isinstance(models, Mapping) or not models:
        raise TensegrityError(f"models {check.shown(models)} must be a dict of models by name")
    jobs: dict[str, Any] = {}
    for name, model in models.items():
        check.kind("name of a model", name, str)
        if not callable(model):
            parts = check.sequence(f"model {name}", model, "a scene and a state")
            if len(parts) not in (2, 3):
                raise TensegrityError(f"model {name} must be a Model, (scene, state) or a function")
            model = Model(*parts)
            if not callable(quantity) or t_end is None:
                raise TensegrityError(f"model {name} is a scene: give a quantity and t_end")
            check.kind(f"state of model {name}", model.state, State)
            dynamics(model.scene).checked(model.state)
        jobs[name] = model
    return jobs


def _measured(
    model: Any, quantity: Any, t_end: float | None, tol: float, record: Any
) -> tuple[Any, Any, float, float]:
    """Value, value of a looser run, evaluations and seconds of a model."""

    def value(tolerance: float) -> Any:
        if not isinstance(model, Model):
            return model()
        assert t_end is not None
        kept = record or Record(interval=t_end / ROWS)
        run = simulate(model.scene, model.state, t_end, tol=tolerance, record=kept)
        if not run.complete:
            raise KeyboardInterrupt
        return quantity(model.view(run) if model.view else run)

    seconds: list[float] = []
    while len(seconds) < REPEATS and not (seconds and seconds[0] > LONG):
        counted: list[int] = []
        token, began = COUNTED.set(counted), time.process_time()
        try:
            found = value(tol)
        finally:
            COUNTED.reset(token)
        seconds.append(time.process_time() - began)
    check.finite("value", np.asarray(found, dtype=float))
    if not isinstance(model, Model):
        return found, None, math.nan, min(seconds)
    return found, value(min(LOOSER * tol, 0.1)), sum(counted), min(seconds)


@checked
def prism_models(
    prism: Prism,
    count: int,
    speed: Annotated[float, "m/s"],
    mass: Mass = 1.0,
    *,
    gyration: Length | None = None,
    bars: Annotated[float, "> 0", "< 1"] | None = None,
) -> dict[str, Model]:
    """Models of a column of equal prisms whose first polygon is struck along the axis.

    Parameters
    ----------
    prism : Prism
        With finite `k_base` and `k_bar`.
    count : int
        Number of prisms, of alternating handedness.
    speed : float
        Of the struck polygon [m/s], > 0 into the column.
    mass : float, optional
        Of each polygon or plate [kg].
    gyration : float, optional
        Radius of gyration of plates [m]; by default that of the nodes, the circumradius.
    bars : float, optional
        Fraction of the mass of a polygon that is in the bars of a prism, for the model of bars with
        mass; by default there is no such model.

    Returns
    -------
    dict of str to Model
        "rigid spring", "polynomial" and "elastic spring", chains; "plates", which turn; "nodes",
        all coordinates of massless members; "bars with mass".  Views of all are runs of the chain:
        u[:, j] is the displacement along the axis of polygon j.

    Raises
    ------
    TensegrityError
        A rigid prism, or another argument outside its bounds.
    """
    count = check.whole("count", count, least=1)
    column: Any = prism.column(count)
    sides, spring = prism.sides, prism.potential()
    rigid = Prism(prism.base, prism.height, prism.prestrain, prism.k_cross, sides=sides)
    line = Chain(spring, count + 1, mass)
    energy = check.number("energy of the blow", mass * speed * speed / 2, unit="J")
    (low, high), *_ = dynamics(line).springs.reachable(energy)[0]
    start = line.at_rest({0: speed})
    springs = {"rigid spring": rigid.potential()}
    springs["polynomial"] = Polynomial(spring, float(low), float(high), FIT)
    found = {name: Model(Chain(one, count + 1, mass), start) for name, one in springs.items()}
    found["elastic spring"] = Model(line, start)

    def seen(axial: Callable[[Any], Any]) -> Callable[[Any], Any]:
        return lambda run: replace(
            run, scene=line, u=axial(run.u), v=axial(run.v), sites=tuple(range(count + 1))
        )

    def polygons(u: Any) -> Any:
        return u[..., 2].reshape(len(u), count + 1, sides).mean(axis=2)

    plates: Any = prism.column(count, plates=(mass, gyration or prism.circumradius))
    moving = np.zeros(plates.shape)
    moving[0, 0] = speed
    found["plates"] = Model(plates, State(0 * moving, moving), seen(lambda u: u[..., 0]))
    node = np.zeros((sides * (count + 1), 3))
    node[:sides, 2] = speed
    given: dict[str, Any] = {"nodes": {"mass": mass / sides}}
    if bars is not None:
        ends = np.full(count + 1, 1.0)
        ends[[0, -1]] = 0.5  # a polygon at an end has bars on one side only
        lumped = np.repeat(mass / sides * (1 - bars * ends), sides)
        given["bars with mass"] = {"mass": lumped, "bar_mass": mass * bars / sides}
    for name, masses in given.items():
        network = column.at(column.positions, **masses).network()
        found[name] = Model(network, State(0 * node, node), seen(polygons))
    return found
