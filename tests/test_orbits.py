"""Periodic orbits of undriven chains: breathers, modes of defects, oscillators."""

import math
from functools import cache

import numpy as np
import pytest
import sympy as sp
from scipy.integrate import quad, solve_ivp
from scipy.optimize import brentq
from scipy.special import ellipk

from tensegrity import (
    Chain,
    Damping,
    Potential,
    PowerLaw,
    Prism,
    State,
    TensegrityError,
    floquet,
    orbit_path,
    periodic_orbit,
)
from tensegrity.orbits.flow import Flow

SPRING = Prism(1.0, 0.7, 0.1, 1.0).potential()
TOP = math.sqrt(float(SPRING.stiffness(0.0))) / math.pi  # of the band of equal masses [Hz]
DEFECT = math.sqrt(4 * float(SPRING.stiffness(0.0)) / (0.5 * 1.5)) / (2 * math.pi)
HERTZ, OVERLAP, EDGE = 5.464421336726e9, 2.374964987e-6, 8101.488936  # N/m^1.5, m, Hz


def followed(chain, guess, frequencies):
    """The last of orbits of these frequencies, each from the one before."""
    for frequency in frequencies:
        guess = periodic_orbit(chain, guess, period=1 / frequency)
    return guess


@cache
def breather(sites, ratio):
    """Of prisms above the band, centred on a bond if `sites` is even."""
    x = np.arange(sites) - (sites - 1) / 2
    shape = np.cos(np.pi * x) if sites % 2 else np.sin(np.pi * x)
    guess = State(0.02 * shape / np.cosh(2 * math.acosh(1.05) * x), 0 * x)
    ratios = [*np.arange(1.05, ratio - 1e-9, 0.025), ratio]
    return followed(Chain(SPRING, sites), guess, TOP * np.array(ratios))


@cache
def defect_mode(ratio):
    x = np.arange(41) - 20
    chain = Chain(SPRING, 41, np.where(x == 0, 0.5, 1.0))
    guess = State(0.0091 * (-1.0 / 3) ** np.abs(x), 0.0 * x)
    ratios = [r for r in (1.005, 1.009, 1.016, 1.03, 1.05, 1.075) if r < ratio] + [ratio]
    return followed(chain, guess, DEFECT * np.array(ratios))


@cache
def gap_breather(heavy, frequency):
    """Of steel and aluminium beads under 20 N, its centre a heavy or a light bead."""
    if frequency < 8050:
        before = gap_breather(heavy, frequency + 50)
        return periodic_orbit(before.scene, before, period=1 / frequency)
    sites = 81 if heavy else 79
    x = np.arange(sites) - sites // 2
    light = np.arange(sites) % 2 == 1
    chain = Chain(PowerLaw(HERTZ, 1.5, preload=20.0), sites, np.where(light, 0.00975, 0.02884))
    shape = light * (np.sin if heavy else np.cos)(np.pi * x / 2)
    width = math.sqrt(1 - (8050 / EDGE) ** 2)
    guess = State(1e-6 * shape / np.cosh(width * x), 0.0 * x)
    return periodic_orbit(chain, guess, period=1 / 8050)


def real_ones(found):
    m = found.multipliers
    return m[(np.abs(m.imag) < 1e-9) & (np.abs(m.real) > 1 + 1e-5)].real


@pytest.mark.parametrize(
    ("sites", "ratio", "energy", "width", "longest", "shortest", "multiplier"),
    [
        (40, 1.1, 0.02336748657, 0.0919669639, 0.0919669639, -0.0443314413, None),
        (41, 1.1, 0.02342248954, 0.0899862886, 0.0863489962, -0.0501902624, 1.0872265),
        (40, 1.2, 0.04211661147, 0.1382137215, 0.1382137215, -0.0509184007, None),
        (41, 1.2, 0.04320938694, 0.1295231142, 0.1264364212, -0.0604539681, 1.5176624),
    ],
)
def test_breathers_of_prisms_above_the_band(
    sites, ratio, energy, width, longest, shortest, multiplier
):
    orbit = breather(sites, ratio)
    r = np.diff(orbit.state.u)
    found = [orbit.energy, np.ptp(orbit.state.u), r.max(), r.min()]
    assert np.allclose(found, [energy, width, longest, shortest], rtol=2e-8, atol=0)
    assert orbit.residual < 1e-11
    assert not orbit.opens
    stability = floquet(orbit)
    assert np.abs(stability.neutral - 1).max() < 1e-4
    if multiplier is None:
        assert real_ones(stability).size == 0
    else:
        assert real_ones(stability) == pytest.approx([multiplier], abs=1e-7)
        assert not stability.stable
        assert stability.growth == pytest.approx(math.log(multiplier) / orbit.period, rel=1e-6)


