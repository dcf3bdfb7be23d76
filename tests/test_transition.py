"""Transition waves: closed forms, simulations, the balance of energy, and what is refused."""

import numpy as np
import pytest
import sympy as sp
from scipy.interpolate import CubicSpline
from scipy.optimize import minimize_scalar

from tensegrity import (
    Chain,
    Damping,
    Drive,
    Potential,
    Record,
    ResolutionError,
    TensegrityError,
    predict,
    simulate,
    transition_wave,
)
from tensegrity.waves.transition import standing_forces

U, A, B, K = sp.symbols("u a b k")


def two_wells(a, b=1.0):
    """Force b u (u - a)(u - 1)."""
    return Potential(B * U**2 * (3 * U**2 - 4 * (1 + A) * U + 6 * A) / 12, U, {"a": a, "b": b})


def linear(k):
    return Potential(K * U**2 / 2, U, {"k": k})


CONVEX_CONCAVE = Potential(U**2 / 2 + U**3 / 3 - U**4 / 4, U)
BOND = Damping(bond=0.5)
PHASES = Potential(4 * (U**4 / 4 - sp.Rational(2, 5) * U**3 + U**2 / 10), U)  # 4 r (r - 1/5)(r - 1)


def on_ground(a=0.35, b=1.0, k=1.0, g=0.3, ahead=0.0, behind=1.0, **more):
    given = {"ground": two_wells(a, b), "damping": Damping(ground=g)} | more
    return transition_wave(linear(k), ahead=ahead, behind=behind, **given)


@pytest.mark.parametrize(
    ("a", "b", "k", "g", "speed"),
    [(0.35, 1.0, 1.0, 0.3, 0.566415511169), (0.2, 1.0, 0.25, 0.5, 0.300790796527)],
)
def test_fronts_on_two_wells_move_as_in_a_simulation(a, b, k, g, speed):
    front = on_ground(a, b, k, g)
    assert front.speed == pytest.approx(speed, rel=1e-11)
    assert front.released == pytest.approx(b * (1 - 2 * a) / 12, rel=1e-14)
    assert front.residual < 1e-10
    assert front.momentum == pytest.approx(front.speed, rel=1e-12)
    chain = Chain(linear(k), 320, ground=two_wells(a, b), damping=Damping(ground=g))
    end = 60 / front.speed
    run = simulate(chain, front.launch(chain, at=110.0), end, tol=1e-10)
    at = np.arange(320) - 170.0
    np.testing.assert_allclose(run.final.u, front.displacement(at), rtol=0, atol=2e-10)
    velocity = -front.speed * front.rate(at)
    np.testing.assert_allclose(run.final.v, velocity, rtol=0, atol=2e-10)
    assert run.loss[-1] == pytest.approx(60 * front.released, rel=1e-8)
    found = []
    for place in 110 + np.arange(8) / 8:
        left = front.released * (place + 0.5)  # of the sites behind
        found.append(chain.energy(front.launch(chain, at=place)) + left)
    assert np.mean(found) == pytest.approx(front.energy, abs=1e-9)


def test_dashpots_in_bonds_and_a_prism_as_spring_do_as_well():
    from tensegrity import Prism

    spring = Prism(1.0, 0.7, 0.1, 1.0).potential()
    depth = 0.02  # m between the wells
    wells = Potential(two_wells(0.3).expression.subs(U, U / depth), U, {"a": 0.3, "b": 4e-4})
    damping = Damping(bond=0.4, ground=0.2)
    front = transition_wave(
        spring, 0.8, ahead=depth, behind=0.0, ground=wells.varied({"a": 0.7}), damping=damping
    )
    assert front.amplitude == -depth
    assert front.residual < 1e-9
    chain = Chain(spring, 240, 0.8, ground=wells.varied({"a": 0.7}), damping=damping)
    run = simulate(chain, front.launch(chain, at=100.0), 40.0, tol=1e-9)
    exact = front.displacement(np.arange(240) - 100 - front.speed * 40)
    np.testing.assert_allclose(run.final.u, exact, rtol=0, atol=1e-10)
    ends = np.array([[-1.5, -0.5], [-0.2, 0.8]])
    elongations = np.diff(front.displacement(ends))[:, 0]
    np.testing.assert_allclose(front.elongation(ends.mean(axis=1)), elongations, rtol=0, atol=1e-15)


@pytest.mark.slow
def test_a_front_of_little_damping_has_a_long_tail():
    front = on_ground(g=0.1)
    assert front.residual < 1e-10
    assert front.reach(1e-6) > 80
    chain = Chain(linear(1.0), 900, ground=two_wells(0.35), damping=Damping(ground=0.1))
    run = simulate(chain, front.launch(chain, at=400.0), 100.0, tol=1e-10)
    exact = front.displacement(np.arange(900) - 400 - front.speed * 100)
    np.testing.assert_allclose(run.final.u, exact, rtol=0, atol=1e-8)


