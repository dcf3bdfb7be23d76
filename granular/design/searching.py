"""The search for the protector whose wall feels least, here or on many machines.

Every batch that a method proposes is computed in parts, by the workers of an executor or here;
designs that were computed before are looked up.  What a design is worth does not depend on the
part that it is computed in, so that a seed gives one result however many workers there are.
The best of them are computed again, see `granular.design.finalists`.
"""

from __future__ import annotations

import hashlib
import itertools
import os
from concurrent.futures import Executor
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

import numpy as np

from granular.beads import Striker
from granular.design import objective
from granular.design.downhill import Descents, Way
from granular.design.finalists import KEPT, Best, chosen
from granular.design.methods import METHODS, starting, suits
from granular.design.packs import Build, wall_peak
from granular.design.spaces import Choice, Order, Sizes, Space
from granular.materials import Material
from tensegrity import TensegrityError, check
from tensegrity.engine import native
from tensegrity.notebook import progress
from tensegrity.runs import archive
from tensegrity.runs.sweep import Crew, Failed, keep, require_same

if TYPE_CHECKING:
    from pathlib import Path

    from tensegrity.typing import Array

COARSE = 2.0  # steps of a search over the default ones
IDLE = 30  # batches without a new design, after which a search ends
PART = 16  # chains that one worker is given


@dataclass(frozen=True)
class Problem:
    """What a design is worth: rows of genes -> forces on the wall; sent to workers.

    Attributes
    ----------
    space : Space
    striker : Striker
    wall : Material
    t_end, dt : float
        [s].
    build : callable or None
    """

    space: Space
    striker: Striker
    wall: Material
    t_end: float
    dt: float
    build: Build | None

    def __call__(self, genes: Array) -> Array:
        """Forces [N]; inf where the wave has not arrived before `t_end`."""
        if self.build is None:
            steps = objective.step_count(self.dt, self.t_end, self.dt)
            designs = self.space.designs(genes)
            found = objective.largest(designs, self.striker, self.wall, self.t_end, steps)
            return np.where(np.isfinite(found.first), found.force, np.inf)
        each = (wall_peak(self.build, self.space.beads(x), self.t_end, self.dt) for x in genes)
        return np.array([force for force, _ in each])

    @property
    def part(self) -> int:
        """Designs that one worker is given."""
        return PART if self.build is None else 1

    def at(self, t_end: float, dt: float) -> Problem:
        """The same with another time and step."""
        return Problem(self.space, self.striker, self.wall, t_end, dt, self.build)


