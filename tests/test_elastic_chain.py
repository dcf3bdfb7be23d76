"""Prisms with elastic bases or bars inside a chain: the inner solve in the compiled loop."""

import math

import numpy as np
import pytest
from oracle import stepped

from tensegrity import Chain, Prism, RangeError, equilibrium_path, simulate

INF = math.inf
PRISMS = {
    "goes flat": (1.0, 0.5, 0.4, 1.0, 2.0, 20.0),
    "rigid bases": (1.0, 0.7, 0.01, 1.0, INF, 10.0),
}


def softening(preload=0.05):
    """A prism that softens to a limit point of its load."""
    return Prism(*PRISMS["goes flat"]).potential(preload)


def held_and_struck(sites=80, speed=0.15):
    """The first mass held, the next one struck compressively."""
    chain = Chain(softening(), sites, ends=("fixed", "free"))
    return chain, chain.at_rest({1: speed})


@pytest.mark.parametrize("preload", [0.0, 0.05])
def test_a_chain_of_elastic_prisms_keeps_its_energy_to_round_off(preload):
    """Whose sum over the kicks of a run grows as the root of their number."""
    chain = Chain(softening(preload), 40)
    run = simulate(chain, chain.at_rest({0: 0.15}), 50.0, method="rkn6", dt=0.02)
    kicks = run.steps * 11
    assert run.energy_error < 2 * np.finfo(float).eps * math.sqrt(kicks)


def test_energy_error_of_a_coarser_run_falls_with_the_sixth_power_of_the_step():
    chain, state = held_and_struck()
    steps = np.array([0.4, 0.3, 0.2])
    errors = [simulate(chain, state, 60.0, method="rkn6", dt=dt).energy_error for dt in steps]
    assert np.polyfit(np.log(steps), np.log(errors), 1)[0] == pytest.approx(6, abs=0.3)


def test_mixed_chain_of_rigid_and_elastic_prisms_follows_newton():
    springs = [Prism(*PRISMS["rigid bases"]).potential()] * 66
    springs += [Prism(1.0, 0.8, 0.05, 1.0).potential()] * 33
    chain = Chain(springs, 100, mass=np.linspace(0.5, 2, 100))
    u = 0.01 * np.sin(np.arange(100) ** 2)
    state = type(chain.at_rest())(u, np.zeros(100))
    dt = 1e-3
    run = simulate(chain, state, dt, dt=dt, method="verlet")
    edges = np.zeros(101)
    edges[1:-1] = chain.bond_tension(u)
    acceleration = np.diff(edges) / chain.mass
    np.testing.assert_allclose(run.final.u, u + dt**2 / 2 * acceleration, rtol=0, atol=1e-17)


def test_trajectory_of_elastic_prisms_is_that_of_plain_numpy():
    chain, state = held_and_struck(40)
    plain = stepped(chain, state, "rkn6", 0.05, 150)
    run = simulate(chain, state, 7.5, method="rkn6", dt=0.05)
    assert np.max(np.abs(run.final.u - plain.u)) < 1e-13 * np.max(np.abs(plain.u))
    assert np.max(np.abs(run.final.v - plain.v)) < 1e-13 * np.max(np.abs(plain.v))


def test_a_compressive_blow_on_a_softening_chain_sends_a_supersonic_rarefaction_wave():
    chain, state = held_and_struck(230)
    run = simulate(chain, state, 150.0, tol=1e-6)
    r = chain.elongation(run.u)
    late = run.t > 90
    ahead = np.arange(230 - 1) > 60
    front = np.array([np.flatnonzero(ahead)[np.argmax(row[ahead])] for row in r[late]])
    speed = np.polyfit(run.t[late], front, 1)[0] / chain.springs[0].sound_speed()
    assert 1.01 < speed < 1.04
    last = r[-1, front[-1] - 10 : front[-1] + 20]
    assert last.max() > 5 * -last[10:].min()  # nothing compressive before it


def test_members_too_stiff_for_the_loop_limit_its_reach_and_a_run_beyond_says_so():
    potential = Prism(1.0, 0.7, 0.01, 1.0, 1e5, 1e5).potential()
    contact = Prism(1.0, 0.7, 0.01, 1.0).potential().domain[0]  # of the rigid prism
    assert potential.domain[0] < 2 * contact
    assert potential.computable_domain[0] == pytest.approx(contact, rel=0.05)
    chain = Chain(potential, 5)
    chain.at_rest({0: 0.01})
    with pytest.raises(RangeError, match=r"members this stiff.*between sites 0 and 1.*t = ") as at:
        simulate(chain, chain.at_rest({0: 2.0}), 5.0, dt=1e-4)
    assert np.isfinite(at.value.run.u).all()


@pytest.mark.parametrize("arguments", [
    pytest.param((1.0, 0.3, 0.01, 1.0, 0.01), marks=pytest.mark.slow),
    pytest.param((1.0, 0.3, 0.0, 1.0, 0.03), marks=pytest.mark.slow),
    (1.0, 0.3, 0.01, 1.0, 0.1, 0.05),
])  # fmt: skip
def test_members_far_softer_than_the_cross_strings_move_as_the_equilibria_say(arguments):
    from scipy.integrate import solve_ivp

    potential = Prism(*arguments).potential()
    chain = Chain(potential, 3)
    start = chain.at_rest({0: 0.002})
    run = simulate(chain, start, 4.0, tol=1e-8)

    def rates(t, y):
        pull = potential.tension(np.diff(y[:3]))
        return np.concatenate([y[3:], np.diff(pull, prepend=0, append=0)])

    exact = solve_ivp(rates, (0, 4), np.append(start.u, start.v), "DOP853", rtol=1e-10, atol=1e-14)
    assert abs(run.final.u - exact.y[:3, -1]).max() < 1e-8 * abs(run.u).max()
    with pytest.raises(RangeError, match=r"at or (above .* or this soft|below .* this stiff)"):
        simulate(chain, chain.at_rest({2: 0.5}), 4.0)


def test_a_stiff_prism_preloaded_to_its_contact_is_followed_near_it():
    prism = Prism(2.0, 1.5, 1e-6, 3.0, 1e8, 1e8)
    potential = prism.potential(0.3 * equilibrium_path(prism).load.max())
    assert np.isfinite(potential.energy(potential.domain)).all()
    assert 0 < potential.computable_domain[1] < potential.domain[1]
    chain = Chain(potential, 2)
    run = simulate(chain, chain.at_rest({0: 1e-3}), 1e-3, tol=1e-7)
    r = chain.elongation(run.u)[:, 0]  # meets a spring of nearly constant stiffness
    angle = np.sqrt(2 * potential.stiffness(0.0)) * run.t
    assert abs(r + np.sin(angle) * 1e-3 / angle[-1] * run.t[-1]).max() < 1e-3 * abs(r).max()


@pytest.mark.parametrize(("k_base", "k_bar"), [(1e15, 1e15), (1e3, 1e8), (3.0, 3.0)])
@pytest.mark.parametrize(("height", "prestrain"), [(0.5, 0.3), (1.5, 0.0), (3.0, 0.3)])
def test_every_prism_reaches_the_contact_or_the_one_of_the_rigid_prism(
    height, prestrain, k_base, k_bar
):
    potential = Prism(1.0, height, prestrain, 1.0, k_base, k_bar).potential()
    rigid = Prism(1.0, height, prestrain, 1.0).potential()
    assert potential.computable_domain[1] == potential.domain[1]
    assert potential.computable_domain[0] <= max(potential.domain[0], 0.8 * rigid.domain[0])
