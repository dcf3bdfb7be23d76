"""The result of `simulate`: recorded rows, the final state, and how they were computed."""

from __future__ import annotations

import math
from dataclasses import dataclass, field, fields, replace
from typing import TYPE_CHECKING

import numpy as np

from tensegrity import check, plotting
from tensegrity.errors import TensegrityError
from tensegrity.printing import GLUE, Lines
from tensegrity.runs import archive
from tensegrity.runs.record import require_all_sites
from tensegrity.runs.rows import Rows
from tensegrity.scenes.dynamics import dynamics
from tensegrity.scenes.ensemble import Ensemble
from tensegrity.scenes.picture import Picture
from tensegrity.scenes.scene import Scene, State, momenta, unchecked_state
from tensegrity.unit_names import in_units

if TYPE_CHECKING:
    from collections.abc import Iterator
    from os import PathLike
    from typing import Any, Self, TypeVar

    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

    from tensegrity.typing import Array

    Frozen = TypeVar("Frozen")


def energy_density(run: Any, ax: Axes | None = None) -> Axes:
    """See `Run.plot`."""
    scene = run.scene
    require_all_sites(run, " to plot")
    drawn: Axes = plotting.axes(ax)
    density = scene.site_energy(run)
    if len(scene.shape) > 1:
        largest = density.max(axis=0, initial=0.0)
        style = plotting.logarithmic(largest)
        picture = Picture(scene, drawn, order=np.argsort(largest), facecolors=None, **style)
        picture.show(np.zeros(scene.shape), largest)
        picture.scale(picture.sites, in_units("largest energy of each site [J]"))
    else:
        image = drawn.pcolormesh(
            np.arange(scene.sites),
            run.t,
            density,
            shading="nearest",
            rasterized=True,
            **plotting.logarithmic(density),
        )
        drawn.set(xlabel="site", ylabel=in_units("time [s]"))
        drawn.figure.colorbar(image, ax=drawn, label=in_units("energy per site [J]"))
    return drawn


SHOWN = 300  # most instants in the picture of a notebook
AT_ONCE = 1_000_000  # most numbers in v of rows whose kinetic energies are computed at once


def unchecked_replace(one: Frozen, **values: Any) -> Frozen:
    """A copy of a frozen dataclass with other values, which are known to be valid."""
    return unchecked(type(one), one.__dict__, **values)


def unchecked(kind: type[Frozen], *given: dict[str, Any], **values: Any) -> Frozen:
    """A frozen dataclass built without its checks, from values that are known to be valid."""
    made = object.__new__(kind)
    for some in given:
        made.__dict__.update(some)
    made.__dict__.update(values)
    return made