def test_multipliers_of_an_orbit_are_those_of_scipys_variational_equations():
    orbit = breather(41, 1.2)
    n = orbit.scene.sites

    def rates(_, y):
        u, v, columns = y[:n], y[n : 2 * n], y[2 * n :].reshape(2 * n, -1)
        r = np.diff(u)
        pulled = SPRING.stiffness(r)[:, None] * np.diff(columns[:n], axis=0)
        forces = np.diff(SPRING.tension(r), prepend=0, append=0)
        bent = np.diff(pulled, axis=0, prepend=0 * pulled[:1], append=0 * pulled[:1])
        return np.concatenate([v, forces, columns[n:].ravel(), bent.ravel()])

    start = np.concatenate([orbit.state.u, orbit.state.v, np.eye(2 * n).ravel()])
    end = solve_ivp(rates, (0, orbit.period), start, "DOP853", rtol=1e-11, atol=1e-12).y[:, -1]
    whole = np.linalg.eigvals(end[2 * n :].reshape(2 * n, 2 * n))
    others = whole[np.abs(whole - 1) > 1e-3]
    found = floquet(orbit).multipliers
    assert len(found) == len(others) == 2 * n - 4
    assert np.abs(found[:, None] - others).min(axis=1).max() < 1e-7
    assert np.abs(end[:n] - orbit.state.u).max() < 1e-9


@pytest.mark.parametrize(
    ("ratio", "energy", "centre", "width"),
    [
        (1.005, 4.71942607648e-4, 0.00909929162706, 0.0128943905982),
        (1.05, 4.90201420354e-3, 0.0290491880075, 0.0448802396857),
        (1.1, 1.03335964798e-2, 0.0415054997597, 0.0669507564961),
    ],
)
def test_the_mode_of_a_light_defect_continues_to_large_energies(ratio, energy, centre, width):
    orbit = defect_mode(ratio)
    u = orbit.state.u - np.mean(orbit.state.u)
    found = [orbit.energy, abs(u[20]), np.ptp(u)]
    assert np.allclose(found, [energy, centre, width], rtol=1e-8, atol=0)


@pytest.mark.parametrize(
    ("heavy", "frequency", "energy", "width", "longest", "multiplier"),
    [
        (True, 7900, 1.42387794e-4, 4.43672097e-6, 0.93406029, 1.61318),
        pytest.param(
            True, 7200, 2.08157998e-4, 7.05282057e-6, 1.48482622, 2.66305, marks=pytest.mark.slow
        ),
        pytest.param(
            True, 6600, 2.96962231e-4, 9.66637613e-6, 2.03505655, 2.91433, marks=pytest.mark.slow
        ),
        pytest.param(
            False, 7900, 1.06899613e-4, 3.66605457e-6, 1.10880019, 1.369282, marks=pytest.mark.slow
        ),
        (False, 7200, 1.26578008e-4, 4.64085685e-6, 1.81743391, None),
        pytest.param(
            False, 6900, 1.49266388e-4, 5.29506768e-6, 2.14173622, None, marks=pytest.mark.slow
        ),
    ],
)
def test_breathers_in_the_gap_of_steel_and_aluminium_open_contacts(
    heavy, frequency, energy, width, longest, multiplier
):
    orbit = gap_breather(heavy, frequency)
    r = np.diff(orbit.state.u) / OVERLAP
    assert np.allclose([orbit.energy, np.ptp(orbit.state.u)], [energy, width], rtol=1e-8, atol=0)
    assert min(abs(r.max() - longest), abs(-r.min() - longest)) < 1e-7
    assert orbit.opens
    assert not gap_breather(heavy, 8000).opens
    found = [x for x in real_ones(floquet(orbit)) if x > 0]  # weak ones near -1 are of the ends
    assert found == ([] if multiplier is None else [pytest.approx(multiplier, abs=2e-5)])


