"""Searches for protectors: they find what is known, again and again, and survive what happens."""

import ast
import os
import random
import signal
import subprocess
import sys
from concurrent.futures import ProcessPoolExecutor, ThreadPoolExecutor
from pathlib import Path

import designs
import numpy as np
import pytest
from crafted import parts, written
from designs import (
    BIG,
    BLOW,
    CHOICE,
    ORDER,
    SIZES,
    SMALL,
    SOFT,
    STEEL,
    STRIKER,
    before_a_wall,
)

from granular import Bead, Striker, materials
from granular.design import Choice, Order, Sizes, finalists, peak_force, search
from granular.design import searching as module
from granular.design.methods import METHODS
from granular.design.objective import wall_peak
from tensegrity import TensegrityError

ROOT = Path(__file__).parent.parent
SHORT = {"t_end": 1e-3, **BLOW}
PAIRS = Order([BIG] * 6 + [SMALL] * 6)


def test_all_orders_of_a_small_space_are_computed_once_and_the_least_is_found():
    """Seventy orders, fewer than the budget: the search ends by itself at the exact optimum."""
    found = search(ORDER, budget=1000, **SHORT)
    assert found.evaluations == 70
    rows = {tuple(row) for row in ORDER.random(np.random.default_rng(0), 5000)}
    assert len(rows) == 70
    every = peak_force([ORDER.beads(row) for row in rows], **SHORT)
    assert found.peak_force == pytest.approx(every.min(), rel=1e-5)
    assert peak_force(found.beads, **SHORT) == every.min()
    assert found.converged_in_time
    np.testing.assert_allclose(found.history.min(), every.min(), rtol=1e-3)
    np.testing.assert_allclose(np.sort(found.history), np.sort(every), rtol=3e-3)


def test_a_method_that_proposes_nothing_new_any_more_ends(monkeypatch):
    monkeypatch.setattr(module, "IDLE", 4)

    def again_and_again(space, rng):
        while True:
            yield space.random(rng, 64)

    monkeypatch.setitem(METHODS, "ga", (again_and_again, (Order,)))
    found = search(Order([BIG] * 2 + [SMALL] * 2), budget=64, **SHORT)
    assert found.evaluations == 6


def test_the_optimum_of_t1_is_found():
    space = Order([BIG] * 10 + [SMALL] * 10)
    found = search(space, budget=5000, seed=1, **SHORT)
    assert found.peak_force == pytest.approx(35.3362969, rel=1e-6)
    word = "".join("A" if bead == BIG else "b" for bead in found.beads)
    assert word == "bbAAAbAAAbbbAAAbAbbb"
    assert found.evaluations <= 5000
    assert found.converged_in_time
    assert [one.t_end for one in found.again] == [1e-3, 1e-3, 1e-3, 1e-2]
    assert "35.33" in str(found)
    assert "NOT" not in str(found)


@pytest.mark.parametrize(
    ("space", "method"),
    [(SIZES, "gradient"), (SIZES, "cma"), (PAIRS, "ga"), (CHOICE, "ga")],
)
def test_every_method_beats_as_many_random_designs(space, method):
    count, t_end = 320, 2e-3
    found = search(space, method=method, budget=count, t_end=t_end, **BLOW)
    rows = space.random(np.random.default_rng(0), count)
    drawn = peak_force([space.beads(row) for row in rows], t_end=t_end, **BLOW)
    assert found.peak_force <= drawn.min() * (1 + 1e-4)
    assert found.method == method
    if space is SIZES:
        assert sum(bead.diameter for bead in found.beads) == pytest.approx(0.042, rel=1e-12)


def test_the_distribution_of_diameters_contracts_to_the_least_value():
    """Sums of squares of distances to a design: 40 generations come to it."""
    rng = np.random.default_rng(0)
    aim = SIZES.random(rng, 1)[0]
    proposals = METHODS["cma"][0](SIZES, rng)
    rows, far = next(proposals), []
    for _ in range(40):
        far.append(np.linalg.norm(rows - aim, axis=1).max())
        rows = proposals.send((rows, ((rows - aim) ** 2).sum(axis=1)))
    assert far[-1] < 1e-2 * far[0]


