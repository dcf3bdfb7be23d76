"""Search for the protector with the least peak force on the wall, on one or many machines.

Every batch that a method proposes is computed in parts, in this process or by the workers of an
executor; designs computed before are looked up.  The force of a design does not depend on the part
in which it is computed, so that the result of a seed is independent of the number of workers.
The best designs are verified with finer steps, see `granular.design.finalists`.
"""

from __future__ import annotations

import hashlib
import os
from collections.abc import Iterator
from concurrent.futures import Executor
from dataclasses import replace
from typing import Any

import numpy as np

from granular.beads import Material, Striker
from granular.design import objective
from granular.design.finalists import CANDIDATES, Best, chosen
from granular.design.methods import POPULATION, Descent, Descents, suits
from granular.design.objective import Build, Problem
from granular.design.scatter import Scatter
from granular.design.spaces import Choice, Order, Sizes, Space
from tensegrity import TensegrityError, check
from tensegrity.checked import checked
from tensegrity.engine import native
from tensegrity.notebook import one_bar, progress
from tensegrity.runs import archive
from tensegrity.runs.sweep import Checkpoint, Failed, outcomes, require_executor
from tensegrity.typing import Array, Count, Duration, Index

COARSE = 4.0  # steps of a search of chains over the default ones: they rank designs alike
BUILT = 2.0  # of other scenes, whose beads have more contacts and stiffer modes
IDLE = 30  # batches without a new design, after which a search ends


@checked
def search(
    space: Space,
    *,
    striker: Striker,
    wall: Material,
    t_end: Duration,
    build: Build | None = None,
    scatter: Scatter | None = None,
    method: str | None = None,
    budget: Count = 20000,
    seed: Index = 0,
    executor: Executor | None = None,
    checkpoint: str | os.PathLike[str] | None = None,
) -> Best:
    """Search a space of designs for the least peak force on the wall.

    Parameters
    ----------
    space : Order, Sizes or Choice
    striker : Striker
    wall : Material
        Material of the wall behind the chain; with a `build`, that of the wall of the objective.
    t_end : float
        Time after the impact within which the peak force is determined [s], > 0.
    build : callable, optional
        Maps the beads of a design to a scene with a striker and the name of one of its walls, such
        as ``(hexagonal_pack(bead=beads, ...), "floor")``; by default a chain before the wall.
    scatter : Scatter, optional
        Minimises a quantile of the peak force of chains over random deviations of diameters, gaps
        and speed, the same ones for every design; `Best.peak_force` and `history` are this
        quantile.  It excludes a `build` and the method "gradient".
    method : {"ga", "gradient", "cma"}, optional
        "ga": a genetic algorithm, for `Order` and `Choice`.  "gradient": descents from many
        starting points, for `Sizes` of chains, see `granular.design.methods`.  "cma": covariance
        matrix adaptation, for `Sizes`.  By default "ga" for `Order` and `Choice`, "gradient" for
        `Sizes`, and "cma" for `Sizes` with a `build` or a `scatter`.
    budget : int, optional
        Largest number of different designs to compute, at least one population; with "gradient",
        of evaluations of a design together with its gradient.
    seed : int, optional
        >= 0.  The result depends on the seed only, not on the executor.
    executor : concurrent.futures.Executor, optional
        Its workers compute the designs; see `tensegrity.sweep`.
    checkpoint : str or path, optional
        File that is replaced after every batch.  The same search continues from it after an
        interruption; a larger budget continues where a smaller one ended.

    Returns
    -------
    Best
        After Ctrl-C, the best of the designs computed so far.

    Raises
    ------
    TensegrityError
        Bad input, before any work; a wave that does not arrive before `t_end` in any design of
        the first batch; a design that cannot be built or whose force is no number; a checkpoint
        of another search.
    CompilerError
        No C compiler, before any work.

    Examples
    --------
    >>> from granular import Bead, Striker, materials
    >>> from granular.design import Order, search
    >>> steel = materials["steel"]
    >>> big, small = Bead(10e-3, steel), Bead(4e-3, steel)
    >>> space, striker = Order([big] * 3 + [small] * 3), Striker(big, speed=0.44)
    >>> best = search(space, striker=striker, wall=steel, t_end=1e-3, budget=64)
    >>> "".join("b" if bead is small else "A" for bead in best.beads), f"{best.peak_force:.1f} N"
    ('AbAAbb', '62.7 N')
    """
    if not isinstance(space, (Order, Sizes, Choice)):
        raise TensegrityError(f"space {check.shown(space)} is not an Order, Sizes or a Choice")
    if build is not None and not callable(build):
        raise TensegrityError(f"build {check.shown(build)} cannot be called")
    if scatter is not None and build is not None:
        raise TensegrityError(f"a build excludes {scatter}, of chains before a wall")
    name, propose = suits(method, space, build is not None, scatter is not None)
    if budget < POPULATION:
        raise TensegrityError(
            f"budget {budget} is below one population of {name!r}, {POPULATION} designs"
        )
    unit = float(space.all_kinds.behind(striker.bead).unit(wall, striker.speed)[0])
    longest = _coarse(build) * objective.STEP_FRACTION * unit
    dt = t_end / objective.step_count(unit, t_end, longest)
    native.require()
    problem = Problem(space, striker, wall, t_end, dt, build, scatter)
    require_executor(executor)
    with one_bar("design"):
        trail = _SearchRecord(problem, executor, budget, checkpoint, name, seed)
        try:
            with progress(budget, "design", trail.begun) as trail.bar:
                trail.follow(propose(space, np.random.default_rng(seed)))
        except KeyboardInterrupt:
            if not trail.forces:
                raise
        return trail.best()


