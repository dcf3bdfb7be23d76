"""Periodic waves, dispersive shocks and energies of modes: closed forms and runs of rings."""

import numpy as np
import pytest
import sympy as sp
from scipy.special import ellipe, ellipj, ellipk

from tensegrity import (
    Chain,
    Potential,
    PowerLaw,
    Prism,
    Record,
    ResolutionError,
    State,
    TensegrityError,
    modes,
    periodic_wave,
    shock,
    simulate,
    solitary_wave,
)

r = sp.Symbol("r")
TODA, CUBIC = Potential(sp.exp(-r) + r - 1, r), Potential(r**2 / 2 + r**3 / 3, r)
SOFT = Potential(r**2 / 2 - r**3 / 3, r)
PRISM = Prism(1.0, 0.7, 0.1, 1.0).potential()


@pytest.mark.parametrize(
    ("spring", "given", "maximum", "minimum"),
    [
        (CUBIC, {"period": 12, "speed": 1.02}, 0.180847035098, -0.062106151623),
        (CUBIC, {"period": 20, "speed": 1.03, "mean": 0.02}, 0.097989532853, -0.003657043925),
        (PRISM, {"period": 10, "speed": 1.699939374476}, 0.006844186549, -0.016598463448),
    ],
)
def test_a_periodic_wave_returns_after_ten_periods_both_ways(spring, given, maximum, minimum):
    wave = periodic_wave(spring, **given)
    assert (wave.maximum, wave.minimum) == pytest.approx((maximum, minimum), abs=1.1e-12)
    assert wave.residual < 1e-14
    sites, last = given["period"], wave.period / wave.speed
    ring = Chain(spring, sites, ends="periodic", stretch=sites * wave.mean)
    for direction in (1, -1):
        start = wave.launch(ring, at=0.3, direction=direction)
        run = simulate(ring, start, 10 * last, method="rkn6", dt=last / 1000)
        assert np.abs(run.final.v - start.v).max() < 1e-11 * np.abs(start.v).max()
    same = periodic_wave(spring, period=sites, height=wave.height, mean=wave.mean)
    assert same.speed == pytest.approx(wave.speed, rel=1e-12)


@pytest.mark.parametrize(("sites", "m"), [(16, 0.9), (12, 0.99), (32, 0.999)])
def test_toda_s_cnoidal_wave_is_found(sites, m):
    whole, second = ellipk(m), ellipe(m)
    w = (1 / ellipj(2 * whole / sites, m)[0] ** 2 - 1 + second / whole) ** -0.5

    def known(x):
        dn = ellipj(2 * whole * x / sites, m)[2]
        return -np.log(1 + w**2 * (dn**2 - second / whole))

    x = np.linspace(0, sites, 41)
    mean = known(np.arange(sites)).mean()
    speed = sites * w / (2 * whole)
    wave = periodic_wave(TODA, period=sites, speed=speed, mean=mean)
    assert np.abs(wave.elongation(x) - known(x + sites / 2)).max() < 1e-13 / (1 - m)


def test_heavy_sites_and_small_waves():
    light, heavy = (periodic_wave(CUBIC, m, period=8.5, height=1e-6) for m in (1.0, 4.0))
    linear = 2 * np.sin(np.pi / 8.5) / (2 * np.pi / 8.5)
    assert light.speed == pytest.approx(linear, rel=1e-9)
    assert heavy.speed == pytest.approx(linear / 2, rel=1e-9)
    even = periodic_wave(Potential(r**2 / 2 + r**4 / 4, r), period=2, height=1.4)
    rate = np.sqrt(4 + 4 * 0.7**2)  # of the pi-mode, q'' = -4 q - 4 q^3
    m = 2 * 0.7**2 / (4 + 4 * 0.7**2)
    assert 2 / even.speed == pytest.approx(4 * ellipk(m) / rate, rel=1e-11)


