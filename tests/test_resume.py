"""Runs that are killed, interrupted or fail go on to the end they had, to the same bits."""

import itertools
import os
import random
import signal
import subprocess
import sys
from threading import Lock

import numpy as np
import pytest
import sympy as sp
from crafted import crafted
from networks import plate, triangles
from scenes import blow, ctrl_c, lanes, many_steps, prism_chain
from springs import series

from granular import Bead, Contact, Striker, chain, hexagonal_pack, materials, y_guide
from tensegrity import (
    Chain,
    Damping,
    Drive,
    Ensemble,
    LockingError,
    Network,
    Potential,
    PowerLaw,
    Prism,
    Record,
    RecordError,
    Run,
    State,
    TensegrityError,
    resume,
    simulate,
)

STEEL, T = Bead(4.76e-3, materials["steel"]), sp.Symbol("t")


def toda(stiffness=2.0):
    r, k = sp.symbols("r k")
    return Chain(Potential(k * (sp.exp(-r) + r - 1), r, {k: stiffness}), 12)


def elastic():
    soft = Prism(1.0, 0.5, 0.4, 1.0, k_base=2.0, k_bar=20.0).potential(preload=0.05)
    one = Chain([soft] * 6 + [PowerLaw(1.0, 1.5, 0.1, length=0.2)] * 5, 12, np.linspace(1, 2, 12))
    return one, one.at_rest({0: 0.1})


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


def moved(**damping):
    """A drive and dashpots."""
    drive = {0: Drive(displacement=0.3 * sp.sin(1.3 * T)), 4: Drive(force=0.1 * sp.cos(T))}
    damping = Damping(**damping or {"bond": 0.2, "ground": 0.1})
    one = Chain(series(0, 1 / 4, length=1.0), 8, drive=drive, damping=damping)
    return one, one.at_rest({3: 0.02})


def moved_lanes():
    several = Ensemble([moved(bond=bond)[0] for bond in (0.0, 1.0)])
    return several, several.at_rest({3: 0.02})


def changing():
    prestrain = 0.02 + 0.01 * sp.sin(T / 2) ** 2
    one = Chain(prism_chain().springs[0].over_time(prestrain=prestrain), 6)
    return one, one.at_rest({3: 0.02})


def shaken():
    """A lattice shaken in its middle, with dashpots and springs that change."""
    drive = {4: Drive(displacement=(0.1 * sp.sin(T), None))}
    spring = series(0, 1 / 4, length=1.0).over_time(k=1 + sp.sin(T) / 2)
    one = plate(drive=drive, damping=Damping(bond=0.1), spring=spring)
    return one, one.at_rest({8: (0.05, -0.1)})


CASES = {  # and steps, of which not all are done at once
    "verlet": (blow, 8.0, many_steps(23), {"method": "verlet"}),
    "midpoint": (lambda: blow(20_000), 8.0, many_steps(20_000), {"method": "midpoint"}),
    "rk4": (blow, 8.0, many_steps(23, 4), {"method": "rk4"}),
    "corrected6": (struck, 1e-4, many_steps(10, 11), {"method": "corrected6"}),
    "default step": (lambda: blow(2000), 600.0, None, {}),
    "tolerance": (lambda: blow(2000), 600.0, None, {"tol": 1e-4, "method": "rkn6"}),
    "elastic": (elastic, 4.0, many_steps(11, 11), {"method": "rkn6"}),
    "lanes": (lanes, 4.0, many_steps(99), {"method": "verlet"}),
    "network": (triangles, 4.0, many_steps(56, 11), {"method": "rkn6"}),
    "beads": (struck, 1e-4, many_steps(10), {"method": "verlet"}),
    "guide": (guide, 5e-5, many_steps(20, 11), {"method": "rkn6"}),
    "moved": (moved, 4.0, 40_000, {"method": "rkn6"}),
    "moved lanes": (moved_lanes, 4.0, 20_000, {"method": "rkn6"}),
    "changing": (changing, 4.0, 40_000, {"method": "rkn6"}),
    "shaken": (shaken, 4.0, 12_000, {"method": "rkn6"}),
}


def state_file(path):
    return path.with_name(path.name + ".state.npz")


def same(run, whole):
    for name in ("t", "u", "v", "energy", "impulse", "elongation_range", "work", "loss"):
        one, two = getattr(run, name), getattr(whole, name)
        assert (one is None and two is None) or np.array_equal(one, two), name
    assert np.array_equal(run.final.u, whole.final.u)
    assert np.array_equal(run.final.v, whole.final.v)
    assert (run.dt, run.steps, run.sites) == (whole.dt, whole.steps, whole.sites)
    assert (run.method, run.complete) == (whole.method, whole.complete)


