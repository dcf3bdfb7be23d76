"""One function applied to many cases, in this process or on the workers of any
`concurrent.futures.Executor`.

A case that raises an error becomes a failed case and the others continue; only a missing C
compiler, which concerns all cases, ends the sweep.  The case of a worker that dies is repeated
once, alone where a pool of processes broke, and counts as failed if its worker dies again.
"""

from __future__ import annotations

import os
import pickle
import time
from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from concurrent.futures import FIRST_COMPLETED, Executor, Future, ProcessPoolExecutor, wait
from concurrent.futures.process import BrokenProcessPool
from contextlib import ExitStack
from dataclasses import dataclass
from functools import partial
from itertools import islice
from typing import Any

import numpy as np

from tensegrity import check
from tensegrity.errors import CompilerError, TensegrityError
from tensegrity.notebook import progress
from tensegrity.runs import archive
from tensegrity.runs.identity import Identities, described

AHEAD = 1024  # parts of the cases submitted to an executor at a time
TOGETHER, MOST_TOGETHER = 0.01, 100  # time of the cases that are sent together [s], their number
NAMED = 1000  # characters of a case that a checkpoint stores to identify it
WRITING = 0.1  # fraction of the time that writing checkpoints may take


@dataclass(frozen=True)
class Failed:
    """A case without a result.

    Attributes
    ----------
    number : int
        Number of the case, from 0.
    error : str
        Name and message of the error that the case raised or by which its worker was lost.
    lost : bool
        Whether the worker was lost.
    """

    number: int
    error: str
    lost: bool = False


archive.register(Failed)


def sweep(
    function: Callable[[Any], Any],
    cases: Iterable[Any],
    executor: Executor | None = None,
    checkpoint: str | os.PathLike[str] | None = None,
) -> list[Any]:
    """Apply a function to each of many cases.

    Parameters
    ----------
    function : callable
        A function of one case.  For a pool of processes it must be importable by other processes.
    cases : iterable
    executor : concurrent.futures.Executor, optional
        Its workers compute the cases: a pool of processes or threads,
        `dask.distributed.Client.get_executor()`, `mpi4py.futures.MPIPoolExecutor`.  By default
        the cases are computed one after the other in this process.
    checkpoint : str or path, optional
        File to which results are saved as they are obtained, replaced as a whole each time.  The
        same call with this file continues an interrupted sweep, also with cases appended to the
        list or removed from its end.  Cases are known by their contents, a function by its code
        (of this version of Python), its defaults, and the values that it captures or uses of its
        module, also in functions that it calls there; of installed packages by its name.  Results
        must be numbers, text, None, arrays, or sequences and dicts of these; sequences are
        returned as tuples.  Two sweeps may share a file: each saves what it has itself.

    Returns
    -------
    list
        The result of each case in order; a `Failed` where the case raised an error, or its worker
        died twice.

    Raises
    ------
    TensegrityError
        A function that cannot be called or sent to other processes; not an executor; a checkpoint
        of other cases or another function; with a checkpoint, cases or a function that have no
        contents to know them by, such as an open file.  With a checkpoint, the first result that it
        cannot store ends the sweep.
    CompilerError
        A case that integrates in time found no C compiler.

    Examples
    --------
    >>> from tensegrity import sweep
    >>> sweep(abs, [-1, 2, "x"])
    [1, 2, Failed(number=2, error="TypeError: bad operand type for abs(): 'str'", lost=False)]
    """
    if not callable(function):
        raise TensegrityError(f"function {check.shown(function)} cannot be called")
    cases = check.sequence("cases", cases, "cases")
    require_executor(executor)
    so_far = _Results(checkpoint, function, cases)
    left = {k: case for k, case in enumerate(cases) if k not in so_far.found}
    with progress(len(cases), "case", len(cases) - len(left)) as bar:
        try:
            for number, result in outcomes(executor, function, left):
                so_far.add(number, result)
                bar.update()
        finally:
            so_far.write()
    return [so_far.found[k] for k in range(len(cases))]


