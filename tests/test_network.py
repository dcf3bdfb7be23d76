"""Networks in the plane and in space: geometry, forces, orders, invariants, refusals."""

import math

import mpmath
import numpy as np
import pytest
import sympy as sp
from networks import SPRING, fork, patch, pushed
from springs import series

from derivations import geometry
from tensegrity import (
    Chain,
    LockingError,
    Network,
    PowerLaw,
    Prism,
    Record,
    StabilityError,
    State,
    TensegrityError,
    Wall,
    angular_momentum,
    simulate,
)

RUNNING = ["verlet", "rkn6", "rk4", "corrected6"]
LINE = [(k, k + 1) for k in range(19)]


def line(dim=2, spring=SPRING):
    direction = np.array([0.0, 0.6, 0.8])[:dim]
    direction /= np.linalg.norm(direction)
    return Network(np.arange(20.0)[:, None] * direction, LINE, spring, 1.0), direction


@pytest.mark.parametrize("dim", [2, 3])
def test_derived_elongation_is_the_plain_one(dim):
    reference, _ = geometry.vectors(dim)
    at_rest = sp.sqrt(sum(x**2 for x in reference)) - geometry.length
    form = geometry.elongation(dim).subs(geometry.initial, at_rest)
    assert sp.simplify(form - geometry.plain_elongation(dim)) == 0


def test_small_overlaps_keep_their_digits(rng):
    """Overlaps down to 1e-12 m between beads of millimetres, against 50 digits."""
    for size in 10.0 ** np.arange(-12, -3):
        x = rng.uniform(-5e-3, 5e-3, (2, 2))
        network = Network(x, [(0, 1)], SPRING)
        u = size * rng.standard_normal((2, 2))
        found = network.elongation(u)[0]
        with mpmath.workdps(50):
            place = [[mpmath.mpf(a) for a in row] for row in x.tolist()]
            moved = [[mpmath.mpf(a) for a in row] for row in u.tolist()]
            apart = [q - p for p, q in zip(*place, strict=True)]
            shift = [q - p for p, q in zip(*moved, strict=True)]
            exact = mpmath.norm([a + b for a, b in zip(apart, shift, strict=True)])
            exact -= mpmath.norm(apart)
            largest = mpmath.norm(shift)  # what r is a projection of
        assert abs(found - float(exact)) < 4e-15 * float(largest)


@pytest.mark.parametrize("dim", [2, 3])
@pytest.mark.parametrize("name", RUNNING)
def test_a_straight_network_is_the_chain(name, dim):
    network, direction = line(dim)
    chain = Chain(SPRING, 20)
    one = simulate(chain, chain.at_rest({0: 0.2}), 15.0, method=name, dt=0.1)
    two = simulate(network, network.at_rest({0: 0.2 * direction}), 15.0, method=name, dt=0.1)
    np.testing.assert_allclose(two.u @ direction, one.u, rtol=0, atol=5e-14)
    np.testing.assert_allclose(two.v @ direction, one.v, rtol=0, atol=5e-14)
    np.testing.assert_allclose(two.energy, one.energy, rtol=1e-13)


