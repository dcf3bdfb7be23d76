"""Domain decomposition: long chains and large networks in parts, on a pool of threads.

Each stage propagates the error at the cut ends of a part of a chain by one site, so a halo as wide
as the stages of a few steps keeps the part itself correct.  Parts and halos begin and end where the
loop of the whole chain begins a block, so every bond is computed by the same instructions on the
same numbers.  A part of a network computes again the forces on its sites by contacts that belong to
earlier parts.  The result therefore equals that of one loop to the bit, for any number of threads.
"""

from __future__ import annotations

import ctypes
import os
import warnings
from concurrent.futures import ThreadPoolExecutor, wait
from contextlib import suppress
from dataclasses import replace
from functools import cache, partial
from threading import Event, Lock, Thread
from weakref import ref

import numpy as np

from tensegrity import check
from tensegrity.engine.bonds import BLOCK
from tensegrity.engine.bound import Bound
from tensegrity.engine.march import STEPS
from tensegrity.errors import TensegrityError

HALO = 4 * BLOCK
PIECE = 512 * BLOCK  # bonds of a part: two arrays of them fit into the cache of one processor
LONG = 2 * PIECE  # least entries of a chain that is divided
WORTH = 500_000  # least forces of bonds, about half a millisecond, that are divided
MANY = 20_000  # least contacts of a network that is divided


def threads() -> int:
    """Threads used for large scenes: $TENSEGRITY_THREADS, or one per available processor.

    A larger number than that of processors is reduced to it, with a warning.
    """
    given, most = os.environ.get("TENSEGRITY_THREADS", "").strip(), processors()
    if not given:
        return most
    if not (given.isascii() and given.isdigit() and given.strip("0")):
        raise TensegrityError(
            f"TENSEGRITY_THREADS {check.shown(given)} must be a whole number, at least 1"
        )
    digits = given.lstrip("0")
    if len(digits) <= len(str(most)) and int(digits) <= most:
        return int(digits)
    warnings.warn(
        f"TENSEGRITY_THREADS {check.shown(given)} exceeds the number of available processors: "
        f"{most} threads are used",
        RuntimeWarning,
        stacklevel=2,
    )
    return most


def processors() -> int:
    """Number of processors that this process may use."""
    if hasattr(os, "sched_getaffinity"):
        return len(os.sched_getaffinity(0))
    return os.cpu_count() or 1


@cache
def _pool(count, work="parts of a scene"):
    return ThreadPoolExecutor(count, thread_name_prefix="tensegrity")


def each(function, items, work):
    """Results of a function of each item, in order; several at a time where there are threads.

    Parameters
    ----------
    function : callable
        Of one item; what it computes must not depend on the other items.
    items : sequence
    work : int
        Forces or energies of bonds to be computed in all; a few are not worth a second thread.

    Returns
    -------
    list

    Raises
    ------
    Exception
        The first error by the order of the items, once no item is being computed any more.
    """
    count = min(threads(), len(items)) if work > WORTH else 1
    if count < 2:
        return [function(item) for item in items]
    jobs = [_pool(count, "scenes").submit(function, item) for item in items]
    try:
        wait(jobs)
    finally:  # after Ctrl-C too: nobody writes to arrays that the caller uses again
        for job in jobs:
            job.cancel()
        while not all(job.done() for job in jobs):
            with suppress(KeyboardInterrupt):
                wait(jobs)
    return [job.result() for job in jobs]


_pool_lock = Lock()  # its holder uses all threads of the pool


def _forget_threads():
    """Renew pool and lock in a forked process, which has no other threads."""
    global _pool_lock
    _pool.cache_clear()
    _pool_lock = Lock()


if hasattr(os, "register_at_fork"):
    os.register_at_fork(after_in_child=_forget_threads)


class Threaded(Bound):
    """A scene advanced in place on several threads.

    `march.c` advances it by calling a function of Python, which distributes the work.  This runs on
    a thread of its own, so that Ctrl-C, which the main thread receives, does not interrupt it.
    """

    def _take_threads(self, count):
        self._pool, self._count, self._failure = _pool(count), count, None
        loop = ref(self)  # no cycle, which would hold the arrays of a run until it is found
        self._called = STEPS(lambda *given: loop()._called_by_march(*given))
        self._march = self._marched(self._called)
        self._march_at = ctypes.addressof(self._march)

    def go(self, done, end, wanted=()):
        """Advance and store states; see `Bound.go`.

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
        Exception
            The error of a worker thread.
        """
        status = []
        worker = Thread(target=lambda: status.append(super(Threaded, self).go(done, end, wanted)))
        worker.start()
        try:
            worker.join()
        finally:
            while worker.is_alive():
                with suppress(KeyboardInterrupt):
                    worker.join()
        failure, self._failure = self._failure, None
        if failure is not None:
            raise failure
        return status[0]

    def _called_by_march(self, scene, method, steps, opened):
        try:
            self.advance_open(steps, bool(opened))
        except BaseException as error:  # an exception cannot pass through C
            self._failure = error
            return 1
        return 0


