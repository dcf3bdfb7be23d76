"""Functions of a user that watch a run: when they are called, and how they end it."""

import os
import tracemalloc

import numpy as np
import pytest
import sympy as sp
from scenes import prism_chain, smooth_blow

from tensegrity import (
    Chain,
    Damping,
    Drive,
    Ensemble,
    Network,
    PowerLaw,
    Record,
    RecordError,
    Run,
    TensegrityError,
    simulate,
)

HOW = {"dt": 0.1, "method": "rkn6"}


class Seen:
    """Keeps what it is called with; ends the run at an instant."""

    def __init__(self, until=np.inf):
        self.until, self.t, self.u, self.v = until, [], [], []

    def __call__(self, t, u, v):
        self.t.append(t)
        self.u.append(u)
        self.v.append(v)
        return t >= self.until


def chain():
    scene = prism_chain(20)
    return scene, smooth_blow(scene)


def driven():
    drive = {0: Drive(displacement=0.005 * (1 - sp.cos(sp.Symbol("t"))))}
    scene = Chain(prism_chain(9).springs[0], 9, drive=drive, damping=Damping(ground=0.01))
    return scene, scene.at_rest()


def lanes():
    scene = Ensemble([prism_chain(9), Chain(PowerLaw(1.0, 1.5, preload=0.5), 9)])
    return scene, scene.at_rest({0: [0.01, 0.02]})


def discs():
    law = PowerLaw(100.0, 1.5)
    scene = Network([[0.0, 0.0], [2.3, 0.1]], (), law, contacts="follow", law=law, radius=1.0)
    return scene, scene.at_rest({0: (0.4, 0.0)})


SCENES = {f.__name__: f for f in (chain, driven, lanes, discs)}
WHEN = {
    "all": None,
    "every": Record(every=7),
    "times": Record(times=[0.0, 0.123, 0.2, 0.2000001, 3.9]),
    "interval": Record(interval=0.37),
}


@pytest.mark.parametrize("when", WHEN)
@pytest.mark.parametrize("name", SCENES)
def test_an_observer_sees_what_is_recorded_and_changes_no_bit(name, when):
    scene, state = SCENES[name]()
    alone = simulate(scene, state, 4.0, record=WHEN[when], **HOW)
    seen = Seen()
    run = simulate(scene, state, 4.0, record=WHEN[when], observe=seen, **HOW)
    assert seen.t == alone.t.tolist() == run.t.tolist()
    for x in ("u", "v"):
        assert np.array_equal(getattr(seen, x), getattr(alone, x))
        assert np.array_equal(getattr(run, x), getattr(alone, x))
    assert np.array_equal(run.energy, alone.energy)
    assert run.complete
    assert run.stopped is None


@pytest.mark.parametrize("name", SCENES)
def test_instants_of_its_own_are_those_of_a_record_of_them(name):
    """Several observers, each with its own instants, and a record of a few sites in a file."""
    scene, state = SCENES[name]()
    often, rarely, plain = Seen(), Seen(), Seen()
    observe = [(often, Record(every=1)), (rarely, WHEN["times"]), plain]
    simulate(scene, state, 4.0, record=Record(every=9, sites=[1]), observe=observe, **HOW)
    for seen, record in (
        (often, Record(every=1)),
        (rarely, WHEN["times"]),
        (plain, Record(every=9)),
    ):
        wanted = simulate(scene, state, 4.0, record=record, **HOW)
        assert seen.t == wanted.t.tolist()
        assert np.array_equal(seen.u, wanted.u)
        assert np.array_equal(seen.v, wanted.v)


def test_all_are_called_in_the_order_of_time_with_arrays_that_cannot_be_written():
    scene, state = chain()
    calls = []

    def note(name):
        def called(t, u, v):
            assert u.shape == v.shape == scene.shape
            assert not u.flags.writeable
            assert not v.flags.writeable
            calls.append((t, name))
            return t > 3.0 and name == 1

        return called

    observe = [(note(0), Record(interval=0.31)), (note(1), Record(every=3)), note(2)]
    simulate(scene, state, 4.0, observe=observe, **HOW)
    assert calls == sorted(calls)
    assert [name for t, name in calls if t == calls[-1][0]] == [1, 2]  # all of the last instant
    assert len(calls) == len(set(calls))
    assert {name for _, name in calls} == {0, 1, 2}


