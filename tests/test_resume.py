"""Runs that are killed, interrupted or fail go on to the end they had, to the same bits."""

import os
import random
import signal
import subprocess
import sys
import time

import numpy as np
import pytest
import sympy as sp
from crafted import crafted
from networks import patch, pushed
from scenes import interrupted, prism_chain, short_attempts, smooth_blow

from granular import Bead, Striker, chain, materials, y_guide
from tensegrity import (
    Chain,
    Drive,
    Ensemble,
    LockingError,
    Potential,
    PowerLaw,
    Prism,
    Record,
    RecordError,
    TensegrityError,
    resume,
    simulate,
)
from tensegrity.runs import recorder, step
from tensegrity.runs.record import beside

STEEL = Bead(4.76e-3, materials["steel"])


def toda(stiffness=2.0):
    r, k = sp.symbols("r k")
    return Chain(Potential(k * (sp.exp(-r) + r - 1), r, {k: stiffness}), 12)


def blow():
    one = prism_chain(24)
    return one, smooth_blow(one)


def elastic():
    soft = Prism(1.0, 0.5, 0.4, 1.0, k_base=2.0, k_bar=20.0).potential(preload=0.05)
    one = Chain([soft] * 6 + [PowerLaw(1.0, 1.5, 0.1, length=0.2)] * 5, 12, np.linspace(1, 2, 12))
    return one, one.at_rest({0: 0.1})


def lanes():
    several = Ensemble(prism_chain(12), 9)
    return several, several.at_rest({1: np.linspace(0.01, 0.03, 9)})


def triangles():
    network = patch()
    return network, pushed(network)


def struck():
    beads = chain([STEEL] * 9, striker=Striker(STEEL, 0.5), end=materials["ptfe"], gravity=9.81)
    return beads, beads.start()


def guide():
    fork = y_guide(5, 4, bead=STEEL, striker=Striker(STEEL, 0.5), end=materials["steel"])
    return fork, fork.start()


def driven():
    moved = prism_chain(5).springs[0]
    one = Chain(moved, 5, drive={0: Drive(force=([0.0, 1.0, 2.0], [0.0, 0.1, 0.0]))})
    return one, one.at_rest()


CASES = {
    "verlet": (blow, 8.0, {"dt": 0.1}),
    "midpoint": (blow, 4.0, {"dt": 0.25, "method": "midpoint"}),
    "rk4": (blow, 4.0, {"dt": 0.1, "method": "rk4"}),
    "default step": (blow, 8.0, {}),
    "tolerance": (blow, 8.0, {"tol": 1e-9}),
    "elastic": (elastic, 4.0, {"dt": 0.05, "method": "rkn6"}),
    "lanes": (lanes, 4.0, {"dt": 0.05}),
    "network": (triangles, 4.0, {"dt": 0.05, "method": "rkn6"}),
    "beads": (struck, 1e-4, {"dt": 2e-6}),
    "guide": (guide, 5e-5, {"dt": 1e-6, "method": "rkn6"}),
}


def same(run, whole):
    for name in ("t", "u", "v", "energy", "impulse", "met"):
        one, two = getattr(run, name), getattr(whole, name)
        assert (one is None and two is None) or np.array_equal(one, two), name
    assert np.array_equal(run.final.u, whole.final.u)
    assert np.array_equal(run.final.v, whole.final.v)
    assert (run.dt, run.steps, run.sites) == (whole.dt, whole.steps, whole.sites)
    assert (run.method, run.complete) == (whole.method, whole.complete)


def interrupt(monkeypatch, at, error=KeyboardInterrupt):
    """Stop the run to a file with its `at`-th attempt."""
    interrupted(monkeypatch, at, 1, error, lambda motion: motion.problem.record.path)


