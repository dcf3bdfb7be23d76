"""Pulses of a run where the answer is known: exact waves, closed forms, linear chains."""

import math
from importlib import import_module
from itertools import cycle

import numpy as np
import pytest
import sympy as sp

from tensegrity import (
    Chain,
    Drive,
    Force,
    Network,
    Potential,
    PowerLaw,
    Prism,
    Record,
    State,
    TensegrityError,
    arrival,
    phase_shift,
    pulses,
    simulate,
    solitary_wave,
)
from tensegrity.springs.polynomial import Polynomial

R = sp.Symbol("r")
TODA = Potential(sp.exp(-R) + R - 1, R)
PRISM = Prism(1.0, 0.7, 0.01, 1.0).potential()
LINEAR = Potential(R**2 / 2, R)
WAVES = {
    "Toda, hardly faster than sound": (TODA, {"speed_ratio": 1.01}),
    "Toda": (TODA, {"speed_ratio": 3.0}),
    "prism, hardly faster than sound": (PRISM, {"speed_ratio": 1.01}),
    "prism": (PRISM, {"speed_ratio": 2.0}),
    "prism, rarefaction": (PRISM, {"amplitude": 0.12}),
    "prism, close to locking": (Prism(1.0, 0.6, 0.001, 1.0).potential(), {"speed_ratio": 12.16}),
    "softening prism, rarefaction": (
        Prism(1.0, 0.5, 0.4, 1.0, 2.0, 20.0).potential(preload=0.05),
        {"speed_ratio": 1.04},
    ),
    "power law": (PowerLaw(1.0, 1.5), {"amplitude": -0.1}),
    "cubic power law": (PowerLaw(1.0, 3.0), {"amplitude": -0.3}),
}


def still(chain, state, time=1e-9):
    """A run whose first row is a state."""
    return simulate(chain, state, time, dt=time, record=Record(every=1))


def toda(kappa, place, sites, other=None):
    """Displacements and velocities of one soliton of Toda's lattice, or two, by its tau function.

    q_n = log(tau_(n-1)/tau_n) obeys q'' = exp(q_(n-1) - q_n) - exp(q_n - q_(n+1)) where
    (log tau_n)'' = tau_(n+1) tau_(n-1)/tau_n^2 - 1; tau_n belongs to bond n.
    """
    bonds = np.arange(-1, sites) + 0.5
    logs, rates = [0 * bonds, 2 * kappa * (bonds - place)], [0.0, -2 * math.sinh(kappa)]
    if other:
        kappa_2, place_2, direction = other
        logs.append(2 * kappa_2 * (bonds - place_2))
        logs.append(logs[1] + logs[2] + math.log(coupling(kappa, kappa_2, direction)))
        rates.append(-2 * direction * math.sinh(kappa_2))
        rates.append(rates[1] + rates[2])
    log_tau = np.logaddexp.reduce(logs)
    rate = np.array(rates) @ np.exp(np.array(logs) - log_tau)
    return State(-np.diff(log_tau), -np.diff(rate))


def coupling(kappa, kappa_2, direction):
    """Factor A of tau = 1 + e1 + e2 + A e1 e2, by Hirota: minus the quotient of the dispersion
    relation w^2 - sinh^2 k at the difference and at the sum of both exponents."""
    w, w_2 = math.sinh(kappa), direction * math.sinh(kappa_2)
    return -((w - w_2) ** 2 - math.sinh(kappa - kappa_2) ** 2) / (
        (w + w_2) ** 2 - math.sinh(kappa + kappa_2) ** 2
    )


# one wave


