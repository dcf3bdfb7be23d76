"""Recording to a file: whole after every row, whatever happens to the process."""

import signal
import subprocess

import numpy as np
import pytest
from scenes import blow, prism_chain, smooth_blow, with_memory
from test_resume import started

from tensegrity import LockingError, Record, TensegrityError, simulate


def test_a_file_holds_the_same_rows_as_memory(tmp_path):
    chain, path = prism_chain(20), tmp_path / "run.npy"
    options = {"dt": 0.1, "method": "verlet"}
    memory = simulate(chain, smooth_blow(chain), 120.0, **options, record=Record(1, [3, 7]))
    file = simulate(chain, smooth_blow(chain), 120.0, **options, record=Record(1, [3, 7], path))
    rows = np.load(path, allow_pickle=False)
    assert len(rows) == len(memory.t) == 1201  # the count's digits grew on the way
    for name in ("t", "energy", "u", "v"):
        assert np.array_equal(rows[name], getattr(memory, name))
        assert np.array_equal(rows[name], getattr(file, name))


def test_a_tolerance_leaves_the_rows_of_the_run_it_returns(tmp_path):
    chain, path = prism_chain(20), tmp_path / "run.npy"
    run = simulate(chain, smooth_blow(chain), 10.0, tol=1e-8, record=Record(path=path))
    rows = np.load(path)
    assert np.array_equal(rows["u"], run.u)
    assert rows["t"][-1] == 10.0


def test_a_locked_run_leaves_its_rows_in_the_file(tmp_path):
    chain, path = prism_chain(), tmp_path / "run.npy"
    with pytest.raises(LockingError) as caught:
        simulate(chain, chain.at_rest({0: 0.3}), 9.0, dt=0.001, record=Record(10, path=path))
    assert np.array_equal(np.load(path)["t"], caught.value.run.t)


def test_paths_that_cannot_be_written_are_refused_before_any_work(tmp_path):
    chain, path = prism_chain(5), tmp_path / "run.npy"
    path.write_text("precious")
    with pytest.raises(TensegrityError, match="exists"):
        simulate(chain, smooth_blow(chain), 1.0, record=Record(path=path))
    assert path.read_text() == "precious"
    with pytest.raises(TensegrityError, match="no folder"):
        simulate(chain, smooth_blow(chain), 1.0, record=Record(path=tmp_path / "x" / "run.npy"))


def test_a_record_beyond_memory_is_refused_with_its_size(monkeypatch):
    chain = prism_chain(1000)
    with_memory(monkeypatch, 10_000_000)
    with pytest.raises(TensegrityError, match=r"0\.16\d* GB exceeds the 0.01 GB of memory"):
        simulate(chain, smooth_blow(chain), 10.0, dt=0.001, record=Record(every=1))


def test_a_record_beyond_the_disk_is_refused_with_its_size(tmp_path, monkeypatch):
    chain = prism_chain(1000)
    usage = type("", (), {"free": 1_000_000})
    monkeypatch.setattr("shutil.disk_usage", lambda _: usage)
    wanted = Record(every=1, path=tmp_path / "run.npy")
    with pytest.raises(TensegrityError, match="disk space"):
        simulate(chain, smooth_blow(chain), 10.0, dt=0.001, record=wanted)


RUN = """
import os, signal, sys
from scenes import blow
from tensegrity import Record, simulate
left, write = int(sys.argv[2]), os.pwrite

def last(file, data, place):
    global left
    left -= 1
    if left < 0:
        write(file, data[: len(data) // 2], place)
        os.kill(os.getpid(), signal.SIGKILL)
    return write(file, data, place)

os.pwrite = last
simulate(*blow(), 1e6, dt=0.1, record=Record(every=1, path=sys.argv[1]))
"""


@pytest.mark.parametrize("writes", [5, 200, 1001])
def test_a_killed_run_leaves_every_row_it_had_written(tmp_path, writes):
    path = tmp_path / "run.npy"
    assert started(RUN, str(path), str(writes)).wait() == -signal.SIGKILL
    size, rows = path.stat().st_size, np.load(path, allow_pickle=False)
    row = rows.dtype.itemsize
    assert len(rows) * row >= size - 4096 - row
    np.testing.assert_allclose(rows["t"], 0.1 * np.arange(len(rows)), rtol=1e-12)
    chain, start = blow()
    if len(rows) > 1:
        last = 0.1 * (len(rows) - 1)
        again = simulate(chain, start, last, dt=0.1, method="verlet")
        np.testing.assert_allclose(rows["u"][-1], again.final.u, rtol=1e-6, atol=1e-6)


def test_interrupt_by_signal_returns_the_partial_run():
    """Ctrl-C, as the process receives it."""
    code = """
import os, signal
signal.signal(signal.SIGINT, signal.default_int_handler)  # a shell may have ignored it
from scenes import blow
from tensegrity import Record, simulate
def interrupt(*_): os.kill(os.getpid(), signal.SIGINT)
run = simulate(*blow(), 1e6, dt=0.1, observe=(interrupt, Record(times=[1.0])))
assert not run.complete and 0 < run.t[-1] < 1e6, run
print("partial")
"""
    answer, _ = started(code, stdout=subprocess.PIPE).communicate()
    assert answer.strip() == b"partial"
