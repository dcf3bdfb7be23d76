"""Waves of the potentials of the literature, from next to the sound speed to 20 times it."""

import math

import mpmath
import numpy as np
import pytest
import sympy as sp
from springs import lennard_jones, series

from tensegrity import Potential, PowerLaw, Prism, TensegrityError, solitary_wave
from tensegrity.waves.nonlinear_part import nonlinear_part

R, A = sp.symbols("r a")
WALL = (-1.0, math.inf)
LENNARD_JONES = lennard_jones(12, 6)
SIX_THREE = lennard_jones(6, 3)
MORSE = (1 - sp.exp(A * R)) ** 2 / 2
TODA = Potential(sp.exp(-R) + R - 1, R)
RIGID = Prism(1.0, 0.7, 0.01, 1.0).potential()
# spring, families with the ratio up to which they are asked for
CLASSICAL = {
    "Toda": (TODA, {"compression": 20}),
    "Lennard-Jones 12-6": (LENNARD_JONES, {"compression": 20}),
    "Lennard-Jones 6-3": (SIX_THREE, {"compression": 20}),
    "Morse": (Potential(MORSE, R, {A: -1.0}), {"compression": 20}),
    "Morse mirrored": (Potential(MORSE, R, {A: 1.0}), {"rarefaction": 20}),
    "FPUT alpha": (series(1 / 3), {"rarefaction": 20}),
    "FPUT beta": (series(0, 1 / 4), {"compression": 20, "rarefaction": 20}),
    "FPUT alpha-beta": (series(1 / 3, 1 / 4), {"rarefaction": 20}),
    "cosh": (Potential(sp.cosh(R) - 1, R), {"compression": 20, "rarefaction": 20}),
    "Coulomb": (Potential(1 / (1 + R) - 1 + R, R, domain=WALL), {"compression": 20}),
    "precompressed Hertz": (PowerLaw(1.0, 1.5, preload=1.0), {"compression": 20}),
    "precompressed cubic": (PowerLaw(2.0, 3.0, preload=0.3), {"compression": 20}),
    "rigid prism": (RIGID, {"compression": 5}),
    "elastic prism": (
        Prism(1.0, 0.5, 0.4, 1.0, 2.0, 20.0).potential(preload=0.05),
        {"rarefaction": 1.3},
    ),
    "softening": (series(1 / 3, -1 / 4), {"rarefaction": 1.1}),
}
CASES = [(name, family) for name, (_, families) in CLASSICAL.items() for family in families]
RATIOS = [1.0001, 1.001, 1.01, 1.1, 1.3, 2.0, 5.0, 20.0]


def misfit(wave):
    """Largest |m c^2 r - V'(r) * tent| over the largest |V'|, the integral by Gauss's rule: no
    Fourier series, no transform, none of the solver's functions."""
    nodes, weights = np.polynomial.legendre.leggauss(16)
    near = np.array([0.0, 0.001, 0.003, 0.01, 0.03, 0.1, 0.3])
    near = np.concatenate([near, 1 - near, 1 + near])  # at a wall peak and feet are sharp
    x, force = np.linspace(0, wave.reach(1e-6), 9), []
    for at in x:
        edges = np.unique(np.clip([-1, 0, 1, *(near - at), *(-near - at)], -1, 1))
        half = np.diff(edges)[:, None] / 2
        s = edges[:-1, None] + half * (nodes + 1)
        tension = wave.potential.tension(wave.elongation(at + s))
        force.append(np.sum(tension * (1 - np.abs(s)) * half * weights))
    left = wave.mass * wave.speed**2 * wave.elongation(x)
    return np.max(np.abs(left - force)) / np.max(np.abs(wave.potential.tension(wave.amplitude)))


@pytest.mark.parametrize(("name", "family"), CASES)
def test_a_classical_potential_has_waves_from_next_to_sound_to_20_times_sound(name, family):
    spring, families = CLASSICAL[name]
    sizes = []
    for ratio in RATIOS:
        if ratio > families[family]:
            with pytest.raises(TensegrityError, match=r"(above|below) speed [\d.]+ sites/s"):
                solitary_wave(spring, speed_ratio=ratio, family=family)
            continue
        wave = solitary_wave(spring, speed_ratio=ratio, family=family)
        assert wave.residual <= 1e-12
        assert misfit(wave) < 3e-11
        assert wave.speed_ratio == pytest.approx(ratio, rel=1e-14)
        assert (wave.amplitude > 0) == (family == "rarefaction")
        sizes.append(abs(wave.amplitude))
    assert sizes == sorted(sizes)


@pytest.mark.parametrize("kappa", [1e-4, 1e-3, 1e-2, 0.1, 1.0, 4.5])
def test_toda_soliton_is_the_closed_form_down_to_1e9_above_sound(kappa):
    """M. Toda (1967): exp(-r) - 1 = sinh^2 kappa sech^2(kappa x), c = sinh(kappa)/kappa."""
    peak = -math.log1p(math.sinh(kappa) ** 2)
    wave = solitary_wave(TODA, amplitude=peak)
    x = np.linspace(0, 20 / kappa, 501)
    exact = -np.log1p((np.sinh(kappa) / np.cosh(kappa * x)) ** 2)
    assert np.abs(wave.elongation(x) - exact).max() < 1e-12 * -peak
    assert wave.speed == pytest.approx(math.sinh(kappa) / kappa, rel=1e-15)


