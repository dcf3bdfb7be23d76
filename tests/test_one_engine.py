"""One engine: what chains can, networks can, with parameters shared, own, or own to a lane."""

import numpy as np
import pytest
from networks import fork, patch, pushed
from oracle import ORDERS, stepped
from scenes import prism_chain, smooth_blow

from tensegrity import (
    Chain,
    Ensemble,
    LockingError,
    Network,
    PowerLaw,
    Prism,
    Record,
    State,
    TensegrityError,
    Wall,
    simulate,
)

RANDOM = np.random.default_rng(3)


def tapered(sites=150):
    """All contacts different, each with its own precompression."""
    factor = np.linspace(1, 2, sites - 1)
    springs = [PowerLaw(2 * k, 1.5, preload=0.1 / k) for k in factor]
    return Chain(springs, sites, mass=np.linspace(1, 3, sites), ends=("free", "fixed"))


def graded(sites=150):
    """Prisms of different prestrain, power laws in their middle, and a long uniform part."""
    prisms = [Prism(1.0, 0.8, p, 1.0).potential() for p in np.linspace(0.02, 0.1, 40)]
    rest = [PowerLaw(2.0, 1.5, preload=0.1)] * 5 + [prisms[0]] * (sites - 46)
    return Chain(prisms + rest, sites)