@pytest.mark.parametrize(("name", "at"), [
    pytest.param(*one, marks=[pytest.mark.slow] * (one[0] == "midpoint" or (k + k // 2) % 2))
    for k, one in enumerate(itertools.product(CASES, (0.1, 0.7)))
])  # fmt: skip
def test_an_interrupted_run_goes_on_to_the_same_bits(tmp_path, name, at):
    """Whatever parts it was done in: interrupted after the first, or the second."""
    make, t_end, steps, how = CASES[name]
    scene, state = make()
    how = how | ({"dt": t_end / steps} if steps else {})
    kept = {"every": steps // 50} if steps and at > 0.5 else {"interval": t_end / 21.3}
    whole = simulate(scene, state, t_end, **how, record=Record(sites=[1, 0], **kept))
    path = tmp_path / "run.npy"
    record = Record(sites=[1, 0], **kept, path=path, checkpoint=1e9)
    part = simulate(scene, state, t_end, **how, record=record, observe=ctrl_c(at * t_end))
    assert not part.complete
    assert 0 < part.steps < whole.steps
    run = resume(path, scene)
    same(run, whole)
    assert repr(run.scene) == repr(scene)
    assert np.array_equal(np.load(path)["v"], whole.v)
    same(resume(path, scene), whole)  # again: nothing is left to do


def test_a_full_disk_loses_the_row_and_not_the_run(tmp_path, monkeypatch):
    scene, state = blow()
    whole = simulate(scene, state, 8.0, dt=0.1, record=Record(every=2))
    path, write, calls = tmp_path / "run.npy", os.pwrite, []

    def full(file, data, place):
        calls.append(place)
        if len(calls) > 20:
            raise OSError(28, "No space left on device")
        return write(file, data, place)

    monkeypatch.setattr("os.pwrite", full)
    record = Record(every=2, path=path, checkpoint=0.0)
    with pytest.raises(RecordError, match="No space left") as caught:
        simulate(scene, state, 8.0, dt=0.1, record=record)
    monkeypatch.undo()
    kept = len(np.load(path))
    assert kept == len(caught.value.run.t) == 9
    same(resume(path), whole)


def test_a_state_that_cannot_be_written_leaves_the_one_before(tmp_path, monkeypatch):
    scene, state = blow()
    how = {"dt": 8.0 / many_steps(23), "method": "verlet"}
    whole = simulate(scene, state, 8.0, **how, record=Record(interval=0.1))
    path, replace, calls = tmp_path / "run.npy", os.replace, []

    def full(one, two):
        calls.append(two)
        if len(calls) > 3:
            raise OSError(28, "No space left on device")
        replace(one, two)

    monkeypatch.setattr("os.replace", full)
    record = Record(interval=0.1, path=path, checkpoint=0.0)
    words = r"run\.npy\.state\.npz cannot be written: No space left"
    with pytest.raises(RecordError, match=words) as caught:
        simulate(scene, state, 8.0, **how, record=record)
    monkeypatch.undo()
    assert np.array_equal(np.load(path)["t"], caught.value.run.t)
    same(resume(path), whole)
    assert sorted(x.name for x in tmp_path.iterdir()) == ["run.npy", "run.npy.state.npz"]


def test_a_run_that_locked_locks_again(tmp_path):
    one, path = prism_chain(), tmp_path / "run.npy"
    record = Record(every=10, path=path, checkpoint=1e9)
    with pytest.raises(LockingError) as first:
        simulate(one, one.at_rest({0: 0.3}), 9.0, dt=0.001, record=record)
    with pytest.raises(LockingError) as second:
        resume(path)
    assert str(first.value) == str(second.value)
    assert np.array_equal(first.value.run.t, second.value.run.t)


def test_a_scene_of_a_users_own_energy_is_asked_for_and_recognised(tmp_path):
    one, path = toda(), tmp_path / "run.npy"
    state, how = one.at_rest({0: 0.5}), {"dt": 5.0 / many_steps(11), "record": Record(interval=0.2)}
    whole = simulate(one, state, 5.0, **how)
    how["record"] = Record(interval=0.2, path=path, checkpoint=1e9)
    simulate(one, state, 5.0, **how, observe=ctrl_c(2.0))
    with pytest.raises(TensegrityError, match=r"give it as `scene`; it printed Chain\(12 sites"):
        resume(path)
    heavier = Chain(one.springs[0], 12, 2.0)
    for wrong in (toda(2.1), heavier, prism_chain(12), Chain(one.springs[0], 13), "chain"):
        with pytest.raises(TensegrityError, match="is not that of"):
            resume(path, scene=wrong)
    same(resume(path, scene=toda()), whole)


def followed_by(stiffness):
    """Three discs whose new contacts are given by a function with a captured value."""

    def law(site, other):
        return PowerLaw(stiffness, 1.5)

    places = [[0.0, 0.0], [1.2, 0.0], [2.6, 0.0]]
    return Network(places, (), PowerLaw(1.0, 1.5), radius=0.5, contacts="follow", law=law)


def packed_by(constant):
    """Beads on a floor whose later contacts have a law with a captured value."""

    def law(bead, other):
        return Contact(constant, 1.5)

    return hexagonal_pack(2, 2, bead=STEEL, contacts="follow", law=law)


@pytest.mark.parametrize(
    ("make", "value", "t_end", "speed"),
    [(followed_by, 2.0, 3.0, (1.0, 0.0)), (packed_by, 2e9, 1e-4, (0.0, 0.5))],
)  # fmt: skip
def test_a_scene_with_a_function_is_recognised_by_what_that_captures(
    tmp_path, make, value, t_end, speed
):
    scene, path = make(value), tmp_path / "run.npy"
    state, how = scene.at_rest({0: speed}), {"dt": t_end / 4000, "method": "verlet"}
    whole = simulate(scene, state, t_end, **how, record=Record(every=100))
    record = Record(every=100, path=path, checkpoint=1e9)
    simulate(scene, state, t_end, **how, record=record, observe=ctrl_c(t_end / 2))
    with pytest.raises(TensegrityError, match="numbers or functions in these differ"):
        resume(path, make(1.1 * value))
    run = resume(path, make(value))
    for name in ("t", "u", "v", "energy"):
        np.testing.assert_array_equal(getattr(run, name), getattr(whole, name), name)


def test_a_scene_that_no_checkpoint_can_know_is_refused_before_any_work(tmp_path):
    places, lock = [[0.0, 0.0], [1.2, 0.0]], Lock()

    def law(site, other):
        with lock:
            return PowerLaw(1.0, 1.5)

    scene = Network(places, (), PowerLaw(1.0, 1.5), radius=0.5, contacts="follow", law=law)
    state, record = scene.at_rest({0: (1.0, 0.0)}), Record(path=tmp_path / "a.npy", checkpoint=1)
    with pytest.raises(TensegrityError, match=r"law uses lock: .* has no contents"):
        simulate(scene, state, 1.0, dt=0.1, record=record)
    assert not [*tmp_path.iterdir()]
    simulate(scene, state, 1.0, dt=0.01).save(tmp_path / "run.npz")  # its print alone
    assert repr(Run.load(tmp_path / "run.npz").scene) == repr(scene)


def test_a_driven_scene_is_recognised_by_its_expressions(tmp_path):
    path, (scene, state) = tmp_path / "rows.npy", moved()
    simulate(scene, state, 1.0, dt=0.05, record=Record(path=path, checkpoint=0.0))
    with pytest.raises(TensegrityError, match="give it as `scene`"):
        resume(path)
    drive, damping = scene.drive, scene.damping
    for other in (
        {"drive": drive | {4: Drive(force=0.1 * sp.sin(T))}, "damping": damping},
        {"drive": drive, "damping": Damping(bond=0.2, ground=0.11)},
        {"drive": drive},
        {},
    ):
        with pytest.raises(TensegrityError, match="is not that of"):
            resume(path, Chain(scene.springs[0], 8, **other))
    assert resume(path, moved()[0]).complete


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
    state_file(path).write_bytes(state_file(path).read_bytes()[:-200])
    with pytest.raises(TensegrityError, match="holds no state, or is damaged"):
        resume(path)


KILLED = """
import os, signal, sys
from tensegrity import Record, resume, simulate
from test_resume import SLOW, shaken
path, left, write = sys.argv[1], int(sys.argv[2]), os.pwrite

def last(file, data, place):
    global left
    left -= 1
    if left < 0:
        write(file, data[: len(data) // 2], place)
        os.kill(os.getpid(), signal.SIGKILL)
    return write(file, data, place)

os.pwrite, (scene, state) = last, shaken()
if os.path.exists(path + ".state.npz"):
    resume(path, scene)
else:
    simulate(scene, state, **SLOW, record=Record(interval=0.0413, path=path, checkpoint=0.0))
"""
SLOW = {"t_end": 4.0, "dt": 4e-4, "method": "rkn6"}


def started(code, *words, **how):
    """A process that runs code with the folder of tests at hand."""
    here = os.path.dirname(__file__)
    environment = {**os.environ, "PYTHONPATH": os.pathsep.join([here, os.path.dirname(here)])}
    return subprocess.Popen([sys.executable, "-c", code, *words], env=environment, **how)


def kills(path, dice, count):
    """Kill it in the midst of a write, look, and go on in a new process that is killed as well."""
    scene, state = shaken()
    whole, seen = simulate(scene, state, **SLOW, record=Record(interval=0.0413)), 0
    for _ in range(count):
        code = started(KILLED, str(path), str(dice.randrange(3, 40))).wait()
        assert code in (0, -signal.SIGKILL)
        rows = np.load(path, allow_pickle=False)
        assert len(rows) >= seen  # nothing that was there is gone
        seen = len(rows)
        assert np.array_equal(rows["t"], whole.t[:seen])
        assert np.array_equal(rows["u"], whole.u[:seen])
        if code == 0:
            break
    assert seen > 0
    same(resume(path, scene), whole)


def test_a_killed_run_is_resumed_to_the_same_bits(tmp_path):
    kills(tmp_path / "run.npy", random.Random(1), 3)


@pytest.mark.slow
def test_kills_at_twenty_random_moments_lose_nothing(tmp_path):
    for number in range(5):
        kills(tmp_path / f"{number}.npy", random.Random(number), 4)


def test_any_damage_to_the_rows_is_refused_or_harmless(tmp_path):
    scene, state = blow()
    path = tmp_path / "run.npy"
    whole = simulate(scene, state, 1.0, dt=0.1, record=Record(path=path, checkpoint=0, every=1))
    kept, rng = path.read_bytes(), np.random.default_rng(4)
    damage = [(n, int(byte)) for n in range(140) for byte in rng.choice(list(b"\0\xff([{'\n9"), 2)]
    damage += [(place, 255) for place in rng.integers(len(kept), size=40).tolist()]
    for place, byte in damage:
        path.write_bytes(kept[:place] + bytes([byte]) + kept[place + 1 :])
        try:
            run = resume(path)
        except TensegrityError:
            continue
        assert np.array_equal(run.final.u, whole.final.u)


WAITING = """
import sys
from tensegrity import Record, simulate
from test_resume import blow
chain, state = blow()
record = Record(path=sys.argv[1], checkpoint=0.0)
simulate(chain, state, 1.0, dt=0.1, record=record, observe=lambda *_: print(flush=True) or input())
"""


def test_a_second_run_of_a_path_is_refused_before_it_writes(tmp_path):
    """A process that is killed holds nothing."""
    (scene, state), path = blow(), tmp_path / "run.npy"
    running = started(WAITING, str(path), stdin=subprocess.PIPE, stdout=subprocess.PIPE)
    running.stdout.readline()
    try:
        files = {x.name: x.read_bytes() for x in tmp_path.iterdir()}
        with pytest.raises(RecordError, match=r"run\.npy is being written by another run"):
            resume(path)
        for record in (Record(path=path), Record(path=path, checkpoint=0)):
            with pytest.raises(TensegrityError, match=r"record path .*run\.npy exists"):
                simulate(scene, state, 1.0, dt=0.1, record=record)
        assert {x.name: x.read_bytes() for x in tmp_path.iterdir()} == files
    finally:
        running.kill()
        running.communicate()
    assert resume(path).complete


def test_of_two_runs_that_begin_a_path_at_once_one_is_refused(tmp_path, monkeypatch):
    """The other begins between the look for the file and its own."""
    (scene, state), path, write, inner = blow(), tmp_path / "run.npy", os.pwrite, []

    def later(file, data, place):
        if not inner:
            inner.append(None)
            with pytest.raises(RecordError, match=r"run\.npy is being written by another run"):
                simulate(scene, state, 1.0, dt=0.1, record=Record(path=path))
        return write(file, data, place)

    monkeypatch.setattr("os.pwrite", later)
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
    for part, value in crafted(state_file(path), "state", others):
        with pytest.raises(TensegrityError, match=r"holds no state, or is damaged|record path"):
            print(part, value, resume(path))
    assert resume(path).complete


@pytest.mark.parametrize("every", [1, 3])
def test_rows_of_another_run_are_refused(tmp_path, every):
    scene, state = blow()
    paths = [tmp_path / "one.npy", tmp_path / "other.npy"]
    for path, part in zip(paths, (1.0, 1.1), strict=True):
        record = Record(every=every, path=path, checkpoint=0)
        simulate(scene, State(state.u, part * state.v), 5e-5, dt=1e-6, record=record)
    paths[0].write_bytes(paths[1].read_bytes())
    with pytest.raises(TensegrityError, match=r"row \d+ is not that of the checkpoint"):
        print(resume(paths[0]))
    assert resume(paths[1]).complete
