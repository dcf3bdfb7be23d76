"""Whatever befalls a run while it records: what it wrote is whole, and ends where the run does."""

import math
import os
import subprocess
import sys

import numpy as np
import pytest
from scenes import prism_chain, smooth_blow

import tensegrity
from tensegrity import (
    Chain,
    Prism,
    Record,
    StabilityError,
    State,
    TensegrityError,
    resume,
    simulate,
)

HERE, PACKAGE = os.path.dirname(__file__), os.path.dirname(tensegrity.__file__)
ROW = 8 * (2 + 2 * 20)  # bytes of a row of 20 sites


def run(path=None, **options):
    chain = prism_chain(20)
    record = Record(path=path, **(options or {"every": 2}))
    return simulate(chain, smooth_blow(chain), 1.0, dt=0.1, method="verlet", record=record)


LIMITED = """
import resource, sys
import numpy as np
from scenes import prism_chain, smooth_blow
from tensegrity import Record, RecordError, simulate
chain, (path, limit) = prism_chain(20), sys.argv[1:]
resource.setrlimit(resource.RLIMIT_FSIZE, (int(limit), int(limit)))
try:
    simulate(chain, smooth_blow(chain), 1e4, dt=0.1, record=Record(every=1, path=path))
except RecordError as error:
    assert path in str(error) and isinstance(error.__cause__, OSError), error
    print(len(error.run.t), error.run.steps, error.run.complete)
"""