@pytest.mark.parametrize(
    ("spring", "behind", "lead", "peak", "trail"),
    [
        (TODA, -0.5, 1.1830079513, -0.8996666813, 0.7159745833),
        (SOFT, -0.1, 1.0628551015, -0.1915929831, 0.904554885),
        (PRISM, -0.01, 1.7949362661, -0.0188708036, 1.4712185953),
    ],
)
def test_edges_of_shocks(spring, behind, lead, peak, trail):
    found = shock(spring, behind)
    assert (found.lead, found.trail) == pytest.approx((lead, trail), abs=6e-11)
    assert found.wave.amplitude == pytest.approx(peak, abs=6e-11)
    assert found.wave.speed == pytest.approx(found.lead, rel=1e-12)
    heavy = shock(spring, behind, mass=4.0)
    assert (2 * heavy.lead, 2 * heavy.piston) == pytest.approx((found.lead, found.piston))


def test_a_shock_onto_a_strained_state_is_that_of_the_spring_from_there():
    """exp(-r) about another state is the same spring, softer by a factor."""
    scaled = Potential(sp.Symbol("k") * (sp.exp(-r) + r - 1), r, parameters={"k": 1.0})
    found, moved = shock(TODA, -0.5), shock(scaled, -0.6, -0.1)
    assert moved.lead == pytest.approx(found.lead * np.exp(0.05), rel=1e-13)
    assert moved.wave.amplitude == pytest.approx(found.wave.amplitude, rel=1e-10)
    assert found.piston == pytest.approx(2 * (np.exp(0.25) - 1), rel=1e-13)


def test_small_shocks_are_those_of_korteweg_and_de_vries():
    """Leading wave of twice the step, moving faster than sound by a third of its excess behind."""
    found = shock(SOFT, -1e-4)
    assert found.wave.amplitude == pytest.approx(-2e-4, rel=1e-3)
    excess = np.sqrt(1 + 2e-4) - 1
    assert found.lead - 1 == pytest.approx(2 / 3 * excess, rel=1e-3)
    assert found.trail - 1 == pytest.approx(-excess, rel=1e-3)


def front(spring, behind, t_end, sites):
    """Place of the leading maximum in the run of a step, at two instants."""
    chain, found = Chain(spring, sites), shock(spring, behind)
    start = found.launch(chain, at=sites / 2)
    times = [t_end / 2, t_end]
    run = simulate(chain, start, t_end, method="rkn6", dt=0.1, record=Record(times=times))
    places = []
    for row in chain.elongation(run.u) / behind:
        peaks = (
            np.flatnonzero((row[1:-1] > row[:-2]) & (row[1:-1] >= row[2:]) & (row[1:-1] > 0.8)) + 1
        )
        at = peaks[-1]
        low, middle, high = row[at - 1 : at + 2]
        places.append(at + (low - high) / (2 * (low - 2 * middle + high)))
    return found, np.diff(places)[0] / (t_end / 2), row[at]


def test_the_leading_wave_of_a_run_has_the_predicted_speed():
    found, speed, peak = front(TODA, -0.5, 200.0, 700)
    assert -5e-3 < speed / found.lead - 1 < 0
    assert 0.9 < peak * -0.5 / found.wave.amplitude < 1.0


@pytest.mark.slow
@pytest.mark.parametrize(("spring", "behind"), [(TODA, -0.5), (SOFT, -0.1), (PRISM, -0.01)])
def test_speeds_of_leading_waves_approach_the_prediction(spring, behind):
    """The difference falls about like 1/t: extrapolated, it is a third of the last one or less."""
    offs = []
    for t_end in (300.0, 600.0):
        found, speed, _ = front(spring, behind, t_end, 2400)
        offs.append(speed - found.lead)
    assert abs(offs[1]) < 2.5e-3 * found.lead
    assert abs(2 * offs[1] - offs[0]) < 6e-4 * found.lead


