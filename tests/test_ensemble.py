"""Ensembles: each lane moves as its chain does alone."""

import warnings

import numpy as np
import pytest
import sympy as sp
from networks import patch
from scenes import prism_chain
from springs import series

from granular import Bead, Striker, chain, materials, y_guide
from tensegrity import (
    Chain,
    ContactError,
    Ensemble,
    LockingError,
    Potential,
    PowerLaw,
    Prism,
    Record,
    StabilityError,
    State,
    TensegrityError,
    arrival,
    simulate,
)

SPEEDS = np.linspace(-0.01, 0.03, 13)  # 8 lanes together and 5 beside copies


def lanes_alone(chain, start, t_end, **options):
    """Final u and v of each lane as a chain of its own."""
    several = Ensemble(chain, start.u.shape[1])
    starts = [several.select(start, k) for k in range(several.count)]
    runs = [simulate(chain, one, t_end, **options).final for one in starts]
    return np.stack([r.u for r in runs], 1), np.stack([r.v for r in runs], 1)


def mixed():
    springs = [Prism(1.0, 0.8, 0.02, 1.0).potential()] * 9 + [PowerLaw(2.0, 1.5, 0.1)] * 10
    return Chain(springs, 20, mass=np.linspace(1, 2, 20), ends=("free", "fixed"))


def unequal():
    springs = [PowerLaw(k, 1.5, 0.1) for k in np.linspace(1, 3, 11)]
    return Chain(springs, 12)


def own(k):
    springs = [PowerLaw(k * (1 + j / 41.7), 1.5, preload=0.2) for j in range(19)]
    return Chain(springs, 20, mass=k + np.arange(20) / 20, ends=("free", "fixed"))


def both_sides(place):
    """Contacts on either side of a gap."""
    r, a = sp.symbols("r a")
    gap = sp.Max(r - a, 0) ** 2 + sp.Max(-r - a, 0) ** 2
    return Chain(Potential(gap, r, {a: place}), 6, ends=("fixed", "fixed"))


BLOW, HARD = {1: SPEEDS, 4: 0.02}, {1: 1.0, 2: -0.3, 4: -0.6}
METHODS = ["verlet", "rkn6", "rk4", "midpoint"]
SCENES = {  # of all lanes, velocities, methods
    "prisms": ([prism_chain(30)] * 13, BLOW, METHODS),
    "mixed": ([mixed()] * 13, BLOW, METHODS),
    "unequal": ([unequal()] * 13, BLOW, METHODS),
    "masses and springs of their own": ([*map(own, np.linspace(1, 3, 13))], BLOW, METHODS),
    "one spring each": (
        [Chain(PowerLaw(k, 1.5, preload=0.2), 20) for k in np.linspace(1, 3, 11)], {0: 0.02},
        ["rkn6"],
    ),
    "networks": (
        [patch(4), patch(4, spring=PowerLaw(2.0, 1.5, preload=0.3, length=1.0))],
        {0: [[0.05] * 2, [0.03] * 2], 1: [[0.0] * 2, [-0.02] * 2]}, ["verlet"],
    ),
    "opening": ([Chain(PowerLaw(k, 1.5), 6) for k in np.linspace(0.7, 1.4, 8)], HARD,
                ["corrected6"]),
    "on both sides": ([*map(both_sides, np.linspace(0.05, 0.2, 5))], HARD, ["corrected6"]),
}  # fmt: skip


@pytest.mark.parametrize(("name", "method"), [
    pytest.param(name, method, marks=[pytest.mark.slow] * ((k + j) % 2))
    for k, (name, scene) in enumerate(SCENES.items()) for j, method in enumerate(scene[2])
])  # fmt: skip
def test_lanes_move_as_their_scenes_alone(name, method):
    scenes, velocity, _ = SCENES[name]
    alike = all(scene is scenes[0] for scene in scenes)
    together = Ensemble(scenes[0], len(scenes)) if alike else Ensemble(scenes)
    start = together.at_rest(velocity)
    options = {"dt": 0.1, "method": method, "record": Record(every=20)}
    run = simulate(together, start, 6.0, **options)
    assert run.u.shape == (4, *together.shape)
    assert len(run) == len(scenes)
    for k, (scene, one) in enumerate(zip(scenes, run, strict=True)):
        alone = simulate(scene, together.select(start, k), 6.0, **options)
        assert one.scene is scene
        np.testing.assert_array_equal(one.u, run.u[..., k])
        for field in (
            "u",
            "v",
            *["elongation_range"] * (not alike),
        ):  # that of equal springs is of all lanes
            mine, its = getattr(one, field), getattr(alone, field)
            np.testing.assert_allclose(mine, its, rtol=0, atol=1e-13 * np.abs(its).max())
        np.testing.assert_allclose(run.energy[:, k], alone.energy, rtol=1e-13)
        assert scene.energy(one.final) == pytest.approx(one.energy[-1], rel=1e-13)


