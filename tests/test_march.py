"""One march: the same bits however it is divided into attempts, and whoever observes it."""

from itertools import pairwise

import numpy as np
import pytest
from networks import SPRING, patch, pushed
from scenes import prism_chain, short_attempts, smooth_blow
from springs import series

from granular import Bead, Striker, materials, y_guide
from tensegrity import (
    Chain,
    ContactError,
    Ensemble,
    Network,
    PowerLaw,
    Prism,
    Record,
    simulate,
)
from tensegrity.errors import LockingError, StabilityError
from tensegrity.runs import trial
from tensegrity.scenes.clearance import Clearance
from tensegrity.scenes.dynamics import dynamics
from tensegrity.scenes.scene import State

FIELDS = ("t", "u", "v", "energy", "met", "impulse")


def unequal():
    """Springs of two laws and of many parameters."""
    prism, rng = Prism(1.0, 0.7, 0.01, 1.0).potential(), np.random.default_rng(3)
    stiff = [PowerLaw(rng.uniform(1, 2), 1.5, preload=0.1) for _ in range(20)]
    chain = Chain([*stiff, *[prism] * 9, stiff[0]], 31, rng.uniform(1, 2, 31))
    return chain, chain.at_rest({0: 0.02, 25: 0.01})


def lanes(count):
    """Chains side by side, each with its own blow."""
    batch = Ensemble(prism_chain(9), count)
    return batch, batch.at_rest({0: np.linspace(0.005, 0.02, count)})


SCENES = {
    "lane": lambda: lanes(1),
    "lanes": lambda: lanes(11),
    "many lanes": lambda: lanes(70),
    "chain": lambda: (prism_chain(20), smooth_blow(prism_chain(20))),
    "unequal": unequal,
    "network": lambda: (patch(), pushed(patch())),
}


def both(monkeypatch, call, steps=7):
    """What a call gives in one attempt, and in short ones."""
    at_once = call()
    with monkeypatch.context() as m:
        short_attempts(m, steps)
        return at_once, call()


@pytest.mark.parametrize("record", [None, Record(every=7), Record(every=5, sites=[3, 1])])
@pytest.mark.parametrize("method", ["verlet", "rkn6", "corrected6"])
@pytest.mark.parametrize("name", SCENES)
def test_a_run_in_one_attempt_has_the_bits_of_short_ones(monkeypatch, name, method, record):
    scene, state = SCENES[name]()
    given = {"dt": 0.1, "method": method, "record": record}
    one, other = both(monkeypatch, lambda: simulate(scene, state, 4.0, **given))
    for field in FIELDS:
        found = getattr(one, field), getattr(other, field)
        assert np.array_equal(*found) or found == (None, None), field
    assert np.array_equal(one.final.u, other.final.u)
    assert np.array_equal(one.final.v, other.final.v)
    assert (one.steps, one.dt, one.sites, one.force) == (
        other.steps, other.dt, other.sites, other.force,
    )  # fmt: skip


@pytest.mark.parametrize("name", SCENES)
def test_a_tolerance_is_met_by_the_same_run_in_short_attempts(monkeypatch, name):
    scene, state = SCENES[name]()
    one, other = both(monkeypatch, lambda: simulate(scene, state, 6.0, tol=1e-6))
    assert (one.steps, one.method) == (other.steps, other.method)
    assert one.error_estimate == pytest.approx(other.error_estimate, rel=1e-12)
    assert np.array_equal(one.u, other.u)


def test_energies_are_those_of_the_springs_one_by_one():
    chain, _ = unequal()
    rng = np.random.default_rng(0)
    u, v = rng.normal(0, 1e-3, (5, chain.sites)), rng.normal(0, 0.1, (5, chain.sites))
    wanted = [
        sum(float(s.energy(r)) for s, r in zip(chain.springs, np.diff(x), strict=True))
        + sum(m * y**2 / 2 for m, y in zip(chain.mass, v[k], strict=True))
        for k, x in enumerate(u)
    ]
    np.testing.assert_allclose(dynamics(chain).energies(u, v), wanted, rtol=1e-13)
    assert chain.energy(State(u[2], v[2])) == dynamics(chain).energies(u, v)[2]
    np.testing.assert_allclose(
        dynamics(chain).energies(np.asfortranarray(u), v), wanted, rtol=1e-13
    )


def test_an_elongation_out_of_its_domain_has_no_energy():
    chain = prism_chain(8)
    u = np.zeros((2, 8))
    u[1, 3:] = 1.01 * chain.springs[0].domain[0]
    with pytest.raises(LockingError):
        dynamics(chain).energies(u, np.zeros((2, 8)))


