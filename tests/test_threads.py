"""Answers do not depend on the thread that asks, nor on what other threads ask meanwhile."""

import os
import subprocess
import sys
import threading
from concurrent.futures import ThreadPoolExecutor
from pathlib import Path

import mpmath
import numpy as np
import pytest
from networks import patch, pushed

from tensegrity import (
    Chain,
    PowerLaw,
    Prism,
    TensegrityError,
    equilibrium_path,
    equilibrium_paths,
    simulate,
    solitary_wave,
)
from tensegrity.once import SIZE, once
from tensegrity.prisms.fold_curve import limit_load

THREADS = 4
ROOT = Path(__file__).parent.parent


def prisms(count):
    """Rigid prisms, elastic ones, and such with rigid bases, all different."""
    for k in range(count):
        bases, bars = (20.0 + k, np.inf, np.inf)[k % 3], (200.0 + k, 150.0 + k, np.inf)[k % 3]
        yield Prism(1.0, 0.6 + 0.004 * k, 0.05, 1.0, bases, bars)


def numbers(prism, preload=0.01):
    """Bytes of what its public calls give: potential, derivatives, paths, limit."""
    spring = prism.potential(preload)
    r = np.linspace(spring.domain[0] / 2, spring.domain[1] / 2, 7)
    found = [spring.domain, spring.length, spring.tension(r), spring.stiffness(r)]
    found += [spring.stiffness_slope(r), prism.axial_stiffness(), prism.natural_lengths()]
    for path in (equilibrium_path(prism), equilibrium_path(prism, max_height=prism.height + 0.1)):
        found += [*path.columns.values(), *([e.row, *e.at.values()] for e in path.events)]
    try:
        found += limit_load(prism, prism.prestrain + 0.01).columns.values()
    except TensegrityError as error:
        found.append(np.frombuffer(str(error).encode(), np.uint8))
    return [np.asarray(x, dtype=float).tobytes() for x in found]


def scene(preload):
    """Bytes of a wave and of two runs on springs of this preload."""
    elastic = Prism(1.0, 0.7, 0.05, 1.0, 20.0, 200.0).potential(preload)
    rigid, contact = Prism(1.0, 0.7, 0.05, 1.0).potential(preload), PowerLaw(1.0, 1.5, preload)
    wave = solitary_wave(rigid, speed_ratio=1.1)
    found = [wave.speed, elastic.energy(np.linspace(elastic.domain[0] / 2, 0.01, 9))]
    for spring in (elastic, rigid, contact):
        chain = Chain(spring, 30)
        run = simulate(chain, chain.at_rest({0: 0.01}), 5.0, tol=1e-6)
        found += [run.u, run.v, run.energy]
    return [np.asarray(x, dtype=float).tobytes() for x in found]


@pytest.fixture(autouse=True)
def eager():
    """Threads that take turns as often as they can."""
    usual = sys.getswitchinterval()
    sys.setswitchinterval(1e-5)
    yield
    sys.setswitchinterval(usual)


@pytest.mark.parametrize(
    ("work", "given"), [(numbers, [*prisms(10)]), (scene, [0.01, 0.02, 0.03, 0.04])]
)
def test_threads_get_the_same_bits_as_one_alone(work, given):
    alone = [*map(work, given)]
    with ThreadPoolExecutor(THREADS) as pool:
        together = [*pool.map(work, given)]
    assert [k for k, (a, b) in enumerate(zip(alone, together, strict=True)) if a != b] == []


def test_threads_may_run_one_scene_at_once():
    chain = Chain(Prism(1.0, 0.7, 0.05, 1.0, 20.0, 200.0).potential(), 30)
    network = patch()

    def runs(speed):
        found = [simulate(network, pushed(network, speed), 1.0)]
        found.append(simulate(chain, chain.at_rest({0: speed}), 5.0, tol=1e-6))
        return [x.tobytes() for run in found for x in (run.u, run.v, run.energy)]

    speeds = [0.01, 0.015, 0.02, 0.025]
    with ThreadPoolExecutor(THREADS) as pool:
        together = [*pool.map(runs, speeds)]
    assert together == [*map(runs, speeds)]


