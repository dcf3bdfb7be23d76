"""Exact waves: dH/dc, and Floquet multipliers on an open window."""

import math

import numpy as np
import pytest
import sympy as sp
from scipy.integrate import solve_ivp
from scipy.optimize import minimize_scalar

from tensegrity import (
    Chain,
    Damping,
    Potential,
    PowerLaw,
    Prism,
    ResolutionError,
    State,
    TensegrityError,
    floquet,
    predict,
    simulate,
    solitary_wave,
    transition_wave,
)
from tensegrity.orbits.flow import DrivenFlow, Flow
from tensegrity.root import root
from tensegrity.waves.by_target import neutral_motions

R = sp.Symbol("r")
TODA = Potential(sp.exp(-R) - 1 + R, R)
ALPHA = Potential(R**2 / 2 + R**3 / 3, R)
BETA = Potential(R**2 / 2 + R**4 / 4, R)
EIGHTH = Potential(R**2 / 2 + R**8 / 8, R)
HERTZ = PowerLaw(1.0, 1.5)
SLENDER, STIFF = (Prism(1.0, 0.7, p, 1.0).potential() for p in (0.01, 0.1))
CRITICAL = 1.03136571736  # speed of EIGHTH at which dH/dc = 0, by an independent code


@pytest.mark.parametrize("kappa", [0.3, 1.0, 1.7])
def test_energy_and_its_slope_of_todas_wave_are_the_closed_form(kappa):
    wave = solitary_wave(TODA, speed=math.sinh(kappa) / kappa)
    exact = math.sinh(2 * kappa) - 2 * kappa
    by_kappa = 2 * math.cosh(2 * kappa) - 2
    speed_by_kappa = (kappa * math.cosh(kappa) - math.sinh(kappa)) / kappa**2
    assert wave.energy == pytest.approx(exact, rel=1e-12)
    assert wave.energy_slope == pytest.approx(by_kappa / speed_by_kappa, rel=1e-12)


def test_energy_of_a_wave_of_hertz_without_preload_is_the_tenth_power_of_its_speed():
    wave = solitary_wave(HERTZ, speed=1.3)
    assert wave.energy_slope == pytest.approx(10 * wave.energy / 1.3, rel=1e-12)


CORNER = Potential(R**2 / 2 + sp.Max(R - 1, 0) ** 2, R)
OPENS = PowerLaw(1.0, 0.5, preload=1.0)  # at r = 1, with unbounded stiffness


@pytest.mark.parametrize(
    ("spring", "peak", "error"),
    [
        (CORNER, 1.5, 1e-8),
        (OPENS, 0.9, 1e-7),
        pytest.param(OPENS, 1.2, 1e-3, marks=pytest.mark.slow),
    ],
)
def test_energy_slope_is_that_of_neighbouring_waves_also_beyond_a_kink(spring, peak, error):
    def slope(step):
        more, less = (solitary_wave(spring, amplitude=peak + s) for s in (step, -step))
        return (more.energy - less.energy) / (more.speed - less.speed)

    near = slope(1e-4) if error > 1e-4 else (4 * slope(1e-4) - slope(2e-4)) / 3
    found = solitary_wave(spring, amplitude=peak).energy_slope
    assert found == pytest.approx(near, rel=error)


@pytest.mark.parametrize(
    ("spring", "target", "slope"),
    [
        (ALPHA, {"speed": 1.1}, 4.35766736),
        (BETA, {"speed": 1.1}, 6.61300453),
        (BETA, {"speed": 1.5}, 17.4402581),
        (SLENDER, {"speed_ratio": 1.05}, 2.21706748e-3),
        (SLENDER, {"speed_ratio": 2}, 6.53906996e-3),
        (SLENDER, {"speed_ratio": 4}, 1.31517729e-2),
        (STIFF, {"speed_ratio": 1.5}, 2.23807599e-2),
    ],
)
def test_waves_whose_energy_rises_with_speed_are_stable(spring, target, slope):
    wave = solitary_wave(spring, **target)
    found = floquet(wave)
    assert wave.energy_slope == pytest.approx(slope, rel=1e-8)
    assert found.stable
    assert found.growth == 0
    assert np.abs(found.neutral - 1).max() < 1e-6
    assert np.all(np.abs(found.multipliers) < 1)


