"""Whole short runs in one call of the compiled loop, and proved afterwards.

What a march looks at block by block is looked at once, at the end: whether all elongations met
were within the domains and not too stiff for the step, whether all numbers are finite, whether no
unlisted contact can have formed.  Where anything of it is not so nothing was done: the march, which
says when and where, has to do it again.  The steps are those of the march, to the last bit.
"""

from __future__ import annotations

import math

import numpy as np

from tensegrity.engine.bonds import by_spring
from tensegrity.engine.bound_line import BoundLine
from tensegrity.engine.bound_net import BoundNet
from tensegrity.engine.methods import Corrected, Splitting
from tensegrity.engine.walk import Course, Plan
from tensegrity.once import once
from tensegrity.runs.guard import Guard
from tensegrity.runs.loops import parts
from tensegrity.runs.record import INSTANTS
from tensegrity.runs.rows import need_memory
from tensegrity.runs.run import Run, changed, known
from tensegrity.runs.stepping import Outlook
from tensegrity.scenes.scene import known_state

SPARE = 4  # prepared loops that a scene keeps for each method: one for each thread at work
LARGEST = 200_000  # numbers in u of a scene that keeps them
KNOWN = 3  # the energies too, when a run was done
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
    coarser : (Whole, float) or None
        The run before it in the same call, and its `largest_gap` from this one.
    """

    complete, coarser = True, None

    def __init__(self, problem, listed, course, met, seen, rows, energy):
        self._problem, self._listed, self._course = problem, listed, course
        self.steps, self.met, self.seen = course.steps, met, seen
        self._rows, self._energy = rows, energy

    @classmethod
    def of_lanes(cls, problem, lanes):
        """Those of the scenes of an ensemble as one."""
        one, scene = lanes[0], problem.scene
        places = np.concatenate([scene.places_of(lane) for lane in range(len(lanes))])
        met = np.concatenate([whole.met for whole in lanes])
        ranges = by_spring(places, len(scene.spring_table), *met.T)
        seen = rows = energy = None
        if one.seen is not None:
            seen = np.stack([whole.seen for whole in lanes], axis=-1)
        if one.has_rows:
            impulses = [whole._rows[1] for whole in lanes]
            rows = (
                np.stack([whole._rows[0] for whole in lanes], axis=-1),
                None if impulses[0] is None else np.stack(impulses, axis=-1),
            )
        if all(whole._energy is not None for whole in lanes):
            each = np.stack([whole._energy for whole in lanes], axis=-1)
            energy = np.array([np.sum(row) for row in each])  # as of the ensemble
        return cls(problem, problem.scene, one._course, ranges, seen, rows, energy)

    @property
    def has_rows(self):
        """Whether rows were kept."""
        return self._rows is not None

    def run(self):
        """The run, with the energies of its rows."""
        problem, ((u, v), impulse) = self._problem, self._rows
        scene, sites, every = problem.scene, problem.record.sites, self._course.every
        t = np.arange(0.0, self.steps + every, every)
        t[-1] = self.steps
        t *= problem.t_end / self.steps
        energy = scene.energies(u, v) if self._energy is None else self._energy
        final = known_state(u[-1].copy(), v[-1].copy())
        listed = self._listed
        fastest = listed.fastest(listed.stiffness_within(self.met)) if scene.follows else None
        if sites is None:
            sites = _sites(scene.sites)
        else:
            u, v = u[:, list(sites)], v[:, list(sites)]
        return known(
            Run, scene=scene, t=t, u=u, v=v, energy=energy, final=final,
            method=problem.method.name, dt=self._course.dt, steps=self.steps, sites=sites,
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
    if not _may_go(problem, steps, most):
        return None
    if problem.moved.in_turn:
        return _in_turn(problem, steps, most, allowed, instants)
    found = _planned(problem, (steps,), allowed, instants)
    return found and found[0]


def two(problem, steps, most, instants):
    """Two runs with steps of their own, of which the second keeps rows; as `whole`, or None."""
    if problem.moved.in_turn or not _may_go(problem, sum(steps), most):
        return None
    return _planned(problem, steps, 1.0, instants)


def _may_go(problem, steps, most):
    """Whether a run can be done at once, as far as can be said before."""
    record, scene, state = problem.record, problem.moved, problem.state
    return (
        0 < steps <= most
        and not scene.is_driven
        and record.is_plain
        and scene.at_once
        and not (scene.follows and not scene.clearance.may_last(state.v, problem.t_end))
    )


def _planned(problem, steps, allowed, instants):
    scene = problem.moved.listed(problem.state.u)
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


def _in_turn(problem, steps, most, allowed, instants):
    """Lanes one after the other, put side by side."""
    scene, found = problem.scene, []
    for lane, one in enumerate(scene.in_turn):
        surrogate = problem.surrogate and problem.surrogate.in_turn[lane]
        state = scene.lane(problem.state, lane)
        alone = changed(
            problem, scene=one, state=state, surrogate=surrogate, trial=True,
            outlook=Outlook(one, state),
        )  # fmt: skip
        found.append(whole(alone, steps, most, allowed, instants))
        if found[-1] is None:
            return None
    return Whole.of_lanes(problem, found)


def prepared(scene, method):
    """A plan for a scene and a method; None where its steps are not in one compiled loop."""
    if not isinstance(method, (Splitting, Corrected)):
        return None
    rest = np.zeros(scene.shape)
    moved = scene.arrays(known_state(rest, rest))
    first, others, close = parts(method)
    loops = []
    for rows, here in ((first if close else None, True), (others, True), (close, False)):
        u, v = moved if here else (np.empty_like(x) for x in moved)
        loops.append(rows and scene.bind(u, v, rows, 1.0))
        if rows and type(loops[-1]) not in (BoundLine, BoundNet):
            return None
    if isinstance(method, Corrected):
        loops[2] = loops[1].show(*(np.empty_like(x) for x in moved))
    return Plan(rest.size, scene.wall_count * scene.dim, scene.energies_at_once, *loops)


def _run(plan, problem, scene, steps, allowed, instants):
    shape, lanes = scene.filled.shape, None
    u, v = problem.state.u, problem.state.v
    if shape != u.shape:  # idle lanes do what the last one does
        lanes = np.s_[..., : u.shape[-1]]
        every_lane = np.minimum(np.arange(shape[-1]), u.shape[-1] - 1)
        u, v = np.ascontiguousarray(u[..., every_lane]), np.ascontiguousarray(v[..., every_lane])
    courses = [_course(problem, scene, plan, shape, instants, n, n == steps[-1]) for n in steps]
    done = plan.run(u, v, *courses)
    if not done:
        return None
    found = []
    for course, met, ranges in zip(courses, plan.met, plan.met_or_rest, strict=False):
        guard = Guard(problem, scene, course.dt, allowed)
        if not (guard.is_known(met) or (guard.is_inside(met) and guard.allows(met))):
            return None
        if problem.scene.clearance is not None and not (
            _is_clear(problem, plan, course.seen) or _is_clear_at_each(problem, plan, course)
        ):
            return None
        rows, seen = course.rows, course.seen and course.seen[0]
        if lanes is not None:
            rows = rows and (np.ascontiguousarray(rows[0][lanes]), None)
            seen = None if seen is None else np.ascontiguousarray(seen[lanes])
        energy = course.energy if done == KNOWN else None
        found.append(Whole(problem, scene, course, ranges.copy(), seen, rows, energy))
    if len(found) > 1:
        found[1].coarser = found[0], plan.gap
    return found


def _course(problem, scene, plan, shape, instants, steps, is_last):
    """Room for what is kept of a run, rows of the last one alone."""
    every, rows, energy, seen = 0, None, None, None
    if problem.rows and is_last:
        every = problem.record.every or max(1, -(-steps // INSTANTS))
        count = -(-steps // every) + 1
        need_memory(count * 2 * math.prod(shape) * 8)
        walls = scene.wall_count
        rows = np.empty((2, count, *shape)), np.zeros((count, walls, *shape[1:])) if walls else None
        if plan.has_energies and not scene.follows and problem.surrogate is None:
            energy = np.empty(count)
    if instants:
        seen = np.empty((2, instants + 1, *shape)), np.empty(instants)
    apart = steps // instants if instants else 0
    return Course(problem.t_end / steps, steps, every, rows, energy, apart, seen)


def _is_clear(problem, plan, seen):
    """Whether no contact that is not listed can have formed."""
    if seen is None:
        u, travel = np.stack([problem.state.u] * 2), np.array([plan.travel])
    else:
        u, travel = seen[0][0], np.diff(seen[1], prepend=0.0)
    return problem.scene.clearance.is_kept(problem.outlook.near, u, travel)


def _is_clear_at_each(problem, plan, course):
    """The same by the same run once more, looked at after each step, which is not taken apart."""
    state, steps = problem.state, course.steps
    if steps * state.u.size > LOOKED:
        return False
    seen, ways = np.empty((2, steps + 1, *state.u.shape)), np.empty(steps)
    plan.run(state.u, state.v, Course(course.dt, steps, 0, None, None, 1, (seen, ways)))
    travel = np.diff(ways, prepend=0.0)
    return problem.scene.clearance.is_kept(problem.outlook.near, seen[0], travel, each=True)
