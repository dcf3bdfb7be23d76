"""Waves, contacts and the junction against exact solutions and quadrature."""

import mpmath
import numpy as np
import pytest
import sympy as sp

from derivations import contact, junction, losses, waves

pytestmark = pytest.mark.unchanged()


def _values(expression, **values):
    """Numbers for symbols given by their names."""
    named = {str(s): s for s in expression.free_symbols}
    return expression.subs({named[k]: v for k, v in values.items() if k in named})


# --- lattice waves ---------------------------------------------------------------------------


def _toda_strain(gamma, x):
    """Exact travelling wave of V = e^-r + r - 1, m = 1, with c = sinh(k)/k, x in sites.

    exp(-r) - 1 = sinh^2(k) sech^2(k x); the tail decays like exp(-2 k x).
    """
    k = gamma / 2
    return -mpmath.log(1 + mpmath.sinh(k) ** 2 * mpmath.sech(k * x) ** 2)


def _nominal_gamma(decay):
    """The gamma of the speed, c = cs (1 + gamma^2/24), of the Toda wave of that decay rate."""
    return mpmath.sqrt(24 * (2 * mpmath.sinh(decay / 2) / decay - 1))


def _error(decay, x, orders):
    gamma = _nominal_gamma(decay) if orders == (2,) else decay
    toda = {"a": 1, "b": -1, "e": 1, "f": -1, "h_0": 1}
    found = 0
    for order, profile in zip(orders, waves.profiles(), strict=False):
        found += gamma**order * mpmath.mpf(
            _values(profile, gamma=sp.Float(gamma, 40), x=sp.Float(x, 40), **toda).evalf(40)
        )
    return abs(found - _toda_strain(decay, x))


@pytest.mark.parametrize(("orders", "expected"), [((2,), 4), ((2, 4), 6), ((2, 4, 6), 8)])
@pytest.mark.parametrize("place", [0, 0.7, 2.0])
def test_error_orders_on_toda(orders, expected, place):
    with mpmath.workdps(40):
        decays = [mpmath.mpf(1) / 2**k for k in range(4, 8)]
        errors = [_error(d, place / d, orders) for d in decays]
        slope = np.polyfit(*(np.log([float(v) for v in w]) for w in (decays, errors)), 1)[0]
    assert slope == pytest.approx(expected, abs=0.02)


def test_terms_of_toda_are_those_of_its_soliton():
    """-log(1 + sinh^2(gamma/2) S) in powers of gamma."""
    a, b, e, f = waves.stiffness, waves.slope, waves.bend, waves.fifth
    toda = {a: 1, b: -1, e: 1, f: -1, waves.sixth: 1}
    gamma, s = sp.symbols("gamma S")
    size = sp.series(sp.sinh(gamma / 2) ** 2, gamma, 0, 10).removeO() * s
    soliton = sp.expand(sum((-size) ** k / k for k in range(1, 5)))
    for n, coefficients in enumerate(waves.expansion(), 1):
        for k, one in enumerate(coefficients, 1):
            assert one.subs(toda) == soliton.coeff(gamma, 2 * n).coeff(s, k)


def test_toda_wave_solves_the_lattice_equation():
    with mpmath.workdps(40):
        decay = mpmath.mpf("0.8")
        c = 2 * mpmath.sinh(decay / 2) / decay

        def tension(x):
            return 1 - mpmath.exp(-_toda_strain(decay, x))

        for x in (mpmath.mpf(0), mpmath.mpf("0.3"), mpmath.mpf(2)):
            left = c**2 * mpmath.diff(lambda y: _toda_strain(decay, y), x, 2)
            assert abs(left - tension(x + 1) + 2 * tension(x) - tension(x - 1)) < 1e-15


def test_decay_and_speed_of_toda_waves():
    speed = waves.speed_of_decay()
    assert float(_values(speed, gamma=0.8)) == pytest.approx(2 * np.sinh(0.4) / 0.8, rel=1e-14)


def test_dispersion_is_that_of_a_ring_of_masses():
    sites, a, m = 12, 1.7, 0.6
    matrix = (
        a / m * (2 * np.eye(sites) - np.roll(np.eye(sites), 1, 0) - np.roll(np.eye(sites), -1, 0))
    )
    numbers = 2 * np.pi * np.arange(sites) / sites
    found = sorted(float(_values(waves.dispersion(), k=k, a=a, m=m)) for k in numbers)
    np.testing.assert_allclose(found, np.linalg.eigvalsh(matrix), atol=1e-13)