def search(
    space: Space,
    *,
    striker: Striker,
    wall: Material,
    t_end: float,
    build: Build | None = None,
    method: str | None = None,
    budget: int = 20000,
    seed: int = 0,
    executor: Executor | None = None,
    checkpoint: str | os.PathLike[str] | None = None,
) -> Best:
    """The design of a space with the least peak force on the wall that a method finds.

    Parameters
    ----------
    space : Order, Sizes or Choice
    striker : Striker
    wall : Material
        Behind a chain; where there is a `build`, of the wall whose force counts.
    t_end : float
        Time from the blow in which the force is looked for [s], > 0.
    build : callable, optional
        Of the beads of a design, gives a scene with a striker and the name of a wall of it, such
        as ``(hexagonal_pack(bead=beads, ...), "floor")``; by default a chain before the wall.
    method : {"ga", "cma", "catcma", "gradient"}, optional
        "ga": a genetic method, for `Order` and `Choice`.  "cma": covariance matrix adaptation, for
        `Sizes`, and by random keys for `Order`.  "catcma": the same for categories, for `Choice`
        and, repaired, for `Order`.  "gradient": from many starts downhill, for `Sizes` of chains,
        see `granular.design.downhill`.  By default "cma" for `Sizes`, else "ga".
    budget : int, optional
        Different designs that are computed at most, at least one population; with "gradient"
        passes, each of which computes one design and its slopes.
    seed : int, optional
        >= 0.  One seed gives one result, whatever computes it.
    executor : concurrent.futures.Executor, optional
        Whose workers compute the designs; see `tensegrity.sweep`.
    checkpoint : str or path, optional
        File that is written after every batch, beside and renamed.  The same search goes on from
        it where it was broken off; a larger budget goes on where a smaller one ended.

    Returns
    -------
    Best
        Also after Ctrl-C, of what was computed until then.

    Raises
    ------
    TensegrityError
        Bad input, before any work; a wave that does not arrive before `t_end` in any design of
        the first batch; a design that cannot be built or whose force is no number; a checkpoint
        of another search.
    CompilerError
        No C compiler, before any work.
    """
    if not isinstance(space, (Order, Sizes, Choice)):
        raise TensegrityError(f"space {check.shown(space)} is not an Order, Sizes or a Choice")
    objective.check_blow(striker, wall)
    t_end = check.number("t_end", t_end, above=0, unit="s")
    if build is not None and not callable(build):
        raise TensegrityError(f"build {check.shown(build)} cannot be called")
    name, propose, population = suits(method, space)
    budget = check.whole("budget", budget, least=1)
    if budget < population:
        raise TensegrityError(
            f"budget {budget} is below one population of {name!r}, {population} designs"
        )
    apart = METHODS[name].propose is starting
    if apart and build is not None:
        raise TensegrityError(f"method {name!r} follows chains before a wall: no build is taken")
    seed = check.whole("seed", seed, least=0)
    unit = float(space.all_kinds.behind(striker.bead).unit(wall, striker.speed)[0])
    dt = t_end / objective.step_count(unit, t_end, COARSE * objective.SHARE * unit)
    native.require()
    problem = Problem(space, striker, wall, t_end, dt, build)
    with Crew(executor) as crew:
        kind = _Descending if apart else _Trail
        trail = kind(problem, crew, budget, checkpoint, name, seed)
        try:
            with progress(budget, "design", trail.kept) as trail.bar:
                trail.follow(propose(space, np.random.default_rng(seed)))
        except KeyboardInterrupt:
            if not trail.forces:
                raise
        return trail.best()


def _parts(data: dict[str, Any]) -> tuple[dict[str, Any], Array, str, Any]:
    """What a checkpoint holds: of what, forces, a digest of their designs, and ways downhill."""
    check.kind("of", data["of"], dict)
    forces = archive.array("forces", data["forces"], (None,), are_finite=False)
    check.kind("digest", data["digest"], str)
    counts, rows = data.get("counts", ()), data.get("rows", ())
    if len(counts) != len(rows) or (len(counts) and np.sum(counts) != len(forces)):
        raise TensegrityError(f"{len(rows)} ways of {np.sum(counts)} forces, of {len(forces)}")
    return data["of"], forces, data["digest"], (counts, rows)


