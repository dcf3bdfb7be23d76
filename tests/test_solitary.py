"""Exact solitary waves: closed forms, identities, chains that carry them, and what has none."""

import math
from itertools import pairwise

import numpy as np
import pytest
import sympy as sp
from springs import series

from derivations import waves as derived
from tensegrity import (
    Chain,
    Ensemble,
    EquilibriumError,
    Potential,
    PowerLaw,
    Prism,
    Record,
    ResolutionError,
    TensegrityError,
    simulate,
    solitary_wave,
    speed,
)
from tensegrity.waves import family
from tensegrity.waves.cosines import Grid
from tensegrity.waves.curve import largest_speed
from tensegrity.waves.travelling import Profile, Scaled, amplitude_is, newton

R = sp.Symbol("r")
TODA = Potential(sp.exp(-R) + R - 1, R, length=1.0)
PRISM = Prism(1.0, 0.7, 0.01, 1.0).potential()


def toda_elongation(kappa, x):
    """M. Toda (1967): exp(-r) - 1 = sinh^2 kappa sech^2(kappa x), c = sinh(kappa)/kappa."""
    return -np.log1p((np.sinh(kappa) / np.cosh(kappa * x)) ** 2)


@pytest.mark.parametrize("kappa", [0.3, 0.8, 2.0])
def test_toda_soliton_by_speed_is_the_closed_form(kappa):
    wave = solitary_wave(TODA, speed=np.sinh(kappa) / kappa)
    x = np.linspace(-30 / kappa, 30 / kappa, 1001)
    error = np.abs(wave.elongation(x) - toda_elongation(kappa, x)).max()
    assert error < 1e-12 * abs(wave.amplitude)
    assert wave.residual < 1e-12


def test_toda_soliton_by_amplitude_has_its_closed_speed_momentum_and_energy():
    kappa = 1.3
    wave = solitary_wave(TODA, mass=1.0, amplitude=float(toda_elongation(kappa, 0.0)))
    assert wave.speed == pytest.approx(np.sinh(kappa) / kappa, rel=1e-12)
    # u behind the soliton: log cosh(y - kappa) - log cosh(y) from one end to the other
    assert wave.shift == pytest.approx(2 * kappa, rel=1e-12)
    assert wave.momentum == pytest.approx(2 * np.sinh(kappa), rel=1e-12)
    assert wave.energy == pytest.approx(np.sinh(2 * kappa) - 2 * kappa, rel=1e-12)


@pytest.mark.parametrize("ratio", [1.001, 1.01, 1.05, 1.3, 2.0, 5.0])
@pytest.mark.parametrize("shape", [(0.7, 0.01), (0.6, 0.001), (0.8, 0.02)])
def test_residual_off_the_grid_is_round_off_up_to_0_97_of_the_stroke(shape, ratio):
    spring = Prism(1.0, *shape, 1.0).potential()
    last = solitary_wave(spring, amplitude=0.97 * spring.domain[0])
    if ratio < last.speed_ratio:
        wave = solitary_wave(spring, speed_ratio=ratio)
        assert wave.residual <= 1e-12
        assert wave.speed_ratio == pytest.approx(ratio, rel=1e-14)
    assert last.residual <= 1e-12


def test_wave_launched_on_a_chain_keeps_its_shape_over_500_sites():
    wave = solitary_wave(PRISM, speed_ratio=1.3)
    chain = Chain(PRISM, 600)
    start = wave.launch(chain, at=40.3)
    assert chain.energy(start) == pytest.approx(wave.energy, rel=1e-12)
    run = simulate(chain, start, 500 / wave.speed, method="rkn6", dt=0.05)
    there = wave.launch(chain, at=540.3)
    r = chain.elongation(run.final.u) - chain.elongation(there.u)
    assert np.max(np.abs(r)) < 1e-9 * abs(wave.amplitude)
    assert np.max(np.abs(run.final.v - there.v)) < 1e-9 * np.max(np.abs(there.v))