class _Results:
    """Results obtained so far, in memory and in a file."""

    def __init__(self, path: Any, function: Any, cases: Sequence[Any]) -> None:
        numbered = {f"case {k}": x for k, x in enumerate(cases)}
        self._file = Checkpoint(path, "sweep", {"function": function}, numbered, _by_number)
        self.found: dict[int, Any] = self._file.found or {}
        self._fresh, self._due = False, 0.0

    def add(self, number: int, result: Any) -> None:
        """Store a result, and write the file unless writing takes too large a fraction of time."""
        if self._file and not archive.holds(result):
            raise TensegrityError(
                f"the result of case {number} is {check.shown(result)}, which a checkpoint "
                "cannot store: return numbers, text or arrays, such as the columns of a path, or "
                "leave out the checkpoint"
            )
        self.found[number], self._fresh = result, True
        if time.monotonic() >= self._due:
            self.write()

    def write(self) -> None:
        """Write the file if there are new results."""
        if self._file and self._fresh:
            began, numbers = time.monotonic(), sorted(self.found)
            self._file.write(numbers=numbers, results=[self.found[k] for k in numbers])
            self._due = time.monotonic() + (time.monotonic() - began) / WRITING
        self._fresh = False


def _by_number(numbers: Any, results: Any, count: int) -> dict[int, Any]:
    """The results in a file by the numbers of their cases."""
    numbers = [check.whole("number", k, least=0, below=count - 1) for k in numbers]
    return dict(zip(numbers, results, strict=True))


class Checkpoint:
    """A file of what a computation has found so far, which only the same computation continues.

    Parameters
    ----------
    path : str or path, or None
        None for no file: such a checkpoint is false.
    kind : str
        "sweep" or "search".
    given : dict
        Functions and arguments by their names in messages: the file knows a computation by the
        identity and the printed form of each.
    further : dict
        The same for what either may have more of.
    make : callable
        Makes `found` of what `write` stored, and of `count`, the number of all that is given; it
        raises an error where these do not fit.

    Attributes
    ----------
    found : object
        What `make` returned, or None where there is no such file yet.

    Raises
    ------
    TensegrityError
        Something given that has no identity; a path without a folder; a file that is damaged, or
        of another computation, which names the first difference.
    """

    def __init__(
        self,
        path: Any,
        kind: str,
        given: Mapping[str, Any],
        further: Mapping[str, Any],
        make: Callable[..., Any],
    ) -> None:
        self.path, self._kind = path, kind
        self.found: Any = None
        if path is None:
            return
        self.path = check.path("checkpoint", path)
        if not self.path.parent.is_dir():
            raise TensegrityError(f"checkpoint {path}: there is no folder {self.path.parent}")
        self._of, identities = dict[str, tuple[str, str]](), Identities()
        for name, value in {**given, **further}.items():
            try:
                self._of[name] = identities.of(value), described(value)[:NAMED]
            except TensegrityError as error:
                raise TensegrityError(
                    f"no checkpoint can know the {name} of a {kind}: {error}"
                ) from error
        if self.path.exists():
            of, self.found = archive.read(self.path, kind, partial(_of_file, make))
            self._require_same(of, further)
            self._of = of | self._of

    def __bool__(self) -> bool:
        return self.path is not None

    def _require_same(self, of: Mapping[str, tuple[str, str]], further: Mapping[str, Any]) -> None:
        for name, (now, text) in self._of.items():
            was, printed = of.get(name, (now, text) if name in further else ("", "missing"))
            if was == now:
                continue
            words = "printed as here, but has other contents or other code"
            if printed != text:
                words = "{}, here {}".format(*check.differing(printed, text))
            raise TensegrityError(
                f"checkpoint {self.path} is of another {self._kind}: its {name} is {words}"
            )

    def write(self, **found: Any) -> None:
        """Replace the file as a whole.

        Raises
        ------
        TensegrityError
            It cannot be written; the one before stays.
        """
        archive.write(self.path, self._kind, {"of": self._of, **found})


def _of_file(make: Callable[..., Any], data: dict[str, Any]) -> tuple[dict[str, Any], Any]:
    """What a checkpoint is of, and what it has found."""
    of = data.pop("of")
    check.kind("of", of, dict)
    for name, pair in of.items():
        if not (isinstance(pair, tuple) and [*map(type, pair)] == [str, str]):
            raise TensegrityError(f"{name} {check.shown(pair)} is no identity")
    return of, make(**data, count=len(of))