def test_energies_of_modes_are_conserved_in_a_harmonic_ring_and_return_in_fpu_s_chain():
    linear = Potential(r**2 / 2, r)
    ring = Chain(linear, 12, np.linspace(1, 2, 12), ends="periodic")
    start = State(*np.random.default_rng(4).normal(size=(2, 12)))
    found = modes(ring, count=12)
    run = simulate(ring, start, 20.0, tol=1e-11)
    each = found.energies(run)
    assert each.sum(axis=1) == pytest.approx(np.full(len(each), ring.energy(start)), rel=1e-9)
    shares = each / each.sum(axis=1, keepdims=True)
    spread = np.exp(-np.sum(shares * np.log(shares), axis=1)) / 12
    assert np.ptp(spread) < 1e-9
    assert found.energies(start) == pytest.approx(each[0])
    chain = Chain(Potential(r**2 / 2 + r**3 / 12, r), 33, ends=("fixed", "fixed"))
    u = np.sin(np.pi * np.arange(33) / 32)
    u[-1] = 0.0
    record = Record(interval=4.0)
    run = simulate(chain, State(u, 0 * u), 9600.0, method="rkn6", dt=0.1, record=record)
    first = modes(chain, count=1).energies(run)[:, 0] / run.energy[0]
    late = np.where(run.t > 5000, first, 0.0)
    assert run.t[late.argmax()] == 9376
    assert late.max() == pytest.approx(0.9813, abs=6e-5)
    assert first.min() < 0.1


def test_what_has_no_periodic_wave_or_shock_is_named():
    ring, wave = Chain(CUBIC, 12, ends="periodic"), periodic_wave(CUBIC, period=12, height=0.1)
    double = Potential(r**2 / 2 - r**4 / 4, r)
    calls = {
        "give one of speed and height": lambda: periodic_wave(CUBIC, period=12),
        "no periodic wave of 12 sites": lambda: periodic_wave(CUBIC, period=12, speed=0.5),
        "stiffness -1 N/m of the spring at the mean": lambda: periodic_wave(
            CUBIC, period=12, height=0.1, mean=-1.0
        ),
        "needs a ring": lambda: wave.launch(Chain(CUBIC, 12)),
        "stretch 0.1 m of the ring must be 0 m": lambda: wave.launch(
            Chain(CUBIC, 12, ends="periodic", stretch=0.1)
        ),
        "has 1.08333 periods": lambda: wave.launch(Chain(CUBIC, 13, ends="periodic")),
        "differ from those of the wave": lambda: wave.launch(Chain(SOFT, 12, ends="periodic")),
        "direction 0 must be": lambda: wave.launch(ring, direction=0),
        "there is no step": lambda: shock(TODA, 0.1, 0.1),
        "sound is to become slower": lambda: shock(TODA, 0.5),
        "there is no trailing edge": lambda: shock(TODA, -1.4),
        "all the way": lambda: shock(double, -0.3, 0.4),
        "within the step must be above 0": lambda: shock(CUBIC, -0.8),
        "a shock: not for rings": lambda: shock(TODA, -0.5).launch(
            Chain(TODA, 9, ends="periodic"), at=3
        ),
        "differ from the shock's": lambda: shock(TODA, -0.5).launch(Chain(SOFT, 9), at=3),
        "is no expression": lambda: shock(PRISM, -0.02, -0.01).wave,
    }
    for words, call in calls.items():
        with pytest.raises(TensegrityError) as said:
            call()
        assert words in str(said.value), said.value
    with pytest.raises(ResolutionError, match="points in half a period"):
        periodic_wave(PowerLaw(1.0, 1.5, preload=1.0), period=12, height=8.0)


def test_a_long_period_has_the_solitary_wave_on_its_mean():
    alone = solitary_wave(CUBIC, amplitude=0.3)
    far = alone.shift / -60
    wave = periodic_wave(CUBIC, period=60, height=0.3, mean=abs(far))
    x = np.linspace(-8, 8, 33)
    assert np.abs(wave.elongation(x) - alone.elongation(x)).max() < 1e-6