def _coarse(build: Build | None) -> float:
    """Steps of a search over the default ones."""
    return COARSE if build is None else BUILT


def _descents(
    forces: Any, digest: Any, count: int, counts: Any = (), rows: Any = ()
) -> tuple[list[tuple[Any, Array]], str]:
    """The best design and the forces of each descent, and the digest, of a file."""
    forces = archive.array("forces", forces, (None,), are_finite=False)
    check.kind("digest", digest, str)
    if len(counts) != len(rows) or (len(counts) and np.sum(counts) != len(forces)):
        raise TensegrityError(f"{len(rows)} descents of {np.sum(counts)} forces, of {len(forces)}")
    if not len(counts):  # of a design each
        return [(None, force) for force in forces[:, None]], digest
    return list(zip(rows, np.split(forces, np.cumsum(counts)[:-1]), strict=True)), digest


class _SearchRecord:
    """The designs of a search and their forces, in memory and in a file.

    Every proposed row gives one design, itself, or all designs of a descent.  The budget counts
    designs.
    """

    def __init__(
        self, problem: Problem, executor: Any, budget: int, path: Any, method: str, seed: int
    ) -> None:
        self._problem, self._executor, self._budget = problem, executor, budget
        self._method, self._seed, self.failed = method, seed, 0
        self.bar: Any = None
        self._leads = Descents(problem) if method == "gradient" else problem
        self.forces: list[float] = []
        self._known: dict[bytes, tuple[Array, float]] = {}  # the best design of each row
        self._whole: list[tuple[Any, int]] = []  # best design of a descent, and count
        self._digest = hashlib.sha256()
        parts = "space", "striker", "wall", "t_end", "dt", "build", "scatter"
        given = {name: getattr(problem, name) for name in parts}
        given |= {"method": method, "seed": seed}
        self._file = Checkpoint(path, "search", given, {}, _descents)
        old: tuple[list[tuple[Any, Array]], str] = self._file.found or ([], "")
        self._old, self._old_digest = old
        self._written = len(self._old)

    @property
    def begun(self) -> int:
        """Number of designs that the file contained."""
        return min(sum(len(forces) for _, forces in self._old), self._budget)

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

    def _values(self, rows: Array) -> tuple[Array, Array]:
        """The best design of each row, and its force; inf beyond the budget."""
        keys = [row.tobytes() for row in rows]
        new = {key: k for k, key in reversed(list(enumerate(keys))) if key not in self._known}
        numbers = sorted(new.values())[: self._budget - len(self.forces)]
        is_first, waiting = not self.forces, iter(numbers)
        for ends in self._descents(rows[numbers]):
            mine = [keys[next(waiting)] for _ in ends]
            for key, descent in zip(mine, ends, strict=True):
                self._take(key, descent)
            self._write()
            if len(self.forces) >= self._budget:
                break
        best = [self._known.get(key, (row, np.inf)) for key, row in zip(keys, rows, strict=True)]
        ends, values = (np.array(x) for x in zip(*best, strict=True))
        if is_first and not np.isfinite(values).any():
            self._refuse_early(rows)
        return ends, values

    def _descents(self, rows: Array) -> Iterator[list[Descent]]:
        """The designs of rows, from the file or computed, in lists that are obtained together."""
        begun = len(self._whole)
        old = self._old[begun : begun + len(rows)]
        yield [
            Descent(np.repeat([row if best is None else best], len(forces), axis=0), forces)
            for row, (best, forces) in zip(rows, old, strict=False)
        ]
        yield from self._computed(self._leads, rows[len(old) :], begun + len(old))

    def _take(self, key: bytes, descent: Descent) -> None:
        """Count a descent, up to the budget."""
        is_fresh = len(self._whole) >= len(self._old)
        forces = descent.forces[: self._budget - len(self.forces)]
        self.forces += forces.tolist()
        best = descent.rows[int(np.argmin(forces))] if len(forces) else None
        if best is not None:
            self._known[key] = best, float(forces.min())
        if is_fresh and self.bar is not None:
            self.bar.update(len(forces))
        if len(forces) == len(descent.forces):  # a larger budget repeats the others
            self._digest.update(key)
            self._whole.append((best, len(forces)))
            if len(self._whole) == len(self._old):
                self._require_same_digest()

    def _write(self) -> None:
        """Write new designs to the file."""
        if not self._file or len(self._whole) <= self._written:
            return
        self._written = len(self._whole)
        rows, counts = zip(*self._whole, strict=True)
        found = {"forces": np.array(self.forces[: sum(counts)]), "digest": self._digest.hexdigest()}
        if isinstance(self._leads, Descents):
            found |= {"counts": np.array(counts), "rows": np.array(rows)}
        self._file.write(**found)

    def _require_same_digest(self) -> None:
        if self._digest.hexdigest() != self._old_digest:
            raise TensegrityError(
                f"checkpoint {self._file.path}: its designs are not those that this search "
                "proposes; was it written with other versions of the libraries?"
            )

    def _refuse_early(self, rows: Array) -> None:
        problem = self._problem
        if problem.build is None:
            design = problem.space.designs(rows[:1])
            raise objective.not_arrived(0, design, problem.striker, problem.wall, problem.t_end)
        raise TensegrityError(f"no wave reaches the wall before t_end {problem.t_end:g} s")

    def _computed(
        self, leads: Problem | Descents, rows: Array, number: int = 0
    ) -> Iterator[list[Descent]]:
        """Ways from rows in their order, in lists of those that one worker computes; `number` is
        that of the first."""
        size = leads.part
        if size > 1 and self._executor is None:
            size = max(1, len(rows))
        parts = [rows[k : k + size] for k in range(0, len(rows), size)]
        done: dict[int, list[Descent]] = {}
        given = 0
        for k, result in outcomes(self._executor, leads, dict(enumerate(parts))):
            if isinstance(result, Failed):
                if not result.lost:
                    raise TensegrityError(f"{leads.unit} {number + k * size}: {result.error}")
                self.failed += len(parts[k])
                result = np.full(len(parts[k]), np.inf)
            if not isinstance(result, Descent):
                pairs = zip(parts[k][:, None], result[:, None], strict=True)
                done[k] = [Descent(*pair) for pair in pairs]
            else:
                done[k] = [result]
            for j, descent in enumerate(done[k]):
                if np.isnan(descent.forces).any():
                    beads = check.shown(self._problem.space.beads(descent.rows[0]))
                    where = number + k * size + j
                    raise TensegrityError(f"the force of {leads.unit} {where} is nan N: {beads}")
            while given in done:
                yield done.pop(given)
                given += 1

    def best(self) -> Best:
        """The best design whose force does not change with the step, also in the longer window."""
        problem, found = self._problem, [x for x in self._known.values() if np.isfinite(x[1])]
        if not found:
            raise TensegrityError(f"no design of {len(self.forces)} has a force at the wall")

        top = sorted(found, key=lambda x: x[1])[:CANDIDATES]
        rows, forces = (np.array(x) for x in zip(*top, strict=True))

        def force(t_end: float, dt: float, rows: Array) -> Array:
            parts = self._computed(replace(problem, t_end=t_end, dt=dt), rows)
            return np.concatenate([descent.forces for ends in parts for descent in ends])

        row, again, converged, rejected = chosen(
            force,
            problem.t_end,
            problem.dt,
            problem.dt / _coarse(problem.build),
            rows,
            forces,
        )
        return Best(
            beads=problem.space.beads(row), peak_force=again[-2].force,
            evaluations=len(self.forces), history=np.array(self.forces),
            converged_in_time=converged, again=again, rejected=rejected,
            failed=self.failed, method=self._method, seed=self._seed,
        )  # fmt: skip