def test_an_oscillator_has_the_period_of_the_quadrature():
    chain = Chain(SPRING, 2, ends=("fixed", "free"))
    energy = 2e-3
    turning = [brentq(lambda r: float(SPRING.energy(r)) - energy, 0, x, xtol=1e-15)
               for x in (-0.066, 0.3)]  # fmt: skip
    middle, half = np.mean(turning), np.ptp(turning) / 2

    def slowness(angle):
        left = energy - float(SPRING.energy(middle + half * math.sin(angle)))
        return half * math.cos(angle) / math.sqrt(2 * max(left, 1e-300))

    edge = math.pi / 2
    period = 2 * quad(slowness, -edge, edge, epsabs=1e-11, limit=200)[0]
    guess = State(np.array([0, 0.9 * turning[1]]), np.zeros(2))
    same = periodic_orbit(chain, guess, period=period)
    assert same.energy == pytest.approx(energy, rel=1e-5)
    near = periodic_orbit(chain, same, energy=0.7 * energy)
    assert abs(near.period / period - 1) > 1e-3
    orbit = periodic_orbit(chain, near, energy=energy)
    assert orbit.energy == pytest.approx(energy, rel=1e-12)
    assert orbit.period == pytest.approx(period, rel=1e-7)
    assert np.abs(orbit.state.u[1] - turning).min() < 1e-10
    assert floquet(orbit).multipliers.size == 0
    assert floquet(orbit).stable


def test_an_orbit_of_given_energy_is_that_of_its_period():
    by_period = breather(20, 1.1)
    near = breather(20, 1.09)
    found = periodic_orbit(by_period.scene, near, energy=by_period.energy)
    assert found.period == pytest.approx(by_period.period, rel=1e-10)
    assert np.allclose(found.state.u, by_period.state.u, atol=1e-9)


@cache
def five_masses():
    """Between walls; masses 1, 2 and 4, 5 move oppositely, the middle one rests."""
    r = sp.Symbol("r")
    chain = Chain(Potential(r**2 / 2 + r**4 / 4, r), 7, ends=("fixed", "fixed"))
    a = 0.1 * np.array([0, 1, 1, 0, -1, -1, 0])
    orbit = periodic_orbit(chain, State(a, 0 * a), period=2 * math.pi / math.sqrt(1.0075))
    return orbit_path(orbit, by="energy", until=0.8)


def test_a_mode_becomes_unstable_where_hills_equation_does():
    """Masses 1, 2 and 4, 5 of five move oppositely, the middle one rests: a'' = -a - a^3."""
    symmetric = np.array([[1, 0, 0, 0, 1], [0, 1, 0, 1, 0], [0, 0, 1, 0, 0]])

    def side(t, y):
        a, k = y[0], np.diag(1 + 3 * y[0] ** 2 * np.array([1, 0, 1, 1, 0, 1]))
        both = np.eye(6, 5) - np.eye(6, 5, -1)
        hill = -(both.T @ k @ both) @ symmetric.T  # on motions that keep the symmetry
        x, v = y[2:].reshape(2, 3, 6)
        return np.concatenate([[y[1], -a - a**3], v.ravel(), (hill[:3] @ x).ravel()])

    def beyond(a):
        start = np.concatenate([[a, 0], np.eye(6).ravel()])
        period = 4 * ellipk(a**2 / (2 + 2 * a**2)) / math.sqrt(1 + a**2)
        y = solve_ivp(side, (0, period), start, method="DOP853", rtol=1e-13, atol=1e-13).y[:, -1]
        return np.linalg.det(y[2:].reshape(6, 6) - np.eye(6))

    path = five_masses()
    assert [event.kind for event in path.events] == ["torus", "stability"]
    event = path.events[1]
    amplitude = brentq(beyond, 0.45, 0.6, xtol=1e-12)
    assert event.value == pytest.approx(2 * amplitude**2 + amplitude**4, rel=1e-8)
    meeting = path.events[0].value
    assert np.array_equal(path.stable, path.energy < meeting)