@pytest.mark.parametrize("limit", [1000, 20_000 + ROW // 2])
def test_a_file_that_may_not_grow_keeps_every_row_before(tmp_path, limit):
    path = tmp_path / "run.npy"
    environment = {**os.environ, "PYTHONPATH": os.pathsep.join([HERE, os.path.dirname(HERE)])}
    answer = subprocess.run(
        [sys.executable, "-c", LIMITED, str(path), str(limit)],
        env=environment, capture_output=True, text=True, timeout=60,
    )  # fmt: skip
    kept = np.load(path, mmap_mode="r", allow_pickle=False)
    fitting = (limit - kept.offset) // ROW
    assert answer.stdout.split() == [str(fitting), str(fitting - 1), "False"], answer.stderr
    assert len(kept) == fitting
    np.testing.assert_allclose(kept["t"], 0.1 * np.arange(fitting), rtol=1e-12)


@pytest.mark.parametrize("lasting", [False, True])
@pytest.mark.parametrize("part", [0.0, 0.3, 0.99])
def test_any_write_may_fail_or_end_short(tmp_path, monkeypatch, part, lasting):
    """A part of the bytes is taken, and the rest refused, at each call in turn."""
    whole, write = run(), os.pwrite
    for bad in range(100):
        calls, first = [], bad + bool(part)  # the call that fails, after one that ends short

        def failing(file, data, place, calls=calls, first=first):
            calls.append(place)
            if part and len(calls) == first:
                return write(file, data[: int(part * len(data))], place)
            if len(calls) > first and (lasting or len(calls) == first + 1):
                raise OSError(28, "No space left on device")
            return write(file, data, place)

        path, error = tmp_path / f"{bad}.npy", None
        monkeypatch.setattr("os.pwrite", failing)
        try:
            run(path)
        except TensegrityError as found:
            error = found
        monkeypatch.undo()
        if error is None:
            assert bad > 2 * len(whole.t)  # every write was tried
            return
        assert str(path) in str(error)
        if error.run is None:
            assert bad == 0  # the file could not be begun
            continue
        kept = np.load(path, allow_pickle=False)
        assert np.array_equal(kept["u"], whole.u[: len(kept)])
        assert np.array_equal(error.run.t, kept["t"][: len(error.run.t)])
        assert len(kept) - len(error.run.t) <= (lasting and part > 0.9)  # shown, not confirmed
    pytest.fail("a failing write was never noticed")


class Interrupting:
    """Raises KeyboardInterrupt before the k-th line of the package that runs."""

    def __init__(self, at=math.inf):
        self.left, self.count, self.where = at, 0, None

    def __enter__(self):
        sys.settrace(self)
        return self

    def __exit__(self, *_):
        sys.settrace(None)

    def __call__(self, frame, event, argument):
        return self.line if frame.f_code.co_filename.startswith(PACKAGE) else None

    def line(self, frame, event, argument):
        if event == "line":
            self.count += 1
            if self.count > self.left and self.where is None:
                self.where = frame.f_code.co_qualname, frame.f_lineno
                raise KeyboardInterrupt
        return self.line


SMALL, LARGE = (prism_chain(20), 10), (prism_chain(2000), 12_000)  # and steps: many at a time


@pytest.mark.parametrize(
    ("scene", "options", "tries"),
    [
        (SMALL, {"every": 2}, 250),
        (SMALL, {"every": 2, "path": "run.npy"}, 250),
        (SMALL, {"times": [0.0, 0.25, 0.26, 0.5, 0.999]}, 250),
        (LARGE, {"every": 700, "path": "run.npy"}, 25),
    ],
    ids=["memory", "file", "times", "large"],
)
def test_an_interrupt_anywhere_loses_nothing(tmp_path, scene, options, tries):
    """The last row is the final state; rows before are those of the whole run."""
    (chain, steps), when = scene, {k: v for k, v in options.items() if k != "path"}

    def run(seen, **record):
        how = {"dt": 1.0 / steps, "method": "verlet", "record": Record(**record)}
        observe = (lambda t, u, v: seen.append(t), Record(**when))
        return simulate(chain, smooth_blow(chain), 1.0, **how, observe=observe)

    run([], **when)
    with Interrupting() as counted:
        whole = run([], **when)
    wanted, returned = whole.t.tolist(), 0
    for at in range(0, counted.count, max(1, counted.count // tries)):
        seen, path = [], tmp_path / f"{at}.npy"
        run([], **when)  # binds the loop that the interrupted one before it did not hand back
        try:
            with Interrupting(at) as tracer:
                part = run(seen, **when, **({"path": path} if "path" in options else {}))
        except KeyboardInterrupt:
            # there was nothing to lose yet, or all was done and on its way out
            assert len(seen) in (0, len(wanted)), tracer.where
            continue
        done = part.steps * part.dt
        due = [t for t in wanted if t <= done]
        returned += not part.complete
        assert part.t.tolist()[: len(due)] == due, tracer.where
        assert np.array_equal(part.u[: len(due)], whole.u[: len(due)]), tracer.where
        if not part.complete:
            assert part.t.tolist()[len(due) :] == [done] * (done not in due), tracer.where
            assert np.array_equal(part.u[-1], part.final.u), tracer.where
            assert np.array_equal(part.v[-1], part.final.v), tracer.where
            assert part.energy[-1] == chain.energy(part.final)
        if "path" in options:
            rows = np.load(path, allow_pickle=False)
            assert np.array_equal(rows["t"], part.t)
            assert np.array_equal(rows["v"], part.v)
    assert returned > tries / 10


def ended(path):
    """The run that goes on; one that was a trial may have been too coarse."""
    try:
        return resume(path)
    except StabilityError as error:
        return error.run


@pytest.mark.parametrize("how", [{"tol": 1e-9}, {}])
def test_an_interrupt_while_a_step_is_sought_returns_the_run_under_way(tmp_path, how):
    """And a state that it leaves is that of its rows: a step that is refined begins them anew."""
    spring = Prism(1.0, 0.9, 0.01, 1.0).potential()
    v = np.zeros(12)
    v[[0, 4, 8]] = np.sqrt(1.8 * float(spring.energy(spring.domain[0])))
    chain, start = Chain(spring, 12), State(np.zeros(12), v)
    t_end = 5 / np.sqrt(float(spring.stiffness(0.0)))

    def run(path):
        record = Record(interval=t_end / 7, path=path, checkpoint=1e9)
        return simulate(chain, start, t_end, **how, record=record)

    run(tmp_path / "first.npy")
    with Interrupting() as counted:
        run(tmp_path / "whole.npy")
    returned = 0
    for at in range(0, counted.count, counted.count // 20):
        path = tmp_path / f"{at}.npy"
        try:
            with Interrupting(at):
                part = run(path)
        except KeyboardInterrupt:
            continue
        if part.complete:
            continue
        found, returned = [part], returned + 1
        if path.with_name(path.name + ".state.npz").exists():
            found.append(ended(path))
        for one in found:  # such steps, and no others
            if one.steps:
                how_far = {"dt": one.dt, "method": one.method}
                alone = simulate(chain, start, one.steps * one.dt, **how_far)
                np.testing.assert_allclose(one.final.u, alone.final.u, rtol=0, atol=1e-13)
    assert returned


def test_a_file_is_there_once_its_header_is(tmp_path, monkeypatch):
    """Nobody who looks, or is killed before, finds an empty one."""
    path, looks = tmp_path / "run.npy", []

    def full(file, data, place):
        looks.append(path.exists())
        raise OSError(28, "No space left on device")

    monkeypatch.setattr("os.pwrite", full)
    with pytest.raises(TensegrityError, match="No space left on device after 0 rows"):
        run(path)
    assert looks == [False]
    assert not any(tmp_path.iterdir())
    monkeypatch.undo()
    assert run(path).u.tobytes() == run().u.tobytes()


@pytest.mark.parametrize("left", [b"", b"\x93NUMPY"])
def test_a_file_that_is_no_record_is_told_so(tmp_path, left):
    path = tmp_path / "run.npy"
    simulate(
        prism_chain(20), smooth_blow(prism_chain(20)), 1.0, dt=0.1,
        record=Record(path=path, checkpoint=1e9),
    )  # fmt: skip
    path.write_bytes(left)
    with pytest.raises(TensegrityError, match=r"holds no rows|holds no state"):
        resume(path)