@pytest.mark.parametrize(
    ("spring", "peaks"),
    [
        (PowerLaw(1.0, 1.5, preload=1.0), (-0.5, -3.0)),
        (PowerLaw(1.0, 0.5, preload=1.0), (0.3, 0.6)),
        (Prism(1.0, 0.5, 0.4, 1.0, 2.0, 20.0).potential(), (0.03, 0.06)),
    ],
    ids=["stiffening", "softening", "softening prism"],
)
def test_the_waves_of_the_talk_are_stable(spring, peaks):
    for peak in peaks:
        wave = solitary_wave(spring, amplitude=peak)
        assert floquet(wave).stable
        assert wave.energy_slope > 0


def test_todas_wave_is_stable_without_a_resonance():
    found = floquet(solitary_wave(TODA, speed=math.sinh(1.0)))
    assert found.stable
    assert found.multipliers.size == 0


def test_multiplier_of_a_wave_of_hertz_does_not_depend_on_its_units():
    waves = [solitary_wave(HERTZ, speed=1.0), solitary_wave(PowerLaw(3e9, 1.5), 0.02, speed=900.0)]
    found = [floquet(wave).multipliers[0] for wave in waves]
    assert np.allclose(found, 0.5600539, rtol=0, atol=2e-7)


@pytest.mark.parametrize(
    ("speed", "slope", "multiplier"),
    [
        (1.015, -6.1562432, 1.00373648),
        (1.02, -3.0187335, 1.00335357),
        (1.03, -0.22275167, 1.00055125),
        (1.05, 1.6644392, 0.98974456),
    ],
)
def test_waves_of_a_steep_law_are_unstable_where_their_energy_falls(speed, slope, multiplier):
    wave = solitary_wave(EIGHTH, speed=speed)
    found = floquet(wave)
    assert wave.energy_slope == pytest.approx(slope, rel=3e-8)
    assert abs(found.multipliers[0] - multiplier) < 2e-8
    assert found.stable == (slope > 0)
    assert found.growth == pytest.approx(max(0, speed * math.log(multiplier)), abs=3e-8)
    assert ("unstable" in str(found)) == (slope < 0)


def test_stability_changes_at_the_speed_of_least_energy():
    def multiplier(speed):
        return floquet(solitary_wave(EIGHTH, speed=speed)).multipliers[0].real - 1

    least = root(lambda c: solitary_wave(EIGHTH, speed=c).energy_slope, 1.03, 1.035, 1e-13)
    assert least == pytest.approx(CRITICAL, abs=2e-11)
    near = [multiplier(least + step) for step in (-1e-4, 1e-4)]
    assert near[0] > 0 > near[1]
    assert near[0] + near[1] == pytest.approx(0, abs=1e-2 * near[0])


def laps(flow, wave, x, u, v, count):
    """The state after some laps, each back by one site and with a window at rest ahead."""
    for _ in range(count):
        u, v = flow.end(u, v, 1 / wave.speed)
        u, v = (np.append(row[1:], 0.0) for row in (u, v))
    return u, v


def test_perturbations_of_a_run_grow_by_the_multiplier():
    wave = solitary_wave(EIGHTH, speed=1.02)
    x = np.arange(111) - 55.0
    flow = Flow(Chain(EIGHTH, 111), 16)
    base = np.array([wave.displacement(x), -wave.speed * wave.rate(x)])
    perturbation = np.array([np.exp(-(x**2)), 0 * x])
    for _ in range(140):
        perturbation *= 1e-6 / np.abs(perturbation).max()
        ends = [laps(flow, wave, x, *(base + s * perturbation), 50) for s in (1, -1)]
        before, perturbation = perturbation, np.subtract(*ends) / 2
    growth = np.abs(perturbation).max() / np.abs(before).max()
    assert math.log(growth) / 50 == pytest.approx(0.0033479596, abs=1e-8)
    assert math.log(floquet(wave).multipliers[0].real) == pytest.approx(0.0033479596, abs=1e-8)