@dataclass(frozen=True, eq=False, repr=False)
class Run(Rows):
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
        Step [s]: the largest one not above the requested step that divides the time evenly.
    steps : int
        Number of steps done.
    sites : tuple of int
        Numbers of the recorded sites.
    complete : bool
        False if the run was interrupted or failed; the rows recorded until then remain.
    error_estimate : float or None
        Estimated max(|du|/max|u|, |dv|/max|v|), where a tolerance was requested.
    force_model : str
        How the tensions were computed: "exact", or by polynomials fitted within the tolerance.
        Recorded energies are exact in either case.
    elongation_range : ndarray, (runs of equal springs, 2)
        Smallest and largest elongation at any stage [m], 0 included.
    fastest : float or None
        Bound on the largest angular frequency over these elongations [rad/s], where contacts are
        detected during the run; `elongation_range` then holds the springs of the last contact list.
    wall_time : float
        [s], all trial runs included.
    impulse : ndarray, (T, walls, dim), or None
        Impulse that each wall received since the start [N s], where the scene has walls.
    work : ndarray, (T,), or None
        Work done on the scene since the start by drives and by the change of its springs [J],
        where the scene is driven, damped or changes.
    loss : ndarray, (T,), or None
        Energy dissipated by dashpots and other forces since the start [J], where there is `work`.
        Energy - work + loss is constant.
    stopped : str or None
        Which observer ended the run, and when.

    Examples
    --------
    >>> from tensegrity import Chain, PowerLaw, simulate
    >>> chain = Chain(PowerLaw(1.0, 1.5), sites=5)
    >>> run = simulate(chain, chain.at_rest({0: 1.0}), 6.0, dt=0.01)
    >>> run.t.shape, run.u.shape, run.steps
    ((301,), (301, 5), 600)
    >>> run.energy_error < 1e-4
    True
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
        """Largest deviation of the total energy from its initial value, relative to the initial
        energy or to the largest kinetic energy of the recorded sites, whichever is larger.

        Where there are work and loss, the deviation of energy - work + loss, relative to the
        largest of the three and of the kinetic energy; absolute [J] where this scale is 0.  The
        kinetic energy is the scale of motions whose energy is 0 at the start, such as a fall from
        rest.  Of a file without its scene, whose masses are not known, it does not count.
        """
        if not len(self.energy):
            return 0.0
        conserved, sizes = self.energy, [abs(self.energy[0]), self._largest_kinetic()]
        if self.work is not None and self.loss is not None:
            conserved = self.energy - self.work + self.loss
            sizes += [np.max(np.abs(x)) for x in (self.energy, self.work, self.loss)]
        deviation, size = np.max(np.abs(conserved - conserved[0])), max(sizes)
        return float(deviation / size) if size else float(deviation)

    def _largest_kinetic(self) -> float:
        """Largest kinetic energy of the recorded sites [J]; 0 without the scene."""
        if isinstance(self.scene, archive.PrintedScene):
            return 0.0
        largest, sites = 0.0, list(self.sites)
        some = max(1, AT_ONCE // max(1, math.prod(self.scene.shape)))
        for k in range(0, len(self.v), some):
            v = np.zeros((len(self.v[k : k + some]), *self.scene.shape))
            v[:, sites] = self.v[k : k + some]
            each = dynamics(self.scene).kinetic(v).reshape(len(v), -1).sum(axis=1)
            largest = max(largest, float(each.max()))
        return largest

    def save(self, path: str | PathLike[str]) -> None:
        """Write the run to one .npz file, completely or not at all, without pickle.

        Parameters
        ----------
        path : str or path
            An existing file is replaced.  The scene is stored as the numbers it is built from, or,
            where its springs are made of a user's own energy, as its printed form only.

        Raises
        ------
        TensegrityError
            If the file cannot be written.
        """
        archive.write(path, "run", {f.name: getattr(self, f.name) for f in fields(self)})

    @classmethod
    def load(cls, path: str | PathLike[str]) -> Self:
        """Read the run that `save` wrote to a file; nothing in it is evaluated or unpickled.

        Parameters
        ----------
        path : str or path

        Returns
        -------
        Run
            With its scene, or, where only the printed form was stored, with a placeholder that
            prints the same and raises a TensegrityError on any other use.

        Raises
        ------
        TensegrityError
            If there is no such file, or it is damaged or not a run, or its scene is of a package
            that was not imported, such as `granular`.
        """
        return archive.read(path, "run", lambda data: _of_file(data)._fitting())

    def _fitting(self) -> Self:
        """This run, once its parts are found consistent with each other."""
        check.kind("final", self.final, State)
        shape = self.final.u.shape
        if not isinstance(self.scene, archive.PrintedScene):
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

    def momentum(self) -> Array:
        """Momentum of all sites plus the impulse that walls have received since the start [N s],
        (T[, dim]).

        It is constant if no other external force acts; the impulse on held sites is not recorded.

        Raises
        ------
        TensegrityError
            Not all sites were recorded.
        """
        if self._batch:
            raise TensegrityError("a batch has no momentum: take that of one of its runs, run[k]")
        order = np.argsort(self.sites)
        if len(order) < self.scene.sites:
            count = f"{len(self.sites)} of {self.scene.sites} sites"
            raise TensegrityError(f"{count} recorded: the momentum needs all")
        total = momenta(self.scene, self.v[:, order])
        return total if self.impulse is None else total + self.impulse.sum(axis=1)

    def plot(self, ax: Axes | None = None) -> Axes:
        """Energy of the sites in logarithmic colours.

        Parameters
        ----------
        ax : matplotlib.axes.Axes, optional
            By default of a new figure.

        Returns
        -------
        matplotlib.axes.Axes
            Of a chain the energy of each site against time; of a network, and so of a guide or a
            pack, a map of the largest energy that each site had.

        Raises
        ------
        TensegrityError
            `ax` is not a Matplotlib axes; a run in which not all sites were recorded.
        """
        return energy_density(self, ax)

    def _lines(self) -> Lines:
        estimate = "" if self.error_estimate is None else f", estimated {self.error_estimate:.1e}"
        end = f"{self.t[-1]:.6g}" if len(self.t) else "0"
        ended = "" if self.complete else f" ({self.stopped or 'incomplete'})"
        yield f"{self.method}, dt = {self.dt:.4g} s, {self.steps} steps to t = {end} s{ended}"
        yield f"force model: {self.force_model}"
        yield f"{len(self.t)} instants of {len(self.sites)} sites recorded"
        yield f"error: energy {self.energy_error:.1e}{estimate}"
        yield f"wall time {self.wall_time:.3g}{GLUE}s"  # seconds, whatever the units of the scene

    def _draw(self, figure: Figure) -> None:
        every = max(1, -(-len(self.t) // SHOWN))
        names = ("t", "u", "v", "energy")
        few = replace(self, **{name: getattr(self, name)[::every] for name in names})
        few.plot(figure.subplots())


@dataclass(frozen=True, eq=False, repr=False)
class RunBatch(Run):
    """Runs of all scenes of an `Ensemble` with one common step.

    `len` is the number of scenes and `[k]` the run of scene k.  The attributes are those of `Run`;
    the last axis of u, v, impulse, `final`, energy, work and loss counts the scenes.
    """

    _batch = 1

    def __len__(self) -> int:
        return self.final.u.shape[-1]

    def __getitem__(self, number: int) -> Run:
        """The run of one scene, by its number from 0.

        Its `elongation_range` covers all scenes that have the same springs.
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
        """The largest `energy_error` of all scenes."""
        return max(run.energy_error for run in self)

    def plot(self, ax: Axes | None = None) -> Axes:
        """Refuse to draw several runs at once: plot one of them, such as `run[0].plot()`."""
        raise TensegrityError(f"{len(self)} runs in one: plot one of them, such as run[0].plot()")

    def _lines(self) -> Lines:
        first, *others = super()._lines()
        yield from (f"{len(self)} runs: {first}", *others)


def _of_file(data: dict[str, Any]) -> Run:
    """The run, or the batch of runs, stored in a file."""
    return (RunBatch if np.ndim(data["energy"]) == 2 else Run)(**data)
