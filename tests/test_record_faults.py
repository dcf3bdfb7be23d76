"""Whatever befalls a run while it records: what it wrote is whole, and ends where the run does."""

import os
import subprocess
import sys

import numpy as np
import pytest
from scenes import prism_chain, short_attempts, smooth_blow

from tensegrity import Record, TensegrityError, resume, simulate
from tensegrity.runs import recorder

HERE = os.path.dirname(__file__)
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
        monkeypatch.setattr(recorder.os, "pwrite", failing)
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
    """Raises KeyboardInterrupt before the k-th line that runs in given files."""

    def __init__(self, at, files):
        self.left, self.files, self.where, self.recording = at, files, None, False

    def __call__(self, frame, event, argument):
        return self.line if frame.f_code.co_filename.endswith(self.files) else None

    def line(self, frame, event, argument):
        if event == "line":
            self.left -= 1
            if self.left < 0 and self.where is None:
                self.where = frame.f_code.co_name, frame.f_lineno
                raise KeyboardInterrupt
            self.recording |= frame.f_code.co_name == "_serve"
        return self.line


WATCHED = ("march.py", "motion.py", "recorder.py", "observers.py", "rows.py")


@pytest.mark.parametrize(
    ("options", "lines"),
    [
        ({"every": 2}, 250),
        ({"every": 2}, 50),
        ({"every": 2, "path": "run.npy"}, 250),
        ({"times": [0.0, 0.25, 0.26, 0.5, 0.999]}, 250),
    ],
    ids=["memory", "at once", "file", "times"],
)
def test_an_interrupt_anywhere_loses_nothing(tmp_path, monkeypatch, options, lines):
    """The last row is the final state; rows before are those of the whole run."""
    if lines >= 250:
        short_attempts(monkeypatch)
    whole = run(**{k: v for k, v in options.items() if k != "path"})
    chain, wanted = prism_chain(20), whole.t.tolist()
    at, ended, stride = -1, False, 5
    while not ended:
        at += stride
        if "path" in options:
            options = {**options, "path": tmp_path / f"{at}.npy"}
        tracer = Interrupting(at, WATCHED)
        sys.settrace(tracer)
        try:
            part = run(**options)
        except KeyboardInterrupt:
            # there was nothing to lose yet, or all was done and on its way out
            assert not tracer.recording or tracer.where[0] == "run", tracer.where
            continue
        finally:
            sys.settrace(None)
        ended = tracer.where is None
        assert part.complete or not ended, tracer.where
        done = part.steps * part.dt
        due = [t for t in wanted if t <= done]
        assert part.t.tolist()[: len(due)] == due, tracer.where
        assert np.array_equal(part.u[: len(due)], whole.u[: len(due)])
        if not part.complete:
            assert part.t.tolist()[len(due) :] == [done] * (done not in due), tracer.where
            assert np.array_equal(part.u[-1], part.final.u), tracer.where
            assert np.array_equal(part.v[-1], part.final.v), tracer.where
            assert part.energy[-1] == chain.energy(part.final)
        if "path" in options:
            kept = np.load(options["path"], allow_pickle=False)
            assert np.array_equal(kept["t"], part.t)
            assert np.array_equal(kept["v"], part.v)
    assert at > lines


def test_a_file_is_there_once_its_header_is(tmp_path, monkeypatch):
    """Nobody who looks, or is killed before, finds an empty one."""
    path, looks, write = tmp_path / "run.npy", [], recorder._write

    def full(file, data, place):
        looks.append(path.exists())
        raise OSError(28, "No space left on device")

    monkeypatch.setattr(recorder, "_write", full)
    with pytest.raises(TensegrityError, match="No space left on device after 0 rows"):
        run(path)
    assert looks == [False]
    assert not any(tmp_path.iterdir())
    monkeypatch.setattr(recorder, "_write", write)
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