ELASTIC = [
    (Prism(1.0, 0.5, 0.4, 1.0, 2.0, 20.0).potential(preload=0.05), "rarefaction"),
    (Prism(1.0, 1.0, 0.1, 1.0, 5.0, 50.0).potential(), "compression"),
]


@pytest.mark.parametrize(("spring", "family"), ELASTIC)
@pytest.mark.parametrize("ratio", [1.001, 1.01, 1.05, 1.3, 2.0, 5.0])
def test_elastic_prisms_carry_exact_waves_up_to_their_largest_speed(spring, family, ratio):
    """A softening one rarefactions; both end at a finite force or a front, so at a low speed."""
    if ratio * spring.sound_speed() < largest_speed(spring):
        wave = solitary_wave(spring, speed_ratio=ratio)
        assert (wave.amplitude > 0) == (family == "rarefaction")
        assert wave.residual <= 1e-12
    else:
        with pytest.raises(TensegrityError, match="speed"):
            solitary_wave(spring, speed_ratio=ratio)


@pytest.mark.parametrize("exponent", [1.5, 2.0, 3.0])
def test_power_laws_have_waves_of_one_shape_and_speed_constant(exponent):
    """Scale invariance: speed ~ amplitude^((n-1)/2); the constant from two domains and grids, and
    from the arrivals on a chain."""
    law, big = PowerLaw(1.0, exponent), 7.0
    one, other = solitary_wave(law, amplitude=-1.0), solitary_wave(law, amplitude=-big)
    assert other.speed / one.speed == pytest.approx(big ** ((exponent - 1) / 2), rel=1e-12)
    x = np.linspace(0, 5, 101)
    assert np.abs(other.elongation(x) / big - one.elongation(x)).max() < 1e-13
    assert one.speed == pytest.approx(speed_constant(exponent), rel=1e-8)
    chain = Chain(law, 80)
    record = Record(every=1, sites=(30, 31, 60, 61))
    start = one.launch(chain, at=15.0)
    run = simulate(chain, start, 60 / one.speed, method="rkn6", dt=0.01, record=record)
    assert speed(run, (30, 60)) == pytest.approx(one.speed, rel=1e-6)


def speed_constant(exponent):
    """Speed of the wave of unit amplitude, by trapezoids in real space and extrapolation."""
    values = []
    for per_site in (8, 16, 32, 64):
        n = 8 * per_site
        tent = (1 - np.abs(np.arange(-per_site, per_site + 1) / per_site)) / per_site
        half = np.exp(-((np.arange(n + 1) / per_site) ** 2))
        for _ in range(60):
            whole = np.concatenate([half[:0:-1], half]) ** exponent
            new = np.convolve(whole, tent, mode="same")[n:]
            squared, half = new[0], new / new[0]
        values.append(np.sqrt(squared))
    for gain in (4, 16, 64):
        values = [(gain * b - a) / (gain - 1) for a, b in pairwise(values)]
    return values[0]


def test_speed_is_the_group_velocity_of_energy_and_lattice_momentum():
    """dE = c dQ along a family, Q = m c int (du/dx)^2 dx: translation by Noether."""

    def lattice_momentum(wave):
        squared = wave.rate(wave.x) ** 2
        return wave.mass * wave.speed * np.sum(squared) * (wave.x[1] - wave.x[0])

    for spring, size in ((PRISM, -0.04), (ELASTIC[0][0], 0.1), (PowerLaw(1.0, 1.5), -1.0)):
        h = 1e-4 * abs(size)
        near = [solitary_wave(spring, mass=2.0, amplitude=size + k * h) for k in (-1, 0, 1)]
        energy = near[2].energy - near[0].energy
        momentum = lattice_momentum(near[2]) - lattice_momentum(near[0])
        assert energy / momentum == pytest.approx(near[1].speed, rel=1e-7)