@pytest.mark.parametrize(("name", "direction"), [*zip(WAVES, cycle([1, -1]))])
def test_an_exact_wave_is_found_where_it_was_launched_and_after_a_run(name, direction):
    spring, given = WAVES[name]
    wave = solitary_wave(spring, 2.0, **given)
    half = math.ceil(wave.reach()) + 20
    chain = Chain(spring, 2 * half, 2.0)
    at = half + np.random.default_rng(len(name)).uniform(-5, 5)
    start, travel = wave.launch(chain, at, direction), 4.3
    run = simulate(chain, start, travel / wave.speed, dt=0.01 / wave.speed, method="rkn6")
    for row, place, close in ((0, at, 1e-7), (-1, at + direction * travel, 1e-6)):
        (pulse,) = pulses(run, row)
        assert pulse.place == pytest.approx(place, abs=close)
        assert pulse.amplitude == pytest.approx(wave.amplitude, rel=close)
        assert pulse.direction == direction
        assert pulse.energy == pytest.approx(wave.energy, rel=1e-7)
        assert pulse.momentum == pytest.approx(direction * wave.momentum, rel=1e-7)
        assert pulse.speed == pulse.wave.speed == pytest.approx(wave.speed, rel=close)


@pytest.mark.parametrize("kappa", [0.3, 1.0, 2.5])
def test_a_soliton_of_toda_has_the_amplitude_of_its_closed_form(kappa):
    """exp(-r) - 1 = sinh(k)^2 sech(k x)^2, speed sinh(k)/k."""
    sites = 2 * math.ceil(20 / kappa) + 20
    at = sites / 2 + 0.319
    run = still(Chain(TODA, sites), toda(kappa, at, sites))
    (pulse,) = pulses(run, 0)
    assert pulse.place == pytest.approx(at, abs=1e-7)
    assert pulse.amplitude == pytest.approx(-2 * math.log(math.cosh(kappa)), rel=1e-7)
    assert pulse.speed == pytest.approx(math.sinh(kappa) / kappa, rel=1e-7)


def test_a_wave_among_ripples_is_placed_as_well_as_they_are_small():
    wave, chain = solitary_wave(PRISM, speed_ratio=1.5), Chain(PRISM, 120)
    state, ripple = wave.launch(chain, 60.3), 1e-3 * np.random.default_rng(1).normal(size=120)
    state = State(state.u + wave.amplitude * ripple, state.v)
    (pulse,) = pulses(still(chain, state), 0)
    assert pulse.wave is not None
    assert pulse.place == pytest.approx(60.3, abs=3e-3)
    assert pulse.amplitude == pytest.approx(wave.amplitude, rel=5e-3)


# what no wave fits


@pytest.mark.parametrize(
    ("ratio", "place", "amplitude"), [(1.05, 1e-3, 3e-4), (1.5, 5e-3, 1e-2), (2.0, 1e-2, 2e-2)]
)
def test_where_no_wave_fits_the_shape_is_interpolated_to_what_the_docstring_says(
    ratio, place, amplitude
):
    """Every other spring is a polynomial, alike to 1e-8, so that no family is that of the chain."""
    wave = solitary_wave(PRISM, speed_ratio=ratio)
    half = math.ceil(wave.reach()) + 3
    alike = Polynomial(PRISM, 1.02 * wave.amplitude, -wave.amplitude, 1e-8)
    mixed = Chain(([PRISM, alike] * half)[:-1], 2 * half)
    for shift in np.linspace(0, 1, 7):
        start = wave.launch(Chain(PRISM, 2 * half), half + shift)
        (pulse,) = pulses(still(mixed, start), 0)
        assert pulse.wave is None
        assert pulse.direction == 1
        assert pulse.place == pytest.approx(half + shift, abs=place)
        assert pulse.amplitude == pytest.approx(wave.amplitude, rel=amplitude)
        assert pulse.speed == pytest.approx(wave.speed, rel=1e-6)


