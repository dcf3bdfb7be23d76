"""Lyapunov exponents: numbers of another computation, another integrator, and linear chains."""

import numpy as np
import pytest
import sympy as sp
from scipy.integrate import solve_ivp

from tensegrity import (
    Chain,
    Damping,
    Network,
    PairLaw,
    Potential,
    PowerLaw,
    Prism,
    StabilityError,
    State,
    TensegrityError,
    lyapunov,
    simulate,
)

r, x, y = sp.symbols("r x y")
HARD, HARMONIC = Potential(r**2 / 2 + r**4 / 4, r), Potential(r**2 / 2, r)
HENON = PairLaw((x**2 + y**2) / 2 + x**2 * y - y**3 / 3, [x], [y])
WALLS = {"ends": ("fixed", "fixed")}


def henon(energy, height):
    """Henon and Heiles' particle: one coordinate each of two sites, whose bond is the potential."""
    speed = np.sqrt(2 * energy - height**2 + 2 * height**3 / 3)
    return Chain(HENON, 2, mass=1.0), State([[0.0], [height]], [[speed], [0.0]])


@pytest.mark.parametrize(
    ("energy", "height", "known"),
    [(1 / 8, -0.25, 0.059847403759), (1 / 12, 0.1, 0.000558776271)],
)
def test_henon_and_heiles_after_100_seconds(energy, height, known):
    chain, state = henon(energy, height)
    tangent = State([[1.0], [0.0]], [[0.0], [0.0]])
    found = lyapunov(chain, state, 100.0, dt=0.02, tangent=tangent)
    assert found.exponent == pytest.approx(known, abs=1e-12)


def first(sites, size):
    """A number at the first site that moves."""
    return size * np.eye(sites)[1]


def test_chains_between_walls_after_short_times():
    still = np.zeros(34)
    u = 0.3 * np.sin(12 * np.pi * np.arange(34) / 33)
    u[-1] = 0.0
    long = Chain(HARD, 34, **WALLS)
    found = lyapunov(long, State(u, still), 100.0, dt=0.02, tangent=State(first(34, 1), still))
    assert found.exponent == pytest.approx(0.00735059592, abs=1e-11)
    assert found.energy_error < 1e-13
    short, still = Chain(HARD, 10, **WALLS), np.zeros(10)
    start = short.at_rest({1: 2.0})
    found = lyapunov(short, start, 50.0, dt=0.01, tangent=State(first(10, 2), still))
    assert found.exponent == pytest.approx(0.006515857664, abs=1e-12)
    beads = Chain(PowerLaw(1.0, 1.5, preload=0.1**1.5), 10, **WALLS)
    start = beads.at_rest({1: 0.3})
    offs = [
        abs(lyapunov(beads, start, 60.0, dt=dt, tangent=State(first(10, 1), still)).exponent
            + 0.00373983)
        for dt in (0.02, 0.005)
    ]  # fmt: skip
    assert offs[0] < 2e-6
    assert offs[1] < 4e-7


def test_masses_and_several_coordinates_against_another_integrator():
    """A ring of unequal masses by DOP853 of the variational equations."""
    mass = np.array([1.0, 2.0, 0.5, 1.5])
    ring = Chain(HARD, 4, mass, ends="periodic", stretch=0.4)
    rng = np.random.default_rng(3)
    start, tangent = (State(*rng.normal(size=(2, 4))) for _ in range(2))

    def rates(_, z):
        u, v, du, dv = z.reshape(4, 4)
        length = np.append(np.diff(u), u[0] - u[-1] + 0.4)
        force = length + length**3
        change = (1 + 3 * length**2) * np.append(np.diff(du), du[0] - du[-1])
        a, da = ((f - np.roll(f, 1)) / mass for f in (force, change))
        return np.concatenate([v, a, dv, da])

    z = np.concatenate([start.u, start.v, tangent.u, tangent.v])
    end = solve_ivp(rates, (0, 10.0), z, rtol=1e-11, atol=1e-12, method="DOP853").y[:, -1]
    known = np.log(np.linalg.norm(end[8:]) / np.linalg.norm(z[8:])) / 10
    found = lyapunov(ring, start, 10.0, dt=0.005, tangent=tangent)
    assert found.exponent == pytest.approx(known, abs=1e-9)
    assert np.abs(found.final.u - end[:4]).max() < 1e-9
    net = Prism(1.0, 0.7, 0.1, 1.0, 5.0, 50.0).column(3, "same", plates=(3.0, 0.577))
    rest = net.at_rest()
    kicked = State(rest.u, 0.01 * rng.normal(size=net.shape))
    moved = simulate(net, kicked, 5.0, method="rkn6", dt=0.01)
    assert np.abs(lyapunov(net, kicked, 5.0, dt=0.01).final.u - moved.final.u).max() < 1e-12