def test_two_domain_lengths_agree():
    """The tail beyond the grid is round-off: twice the length changes nothing."""
    wave = solitary_wave(PRISM, speed_ratio=1.05)
    law, grid = Scaled(PRISM, wave.amplitude), wave._shape.grid
    rho = wave.elongation(grid.x) / wave.amplitude
    nu = wave.speed**2 * law.reference / law.force - law.rest
    longer = Grid(2 * grid.points, 2 * grid.half_length)
    again = newton(Profile(law, grid, rho, nu).on(longer), amplitude_is(1.0))
    assert again.nu == pytest.approx(nu, rel=1e-13)
    assert np.abs(again.rho[: grid.points + 1] - rho).max() < 1e-13


def test_a_domain_too_short_for_the_tail_shows():
    """Half of what the tail needs: the wave of that period is another one."""
    wave = solitary_wave(PRISM, speed_ratio=1.05)
    law, grid = Scaled(PRISM, wave.amplitude), Grid(192, wave._shape.grid.half_length / 4)
    rho = wave.elongation(grid.x) / wave.amplitude
    nu = wave.speed**2 * law.reference / law.force - law.rest
    short = newton(Profile(law, grid, rho, nu), amplitude_is(1.0))
    assert short.residual() < 1e-12
    assert short.tail > 1e-5
    assert abs(short.nu / nu - 1) > 1e-9


def test_wave_is_the_same_by_speed_amplitude_and_energy():
    by_speed = solitary_wave(PRISM, mass=0.3, speed_ratio=1.7)
    for given in (
        {"amplitude": by_speed.amplitude},
        {"energy": by_speed.energy},
        {"speed": by_speed.speed},
    ):
        wave = solitary_wave(PRISM, mass=0.3, **given)
        assert wave.speed == pytest.approx(by_speed.speed, rel=1e-12)
        assert wave.energy == pytest.approx(by_speed.energy, rel=1e-12)
        assert wave.amplitude == pytest.approx(by_speed.amplitude, rel=1e-12)
    chain = Chain(PRISM, 100, mass=0.3)
    state = by_speed.launch(chain, at=50.2)
    assert chain.momentum(state) == pytest.approx(by_speed.momentum, rel=1e-12)
    assert chain.energy(state) == pytest.approx(by_speed.energy, rel=1e-12)


def test_stiffening_prisms_carry_rarefactions_above_a_threshold():
    spring = Prism(1.0, 0.8, 0.02, 1.0).potential()
    assert solitary_wave(spring, speed_ratio=1.2).amplitude < 0
    wave = solitary_wave(spring, speed_ratio=1.2, family="rarefaction")
    assert wave.amplitude > 0
    slow = solitary_wave(spring, speed_ratio=1.001, family="rarefaction")
    with pytest.raises(TensegrityError, match="no solitary wave of rarefaction"):
        solitary_wave(spring, amplitude=0.8 * slow.amplitude)


@pytest.mark.parametrize("x", [math.nan, [1.0, math.nan], "a", 1j])
@pytest.mark.parametrize("read", ["elongation", "rate", "displacement"])
def test_places_that_are_no_numbers_are_refused(read, x):
    wave = solitary_wave(TODA, speed_ratio=1.4)
    with pytest.raises(TensegrityError, match=r"x .* is not (a number|made of numbers)"):
        getattr(wave, read)(x)


def test_a_wave_is_zero_infinitely_far_away():
    wave = solitary_wave(TODA, speed_ratio=1.4)
    far = [-math.inf, math.inf]
    assert not np.any([wave.elongation(far), wave.rate(far)])
    assert wave.displacement(far) == pytest.approx([wave.shift, 0.0], abs=1e-14)


@pytest.mark.parametrize("tail", [math.nan, 2.0, 1.0, 0.0, -1.0, "a"])
def test_a_tail_is_a_part_of_the_peak(tail):
    wave, chain = solitary_wave(TODA, speed_ratio=1.4), Chain(TODA, 200)
    for ask in (wave.reach, lambda tail: wave.launch(chain, at=100, tail=tail)):
        with pytest.raises(TensegrityError, match=r"tail .* (must|is not)"):
            ask(tail)


