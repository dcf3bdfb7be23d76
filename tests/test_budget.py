"""What passes through a bond, against a closed form and against what the sites hold."""

import math

import numpy as np
import pytest
from scenes import prism_chain, smooth_blow
from scipy.integrate import quad
from scipy.interpolate import BarycentricInterpolator

from figures import _scenes
from tensegrity import Chain, Ensemble, Record, TensegrityError, budget, simulate

ALL = Record(every=1)


def test_two_masses_and_a_linear_spring_as_in_closed_form():
    """r = sin(w t)/w with w^2 = 2: the second mass has v = (cos(w t) - 1)/2 times the blow."""
    chain = Chain(_scenes.linear(1.0), 2)
    run = simulate(chain, chain.at_rest({1: 1.0}), 10.0, method="rkn6", dt=0.02, record=ALL)
    found, w = budget(run, 0), math.sqrt(2)
    v = (1 + np.cos(w * run.t)) / 2
    np.testing.assert_allclose(found.impulse, v - 1, atol=1e-11)
    np.testing.assert_allclose(found.work, (v**2 - 1) / 2, atol=1e-11)
    assert found.momentum_error < 1e-11


@pytest.mark.parametrize("bond", [0, 3, 30])
def test_energy_and_momentum_beyond_any_bond_close(bond):
    chain = prism_chain(40)
    run = simulate(chain, smooth_blow(chain), 40.0, method="rkn6", dt=0.02, record=ALL)
    found = budget(run, bond)
    assert found.energy_error < 1e-10
    assert found.momentum_error < 1e-10
    coarse = simulate(chain, smooth_blow(chain), 40.0, method="rkn6", dt=0.32, record=ALL)
    assert budget(coarse, bond).energy_error > 1e4 * found.energy_error  # it is no identity


def test_errors_are_relative_to_the_energy_and_to_the_change_of_momentum():
    """A coarse run, its quadrature by exact polynomials through the same instants."""
    chain = Chain(_scenes.linear(2.0), 2)
    run = simulate(chain, chain.at_rest({1: 3.0}), 7.0, method="rkn6", dt=1.0, record=ALL)
    found = budget(run, 0)
    tension = 2 * (run.u[:, 1] - run.u[:, 0])  # 8 instants: the spline is one polynomial
    for rate, kept, scale, error in (
        (-tension * run.v[:, 1], run.v[:, 1] ** 2 / 2, 3.0**2 / 2, found.energy_error),
        (-tension, run.v[:, 1], np.abs(run.v[:, 1] - 3).max(), found.momentum_error),
    ):
        passed = BarycentricInterpolator(run.t, rate)
        gaps = [
            kept[k] - kept[0] - quad(passed, 0, t, epsabs=1e-12)[0] for k, t in enumerate(run.t)
        ]
        assert error == pytest.approx(np.abs(gaps).max() / scale, rel=1e-8)
        assert error > 1e-4


def test_a_chain_that_stays_at_rest_has_no_error():
    chain = prism_chain(6)
    run = simulate(chain, chain.at_rest(), 2.0, method="rkn6", dt=0.1, record=ALL)
    found = budget(run, 2)
    assert (found.energy_error, found.momentum_error) == (0, 0)


def test_force_at_a_held_end_is_the_change_of_momentum():
    chain = prism_chain(40, ends=("fixed", "free"))
    state = chain.at_rest({1: 0.03})
    run = simulate(chain, state, 30.0, method="rkn6", dt=0.02, record=ALL)
    found = budget(run, 0)
    assert found.momentum_error < 1e-10
    change = chain.momentum(run.final) - chain.momentum(state)
    assert found.impulse[-1] == pytest.approx(change, abs=1e-11)
    assert abs(change) > 1e-3


def test_bad_input_says_what_and_why():
    chain = prism_chain(12)
    run = simulate(chain, smooth_blow(chain), 2.0, method="rkn6", dt=0.1, record=ALL)
    with pytest.raises(TensegrityError, match="bond 11 must be below 11"):
        budget(run, 11)
    few = simulate(chain, smooth_blow(chain), 2.0, method="rkn6", dt=0.5, record=ALL)
    with pytest.raises(TensegrityError, match="5 instants recorded, must be above 7"):
        budget(few, 3)
    some = simulate(chain, smooth_blow(chain), 2.0, dt=0.1, record=Record(every=1, sites=[3, 4]))
    with pytest.raises(TensegrityError, match="2 of 12 sites recorded"):
        budget(some, 3)
    held = prism_chain(12, ends=("free", "fixed"))
    run = simulate(held, smooth_blow(held), 2.0, method="rkn6", dt=0.1, record=ALL)
    with pytest.raises(TensegrityError, match="the last site is fixed"):
        budget(run, 3)
    spring = chain.springs[0]
    changing = Chain(spring.over_time(prestrain=0.03), 12)
    tuned = simulate(changing, smooth_blow(chain), 2.0, dt=0.1, record=ALL)
    with pytest.raises(TensegrityError, match="springs that change in time"):
        budget(tuned, 3)
    lanes = Ensemble(chain, 2)
    with pytest.raises(TensegrityError, match="is Ensemble, not a Chain"):
        budget(simulate(lanes, lanes.at_rest({0: 0.01}), 2.0, dt=0.1, record=ALL), 3)
