"""Waves at an interface: the linear limit in closed form, and what must come out of exact waves."""

import math

import numpy as np
import pytest
import sympy as sp

from tensegrity import (
    Chain,
    Potential,
    Prism,
    Record,
    State,
    TensegrityError,
    interface,
    simulate,
    solitary_wave,
    transmission,
)

R = sp.Symbol("r")
HARD = Prism(1.0, 0.8, 0.1, 1.0).potential()
SOFT = Prism(1.0, 0.8, 0.02, 1.0).potential()


def linear(stiffness):
    return Potential(stiffness * R**2 / 2, R)


def met(near, far, mass, width, along):
    """What a long small pulse of compression, `width` sites long, leaves at a linear interface.

    It comes along the near chain (1) or the far one (-1), whose sound speeds are those of
    stiffness over mass.
    """
    springs = linear(near), linear(far)
    speeds = [math.sqrt(k / m) for k, m in zip((near, far), mass, strict=True)]
    side = int(along < 0)
    sites = [int(24 * width * c / speeds[side]) for c in speeds]
    chain = interface(*springs, sites, mass)
    place = sites[0] - along * 6 * width
    x = np.arange(chain.sites) - place
    start = State(
        -along * np.array([math.erf(along * z / width) for z in x]),
        along * 2 / math.sqrt(math.pi) / width * speeds[side] * np.exp(-((x / width) ** 2)),
    )
    start.v[...] *= np.abs(x) < 5.9 * width
    run = simulate(chain, start, 14 * width / speeds[side], dt=0.02, method="rkn6")
    return transmission(run), speeds


# the linear limit


@pytest.mark.parametrize(("far", "mass", "along"), [
    (4.0, (1.0, 1.0), 1), (0.25, (1.0, 1.0), -1), (1.0, (1.0, 3.0), 1), (2.0, (1.5, 0.4), -1),
    (2.0, (1.5, 0.4), 1),
])  # fmt: skip
def test_long_waves_are_divided_by_the_impedances(far, mass, along):
    """Z = sqrt(k m): velocities by (Z - Z')/(Z + Z') and 2 Z/(Z + Z'), the energy by squares."""
    found, speeds = met(1.0, far, mass, 24.0, along)
    z, other = (math.sqrt(k * m) for k, m in zip((1.0, far), mass, strict=True))
    c, further = speeds
    if along < 0:
        z, other, c, further = other, z, further, c
    back = (z - other) / (z + other)
    assert found.reflected_energy == pytest.approx(back**2, abs=5e-4)
    assert found.reflected_energy + found.transmitted_energy == pytest.approx(1, abs=1e-9)
    (reflected,), (transmitted,) = found.reflected, found.transmitted
    assert reflected.direction == -along == -transmitted.direction
    assert reflected.amplitude / found.incident.amplitude == pytest.approx(-back, abs=5e-3)
    assert transmitted.amplitude / found.incident.amplitude == pytest.approx(
        (1 + back) * c / further, rel=1e-2
    )
    assert (reflected.speed, transmitted.speed) == pytest.approx((c, further), rel=1e-2)
    # to first order in the frequency w: Z' - i w excess, with the excess mass of that site
    excess = (mass[1] - mass[0]) / 2
    later = 0.25 / 24 / c  # of a Gaussian's peak, by dispersion, for each width of travel [s]
    back_delay = excess * 2 * z / (z**2 - other**2) + 14 * later
    on_delay = excess / (z + other) + 6 * later + 8 * later * (c / further) ** 2
    close = 0.03 / min(c, further)  # a few hundredths of a site
    assert found.reflected_delays == pytest.approx(back_delay, abs=close)
    assert found.transmitted_delays == pytest.approx(on_delay, abs=close)


def test_the_linear_limit_is_come_to_with_the_square_of_the_length():
    errors = [abs(met(1.0, 4.0, (1.0, 1.0), width, 1)[0].reflected_energy - 1 / 9)
              for width in (8.0, 16.0, 32.0)]  # fmt: skip
    assert errors[0] / errors[1] == pytest.approx(4, rel=0.2)
    assert errors[1] / errors[2] == pytest.approx(4, rel=0.2)


# solitary waves