def test_neutral_motions_are_those_of_neighbouring_waves():
    wave, x = solitary_wave(STIFF, speed_ratio=1.5), np.linspace(-6, 6, 25)
    shift, change = neutral_motions(wave, x)
    step = 1e-5

    def state(speed, moved=0.0):
        one = solitary_wave(STIFF, speed=speed)
        return np.array([one.displacement(x + moved), -speed * one.rate(x + moved)])

    c = wave.speed
    size = np.abs(shift).max()
    assert np.allclose((state(c, step) - state(c, -step)) / 2e-5, shift, atol=1e-8 * size)
    differences = (state(c + step) - state(c - step)) / 2e-5
    assert np.allclose(differences, change, atol=1e-7 * np.abs(change).max())


def test_tangents_are_symplectic_and_derivatives_of_the_flow():
    n, time = 12, 3.0
    chain, generator = Chain(STIFF, n, np.linspace(1, 2, n)), np.random.default_rng(0)
    u, v = 0.02 * generator.normal(size=(2, n))
    flow = Flow(chain, 30)
    tangent = flow.tangents(u, v, time)[2]
    form = np.kron([[0, 1], [-1, 0]], np.diag(chain.mass))
    assert np.abs(tangent.T @ form @ tangent - form).max() < 1e-13
    assert np.array_equal(flow.tangents(u, v, time, of_u=False)[2], tangent[n:])
    columns = []
    for direction in np.eye(2 * n).reshape(2 * n, 2, n):
        ends = [np.concatenate(flow.end(u + s * direction[0], v + s * direction[1], time))
                for s in (2e-5, 1e-5, -1e-5, -2e-5)]  # fmt: skip
        columns.append((8 * (ends[1] - ends[2]) - ends[0] + ends[3]) / 12e-5)
    assert np.abs(np.transpose(columns) - tangent).max() < 1e-8


def test_what_has_no_window_is_refused():
    with pytest.raises(TensegrityError, match=r"of 3 is not a SolitaryWave"):
        floquet(3)
    with pytest.raises(TensegrityError, match=r"window of .* sites, must be at most"):
        floquet(solitary_wave(ALPHA, excess=1e-4))


def test_neutral_multipliers_that_do_not_close_are_refused():
    """The stiffness is not bounded where the contact opens, so that steps converge slowly."""
    wave = solitary_wave(OPENS, amplitude=1.2)
    with pytest.raises(ResolutionError, match=r"neutral multipliers .* must be within 1e-06"):
        floquet(wave)


def test_a_family_names_the_speeds_at_which_it_is_unstable():
    potential = Potential(R**2 / 2 + 0.02 * R**4 / 4 + R**8 / 8, R)
    twice = predict(potential)["rarefaction"]
    ((low, high),) = twice.unstable()
    assert high == pytest.approx(1.02907398672, abs=2e-11)
    assert 1.0 + 1e-6 < low < 1.002  # near the speed of sound the fourth power counts more
    for speed in (low, high):
        slopes = twice.curve(speed=speed * np.array([0.9999, 1.0001])).energy_slope
        assert slopes[0] * slopes[1] < 0
    assert not floquet(solitary_wave(potential, speed=1.01)).stable


def test_a_prediction_says_which_waves_are_unstable_and_their_curve_is_dashed():
    import matplotlib.pyplot as plt

    family = predict(EIGHTH)["compression"]
    assert "unstable from 1 to 1.03137 sites/s" in str(family)
    assert "no unstable wave was found" in str(predict(STIFF)["rarefaction"])
    curve = family.curve(speed=np.array([1.01, 1.02, 1.03, 1.04, 1.05]))
    axes = curve.plot(x="speed", y="energy")
    assert [line.get_linestyle() for line in axes.lines] == ["-", "--"]
    assert np.isfinite(axes.lines[0].get_ydata()).tolist() == [False] * 3 + [True] * 2
    assert axes.get_xlabel() == "speed [sites/s]"
    plt.close(axes.figure)
    with pytest.raises(TensegrityError, match="column 'sped'"):
        curve.plot(x="sped")