class ThreadedChain(Threaded):
    """A chain advanced in place, in parts.

    Parameters
    ----------
    loop : Compiled
    u, v : ndarray, (sites,)
    bonds : Bonds
    method : Splitting
    dt : float
        [s]
    count : int
        Number of threads.
    """

    def __init__(self, loop, u, v, bonds, method, dt, count) -> None:
        self._together = (HALO - 2) // method.stages  # steps between two exchanges
        total = len(bonds.group)
        pieces = count * -(-total // (count * PIECE))
        ends = [start_of_block(bonds.runs.first, total * k // pieces) for k in range(pieces)]
        self._parts = [
            _Subdomain(loop, u, v, bonds, method, dt, start, stop)
            for start, stop in zip(ends, [*ends[1:], total], strict=True)
        ]
        super().__init__(loop, u, v, bonds, method, dt)
        self._take_threads(count)

    def set_step(self, dt):
        """Change the length of the steps [s]."""
        super().set_step(dt)
        for piece in self._parts:
            piece.loop.set_step(dt)

    def go(self, done, end, wanted=()):
        """Advance and store states.

        Parameters
        ----------
        done, end, wanted
            As of `Bound.go`.

        Returns
        -------
        int
        """
        for piece in self._parts:
            piece.loop.forget()
        return super().go(done, end, wanted)

    def forget(self):
        """Reset the elongation ranges; see `Bound.forget`."""
        for loop in (super(), *(piece.loop for piece in self._parts)):
            loop.forget()

    def widen(self, ranges):
        """Widen ranges of elongation; see `Bound.widen`."""
        for loop in (super(), *(piece.loop for piece in self._parts)):
            loop.widen(ranges)
        return ranges

    def advance_open(self, steps, opened):
        """Advance without the closing kick; see `Bound.advance_open`."""
        done = 0
        while done < steps:
            part = min(self._together, steps - done)
            advance = partial(_Subdomain.advance, steps=part, opened=done > 0 or opened)
            for work in (advance, _Subdomain.give):  # all read before any writes
                list(self._pool.map(work, self._parts))
            done += part


class ThreadedNetwork(Threaded):
    """A network advanced in place, one part on each thread.

    The threads wait for each other in every stage, so all must run at the same time: one network
    uses the pool, and any other is advanced undivided meanwhile, with the same result.
    """

    def __init__(self, loop, u, v, bonds, method, dt, count) -> None:
        super().__init__(loop, u, v, bonds, method, dt, count)
        self._take_threads(count)

    def advance_open(self, steps, opened):
        """Advance without the closing kick; see `Bound.advance_open`."""
        if not _pool_lock.acquire(blocking=False):
            super().advance_open(steps, opened)
            return
        begin, jobs, complete = Event(), [], []

        def advance_part(number):
            begin.wait()
            if complete:  # otherwise other threads are missing
                piece = ctypes.addressof(self._pieces[number])
                self._loop.library.advance_together(piece, steps, opened)

        try:
            jobs += [self._pool.submit(advance_part, k) for k in range(self._count)]
            complete.append(True)
        finally:
            begin.set()
            wait(jobs)
            _pool_lock.release()
        for one in jobs:
            one.result()


class _Subdomain:
    """Bonds from `start` to `stop` of a chain, with a halo on either side."""

    def __init__(self, loop, u, v, bonds, method, dt, start, stop) -> None:
        runs, total = bonds.runs, len(bonds.group)
        low = start_of_block(runs.first, max(start - HALO, 0), down=True)
        high = min(start_of_block(runs.first, min(stop + HALO, total)), total)
        inside = {int(x) for x in runs.first if low < x < high}
        edges = np.array(sorted({low, start, stop, high} | inside))
        parent = np.searchsorted(runs.first, edges[:-1], side="right") - 1
        part = replace(
            runs, first=edges, law=runs.law[parent], own=runs.own[parent], kind=runs.kind[parent]
        )
        self._globals, self._sites = (u, v), slice(low, high + 1)
        self._local = u[self._sites].copy(), v[self._sites].copy()
        weights = replace(bonds, inverse_mass=bonds.inverse_mass[self._sites])
        mine = (edges[:-1] >= start) & (edges[:-1] < stop)
        self.loop = Bound(loop, *self._local, weights, method, dt, runs=part, seen=mine)
        self._mine = slice(start, stop + (stop == total))
        self._inner = slice(start - low, self._mine.stop - low)

    def advance(self, steps, opened):
        """Read the state of the chain, and advance some steps."""
        for local, whole in zip(self._local, self._globals, strict=True):
            local[:] = whole[self._sites]
        self.loop.advance_open(steps, opened)

    def give(self):
        """Write back the state without the halo."""
        for local, whole in zip(self._local, self._globals, strict=True):
            whole[self._mine] = local[self._inner]


def start_of_block(first, bond, down=False):
    """The nearest bond on one side at which a block of the loop begins.

    In a run the loop begins with an incomplete block, if its length is no multiple of a block.

    Parameters
    ----------
    first : ndarray of int, (runs + 1,)
        First bond of each run.
    bond : int
    down : bool, optional
        Whether the result must not be above `bond`; otherwise it is not below.

    Returns
    -------
    int
    """
    if bond >= first[-1]:
        return int(first[-1])
    s = int(np.searchsorted(first, bond, side="right")) - 1
    start, stop = int(first[s]), int(first[s + 1])
    odd = (stop - start) % BLOCK
    place = bond - start
    if place == 0:
        return bond
    if place <= odd:
        return start if down else start + odd
    blocks = (place - odd) // BLOCK if down else -(-(place - odd) // BLOCK)
    return start + odd + blocks * BLOCK