def test_two_pairs_leave_the_circle_together_where_those_of_scipy_meet():
    """Five masses, about the orbit in closed form."""
    event = five_masses().events[0]
    both = np.eye(6, 5) - np.eye(6, 5, -1)

    def sums(energy):
        """mu + 1/mu of all pairs, of the tangent of a period."""
        a = math.sqrt(math.sqrt(1 + energy) - 1)  # 2 a^2 + a^4 is the energy

        def side(t, y):
            k = np.diag(1 + 3 * y[0] ** 2 * np.array([1, 0, 1, 1, 0, 1]))
            (x, v), own = y[2:].reshape(2, 5, 10), [y[1], -y[0] - y[0] ** 3]
            return np.concatenate([own, v.ravel(), -(both.T @ k @ both @ x).ravel()])

        period = 4 * ellipk(a**2 / (2 + 2 * a**2)) / math.sqrt(1 + a**2)
        start = np.concatenate([[a, 0], np.eye(10).ravel()])
        y = solve_ivp(side, (0, period), start, method="DOP853", rtol=1e-12, atol=1e-12).y[:, -1]
        found = np.linalg.eigvals(y[2:].reshape(10, 10))
        return found + 1 / found

    squares = [np.abs(sums(event.value + step).imag).max() ** 2 for step in (-1e-6, 1e-6, 2e-6)]
    assert squares[0] < 1e-4 * squares[1]
    assert squares[2] == pytest.approx(2 * squares[1], rel=0.02)  # from 0 at the event to 2e-8


def oscillator(domain=(-math.inf, math.inf)):
    """A mass on a spring r + r^3 that leads to no more than the domain."""
    r = sp.Symbol("r")
    chain = Chain(Potential(r**2 / 2 + r**4 / 4, r, domain=domain), 2, ends=("fixed", "free"))
    guess = State(np.array([0.0, 0.1]), np.zeros(2))
    return periodic_orbit(chain, guess, period=2 * math.pi / math.sqrt(1.0075))


def test_a_path_to_large_amplitudes_has_the_periods_of_the_elliptic_integral():
    path = orbit_path(oscillator(), by="energy", until=5e3)  # of 5e-3
    squared = np.sqrt(1 + 4 * path.energy) - 1  # of the amplitude
    periods = 4 * ellipk(squared / (2 + 2 * squared)) / np.sqrt(1 + squared)
    assert np.allclose(path.period, periods, rtol=1e-9, atol=0)
    assert path.energy[-1] == pytest.approx(5e3, rel=1e-12)


def test_a_path_that_ends_says_why():
    with pytest.raises(
        TensegrityError, match=r"does not reach 1: .*close to the end of its domain"
    ):
        orbit_path(oscillator((-1.0, 1.0)), by="energy", until=1.0)


def test_an_orbit_returns_in_a_run():
    orbit = breather(20, 1.1)
    run = orbit.run()
    assert run.t[-1] == pytest.approx(orbit.period, rel=1e-14)
    assert np.abs(run.final.u - orbit.state.u).max() < 1e-8
    assert np.abs(run.final.v).max() < 1e-8


def test_the_turning_point_is_the_one_that_the_guess_lies_nearer_to():
    orbit = breather(20, 1.1)
    other = Flow(orbit.scene, 400).end(orbit.state.u, 0 * orbit.state.u, orbit.period / 2)[0]
    found = periodic_orbit(orbit.scene, State(other, 0 * other), period=orbit.period)
    assert np.allclose(found.state.u, other, atol=1e-9)
    assert np.abs(orbit.state.u - other).max() > 0.05


LINE = Chain(SPRING, 20)
BENT = State(0.02 * np.cos(np.pi * np.arange(20)), np.zeros(20))