def same(one, other):
    assert one.peak_force == other.peak_force
    assert one.beads == other.beads
    np.testing.assert_array_equal(one.history, other.history)


def test_one_seed_gives_one_result_here_and_on_workers_of_any_number():
    here = designs.small_search()
    with ProcessPoolExecutor(1) as one, ProcessPoolExecutor(2) as two, ThreadPoolExecutor(2) as t:
        for executor in (one, two, t):
            same(here, designs.small_search(executor=executor))
    assert designs.small_search(seed=4).history[0] != here.history[0]


@pytest.mark.filterwarnings("ignore")
def test_one_seed_gives_one_result_on_a_dask_cluster():
    distributed = pytest.importorskip("dask.distributed")
    path = os.pathsep.join([str(ROOT), str(ROOT / "tests")])
    os.environ["PYTHONPATH"] = os.pathsep.join([path, os.environ.get("PYTHONPATH", "")])
    with (
        distributed.LocalCluster(2, threads_per_worker=1, dashboard_address=None) as cluster,
        distributed.Client(cluster) as client,
    ):
        client.wait_for_workers(1, timeout=60)  # the second one does not come on one core
        same(designs.small_search(), designs.small_search(executor=client.get_executor()))


def test_a_search_goes_on_from_its_checkpoint_and_computes_nothing_twice(tmp_path, monkeypatch):
    path = tmp_path / "search.npz"
    whole = designs.small_search()
    first = designs.small_search(path, budget=200)
    assert first.evaluations == 200
    computed = []
    plain = module.Problem.__call__
    monkeypatch.setattr(
        module.Problem, "__call__", lambda self, x: computed.append(len(x)) or plain(self, x)
    )
    same(whole, designs.small_search(path))
    again = 2 * finalists.FINALISTS + 1
    assert sum(computed) == 640 - 200 + again
    computed.clear()
    same(whole, designs.small_search(path))
    assert sum(computed) == again
    assert [p.name for p in tmp_path.iterdir()] == ["search.npz"]


def test_a_checkpoint_of_another_search_is_refused_with_the_difference(tmp_path):
    path = tmp_path / "search.npz"
    search(ORDER, checkpoint=path, budget=64, **SHORT)
    for words, changed in (
        ("seed is 0, here 1", {"seed": 1}),
        ("t_end is 0.001, here 0.002", {"t_end": 2e-3}),
        ("wall is", {"wall": materials["ptfe"]}),
    ):
        with pytest.raises(TensegrityError, match=words):
            search(ORDER, checkpoint=path, budget=64, **(SHORT | changed))
    other = tmp_path / "sizes.npz"
    search(SIZES, checkpoint=other, budget=64, method="cma", **SHORT)
    with pytest.raises(TensegrityError, match="method is 'cma', here 'gradient'"):
        search(SIZES, checkpoint=other, budget=64, **SHORT)
    heavy = Bead(STRIKER.bead.diameter, STRIKER.bead.material, 2 * STRIKER.bead.mass)
    with pytest.raises(
        TensegrityError, match=r"striker is .*mass=(\S+),.*, here .*mass=(\S+),"
    ) as e:
        search(ORDER, checkpoint=path, budget=64, **(SHORT | {"striker": Striker(heavy, 0.5)}))
    assert len(str(e.value)) < 400
    with pytest.raises(TensegrityError, match="its space is Order"):
        search(CHOICE, checkpoint=path, budget=64, **SHORT)
    kept = parts(path, "search")
    written(path, "search", kept | {"digest": "another"})
    with pytest.raises(TensegrityError, match="not those that this search proposes"):
        search(ORDER, checkpoint=path, budget=64, **SHORT)
    path.write_bytes(b"no archive")
    with pytest.raises(TensegrityError, match="damaged"):
        search(ORDER, checkpoint=path, budget=64, **SHORT)


def run_and_kill(mode, path, after=10**9):
    """What a program of `designs` prints, or None if it is killed, after so many files or cases."""
    command = [sys.executable, str(ROOT / "tests" / "designs.py"), mode, str(path), str(after)]
    environment = os.environ | {"PYTHONPATH": str(ROOT)}
    answer = subprocess.run(command, stdout=subprocess.PIPE, text=True, cwd=ROOT, env=environment)
    assert answer.returncode in (0, -signal.SIGKILL)
    return None if answer.returncode else answer.stdout


