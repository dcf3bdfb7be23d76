"""Waves of cells of several masses and springs, against numbers of another computation."""

import numpy as np
import pytest
import sympy as sp

from tensegrity import Chain, Potential, TensegrityError, genuine, simulate, solitary_wave

r = sp.Symbol("r")
SPRING = Potential(r**2 / 2 + r**3 / 3, r)


def linear(k):
    return Potential(k * r**2 / 2, r)


def dimer(light, **speed):
    return solitary_wave(SPRING, mass=[1, light], **(speed or {"speed_ratio": 1.05}))


@pytest.mark.parametrize(
    ("light", "k", "least", "phase"),
    [
        (0.2, 4.9689154364361, 5.84554e-06, -1.35653),
        (0.25, 4.4942752882501, 3.2709e-05, -1.28495),
        (0.3, 4.132538312724, 4.51915e-05, -1.20293),
        (0.9, 2.8804555375511, 0.00095835, 2.884),
    ],
)
def test_least_tails_of_dimers(light, k, least, phase):
    wave = dimer(light)
    assert wave.residual < 1e-13
    own = 2 * wave.resonances[0][0]
    assert own == pytest.approx(k, rel=1e-9)
    square = 1 + 1 / light + np.sqrt((1 + 1 / light) ** 2 - 4 / light * np.sin(own / 2) ** 2)
    assert np.sqrt(square) == pytest.approx(wave.speed / 2 * own, rel=1e-13)
    assert wave.tail * abs(wave.amplitude) == pytest.approx(least, rel=1e-4)
    assert wave.tail_phase == pytest.approx(phase, abs=2e-4)  # given to 3 or 5 decimals


@pytest.mark.parametrize(
    ("low", "high", "light"), [(0.3, 0.36, 0.326888637314), (0.14, 0.17, 0.154516966648)]
)
def test_genuine_waves_of_dimers(low, high, light):
    assert genuine(dimer, low, high, 2) == pytest.approx([light], rel=1e-10)


def test_a_mass_in_mass_is_genuine_where_its_resonance_does_not_stretch_the_chain():
    def hung(k):
        return solitary_wave(SPRING, inner={0: (0.3, linear(k))}, speed_ratio=1.1)

    speed = hung(2.0).speed
    closed = 4 * np.pi**2 * speed**2 * 0.3 / 1.3
    assert genuine(hung, 8.2, 8.8, 2) == pytest.approx([closed], rel=1e-11)
    assert genuine(hung, 0.9, 1.0, 2) == pytest.approx([0.9500487026], rel=1e-9)
    assert hung(closed).amplitude == pytest.approx(0.30821734642, rel=1e-10)


def test_equal_masses_as_a_cell_of_two_have_the_wave_of_the_chain():
    wave, chain = dimer(1.0), solitary_wave(SPRING, speed_ratio=1.05)
    assert wave.tail < 1e-16
    assert wave.speed == pytest.approx(chain.speed, rel=1e-14)
    assert wave.amplitude == pytest.approx(chain.amplitude, rel=1e-12)
    x = np.array([0.0, 1.3, -4.0])
    assert wave.elongation(x)[:, 1] == pytest.approx(chain.elongation(x), rel=1e-11)
    assert wave.rate(x)[:, 0] == pytest.approx(chain.rate(x), rel=1e-11)
    assert wave.energy == pytest.approx(chain.energy, rel=1e-11)


def test_a_launched_genuine_wave_is_unchanged():
    wave = dimer(0.326888637314)
    chain = Chain(SPRING, 300, mass=np.tile([1, 0.326888637314], 150))
    run = simulate(chain, wave.launch(chain, 90.0), 100 / wave.speed, method="rkn6", dt=0.02)
    there = wave.launch(chain, 190.0)
    assert np.abs(run.final.v - there.v).max() < 1e-6 * np.abs(there.v).max()


def test_precompressed_beads():
    law = Potential(r - 1 + sp.Rational(2, 5) * (1 - r) ** sp.Rational(5, 2) + sp.Rational(3, 5), r)
    made = lambda mu: solitary_wave(law, mass=[1, mu], speed_ratio=1.05)  # noqa: E731
    assert genuine(made, 0.33, 0.36, 2) == pytest.approx([0.344263183783], rel=1e-9)
    assert made(0.344263183783).amplitude == pytest.approx(-0.63981001, rel=1e-7)


@pytest.mark.parametrize(
    ("words", "given"),
    [
        ("mass 1 of 2 kg must equal mass 2 of 3 kg|without a mirror", {"mass": [1, 2, 3]}),
        ("2 springs and 3 masses form no cell", {"potential": [SPRING] * 2, "mass": [1, 2, 1]}),
        ("speed .* must be above", {"mass": [1, 2], "speed_ratio": 0.9}),
        ("by its speed", {"mass": [1, 2], "speed_ratio": None, "amplitude": 0.1}),
        ("site of inner 2 must be", {"inner": {2: (1.0, SPRING)}}),
        ("has 1 entries", {"inner": {0: (1.0,)}}),
    ],
)
def test_what_is_no_cell_with_a_wave_is_refused(words, given):
    with pytest.raises(TensegrityError, match=words):
        solitary_wave(**{"potential": SPRING, "speed_ratio": 1.05} | given)
