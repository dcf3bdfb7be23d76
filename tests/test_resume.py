"""Runs that are killed, interrupted or fail go on to the end they had, to the same bits."""

import numpy as np
import pytest
import sympy as sp
from networks import patch, pushed
from scenes import prism_chain, smooth_blow

from granular import Bead, Striker, chain, materials, y_guide
from tensegrity import (
    Chain,
    Ensemble,
    Potential,
    PowerLaw,
    Prism,
    Record,
    march,
    resume,
    simulate,
)

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


CASES = {
    "verlet": (blow, 8.0, {"dt": 0.1}),
    "processed6": (blow, 8.0, {"dt": 0.25, "method": "processed6"}),
    "gauss4": (blow, 4.0, {"dt": 0.25, "method": "gauss4"}),
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
    """Stop the run whose `at`-th block of steps of a march is asked for."""
    advance, calls = march._Watch.advance, []

    def broken(self, steps):
        if not self._problem.record.path:
            return advance(self, steps)
        calls.append(steps)
        if len(calls) == at:
            raise error
        return advance(self, steps)

    monkeypatch.setattr(march._Watch, "advance", broken)


@pytest.mark.parametrize("at", [1, 2, 9])
@pytest.mark.parametrize("kind", ["every", "interval"])
@pytest.mark.parametrize("name", CASES)
def test_an_interrupted_run_goes_on_to_the_same_bits(tmp_path, monkeypatch, name, kind, at):
    make, t_end, options = CASES[name]
    scene, state = make()
    record = {"every": 1} if kind == "every" else {"interval": t_end / 21.3}
    if name == "tolerance":
        monkeypatch.setattr("tensegrity.tolerance.WORTH", np.inf)
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