@pytest.mark.parametrize("moving", [0, 1, -1])
def test_a_long_hump_of_a_linear_chain_is_no_solitary_wave_but_has_place_and_height(moving):
    x = np.arange(200) - 100.3
    state = State(np.array([-3e-3 * math.erf(z / 8) for z in x]),
                  moving * 6e-3 / 8 / math.sqrt(math.pi) * np.exp(-((x / 8) ** 2)))  # fmt: skip
    (pulse,) = pulses(still(Chain(LINEAR, 200), state), 0)
    assert pulse.wave is None
    assert pulse.direction == moving
    assert pulse.place == pytest.approx(100.3, abs=1e-2)
    highest = 3e-3 * 2 * math.erf(1 / 16)
    assert pulse.amplitude == pytest.approx(-highest, rel=1e-3)
    assert pulse.speed == pytest.approx(abs(moving), rel=1e-2)


def test_a_wave_scaled_by_a_fifth_is_no_exact_wave():
    wave, chain = solitary_wave(PRISM, speed_ratio=1.3), Chain(PRISM, 200)
    state = wave.launch(chain, 100.25)
    (pulse,) = pulses(still(chain, State(1.2 * state.u, 1.2 * state.v)), 0)
    assert pulse.wave is None
    assert pulse.place == pytest.approx(100.25, abs=0.02)


# speeds of what no wave fits

STRUCK = {  # springs of several scales in SI, and speeds of two struck sites
    "prism": (PRISM, 1.0, 2e-3),
    "prism, a wave among ripples": (PRISM, 1.0, 0.02),
    "beads": (PowerLaw(3e9, 1.5, preload=20.0), 4e-3, 0.02),
    "films": (Potential(1e-3 * R**2 / 2 + 30 * R**4, R), 1e-9, 1e-3),
    "softening": (Potential(R**2 / 2 - 0.3 * R**4, R), 1.0, 0.05),
    "sonic vacuum": (PowerLaw(1e8, 1.5), 1e-3, 0.1),
}