def test_linear_chains_do_not_grow_and_the_result_says_so():
    chain = Chain(HARMONIC, 10, **WALLS)
    found = lyapunov(chain, chain.at_rest({1: 1.0}), 2000.0)
    assert abs(found.exponent) < 1e-3
    assert found.exponent < found.regular
    assert "not above" in str(found)
    assert len(found.t) == len(found.exponents) <= 100
    axes = found.plot()
    assert axes.get_xscale() == "log"
    same = lyapunov(chain, chain.at_rest({1: 1.0}), 2000.0, dt=found.dt, every=7)
    assert same.exponent == pytest.approx(found.exponent, abs=1e-12)
    other = lyapunov(chain, chain.at_rest({1: 1.0}), 2000.0, dt=found.dt, seed=5)
    assert other.exponent != found.exponent


def test_chaos_of_a_stiffening_chain_has_two_digits():
    chain = Chain(HARD, 10, **WALLS)
    found = lyapunov(chain, chain.at_rest({1: 2.0}), 2e4, dt=0.04)
    assert found.exponent == pytest.approx(0.0209, abs=0.005)  # .0209 after 1e5 s and more
    assert found.exponent > found.regular
    assert 0 < found.spread < 0.004


@pytest.mark.slow
@pytest.mark.parametrize(
    ("scene", "start", "dt", "known", "spread"),
    [
        (*henon(1 / 8, -0.25), 0.05, 0.046, 0.003),
        (*henon(1 / 6, -0.25), 0.05, 0.127, 0.004),
        (Chain(HARD, 10, **WALLS), {1: 2.0}, 0.04, 0.0209, 0.0005),
        (Chain(PowerLaw(1.0, 1.5, preload=0.1**1.5), 10, **WALLS), {1: 0.3}, 0.05, 0.0316, 0.0005),
    ],
)
def test_exponents_of_long_motions(scene, start, dt, known, spread):
    state = scene.at_rest(start) if isinstance(start, dict) else start
    found = lyapunov(scene, state, 1e5, dt=dt)
    assert found.exponent == pytest.approx(known, abs=2 * spread)


def test_what_has_no_exponent_is_named():
    chain, still = Chain(HARD, 6), State(np.zeros(6), np.zeros(6))
    start = chain.at_rest({0: 1.0})
    net = Network([[0, 0], [1, 0]], [[0, 1]], HARD, radius=0.5, contacts="follow", law=HARD)
    calls = {
        "no perturbation": lambda: lyapunov(chain, start, 1.0, tangent=still),
        "tangent has shape (2,)": lambda: lyapunov(
            chain, start, 1.0, tangent=State([0, 1], [0, 0])
        ),
        "not for scenes that are driven": lambda: lyapunov(
            Chain(HARD, 6, damping=Damping(0.1)), start, 1.0
        ),
        "contacts of the scene must be 'fixed'": lambda: lyapunov(net, net.at_rest(), 1.0),
    }
    for words, call in calls.items():
        with pytest.raises(TensegrityError) as said:
            call()
        assert words in str(said.value), said.value
    with pytest.raises(StabilityError, match=r"smaller|too large"):
        lyapunov(chain, start, 100.0, dt=1.9)
