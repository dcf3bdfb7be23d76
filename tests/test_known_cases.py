"""Cases of the literature with their numbers, by the public interface alone."""

import numpy as np
import pytest
from scipy.integrate import solve_ivp

from tensegrity import Chain, PowerLaw, phase_shift, simulate, solitary_wave


def test_newtons_cradle_of_three_balls_leaves_the_velocities_of_hinch_and_saint_jean():
    chain = Chain(PowerLaw(1.0, 1.5), sites=3)
    run = simulate(chain, chain.at_rest({0: 1.0}), 20.0, tol=1e-10)
    assert run.final.v == pytest.approx([-0.0709524, 0.0764031, 0.9945493], abs=1e-7)


@pytest.mark.parametrize(("between", "shift"), [(60, 0.36011), (61, 0.35646)])
def test_equal_waves_of_beads_that_meet_at_a_contact_or_a_bead_are_shifted(between, shift):
    """Santibanez et al. (2011); waves launched an odd number of sites apart meet at a contact."""
    spring = PowerLaw(1.0, 1.5)
    wave, chain = solitary_wave(spring, amplitude=-0.1), Chain(spring, 161)
    start = wave.launch(chain, 50.0) + wave.launch(chain, 50.0 + between, direction=-1)
    run = simulate(chain, start, 80 / wave.speed, tol=1e-9)
    assert phase_shift(run, wave, wave) == pytest.approx((shift, shift), abs=2e-5)


def test_a_tapered_chain_has_the_velocities_of_another_integrator():
    """25 beads, each of 0.95 the radius of the one before: masses by its cube, contacts by
    sqrt(R R'/(R + R')); the first strikes the others at 1 m/s (Harbola et al. 2009)."""
    radii = 0.95 ** np.arange(25.0)
    mass = radii**3
    stiffness = np.sqrt(radii[1:] * radii[:-1] / (radii[1:] + radii[:-1]))
    chain = Chain([PowerLaw(k, 1.5) for k in stiffness], 25, mass)
    run = simulate(chain, chain.at_rest({0: 1.0}), 60.0, tol=1e-10)

    def rates(_, y):
        force = stiffness * np.maximum(y[:24] - y[1:25], 0) ** 1.5
        return np.concatenate([y[25:], np.diff(force, prepend=0, append=0) * -1 / mass])

    y = solve_ivp(rates, (0, 60), [0.0] * 25 + [1.0] + [0.0] * 24, method="DOP853",
                  rtol=1e-13, atol=1e-15, max_step=0.01).y[:, -1]  # fmt: skip
    assert run.final.v == pytest.approx(y[25:], abs=2e-10)  # its steps end at no contact
    assert run.final.v[-1] > 1.5
