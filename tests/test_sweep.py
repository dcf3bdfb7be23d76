"""Sweeps: results in order, failures kept, workers that die, checkpoints."""

import ast
import os
import subprocess
import sys
from concurrent.futures import ProcessPoolExecutor, ThreadPoolExecutor
from functools import partial
from threading import Lock

import numpy as np
import pytest
from crafted import crafted, parts, written
from designs import square_or_die, square_or_die_once, squared
from test_design_search import ROOT, run_and_kill
from test_identity import PAIRS, tables

from tensegrity import TensegrityError, sweep


def test_results_come_in_the_order_of_the_cases_and_failures_with_their_errors():
    cases = [3, "x", 2, None, 1]
    expected = [9, "TypeError", 4, "TypeError", 1]
    with ProcessPoolExecutor(2) as pool, ThreadPoolExecutor(3) as threads:
        for executor in (None, pool, threads):
            found = sweep(squared, cases, executor)
            for number, (result, wanted) in enumerate(zip(found, expected, strict=True)):
                if isinstance(wanted, str):
                    assert not isinstance(result, int)
                    assert (result.number, result.lost) == (number, False)
                    assert result.error.startswith(wanted)
                else:
                    assert result == wanted
    assert sweep(squared, []) == []


def test_a_case_whose_worker_dies_is_repeated_once_and_the_others_are_not_lost(tmp_path):
    with ProcessPoolExecutor(2) as pool:
        cases = [(x, tmp_path / f"died{x}" if x == 5 else tmp_path) for x in range(20)]
        assert sweep(square_or_die_once, cases, pool) == [x * x for x in range(20)]
    with ProcessPoolExecutor(2) as pool:
        found = sweep(square_or_die, [1, 2, -3, 4, -5, *range(6, 30)], pool)
    dead = {k: one for k, one in enumerate(found) if not isinstance(one, int)}
    assert {k: (one.number, one.lost) for k, one in dead.items()} == {2: (2, True), 4: (4, True)}
    assert "BrokenProcessPool" in dead[2].error
    assert [x for x in found if isinstance(x, int)] == [x * x for x in (1, 2, 4, *range(6, 30))]


def test_cases_that_are_sent_together_are_lost_one_by_one():
    cases = [*range(1, 400)]
    cases[300] = -7
    with ProcessPoolExecutor(2) as pool:
        found = sweep(square_or_die, cases, pool)
    assert (found[300].number, found[300].lost) == (300, True)
    assert [*found[:300], *found[301:]] == [x * x for x in cases if x > 0]


def test_a_sweep_goes_on_from_its_checkpoint(tmp_path):
    path, log = tmp_path / "sweep.npz", tmp_path / "log"

    def seen():
        return [int(x) for x in log.read_text().split()]

    def counted(x):
        with open(log, "a") as file:
            print(x, file=file)
        if len(seen()) == 3:
            raise KeyboardInterrupt
        return {"value": x, "row": np.arange(x)}

    with pytest.raises(KeyboardInterrupt):
        sweep(counted, range(6), checkpoint=path)
    assert len(parts(path, "sweep")["numbers"]) == 2
    found = sweep(counted, range(6), checkpoint=path)
    assert seen() == [0, 1, 2, 2, 3, 4, 5]
    assert [one["value"] for one in found] == list(range(6))
    np.testing.assert_array_equal(found[4]["row"], np.arange(4))
    assert [one["value"] for one in sweep(counted, range(8), checkpoint=path)] == list(range(8))
    assert seen()[7:] == [6, 7]  # a longer list computes what is new
    assert [one["value"] for one in sweep(counted, range(3), checkpoint=path)] == [0, 1, 2]
    assert len(sweep(counted, range(8), checkpoint=path)) == 8
    assert len(seen()) == 9  # a shorter one loses nothing
    long = "x" * 100
    assert sweep(len, [long + "1", 5], checkpoint=tmp_path / "long.npz")[0] == 101
    with pytest.raises(TensegrityError, match=r"its case 0 is .*xx1', here .*xx2'$") as caught:
        sweep(len, [long + "2"], checkpoint=tmp_path / "long.npz")
    assert len(str(caught.value)) < 400
    with pytest.raises(TensegrityError, match="its case 2 is 2, here -2"):
        sweep(counted, [0, 1, -2], checkpoint=path)
    with pytest.raises(TensegrityError, match="of another sweep: its function"):
        sweep(squared, range(6), checkpoint=path)


