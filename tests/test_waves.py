"""Waves against outside references: Toda's soliton, the Fermi-Pasta-Ulam-Tsingou recurrence."""

import numpy as np
import pytest
import sympy as sp
from springs import series

from tensegrity import (
    Chain,
    Potential,
    PowerLaw,
    Prism,
    Record,
    State,
    TensegrityError,
    predict,
    sech2,
    simulate,
    solitary_wave,
    speed,
    tent,
    width,
)
from tensegrity.measure.observables import peak

R = sp.Symbol("r")
TODA = Potential(sp.exp(-R) + R - 1, R, length=1.0)


def toda_soliton(kappa, chain, at, t=0.0):
    """M. Toda (1967): exp(-r_j) - 1 = sinh^2 kappa sech^2(kappa (j - at) - t sinh kappa)."""

    def log_cosh(x):
        return np.logaddexp(x, -x) - np.log(2)

    j = np.arange(chain.sites)
    phase = kappa * (j - at) - t * np.sinh(kappa)
    # u_j = log(cosh(phase_j)/cosh(phase_j - kappa)) satisfies it, up to a constant
    u = log_cosh(phase - kappa) - log_cosh(phase)
    v = -np.sinh(kappa) * (np.tanh(phase - kappa) - np.tanh(phase))
    return State(u, v)


def test_toda_soliton_keeps_its_shape_over_500_sites():
    kappa, chain = 0.8, Chain(TODA, 640)
    travelled = 500 * kappa / np.sinh(kappa)
    run = simulate(chain, toda_soliton(kappa, chain, 60), travelled, method="rkn6", dt=0.05,
                   record=Record(every=20))  # fmt: skip
    exact = toda_soliton(kappa, chain, 60, travelled)
    assert np.max(np.abs(run.final.u - exact.u)) < 1e-10
    assert np.max(np.abs(run.final.v - exact.v)) < 1e-10
    assert run.energy_error < 1e-12


def test_measured_speed_of_a_toda_soliton():
    kappa, chain = 0.8, Chain(TODA, 200)
    run = simulate(chain, toda_soliton(kappa, chain, 40), 80.0, method="rkn6", dt=0.05,
                   record=Record(every=1))  # fmt: skip
    measured = speed(run, (60, 110))
    assert measured == pytest.approx(np.sinh(kappa) / kappa, rel=1e-6)
    place, height = peak(chain.elongation(run.final.u))
    assert place == pytest.approx(40 - 0.5 + 80 * np.sinh(kappa) / kappa, abs=0.6)
    assert height == pytest.approx(-np.log(1 + np.sinh(kappa) ** 2), rel=0.02)


def test_sech2_approaches_toda_with_the_fourth_power_of_gamma():
    kappas = np.array([0.05, 0.1, 0.2])
    errors = []
    x = np.linspace(-40, 40, 2001)
    for kappa in kappas:
        exact = -np.log1p((np.sinh(kappa) / np.cosh(kappa * x)) ** 2)
        errors.append(np.max(np.abs(sech2(TODA, np.sinh(kappa) / kappa, x) - exact)))
    assert abs(np.polyfit(np.log(kappas), np.log(errors), 1)[0] - 4) < 0.1


CUBIC = Potential(R**2 / 2 + R**3 / 3 - R**4 / 4, R)
EVEN = Potential(R**2 / 2 + R**4 / 4, R)
TERMS = [  # kappa; tolerance; errors over the peak by another program, at fewer places
    (Prism(1, 0.7, 0.1, 1).potential(), (0.4, 0.2, 0.1), 5e-4,
     [(3.5055e-2, 8.8385e-3, 2.2145e-3), (1.7067e-3, 1.0892e-4, 6.8457e-6), ()]),
    (Prism(1, 0.7, 0.3, 1).potential(), (0.8, 0.4, 0.2), 5e-4,
     [(9.590e-2, 2.401e-2, 6.006e-3), (9.424e-3, 5.941e-4, 3.726e-5), ()]),
    (CUBIC, (0.8, 0.4, 0.2), 0.06,
     [(9.2e-2, 2.2e-2, 5.6e-3), (1.2e-2, 6.8e-4, 4.2e-5), (2.0e-3, 2.9e-5, 4.5e-7)]),
    (PowerLaw(1.0, 1.5, preload=1.0), (0.8, 0.4, 0.2), 0.06,
     [(6.7e-2, 1.7e-2, 4.4e-3), (1.8e-3, 1.2e-4, 7.7e-6), (2.9e-4, 5.2e-6, 8.5e-8)]),
    (EVEN, (0.8, 0.4, 0.2), 0.06, [(4.3e-2, 1.1e-2, 2.9e-3), (4.5e-3, 3.1e-4, 2.0e-5)]),
]  # fmt: skip


@pytest.mark.parametrize(("spring", "kappas", "near", "known"), TERMS)
def test_terms_of_small_waves_have_orders_2_4_6_and_their_constants(spring, kappas, near, known):
    family, errors = predict(spring).families[0], [[] for _ in known]
    for kappa in kappas:
        excess, x = 2 * np.sinh(kappa / 2) / kappa - 1, np.linspace(0, 20 / kappa, 801)
        wave = solitary_wave(spring, excess=excess, family=family.name)
        for order, so_far in enumerate(errors, 1):
            found = family.small(x, excess, order)
            so_far.append(np.abs(found - wave.elongation(x)).max() / abs(wave.amplitude))
    for order, (found, wanted) in enumerate(zip(errors, known, strict=True), 1):
        assert found == pytest.approx(wanted or found, rel=near)
        slope = np.log(found[-2] / found[-1]) / np.log(2)
        assert slope == pytest.approx(2 * order, abs=0.06)
    for order, constant in enumerate(family.small_errors, 1):  # its error is of the next order
        limit = errors[order - 1][-1] / kappas[-1] ** (2 * order)
        assert limit == pytest.approx(constant, rel=2 * kappas[-1] ** 2)
    assert len(family.small_errors) == (1 if spring is EVEN else 3)