class _Trail:
    """The designs of a search and what they are worth, in memory and in a file."""

    def __init__(
        self, problem: Problem, crew: Crew, budget: int, path: Any, method: str, seed: int
    ) -> None:
        self._problem, self._crew, self._budget = problem, crew, budget
        self._method, self._seed, self.bar = method, seed, None
        self.forces: list[float] = []
        self._known: dict[bytes, float] = {}
        self._top, self._top_forces = np.empty((0, problem.space.count)), np.empty(0)
        self._digest, self.failed = hashlib.sha256(), 0
        self._path: Path | None = None if path is None else check.path("checkpoint", path)
        self._old, self._old_digest = np.empty(0), ""
        self._old_places: Any = (), ()  # of ways downhill
        build = problem.build
        named = "" if build is None else f"{build.__module__}.{getattr(build, '__qualname__', '')}"
        self._of = {
            "space": repr(problem.space), "striker": repr(problem.striker),
            "wall": repr(problem.wall), "t_end": problem.t_end, "dt": problem.dt, "build": named,
            "method": method, "seed": seed,
        }  # fmt: skip
        if self._path is not None and self._path.exists():
            of, *old = archive.read(self._path, "search", _parts)
            require_same(self._path, "search", of, self._of)
            self._old, self._old_digest, self._old_places = old

    @property
    def kept(self) -> int:
        """Designs that the file had."""
        return min(len(self._old), self._budget)

    def follow(self, proposals: Any) -> None:
        """Compute what a method proposes, until it ends or the budget does."""
        rows, idle = next(proposals, None), 0
        while rows is not None:
            before = len(self.forces)
            forces = self._values(rows)
            idle = 0 if len(self.forces) > before else idle + 1
            if len(self.forces) >= self._budget or idle == IDLE:
                return
            try:
                rows = proposals.send(forces)
            except StopIteration:
                return

    def _values(self, rows: Array) -> Any:
        """Forces of rows, those of new ones computed; inf beyond the budget."""
        keys = [row.tobytes() for row in rows]
        new = {key: k for k, key in reversed(list(enumerate(keys))) if key not in self._known}
        numbers = sorted(new.values())[: self._budget - len(self.forces)]
        if numbers:
            self._add([keys[k] for k in numbers], rows[numbers])
        return np.array([self._known.get(key, np.inf) for key in keys])

    def _add(self, keys: list[bytes], rows: Array) -> None:
        begun = len(self.forces)
        forces = self._old[begun : begun + len(rows)]
        for key in keys[: len(forces)]:
            self._digest.update(key)
        if begun < len(self._old) <= begun + len(rows):
            self._require_same_digest()
        fresh = rows[len(forces) :]
        if len(fresh):
            computed = self._computed(self._problem, fresh, begun + len(forces))
            for key in keys[len(forces) :]:
                self._digest.update(key)
            forces = np.concatenate([forces, computed])
        self.forces += forces.tolist()
        self._known.update(zip(keys, forces.tolist(), strict=True))
        every, values = np.concatenate([self._top, rows]), np.append(self._top_forces, forces)
        order = np.argsort(values, kind="stable")[:KEPT]
        self._top, self._top_forces = every[order].astype(rows.dtype), values[order]
        if self.bar is not None:
            self.bar.update(len(fresh))
        if len(fresh) and self._path is not None:
            data = {"of": self._of, "forces": np.array(self.forces)}
            keep(self._path, "search", data | {"digest": self._digest.hexdigest()})
        if not begun and not np.isfinite(forces).any():
            self._refuse_early(rows)

    def _require_same_digest(self) -> None:
        if self._digest.hexdigest() != self._old_digest:
            raise TensegrityError(
                f"checkpoint {self._path}: its designs are not those that this search proposes; "
                "was it written with other versions of the libraries?"
            )

    def _refuse_early(self, rows: Array) -> None:
        problem = self._problem
        if problem.build is None:
            design = problem.space.designs(rows[:1])
            raise objective.not_arrived(0, design, problem.striker, problem.wall, problem.t_end)
        raise TensegrityError(f"no wave reaches the wall before t_end {problem.t_end:g} s")

    def _computed(self, problem: Problem, rows: Array, number: int = 0) -> Array:
        """Forces of rows, in parts where there are workers; `number` is that of the first."""
        size = problem.part if self._crew.is_apart else len(rows)
        parts = [rows[k : k + size] for k in range(0, len(rows), size)]
        forces = np.empty(len(rows))
        for k, result in self._crew.outcomes(problem, parts):
            mine = slice(k * size, (k + 1) * size)
            if isinstance(result, Failed):
                if not result.lost:
                    raise TensegrityError(f"design {number + k * size}: {result.error}")
                self.failed += len(parts[k])
                result = np.full(len(parts[k]), np.inf)
            forces[mine] = result
        if np.isnan(forces).any():
            bad = int(np.argmax(np.isnan(forces)))
            beads = check.shown(problem.space.beads(rows[bad]))
            raise TensegrityError(f"the force of design {number + bad} is nan N: {beads}")
        return forces

    def best(self) -> Best:
        """The best design that does not move with the step, in the longer window too."""
        problem, some = self._problem, np.isfinite(self._top_forces)
        if not some.any():
            raise TensegrityError(f"no design of {len(self.forces)} has a force at the wall")

        def force(t_end: float, dt: float, rows: Array) -> Array:
            return self._computed(problem.at(t_end, dt), rows)

        row, again, converged, rejected = chosen(
            force, problem.t_end, problem.dt, self._top[some], self._top_forces[some]
        )
        return Best(
            beads=problem.space.beads(row), peak_force=again[-2].force,
            evaluations=len(self.forces), history=np.array(self.forces),
            converged_in_time=converged, again=again, rejected=rejected,
            failed=self.failed, method=self._method, seed=self._seed,
        )  # fmt: skip