def test_the_front_of_a_convex_concave_law_has_its_closed_speed():
    front = transition_wave(CONVEX_CONCAVE, ahead=0.0, behind=2 / 3)
    assert front.speed == pytest.approx(np.sqrt(11) / 3, rel=1e-13)
    step = 1e-3
    slope = np.diff(front.elongation([-step, step]))[0] / (2 * step)
    assert slope == pytest.approx(-0.234026389556, abs=1e-7)
    assert float(front.elongation(1.0)) == pytest.approx(0.129521051554, abs=1e-11)
    x = np.linspace(0, 8, 30)
    np.testing.assert_allclose(front.elongation(x) + front.elongation(-x), 2 / 3, rtol=1e-12)
    assert front.released == pytest.approx(0, abs=1e-14)
    chain = Chain(CONVEX_CONCAVE, 240)
    run = simulate(chain, front.launch(chain, at=80.0), 60.0, tol=1e-10)
    at = np.arange(239) + 0.5 - 80 - front.speed * 60
    near = np.abs(at) < 30
    found = np.diff(run.final.u)[near]
    np.testing.assert_allclose(found, front.elongation(at[near]), rtol=0, atol=1e-9)


@pytest.mark.parametrize(("a", "b"), [(1.0, 1.0), (-0.7, 0.4)])
def test_predict_names_the_front_in_which_a_family_ends(a, b):
    law = Potential(U**2 / 2 + A * U**3 / 3 - B * U**4 / 4, U, {"a": a, "b": b})
    family = predict(law)["rarefaction" if a > 0 else "compression"]
    state = 2 * a / (3 * b)
    assert family.crests[1] == pytest.approx(state, rel=1e-12)
    assert f"between fronts from 0 to {state:.9g} m (`transition_wave`)" in family.why
    front = transition_wave(law, ahead=0.0, behind=family.crests[1])
    assert front.speed == pytest.approx(family.speeds[1], rel=1e-12)
    assert front.speed**2 == pytest.approx(1 + 2 * a**2 / (9 * b), rel=1e-12)


@pytest.mark.parametrize("dashpot", [pytest.param(0.5, marks=pytest.mark.slow), 1.0])
def test_a_supersonic_front_has_the_speed_of_rankine_and_hugoniot(dashpot):
    front = transition_wave(PHASES, ahead=0.0, behind=1.3, damping=Damping(bond=dashpot))
    assert front.speed**2 == pytest.approx(1.32, rel=1e-14)
    assert front.family == "supersonic"
    assert front.residual < 1e-9  # the force at the seam is round-off
    found, row = pulled(float(1.3 * front.speed), dashpot, 300, 150, 0.65)
    assert found == pytest.approx(front.speed, rel=2e-5)
    at = np.arange(len(row), dtype=float)
    middle, near = crossing(at, row, 0.65), slice(150, 240)

    def wrong(shift):
        return float(np.abs(front.elongation(at - middle - shift) - row)[near].max())

    assert minimize_scalar(wrong, bounds=(-0.3, 0.3), method="bounded").fun < 2e-3


def crossing(x, values, level):
    """The first place at which sampled values cross a level."""
    k = int(np.flatnonzero(np.diff(values > level))[0])
    near = slice(k - 3, k + 5)
    roots = CubicSpline(x[near], values[near] - level).roots(extrapolate=False)
    return float(roots[np.argmin(np.abs(roots - x[k : k + 2].mean()))])