@pytest.mark.parametrize("dim", [2, 3])
def test_forces_are_the_complex_step_gradient_of_the_plain_energy(dim, rng):
    """Energy of |x_j - x_i| - L typed plainly, against the acceleration that the loop uses."""
    spring = series(-0.4 / 3, k=1.3)
    x = rng.uniform(0, 3, (7, dim))
    bonds = [(0, 1), (2, 1), (2, 3), (4, 3), (5, 4), (6, 0), (6, 3), (5, 1)]
    mass = rng.uniform(0.5, 2, 7)
    lengths = rng.uniform(0.5, 2, len(bonds))
    loads = rng.standard_normal((7, dim))
    network = Network(x, bonds, spring, lengths, mass, loads=loads, held=[5])
    u = 0.1 * rng.standard_normal((7, dim))
    u[5] = 0

    def energy(u):
        total = -np.sum(loads * u)
        for (i, j), length in zip(bonds, lengths, strict=True):
            stretch = np.sqrt(np.sum((x[j] + u[j] - x[i] - u[i]) ** 2)) - length
            total += 1.3 * stretch**2 / 2 - 0.4 * stretch**3 / 3
        return total

    assert network.energy(State(u, np.zeros_like(u))) == pytest.approx(energy(u), rel=1e-13)
    dt, tiny = 1e-3, 1e-30
    run = simulate(network, State(u, np.zeros_like(u)), dt, dt=dt, method="verlet")
    found = (run.final.u - u) * 2 / dt**2
    for site in range(7):
        for axis in range(dim):
            step = np.zeros_like(u, dtype=complex)
            step[site, axis] = 1j * tiny
            force = 0.0 if site == 5 else -energy(u + step).imag / tiny
            assert found[site, axis] == pytest.approx(force / mass[site], abs=1e-9)


@pytest.mark.parametrize("dim", [2, 3])
def test_free_patch_keeps_energy_momentum_and_angular_momentum(dim):
    network = patch(dim=dim)
    start = pushed(network)
    run = simulate(network, start, 20.0, dt=0.02, method="rkn6")
    assert run.energy_error < 1e-11
    np.testing.assert_allclose(
        network.momentum(run.final), network.momentum(start), rtol=0, atol=1e-15
    )
    np.testing.assert_allclose(
        angular_momentum(network, run.final), angular_momentum(network, start), rtol=0, atol=1e-14
    )
    sites = network.site_energy(run).sum(axis=1)
    np.testing.assert_allclose(sites, run.energy, rtol=1e-12)


@pytest.mark.parametrize("name", ["verlet", "rkn6"])
def test_time_reversal_returns_to_the_start(name):
    network = patch(4)
    start = pushed(network)
    there = simulate(network, start, 10.0, method=name, dt=0.05)
    back = simulate(network, there.final.reversed(), 10.0, method=name, dt=0.05)
    np.testing.assert_allclose(back.final.u, start.u, rtol=0, atol=1e-13)
    np.testing.assert_allclose(back.final.v, -start.v, rtol=0, atol=1e-13)


@pytest.mark.parametrize("name", RUNNING)
def test_walls_receive_the_momentum_that_is_lost(name):
    network = fork()
    start = network.at_rest({0: (0.5, 0.0)})
    run = simulate(network, start, 1.5e-4, method=name, dt=1e-7)
    momenta = [
        network.momentum(State(u.copy(), v.copy())) for u, v in zip(run.u, run.v, strict=True)
    ]
    total = np.array(momenta) + run.impulse.sum(axis=1)
    assert run.impulse.shape == (len(run.t), 2, 2)
    assert np.max(np.abs(run.impulse[-1])) > 1e-9
    np.testing.assert_allclose(total, total[0] + 0 * total, rtol=0, atol=1e-16)


def test_impulse_is_the_integral_of_the_wall_loads():
    """By the trapezoidal rule over every step, which is what Verlet's kicks add up to."""
    network = fork()
    every = Record(every=1)
    start = network.at_rest({0: (0.5, 0.0)})
    run = simulate(network, start, 1.5e-4, method="verlet", dt=1e-7, record=every)
    load = network.wall_load(run.u)
    assert load.min() >= 0
    for number, wall in enumerate(network.walls):
        members = network.wall_contacts[:, 1] == number
        pushed_by = np.trapezoid(load[:, members].sum(axis=1), run.t)
        np.testing.assert_allclose(run.impulse[-1, number], -wall.normal * pushed_by, rtol=1e-10)


@pytest.mark.parametrize("name", RUNNING)
def test_a_symmetric_fork_stays_symmetric_to_the_last_bit(name):
    network = fork()
    run = simulate(network, network.at_rest({0: (0.5, 0.0)}), 3e-4, method=name, dt=2e-7)
    one, two = run.u[:, 6:11], run.u[:, 11:]
    assert np.abs(one).max() > 1e-7
    assert np.max(np.abs(one - two * [1, -1])) < 1e-10 * np.abs(one).max()
    assert np.all(run.u[:, :6, 1] == 0)