@pytest.mark.parametrize("when", WHEN)
@pytest.mark.parametrize("name", SCENES)
def test_a_true_return_ends_the_run_there(name, when, tmp_path):
    scene, state = SCENES[name]()
    whole = simulate(scene, state, 4.0, record=Record(every=1), **HOW)
    seen = Seen(until=1.7)
    record, path = Record(every=4), tmp_path / "rows.npy"
    observe = (seen, WHEN[when] or Record(every=1))
    run = simulate(scene, state, 4.0, record=record, observe=observe, **HOW)
    assert seen.t[-1] == run.t[-1] >= 1.7
    assert all(t < 1.7 for t in seen.t[:-1])
    assert not run.complete
    assert f"t = {run.t[-1]:.6g} s" in run.stopped
    assert run.stopped in " ".join(str(run).split())
    assert np.array_equal(run.u[-1], seen.u[-1])
    assert np.array_equal(run.final.v, seen.v[-1])
    rows = len(run.t) - 1
    assert np.array_equal(run.u[:rows], whole.u[::4][:rows])
    assert run.steps == int(run.t[-1] / run.dt + 1e-9)
    assert run.energy[-1] == pytest.approx(
        run.energy[0] + (0 if run.work is None else (run.work - run.loss)[-1]), rel=1e-3, abs=1e-9
    )
    simulate(
        scene, state, 4.0, record=Record(every=4, path=path), observe=(Seen(1.7), observe[1]), **HOW
    )
    kept = np.load(path)
    assert np.array_equal(kept["t"], run.t)
    assert np.array_equal(kept["u"], run.u)


def test_an_exception_ends_the_run_as_ctrl_c_does(tmp_path):
    scene, state = chain()
    whole = simulate(scene, state, 4.0, record=Record(every=2), **HOW)

    def fails(t, u, v):
        if t > 1.0:
            raise ZeroDivisionError("by hand")

    def stops(t, u, v):
        if t > 1.0:
            raise KeyboardInterrupt

    with pytest.warns(
        RuntimeWarning, match=r"fails raised ZeroDivisionError\('by hand'\) at t = 1.2 s"
    ):
        run = simulate(scene, state, 4.0, record=Record(every=2), observe=fails, **HOW)
    assert not run.complete
    assert "ZeroDivisionError" in run.stopped
    assert run.t[-1] == pytest.approx(1.2)
    assert np.array_equal(run.u, whole.u[: len(run.t)])
    run = simulate(scene, state, 4.0, record=Record(every=2), observe=stops, **HOW)
    assert not run.complete
    assert run.t[-1] >= 1.2 - 1e-12


@pytest.mark.parametrize("how", [{}, {"tol": 1e-6}, {"tol": 1e-3, "method": "verlet"}])
def test_without_a_given_step_it_is_called_for_the_run_that_is_returned(how):
    scene, state = chain()
    alone, seen = simulate(scene, state, 4.0, **how), Seen()
    run = simulate(scene, state, 4.0, observe=seen, **how)
    assert run.steps == alone.steps
    assert seen.t == run.t.tolist()
    assert np.array_equal(seen.u, run.u)
    assert np.array_equal(run.u, alone.u)
    assert run.error_estimate == alone.error_estimate
    ended = simulate(scene, state, 4.0, observe=Seen(2.0), **how)
    assert not ended.complete
    assert ended.t[-1] >= 2.0


def test_a_run_that_was_ended_is_saved_and_loaded(tmp_path):
    scene, state = chain()
    run = simulate(scene, state, 4.0, observe=Seen(1.0), **HOW)
    run.save(tmp_path / "run.npz")
    found = Run.load(tmp_path / "run.npz")
    assert found.stopped == run.stopped
    assert not found.complete


@pytest.mark.parametrize(
    ("observe", "words"),
    [
        (3, "observe 3 must be a sequence of functions"),
        ([3], "observe 3 is not a function"),
        ((print, 7), "observe 7 is not a function"),
        ([(print, 7)], "record of an observer 7"),
        ((print, Record(sites=[0])), "sites in an observer's record"),
        ((print, Record(path="x.npy")), "path in an observer's record"),
        ((print, Record(times=[9.0])), "after the end"),
    ],
)
def test_what_is_no_observer_is_refused_before_any_work(observe, words):
    scene, state = chain()
    with pytest.raises(TensegrityError, match=words):
        simulate(scene, state, 4.0, observe=observe, **HOW)


def test_instants_within_one_step_share_its_state():
    """Four thousand of them in fifty steps take no room of four thousand states, 19 MB."""
    scene = prism_chain(300)
    state, seen = scene.at_rest({0: 0.01}), []
    tracemalloc.start()
    observe = (lambda t, u, v: seen.append(t), Record(interval=0.00125))
    simulate(scene, state, 5.0, record=Record(sites=[0]), observe=observe, **HOW)
    taken = tracemalloc.get_traced_memory()[1]
    tracemalloc.stop()
    assert len(seen) == 4_001
    assert taken < 9e6


def test_a_stop_and_a_disk_that_is_full_leave_the_last_row_as_the_end(tmp_path, monkeypatch):
    scene, state = chain()
    write, calls = os.pwrite, []

    def full(*given):
        calls.append(given)
        if len(calls) > 12:
            raise OSError(28, "No space left on device")
        return write(*given)

    monkeypatch.setattr("os.pwrite", full)
    record = Record(every=2, path=tmp_path / "rows.npy")
    with pytest.raises(RecordError) as caught:
        simulate(scene, state, 4.0, record=record, observe=Seen(3.0), **HOW)
    run = caught.value.run
    assert run.t[-1] == pytest.approx(run.steps * run.dt)
    assert np.array_equal(run.u[-1], run.final.u)