@pytest.mark.parametrize("kind", ["chains", "one chain", "networks"])
def test_blocks_of_a_large_ensemble_give_the_same_bits_on_any_number_of_threads(kind, monkeypatch):
    """130 chains take three blocks, of which the last has two; a network has a loop of its own."""
    count = 12 if kind == "networks" else 130
    if kind == "one chain":
        together = Ensemble(prism_chain(30), count)
    else:
        of = own if kind == "chains" else (lambda k: patch(4, spring=PowerLaw(k, 1.5, preload=0.3)))
        together = Ensemble([of(k) for k in np.linspace(1, 3, count)])
    velocity = np.linspace(0.01, 0.03, count)
    start = together.at_rest({0: velocity if kind != "networks" else np.stack([velocity] * 2)})
    options = {"dt": 0.05, "method": "rkn6", "record": Record(every=40)}
    found = {}
    for threads in "12":
        monkeypatch.setenv("TENSEGRITY_THREADS", threads)
        with warnings.catch_warnings(action="ignore", category=RuntimeWarning):  # one processor
            found[threads] = simulate(together, start, 30.0, **options)
    for name in ("u", "v", "energy"):
        np.testing.assert_array_equal(*(getattr(run, name) for run in found.values()))
    for k in (0, 63, 64, 127, 128, 129):
        k = min(k, count - 1)
        alone = simulate(together.scenes[k], together.select(start, k), 30.0, **options)
        for mine, its in ((found["2"].u[..., k], alone.u), (found["2"].v[..., k], alone.v)):
            np.testing.assert_allclose(mine, its, rtol=0, atol=1e-13 * np.abs(its).max())


def test_the_first_scene_that_locks_is_named_on_any_number_of_threads(monkeypatch):
    chains = [prism_chain(30)] * 150
    together = Ensemble(chains)
    velocity = np.where(np.isin(np.arange(150), (70, 130, 149)), 3.0, 0.01)
    start = together.at_rest({0: velocity})
    for threads in "12":
        monkeypatch.setenv("TENSEGRITY_THREADS", threads)
        with (
            warnings.catch_warnings(action="ignore", category=RuntimeWarning),
            pytest.raises((LockingError, StabilityError), match="of scene 70"),
        ):
            simulate(together, start, 300.0, dt=0.1)


def test_a_tolerance_holds_in_every_lane():
    chain = prism_chain(30)
    ensemble = Ensemble(chain, 8)
    start = ensemble.at_rest({0: SPEEDS[:8]})
    run = simulate(ensemble, start, 20.0, tol=1e-7)
    u, _ = lanes_alone(chain, start, 20.0, method="rkn6", dt=0.02)
    assert np.max(np.abs(run.final.u - u)) < 1e-7 * np.max(np.abs(run.u))


def test_locking_is_told_with_its_lane():
    ensemble = Ensemble(prism_chain(10), 3)
    with pytest.raises(LockingError, match="between sites 0 and 1 of scene 2"):
        simulate(ensemble, ensemble.at_rest({0: [0.01, 0.02, 0.5]}), 10.0)


@pytest.mark.parametrize(("lanes", "light"), [(3, 1), (70, 68), (65, 64)])
def test_a_step_that_is_unstable_at_first_is_told_with_its_lane(lanes, light):
    masses = np.where(np.arange(lanes) == light, 1e-3, 1.0)
    ensemble = Ensemble([Chain(series(), 6, float(mass)) for mass in masses])
    words = rf"scene {light}: .* initial state$|initial state of scene {light}$"
    with pytest.raises(StabilityError, match=words):
        simulate(ensemble, ensemble.at_rest({0: 0.01}), 1.0, dt=0.2)


@pytest.mark.parametrize("end", [-0.1, 0.1])
def test_every_lane_is_watched_at_both_ends_of_the_domain(end):
    """A law that goes on beyond its domain, so that the range met alone can tell."""
    spring = series(domain=(-0.1, 0.1))
    chain = Chain(spring, 6, ends=("free", "fixed"))
    for lanes, far in ((1025, 0), (1025, 1023), (1025, 1024), (11, 9)):  # 1024 at once at most
        ensemble = Ensemble(chain, lanes)
        start = ensemble.at_rest({0: [-2 * end * (lane == far) for lane in range(lanes)]})
        words = f"sites 0 and 1 of scene {far} got there|scene {far}: .*sites 0 and 1 got there"
        with pytest.raises(LockingError, match=words) as caught:
            simulate(ensemble, start, 4.0, dt=0.01)
        assert 0.09 < np.abs(caught.value.run.elongation_range).max() < 0.1