@pytest.mark.parametrize(("length", "stiffness", "mass"), [(1e-6, 1e3, 1e-9), (1e3, 1e-3, 1e4)])
def test_unstable_speeds_do_not_depend_on_units(length, stiffness, mass):
    eighth = stiffness * (R**2 / 2 + R**8 / 8 / length**6)
    potential = Potential(eighth, R)
    ((low, high),) = predict(potential, mass)["compression"].unstable(12)
    sound = potential.sound_speed(mass)
    assert [low / sound, high / sound] == pytest.approx([1, CRITICAL], rel=1e-10)


@pytest.mark.parametrize("prestrain", [0.01, 0.1, pytest.param(0.4, marks=pytest.mark.slow)])
def test_the_energy_of_waves_of_prisms_rises_with_their_speed(prestrain):
    families = predict(Prism(1.0, 0.7, prestrain, 1.0).potential()).families
    assert [family.name for family in families] == ["compression", "rarefaction"]
    assert [family.unstable(12) for family in families] == [(), ()]
    assert families[0].curve(4).stable.tolist() == [True] * 4


def front_on_wells():
    """Of the force u (u - 0.35)(u - 1) to the ground, coupling 1, dashpot 0.3."""
    wells = Potential(R**4 / 4 - sp.Rational(27, 20) * R**3 / 3 + sp.Rational(7, 40) * R**2, R)
    return transition_wave(Potential(R**2 / 2, R), ahead=0.0, behind=1.0, ground=wells,
                           damping=Damping(ground=0.3))  # fmt: skip


def test_a_front_is_neutral_to_its_shift_alone_and_the_rest_decays():
    """Its tangent map by SciPy, of variational equations that are written out."""
    front = front_on_wells()
    found = floquet(front)
    assert found.stable
    assert found.growth == 0
    assert found.neutral.shape == (1,)
    assert abs(found.neutral[0] - 1) < 1e-9
    sites = 101
    x = np.arange(sites) - 50.0
    bonds = np.eye(sites - 1, sites, 1) - np.eye(sites - 1, sites)
    coupled = bonds.T @ bonds

    def rates(t, y):
        u, v = y[: 2 * sites].reshape(2, sites)
        du, dv = y[2 * sites :].reshape(2, sites, -1)
        force = -coupled @ u - 0.3 * v - u * (u - 0.35) * (u - 1)
        slope = 3 * u**2 - 2.7 * u + 0.35
        change = -coupled @ du - 0.3 * dv - slope[:, None] * du
        return np.concatenate([v, force, dv.ravel(), change.ravel()])

    start = [front.displacement(x), -front.speed * front.rate(x), np.eye(2 * sites).ravel()]
    end = solve_ivp(rates, (0, 1 / front.speed), np.concatenate(start), method="DOP853",
                    rtol=1e-9, atol=1e-11).y[2 * sites :, -1]  # fmt: skip
    rows = end.reshape(2, sites, 2 * sites)
    moved = np.zeros_like(rows)
    moved[:, :-1] = rows[:, 1:]
    values = np.linalg.eigvals(moved.reshape(2 * sites, -1))
    assert np.abs(values - 1).min() < 1e-6
    for one in found.multipliers:
        assert np.abs(values - one).min() < 1e-5
    assert np.sum(np.abs(values) > 0.8) == 1


@pytest.mark.slow
def test_a_slow_front_takes_the_steps_that_its_dashpots_require():
    """It passes a site in 364 s, in which perturbations of bonds decay at up to 9/s."""
    wells = Potential(R**4 / 4 - sp.Rational(1499, 3000) * R**3 + sp.Rational(499, 2000) * R**2, R)
    front = transition_wave(Potential(2 * R**2, R), ahead=0.0, behind=1.0, ground=wells,
                            damping=Damping(ground=1.0, bond=1.0))  # fmt: skip
    found = floquet(front)
    assert found.stable
    assert found.neutral[0] == pytest.approx(1.0, abs=1e-9)