class _Descending(_Trail):
    """Ways downhill from starts, one after the other however they are computed."""

    def __init__(self, *given: Any) -> None:
        super().__init__(*given)
        problem = self._problem
        space: Any = problem.space
        self._descents = Descents(space, problem.striker, problem.wall, problem.t_end, problem.dt)
        counts, rows = self._old_places
        parts = np.split(self._old, np.cumsum(counts)[:-1]) if len(counts) else []
        self._ways = list(zip(rows, parts, strict=True))  # lowest place and all forces of each
        self._started = 0

    def _values(self, rows: Array) -> tuple[Array, Array]:
        """The lowest place on the way from each start, and its force; inf beyond the budget."""
        begun = self._started
        if not begun and not self._ways and not np.isfinite(self._problem(rows)).any():
            self._refuse_early(rows)
        found, values = rows.copy(), np.full(len(rows), np.inf)
        known = self._ways[begun : begun + len(rows)]
        ways = itertools.chain(known, self._fresh(rows[len(known) :], begun + len(known)))
        for k, (place, forces) in enumerate(ways):
            self._started += 1
            self._digest.update(rows[k].tobytes())
            if self._started == len(self._ways) and k < len(known):
                self._require_same_digest()
            left = self._budget - len(self.forces)
            whole = len(forces) <= left
            if k < len(known):
                lowest = place
            else:
                lowest = place[int(np.argmin(forces[:left]))] if len(forces) else rows[k]
            self.forces += forces[:left].tolist()
            if len(forces):
                found[k], values[k] = lowest, forces[:left].min()
                self._top = np.concatenate([self._top, lowest[None]])
                self._top_forces = np.append(self._top_forces, values[k])
            if k >= len(known):
                self._keep(lowest, forces, whole)
            if len(self.forces) >= self._budget:
                break
        order = np.argsort(self._top_forces, kind="stable")[:KEPT]
        self._top, self._top_forces = self._top[order], self._top_forces[order]
        return found, values

    def _keep(self, lowest: Array, forces: Array, whole: bool) -> None:
        if self.bar is not None:
            self.bar.update(min(len(forces), self.bar.total - self.bar.n))
        if not whole:
            return  # a larger budget goes it again
        self._ways.append((lowest, forces))
        if self._path is not None:
            data = {
                "of": self._of, "forces": np.concatenate([f for _, f in self._ways]),
                "counts": np.array([len(f) for _, f in self._ways]),
                "rows": np.array([row for row, _ in self._ways]),
                "digest": self._digest.hexdigest(),
            }  # fmt: skip
            keep(self._path, "search", data)

    def _fresh(self, rows: Array, number: int) -> Any:
        """Ways from starts in their order; `number` is that of the first."""
        done: dict[int, Way] = {}
        given = 0
        for k, result in self._crew.outcomes(self._descents, list(rows)):
            if isinstance(result, Failed):
                if not result.lost:
                    raise TensegrityError(f"start {number + k}: {result.error}")
                self.failed += 1
                result = Way(rows[:0], np.empty(0))
            done[k] = result
            while given in done:
                yield done.pop(given)
                given += 1
