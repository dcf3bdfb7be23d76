"""One run with one step: at once where it is short, else the compiled loop, block by block."""

from __future__ import annotations

import time

import numpy as np

from tensegrity.errors import ContactError, LockingError, RecordError, StabilityError
from tensegrity.progress import progress
from tensegrity.runs.book import Book, Checks, Kept
from tensegrity.runs.guard import Guard
from tensegrity.runs.watch import Watch
from tensegrity.runs.whole import two, whole

BLOCK = 2_000_000  # bonds x stages x steps in one call of the loop: about 5 ms
STRIDE = 4  # blocks in one call with its rows: an interrupt waits no longer
WHOLE = 4  # such calls in one, where all of a run is done at once
FEWEST = 100  # steps in one call: the pieces of a long chain work apart for some tens


def together(problem):
    """Steps that go in one block."""
    return max(FEWEST, BLOCK // (problem.scene.cost * problem.method.stages))


def march(problem, steps, allowed, checkpoints=0, start=None):
    """Run with one step, watching that it stays below `allowed` of the stability limit.

    Parameters
    ----------
    problem : Problem
    steps : int
    allowed : float
    checkpoints : int, optional
    start : Start, optional
        Where a run that was broken off goes on.

    Returns
    -------
    run : Run
        Or `Whole`, of a trial.
    checks : tuple of ndarray
        u and v of all sites at `checkpoints` + 1 evenly spaced instants, which `steps` is a
        multiple of.
    """
    stopped = False
    if start is None:
        try:
            found = whole(problem, steps, WHOLE * STRIDE * together(problem), allowed, checkpoints)
            if found is not None:
                return found if problem.trial else found.run(), found.seen
        except KeyboardInterrupt:
            stopped = True
        refuse_start(problem, steps)
    return _march(problem, steps, allowed, checkpoints, start, stopped)


def march_twice(problem, steps, checkpoints):
    """Two runs of a trial in one call, or None where each has to be done with care.

    Parameters
    ----------
    problem : Problem
        That keeps rows does so of the second run.
    steps : (int, int)
        Of the one and of the other.
    checkpoints : int

    Returns
    -------
    list of (Whole or Run, tuple of ndarray)
        As of `march`; the first alone, not complete, where it was interrupted.
    """
    try:
        found = two(problem, steps, WHOLE * STRIDE * together(problem), checkpoints)
    except KeyboardInterrupt:
        return [_march(problem, steps[0], 1.0, checkpoints, None, True)]
    return found and [(run, run.seen) for run in found]


def refuse_start(problem, steps):
    """Refuse a step that was given and is not stable as the run begins."""
    if problem.choice != "dt" or not steps:
        return
    scene, dt = problem.scene.listed(problem.state.u), problem.t_end / steps
    present = scene.present_ranges(problem.state.u)
    if Guard(problem, scene, dt, 1.0).is_known(present):
        return
    limit = problem.largest_step(scene.frequency(present))
    if dt > limit:
        raise StabilityError(
            f"{problem.step_words(dt)} is beyond {limit:.6g} s, the stability limit of "
            f"{problem.method.name} in the initial state"
        )


def _march(problem, steps, allowed, checkpoints, start, stopped):
    """The same with care, or not at all where it was stopped before."""
    scene, seconds = problem.scene, problem.record.checkpoint
    watch = Watch(problem, problem.t_end / steps if steps else 0.0, allowed, start)
    book = Book(problem, watch, steps, start and start.count)
    checks = Checks(scene.shape, steps, checkpoints)
    largest = together(problem)
    since, failure, careful = time.monotonic(), None, 0
    book.keep_state()
    try:
        with progress(steps, "step") as bar:
            while True:
                if stopped:
                    raise KeyboardInterrupt
                done = watch.sound.done
                bar.update(done - bar.n)
                book.catch_up()
                checks.catch_up(watch)
                if done == steps:
                    break
                if seconds is not None and time.monotonic() - since > seconds:
                    book.keep_state()
                    since = time.monotonic()
                if done >= careful and _stride(
                    watch, book, checks, min(steps - done, STRIDE * largest)
                ):
                    continue
                careful = max(careful, min(steps, done + STRIDE * largest))
                stop = min(book.stop(), checks.stop())
                watch.advance(min(stop - done, largest))
        book.keep_state()
        return book.run(complete=True), checks.rows
    except KeyboardInterrupt:
        pass
    except (ContactError, LockingError, StabilityError, RecordError) as error:
        failure = error
    run, failure = book.broken_off(failure)
    if failure is None:
        return run, checks.rows
    failure.run = run
    raise failure


def _stride(watch, book, checks, steps):
    """Do steps with their rows in one call, at most `steps`; whether any was done."""
    if not (steps > 0 and book.can_wait() and watch.strides()):
        return False
    while True:
        steps = min(steps, watch.most())
        end = watch.sound.done + steps
        rows, seen = book.ahead(end), checks.ahead(end)
        if rows is None:
            return False
        if watch.stride(end, book.room(rows) if not len(seen) else _room(watch, rows, seen)):
            return True
        if steps <= max(watch.most(), 1):  # not for want of a look for new contacts
            return False


def _room(watch, rows, seen):
    """Room for rows and what is compared, in one order."""
    dense = len(rows) and len(rows) == rows[-1] - rows[0] + 1
    at = rows if dense and rows[0] <= seen[0] and seen[-1] <= rows[-1] else np.union1d(rows, seen)
    state, impulse = watch.look()
    each = state.u.shape, state.v.shape, impulse.shape
    return Kept(at, *(np.empty((len(at), *shape)) for shape in each))