@pytest.mark.parametrize("at", [1, 2, 9])
@pytest.mark.parametrize("kind", ["every", "interval"])
@pytest.mark.parametrize("name", CASES)
def test_an_interrupted_run_goes_on_to_the_same_bits(tmp_path, monkeypatch, name, kind, at):
    make, t_end, options = CASES[name]
    scene, state = make()
    record = {"every": 1} if kind == "every" else {"interval": t_end / 21.3}
    if name == "tolerance":
        monkeypatch.setattr("tensegrity.runs.tolerance.WORTH", np.inf)
    whole = simulate(scene, state, t_end, **options, record=Record(sites=[1, 0], **record))
    path = tmp_path / "run.npy"
    interrupt(monkeypatch, at)
    record = Record(sites=[1, 0], **record, path=path, checkpoint=1e9)
    part = simulate(scene, state, t_end, **options, record=record)
    monkeypatch.undo()
    assert not part.complete
    run = resume(path)
    if name == "tolerance" and run.dt != whole.dt:
        assert run.error_estimate is None  # the march under way was a trial
        how = {"dt": run.dt, "method": run.method}
        record = Record(sites=[1, 0], every=record.every, interval=record.interval)
        whole = simulate(scene, state, t_end, **how, record=record)
    same(run, whole)
    assert repr(run.scene) == repr(scene)
    assert np.array_equal(np.load(path)["v"], whole.v)
    same(resume(path), whole)  # again: nothing is left to do


def test_a_full_disk_loses_the_row_and_not_the_run(tmp_path, monkeypatch):
    scene, state = blow()
    whole = simulate(scene, state, 8.0, dt=0.1, record=Record(every=2))
    path, write, calls = tmp_path / "run.npy", os.pwrite, []

    def full(file, data, place):
        calls.append(place)
        if len(calls) > 20:
            raise OSError(28, "No space left on device")
        return write(file, data, place)

    monkeypatch.setattr("tensegrity.runs.recorder.os.pwrite", full)
    record = Record(every=2, path=path, checkpoint=0.0)
    with pytest.raises(RecordError, match="No space left") as caught:
        simulate(scene, state, 8.0, dt=0.1, record=record)
    monkeypatch.undo()
    kept = len(np.load(path))
    assert kept == len(caught.value.run.t) == 9
    same(resume(path), whole)


def test_a_state_that_cannot_be_written_leaves_the_one_before(tmp_path, monkeypatch):
    scene, state = blow()
    whole = simulate(scene, state, 8.0, dt=0.1, record=Record(every=2))
    path, replace, calls = tmp_path / "run.npy", os.replace, []

    def full(one, two):
        calls.append(two)
        if len(calls) > 5:
            raise OSError(28, "No space left on device")
        replace(one, two)

    short_attempts(monkeypatch, 8)
    monkeypatch.setattr("tensegrity.runs.archive.os.replace", full)
    with pytest.raises(RecordError, match=r"run\.npy\.state\.npz: No space left") as caught:
        simulate(scene, state, 8.0, dt=0.1, record=Record(every=2, path=path, checkpoint=0.0))
    monkeypatch.undo()
    assert np.array_equal(np.load(path)["t"], caught.value.run.t)
    same(resume(path), whole)
    assert sorted(x.name for x in tmp_path.iterdir()) == ["run.npy", "run.npy.state.npz"]