def test_an_even_spring_has_small_waves_of_both_signs_and_two_terms():
    both = predict(EVEN)
    one, other = (both[name].small([0.0, 1.0], 0.01, 2) for name in ("compression", "rarefaction"))
    assert (one == -other).all()
    assert sech2(EVEN, 1.01, [0.0, 1.0], 2) == pytest.approx(one, rel=1e-12)
    assert one[0] < 0
    odd = Potential(R**2 / 2 + R**4 / 4 + R**5 / 5, R)
    assert sech2(odd, 1.01, 0.0) == pytest.approx(sech2(EVEN, 1.01, 0.0), rel=1e-9)
    for spring, order in ((EVEN, 3), (odd, 2)):
        with pytest.raises(TensegrityError, match=f"no term of order {order}"):
            sech2(spring, 1.01, 0.0, order)
    threshold = predict(Prism(1.0, 0.7, 0.01, 1.0).potential())["rarefaction"]
    for asked in (lambda: threshold.small(0.0, 0.1), lambda: threshold.small_errors):
        with pytest.raises(TensegrityError, match="no small wave: rarefaction starts at a thres"):
            asked()


def test_asymptotics_refuse_what_has_no_such_wave():
    with pytest.raises(TensegrityError, match="speed_ratio"):
        sech2(TODA, 1.0, 0.0)
    with pytest.raises(TensegrityError, match="V''"):
        sech2(Prism(1, 0.8, 0.0, 1).potential(), 1.1, 0.0)
    with pytest.raises(TensegrityError, match="locking stroke"):
        tent(TODA, 0.0)


def test_tent_spans_two_sites_and_reaches_the_locking_stroke():
    spring = Prism(1, 0.7, 0.01, 1).potential()
    x = np.linspace(-2, 2, 4001)
    profile = tent(spring, x)
    assert profile.min() == spring.domain[0]
    assert width(x, profile, 0.05) == pytest.approx(1.9, abs=1e-9)


def test_width_needs_a_pulse_that_ends():
    with pytest.raises(TensegrityError, match="both sides"):
        width(np.arange(5.0), np.arange(5.0))


def test_sound_speed_of_a_linear_chain_is_that_of_long_waves():
    chain = Chain(series(k=3.0), 400)
    assert chain.springs[0].sound_speed(mass=0.75) == pytest.approx(2.0)


MASSES = 32  # between two fixed sites, as in the report of 1955


def fput_beta(beta, t_end):
    """Start in mode 1 with unit amplitude, V = r^2/2 + beta r^4/4.

    Returns the run, the instants and the share of the energy in mode 1, as its largest value
    within half a period around each instant (it oscillates with the mode).
    """
    chain = Chain(series(0, beta / 4), MASSES + 2, ends=("fixed", "fixed"))
    shape = np.sin(np.pi * np.arange(MASSES + 2) / (MASSES + 1))
    shape[[0, -1]] = 0
    start = State(shape, np.zeros_like(shape))
    run = simulate(chain, start, t_end, method="rkn6", dt=0.4, record=Record(every=5))
    omega = 2 * np.sin(np.pi / (2 * (MASSES + 1)))
    mode = np.sqrt(2 / (MASSES + 1)) * shape
    energy = 0.5 * ((run.v @ mode) ** 2 + omega**2 * (run.u @ mode) ** 2)
    half = int(np.pi / omega / (run.t[1] - run.t[0]))
    share = np.lib.stride_tricks.sliding_window_view(energy / energy[0], half).max(axis=1)
    return run, run.t[half // 2 :][: len(share)], share


def recurrence(beta, t_end):
    """Instant and share of the first return to mode 1, and the least share before it."""
    run, t, share = fput_beta(beta, t_end)
    assert run.energy_error < 1e-9
    half = len(share) // 2
    low = int(np.argmin(share[:half]))
    back = low + int(np.argmax(share[low : 3 * low]))
    return run.energy[0], t[back], share[back], share[low]


@pytest.mark.parametrize("beta", [0.05, 0.1, 0.3])
def test_fput_beta_recurrence_time_of_the_weakly_nonlinear_chain(beta):
    """S. D. Pace, K. A. Reiss, D. K. Campbell, Chaos 29, 113107 (2019): t_r/(N + 1)^3 depends on
    S = E beta (N + 1) only and starts linearly.

    Modes 1 and 3 beat at Omega_3 - 3 Omega_1; with the shifts of both frequencies by mode 1,
    9/8 and 3/2 of beta E/(N + 1), it is (2/pi^2)/(1 - 9 S/(8 pi^2)).
    """
    energy, t, share, _ = recurrence(beta, 11_000.0)
    s = energy * beta * (MASSES + 1)
    expected = 2 / np.pi**2 / (1 - 9 * s / (8 * np.pi**2))
    assert t / (MASSES + 1) ** 3 == pytest.approx(expected, rel=0.02)
    assert share > 0.999


def test_fput_beta_recurs_after_giving_half_its_energy_away():
    """At beta = 3 mode 1 keeps less than half of its energy and gets back all but 3 %."""
    _, t, share, least = recurrence(3.0, 20_000.0)
    assert least < 0.5
    assert share > 0.97
    assert 8_000 < t < 10_000