def test_a_struck_front_comes_back_to_itself_somewhat_shifted():
    front = front_on_wells()
    chain = Chain(front.potential, 240, ground=front.ground, damping=front.damping)
    start = front.launch(chain, at=80.0)
    v = start.v.copy()
    v[78:83] += 0.05
    run = simulate(chain, State(start.u, v), 60 / front.speed, tol=1e-9)
    x = np.arange(240.0)

    def off(shift):
        return float(np.abs(run.final.u - front.displacement(x - 140.0 - shift)).max())

    best = minimize_scalar(off, bounds=(-1, 1), method="bounded", options={"xatol": 1e-12})
    assert abs(best.x) > 1e-3
    assert best.fun < 1e-6


def test_a_real_multiplier_of_a_damped_front_is_near_the_partner_of_its_shift():
    """The tangent on a ring is conformally symplectic: the products of pairs are exp(-g/(m c))."""
    front = front_on_wells()
    partner = math.exp(-0.3 / front.speed)
    x = np.arange(-40.0, 41.0)
    chain = Chain(front.potential, len(x), ground=front.ground, damping=front.damping)
    flow = DrivenFlow(chain, 8, 1 / front.speed)
    rows = flow.tangents(front.displacement(x), -front.speed * front.rate(x), 1 / front.speed)[2]
    ring = np.roll(rows.reshape(2, len(x), -1), -1, axis=1).reshape(2 * len(x), -1)
    values = np.linalg.eigvals(ring)
    assert np.abs(values - 1).min() < 1e-9
    assert np.abs(values - partner).min() < 1e-9
    found = floquet(front).multipliers
    (real,) = found[found.imag == 0].real
    assert 1e-5 < abs(real - partner) < 1e-4


QUARTIC = 4 * R * (R - sp.Rational(1, 5)) * (R - 1)
BONDS = [(R + R**2 - R**3, 2 / 3, 0.0, 30), (QUARTIC, 1.3, 1.0, 50)]  # force, behind, dashpot


@pytest.mark.parametrize(("force", "behind", "dashpot", "half"), BONDS)
def test_a_front_of_bonds_is_neutral_to_its_shift_alone(force, behind, dashpot, half):
    """Its tangent map by SciPy, of variational equations of elongations and velocities."""
    damping = Damping(bond=dashpot)
    law = Potential(sp.integrate(force, R), R)
    front = transition_wave(law, ahead=0.0, behind=behind, damping=damping)
    found = floquet(front)
    assert found.stable
    assert abs(found.neutral - 1) == pytest.approx([0], abs=1e-6)
    x, around = np.arange(-half - 10, half + 11.0), 10
    tension, slope = (sp.lambdify(R, one) for one in (force, sp.diff(force, R)))
    n = len(x)
    bonds = np.eye(n - 1, n, 1) - np.eye(n - 1, n)

    def rates(t, y):
        r, v = y[: n - 1], y[n - 1 : 2 * n - 1]
        dr, dv = np.split(y[2 * n - 1 :].reshape(2 * n - 1, -1), [n - 1])
        force = tension(r) + dashpot * (bonds @ v)
        change = slope(r)[:, None] * dr + dashpot * (bonds @ dv)
        return np.concatenate([bonds @ v, -bonds.T @ force, (bonds @ dv).ravel(),
                               (-bonds.T @ change).ravel()])  # fmt: skip

    r, v = front.elongation(x[1:] - 0.5), -front.speed * front.rate(x)
    end = solve_ivp(rates, (0, 1 / front.speed), [*r, *v, *np.eye(2 * n - 1).ravel()],
                    method="DOP853", rtol=1e-8, atol=1e-10).y[2 * n - 1 :, -1]  # fmt: skip
    parts = np.split(end.reshape(2 * n - 1, -1), [n - 1])
    moved = np.vstack([np.vstack([one[1:], 0 * one[:1]]) for one in parts])
    inside = np.r_[around : n - 1 - around, n - 1 + around : 2 * n - 1 - around]
    values = np.linalg.eigvals(moved[np.ix_(inside, inside)])
    assert np.abs(values - 1).min() < 1e-6
    assert np.sum(np.abs(values) > 0.99) == 1