def pulled(pull, dashpot, sites, bond, level):
    """Speed between bonds from the end, `bond`/2 and `bond`, at which the front that a pull at
    constant speed causes passes, and the last row of elongations."""
    drive = {sites - 1: Drive(displacement=pull * sp.Symbol("t"))}
    chain = Chain(PHASES, sites, damping=Damping(bond=dashpot), drive=drive)
    times = np.arange(0.0, 2.0 * bond if pull < 1 else 1.2 * bond, 0.1)
    run = simulate(chain, chain.at_rest(), times[-1], dt=0.05, record=Record(times=times))
    rows = np.diff(run.u)[:, ::-1]
    passed = [crossing(times, rows[:, k], level) for k in (bond // 2, bond)]
    return bond / 2 / (passed[1] - passed[0]), rows[-1]


@pytest.mark.slow
def test_a_slower_pull_makes_a_front_as_fast_as_sound_ahead_of_it():
    """The elongation ahead, at the end of a rarefaction, is that whose sound speed the front has;
    such a front decays as slowly as the rarefaction spreads, and is not one of permanent form."""
    from scipy.optimize import fsolve

    pull, sound = 0.6, lambda r: np.sqrt(PHASES.stiffness(r))
    nodes, weights = np.polynomial.legendre.leggauss(20)

    def missed(states):
        ahead, behind = states
        rise = ahead / 2 * float(weights @ sound(ahead / 2 * (1 + nodes)))
        chord = np.diff(PHASES.tension([ahead, behind]))[0] / (behind - ahead)
        return [chord - sound(ahead) ** 2, rise + sound(ahead) * (behind - ahead) - pull]

    ahead, behind = fsolve(missed, [0.05, 1.1], xtol=1e-13)
    speed, row = pulled(pull, 0.5, 500, 200, 0.6)
    assert speed == pytest.approx(0.54214273, rel=1e-6)
    assert speed == pytest.approx(float(sound(ahead)), rel=1e-3)
    assert row[150] == pytest.approx(behind, abs=1e-4)
    with pytest.raises(TensegrityError):
        transition_wave(PHASES, ahead=ahead, behind=behind, damping=BOND)


def smoothed(width):
    """Tension r, less 1 above r = 1/2; the step is a hyperbolic tangent of this width."""
    energy = U**2 / 2 - B / 2 * sp.log((1 + sp.exp((2 * U - 1) / B)) / (1 + sp.exp(-1 / B)))
    return Potential(energy, U, {"b": width})


@pytest.mark.parametrize(
    ("width", "behind", "off"),
    [
        pytest.param(0.06, 1.85324708179, 0.0143, marks=pytest.mark.slow),
        (0.02, 1.7171220866, 0.0030),
    ],
)
def test_a_subsonic_front_of_bonds_approaches_the_closed_kinetic_relation(width, behind, off):
    """Of the bilinear bond, exact for any dashpot; a smooth step of 0.02 is as near as the grid
    resolves, and changes the state ahead by 0.003."""
    from scipy.integrate import quad

    def relation(c, dashpot):
        def integrand(k):
            bonds = 4 * np.sin(k / 2) ** 2
            return (
                bonds**2 * dashpot * c / abs(bonds * (1 - 1j * dashpot * c * k) - (c * k) ** 2) ** 2
            )

        return quad(integrand, 0, 400, limit=4000)[0] / np.pi

    assert relation(0.5, 0.5) == pytest.approx(0.520161659765, abs=1e-6)
    front = transition_wave(
        smoothed(width), ahead=0.353494993099, behind=behind, damping=Damping(bond=0.5)
    )
    c = front.speed
    ahead = 0.5 + relation(c, 0.5) - 1 / (2 * (1 - c**2))
    assert front.residual < 1e-6
    assert abs(ahead - front.ahead) == pytest.approx(off, abs=1e-4)


def test_what_pins_a_front_is_a_force_of_the_lattice():
    """Thresholds of a where one end of the range of forces is 0."""
    for k, a in ((0.1, 0.455129892000), (0.2, 0.494331052706)):
        low, high = standing_forces(linear(k), two_wells(a), 0.0, 1.0)
        assert low < 0
        assert high == pytest.approx(0, abs=1e-12)
        low, high = standing_forces(linear(k), two_wells(1 - a), 0.0, 1.0)
        assert low == pytest.approx(0, abs=1e-12)


def test_a_front_says_what_it_is():
    front = on_ground()
    text = str(front)
    for words in (
        "subsonic transition wave, speed 0.566416 sites/s = 0.566416 sound speeds",
        "ahead 0 m, behind 1 m",
        "released 0.025 J/site, width 6.811 sites from 5 % to 95 %",
        "energy 0.143251 J, momentum 0.566416 kg m/s, residual",
    ):
        assert words in text.replace("\n", ", ")
    assert "ransition wave" in front._repr_html_()
    ends = front.displacement([-0.5 * front.width(), 0.5 * front.width()])
    assert front.plot().get_ylabel() == "elongation [m]"
    assert ends[0] - ends[1] == pytest.approx(0.9, abs=0.01)
    assert front.shift == pytest.approx(1, rel=1e-12)
    half = front.width(0.25)
    assert 0 < half < front.width()
    assert abs(float(front.displacement(front.reach(1e-6)))) < 1e-6


def test_units_do_not_matter():
    """The same front in millimetres, grams and milliseconds: k A^2 m, each times its scale."""
    length, mass, time = 1e-3, 2e-3, 1e-4
    stiff = mass / time**2
    wells = Potential(two_wells(0.35).expression.subs(U, U / length), U,
                      {"a": 0.35, "b": stiff * length**2})  # fmt: skip
    front = transition_wave(
        linear(stiff), mass, ahead=0.0, behind=length, ground=wells,
        damping=Damping(ground=0.3 * mass / time),
    )  # fmt: skip
    assert front.speed * time == pytest.approx(0.566415511169, rel=1e-11)
    front = transition_wave(
        Potential(stiff * length**2 * CONVEX_CONCAVE.expression.subs(U, U / length), U), mass,
        ahead=0.0, behind=2 / 3 * length,
    )  # fmt: skip
    assert front.speed * time == pytest.approx(np.sqrt(11) / 3, rel=1e-12)


HELD = Chain(linear(1.0), 200, ends=("free", "fixed"), ground=two_wells(0.35))


@pytest.mark.parametrize(
    ("words", "make"),
    [
        ("released, -0.025 J/site, must be above 0", lambda: on_ground(ahead=1.0, behind=0.0)),
        ("radiates without damping", lambda: on_ground(damping=None)),
        ("no equilibrium of the ground: the next one is near 1.0", lambda: on_ground(behind=0.99)),
        ("at the state behind, 0.35 m, must be above 0", lambda: on_ground(behind=0.35)),
        ("it stands where each site is pushed with -0.0107473", lambda: on_ground(0.48, k=0.1)),
        (
            r"of 1e-09 N s/m to the ground .* at most [^ ]+e-06 J/site .* least the 0.025 J/site",
            lambda: on_ground(damping=Damping(ground=1e-9)),
        ),
        (
            r"of 0.001 N s/m to the ground .* Newton step, .*, must be below 1e-09",
            lambda: on_ground(damping=Damping(ground=1e-3)),
        ),
        ("one coefficient", lambda: on_ground(damping=Damping(ground=[0.1, 0.2]))),
        ("must differ", lambda: on_ground(behind=0.0)),
        (
            "the state behind a front must be 0.66666666666",
            lambda: transition_wave(CONVEX_CONCAVE, ahead=0.0, behind=0.6),
        ),
        (
            r"its speed 0.943398 sites/s, by Rankine and Hugoniot, must be above 1",
            lambda: transition_wave(CONVEX_CONCAVE, ahead=0.0, behind=-0.1),
        ),
        (
            "must be above 0",
            lambda: transition_wave(PHASES, ahead=0.0, behind=0.9, damping=BOND),
        ),
        (
            "released, -",
            lambda: transition_wave(PHASES, ahead=1.3, behind=0.0, damping=BOND),
        ),
        (
            "dashpots to the ground",
            lambda: transition_wave(PHASES, ahead=0.0, behind=1.3, damping=Damping(0.5, 0.1)),
        ),
        ("same springs to the ground", lambda: on_ground().launch(HELD, at=100.0)),
        ("direction -1 must be", lambda: on_ground().launch(HELD, at=100.0, direction=-1)),
        ("level", lambda: on_ground().width(0.6)),
    ],
)  # fmt: skip
def test_what_is_no_front_is_refused(words, make):
    with pytest.raises(TensegrityError, match=words):
        make()


@pytest.mark.slow
def test_a_front_too_sharp_for_the_grid_is_refused():
    with pytest.raises(ResolutionError, match="points do not resolve the front"):
        transition_wave(
            Potential(U**2 / 2 - sp.Max(0, U - sp.Rational(1, 2)), U),
            ahead=0.353494993099, behind=1.686828326432, damping=BOND,
        )  # fmt: skip


def test_the_picture_of_speeds_agrees_with_runs_and_ends_where_fronts_are_pinned():
    from figures import transition_speed as picture

    front = picture.front(0.25, 0.3, 0.7)
    assert picture.measured(0.25, 0.3, 0.7) == pytest.approx(front.speed, rel=1e-3)
    assert front.speed < picture.continuum(0.25, 0.3, 0.7) < 1.08 * front.speed
    assert picture.threshold(0.1) == pytest.approx(0.455129892, abs=1e-9)


@pytest.mark.slow
def test_a_struck_row_of_discs_switches_from_its_upper_wells_and_stops_at_a_defect():
    from figures import transition_switch as picture

    struck, back, stopped = (picture.run(*row) for row in picture.ROWS.values())
    ground = picture.unit(picture.TORQUE)
    high, low = picture.wells(ground)
    assert np.abs(ground.tension([high, low])).max() < 1e-14
    assert struck.u[0, 0] == pytest.approx(high, abs=1e-15)
    assert (struck.u[-1] > 0).all()
    assert struck.u[-1, :20] == pytest.approx(low, abs=1e-3)
    front = picture.front(picture.TORQUE, picture.DASHPOT)
    assert picture.measured(struck) == pytest.approx(front.speed, rel=2e-3)
    assert front.released == pytest.approx(
        float(ground.energy(high) - ground.energy(low)), rel=1e-9
    )
    assert back.u[-1] == pytest.approx(low, abs=1e-6)
    assert np.array_equal(stopped.u[-1] > 0, np.arange(picture.SITES) < picture.DEFECT)
    assert np.abs(stopped.v[-1]).max() < 1e-4
