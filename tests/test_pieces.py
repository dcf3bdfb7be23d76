"""Long chains in pieces on threads: the same bits as in one loop."""

import multiprocessing
import os

import numpy as np
import pytest

from tensegrity import Chain, PowerLaw, Prism, TensegrityError, simulate
from tensegrity.engine import pieces
from tensegrity.engine.bound import Bound
from tensegrity.engine.compiled import Compiled
from tensegrity.engine.methods import METHODS
from tensegrity.engine.pieces import HALO, LONG, BoundPieces, start_of_block
from tensegrity.scenes.dynamics import dynamics


def uniform(sites=LONG + 4321):
    return Chain(Prism(1.0, 0.8, 0.02, 1.0).potential(), sites)


def mixed():
    """Segments shorter and longer than a piece, none a multiple of a block."""
    prism, hertz = Prism(1.0, 0.8, 0.05, 1.0), PowerLaw(2.0, 1.5, preload=0.1)
    springs = [prism.potential()] * 20011 + [hertz] * 33 + [prism.potential(0.05)] * 30001
    return Chain(springs + [hertz] * 5005, 55051, ends=("free", "fixed"))


@pytest.mark.parametrize("method", ["verlet", "rkn6"])
@pytest.mark.parametrize("threads", [2, 3])
@pytest.mark.parametrize("scene", [uniform, mixed])
def test_pieces_equal_the_whole_bit_for_bit(scene, threads, method):
    chain, method = scene(), METHODS[method]
    rng = np.random.default_rng(5)
    start = 1e-5 * rng.standard_normal((2, chain.sites))
    # so close to the limit that what is wrong at a cut travels a site a stage without fading
    ranges = dynamics(chain).present_ranges(np.stack([start[0], -start[0]]).max(axis=0))
    dt = 0.99 * method.stability_limit / dynamics(chain).frequency(ranges)
    start[:, chain.held] = 0
    engine = Compiled.of(dynamics(chain).loop_bonds)
    steps = 2 * (HALO // method.stages) + 7
    results = []
    for divided in (False, True):
        u, v = start.copy()
        parts = u, v, dynamics(chain).loop_bonds, method, dt
        loop = BoundPieces(engine, *parts, threads) if divided else Bound(engine, *parts)
        for n in (1, steps):  # a second call takes up what the first left
            loop.advance(n)
        results.append((u, v, loop.range.copy()))
    for one, two in zip(*results, strict=True):
        assert one.tobytes() == two.tobytes()


@pytest.mark.parametrize("threads", ["1", "2", "3"])
def test_runs_do_not_depend_on_the_number_of_threads(monkeypatch, threads):
    chain = uniform()
    state = chain.at_rest({0: 0.03, chain.sites // 2: -0.02, chain.sites - 1: 0.01})
    alone = simulate(chain, state, 6.0, dt=0.1)
    monkeypatch.setattr(pieces, "processors", lambda: 3)
    monkeypatch.setenv("TENSEGRITY_THREADS", threads)
    run = simulate(chain, state, 6.0, dt=0.1)
    assert run.final.u.tobytes() == alone.final.u.tobytes()
    assert run.final.v.tobytes() == alone.final.v.tobytes()


@pytest.mark.parametrize(("given", "taken"), [("", 4), ("1", 1), (" 4 ", 4), ("003", 3)])
def test_threads_are_those_asked_for_or_one_a_processor(monkeypatch, given, taken):
    monkeypatch.setattr(pieces, "processors", lambda: 4)
    monkeypatch.setenv("TENSEGRITY_THREADS", given)
    assert pieces.threads() == taken
    monkeypatch.delenv("TENSEGRITY_THREADS")
    assert pieces.threads() == 4


@pytest.mark.parametrize("given", ["5", "20000", "9" * 5000])
def test_more_threads_than_processors_are_not_taken(monkeypatch, given):
    monkeypatch.setattr(pieces, "processors", lambda: 4)
    monkeypatch.setenv("TENSEGRITY_THREADS", given)
    with pytest.warns(RuntimeWarning, match="more than the processors we may use: 4 threads"):
        assert pieces.threads() == 4


@pytest.mark.parametrize("given", ["²", "٣", "0", "-1", "1.5", "many"])
def test_what_is_no_number_of_threads_is_refused(monkeypatch, given):
    monkeypatch.setenv("TENSEGRITY_THREADS", given)
    chain = uniform(LONG + 100)
    with pytest.raises(TensegrityError, match=r"TENSEGRITY_THREADS .* must be a whole number"):
        simulate(chain, chain.at_rest({0: 0.03}), 1.0, dt=0.1)


def test_blocks_begin_where_the_loop_begins_them():
    first = np.array([0, 10, 200])  # 10 bonds, then 190 = 62 + 2 * 64
    found = [start_of_block(first, b) for b in (0, 3, 10, 11, 72, 73, 137, 150, 200, 300)]
    assert found == [0, 10, 10, 72, 72, 136, 200, 200, 200, 200]
    assert [start_of_block(first, b, down=True) for b in (3, 71, 73, 199)] == [0, 10, 72, 136]


def _final(chain):
    return simulate(chain, chain.at_rest({0: 0.03}), 1.0, dt=0.1).final.v.tobytes()


@pytest.mark.skipif(not hasattr(os, "fork"), reason="processes are not forked here")
def test_a_forked_process_has_threads_of_its_own(monkeypatch):
    """A forked process has the parent's pool but not its threads: it must not wait for them."""
    monkeypatch.setattr(pieces, "processors", lambda: 2)
    monkeypatch.setenv("TENSEGRITY_THREADS", "2")
    chain = uniform(LONG + 100)
    here = _final(chain)
    with multiprocessing.get_context("fork").Pool(1) as pool:
        assert pool.apply_async(_final, (chain,)).get(timeout=60) == here