def test_a_bead_on_a_loaded_wall_swings_about_its_static_overlap():
    """Dropped in contact under its weight W, the linear wall gives way by 2 W/k at most."""
    weight, k, mass = 2.0, 50.0, 0.3
    network = Network(
        [[0.0, 1.0]], [], SPRING, mass=mass, walls=[Wall((0, 0), (0, 1))], radius=1.0,
        wall_contacts=[(0, 0)], wall_spring=PowerLaw(k, 1.0), loads=[[0.0, -weight]],
    )  # fmt: skip
    period = 2 * math.pi * math.sqrt(mass / k)
    run = simulate(network, network.at_rest(), period / 2, dt=period / 2000, method="rkn6")
    assert run.final.u[0, 1] == pytest.approx(-2 * weight / k, rel=1e-6)
    assert abs(run.energy).max() < 1e-9
    assert network.wall_load(run.final.u)[0] == pytest.approx(2 * weight, rel=1e-6)


@pytest.mark.parametrize("how", [{}, {"tol": 1e-8}])
def test_a_spinning_bond_runs_though_its_energy_could_close_it(how):
    """Against the distance of both sites, an oscillator with the barrier of the spin."""
    from scipy.integrate import solve_ivp

    network = Network([(0, 0), (1, 0)], [(0, 1)], series(length=1.0))
    state = network.at_rest({0: (0, -2.0), 1: (0, 2.0)})  # 4 J; the bond closes with 0.5 J
    run = simulate(network, state, 10.0, **how)
    spin = 4.0  # distance times velocity across it; each site has 1 kg, so the force counts twice
    exact = solve_ivp(
        lambda t, x: [x[1], spin**2 / x[0] ** 3 - 2 * (x[0] - 1)], (0, 10), [1.0, 0.0],
        rtol=1e-12, atol=1e-12, method="DOP853",
    )  # fmt: skip
    distance = network.elongation(run.final.u)[0] + 1
    assert distance == pytest.approx(exact.y[0, -1], rel=1e-6)
    assert run.energy_error < 1e-6


@pytest.mark.parametrize("height", [0.5, 0.02])
def test_a_ball_that_falls_from_rest_bounces_back_in_time(height):
    """The energy at the start, 0, says nothing of the speed at which it meets the floor.

    Exact: parabolas, and the time in contact by quadrature of the energy's balance.
    """
    from scipy.integrate import quad
    from scipy.optimize import brentq

    k, g, end = 1e6, 9.81, 2.0
    ball = Network(
        [(0.0, 0.5 + height)], [], [], radius=0.5, walls=[Wall((0, 0), (0, 1))],
        wall_contacts=[(0, 0)], wall_spring=PowerLaw(k, 1.5), loads=[(0.0, -g)],
    )  # fmt: skip

    def square(d):  # of the speed at an overlap
        return 2 * g * (height + d) - 2 * k * d**2.5 / 2.5

    deepest = brentq(square, 1e-5, 0.1)
    inside = quad(  # with d = deepest (1 - s^2) the speed's root is gone
        lambda s: 2 * deepest * s / math.sqrt(square(deepest * (1 - s * s))), 0, 1, epsrel=1e-10
    )[0]
    fall = math.sqrt(2 * height / g)
    late = (end + fall + inside) % (2 * (fall + inside)) - fall - inside  # after the last top
    assert abs(late) < fall
    run = simulate(ball, ball.at_rest(), end)
    assert run.final.u[0, 1] == pytest.approx(-g * late**2 / 2, rel=1e-3)
    assert np.abs(run.energy).max() < 1e-5 * g * height