def test_what_a_checkpoint_cannot_hold_is_refused(tmp_path):
    def returned(x):
        return x

    masked = np.ma.masked_array([1, 2], [0, 1])
    words = r"(?s)result of case 0 is .*cannot store: return num"
    for result in (object(), np.array([None]), masked, {(1, 2): object()}):
        with pytest.raises(TensegrityError, match=words):
            sweep(returned, [result], checkpoint=tmp_path / "x.npz")


def test_results_by_pairs_are_read_back_from_a_checkpoint(tmp_path):
    expected = [{(1, x): {np.int64(x): "a", 2.5: None}} for x in range(3)]
    for _ in range(2):
        assert sweep(by_pairs, range(3), checkpoint=tmp_path / "x.npz") == expected


def test_a_checkpoint_tells_functions_with_other_arguments_apart(tmp_path):
    path = tmp_path / "x.npz"
    for _ in range(2):
        assert sweep(partial(round, ndigits=1), [0.26], checkpoint=path) == [0.3]
    words = r"its function is builtins[.]round with ndigits=1, here .* with ndigits=2"
    with pytest.raises(TensegrityError, match=words):
        sweep(partial(round, ndigits=2), [0.26], checkpoint=path)
    assert sorted(tmp_path.iterdir()) == [path]


@pytest.mark.parametrize(
    "name", ["objects", "masks", "lambdas", "changing scenes", "series", "frames"]
)
def test_a_checkpoint_does_not_take_one_case_for_another(name, tmp_path):
    """Also where they print alike."""
    if name not in (pairs := PAIRS | tables()):
        pytest.skip("pandas is not installed")
    (one, other), path = pairs[name], tmp_path / "x.npz"
    assert sweep(type_of, [1, one()], checkpoint=path) == ["int", type(one()).__name__]
    assert len(sweep(type_of, [1, one()], checkpoint=path)) == 2
    before = path.read_bytes()
    with pytest.raises(TensegrityError, match="is of another sweep: its case 1 is "):
        sweep(type_of, [1, other()], checkpoint=path)
    assert path.read_bytes() == before


def type_of(x):
    return type(x).__name__


@pytest.mark.parametrize("name", ["lambdas", "nested functions", "globals", "code", "methods"])
def test_a_checkpoint_knows_a_function_by_its_code_and_what_it_captures(name, tmp_path):
    """A result of the other function would be returned for it."""
    (one, other), path = PAIRS[name], tmp_path / "x.npz"
    first = sweep(one(), [2.0, 3.0], checkpoint=path)
    assert sweep(one(), [2.0, 3.0], checkpoint=path) == first != sweep(other(), [2.0, 3.0])
    with pytest.raises(TensegrityError, match="is of another sweep: its function is "):
        sweep(other(), [2.0, 3.0], checkpoint=path)


def test_what_no_checkpoint_can_know_is_refused_before_any_work(tmp_path):
    lock, seen = Lock(), []

    def locked(x):
        with lock:
            return seen.append(x)

    words = r"the function of a sweep: .*locked uses lock: .*lock.* cannot pickle"
    with pytest.raises(TensegrityError, match=words):
        sweep(locked, [1], checkpoint=tmp_path / "x.npz")
    with pytest.raises(TensegrityError, match=r"no checkpoint can know the case 1 of a sweep"):
        sweep(type_of, [1, lock], checkpoint=tmp_path / "x.npz")
    assert not seen
    assert not [*tmp_path.iterdir()]