def peaks_that_moved(spring, mass, struck, sites=240):
    """Pulses of struck sites, where they ought to be a little later, and where a peak is then."""
    chain = Chain(spring, sites, mass)
    speed = spring.sound_speed(mass) or (1e8 / 1e-3) ** 0.4 * struck**0.2
    times = [0.39 * sites / speed, (0.39 * sites + 1) / speed]
    start = chain.at_rest({0: struck, sites // 2: -struck / 2})
    run = simulate(chain, start, times[1], tol=1e-8, record=Record(times=times))
    before, after = (pulses(run, row, fraction=0.03) for row in (0, 1))
    moved = [pulse for pulse in before if pulse.speed]
    there = [pulse.place + pulse.direction * pulse.speed / speed for pulse in moved]
    near = [min((x.place for x in after), key=lambda x, at=at: abs(x - at)) for at in there]
    return before, moved, np.array(there), np.array(near), speed


@pytest.mark.parametrize("name", STRUCK)
def test_a_speed_that_is_given_is_that_at_which_the_peak_moves(name):
    """Ripples move at less than the speed of sound; what changes too fast has no speed."""
    before, moved, there, near, sound = peaks_that_moved(*STRUCK[name])
    speeds = np.array([pulse.speed for pulse in moved])
    assert np.abs(there - near).max() < 6e-3 * (speeds / sound).max()
    if name == "sonic vacuum":
        assert len(moved) >= 2
        return
    assert len(moved) > 12
    assert len(moved) < len(before)
    assert (speeds[[pulse.wave is None for pulse in moved]] < 1.001 * sound).all()
    assert all((pulse.speed == 0) == (pulse.direction == 0) for pulse in before)


def test_ripples_are_not_compared_with_waves_that_they_cannot_be(monkeypatch):
    """A wave is only solved for where a pulse moves at the speed of its form."""
    tried = []

    def counted(*given, **options):
        tried.append(options)
        return solitary_wave(*given, **options)

    measure = import_module("tensegrity.measure.pulses")
    monkeypatch.setattr(measure, "solitary_wave", counted)
    measure._found.cache_clear()  # of the test above
    assert len(peaks_that_moved(*STRUCK["prism, a wave among ripples"])[0]) > 60
    assert 2 <= len(tried) <= 6  # at two instants; 16 and more at each before


def test_a_chain_with_a_drive_or_a_force_of_time_has_speeds_where_nothing_of_these_is_felt():
    times = [40.0, 41.0]
    for given in ({"drive": {0: Drive(force=0.02 * sp.sin(sp.Symbol("t")))}},
                  {"ground": Potential(0.04 * R**2, R)},
                  {"forces": [Force(0.02 * sp.sin(sp.Symbol("t")), at=[0])]}):  # fmt: skip
        chain = Chain(LINEAR, 90, **given)
        start = chain.at_rest({0: 0.01})
        run = simulate(chain, start, 41.0, tol=1e-8, record=Record(times=times))
        found, later = pulses(run, 0), [pulse.place for pulse in pulses(run, 1)]
        moved = [pulse for pulse in found if pulse.speed]
        assert all(pulse.place > 8 for pulse in moved)
        for pulse in (x for x in moved if x.place > 24):
            gaps = np.abs(np.array(later) - pulse.place - pulse.speed)
            assert gaps.min() < 0.03  # places of ripples of four sites are not known better
        assert bool(moved) == ("forces" not in given)


# several, none, and what is cut


def test_energies_of_pulses_far_from_each_other_add_up_to_that_of_the_run():
    fast, slow = (solitary_wave(PRISM, speed_ratio=ratio) for ratio in (1.5, 1.2))
    pulled, chain = solitary_wave(PRISM, amplitude=0.12), Chain(PRISM, 400)
    start = (slow.launch(chain, 60.4, -1) + fast.launch(chain, 320.2)
             + pulled.launch(chain, 190.7))  # fmt: skip
    run = simulate(chain, start, 20.0, tol=1e-9)
    found = pulses(run)
    assert [pulse.direction for pulse in found] == [-1, 1, 1]
    assert [pulse.amplitude > 0 for pulse in found] == [False, True, False]
    assert sum(pulse.energy for pulse in found) == pytest.approx(run.energy[-1], rel=1e-8)
    for pulse, wave in zip(found, (slow, pulled, fast), strict=True):
        assert pulse.energy == pytest.approx(wave.energy, rel=1e-7)


def test_pulses_count_from_the_stated_fraction_of_the_largest():
    fast, slow = (solitary_wave(PRISM, speed_ratio=ratio) for ratio in (1.5, 1.2))
    chain = Chain(PRISM, 300)
    run = still(chain, slow.launch(chain, 60.5) + fast.launch(chain, 220.5))
    part = slow.amplitude / fast.amplitude
    assert len(pulses(run, 0, 0.99 * part)) == 2
    assert len(pulses(run, 0, 1.01 * part)) == 1


def test_waves_that_overlap_are_cut_at_the_least_elongation_between_them():
    """Each site counts once, what is at the cuts included."""
    fast, slow = (solitary_wave(PRISM, speed_ratio=ratio) for ratio in (1.5, 1.2))
    chain = Chain(PRISM, 80)
    state = slow.launch(chain, at=40.5) + fast.launch(chain, at=44.5)
    run, r = still(chain, state), np.abs(chain.elongation(state.u))
    second, first = pulses(run, 0)
    least = 40 + int(np.argmin(r[40:45]))
    assert r[least] > 0.01 * r.max()  # or the cut would not matter
    assert (second.last, first.first) == (least, least + 1)
    each = chain.site_energy(state)
    for pulse in (first, second):
        inside = slice(pulse.first, pulse.last + 1)
        assert pulse.energy == pytest.approx(each[inside].sum(), rel=1e-12)
        assert pulse.momentum == pytest.approx((chain.mass * state.v)[inside].sum(), rel=1e-12)
    assert first.energy + second.energy == pytest.approx(chain.energy(state), rel=1e-9)
    together = slow.launch(chain, at=40.5) + fast.launch(chain, at=41.5)
    assert len(pulses(still(chain, together), 0)) == 1


def test_waves_that_meet_have_no_direction():
    wave, chain = solitary_wave(PRISM, speed_ratio=1.3), Chain(PRISM, 101)
    both = wave.launch(chain, 35.0) + wave.launch(chain, 65.0, direction=-1)
    run = simulate(chain, both, 14.5 / wave.speed, dt=0.01 / wave.speed)
    (pulse,) = pulses(run)
    assert (pulse.direction, pulse.speed, pulse.wave) == (0, 0.0, None)


def test_a_chain_without_deformation_has_no_pulse():
    chain = Chain(PRISM, 20)
    assert pulses(still(chain, chain.at_rest()), 0) == []
    noise = 1e-16 * np.random.default_rng(1).normal(size=20)
    assert pulses(still(chain, State(1.0 + noise, np.zeros(20))), 0) == []


@pytest.mark.parametrize(("ends", "sign"), [("fixed", -1), ("free", 1)])
def test_what_an_end_returns_goes_the_other_way(ends, sign):
    """A fixed end returns compression as compression, a free one as rarefaction."""
    wave, chain = solitary_wave(PRISM, speed_ratio=1.3), Chain(PRISM, 120, ends=("free", ends))
    run = simulate(chain, wave.launch(chain, 60.3), 110 / wave.speed, dt=0.02 / wave.speed)
    largest = max(pulses(run), key=lambda pulse: pulse.energy)
    assert largest.direction == -1
    assert largest.amplitude * sign > 0
    assert (largest.wave is not None) == (ends == "fixed")


def test_a_pulse_at_an_end_of_the_chain_has_no_wave():
    chain = Chain(PRISM, 40)
    run = simulate(chain, chain.at_rest({0: 0.02}), 0.5, tol=1e-8)
    (pulse,) = pulses(run)
    assert (pulse.first, pulse.place, pulse.wave) == (0, 0.5, None)
    assert pulse.energy == pytest.approx(run.energy[-1], rel=1e-2)


# arrivals


@pytest.fixture(scope="module")
def crossing():
    """Two equal waves head-on, recorded densely, and how far each is shifted."""
    wave, chain = solitary_wave(PRISM, speed_ratio=2.0), Chain(PRISM, 121)
    start = wave.launch(chain, 30.5) + wave.launch(chain, 85.5, direction=-1)
    run = simulate(chain, start, 50 / wave.speed, dt=0.01 / wave.speed, method="rkn6",
                   record=Record(every=4))  # fmt: skip
    return wave, run, phase_shift(run, wave, wave)


def test_an_arrival_is_that_of_the_wave_in_the_direction_given(crossing):
    """Bond 70 is passed by the left-going wave, then by the other one, ahead by its shift."""
    wave, run, shifts = crossing
    returned = (85.5 - 70.5) / wave.speed
    assert arrival(run, 70, -1) == arrival(run, 70) == pytest.approx(returned, rel=1e-6)
    came = (70.5 - 30.5 - shifts[0]) / wave.speed
    assert arrival(run, 70, 1) == pytest.approx(came, rel=1e-5)
    assert arrival(run, 70, after=2 * returned) == pytest.approx(arrival(run, 70, 1), rel=1e-12)


def test_an_arrival_that_is_not_there_is_an_error(crossing):
    wave, run, _ = crossing
    with pytest.raises(TensegrityError, match="no peak passes"):
        arrival(run, 70, -1, after=20 / wave.speed)
    with pytest.raises(TensegrityError, match="no recorded instant lies after 1e"):
        arrival(run, 70, after=1e9)
    with pytest.raises(TensegrityError, match="direction 0 must be 1 or -1"):
        arrival(run, 70, 0)


# collisions


@pytest.mark.parametrize(
    ("kappas", "direction"), [((1.0, 0.7), -1), ((1.2, 1.2), -1), ((2.2, 0.8), 1)],
    ids=["head-on", "equal", "overtaking"],
)  # fmt: skip
def test_phase_shifts_of_toda_are_those_of_the_closed_form(kappas, direction):
    """Far behind wave 2 tau is 1 + e1, far ahead of it e2 (1 + A e1): -log(A)/(2 k1) sites on."""
    places, sites = (60.3, 110.8), 420
    waves = [solitary_wave(TODA, speed_ratio=math.sinh(k) / k) for k in kappas]
    log = math.log(coupling(*kappas, direction))
    form = math.cosh if direction < 0 else math.sinh
    total, gap = sum(kappas) / 2, (kappas[0] - kappas[1]) / 2
    assert log == pytest.approx(2 * math.log(form(gap) / form(total)), rel=1e-9)
    # the peak of wave 2 is where A e2 = 1 while wave 1 is behind it, and where e2 = 1 after it
    state = toda(kappas[0], places[0], sites, (kappas[1], places[1], direction))
    closing = waves[0].speed - direction * waves[1].speed
    chain, time = Chain(TODA, sites), 110 / closing
    run = simulate(chain, state, time, dt=0.01, method="rkn6", record=Record(every=10**6))
    exact = toda(kappas[0], places[0] + waves[0].speed * time, sites,
                 (kappas[1], places[1] + direction * waves[1].speed * time, direction))  # fmt: skip
    assert np.abs(run.final.u - exact.u).max() < 1e-9  # the tau function does solve the chain
    shifts = phase_shift(run, *waves)
    assert shifts[0] == pytest.approx(-log / (2 * kappas[0]), abs=1e-6)
    assert shifts[1] == pytest.approx(direction * log / (2 * kappas[1]), abs=1e-6)


def test_a_collision_that_the_run_does_not_show_is_an_error(crossing):
    wave, run, _ = crossing
    chain, other = run.scene, solitary_wave(PRISM, speed_ratio=1.5)
    with pytest.raises(TensegrityError, match="is not the left wave, of amplitude"):
        phase_shift(run, other, wave)
    away = wave.launch(chain, 30.5, direction=-1) + wave.launch(chain, 85.5)
    with pytest.raises(TensegrityError, match="the waves meet inf s after the first row"):
        phase_shift(still(chain, away), wave, wave)
    with pytest.raises(TensegrityError, match="1 pulses in the first row"):
        phase_shift(still(chain, wave.launch(chain, 60.0)), wave, wave)
    short = simulate(chain, State(run.u[0], run.v[0]), 27.6 / wave.speed, dt=0.01 / wave.speed)
    with pytest.raises(TensegrityError, match="no wave of the last row continues the one at 30"):
        phase_shift(short, wave, wave)


# what is refused


def test_only_runs_of_whole_chains_have_pulses():
    network = Network([[0.0, 0.0], [1.0, 0.0]], [(0, 1)], LINEAR)
    with pytest.raises(TensegrityError, match="scene of the run is Network, must be a Chain"):
        pulses(simulate(network, network.at_rest(), 1.0))
    changes = Chain(PRISM.over_time(prestrain=0.01 + 0.001 * sp.Symbol("t")), 10)
    with pytest.raises(TensegrityError, match="the springs change in time"):
        pulses(simulate(changes, changes.at_rest(), 1.0, dt=0.1))
    chain = Chain(PRISM, 10)
    with pytest.raises(TensegrityError, match="2 of 10 sites recorded"):
        pulses(simulate(chain, chain.at_rest(), 1.0, record=Record(every=1, sites=[0, 1])))
    run = still(chain, chain.at_rest())
    for row in (2, -3):
        with pytest.raises(TensegrityError, match=f"row {row} must be"):
            pulses(run, row)