@pytest.mark.slow
def test_killed_at_random_moments_a_search_loses_a_batch_at_most(tmp_path):
    path, dice, done = tmp_path / "search.npz", random.Random(1), 0
    whole = designs.small_search()
    while done < 640:
        count = dice.randint(1, 3)
        found = run_and_kill("search", path, count)
        assert found is None or done + 64 * count >= 640
        last, done = done, len(parts(path, "search")["forces"])
        assert done == min(last + 64 * count, 640)
        if found:
            break
    value, evaluations, history = ast.literal_eval(run_and_kill("search", path))
    assert (value, evaluations) == (whole.peak_force, 640)
    assert history == whole.history.tobytes().hex()


def test_designs_lost_with_a_worker_twice_are_kept_as_failed(monkeypatch):
    plain = module.Problem.__call__

    def deadly(self, genes):
        if os.getpid() != parent and (genes == victim).all(axis=1).any():
            os._exit(1)
        return plain(self, genes)

    parent = os.getpid()
    victim = CHOICE.random(np.random.default_rng(0), 64)[20]
    monkeypatch.setattr(module.Problem, "__call__", deadly)
    with ProcessPoolExecutor(2) as pool:
        found = search(CHOICE, budget=64, executor=pool, **SHORT)
    assert found.failed == 16  # those of one part
    assert np.isinf(found.history[16:32]).all()
    assert np.isfinite(found.history).sum() == 48
    assert "16 designs were lost" in str(found)


def test_a_design_that_moves_with_the_step_is_not_taken(monkeypatch):
    """An optimiser finds integration errors: here one design is far too good with long steps."""
    plain = module.Problem.__call__
    victim = ORDER.random(np.random.default_rng(0), 64)[5]

    def flattered(self, genes):
        mine = (genes == victim).all(axis=1)
        return np.where(mine, 1.0 / self.dt**0.1, plain(self, genes))

    monkeypatch.setattr(module.Problem, "__call__", flattered)
    found = search(ORDER, budget=64, **SHORT)
    assert found.history.min() == found.history[5] < 10
    assert found.rejected >= 1
    assert found.beads != ORDER.beads(victim)
    assert found.converged_in_time


def test_a_design_whose_force_grows_after_the_window_is_passed_over(monkeypatch):
    """An optimiser hides a force there: the next best design is taken."""
    plain, rows = module.Problem.__call__, {}

    def hidden(self, genes):
        forces = plain(self, genes)
        rows.setdefault("best", genes[np.argmin(forces)])
        mine = (genes == rows["best"]).all(axis=1) & (self.t_end > SHORT["t_end"])
        return np.where(mine, 1.5 * forces, forces)

    known = search(ORDER, budget=64, **SHORT)
    monkeypatch.setattr(module.Problem, "__call__", hidden)
    found = search(ORDER, budget=64, **SHORT)
    assert known.beads == ORDER.beads(rows["best"])
    assert known.peak_force < found.peak_force < 1.5 * known.peak_force
    assert found.converged_in_time
    assert found.history.min() == known.history.min()


def test_a_force_that_grows_after_the_window_is_said_not_to_be_converged():
    """A chaotic chain of soft beads, watched while its first pulse comes only."""
    space = Order([BIG] * 3 + [SOFT] * 3)
    found = search(space, budget=64, t_end=4.2e-4, **BLOW)
    longer = peak_force(found.beads, t_end=4.2e-3, **BLOW)
    assert found.converged_in_time == (abs(longer / found.peak_force - 1) < 1e-3)
    assert not found.converged_in_time
    assert "not converged in time" in str(found)


def test_a_scene_that_is_built_is_searched_like_the_chain(monkeypatch):
    monkeypatch.setattr(finalists, "WINDOW", 2)
    few = Order([BIG] * 2 + [SMALL] * 2)
    early = SHORT | {"t_end": 3e-4}
    plain = search(few, budget=64, **early)
    built = search(few, budget=64, build=before_a_wall, **early)
    assert built.peak_force == pytest.approx(plain.peak_force, rel=2e-3)
    np.testing.assert_allclose(built.history, plain.history, rtol=2e-2)
    assert built.again[0].dt < 0.6 * plain.again[0].dt  # within the limit of packs
    assert built.again[1].dt == pytest.approx(plain.again[1].dt, rel=0.2)