def test_steps_follow_what_loads_do_where_nothing_opens():
    """Pulled on a hardening spring from rest: the step is that for the elongations met."""
    spring = series(0, 100 / 4)
    network = Network(
        [(0.0, 0.0), (1.0, 0.0)], [(0, 1)], spring, held=[0], loads=[(0.0, 0.0), (30.0, 0.0)]
    )
    run = simulate(network, network.at_rest(), 5.0)
    assert run.method == "rkn6"  # 0.15 of its stability limit, 3.1414
    fastest = math.sqrt(max(spring.stiffness(r) for r in run.elongation_range[0]))
    assert run.dt <= 0.15 * 3.1415 / fastest
    fine = simulate(network, network.at_rest(), 5.0, dt=run.dt / 8, method="rkn6").final.u
    np.testing.assert_allclose(run.final.u, fine, rtol=0, atol=1e-6 * fine.max())


def test_steps_beyond_the_limit_are_refused_with_sites_named():
    network = patch()
    with pytest.raises(StabilityError, match="stability limit"):
        simulate(network, pushed(network), 5.0, dt=3.0)
    cubic, _ = line(2, PowerLaw(100.0, 3.0))
    with pytest.raises(StabilityError, match=r"between sites 0 and 1") as caught:
        simulate(cubic, cubic.at_rest({0: (0.0, 4.0)}), 20.0, dt=0.4)
    assert caught.value.run.u.ndim == 3


def test_the_limit_bounds_the_fastest_mode():
    """Of the tangent stiffness, by differences of the forces; not far above it either."""
    network = patch(4)
    n, h = network.sites * 2, 1e-6
    dt = 1e-4

    def force(u):
        state = State(u.reshape(network.shape), np.zeros(network.shape))
        run = simulate(network, state, dt, dt=dt, method="verlet")
        return ((run.final.u - state.u) * 2 / dt**2).ravel()

    columns = [(force(h * e) - force(-h * e)) / (2 * h) for e in np.eye(n)]
    exact = math.sqrt(-np.linalg.eigvalsh((np.array(columns) + np.array(columns).T) / 2)[0])
    with pytest.raises(StabilityError, match=r"beyond (\S+) s, the stability limit") as refused:
        simulate(network, pushed(network, 1e-6), 10.0, dt=5.0, method="verlet")
    limit = float(str(refused.value).split("beyond ")[1].split()[0])
    assert exact * (1 - 1e-4) < 2 / limit < 1.8 * exact


def test_a_bond_driven_to_the_end_of_its_domain_raises():
    spring = Prism(1.0, 0.8, 0.02, 1.0).potential()
    network = Network([[0.0, 0.0], [0.8, 0.0]], [(0, 1)], spring)
    with pytest.raises(LockingError, match="between sites 0 and 1"):
        simulate(network, network.at_rest({0: (1.0, 0.0)}), 5.0)


def test_coinciding_sites_are_noticed():
    """Steps that end where two sites are at one place: no direction is left there."""
    network = Network([[0.0, 0.0], [1.0, 0.0]], [(0, 1)], series(k=2e-40))
    with pytest.raises(StabilityError, match="sites 0 and 1, which coincide"):
        simulate(network, network.at_rest({0: (1.0, 0.0)}), 4.0, dt=2**-4)


GOOD = {"positions": [[0, 0], [1, 0], [2, 0]], "bonds": [(0, 1), (1, 2)], "spring": SPRING}