@pytest.mark.parametrize("compiler", ["", "no-such-compiler"])
def test_first_calls_of_a_process_may_come_from_many_threads(compiler, tmp_path):
    """Nothing is built when they start; the parent, where all is, gives the reference."""
    code = (
        "import sys, threading, warnings; sys.path.insert(0, 'tests'); import test_threads as t\n"
        "warnings.simplefilter('ignore'); sys.setswitchinterval(1e-5)\n"
        "start, found, given = threading.Barrier(6), {}, [*t.prisms(6)]\n"
        "def ask(k):\n"
        "    start.wait(); found[k] = t.numbers(given[k])\n"
        "threads = [threading.Thread(target=ask, args=(k,)) for k in range(6)]\n"
        "[x.start() for x in threads]; [x.join() for x in threads]\n"
        "assert [found[k] for k in range(6)] == [t.numbers(x) for x in given]\n"
    )
    environment = {**os.environ, "PYTHONPATH": str(ROOT)}
    environment |= {"CC": compiler} if compiler else {}
    subprocess.run([sys.executable, "-c", code], cwd=ROOT, env=environment, check=True)


def test_precision_of_the_readers_own_arithmetic_is_left_alone():
    """Threads that set mpmath's one precision back would leave each other's there."""
    with mpmath.workdps(7):
        for prism in prisms(3):
            prism.axial_stiffness()
        assert mpmath.mp.dps == 7
    with ThreadPoolExecutor(THREADS) as pool:
        list(pool.map(Prism.axial_stiffness, [*prisms(300)]))
    assert mpmath.mp.dps == 15


def test_a_builder_runs_once_whoever_asks():
    calls = []

    @once
    def build(name):
        calls.append(name)
        return object()

    with ThreadPoolExecutor(THREADS) as pool:
        found = [*pool.map(build, ["a"] * 50)]
    assert calls == ["a"]
    assert len(set(map(id, found))) == 1


def test_a_builder_that_fails_is_asked_again():
    answers = iter([ZeroDivisionError, 7])

    @once
    def build():
        answer = next(answers)
        if answer is ZeroDivisionError:
            raise answer
        return answer

    with pytest.raises(ZeroDivisionError):
        build()
    assert build() == build() == 7


def test_paths_of_many_prisms_are_those_of_each_in_their_order():
    given = [*prisms(9), Prism(1.0, 0.7, 0.05, 1.0)] * 4
    with ThreadPoolExecutor(3) as workers:
        several = [equilibrium_paths(given, max_height=0.75, executor=x) for x in (None, workers)]
    for found in several:
        assert [path.prism for path in found] == given
        for prism, path in zip(given, found, strict=True):
            alone = equilibrium_path(prism, max_height=0.75)
            assert str(path) == str(alone)
            for name, column in alone.columns.items():
                assert column.tobytes() == path.columns[name].tobytes()
    assert equilibrium_paths([]) == []


def test_one_wrong_prism_among_many_is_refused():
    with pytest.raises(TensegrityError, match=r"0\.65 m must be below the height 0\.6 m"):
        equilibrium_paths([Prism(1.0, 0.7, 0.05, 1.0), Prism(1.0, 0.6, 0.05, 1.0)], min_height=0.65)
    for wrong in (Prism(1.0, 0.7, 0.05, 1.0), [1.0], None, "prisms"):
        with pytest.raises(TensegrityError, match=r"[pP]rism"):
            equilibrium_paths(wrong)


def test_different_objects_are_built_at_the_same_time():
    both = threading.Barrier(2, timeout=60)

    @once
    def build(name):
        both.wait()  # passed only by two builders together
        return name

    with ThreadPoolExecutor(2) as pool:
        assert [*pool.map(build, "ab")] == ["a", "b"]


def test_old_results_are_forgotten_and_the_cache_stays_bounded():
    @once
    def build(number):
        return [number]

    first = build(0)
    assert build(0) is first
    for number in range(1, SIZE + 1):
        build(number)
    assert build(SIZE) is build(SIZE)
    assert build(0) == first
    assert build(0) is not first


@pytest.mark.skipif(not hasattr(os, "fork"), reason="needs fork")
def test_a_forked_process_does_not_wait_for_a_builder_that_it_has_not():
    code = (
        "import os, threading; from tensegrity.once import once\n"
        "begun, go_on = threading.Event(), threading.Event()\n"
        "@once\n"
        "def build():\n"
        "    begun.set(); go_on.wait(); return 7\n"
        "thread = threading.Thread(target=build); thread.start(); begun.wait()\n"
        "child = os.fork()\n"
        "go_on.set()\n"
        "if child == 0: os._exit(build())\n"
        "assert os.waitstatus_to_exitcode(os.waitpid(child, 0)[1]) == 7; thread.join()\n"
    )
    environment = {**os.environ, "PYTHONPATH": str(ROOT)}
    subprocess.run([sys.executable, "-c", code], env=environment, check=True, timeout=60)