def require_executor(executor: Any) -> None:
    """Refuse what cannot take cases, unless it is None."""
    if executor is not None and not isinstance(executor, Executor):
        raise TensegrityError(
            f"executor {check.shown(executor)} is not a concurrent.futures.Executor"
        )


def outcomes(
    executor: Any, function: Callable[[Any], Any], cases: Mapping[int, Any]
) -> Iterator[tuple[int, Any]]:
    """Results of a function of each case, as they are obtained.

    Parameters
    ----------
    executor : concurrent.futures.Executor or None
        None computes the cases one after the other in this thread.
    function : callable
    cases : mapping of int
        The cases by their numbers.

    Yields
    ------
    (int, object)
        Number and result, or a `Failed`, in the order of completion.

    Raises
    ------
    TensegrityError
        A function that cannot be sent to other processes.
    CompilerError
        A case found no C compiler.
    """
    if executor is None:
        for pair in cases.items():
            yield _attempt(function, *pair)
        return
    ahead = AHEAD
    if isinstance(executor, ProcessPoolExecutor):
        ahead = 2 * (os.cpu_count() or 1) + 2  # if one process dies, all of these are lost
        _require_sendable(function)
    left, waiting, size = iter(cases.items()), len(cases), 1
    running: dict[Future[Any], list[tuple[int, Any]]] = {}
    with ExitStack() as own:
        own.callback(lambda: [future.cancel() for future in running])
        while waiting or running:
            while waiting and len(running) < ahead:
                fair = -(-waiting // ahead)  # so that all workers end together
                some = list(islice(left, min(size, fair)))
                waiting -= len(some)
                try:
                    future = executor.submit(_attempted, function, some)
                except BrokenProcessPool:
                    executor = own.enter_context(ProcessPoolExecutor())
                    future = executor.submit(_attempted, function, some)
                running[future] = some
            for future in wait(running, return_when=FIRST_COMPLETED).done:
                some, error = running.pop(future), future.exception()
                if isinstance(error, CompilerError):
                    raise error
                if error is None:
                    results, seconds = future.result()
                    size = int(np.clip(TOGETHER * len(some) / max(seconds, 1e-9), 1, MOST_TOGETHER))
                else:  # an error of the worker; those of the function are caught in `_attempt`
                    results = _repeated(executor, function, some)
                yield from results


def _repeated(executor: Any, function: Any, some: list[tuple[int, Any]]) -> list[tuple[int, Any]]:
    """Results of cases whose worker was lost, computed again, together and, if they are lost again,
    one by one; where they could break a pool, in one of their own."""
    try:
        with ExitStack() as own:
            if isinstance(executor, ProcessPoolExecutor):
                executor = own.enter_context(ProcessPoolExecutor(1))
            found: list[tuple[int, Any]] = executor.submit(_attempted, function, some).result()[0]
            return found
    except CompilerError:
        raise
    except Exception as error:
        if len(some) > 1:
            return [one for pair in some for one in _repeated(executor, function, [pair])]
        number = some[0][0]
        return [(number, Failed(number, f"{type(error).__name__}: {error}", lost=True))]


def _require_sendable(function: Callable[[Any], Any]) -> None:
    try:
        pickle.dumps(function)
    except Exception as error:
        raise TensegrityError(
            f"function {check.shown(function)} cannot be sent to other processes: {error}"
        ) from error


def _attempted(function: Callable[[Any], Any], some: list[tuple[int, Any]]) -> Any:
    """(number, result or `Failed`) of some cases, and the time that they take [s]."""
    began = time.monotonic()
    return [_attempt(function, *pair) for pair in some], time.monotonic() - began


def _attempt(function: Callable[[Any], Any], number: int, case: Any) -> tuple[int, Any]:
    try:
        return number, function(case)
    except CompilerError:
        raise
    except Exception as error:
        return number, Failed(number, f"{type(error).__name__}: {error}")