@pytest.mark.parametrize(
    ("change", "why"),
    [
        ({"positions": [[0, 0], [0, 0], [2, 0]]}, "same place"),
        ({"positions": [[0, math.nan], [1, 0], [2, 0]]}, "finite"),
        ({"positions": [[0] * 4, [1] * 4, [2] * 4]}, "positions have shape"),
        ({"positions": [[0, 0], [1]]}, "positions"),
        ({"bonds": [(0, 0), (1, 2)]}, "to itself"),
        ({"bonds": [(0, 1), (1, 3)]}, "joins sites 1 and 3"),
        ({"bonds": [(0, 1), (1, -1)]}, "joins sites 1 and -1"),
        ({"bonds": [(0, 1.5)]}, "whole numbers"),
        ({"lengths": [1.0, 0.0]}, "length 0 m of bond 1"),
        ({"lengths": [1.0, math.inf]}, "lengths is inf"),
        ({"lengths": [1.0, 1.0, 1.0]}, r"lengths have shape \(3,\), must be \(2,\)"),
        ({"lengths": [[1.0, 1.0]]}, "lengths have shape"),
        ({"mass": 0.0}, "mass 0 kg of site 0"),
        ({"mass": [1.0, -1.0, 1.0]}, "mass -1 kg of site 1"),
        ({"mass": [1.0, 1.0]}, "mass has shape"),
        ({"mass": math.nan}, "mass"),
        ({"radius": 0.0}, "radius 0 m"),
        ({"spring": [SPRING]}, "1 springs for 2 bonds"),
        ({"spring": "soft"}, "spring of bond 0 is 's'|springs for 2"),
        ({"spring": None}, "not a Potential"),
        ({"held": [3]}, "held site 3"),
        ({"held": 1}, "held 1 must be a sequence of sites"),
        ({"loads": [[0, 1]]}, "loads has shape"),
        ({"walls": ["wall"]}, "not a Wall"),
        ({"walls": Wall((0, 0), (0, 1))}, "walls Wall.* must be a sequence of Walls"),
        ({"walls": 3}, "walls 3 must be a sequence"),
        ({"walls": [Wall((0, 0, 0), (0, 0, 1))]}, "3 coordinates"),
        ({"wall_contacts": [(0, 0)], "wall_spring": SPRING}, "radius"),
        ({"radius": 0.4, "wall_contacts": [(0, 0)], "wall_spring": SPRING}, "with wall 0"),
    ],
)
def test_impossible_networks_are_refused(change, why):
    Network(**GOOD)
    with pytest.raises(TensegrityError, match=why):
        Network(**GOOD | change)


def test_impossible_walls_are_refused():
    for arguments, why in (
        (((0, 0), (0, 0)), "length 0"),
        (((0,), (1, 0)), "shape"),
        (("a", (0, 1)), "wall point 'a' is not made of numbers"),
        (((0, 0), (0, "up")), "wall normal .* is not made of numbers"),
        (((0, 0), (0, 1), "a"), "wall extent 'a' is not"),
        (((0, math.nan), (0, 1)), "finite"),
        (((0, 0), (0, 1), (1, 1)), "perpendicular"),
        (((0, 0), (0, 1), (0, 0)), "above 0"),
    ):
        with pytest.raises(TensegrityError, match=why):
            Wall(*arguments)
    with pytest.raises(TensegrityError, match="point of a wall 'a' is not made of numbers"):
        Wall.between("a", (0, 1), (1, 1))


def test_impossible_states_are_refused():
    network = Network(**GOOD, held=[0])
    with pytest.raises(TensegrityError, match="held"):
        network.at_rest({0: (1.0, 0.0)})
    with pytest.raises(TensegrityError, match="velocity of site 1"):
        network.at_rest({1: 1.0})
    with pytest.raises(TensegrityError, match="must be below 3"):
        network.at_rest({3: (1.0, 0.0)})
    with pytest.raises(TensegrityError, match="shape"):
        simulate(network, State(np.zeros(3), np.zeros(3)), 1.0)


def test_recorded_sites_and_a_file_keep_all_coordinates(tmp_path):
    network = fork()
    state, path = network.at_rest({0: (0.5, 0.0)}), tmp_path / "rows.npy"
    run = simulate(network, state, 1e-5, dt=1e-7, record=Record(every=10, sites=[3, 0], path=path))
    rows = np.load(path, mmap_mode="r")
    assert run.u.shape == rows["v"].shape == (11, 2, 2)
    assert rows["impulse"].shape == (11, 2, 2)
    np.testing.assert_array_equal(run.u[-1, 1], run.final.u[0])