def test_two_sweeps_with_one_checkpoint_both_end(tmp_path, monkeypatch):
    """The other one writes, as a whole, while the first one does."""
    path, replace, inner = tmp_path / "x.npz", os.replace, []

    def later(one, two):
        if not inner:
            inner.append(None)
            inner[:] = sweep(squared, range(5), checkpoint=path)
        replace(one, two)

    monkeypatch.setattr("os.replace", later)
    assert sweep(squared, range(5), checkpoint=path) == inner == [0, 1, 4, 9, 16]
    assert [*tmp_path.iterdir()] == [path]
    assert sorted(parts(path, "sweep")["numbers"]) == [0, 1, 2, 3, 4]


def test_a_checkpoint_of_another_form_is_refused(tmp_path):
    path = tmp_path / "x.npz"
    sweep(squared, range(3), checkpoint=path)
    others = {"of": [{"function": "designs.squared"}], "numbers": [[3], [-1], [0.5]]}
    for part, value in crafted(path, "sweep", others):
        if part == "results" and value != "left out":
            continue  # anything may be
        with pytest.raises(TensegrityError, match="holds no sweep, or is damaged"):
            print(part, value, sweep(squared, range(3), checkpoint=path))


def test_a_checkpoint_that_does_not_say_of_which_function_is_refused(tmp_path):
    path = tmp_path / "x.npz"
    sweep(squared, range(3), checkpoint=path)
    whole = parts(path, "sweep")
    cases = {name: known for name, known in whole["of"].items() if name != "function"}
    one = {"of": cases, "numbers": whole["numbers"][:1], "results": whole["results"][:1]}
    written(path, "sweep", one)
    with pytest.raises(TensegrityError, match="of another sweep: its function is missing, here"):
        sweep(squared, range(3), checkpoint=path)


def by_pairs(x):
    return {(1, x): {np.int64(x): "a", 2.5: None}}


def test_a_checkpoint_without_a_folder_is_refused_before_any_work(tmp_path):
    seen = []
    with pytest.raises(TensegrityError, match="there is no folder"):
        sweep(seen.append, [1], checkpoint=tmp_path / "none" / "x.npz")
    assert not seen


@pytest.mark.slow
def test_a_sweep_that_is_killed_ends_with_the_same_results(tmp_path):
    path = tmp_path / "sweep.npz"
    for case in (3, 17, 17, 39):
        assert run_and_kill("sweep", path, case) is None
    last = run_and_kill("sweep", path)
    assert ast.literal_eval(last) == [x * x for x in range(40)]


@pytest.mark.parametrize(
    ("call", "words"),
    [
        (lambda: sweep("abs", [1]), "function 'abs' cannot be called"),
        (lambda: sweep(abs, 3), "cases 3 must be a sequence"),
        (lambda: sweep(abs, [1], executor="pool"), "not a concurrent.futures.Executor"),
        (lambda: sweep(abs, [1], checkpoint=3), "checkpoint 3 is not a path"),
    ],
)
def test_bad_input_is_refused(call, words):
    with pytest.raises(TensegrityError, match=words):
        call()


def test_a_function_that_other_processes_cannot_import_is_refused_before_any_work():
    with (
        ProcessPoolExecutor(1) as pool,
        pytest.raises(TensegrityError, match="cannot be sent to other processes"),
    ):
        sweep(lambda x: x, [1], pool)


@pytest.mark.slow
def test_a_search_under_mpi_gives_the_result_of_one_process(tmp_path):
    pytest.importorskip("mpi4py")
    from shutil import which

    if which("mpiexec") is None:
        pytest.skip("mpiexec is not installed")
    code = (
        "import sys; sys.path.insert(0, 'tests'); import designs\n"
        "from mpi4py.futures import MPIPoolExecutor\n"
        "if __name__ == '__main__':\n"
        "    with MPIPoolExecutor() as pool:\n"
        "        one, two = designs.small_search(), designs.small_search(executor=pool)\n"
        "    print(one.peak_force == two.peak_force, (one.history == two.history).all())\n"
    )
    script = tmp_path / "under_mpi.py"
    script.write_text(code)
    answer = subprocess.run(
        ["mpiexec", "-n", "3", sys.executable, "-m", "mpi4py.futures", str(script)],
        capture_output=True, text=True, cwd=ROOT, timeout=600,
    )  # fmt: skip
    assert answer.stdout.split() == ["True", "True"], answer.stderr