def test_launch_to_lower_sites_mirrors_the_wave():
    wave = solitary_wave(PRISM, speed_ratio=1.4)
    chain = Chain(PRISM, 100)
    up, down = wave.launch(chain, at=49.5), wave.launch(chain, at=49.5, direction=-1)
    assert np.allclose(up.v, -down.v[::-1], rtol=0, atol=1e-15)
    assert chain.momentum(down) == pytest.approx(-wave.momentum, rel=1e-12)
    assert down.u[0] == pytest.approx(0.0, abs=1e-15)
    assert up.u[-1] == pytest.approx(0.0, abs=1e-15)
    assert up.u[0] == pytest.approx(wave.shift, rel=1e-12)


def test_launch_on_a_chain_with_a_fixed_end():
    wave = solitary_wave(PRISM, speed_ratio=1.4)
    for ends in (("free", "fixed"), ("fixed", "free")):
        chain = Chain(PRISM, 100, ends=ends)
        chain.check(wave.launch(chain, at=49.5))
    with pytest.raises(TensegrityError, match="both ends"):
        wave.launch(Chain(PRISM, 100, ends=("fixed", "fixed")), at=49.5)


def test_launch_refuses_what_does_not_fit():
    wave = solitary_wave(PRISM, speed_ratio=1.4)
    with pytest.raises(TensegrityError, match="sites away"):
        wave.launch(Chain(PRISM, 40), at=10)
    with pytest.raises(TensegrityError, match="masses"):
        wave.launch(Chain(PRISM, 100, mass=2.0), at=50)
    with pytest.raises(TensegrityError, match="springs"):
        wave.launch(Chain(TODA, 100), at=50)
    with pytest.raises(TensegrityError, match="chain is Ensemble, not a Chain"):
        wave.launch(Ensemble(Chain(PRISM, 100), 2), at=50)
    with pytest.raises(TensegrityError, match="direction 2"):
        wave.launch(Chain(PRISM, 100), at=50, direction=2)


@pytest.mark.parametrize(
    ("spring", "given", "message"),
    [
        (PRISM, {}, "nothing given"),
        (PRISM, {"speed": 1.0, "energy": 1.0}, "speed and energy given"),
        (PRISM, {"speed_ratio": 0.9}, "sound speed"),
        (PRISM, {"speed_ratio": 1.0}, "sound speed"),
        (PRISM, {"speed_ratio": math.nan}, "speed_ratio nan"),
        (PRISM, {"speed_ratio": 20.0}, "is above speed"),
        (PRISM, {"energy": -1.0}, "energy -1 J"),
        (PRISM, {"energy": 1.0}, "is above energy"),
        (PRISM, {"amplitude": 0.0}, "must not be 0"),
        (PRISM, {"amplitude": -1.0}, "bars meet"),
        (PRISM, {"amplitude": -0.01, "family": "rarefaction"}, "wrong sign"),
        (PRISM, {"speed_ratio": 1.1, "family": "dark"}, "family 'dark'"),
        (Prism(1.0, 0.8, 0.0, 1.0).potential(), {"speed_ratio": 1.1}, "sonic vacuum"),
        (series(), {"speed": 1.1}, "does not exceed its value at rest"),
        (series(0, -1 / 4), {"speed": 1.1}, "does not exceed its value at rest"),
        (PowerLaw(1.0, 1.0), {"speed": 1.1}, "does not exceed its value at rest"),
        (PowerLaw(1.0, 0.5), {"speed": 1.1}, "does not exceed its value at rest"),
        (PowerLaw(1.0, 1.5), {"amplitude": 1.0}, "does not resist"),
        (PowerLaw(1.0, 1.5), {"speed_ratio": 1.1}, "sonic vacuum"),
        (PowerLaw(1.0, 40.0), {"amplitude": 1.0}, "does not resist"),
        (PowerLaw(1.0, 40.0), {"amplitude": -1e-8}, "the energy is 0 to round-off"),
        (PRISM, {"amplitude": -5e-324}, "the speed is the sound speed to round-off"),
        (Potential(sp.exp(-R), R), {"speed": 1.1}, "tension -1 N at r = 0 must be 0"),
        (TODA, {"speed": 1e200}, r"speed 1e\+200 sites/s gives m c\^2 = inf N/m"),
        (TODA, {"speed": 10.0, "mass": 1e308}, r"m c\^2 = inf N/m"),
        (PowerLaw(1.0, 1.5), {"speed": 1e-170}, r"m c\^2 = 0\.0 N/m, must be a number above"),
        (TODA, {"speed": 1.1, "family": "rarefaction"}, "does not exceed its value at rest"),
        ("spring", {"speed": 1.1}, "not a Potential"),
    ],
)
def test_where_no_wave_exists_the_error_says_why(spring, given, message):
    with pytest.raises(TensegrityError, match=message):
        solitary_wave(spring, **given)