def test_tent_holds_the_whole_stroke_on_two_spacings():
    tent = sp.lambdify(waves.position, waves.tent().subs({waves.stroke: 0.2, waves.spacing: 0.5}))
    x = np.array([-0.9, -0.5, -0.25, 0.0, 0.25, 0.5, 0.9])
    np.testing.assert_allclose(tent(x), [0, 0, -0.2, -0.4, -0.2, 0, 0], atol=1e-15)


def test_largest_speed_is_that_of_two_masses_meeting():
    """Integrate one moving mass against one at rest through a stiff bond: it must just close."""
    from scipy.integrate import solve_ivp

    mass, stroke, k = 0.7, 0.3, 5.0  # the bond stores k d^2/2 when closed
    energy = k * stroke**2 / 2
    speed = float(_values(waves.largest_speed(), m=mass, d=stroke, V_lock=energy))

    def rate(_, y):
        force = k * (y[1] - y[0])
        return [y[2], y[3], force / mass, -force / mass]

    start = [0.0, 0.0, speed * stroke, 0.0]

    def closest(_, y):
        return y[2] - y[3]

    run = solve_ivp(rate, (0, 2.0), start, rtol=1e-10, atol=1e-12, events=closest)
    at_closest = run.y_events[0][0]
    assert at_closest[0] - at_closest[1] == pytest.approx(stroke, rel=1e-8)


# --- contact ---------------------------------------------------------------------------------


@pytest.mark.parametrize("place", [0.0, 0.4, 0.95])
def test_hertz_pressure_sinks_the_half_space_like_a_parabola(place):
    """Boussinesq's integral over the disc by quadrature, polar about its centre."""
    from scipy.special import ellipk

    def ring(s):
        """Potential at `place` of a ring of radius s: elliptic integral, log-singular."""
        total = s + place
        return 4 * s / total * ellipk(4 * s * place / total**2) * np.sqrt(1 - s * s)

    from scipy.integrate import quad

    pieces = [(0, place), (place, 1)] if place else [(0, 1)]
    value = sum(quad(ring, low, high, limit=200)[0] for low, high in pieces) / np.pi
    found = _values(contact.sinking(), A=1, p_m=1, rho=place)
    assert float(found) == pytest.approx(value, rel=1e-7)


def test_hertz_constant_of_two_materials():
    """4/3 E* sqrt(R*) of a steel and a PTFE bead, each with its own Poisson ratio."""
    e1, e2, nu1, nu2, r1, r2 = 193e9, 1.46e9, 0.30, 0.46, 2.38e-3, 4.0e-3
    plane = 1 / ((1 - nu1**2) / e1 + (1 - nu2**2) / e2)
    expected = 4 / 3 * plane * np.sqrt(1 / (1 / r1 + 1 / r2))
    given = {"E_i": e1, "E_j": e2, "nu_i": nu1, "nu_j": nu2, "r_i": r1, "r_j": r2}
    found = _values(contact.hertz_constant()[0], **given)
    assert float(found) == pytest.approx(expected, rel=1e-13)
    wall = _values(contact.wall_constant(), **given)
    assert float(wall) == pytest.approx(4 / 3 * plane * np.sqrt(r1), rel=1e-13)


@pytest.mark.parametrize("n", [sp.Rational(3, 2), sp.Integer(2), sp.Integer(3)])
def test_nesterenko_wave_solves_his_equation(n):
    """lambda xi = xi^n + n/24 ((n - 1) xi^(n-2) xi'^2 + 2 xi^(n-1) xi'') at some places."""
    lam, kappa, power = (
        x.subs({contact.exponent: n, contact.wave: 1}) for x in contact.nesterenko()
    )
    with mpmath.workdps(30):

        def xi(x):
            return mpmath.cos(mpmath.mpf(kappa.evalf(30)) * x) ** mpmath.mpf(power.evalf(30))

        n_, lam_ = mpmath.mpf(n.p) / n.q, mpmath.mpf(lam.evalf(30))
        for x in (mpmath.mpf("0.1"), mpmath.mpf("0.6")):
            value, slope, curve = (mpmath.diff(xi, x, k) for k in range(3))
            bracket = (n_ - 1) * value ** (n_ - 2) * slope**2 + 2 * value ** (n_ - 1) * curve
            assert abs(lam_ * value - value**n_ - n_ / 24 * bracket) < 1e-12


