"""What `simulate` returns: recorded rows, the last state, and how they were made."""

from __future__ import annotations

from dataclasses import dataclass, field, fields, replace
from typing import TYPE_CHECKING

import numpy as np

from tensegrity import check
from tensegrity.errors import TensegrityError
from tensegrity.notebook import page
from tensegrity.runs import archive
from tensegrity.scenes.dynamics import dynamics
from tensegrity.scenes.ensemble import Ensemble
from tensegrity.scenes.scene import Scene, State, unchecked_state

if TYPE_CHECKING:
    from collections.abc import Iterator
    from os import PathLike
    from typing import Any, Self, TypeVar

    from matplotlib.axes import Axes

    from tensegrity.typing import Array

    Frozen = TypeVar("Frozen")


FAINTEST = 1e-4  # of the largest energy density: the lower end of the colours


def energy_density(run: Any, axes: Axes | None = None) -> Axes:
    """Energy of each site against time, logarithmic colours; returns the axes."""
    from matplotlib.colors import LogNorm

    scene = run.scene
    if run.sites != tuple(range(scene.sites)):
        raise TensegrityError(
            f"{len(run.sites)} of {scene.sites} sites recorded: record all to plot"
        )
    axes = check.axes(axes)
    density = scene.site_energy(run.u, run.v)
    largest = density.max() or 1.0
    image = axes.pcolormesh(
        np.arange(scene.sites),
        run.t,
        np.clip(density, FAINTEST * largest, None),
        norm=LogNorm(FAINTEST * largest, largest),
        cmap="viridis",
        shading="nearest",
        rasterized=True,
    )
    axes.set(xlabel="site", ylabel="time [s]")
    axes.figure.colorbar(image, ax=axes, label="energy per site [J]")
    return axes


SHOWN = 300  # instants in a notebook's picture


def unchecked_replace(one: Frozen, **values: Any) -> Frozen:
    """The same frozen dataclass with other values, which are known to be right."""
    return unchecked(type(one), one.__dict__, **values)


def unchecked(kind: type[Frozen], *given: dict[str, Any], **values: Any) -> Frozen:
    """A frozen dataclass of values that are known to be right, or else its defaults."""
    made = object.__new__(kind)
    for some in given:
        made.__dict__.update(some)
    made.__dict__.update(values)
    return made