@pytest.mark.parametrize("along", [1, -1])
def test_a_solitary_wave_passes_an_interface_that_is_hardly_one(along):
    chain = interface(HARD, HARD, (80, 90), (1.0, 1.0 + 1e-9))
    wave = solitary_wave(HARD, chain.mass[0 if along > 0 else -1], speed_ratio=1.5)
    at = 40.3 if along > 0 else 125.3
    run = simulate(chain, wave.launch(chain, at, along), 75 / wave.speed, dt=0.01 / wave.speed,
                   method="rkn6")  # fmt: skip
    found = transmission(run)
    assert (found.site, found.reflected) == (80, ())
    assert found.transmitted_energy == pytest.approx(1, abs=1e-8)
    (passed,) = found.transmitted
    assert passed.amplitude == pytest.approx(wave.amplitude, rel=1e-6)
    assert passed.wave.mass == chain.mass[-1 if along > 0 else 0]
    assert found.transmitted_delays[0] * wave.speed == pytest.approx(0, abs=1e-6)


@pytest.fixture(scope="module")
def softer():
    """A wave of compression from hard to soft prisms."""
    chain, wave = interface(HARD, SOFT, (200, 200)), solitary_wave(HARD, speed_ratio=1.2)
    start = wave.launch(chain, at=150.0)
    return wave, simulate(
        chain, start, 130 / wave.speed, tol=1e-9, record=Record(interval=1.3 / wave.speed)
    )


def test_hard_to_soft_reflects_rarefaction_and_transmits_solitary_compression(softer):
    wave, run = softer
    found = transmission(run)
    assert found.incident.place == pytest.approx(150.0, abs=1e-7)
    assert found.incident.wave.speed == pytest.approx(wave.speed, rel=1e-7)
    assert all(pulse.place < 200 and pulse.direction == -1 for pulse in found.reflected)
    assert all(pulse.place >= 200 and pulse.direction == 1 for pulse in found.transmitted)
    assert found.reflected[0].amplitude > 0
    assert found.reflected[0].wave is None  # no small rarefaction waves in this chain
    leading = found.transmitted[-1]
    assert leading.amplitude < 0
    assert leading.wave is not None
    assert leading.energy < found.transmitted_energy * wave.energy
    assert found.reflected_energy + found.transmitted_energy == pytest.approx(1, abs=1e-7)


def test_a_delay_does_not_depend_on_the_row_once_the_wave_is_on_its_own(softer):
    _, run = softer
    early, late = (transmission(run, row) for row in (-25, -1))
    assert early.transmitted_delays[-1] == pytest.approx(late.transmitted_delays[-1], abs=2e-3)


def test_the_chain_of_an_interface_is_the_near_one_and_then_the_far_one():
    chain = interface(HARD, SOFT, (3, 2), (1.0, 2.0))
    assert isinstance(chain, Chain)
    assert chain.springs == (HARD, HARD, HARD, SOFT)
    assert chain.mass.tolist() == [1.0, 1.0, 1.0, 2.0, 2.0]
    assert chain.ends == ("free", "free")
    with pytest.raises(TensegrityError, match="1 numbers of sites and 2 masses"):
        interface(HARD, SOFT, (3,))
    with pytest.raises(TensegrityError, match="mass -1 kg must be above 0"):
        interface(HARD, SOFT, (3, 3), (1.0, -1.0))


# what is refused


def test_what_is_no_incidence_is_an_error(softer):
    wave, run = softer
    chain = run.scene

    def still(chain, state):
        return simulate(chain, state, 1e-9, dt=1e-9, record=Record(every=1))

    plain, three = Chain(HARD, 200), Chain([HARD] * 4 + [SOFT] * 4 + [HARD] * 3, 12)
    with pytest.raises(TensegrityError, match="a chain without one interface"):
        transmission(still(plain, wave.launch(plain, 100.0)))
    with pytest.raises(TensegrityError, match=r"with changes at the sites \[4, 8\]"):
        transmission(still(three, three.at_rest({0: 0.01})))
    with pytest.raises(TensegrityError, match="0 pulses in the first row"):
        transmission(still(chain, chain.at_rest()))
    with pytest.raises(TensegrityError, match="is not on its way to the interface at 200"):
        transmission(still(chain, wave.launch(chain, 150.0, direction=-1)))
    with pytest.raises(TensegrityError, match="the incident pulse has not reached the interface"):
        transmission(run, 3)


def test_a_run_that_an_end_has_answered_is_refused(softer):
    wave, _ = softer
    chain = interface(HARD, SOFT, (80, 40))
    run = simulate(chain, wave.launch(chain, 40.0), 100 / wave.speed, tol=1e-6,
                   record=Record(interval=1.3 / wave.speed))  # fmt: skip
    with pytest.raises(TensegrityError, match="take an earlier row or a longer chain"):
        transmission(run)
    assert transmission(run, 55).transmitted