def test_ctrl_c_gives_the_best_until_then(monkeypatch):
    plain, calls = module.Problem.__call__, []

    def interrupted(self, genes):
        calls.append(1)
        if len(calls) == 4:
            raise KeyboardInterrupt
        return plain(self, genes)

    monkeypatch.setattr(module.Problem, "__call__", interrupted)
    assert designs.small_search().evaluations == 192


@pytest.mark.parametrize(
    ("changed", "words"),
    [
        ({"space": "T1"}, "space 'T1' is not"),
        ({"method": "annealing"}, "'annealing' is not one of ga, gradient, cma"),
        ({"method": "cma", "space": CHOICE}, "does not search Choice: take ga"),
        ({"budget": 63}, "budget 63 is below one population of 'ga', 64 designs"),
        ({"t_end": 1e-5}, "is before the wave through design 0 arrives: .* comes at"),
        ({"build": "pack"}, "build 'pack' cannot be called"),
        ({"build": designs.never_a_number}, "design 0: .*gives no scene: no such pack"),
        ({"executor": 2}, "executor 2 is not a concurrent.futures.Executor"),
        ({"checkpoint": ""}, "names no file"),
    ],
)
def test_bad_input_is_refused(changed, words):
    given = {"space": ORDER, "budget": 64, **SHORT} | changed
    with pytest.raises(TensegrityError, match=words):
        search(given.pop("space"), **given)


def test_a_force_that_is_no_number_stops_the_search_and_loses_nothing(tmp_path, monkeypatch):
    plain, path = module.Problem.__call__, tmp_path / "search.npz"

    def poisoned(self, genes):
        forces = plain(self, genes)
        if len(parts(path, "search")["forces"]) == 128 if path.exists() else False:
            forces[7] = np.nan
        return forces

    with monkeypatch.context() as patched:
        patched.setattr(module.Problem, "__call__", poisoned)
        with pytest.raises(TensegrityError, match="force of design 135 is nan N"):
            designs.small_search(path)
    assert len(parts(path, "search")["forces"]) == 128
    same(designs.small_search(path), designs.small_search())


def test_methods_are_a_table_that_the_page_of_names_follows():
    assert list(METHODS) == ["ga", "gradient", "cma"]


@pytest.mark.slow
def test_searches_reach_what_is_known():
    """T1 in 8 of 10 seeds, T2 in 8 of 40, S below 28.5 N, M below 2.4 N."""
    steel = Order([BIG] * 10 + [SMALL] * 10)
    reached = [search(steel, budget=5000, seed=s, **SHORT).peak_force for s in range(10)]
    assert np.sum(np.isclose(reached, 35.3362969, rtol=1e-6)) >= 8
    pair = Order([BIG] * 10 + [SOFT] * 10)
    reached = [search(pair, t_end=8e-3, budget=5000, seed=s, **BLOW).peak_force for s in range(40)]
    assert np.sum(np.isclose(reached, 5.4411505, rtol=1e-6)) >= 8
    assert np.median(reached) <= 5.6
    sizes = Sizes(20, (4e-3, 10e-3), 0.140, STEEL)
    assert min(search(sizes, budget=25000, seed=s, **SHORT).peak_force for s in range(2)) <= 28.5
    six = [materials[name] for name in designs.LETTERS.values()]
    found = search(Choice(20, 10e-3, six), t_end=12e-3, budget=40000, **BLOW)
    assert found.peak_force <= 2.4
    assert found.converged_in_time


def test_the_peak_of_a_built_scene_is_that_of_the_chain_it_is():
    beads = [BIG] * 20
    force, time = wall_peak(before_a_wall, beads, 1e-3, 2e-7)
    assert force == pytest.approx(peak_force(beads, dt=1e-7, **SHORT), rel=1e-6)
    assert 0 < time < 1e-3
    assert wall_peak(before_a_wall, beads, time - 2e-6, 2e-7)[0] == np.inf  # it rises still


def test_a_built_scene_whose_wave_has_not_arrived_has_no_force():
    force, _ = wall_peak(before_a_wall, [BIG] * 20, 5e-5, 1e-6)
    assert force == np.inf