def test_states_of_another_shape_are_refused():
    ensemble = Ensemble(prism_chain(10), 3)
    with pytest.raises(TensegrityError, match=r"shape \(10, 2\), the ensemble has \(10, 3\)"):
        simulate(ensemble, State(np.zeros((10, 2)), np.zeros((10, 2))), 1.0)
    with pytest.raises(TensegrityError, match="count 0"):
        Ensemble(prism_chain(10), 0)
    with pytest.raises(TensegrityError, match="not a Chain"):
        Ensemble([ensemble])


def test_a_spring_can_get_the_energy_of_its_lane_only():
    """Lanes side by side neither lock sooner than alone, nor change the default step."""
    chain = prism_chain(10)
    barrier = chain.springs[0].energy(chain.springs[0].domain[0])
    speed = np.sqrt(2 * 0.8 * barrier)
    alone = simulate(chain, chain.at_rest({0: speed}), 5.0)
    for lanes in (2, 9):
        ensemble = Ensemble(chain, lanes)
        start = ensemble.at_rest({0: speed})
        assert simulate(ensemble, start, 5.0).steps == alone.steps
        with pytest.raises(StabilityError, match="too coarse"):
            simulate(ensemble, start, 5.0, dt=0.4, method="verlet")


def test_lanes_of_beads_keep_the_step_of_beads():
    steel = Bead(4.76e-3, materials["steel"])
    beads = chain([steel] * 6, striker=Striker(steel, 0.5))
    ensemble, start = Ensemble(beads, 9), beads.start()
    start = State(*(np.stack([x] * 9, axis=1) for x in (start.u, start.v)))
    alone = simulate(beads, beads.start(), 1e-4)
    assert simulate(ensemble, start, 1e-4).dt == alone.dt


@pytest.mark.parametrize("velocity", [{0: [1.0, 2.0]}, {0: "a"}, [1.0, 2.0]])
def test_velocities_that_no_lane_can_take_are_refused(velocity):
    with pytest.raises(TensegrityError, match="velocity"):
        Ensemble(prism_chain(4), 3).at_rest(velocity)


def test_observables_of_one_chain_refuse_lanes():
    ensemble = Ensemble(prism_chain(10), 2)
    run = simulate(ensemble, ensemble.at_rest({0: 0.01}), 5.0)
    with pytest.raises(TensegrityError, match=r"rows of shape \(10, 2\)"):
        arrival(run, 3)


def fork():
    """A small guide of steel beads, whose unlisted contacts have to be watched."""
    steel = Bead(4.76e-3, materials["steel"], mass=0.45e-3)
    return y_guide(3, 4, bead=steel, wall=materials["ptfe"], striker=Striker(steel, 0.5))


@pytest.mark.parametrize(
    "given",
    [{"tol": 1e-3}, {"dt": 2e-7}, {}, {"dt": 2e-7, "record": Record(times=[1e-5, 3.3e-5])}],
    ids=["tol", "dt", "default", "between steps"],
)
def test_guides_run_as_lanes(given):
    """One after the other with one step, each watched by its own clearance."""
    guide, speeds = fork(), (0.3, 1.0)
    start = guide.start()
    lanes = Ensemble(guide, len(speeds))
    state = State(*(np.stack([x * speed for speed in speeds], axis=-1) for x in (start.u, start.v)))
    run = simulate(lanes, state, 4e-5, **given)
    for k, speed in enumerate(speeds):
        alone = simulate(
            guide, State(start.u, speed * start.v), 4e-5, dt=run.dt, method=run.method,
            record=given.get("record", Record()),
        )  # fmt: skip
        assert alone.steps == run.steps
        for name in ("u", "v", "impulse"):
            np.testing.assert_array_equal(getattr(run, name)[..., k], getattr(alone, name))


def test_a_lane_whose_bead_comes_to_the_end_of_its_wall_is_told():
    guide = fork()
    start = guide.start()
    fast = State(*(np.stack([x, 100 * x], axis=-1) for x in (start.u, start.v)))
    with pytest.raises(ContactError, match=r"beyond its end at t = 0\.000162") as caught:
        simulate(Ensemble(guide, 2), fast, 3e-4, dt=4e-8)
    assert 1.6e-4 < caught.value.run.t[-1] < 1.63e-4


def test_the_last_state_is_that_of_the_last_row_although_other_trial_runs_follow():
    springs = [
        Prism(1.0, h, p, 1.0).potential() for h, p in ((0.7, 0.01), (0.8, 0.02), (0.6, 0.03))
    ]
    ensemble = Ensemble([Chain(spring, 6) for spring in (*springs, PowerLaw(1.0, 1.5))])
    for t_end, tol in ((3.0, 1e-12), (8.0, 1e-10)):
        run = simulate(ensemble, ensemble.at_rest({0: 0.05}), t_end, tol=tol)
        assert np.array_equal(run.final.u, run.u[-1])
        assert np.array_equal(run.final.v, run.v[-1])