def alternating(sites=60):
    hard, soft = PowerLaw(2.0, 1.5, preload=0.1), PowerLaw(1.0, 1.5, preload=0.1)
    return Chain([hard, soft] * ((sites - 1) // 2) + [hard], sites)


def mixed():
    prism = Prism(1.0, 0.8, 0.05, 1.0)
    springs = [prism.potential()] * 70 + [PowerLaw(2.0, 1.5, preload=0.1)] * 50
    return Chain(springs + [prism.potential(0.05)] * 9, 130, ends=("free", "fixed"))


SCENES = {
    "uniform": lambda: prism_chain(100),
    "mixed": mixed,
    "tapered": tapered,
    "graded": graded,
    "alternating": alternating,
    "fork": fork,
    "plane": patch,
    "space": lambda: patch(4, dim=3),
}


@pytest.mark.parametrize(("name", "method"), [
    pytest.param(name, method, marks=[pytest.mark.slow] * (method == ["verlet", "rk4"][k % 2]))
    for k, name in enumerate(SCENES) for method in ("verlet", "rkn6", "rk4")
])  # fmt: skip
def test_loop_is_that_of_numpy_to_the_growth_of_round_off(name, method):
    """Whoever owns the parameters: two orders of summation differ by eps a step."""
    scene, steps, dt = SCENES[name](), 113, 1e-6 if name == "fork" else 0.1
    state = smooth_blow(scene) if isinstance(scene, Chain) else pushed(scene, 0.3)
    run = simulate(scene, state, steps * dt, dt=dt * (1 + 1e-9), method=method)
    plain, sites, eps = stepped(scene, state, method, dt, steps), scene.sites, np.finfo(float).eps
    assert run.steps == steps
    found = [run.final.u, run.final.v, run.elongation_range[: len(plain.elongation_range)]]
    wanted = [plain.u[:sites], plain.v[:sites], plain.elongation_range]
    for one, two in zip(found, wanted, strict=True):
        np.testing.assert_allclose(one, two, rtol=0, atol=2 * steps * eps * np.abs(two).max())
    if run.impulse is not None:  # far smaller than what they are differences of
        np.testing.assert_allclose(run.impulse[-1], plain.v[sites:], rtol=1e-10)


@pytest.mark.parametrize("exponent", [3.0, 1.5])  # without roots and with
@pytest.mark.parametrize("sites", [2, 3, 64, 65, 66, 129, 1000])
def test_blocks_of_any_length(sites, exponent):
    chain = Chain(PowerLaw(1.0, exponent, preload=0.2), sites)
    state = chain.at_rest({0: 0.1, sites - 1: -0.05})
    run = simulate(chain, state, 0.5, dt=0.1, method="verlet")
    plain = stepped(chain, state, "verlet", 0.1, 5)
    for one, two in (
        (run.final.u, plain.u),
        (run.final.v, plain.v),
        (run.elongation_range, plain.elongation_range),
    ):
        np.testing.assert_allclose(one, two, rtol=0, atol=1e-15)


@pytest.mark.parametrize("bonds", [1, 63, 64, 65, 200])
def test_ranges_of_many_equal_bonds_are_those_of_all(bonds):
    """Kicks of verlet fall on its steps: there is nothing else to be met."""
    chain = prism_chain(bonds + 1)
    start = chain.at_rest({0: 0.02, bonds // 2 + 1: -0.01})
    run = simulate(chain, start, 20.0, dt=0.25, record=Record(every=1))
    r = np.diff(run.u)
    np.testing.assert_array_equal(run.elongation_range, [[min(r.min(), 0), max(r.max(), 0)]])


def test_a_lane_of_its_own_that_locks_is_named():
    chains = [Chain(Prism(1.0, 0.7, p, 1.0).potential(), 12) for p in np.linspace(0.01, 0.08, 8)]
    several = Ensemble(chains)
    start = several.at_rest({0: np.where(np.arange(8) == 5, 0.9, 0.01)})
    with pytest.raises(LockingError, match="sites 0 and 1 of scene 5 got there at t"):
        simulate(several, start, 5.0, tol=1e-4)


def test_lanes_of_other_shape_are_refused():
    for other in (prism_chain(11), patch(4)):
        with pytest.raises(TensegrityError, match=r"scene 1, .* differs in shape"):
            Ensemble([prism_chain(10), other])
    with pytest.raises(TensegrityError, match="give a scene and its count"):
        Ensemble(prism_chain(10))
    with pytest.raises(TensegrityError, match="empty"):
        Ensemble([])


# --- on a line -------------------------------------------------------------------------------


def as_network(chain, **options):
    """The same masses and springs as a network of one dimension."""
    bonds = [(j, j + 1) for j in range(chain.sites - 1)]
    places = np.arange(chain.sites, dtype=float)[:, None]
    return Network(places, bonds, chain.springs, mass=chain.mass, held=chain.held, **options)


@pytest.mark.parametrize("scene", [prism_chain, tapered])
@pytest.mark.parametrize("method", ["verlet", "rkn6", "rk4"])
def test_a_chain_written_as_a_network_is_the_same_loop(scene, method):
    chain = scene()
    network, state = as_network(chain), smooth_blow(chain)
    start = State(state.u[:, None], state.v[:, None])
    one = simulate(chain, state, 10.0, dt=0.05, method=method)
    two = simulate(network, start, 10.0, dt=0.05, method=method)
    assert two.final.u[:, 0].tobytes() == one.final.u.tobytes()
    np.testing.assert_allclose(two.energy, one.energy, rtol=1e-13)


@pytest.mark.parametrize(
    "method",
    ["rkn6", "midpoint", *(pytest.param(x, marks=pytest.mark.slow) for x in ("verlet", "rk4"))],
)
def test_bonds_in_any_order_on_a_line_pull_as_in_a_chain(method):
    """The bonds backwards, every other one from right to left: the general loop."""
    chain = tapered(30)
    order = np.arange(29)[::-1]
    bonds = [(j, j + 1) if j % 2 else (j + 1, j) for j in order]
    places = np.arange(30, dtype=float)[:, None]
    springs = [chain.springs[j] for j in order]
    network = Network(places, bonds, springs, mass=chain.mass, held=chain.held)
    state = smooth_blow(chain)
    start = State(state.u[:, None], state.v[:, None])
    one = simulate(chain, state, 5.0, dt=0.05, method=method)
    two = simulate(network, start, 5.0, dt=0.05, method=method)
    np.testing.assert_allclose(two.final.u[:, 0], one.final.u, rtol=0, atol=1e-14)
    np.testing.assert_allclose(two.energy, one.energy, rtol=1e-13)


def test_a_line_has_walls_and_loads():
    """A bead that falls on a wall and a bead: momentum, and energy with the load's."""
    walls = [Wall([0.0], [1.0])]
    network = Network(
        [[1.0], [3.0]], [(0, 1)], PowerLaw(5.0, 1.5), mass=[1.0, 2.0], walls=walls,
        wall_contacts=[(0, 0)], wall_spring=PowerLaw(9.0, 1.5), radius=1.0,
        loads=[[-0.1], [-0.2]],
    )  # fmt: skip
    run = simulate(network, network.at_rest({1: [-0.3]}), 6.0, tol=1e-8)
    assert run.energy_error < 1e-7
    momentum = (run.v[:, :, 0] @ [1.0, 2.0]) + 0.3 * run.t + 0.6
    np.testing.assert_allclose(run.impulse[:, 0, 0], -momentum, atol=1e-7)
    assert np.abs(run.impulse[-1]) > 0.5


# --- forces and stiffness --------------------------------------------------------------------


def scenes_with_a_state():
    beads = patch(4, dim=3)
    yield tapered(12), 0.01 * RANDOM.standard_normal(12)
    yield Chain(Prism(1.0, 0.7, 0.05, 1.0, 10.0, 100.0).potential(0.01), 9), 0.01 * np.arange(9)
    yield beads, 0.01 * RANDOM.standard_normal(beads.shape)
    walled = Network(
        [[0.0, 0.9], [1.5, 0.9]], [(0, 1)], PowerLaw(3.0, 2.0), mass=[1.0, 2.0],
        lengths=1.6, walls=[Wall((0, 0), (0, 1))], wall_contacts=[(0, 0), (1, 0)],
        wall_spring=PowerLaw(2.0, 1.5), radius=1.0, loads=[[0, -1], [0.5, 0]], held=[1],
        wall_gaps=[-0.1, -0.1],
    )  # fmt: skip
    yield walled, np.array([[0.02, -0.05], [0.0, 0.0]])


@pytest.mark.parametrize("number", range(4))
def test_forces_are_the_slope_of_the_energy_and_stiffness_that_of_the_forces(number):
    scene, u = list(scenes_with_a_state())[number]
    if isinstance(scene, Chain):
        u[list(scene.held)] = 0
    at_rest, free = np.zeros(scene.shape), np.ones(scene.shape, dtype=bool)
    free[list(scene.held)] = False
    h = 1e-5
    forces, stiffness = scene.forces(u), scene.stiffness(u).toarray()
    assert np.abs(stiffness).max() > 0.1
    np.testing.assert_allclose(stiffness, stiffness.T, atol=1e-13)
    for k in np.flatnonzero(free.ravel()):
        step = np.zeros(u.size)
        step[k] = h
        one, two = u + step.reshape(u.shape), u - step.reshape(u.shape)
        slope = (scene.energy(State(one, at_rest)) - scene.energy(State(two, at_rest))) / (2 * h)
        assert forces.ravel()[k] == pytest.approx(-slope, abs=1e-9)
        change = (scene.forces(one) - scene.forces(two)).ravel() / (2 * h)
        np.testing.assert_allclose(stiffness[:, k], -change * free.ravel(), atol=2e-8)
    assert not forces[list(scene.held)].any()
    assert not stiffness[~free.ravel()].any()


@pytest.mark.parametrize("method", ["verlet", "rkn6", "midpoint", "rk4"])
def test_every_method_keeps_its_order_in_a_network(method):
    network = patch(3)
    state, t_end = pushed(network), 2.0
    exact = simulate(network, state, t_end, method="rkn6", dt=0.002).final
    steps = {"verlet": (40, 80, 160), "rk4": (20, 40, 80)}
    steps["midpoint"] = steps["verlet"]
    errors, counts = [], steps.get(method, (5, 8, 12))
    for count in counts:
        final = simulate(network, state, t_end, method=method, dt=t_end / count).final
        errors.append(np.max(np.abs(final.v - exact.v)))
    order = -np.polyfit(np.log(counts), np.log(errors), 1)[0]
    assert order == pytest.approx(ORDERS[method], abs=0.35)


def test_energies_are_those_of_the_springs_one_by_one():
    chain = mixed()
    rng = np.random.default_rng(0)
    u, v = rng.normal(0, 1e-3, chain.sites), rng.normal(0, 0.1, chain.sites)
    wanted = sum(float(s.energy(r)) for s, r in zip(chain.springs, np.diff(u), strict=True))
    wanted += np.sum(chain.mass * v**2) / 2
    assert chain.energy(State(u, v)) == pytest.approx(wanted, rel=1e-13)


def test_an_elongation_out_of_its_domain_has_no_energy():
    chain, u = prism_chain(8), np.zeros(8)
    u[3:] = 1.01 * chain.springs[0].domain[0]
    with pytest.raises(LockingError):
        chain.energy(State(u, 0 * u))