@pytest.mark.parametrize(
    ("scene", "guess", "given", "words"),
    [
        (3, BENT, {"period": 1.0}, "scene"),
        (
            Chain(SPRING, 20, damping=Damping(ground=0.1)),
            BENT,
            {"period": 1.0},
            "no periodic drive",
        ),
        (LINE, BENT.u, {"period": 1.0}, "not a State or an Orbit"),
        (LINE, BENT, {}, "exactly one of period and energy"),
        (LINE, BENT, {"period": 1.0, "energy": 1.0}, "exactly one of period and energy"),
        (LINE, BENT, {"energy": 1.0}, "requires an Orbit"),
        (LINE, BENT, {"period": -1.0}, "period -1 s must be above 0"),
    ],
)
def test_what_is_no_question_is_refused(scene, guess, given, words):
    with pytest.raises(TensegrityError, match=words):
        periodic_orbit(scene, guess, **given)


def test_a_guess_that_slides_to_rest_is_named():
    x = np.arange(20) - 9.5
    guess = State(0.01 * np.sin(np.pi * x) / np.cosh(x), 0 * x)
    with pytest.raises(TensegrityError, match="converges to the state at rest"):
        periodic_orbit(LINE, guess, period=1 / (1.1 * TOP))


def test_a_harmonic_in_the_band_is_named():
    x = np.arange(40) - 19.5
    guess = State(0.02 * np.sin(np.pi * x) / np.cosh(0.3 * x), 0 * x)
    with pytest.raises(TensegrityError, match=r"harmonic 1 .* lies in the band .* to 0\.53"):
        periodic_orbit(Chain(SPRING, 40), guess, period=1 / (0.5 * TOP))


def test_the_linear_chain_has_no_orbit_off_its_frequencies():
    import sympy as sp

    r = sp.Symbol("r")
    chain = Chain(Potential(r**2 / 2, r), 20)
    with pytest.raises(TensegrityError, match="converges to the state at rest"):
        periodic_orbit(chain, BENT, period=2.0)


def diatomic_breather(light_centred, sites, start, frequencies):
    """Of prisms between masses 1 and 2, from the shape of a mode at the edge of a band."""
    x = np.arange(sites) - sites // 2
    light = (x % 2 == 0) == light_centred
    chain = Chain(SPRING, sites, np.where(light, 1.0, 2.0))
    shape, width = np.where(light, 0.0, 2.0) * np.sin(np.pi * x / 2), 0.1
    if start == "optic":
        shape, width = np.where(light, 1.0, -0.5), 0.2
    u = 0.01 * shape / np.cosh(width * x)
    return followed(chain, State(u - u.mean(), 0 * x), frequencies)


@pytest.mark.parametrize(
    ("light_centred", "energy", "width", "multiplier"),
    [
        (True, 0.0190964098941, 0.0858504763, None),
        (False, 0.0241840893433, 0.0976019978, 1.6887901),
    ],
)
def test_breathers_of_two_masses_above_the_optic_band(light_centred, energy, width, multiplier):
    ratios = np.array([1.02, 1.04, 1.06, 1.08, 1.1])
    orbit = diatomic_breather(light_centred, 61, "optic", 0.45942436158 * ratios)
    assert np.allclose([orbit.energy, np.ptp(orbit.state.u)], [energy, width], rtol=2e-9, atol=0)
    found = real_ones(floquet(orbit))
    assert found == pytest.approx([] if multiplier is None else [multiplier], abs=1e-7)


def test_a_breather_that_leaves_the_acoustic_band_has_a_strong_quartet():
    frequencies = [0.27, 0.275, 0.28, 0.285, 0.29]
    orbit = diatomic_breather(True, 81, "acoustic", frequencies)
    size = [orbit.energy, np.ptp(orbit.state.u)]
    assert size == pytest.approx([0.048684512, 0.166134036], rel=1e-8)
    found = floquet(orbit)
    assert found.multipliers[0] == pytest.approx(1.15628 + 0.36517j, abs=5e-6)
    assert found.growth == pytest.approx(0.29 * math.log(abs(1.15628 + 0.36517j)), rel=5e-5)
    fewer = diatomic_breather(True, 61, "acoustic", frequencies)
    assert floquet(fewer).multipliers[0] == pytest.approx(found.multipliers[0], abs=3e-3)