def test_no_state_of_a_trial_stands_beside_the_rows_of_the_next(tmp_path, monkeypatch):
    scene, state = guide()
    path, begin, calls = tmp_path / "run.npy", recorder.FileRows.__init__, []
    expected = step.expected_steps  # too few: the run is begun anew with more
    monkeypatch.setattr(step, "expected_steps", lambda *given: expected(*given) // 16)

    def killed(self, *arguments):
        begin(self, *arguments)
        calls.append(beside(path).exists())
        if len(calls) == 2:
            raise KeyboardInterrupt

    monkeypatch.setattr(recorder.FileRows, "__init__", killed)
    with pytest.raises(KeyboardInterrupt):
        simulate(scene, state, 5e-5, record=Record(path=path, checkpoint=1e9))
    assert calls == [False, False]
    assert not beside(path).exists()


def test_a_run_that_locked_locks_again(tmp_path):
    one, path = prism_chain(), tmp_path / "run.npy"
    record = Record(every=10, path=path, checkpoint=1e9)
    with pytest.raises(LockingError) as first:
        simulate(one, one.at_rest({0: 0.3}), 9.0, dt=0.001, record=record)
    with pytest.raises(LockingError) as second:
        resume(path)
    assert str(first.value) == str(second.value)
    assert np.array_equal(first.value.run.t, second.value.run.t)


def test_a_scene_of_a_users_own_energy_is_asked_for_and_recognised(tmp_path, monkeypatch):
    one, path = toda(), tmp_path / "run.npy"
    state = one.at_rest({0: 0.5})
    whole = simulate(one, state, 5.0, dt=0.1, record=Record(every=1))
    interrupt(monkeypatch, 9)
    simulate(one, state, 5.0, dt=0.1, record=Record(every=1, path=path, checkpoint=1e9))
    monkeypatch.undo()
    with pytest.raises(TensegrityError, match=r"give it as `scene`; it printed Chain\(12 sites"):
        resume(path)
    heavier = Chain(one.springs[0], 12, 2.0)
    for wrong in (toda(2.1), heavier, prism_chain(12), Chain(one.springs[0], 13), "chain"):
        with pytest.raises(TensegrityError, match="is not that of"):
            resume(path, scene=wrong)
    same(resume(path, scene=toda()), whole)


def test_a_scene_that_can_be_built_may_be_given_too(tmp_path):
    scene, state = blow()
    path = tmp_path / "run.npy"
    record = Record(path=path, checkpoint=0)
    run = simulate(scene, state, 1.0, dt=0.1, record=record)
    assert resume(path, scene).scene is scene
    same(resume(path, scene), run)
    with pytest.raises(TensegrityError, match="is not that of"):
        resume(path, prism_chain(25))


def test_files_that_do_not_belong_together_are_refused(tmp_path):
    scene, state = blow()
    path, other = tmp_path / "run.npy", tmp_path / "other.npy"
    with pytest.raises(TensegrityError, match=r"no file .*run\.npy\.state\.npz"):
        resume(path)
    with pytest.raises(TensegrityError, match="is not a path"):
        resume(3)
    record = Record(path=path, checkpoint=0, every=1)
    simulate(scene, state, 1.0, dt=0.1, record=record)
    with pytest.raises(TensegrityError, match="exists"):
        simulate(scene, state, 1.0, dt=0.1, record=record)
    simulate(scene, state, 1.0, dt=0.1, record=Record(path=other, sites=[1]))
    whole = path.read_bytes()
    for wrong in (other.read_bytes(), whole[:300], b"", b"precious"):
        path.write_bytes(wrong)
        with pytest.raises(TensegrityError, match=r"record path .*run\.npy holds"):
            resume(path)
        assert path.read_bytes() == wrong
    path.unlink()
    with pytest.raises(TensegrityError, match=r"record path .*run\.npy holds"):
        resume(path)
    path.write_bytes(whole)
    beside(path).write_bytes(beside(path).read_bytes()[:-200])
    with pytest.raises(TensegrityError, match="holds no state, or is damaged"):
        resume(path)


KILLED = """
import sys
from test_resume import blow
from tensegrity import Record, simulate
chain, state = blow()
record = Record(interval=0.413, path=sys.argv[1], checkpoint=0.003)
simulate(chain, state, 400.0, dt=0.05, method="rkn6", record=record)
"""


def _kills(tmp_path, seed, count):
    """Kill at random moments, look, and go on in a new process that is killed as well."""
    scene, state = blow()
    whole = simulate(scene, state, 400.0, dt=0.05, method="rkn6", record=Record(interval=0.413))
    here = os.path.dirname(__file__)
    environment = {**os.environ, "PYTHONPATH": os.pathsep.join([here, os.path.dirname(here)])}
    moments, path, seen, number = random.Random(seed), None, 0, 0
    for kill in range(count):
        code = "import sys\nfrom tensegrity import resume\nresume(sys.argv[1])"
        if path is None:
            path, code, seen, number = tmp_path / f"{kill}.npy", KILLED, 0, number + 1
        running = subprocess.Popen([sys.executable, "-c", code, str(path)], env=environment)
        until = time.monotonic() + 60
        while not beside(path).exists() or _rows(path) <= seen:
            assert running.poll() is None or _rows(path) == len(whole.t)
            assert time.monotonic() < until
            if _rows(path) == len(whole.t):
                break
            time.sleep(0.002)
        time.sleep(moments.uniform(0, 0.5))
        running.send_signal(signal.SIGKILL)
        running.wait()
        kept = np.load(path, allow_pickle=False)
        assert len(kept) >= seen  # nothing that was there is gone
        seen = len(kept)
        assert np.array_equal(kept["t"], whole.t[:seen])
        assert np.array_equal(kept["u"], whole.u[:seen])
        assert seen > 0
        if seen == len(whole.t) or kill == count - 1:
            same(resume(path), whole)
            path = None
    return number


def _rows(path):
    try:
        return len(np.load(path, mmap_mode="r"))
    except (OSError, ValueError):
        return 0


def test_a_killed_run_is_resumed_to_the_same_bits(tmp_path):
    _kills(tmp_path, 1, 3)


@pytest.mark.slow
def test_twenty_kills_at_random_moments_lose_nothing(tmp_path):
    _kills(tmp_path, 2, 20)


def test_any_damage_to_the_rows_is_refused_or_harmless(tmp_path):
    scene, state = blow()
    path = tmp_path / "run.npy"
    whole = simulate(scene, state, 1.0, dt=0.1, record=Record(path=path, checkpoint=0, every=1))
    kept, rng = path.read_bytes(), np.random.default_rng(4)
    damage = [(place, byte) for place in range(140) for byte in b"\0\xff([{'\n9"]
    damage += [(place, 255) for place in rng.integers(len(kept), size=40).tolist()]
    for place, byte in damage:
        path.write_bytes(kept[:place] + bytes([byte]) + kept[place + 1 :])
        try:
            run = resume(path)
        except TensegrityError:
            continue
        assert np.array_equal(run.final.u, whole.final.u)


def test_a_second_run_of_a_path_is_refused_before_it_writes(tmp_path, monkeypatch):
    """Also one that looked before the first began; a process that is killed holds nothing."""
    (scene, state), path = blow(), tmp_path / "run.npy"
    here = os.path.dirname(__file__)
    environment = {**os.environ, "PYTHONPATH": os.pathsep.join([here, os.path.dirname(here)])}
    running = subprocess.Popen([sys.executable, "-c", KILLED, str(path)], env=environment)
    while not beside(path).exists():
        time.sleep(0.002)
    running.send_signal(signal.SIGSTOP)
    try:
        files = {x.name: x.read_bytes() for x in tmp_path.iterdir()}
        with pytest.raises(RecordError, match=r"run\.npy is being written by another run"):
            resume(path)
        monkeypatch.setattr(Record, "check", lambda *given: None)
        for record in (Record(path=path), Record(path=path, checkpoint=0)):
            with pytest.raises(RecordError, match=r"record path .*run\.npy exists"):
                simulate(scene, state, 1.0, dt=0.1, record=record)
        monkeypatch.undo()
        assert {x.name: x.read_bytes() for x in tmp_path.iterdir()} == files
    finally:
        running.kill()
        running.wait()
    assert resume(path).complete


def test_of_two_runs_that_begin_a_path_at_once_one_is_refused(tmp_path, monkeypatch):
    """The other begins between the look for the file and its own."""
    (scene, state), path, write, inner = blow(), tmp_path / "run.npy", recorder._write, []

    def later(file, data, place):
        if not inner:
            inner.append(None)
            with pytest.raises(RecordError, match=r"run\.npy is being written by another run"):
                simulate(scene, state, 1.0, dt=0.1, record=Record(path=path))
        write(file, data, place)

    monkeypatch.setattr(recorder, "_write", later)
    run = simulate(scene, state, 1.0, dt=0.1, record=Record(path=path))
    assert inner
    assert np.array_equal(np.load(path)["u"], run.u)
    assert [x.name for x in tmp_path.iterdir()] == ["run.npy"]


@pytest.mark.parametrize("make", [blow, lanes, guide, driven])
def test_a_state_whose_parts_do_not_fit_is_refused(tmp_path, make):
    scene, state = make()
    path = tmp_path / "run.npy"
    simulate(scene, state, 5e-5, dt=1e-6, record=Record(every=1, path=path, checkpoint=0))
    others = {"choice": ["all"], "done": [10**6], "count": [10**6], "allowed": [0.0, np.nan]}
    for part, value in crafted(beside(path), "state", others):
        with pytest.raises(TensegrityError, match=r"holds no state, or is damaged|record path"):
            print(part, value, resume(path))
    assert resume(path).complete