@pytest.mark.parametrize("name", ["Toda", "Lennard-Jones 12-6", "Morse", "Coulomb", "rigid prism"])
def test_next_to_sound_the_peak_follows_the_second_order_of_the_expansion(name):
    """V''/V''' (6 e + (6/5 - 9 V'' V''''/V'''^2) e^2), e = c/cs - 1: what is left is of order 3."""
    spring, _ = CLASSICAL[name]
    h = 1e-4 * nonlinear_part(spring).scale
    k, slope = (float(f(0.0)) for f in (spring.stiffness, spring.stiffness_slope))
    curvature = float(spring.stiffness_slope(h) - spring.stiffness_slope(-h)) / (2 * h)
    left = []
    for e in (1e-3, 1e-4):
        wave = solitary_wave(spring, speed_ratio=1 + e)
        second = (6 / 5 - 9 * k * curvature / slope**2) * e
        left.append((wave.amplitude * slope / (k * e) - 6 - second) / e**2)
    assert left[1] == pytest.approx(left[0], rel=0.1)  # e^3 with one coefficient


@pytest.mark.parametrize(
    ("spring", "n"), [(LENNARD_JONES, 12), (SIX_THREE, 6)], ids=["12-6", "6-3"]
)
def test_fast_lennard_jones_waves_approach_the_wall_by_the_corrected_tent(spring, n):
    """The peak leaves s = (4 A/(m c^2 sigma^2))^(1/n), sigma = 1 - beta s, of the length,
    V ~ A y^-n at the wall; beta = -sqrt(pi) Gamma(-1/n)/(n Gamma(1/2 - 1/n))."""
    gamma = math.gamma
    beta = -math.sqrt(math.pi) * gamma(-1 / n) / (n * gamma(1 / 2 - 1 / n))
    errors = []
    for ratio in (40, 160):
        wave = solitary_wave(spring, speed_ratio=ratio)
        s = 1 + wave.amplitude
        errors.append(abs((4 / wave.speed**2 / (1 - beta * s) ** 2) ** (1 / n) / s - 1))
    assert errors[0] < 0.02
    assert 0.8 < math.log(errors[0] / errors[1], 4) < 1.3


def test_an_energy_measured_from_anywhere_gives_the_same_wave():
    settled = lennard_jones(12, 6, shift=1.0)
    waves = [solitary_wave(spring, speed_ratio=1.3) for spring in (LENNARD_JONES, settled)]
    assert waves[0].energy == pytest.approx(waves[1].energy, rel=1e-12)
    again = solitary_wave(LENNARD_JONES, energy=waves[0].energy)
    assert again.speed == pytest.approx(waves[0].speed, rel=1e-12)


@pytest.mark.parametrize("r", [-0.5, -0.03, -1e-3, -1e-9, 1e-12, 1e-5, 0.02])
def test_excesses_keep_their_digits_however_small_the_elongation(r):
    of = nonlinear_part(LENNARD_JONES)
    with mpmath.workdps(60):
        x = mpmath.mpf(r)
        exact = [
            156 * (1 + x) ** -14 - 84 * (1 + x) ** -8 - 72,
            -12 * (1 + x) ** -13 + 12 * (1 + x) ** -7 - 72 * x,
            (1 + x) ** -12 - 2 * (1 + x) ** -6 + 1 - 36 * x**2,
        ]
        exact = [float(value) for value in exact]
    found = [float(f(r)) for f in (of.stiffness, of.tension, of.energy)]
    np.testing.assert_allclose(found, exact, rtol=1e-14)


def test_a_jump_of_the_stiffness_is_not_taken_for_a_polynomial():
    """A linear contact: V''' is 0 on both sides of where it opens."""
    spring = PowerLaw(2.0, 1.0, preload=1.0)
    of = nonlinear_part(spring)
    r = np.array([-0.7, -0.1, 0.3, 0.6, 0.9])
    np.testing.assert_allclose(2 * r + of.tension(r), spring.tension(r), rtol=1e-14)


@pytest.mark.parametrize(
    ("given", "words"),
    [
        ({"energy": 5e-9}, "below energy 0.0001974"),
        ({"energy": 1e-6}, "below energy 0.0001974"),
        ({"energy": 20.0}, "above energy"),
        ({"amplitude": 1e-3}, "below peak 0.0136"),
        ({"amplitude": 5e-324}, "peak 4.94066e-324 m must be at least"),
        ({"speed_ratio": 1 + 1e-9}, "below speed 0.5502"),
        ({"speed_ratio": 20.0}, "above speed 2.8689"),
    ],
)
def test_beyond_a_family_the_error_names_its_range(given, words):
    """Rarefactions of a stiffening prism start above a threshold: an energy of 1.966e-4 J."""
    with pytest.raises(TensegrityError, match=words):
        solitary_wave(RIGID, family="rarefaction", **given)


@pytest.mark.parametrize("exponent", [40.0, 100.0])
def test_contacts_as_hard_as_walls_carry_waves(exponent):
    """Scale invariance of speeds whose small forces underflow: c ~ a^((n - 1)/2)."""
    one, other = (solitary_wave(PowerLaw(1.0, exponent), amplitude=-a) for a in (1.0, 1.5))
    assert one.residual <= 1e-12
    assert other.speed / one.speed == pytest.approx(1.5 ** ((exponent - 1) / 2), rel=1e-12)


@pytest.mark.parametrize("preload", [1e-30, 10.0, 100.0, 1e9])
def test_a_precompressed_contact_has_one_wave_whatever_its_preload(preload):
    """... in overlaps under the preload: F^(2/3)."""
    one, other = (
        solitary_wave(PowerLaw(1.0, 1.5, preload=f), speed_ratio=1.1) for f in (1.0, preload)
    )
    assert other.amplitude == pytest.approx(one.amplitude * preload ** (2 / 3), rel=1e-12)
