"""Spectra of runs: against sums of waves, and dispersion relations."""

from dataclasses import replace

import numpy as np
import pytest
import sympy as sp
from hypothesis import given
from hypothesis import strategies as st

from tensegrity import (
    Chain,
    Potential,
    Record,
    State,
    TensegrityError,
    dispersion,
    simulate,
    spectrum,
)

r = sp.Symbol("r")
LINEAR = Potential(r**2 / 2, r)
CHAIN = Chain(LINEAR, 16)
RUN = simulate(CHAIN, CHAIN.at_rest({0: 1.0}), 31.5, dt=0.1, record=Record(interval=0.5))


@given(st.integers(-6, 7), st.integers(2, 29), st.floats(0.1, 9.0), st.floats(0, 6))
def test_a_travelling_wave_of_amplitude_a_reads_a(wave, oscillation, amplitude, phase):
    q, w = 2 * np.pi * wave / 16, 2 * np.pi * oscillation / 32
    moving = amplitude * np.cos(q * np.arange(16) - w * RUN.t[:, None] + phase)
    found = spectrum(replace(RUN, u=moving, v=2 * moving))
    row, column = np.unravel_index(found.amplitude.argmax(), found.amplitude.shape)
    assert found.amplitude[row, column] == pytest.approx(amplitude, rel=1e-12)
    assert abs(found.wavenumbers[column] - q) < 1e-12
    assert abs(found.frequencies[row] - w) < 1e-12
    twice = spectrum(replace(RUN, u=moving, v=2 * moving), of="v")
    np.testing.assert_allclose(twice.amplitude, 2 * found.amplitude, atol=1e-12 * amplitude)


def test_standing_waves_read_half_at_either_wavenumber_and_uniform_motion_all():
    j, t = np.arange(16), RUN.t[:, None]
    for q, w, read in ((np.pi / 4, 2.0, 0.5), (np.pi, 1.0, 1.0), (0.0, 3.0, 1.0), (0.0, 0.0, 1.0)):
        standing = np.cos(q * j) * np.cos(2 * np.pi * w / 4 * t)
        found = spectrum(replace(RUN, u=standing))
        assert found.amplitude.max() == pytest.approx(read, rel=1e-12)
    nothing = spectrum(replace(RUN, u=0 * t * j))
    assert nothing.participation == 0
    assert len(nothing.ridge()[0]) == 0


def test_alternate_sites_show_folded_wavenumbers_and_coordinates_stay_apart():
    j, t = np.arange(16), RUN.t[:, None]
    wave = np.cos(np.pi / 4 * j - 2 * np.pi * 5 / 32 * t)
    found = spectrum(replace(RUN, u=wave), sites=range(1, 16, 2))
    assert found.amplitude.max() == pytest.approx(1, rel=1e-12)
    row, column = np.unravel_index(found.amplitude.argmax(), found.amplitude.shape)
    assert found.wavenumbers[column] == pytest.approx(np.pi / 4, rel=1e-12)
    assert found.wavenumbers[-1] == pytest.approx(np.pi / 2)
    both = spectrum(replace(RUN, u=np.stack([wave, 3 * wave], axis=-1)))
    assert both.amplitude[row].max(axis=0) == pytest.approx([1, 3])
    assert both.total.max() == pytest.approx(10**0.5)


@pytest.mark.parametrize("masses", [[1.0], [1.0, 0.4]])
def test_lines_of_thermal_motion_lie_on_the_bands(masses):
    """Waves of all branches of a chain between walls, 600 s: each line within a twentieth of the
    resolution in frequency, at the phases that walls admit."""
    many = 32
    chain = Chain(LINEAR, many + 1, np.resize(masses, many + 1), ends=("fixed", "fixed"))
    v = np.zeros(many + 1)
    v[1:-1] = np.random.default_rng(1).normal(size=many - 1)
    run = simulate(
        chain, State(0 * v, v), 600.0, method="rkn6", dt=0.05, record=Record(interval=0.6)
    )
    apart = 2 * np.pi / 600.6
    inner = spectrum(run, sites=range(0, many, len(masses)))
    bands = dispersion(LINEAR, masses, np.linspace(0, np.pi, many * 8 + 1))
    w = inner.ridge(0.2)[1]
    own = dispersion(LINEAR, masses, np.pi * np.arange(1, many) / many * len(masses)).ravel()
    assert bands.max() < np.pi / 0.6
    off = np.abs(w[:, None] - own).min(axis=1)
    assert len(w) > 5
    assert off.max() < 0.05 * apart


def test_participation_counts_equal_waves():
    j, t = np.arange(16), RUN.t[:, None]
    waves = sum(np.cos(2 * np.pi * k / 16 * j - 0.3 * k * t) for k in (3, 6))
    assert (
        spectrum(replace(RUN, u=waves)).participation
        > spectrum(replace(RUN, u=np.cos(6 * np.pi / 16 * j - 0.9 * t))).participation
    )


def test_what_has_no_spectrum_is_named():
    uneven = replace(RUN, t=RUN.t**1.1)
    with pytest.raises(TensegrityError, match=r"apart, must be 0\.5"):
        spectrum(replace(RUN, t=np.append(RUN.t[:-1], RUN.t[-1] + 0.1)))
    with pytest.raises(TensegrityError, match="record at even intervals"):
        spectrum(uneven)
    with pytest.raises(TensegrityError, match="3 instants are too few"):
        spectrum(replace(RUN, t=RUN.t[:3], u=RUN.u[:3]))
    with pytest.raises(TensegrityError, match="site 9 was not recorded"):
        spectrum(replace(RUN, u=RUN.u[:, :9], sites=tuple(range(9))), sites=[7, 8, 9])
    with pytest.raises(TensegrityError, match="must ascend in even steps"):
        spectrum(RUN, sites=[0, 1, 3])
    with pytest.raises(TensegrityError, match="must be 'u' or 'v'"):
        spectrum(RUN, of="r")


def test_a_picture_has_the_bands_of_equal_cells():
    axes = spectrum(RUN).plot()
    (line,) = axes.lines
    q, w = line.get_data()
    np.testing.assert_allclose(w, dispersion(LINEAR, 1.0, q)[:, 0])
    assert "16 wave numbers" in str(spectrum(RUN))