def test_what_is_too_stiff_for_the_step_is_told_as_in_short_attempts(monkeypatch):
    """A spring that stiffens: stable at first, not where the run goes, which is finite."""
    chain = Chain(series(0, 50), 6)

    def error():
        with pytest.raises(StabilityError) as caught:
            simulate(chain, chain.at_rest({0: 1.5}), 2.4, dt=0.8)
        return str(caught.value), len(caught.value.run.t)

    one, other = both(monkeypatch, error)
    assert one == other


@pytest.mark.filterwarnings("ignore:.*encountered:RuntimeWarning")
def test_a_run_that_overflows_is_told_as_in_short_attempts(monkeypatch):
    """Two bodies that never meet go out of what a number can say; no elongation shows it."""
    chain = Chain(PowerLaw(1.0, 1.5), 2)
    state = State([0.0, 1.0], [1e150, 1e150])

    def error():
        with pytest.raises(StabilityError) as caught:
            simulate(chain, state, 1e200, dt=1e199)
        return str(caught.value), len(caught.value.run.t)

    one, other = both(monkeypatch, error)
    assert one == other


def test_contacts_that_are_not_listed_are_found_between_instants(monkeypatch):
    """Two beads that graze each other while a third pair, far away, sets the pace."""
    places = [[0.0, 0.0], [1.0, 0.0], [0.0, 9.0], [3.0, 9.2]]
    network = Network(places, [(0, 1)], SPRING, radius=0.5)
    state = network.at_rest({0: (0.1, 0.0), 2: (1.0, 0.0)})

    def error():
        with pytest.raises(ContactError) as caught:
            simulate(network, state, 8.0, tol=1e-4)
        return str(caught.value)

    one, other = both(monkeypatch, error)
    assert one == other
    assert "sites 2 and 3" in one


def forked(half_angle=0.4):
    """A guide so narrow that beads of its branches are near what they are not listed to touch."""
    steel = Bead(4.76e-3, materials["steel"], mass=0.45e-3)
    return y_guide(
        6, 6, half_angle=half_angle, bead=steel, wall=materials["ptfe"],
        striker=Striker(steel, 0.5),
    )  # fmt: skip


def test_beads_too_near_others_to_be_sure_of_are_looked_at_after_each_step(monkeypatch):
    scene = forked()
    one, other = both(monkeypatch, lambda: simulate(scene, scene.start(), 1e-4, tol=1e-4))
    for name in FIELDS:
        assert np.array_equal(getattr(one, name), getattr(other, name)), name


def test_what_touches_at_the_end_of_a_step_is_found_by_a_look_after_each():
    """Gaps of the way gone in one step, and less: kept as long as none is closed."""
    none = np.zeros((0, 2), dtype=int)
    beads = Clearance(np.array([[0.0, 0], [3.0, 0]]), np.ones(2), none, (), none)
    beads.skin = 10.0  # all of the way is watched
    for last, kept in ((0.999, True), (1.0, False), (1.001, False)):
        u = np.zeros((3, 2, 2))
        u[1, 0, 0], u[2, 0, 0] = last / 2, last
        tracker = beads.tracker(u[0])
        assert tracker.keeps(u, np.full(2, last), each=True) is kept
        assert tracker.keeps(u, np.full(2, last)) is False


def test_a_run_between_tells_what_far_coarser_ones_cannot(monkeypatch):
    """Cheaper than a finer one: what is there turns out to be good enough."""
    prism = Prism(1.0, 0.7, 0.01, 1.0).potential()
    chain, steps = Chain(prism, 60), []
    energy = 0.9 * float(prism.energy(prism.domain[0]))
    refined = trial.refined
    monkeypatch.setattr(
        trial, "refined", lambda p, n, *rest: steps.append(n) or refined(p, n, *rest)
    )
    run = simulate(chain, chain.at_rest({30: np.sqrt(2 * energy)}), 40.0, tol=1e-9)
    assert any(later < sooner for sooner, later in pairwise(steps))
    fine = simulate(
        chain, chain.at_rest({30: np.sqrt(2 * energy)}), 40.0, dt=run.dt / 4, method="rkn6",
        record=Record(every=4 * -(-run.steps // 500)),
    )  # fmt: skip
    gaps = [np.max(np.abs(getattr(run, n) - getattr(fine, n))) for n in ("u", "v")]
    assert gaps[0] < 1e-9 * np.max(np.abs(fine.u))
    assert gaps[1] < 1e-9 * np.max(np.abs(fine.v))