def test_a_wave_too_close_to_locking_is_not_resolved():
    with pytest.raises(ResolutionError, match="not resolved"):
        solitary_wave(PRISM, amplitude=(1 - 1e-4) * PRISM.domain[0])


def test_preload_beyond_the_limit_point_has_no_potential_to_carry_waves():
    with pytest.raises(EquilibriumError, match="largest axial load"):
        Prism(1.0, 0.5, 0.4, 1.0, 2.0, 20.0).potential(preload=0.2)


def test_power_law_without_a_length_has_no_strain():
    wave = solitary_wave(PowerLaw(1.0, 1.5), speed=1.0)
    with pytest.raises(TensegrityError, match="no length"):
        _ = wave.strain
    assert solitary_wave(PowerLaw(1.0, 1.5, length=2.0), amplitude=-1.0).strain.min() == (
        pytest.approx(-0.5, rel=1e-14)
    )


def test_precompressed_hertz_chain_carries_a_wave():
    spring = PowerLaw(1.0, 1.5, preload=0.3)
    wave = solitary_wave(spring, speed_ratio=1.2)
    assert wave.residual <= 1e-12
    chain = Chain(spring, 200)
    run = simulate(chain, wave.launch(chain, at=50.0), 100 / wave.speed, method="rkn6", dt=0.03)
    there = wave.launch(chain, at=150.0)
    assert np.abs(run.final.v - there.v).max() < 1e-9 * np.abs(there.v).max()


@pytest.mark.parametrize("shape", [(0.7, 0.01), (0.6, 0.001)])
def test_largest_speed_is_the_limit_from_two_sets_of_waves(shape):
    """... and the energy two masses lose in a bond overestimates it by less than a tenth."""
    spring = Prism(1.0, *shape, 1.0).potential()
    limit = largest_speed(spring)
    assert largest_speed(spring, closest=6e-4) == pytest.approx(limit, rel=1e-5)
    values = {
        derived.mass: 1.0,
        derived.stroke: -spring.domain[0],
        derived.locking_energy: float(spring.energy(spring.domain[0])),
    }
    assert 1 < float(derived.largest_speed().subs(values)) / limit < 1.1
    near = solitary_wave(spring, amplitude=0.999 * spring.domain[0])
    assert 0.9 * limit < near.speed < limit


def test_softening_ends_a_family_at_the_speed_of_a_front():
    """Near it the wave has a flat top at the level the front joins to rest."""
    spring, _ = ELASTIC[1]
    rise = family.Family(spring, -1).rising_part
    size, above = rise.top, rise.ceiling
    wave = solitary_wave(spring, amplitude=-0.998 * size)
    assert wave.speed**2 == pytest.approx(spring.stiffness(0.0) + above, rel=1e-5)
    assert wave.speed < largest_speed(spring)
    assert wave.width(0.5) > 2 * solitary_wave(spring, amplitude=-0.5 * size).width(0.5)


def test_a_wave_says_what_it_is():
    text = str(solitary_wave(PRISM, speed_ratio=1.05))
    assert "compression" in text
    assert "1.05 sound speeds" in text
    assert "residual" in text
