"""Steps of a splitting with explicit time: driven sites, dashpots, springs that change.

Time is an additional coordinate, which drifts advance: the kick of a stage uses the forces, the
prescribed displacements and the springs at its instant, and a splitting keeps its order.  The work
of drives is the change of the momentum conjugate to time, summed with the kicks of the method.  A
drift with dashpots, u' = v, m v' = -G v, is linear in v and solved exactly in a chain; so the
commutators on which the order of a Nystrom splitting relies still vanish, and it keeps its order.
In a network G depends on u as bonds turn; the commutators vanish as well, and the drift is solved
to the order of the method.  See `driven.c`.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from typing import Any

import numpy as np

from tensegrity.engine import forced, march
from tensegrity.engine.bonds import Bonds
from tensegrity.engine.bound import Bound
from tensegrity.engine.compiled import compiled
from tensegrity.engine.force_law import AppliedForce
from tensegrity.engine.inertia import Ties
from tensegrity.engine.layout import of_contacts
from tensegrity.engine.methods import Splitting
from tensegrity.engine.native import structure
from tensegrity.typing import Array, Indices

DRIVE = structure("driven.c", "drive")
UNDAMPED, DAMPED_SITES, DAMPED_CHAIN, DAMPED_NETWORK = range(4)  # as in driven.c
LEAST_TERMS = 12  # of the series of a drift
NODES = 8  # instants of a drift at which prescribed velocities are interpolated by polynomials
SMALL = 1e-17  # relative size of the first omitted term of the series
LARGEST_DAMPING = 2.0  # duration of a drift times the largest rate of decay


@dataclass(frozen=True, eq=False)
class Forcing:
    """Drives, dashpots and changing springs of a scene in the form of arrays.

    Entries are those of u, flattened.

    Attributes
    ----------
    bonds : Bonds
        Bonds of the scene.
    moved, forced : ndarray of int
        Entries whose motion is prescribed, and entries with a prescribed force.
    motion, force : callable (t, order) -> ndarray, (t.size, entries)
        Displacements [m], forces [N], and their rates for order 1.
    mass : ndarray, (entries,)
        [kg]; 0 where the motion is prescribed.
    prescribed_mass : ndarray, (moved,)
        Masses of the entries whose motion is prescribed [kg].
    ground : ndarray, (entries,)
        Dashpots to the ground [N s/m].
    bond : ndarray, (bonds,)
        Dashpots in the bonds [N s/m]; none in contacts with walls, which follow the bonds.
    timed : object or None
        Springs of which some change; see `springs.over_time.TimedSprings`.
    applied : tuple of AppliedForce
        Further forces, on sites and along bonds.
    ties : Ties, optional
        Of bonds with mass.
    """

    bonds: Bonds
    moved: Indices
    forced: Indices
    motion: Callable[[Array, int], Array]
    force: Callable[[Array, int], Array]
    mass: Array
    prescribed_mass: Array
    ground: Array
    bond: Array
    timed: Any
    applied: tuple[AppliedForce, ...] = ()
    ties: Ties | None = None

    @property
    def damped(self) -> int:
        """Kind of dashpots, as in `driven.c`."""
        if self.bond.any():
            return DAMPED_CHAIN if self.bonds.contacts is None else DAMPED_NETWORK
        return DAMPED_SITES if self.ground.any() else UNDAMPED

    @property
    def damped_bonds(self) -> Indices:
        """Numbers of the bonds of a network that have dashpots."""
        return (
            np.flatnonzero(self.bond) if self.damped == DAMPED_NETWORK else np.zeros(0, dtype=int)
        )

    @property
    def decay(self) -> float:
        """Bound on the rates at which velocities decay by dashpots [1/s]."""
        total = self.ground.copy()
        if self.damped == DAMPED_CHAIN:
            total[1:] += 2 * self.bond
            total[:-1] += 2 * self.bond
        elif self.damped == DAMPED_NETWORK:
            of: Any = self.bonds.contacts
            by_site = total.reshape(len(of.load), -1)  # a view
            for ends in (of.first, of.second):
                np.add.at(by_site, ends[self.damped_bonds], 2 * self.bond[self.damped_bonds, None])
        weights = np.divide(1, self.mass, out=np.zeros_like(total), where=self.mass > 0)
        return float(np.max(total * weights, initial=0.0))


class Schedule:
    """Time-dependent numbers for all kicks and drifts of some steps.

    Parameters
    ----------
    forcing : Forcing
    method : Splitting
    dt : float
        [s]
    """

    def __init__(self, forcing: Forcing, method: Splitting, dt: float) -> None:
        self._forcing, self._dt = forcing, dt
        self.kicks, self.drifts = (np.multiply(x, dt) for x in (method.kicks, method.drifts))
        self._within = np.concatenate([[0.0], np.cumsum(self.drifts)[:-1]])
        self.degree, self.levels = self._terms(), -(-method.order // 2)
        nodes = (1 - np.cos(np.pi * (np.arange(NODES) + 0.5) / NODES)) / 2
        self._nodes, self._solve = nodes, np.linalg.inv(np.vander(nodes, increasing=True))
        self._gauss, self._weights = np.polynomial.legendre.leggauss(NODES)

    def _terms(self) -> int:
        """Number of terms of the series of a drift."""
        if self._forcing.damped != DAMPED_CHAIN:
            return LEAST_TERMS
        size, term, count = float(np.abs(self.drifts).max()) * self._forcing.decay, 1.0, 0
        while term > SMALL or count < LEAST_TERMS:
            count += 1
            term *= size / count
        return count

    def times(self, first: int, steps: int, origin: float = 0.0) -> Array:
        """Instants of the kicks and of the end.

        Parameters
        ----------
        first, steps : int
            Number of the first step, and how many.
        origin : float, optional
            Time of step 0 [s].

        Returns
        -------
        ndarray, (steps stages + 1,)
            [s]
        """
        starts = origin + self._dt * np.arange(first, first + steps + 1)
        return np.append((starts[:-1, None] + self._within).ravel(), starts[-1])

    def width(self) -> int:
        """Count of time-dependent numbers for a step."""
        forcing, width = self._forcing, 1
        width += len(forcing.moved) * (2 + self.degree * (1 + (forcing.damped > 0)))
        width += 2 * len(forcing.forced)
        if forcing.timed is not None:
            width += 2 * forcing.timed.columns.size
        return width * len(self.drifts)

    def rows(self, first: int, steps: int, origin: float = 0.0) -> dict[str, Array]:
        """The arrays of `driven.c` that depend on time.

        Parameters
        ----------
        first, steps : int
            Number of the first step, and how many.
        origin : float, optional
            Time of step 0 [s].

        Returns
        -------
        dict of ndarray
        """
        forcing, at = self._forcing, self.times(first, steps, origin)
        table = {}
        if forcing.moved.size:
            table["moved_u"] = forcing.motion(at[1:], 0)
            table["moved_v"] = forcing.motion(at, 1)
            if forcing.damped:
                table |= self._between(at, steps)
        if forcing.forced.size:
            table["force"], table["force_rate"] = (forcing.force(at, k) for k in (0, 1))
        if forcing.timed is not None:
            table["numbers"], table["domain"] = forcing.timed.numbers(at)
        return {name: np.ascontiguousarray(rows, dtype=float) for name, rows in table.items()}

    def _between(self, at: Array, steps: int) -> dict[str, Array]:
        """Prescribed velocities within drifts as polynomials, or the loss in their dashpots."""
        starts, lengths = at[:-1], np.tile(self.drifts, steps)
        moved, ground = self._forcing.moved, self._forcing.ground
        if self._forcing.damped >= DAMPED_CHAIN:
            nodes = starts[:, None] + lengths[:, None] * self._nodes
            values = self._forcing.motion(nodes.ravel(), 1).reshape(*nodes.shape, len(moved))
            series = np.zeros((len(starts), len(moved), self.degree))
            series[..., :NODES] = np.einsum("kx,sxm->smk", self._solve, values)
            return {"series": series}
        nodes = starts[:, None] + lengths[:, None] * (1 + self._gauss) / 2
        squares = self._forcing.motion(nodes.ravel(), 1).reshape(*nodes.shape, len(moved)) ** 2
        return {"dissipated": lengths * ((squares @ ground[moved]) @ self._weights) / 2}


class Locked(Exception):  # internal: tells the stage, not raised to users
    """A spring that changes reached an end of its domain.

    Parameters
    ----------
    t : float
        Instant of the stage [s].
    """

    def __init__(self, t: float) -> None:
        self.t = t


class BoundDriven(Bound):
    """Arrays u and v of a driven scene, advanced in place, with work and loss.

    Attributes
    ----------
    sums : ndarray, (2,)
        Work of drives [J], without the energy of their masses and forces; loss in dashpots [J].
    output_sums : ndarray, (2,)
        The same for the output state.
    """

    output_sums: Any

    def __init__(
        self, loop: Any, forcing: Forcing, u: Array, v: Array, method: Any, dt: float,
        corrects: bool,
    ) -> None:  # fmt: skip
        splits = isinstance(method, Splitting)
        self._forcing, self._corrects = forcing, corrects
        self.schedule: Any = (Schedule if splits else forced.Stages)(forcing, method, dt)
        self.sums = np.zeros(2)
        self.output_sums = self.sums.copy() if splits else self.sums
        self._reached = np.zeros((0 if forcing.timed is None else len(forcing.timed.series), 2))
        super().__init__(loop, u, v, forcing.bonds, method, dt)
        if forcing.timed is not None:
            self._no_range = self._no_range[forcing.timed.number]

    def _steps(self, method: Any) -> Any:
        forcing, schedule, loop = self._forcing, self.schedule, self._loop
        if not isinstance(method, Splitting):
            self._timed_fields = forced.fields(forcing, self.sums, self._corrects)
            kind, steps = super()._steps(method)
            steps.fill(forcing=self._timed_fields)
            return kind, steps
        drifts, weights = schedule.drifts, 1 / np.where(forcing.mass, forcing.mass, 1.0)
        rates = forcing.ground * weights * np.ones_like(drifts)[:, None]
        drift_factor = drifts[:, None] * np.ones_like(rates)
        np.divide(-np.expm1(-drifts[:, None] * rates), rates, out=drift_factor, where=rates != 0)
        entries, moving, bonds = len(forcing.mass), len(forcing.moved), len(forcing.bonds.group)
        sizes = {"term": entries, "next": entries, "pull": entries + 1, "elongations": bonds}
        arrays = {name: np.zeros(size) for name, size in sizes.items()}
        arrays["given"] = np.zeros((moving + 1, schedule.degree))
        arrays |= {
            name: getattr(forcing, name) for name in ("mass", "prescribed_mass", "ground", "bond")
        }
        arrays |= {name: getattr(forcing, name).astype(np.int64) for name in ("moved", "forced")}
        arrays |= {
            "decay": np.exp(-drifts[:, None] * forcing.ground * weights),
            "drift_factor": drift_factor,
        }
        if loop.dim:
            self._scene.fill(**of_contacts(loop, forcing.bonds))
        if forcing.timed is not None:
            arrays |= self._changing()
        if forcing.damped == DAMPED_NETWORK:
            of, damped_bonds = forcing.bonds.contacts, forcing.damped_bonds
            ends = loop.dim * np.stack([of.first, of.second], axis=1)[damped_bonds]
            arrays |= {
                "bond": forcing.bond[damped_bonds],
                "geometry": of.geometry[:, damped_bonds].T,
                "ends": ends.astype(np.int64),
                "room": np.zeros((schedule.levels + 3, 2 * entries + 1)),
            }
        arrays |= {"sums": self.sums, "output_sums": self.output_sums}
        numbers = {
            "entries": entries,
            "moving": moving,
            "forcing": len(forcing.forced),
            "damped": forcing.damped,
            "degree": schedule.degree,
            "damped_bonds": len(forcing.damped_bonds),
            "levels": schedule.levels,
            "bonds": bonds,
            "springs": len(self._reached),
            "columns": 0 if forcing.timed is None else forcing.timed.columns.size,
            "shared_size": self._scene.filled["shared"].size,
            "own_size": self._scene.filled["own"].size,
        }
        arrays = {name: np.ascontiguousarray(x) for name, x in arrays.items()}
        self._timed_fields = DRIVE(**dict.fromkeys(DRIVE.kinds) | arrays | numbers)
        return "driven", self._timed_fields  # others: `_timed`

    def _changing(self) -> dict[str, Any]:
        """Arrays of springs that change: the loop's bonds have for parameters the columns of
        their numbers, and places for these numbers."""
        runs, timed, places = self._layout.runs, self._forcing.timed, {}
        for name in ("shared", "own"):
            columns = self._layout.fields[name]
            places[name] = np.zeros(columns.shape)
            places[f"{name}_from"] = columns.astype(np.int64)
        self._scene.fill(shared=places["shared"], own=places["own"])
        spring = self._forcing.bonds.group[runs.source].astype(np.int64)
        return places | {"spring": spring, "column": timed.columns, "reached": self._reached}

    def go(self, done: int, end: int, wanted: Any = ()) -> int:
        """Advance and store states; see `Bound.go`.

        Prescribed velocities are 0, and sums lack the energy of the masses and forces of drives.

        Parameters
        ----------
        done, end : int
        wanted : sequence of Wanted, optional

        Returns
        -------
        int
            See `Bound.go`.

        Raises
        ------
        Locked
            A changing spring reached an end of its domain; u and v are invalid then.
        """
        self._reached[:] = np.inf, -np.inf
        return self._timed(done, end - done, lambda: super(BoundDriven, self).go(done, end, wanted))

    def short(self, t: float) -> None:
        """One single step that begins at t [s], in place, with its closing kick."""

        def step() -> int:
            u, v = (x.ctypes.data for x in (self.u, self.v))
            stopped: int = self._advance(*self._addresses, 1, False)
            if self._postprocess is None:
                return stopped
            return stopped or self._postprocess(*self._addresses, u, v)

        self._timed(0, 1, step, t)
        self.sums[:] = self.output_sums

    def _timed(self, first: int, steps: int, do: Callable[[], int], origin: float = 0.0) -> int:
        """Do steps from number `first` on, where step 0 is at `origin` [s]."""
        timed = self._timed_fields
        timed.fill(**self.schedule.rows(first, max(steps, 1), origin))
        timed.stage, self.output_sums[:] = 0, self.sums
        timed.step = 0
        status = do()
        if status == march.STOPPED:
            times = self.schedule.times(first, steps, origin)
            raise Locked(float(times[timed.stage]))
        return status

    def record_stages(self, path: Array) -> None:
        """Where a Runge-Kutta method writes u and v of all stages of the following steps, (stages
        of all steps, 2, entries)."""
        self._timed_fields.fill(path=path)

    def widen(self, ranges: Array) -> Array:
        """Widen ranges of elongation; see `Bound.widen`."""
        timed = self._forcing.timed
        if timed is None:
            return super().widen(ranges)
        for side, wider in enumerate((np.minimum, np.maximum)):
            wider(ranges[:, side], self._reached[timed.number, side], out=ranges[:, side])
        return ranges


def bind(
    forcing: Forcing, u: Array, v: Array, method: Any, dt: float, corrects: bool = False
) -> BoundDriven:
    """Prepare a loop that advances rows `u` and `v` of a driven scene in place.

    Parameters
    ----------
    forcing : Forcing
    u, v : ndarray, C-contiguous
        See `kernel.bind`.
    method : Splitting or Nystrom
        The latter, with rows for rates, takes further forces, and no dashpots or changing springs.
    dt : float
        Step [s].
    corrects : bool, optional
        Whether steps are corrected where contacts close, which their adjoint does not know.

    Returns
    -------
    BoundDriven
    """
    bonds, forces = forcing.bonds, tuple(one.law for one in forcing.applied)
    loop = compiled(bonds.laws, bonds.own, bonds.dim, 1, forces)
    return BoundDriven(loop, forcing, u, v, method, dt, corrects)