@pytest.mark.parametrize("n", [1.5, 2.0, 3.0])
def test_long_wave_equation_is_that_of_the_chain(n):
    """The force on a mass of a slowly strained chain, against the derivative of the long wave."""
    _, coefficients = contact.long_wave()
    p, q = (float(coefficients[k].subs(contact.exponent, n)) for k in ("p", "q"))
    errors = []
    for scale in (0.05, 0.025):
        with mpmath.workdps(30):

            def displacement(x, scale=scale):
                return -x - mpmath.sin(scale * x) / scale / 2  # xi = -u' = 1 + cos(scale x)/2

            def xi(x, scale=scale):
                return 1 + mpmath.cos(scale * x) / 2

            def long_wave(x, xi=xi):
                value, slope, curve = (mpmath.diff(xi, x, k) for k in range(3))
                return value**n * (1 + p * (slope / value) ** 2 + q * curve / value)

            x = mpmath.mpf(1) / scale
            behind = displacement(x - 1) - displacement(x)
            ahead = displacement(x) - displacement(x + 1)
            exact = behind**n - ahead**n
            errors.append(float(abs(exact + mpmath.diff(long_wave, x))))
    assert errors[0] < 1e-6
    assert np.log2(errors[0] / errors[1]) == pytest.approx(5, abs=0.2)


def test_effective_mass_by_quadrature():
    from scipy.integrate import trapezoid

    x = np.linspace(-np.pi / 2, np.pi / 2, 20001) / (np.sqrt(10) / 5)
    xi = np.cos(np.sqrt(10) / 5 * x) ** 4
    momentum, kinetic = trapezoid(xi, x), trapezoid(xi**2, x) / 2
    energy = kinetic * 9 / 5  # virial: 2 T = (n + 1) V
    assert float(contact.effective_mass()) == pytest.approx(momentum**2 / (2 * energy), rel=1e-6)


def test_the_loss_and_the_energy_of_a_wave_by_quadrature():
    from scipy.integrate import quad

    kappa, a = np.sqrt(10) / 5, 0.3
    c = np.sqrt(4 / 5 * np.sqrt(a))
    end = np.pi / 2 / kappa
    given = {"alpha": 1.0, "m": 1.0, "gamma": 1.0, "xi_m": a}
    lost, energy = (float(_values(x, **given)) for x in losses.loss_and_energy())

    def xi(x):
        return a * np.cos(kappa * x) ** 4

    def slope(x):
        return -4 * a * kappa * np.cos(kappa * x) ** 3 * np.sin(kappa * x)

    found = quad(lambda x: 1.5 * c * np.sqrt(xi(x)) * slope(x) ** 2, -end, end)[0]
    assert lost == pytest.approx(found, rel=1e-9)
    kinetic = quad(lambda x: c**2 * xi(x) ** 2 / 2, -end, end)[0]
    assert energy == pytest.approx(kinetic * 9 / 5, rel=1e-9)
    by_step = [float(losses.amplitude().subs({
        losses.first: a, losses.time: 0.1, contact.constant: 1, contact.mass: 1, losses.number: j,
    })) for j in (4.999, 5.001)]  # fmt: skip
    middle = np.mean(by_step)
    slope_here = (by_step[1] - by_step[0]) / 0.002
    assert slope_here == pytest.approx(-float(losses.rate()) * 0.1 * middle**1.25, rel=1e-6)


# --- junction --------------------------------------------------------------------------------


@pytest.mark.parametrize("half_angle", [0.2, 0.6, 1.2])
@pytest.mark.parametrize("count", [1, 2, 5])
def test_junction_keeps_momentum_and_energy(half_angle, count):
    values = {junction.half_angle: half_angle, junction.waves: count, junction.incident: 1.3}
    back, forth = (float(x.subs(values)) for x in junction.split())
    assert pytest.approx(-back + 2 * count * forth * np.cos(half_angle), rel=1e-14) == 1.3
    assert pytest.approx(back**2 + 2 * count * forth**2, rel=1e-14) == 1.3**2
    assert forth > 0


def test_reflection_ends_at_the_stated_half_angle():
    end = float(junction.no_reflection())
    back = junction.split()[0].subs({junction.waves: 1, junction.incident: 1})
    assert float(back.subs(junction.half_angle, end - 0.01)) > 0
    assert float(back.subs(junction.half_angle, end + 0.01)) < 0