@dataclass(frozen=True, eq=False)
class Run:
    """A finished, interrupted or failed run.

    Attributes
    ----------
    t : ndarray, (T,)
        Recorded instants [s].
    u, v : ndarray, (T, sites) or (T, sites, dim)
        Displacement [m] and velocity [m/s] of the recorded sites.
    energy : ndarray, (T,)
        Total energy of the scene, all sites [J].
    final : State
        State at the last instant reached.
    method : str
    dt : float
        Step [s]: the largest not above the one asked for that divides the time evenly.
    steps : int
        Steps done.
    complete : bool
        False if the run was interrupted or failed; what it had recorded is kept.
    error_estimate : float or None
        Estimated max(|du|/max|u|, |dv|/max|v|), where a tolerance was asked for.
    force_model : str
        What the tensions were computed by: "exact", or the polynomials that a tolerance allowed.
        Recorded energies are exact anyhow.
    met : ndarray, (runs of equal springs, 2)
        Smallest and largest elongation met at any stage [m], 0 included.
    fastest : float or None
        Bound on the largest angular frequency over the elongations met [rad/s], where contacts
        are followed; `elongation_range` is then that of the springs listed last.
    wall_time : float
        [s], all trial runs included.
    impulse : ndarray, (T, walls, dim), or None
        What each wall received since the start [N s], where the scene has walls.
    work : ndarray, (T,), or None
        Done on the scene since the start by what drives its sites or changes its springs [J],
        where the scene is driven, damped or tuned.
    loss : ndarray, (T,), or None
        Taken by dashpots since the start [J], likewise.  Energy - work + loss is constant.
    stopped : str or None
        Which observer ended the run, and when.
    """

    scene: Any = field(repr=False)
    t: Array
    u: Array
    v: Array
    energy: Array
    final: State
    method: str
    dt: float
    steps: int
    sites: tuple[int, ...]
    complete: bool = True
    error_estimate: float | None = None
    force_model: str = "exact"
    elongation_range: Array = field(default=None, repr=False)  # type: ignore[arg-type]
    fastest: float | None = field(default=None, repr=False)
    wall_time: float = 0.0
    impulse: Array | None = None
    work: Array | None = None
    loss: Array | None = None
    stopped: str | None = None

    _batch = 0  # axes that count scenes

    @property
    def energy_error(self) -> float:
        """Largest relative deviation of the total energy from its first value.

        Where there is work and loss, that of the energy less work and plus loss, over the largest
        of these and the energy; unless all are 0.
        """
        if not len(self.energy):
            return 0.0
        kept, size = self.energy, abs(self.energy[0])
        if self.work is not None and self.loss is not None:
            kept = self.energy - self.work + self.loss
            size = max(np.max(np.abs(x)) for x in (self.energy, self.work, self.loss))
        deviation = np.max(np.abs(kept - kept[0]))
        return float(deviation / size) if size else float(deviation)

    def save(self, path: str | PathLike[str]) -> None:
        """Write all of the run to one .npz file, whole or not at all, without pickle.

        Parameters
        ----------
        path : str or path
            A file that is there is replaced.  The scene is kept as the numbers it is built from;
            one that is made of a user's own energy as what it prints.

        Raises
        ------
        TensegrityError
            If the file cannot be written.
        """
        try:
            archive.write(path, "run", {f.name: getattr(self, f.name) for f in fields(self)})
        except OSError as error:
            raise TensegrityError(f"run not saved to {path}: {error.strerror}") from error

    @classmethod
    def load(cls, path: str | PathLike[str]) -> Self:
        """The run that was saved to a file; nothing in it is evaluated or unpickled.

        Parameters
        ----------
        path : str or path

        Returns
        -------
        Run
            With its scene, or, where that was kept as what it prints, one that prints so and
            raises a TensegrityError when it is asked for more.

        Raises
        ------
        TensegrityError
            If there is no such file, or it is damaged or something else, or its scene is of a
            package that was not imported, such as `granular`.
        """
        return archive.read(path, "run", lambda data: _of_file(data)._fitting())

    def _fitting(self) -> Self:
        """The run of a file, if its parts fit each other."""
        check.kind("final", self.final, State)
        shape = self.final.u.shape
        if not isinstance(self.scene, archive.Printed):
            check.kind("scene", self.scene, Ensemble if self._batch else Scene)
            if self.scene.shape != shape:
                raise TensegrityError(f"final has shape {shape}, the scene {self.scene.shape}")
        numbers = check.sequence("sites", self.sites, "numbers")
        for site in numbers:
            check.whole("site", site, least=0, below=shape[0])
        t = archive.array("t", self.t, (None,))
        if not (np.diff(t) > 0).all():
            raise TensegrityError("t must increase")
        rows, optional = (len(t), len(numbers), *shape[1:]), {"elongation_range": (None, 2)}
        sums = len(t), *shape[len(shape) - self._batch :]
        optional |= {"work": sums, "loss": sums, "impulse": (len(t), None, *shape[1:])}
        for name, wanted in ({"u": rows, "v": rows, "energy": sums} | optional).items():
            if name not in optional or getattr(self, name) is not None:
                archive.array(name, getattr(self, name), wanted)
        for name in ("dt", "wall_time", "error_estimate", "fastest"):
            if name in ("dt", "wall_time") or getattr(self, name) is not None:
                check.number(name, getattr(self, name), least=0, finite=name == "dt")
        check.whole("steps", self.steps, least=0)
        check.truth("complete", self.complete)
        if self.complete and self.stopped is not None:
            raise TensegrityError(f"complete, but stopped: {check.shown(self.stopped)}")
        for name in ("method", "force_model", *["stopped"] * (self.stopped is not None)):
            check.kind(name, getattr(self, name), str)
        return self

    def plot(self, axes: Axes | None = None) -> Axes:
        """Space-time density of energy; needs all sites recorded. Returns the axes."""

        return energy_density(self, axes)

    def __str__(self) -> str:
        estimate = "" if self.error_estimate is None else f", estimated {self.error_estimate:.1e}"
        end = f"{self.t[-1]:.6g}" if len(self.t) else "0"
        ended = "" if self.complete else f" ({self.stopped or 'incomplete'})"
        return (
            f"{self.method}, dt = {self.dt:.4g} s, {self.steps} steps to t = {end} s"
            f"{ended}\n"
            f"force model: {self.force_model}\n"
            f"{len(self.t)} instants of {len(self.sites)} sites recorded\n"
            f"error: energy {self.energy_error:.1e}{estimate}\n"
            f"wall time {self.wall_time:.3g} s"
        )

    __repr__ = __str__

    def _repr_html_(self) -> str:
        rows = {
            "method": self.method,
            "step": f"{self.dt:.4g} s, {self.steps} steps",
            "end": f"{self.t[-1] if len(self.t) else 0:.6g} s"
            + ("" if self.complete else f" ({self.stopped or 'incomplete'})"),
            "recorded": f"{len(self.t)} instants of {len(self.sites)} sites",
            "force_model": self.force_model,
            "energy error": f"{self.energy_error:.1e}",
            "wall time": f"{self.wall_time:.3g} s",
        }
        if self.error_estimate is not None:
            rows["estimated error"] = f"{self.error_estimate:.1e}"
        every = max(1, -(-len(self.t) // SHOWN))
        names = ("t", "u", "v", "energy")
        few = replace(self, **{name: getattr(self, name)[::every] for name in names})
        return page("Run", rows, lambda figure: few.plot(figure.subplots()))


@dataclass(frozen=True, eq=False, repr=False)
class RunBatch(Run):
    """Runs of all scenes of an `Ensemble`, with one step; `len` is their number, `[k]` the run of a
    scene.

    Attributes are those of `Run`.  The last axis of u, v, impulse and `final` counts scenes, and so
    does that of energy, work and loss, (T, scenes).
    """

    _batch = 1

    def __len__(self) -> int:
        return self.final.u.shape[-1]

    def __getitem__(self, number: int) -> Run:
        """The run of one scene, by its number from 0.

        Its `elongation_range` is that of its springs in all scenes that have them.
        """
        k = range(len(self))[number]
        values = {field.name: getattr(self, field.name) for field in fields(self)}
        for name in ("u", "v", "energy", "impulse", "work", "loss"):
            if values[name] is not None:
                values[name] = np.ascontiguousarray(values[name][..., k])
        final = (np.ascontiguousarray(x[..., k]) for x in (self.final.u, self.final.v))
        elongation_range = self.elongation_range[dynamics(self.scene).spring_numbers(k)]
        return unchecked(
            Run,
            values,
            scene=self.scene.scenes[k],
            final=unchecked_state(*final),
            elongation_range=elongation_range,
        )

    def __iter__(self) -> Iterator[Run]:
        return (self[k] for k in range(len(self)))

    @property
    def energy_error(self) -> float:
        """The largest of any scene."""
        return max(run.energy_error for run in self)

    def plot(self, axes: Axes | None = None) -> Axes:
        """Refused: plot one of them."""
        raise TensegrityError(f"{len(self)} runs in one: plot one of them, such as run[0].plot()")

    def __str__(self) -> str:
        return f"{len(self)} runs: {super().__str__()}"

    __repr__ = __str__


def _of_file(data: dict[str, Any]) -> Run:
    """The run, or the runs of an ensemble, that a file holds."""
    return (RunBatch if np.ndim(data["energy"]) == 2 else Run)(**data)
