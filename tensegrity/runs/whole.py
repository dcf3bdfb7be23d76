"""A whole short run in one call of the compiled loop, and proved afterwards.

What a march looks at block by block is looked at once, at the end: whether all elongations met
were within the domains and not too stiff for the step, whether all numbers are finite, whether no
unlisted contact can have formed.  Where anything of it is not so nothing was done: the march, which
says when and where, has to do it again.  The steps are those of the march, to the last bit.
"""

from __future__ import annotations

import math

import numpy as np

from tensegrity.engine.compiled import BoundLine, BoundNet
from tensegrity.engine.methods import Corrected, Splitting
from tensegrity.engine.walk import Plan
from tensegrity.once import once
from tensegrity.runs.guard import Guard
from tensegrity.runs.loops import parts
from tensegrity.runs.record import INSTANTS
from tensegrity.runs.rows import need_memory
from tensegrity.runs.run import Run, known
from tensegrity.scenes.scene import known_state

SPARE = 4  # prepared loops that a scene keeps for each method: one for each thread at work
LARGEST = 200_000  # numbers in u of a scene that keeps them
LOOKED = 4_000_000  # numbers in u at all steps of a run that is looked at after each


class Whole:
    """A run that ended well; a `Run` once that is asked for.

    Attributes
    ----------
    steps : int
    met : ndarray, (springs, 2)
        Smallest and largest elongation met [m], 0 included.
    seen : tuple of ndarray, (instants + 1, *shape)
        u and v at evenly spaced instants.
    """

    complete = True

    def __init__(self, problem, listed, dt, steps, met, seen, every, rows):
        self._problem, self._listed, self._dt = problem, listed, dt
        self.steps, self.met, self.seen, self._every, self._rows = steps, met, seen, every, rows

    @property
    def has_rows(self):
        """Whether rows were kept."""
        return self._rows is not None

    def run(self):
        """The run, with the energies of its rows."""
        problem, ((u, v), impulse) = self._problem, self._rows
        scene, sites = problem.scene, problem.record.sites
        t = np.arange(0.0, self.steps + self._every, self._every)
        t[-1] = self.steps
        t *= problem.t_end / self.steps
        energy, final = scene.energies(u, v), known_state(u[-1].copy(), v[-1].copy())
        listed = self._listed
        fastest = listed.fastest(listed.stiffness_within(self.met)) if scene.follows else None
        if sites is None:
            sites = _sites(scene.sites)
        else:
            u, v = u[:, list(sites)], v[:, list(sites)]
        return known(
            Run, scene=scene, t=t, u=u, v=v, energy=energy, final=final,
            method=problem.method.name, dt=self._dt, steps=self.steps, sites=sites,
            impulse=impulse, force=problem.force, met=self.met, fastest=fastest,
        )  # fmt: skip


@once
def _sites(count):
    return tuple(range(count))


def whole(problem, steps, most, allowed=1.0, instants=0):
    """Run with one step, or None where it has to be done with care.

    Parameters
    ----------
    problem : Problem
    steps : int
    most : int
        Steps that may go together.
    allowed : float
        Share of the stability limit.
    instants : int
        Evenly spaced ones to be compared with other runs, besides the first.

    Returns
    -------
    Whole or None
    """
    record, scene, state = problem.record, problem.moved, problem.state
    if (
        not 0 < steps <= most
        or scene.is_driven
        or not (record.is_plain and scene.at_once)
        or (scene.follows and not scene.clearance.may_last(state.v, problem.t_end))
    ):
        return None
    scene = scene.listed(state.u)
    plans = scene.remembered.plans.setdefault(problem.method, [])
    try:
        plan = plans.pop()
    except IndexError:
        plan = prepared(scene.filled, problem.method)
    if plan is None:
        return None
    try:
        return _run(plan, problem, scene, steps, allowed, instants)
    finally:
        if len(plans) < SPARE and math.prod(scene.shape) <= LARGEST:
            plans.append(plan)


def prepared(scene, method):
    """A plan for a scene and a method; None where its steps are not in one compiled loop."""
    if not isinstance(method, (Splitting, Corrected)):
        return None
    rest = np.zeros(scene.shape)
    moved = scene.arrays(known_state(rest, rest))
    first, others, close = parts(method)
    enter, leave = method.processor or (None, None)
    each = (enter, True), (first if close else None, True), (others, True)
    loops = []
    for rows, here in (*each, (close, False), (leave, False)):
        u, v = moved if here else (np.empty_like(x) for x in moved)
        loops.append(rows and scene.bind(u, v, rows, 1.0))
        if rows and type(loops[-1]) not in (BoundLine, BoundNet):
            return None
    if isinstance(method, Corrected):
        loops[3] = loops[2].show(*(np.empty_like(x) for x in moved))
    return Plan(rest.size, scene.wall_count * scene.dim, *loops)


def _run(plan, problem, scene, steps, allowed, instants):
    shape, lanes = scene.filled.shape, None
    u, v = problem.state.u, problem.state.v
    if shape != u.shape:  # idle lanes do what the last one does
        lanes = np.s_[..., : u.shape[-1]]
        every_lane = np.minimum(np.arange(shape[-1]), u.shape[-1] - 1)
        u, v = np.ascontiguousarray(u[..., every_lane]), np.ascontiguousarray(v[..., every_lane])
    dt, every, rows, seen, ways = problem.t_end / steps, 0, None, None, None
    if problem.rows:
        every = problem.record.every or max(1, -(-steps // INSTANTS))
        count = -(-steps // every) + 1
        need_memory(count * 2 * u.nbytes)
        walls = scene.wall_count
        rows = np.empty((2, count, *shape)), np.zeros((count, walls, *shape[1:])) if walls else None
    if instants:
        seen, ways = np.empty((2, instants + 1, *shape)), np.empty(instants)
    apart, looks = (steps // instants, (seen, ways)) if instants else (0, None)
    if not plan.run(dt, steps, u, v, every, rows, apart, looks):
        return None
    if lanes is not None:
        rows = rows and (np.ascontiguousarray(rows[0][lanes]), None)
        seen = None if seen is None else np.ascontiguousarray(seen[lanes])
    met = plan.met
    guard = Guard(problem, scene, dt, allowed)
    if not (guard.is_known(met) or (guard.is_inside(met) and guard.allows(met))):
        return None
    if problem.scene.clearance is not None and not (
        _is_clear(problem, plan, seen, ways) or _is_clear_at_each(problem, plan, dt, steps)
    ):
        return None
    np.minimum(met[:, 0], 0, out=met[:, 0])
    np.maximum(met[:, 1], 0, out=met[:, 1])
    return Whole(problem, scene, dt, steps, met, seen, every, rows)


def _is_clear(problem, plan, seen, ways):
    """Whether no contact that is not listed can have formed."""
    if seen is None:
        u, travel = np.stack([problem.state.u] * 2), np.array([plan.travel])
    else:
        u, travel = seen[0], np.diff(ways, prepend=0.0)
    return problem.scene.clearance.is_kept(problem.outlook.near, u, travel)


def _is_clear_at_each(problem, plan, dt, steps):
    """The same by the same run once more, looked at after each step, which is not taken apart."""
    state = problem.state
    if steps * state.u.size > LOOKED:
        return False
    seen, ways = np.empty((2, steps + 1, *state.u.shape)), np.empty(steps)
    plan.run(dt, steps, state.u, state.v, 0, None, 1, (seen, ways))
    travel = np.diff(ways, prepend=0.0)
    return problem.scene.clearance.is_kept(problem.outlook.near, seen[0], travel, each=True)
