"""Pair laws: bonds whose energy is a function of all coordinates of both ends."""

import math

import mpmath
import numpy as np
import pytest
import sympy as sp
from scipy.integrate import solve_ivp
from scipy.optimize import brentq

from tensegrity import (
    Chain,
    Damping,
    Force,
    Member,
    Network,
    PairLattice,
    PairLaw,
    Potential,
    Record,
    State,
    TensegrityError,
    Unit,
    bands,
    dispersion,
    gradient,
    modes,
    objective,
    simulate,
    solitary_wave,
)

B, KS, KT, INERTIA = 0.35, 0.01851, 3.835e-5, 1 / (4 * 1.815**2)
UNIT = u, a, U, A = sp.symbols("u a U A")
FIRST, SECOND = (u, a), (U, A)


def rotating(b=B, ks=KS, kt=KT):
    """Rigid units on hinges in a row: elongation, shear and bending of each hinge."""
    Ks, Kt = sp.symbols("Ks Kt")
    arm = 1 / (2 * sp.cos(b))
    along = U - u + arm * (2 * sp.cos(b) - sp.cos(b + a) - sp.cos(b + A))
    across = arm * (sp.sin(b + A) - sp.sin(b + a))
    energy = along**2 / 2 + Ks * across**2 / 2 + Kt * (a + A) ** 2 / 2
    return PairLaw(energy, FIRST, SECOND, {Ks: ks, Kt: kt}, site=2 * Kt * a**2)


def kresling(n=6, radius=1.0, twist=2 * math.pi / 9, height=1.8):
    """Creases of a Kresling unit between plates (u, phi), unstressed at this twist and height."""

    def crease(sign, rise, turn):
        chord = 2 * radius * sp.sin((twist + turn + sign * sp.pi / n) / 2)
        return sp.sqrt((height + rise) ** 2 + chord**2)

    energy = sum(n * (crease(s, U - u, A - a) - crease(s, 0, 0)) ** 2 / 2 for s in (1, -1))
    return PairLaw(energy, FIRST, SECOND)


ROTATING, KRESLING = rotating(), kresling()


def test_free_coordinates_are_found_by_their_shifts():
    assert ROTATING.free == (True, False)
    assert KRESLING.free == (True, True)
    hidden = PairLaw(
        sp.sin(U) * sp.cos(u) - sp.cos(U) * sp.sin(u) - sp.sin(U - u) + (U - u) ** 2, u, U
    )
    assert hidden.free == (True,)
    assert PairLaw((U - u) ** 2, u, U, site=1e-12 * u**2).free == (False,)


def closed_form(q, b=B, ks=KS, kt=KT, inertia=INERTIA):
    """Roots of the dispersion relation of rotating units, of which w^2 are two."""
    s, c, t = np.sin(q / 2), np.cos(q / 2), math.tan(b)
    stiff = ks * s**2 + 4 * kt * (1 + c**2)
    half = (4 * s**2 + (t**2 * c**2 + stiff) / inertia) / 2
    root = np.sqrt(half**2 - 4 * s**2 * stiff / inertia)
    return np.sqrt(np.stack([half - root, half + root], axis=1))


def test_dispersion_of_rotating_units_is_the_closed_form():
    q = np.linspace(0.3, 3.1, 8)
    found = dispersion(ROTATING, (1.0, INERTIA), q)
    assert found == pytest.approx(closed_form(q), rel=1e-12)
    t, slow = math.tan(B), 1e-6
    sound = math.sqrt(8 * KT / (t**2 + 8 * KT))
    assert dispersion(ROTATING, (1.0, INERTIA), [slow])[0, 0] / slow == pytest.approx(
        sound, rel=1e-9
    )
    gap = math.sqrt((t**2 + 8 * KT) / INERTIA)
    assert dispersion(ROTATING, (1.0, INERTIA), [0.0])[0] == pytest.approx([0.0, gap], rel=1e-12)


@pytest.mark.parametrize(
    ("phase", "frequencies"),
    [(0.5, (0.04915892716581, 1.381869996219)), (3.0, (0.4941065635784, 1.997334361032))],
)
def test_bands_of_rotating_units_are_those_of_two_other_computations(phase, frequencies):
    found = dispersion(ROTATING, (1.0, INERTIA), [phase])[0]
    assert found == pytest.approx(frequencies, rel=1e-10)


def test_a_row_of_two_different_pair_laws_has_the_branches_of_both_cells():
    other = rotating(kt=2 * KT)
    found = dispersion([ROTATING, other], [(1.0, INERTIA), (2.0, INERTIA)], [0.7])
    assert found.shape == (1, 4)
    alike = dispersion([ROTATING] * 2, [(1.0, INERTIA)] * 2, [0.8])[0]
    halves = closed_form(np.array([0.4, 0.4 + np.pi]))
    assert alike == pytest.approx(np.sort(halves.ravel()), rel=1e-11)


def test_modes_between_fixed_ends_are_waves_of_the_kresling_column():
    column = Chain(KRESLING, 9, mass=(1.0, 0.5), ends=("fixed", "fixed"))
    q = np.pi * np.arange(1, 8) / 8
    waves = np.sort(dispersion(KRESLING, (1.0, 0.5), q).ravel())
    assert modes(column, count=14).frequencies == pytest.approx(waves, rel=1e-11)


def test_struck_rotating_units_reach_the_peak_of_other_integrators():
    """DOP853 to 1e-13, and Yoshida's method of order 6 with a third code, in units.json."""
    chain = Chain(ROTATING, 120, mass=(1.0, INERTIA))
    start = chain.at_rest({0: (0.2, 0.0)})
    run = simulate(chain, start, 300.0, method="rkn6", dt=0.05, record=Record(interval=0.5))
    row = int(np.abs(run.u[:, 60, 1]).argmax())
    assert run.t[row] == 257.5
    assert abs(run.u[row, 60, 1]) == pytest.approx(0.0941316052752, rel=3e-11)
    assert chain.momentum(run.final) == pytest.approx([0.2], abs=1e-14)
    assert run.energy_error < 1e-11


def test_a_struck_kresling_column_is_that_of_other_tolerances():
    column = Chain(KRESLING, 150, mass=(1.0, 0.5))
    run = simulate(column, column.at_rest({0: (0.3, 0.0)}), 50.0, tol=1e-10)
    assert run.final.u[20] == pytest.approx((0.13035161745, -0.14030277467), rel=1e-8)
    assert column.momentum(run.final) == pytest.approx([0.3, 0.0], abs=1e-13)


@pytest.mark.parametrize(("method", "order"), [("verlet", 2), ("rkn6", 6), ("rk4", 4)])
def test_runs_converge_with_the_order_of_the_method(method, order):
    chain = Chain(ROTATING, 12, mass=(1.0, INERTIA))
    start = chain.at_rest({0: (0.2, 0.1)})
    coarse, middle, fine = (
        simulate(chain, start, 12.0, method=method, dt=0.2 / k).final.u for k in (1, 2, 4)
    )
    found = np.log2(np.abs(coarse - middle).max() / np.abs(middle - fine).max())
    assert found == pytest.approx(order, abs=0.5)


@pytest.mark.parametrize("pair", [ROTATING, KRESLING])
def test_forces_are_the_slope_of_the_energy_and_stiffness_that_of_the_forces(pair):
    chain = Chain(pair, 4, mass=(1.0, 0.3))
    place = 0.1 * np.random.default_rng(3).standard_normal(chain.shape)
    rest, h, stiffness = np.zeros(chain.shape), 1e-5, chain.stiffness(place).toarray()
    for k, each in enumerate(h * np.eye(place.size).reshape(-1, *chain.shape)):
        up, down = (chain.energy(State(place + x, rest)) for x in (each, -each))
        assert chain.forces(place).ravel()[k] == pytest.approx((down - up) / (2 * h), abs=1e-9)
        slope = (chain.forces(place - each) - chain.forces(place + each)).ravel() / (2 * h)
        assert stiffness[:, k] == pytest.approx(slope, abs=1e-8)


def test_each_site_has_its_whole_energy_whatever_its_bonds():
    """Sites of a star, of degree 1 and 3, turned by different angles without any other energy."""
    pair = PairLaw((U - u) ** 2 / 2, FIRST, SECOND, site=sp.sin(a) ** 2)
    places = np.eye(4, 2) + np.arange(8).reshape(4, 2)
    star = Network(places, [(0, 1), (0, 2), (0, 3)], pair, mass=(1.0, 1.0))
    angles = np.array([0.3, -0.2, 0.5, 0.1])
    place = np.stack([0 * angles, angles], axis=1)
    assert star.energy(State(place, 0 * place)) == pytest.approx(np.sum(np.sin(angles) ** 2))
    assert star.forces(place)[:, 1] == pytest.approx(-np.sin(2 * angles))


def test_steps_beyond_the_stiffness_that_is_reached_are_refused_or_made_finer():
    """The largest stiffness of V = cosh(q_j - q_i) grows with the difference."""
    pair = PairLaw(sp.cosh(10 * (U - u)) / 100 + (A + a) ** 2, FIRST, SECOND, site=a**4)
    chain = Chain(pair, 6, mass=(1.0, 1.0))
    start = chain.at_rest({0: (2.0, 0.0)})
    run = simulate(chain, start, 5.0)
    fastest = max(
        np.sqrt(np.linalg.eigvalsh(chain.stiffness(x).toarray()).max()) for x in run.u[::5]
    )
    assert fastest > 2 * np.sqrt(np.linalg.eigvalsh(chain.stiffness(0 * run.u[0]).toarray()).max())
    assert run.dt * fastest < 2
    assert run.energy_error < 1e-3
    with pytest.raises(TensegrityError, match="stability limit"):
        simulate(chain, start, 5.0, dt=1.9 / fastest)
    low, high = run.elongation_range[0]
    assert low < np.diff(run.u[..., 0], axis=1).min() + 1e-3
    assert high > np.diff(run.u[..., 0], axis=1).max() - 1e-3


def turning_squares(kt=0.01, beta=0.3):
    """Rigid squares on hinges, tilted by turns: each joined to those at its right and above it."""
    x, y, t, X, Y, T = sp.symbols("x y t X Y T")

    def hinge(d, s):
        def corner(e, turn):
            return sp.Matrix([sp.cos(e + turn), sp.sin(e + turn)])

        move = sp.Matrix([X - x, Y - y])
        move += corner(d + sp.pi - s * beta, T) - corner(d + sp.pi - s * beta, 0)
        move += corner(d + s * beta, 0) - corner(d + s * beta, t)
        energy = move.dot(move) / 2 + sp.Symbol("kt") * (T - t) ** 2 / 2
        return PairLaw(energy, (x, y, t), (X, Y, T), {"kt": kt})

    side = 2 * math.cos(beta)
    bonds = []
    for i in (0, 1):  # square 1 is to the right of square 0
        right, above = ((0, 0), (0, -1)) if i == 0 else ((1, 1), (1, 0))
        bonds += [
            (i, 1 - i, right, hinge(0, 1 - 2 * i)),
            (i, 1 - i, above, hinge(sp.pi / 2, 1 - 2 * i)),
        ]
    vectors = [[side, side], [side, -side]]
    return PairLattice(vectors, [[0, 0], [side, 0]], bonds, mass=(1.0, 1.0, 0.3))


def test_bands_of_rotating_squares():
    lattice = turning_squares()
    across, up = 1.0, 0.5  # phases from a square to the next
    found = bands(lattice, [[across + up, across - up], [0.0, 0.0]]).frequencies
    slow = 0.7775451585884, 0.8984573137737, 1.783176968521
    exact = *slow, 2.601795544538, 3.126132992068, 4.669021704199
    assert found[0] == pytest.approx(exact, rel=1e-11)
    s, c, j = math.sin(0.3), math.cos(0.3), 0.3
    gamma = (
        0,
        0,
        math.sqrt(8 * (s**2 + 0.01) / j),
        math.sqrt(8),
        math.sqrt(8),
        math.sqrt(8 * c**2 / j),
    )
    assert found[1] == pytest.approx(gamma, rel=1e-12)


def test_a_gradient_is_that_of_differences_for_places_velocities_inertias_and_parameters():
    place, speed = 0.1 * np.random.default_rng(4).standard_normal((2, 6, 2))
    masses = np.array([1.0, INERTIA]) * (1 + np.arange(6)[:, None] / 10)
    traces = objective.displacement(5, 1), objective.energy([1, 2])

    def found(ks=KS, masses=masses, place=place, method="verlet"):
        chain = Chain(rotating(ks=ks), 6, mass=masses)
        return gradient(traces, chain, State(place, speed), 5.0, dt=0.05, method=method)

    for method in ("verlet", "rkn6"):
        step, here = 1e-6, found(method=method)
        each = zip(
            here, found(KS + step, method=method), found(KS - step, method=method), strict=True
        )
        for one, up, down in each:
            slope = (up.value - down.value) / (2 * step)
            assert one.by("Ks").sum() == pytest.approx(slope, rel=1e-6)
        for site, axis in ((2, 0), (1, 1)):
            moved = np.zeros((6, 2))
            moved[site, axis] = step
            for name, field in (("masses", "mass"), ("place", "u")):
                start = {"masses": masses, "place": place}[name]
                both = [found(method=method, **{name: start + s * moved}) for s in (1, -1)]
                for one, up, down in zip(here, *both, strict=True):
                    slope = (up.value - down.value) / (2 * step)
                    assert getattr(one, field)[site, axis] == pytest.approx(
                        slope, rel=1e-5, abs=1e-8
                    )


H, F = sp.symbols("h f")


def kresling_unit():
    def crease(sign):
        return sp.sqrt(H**2 + 4 * sp.sin((F + sign * sp.pi / 6) / 2) ** 2)

    members = [Member(crease(sign), 1.0, 6) for sign in (-1, 1)]
    return Unit([F], H, members, rest={H: 1.8, F: 2 * math.pi / 9})


def test_a_column_of_a_unit_has_the_rarefaction_of_its_first_state_and_compression_at_its_second():
    unit = kresling_unit()
    column = Chain(unit.pair(sites=(H, F)), sites=270, mass=(1.0, 0.5))
    wave = solitary_wave(column, speed_ratio=1.003)
    assert wave.sound_speed == pytest.approx(3.4458474929526, rel=1e-12)
    assert wave.elongation(0.0) == pytest.approx((0.189619006139, 0.116295304143), rel=1e-10)
    assert wave.family == "rarefaction"
    state = wave.launch(column, 110.5)
    run = simulate(column, state, 40 / wave.speed, tol=1e-10)
    assert np.abs(run.final.u - wave.launch(column, 150.5).u).max() < 1e-9
    second = unit.about(unit.equilibria()[-1]).pair(sites=("h", "f"))
    wave = solitary_wave(Chain(second, 60, mass=(1.0, 0.5)), speed_ratio=1.01)
    assert wave.elongation(0.0) == pytest.approx((-0.0163943364845, -0.0340868878111), rel=1e-9)
    assert wave.family == "compression"


def test_inner_coordinates_of_a_unit_are_in_equilibrium_bond_by_bond():
    pair = kresling_unit().pair(sites=["h"])
    chain = Chain(pair, 2, mass=0.5)

    def slope(twist, height):
        return sum(
            (math.sqrt(height**2 + 4 * math.sin((twist + x) / 2) ** 2)
             - math.sqrt(1.8**2 + 4 * math.sin((2 * math.pi / 9 + x) / 2) ** 2))
            * math.sin(twist + x)
            / math.sqrt(height**2 + 4 * math.sin((twist + x) / 2) ** 2)
            for x in (math.pi / 6, -math.pi / 6)
        )  # fmt: skip

    for r in (-0.1, 0.05, 0.2):
        twist = brentq(slope, 0.3, 1.1, args=(1.8 + r,), xtol=1e-15)
        both = Chain(kresling(), 2, mass=1.0)
        exact = both.forces([[0, 0], [r, twist - 2 * math.pi / 9]])
        assert exact[1, 1] == pytest.approx(0, abs=1e-13)
        assert chain.forces([[0.0], [r]])[:, 0] == pytest.approx(exact[:, 0], rel=1e-11)
    near = [(chain.forces([[0], [x]])[0, 0]) for x in (0.1 - 1e-5, 0.1 + 1e-5)]
    slope_there = chain.stiffness([[0.0], [0.1]]).toarray()[1, 1]
    assert slope_there == pytest.approx((near[1] - near[0]) / 2e-5, rel=1e-8)
    with pytest.raises(TensegrityError, match="nan"):  # no equilibrium is found
        chain.energy(State([[0.0], [-1.5]], [[0.0], [0.0]]))


def test_sines_and_cosines_in_registers_are_those_of_many_digits():
    """Energies of potentials are computed in registers, several at once, like forces in a run; at
    arguments beyond 1e6 by the library."""
    r, x = sp.Symbol("r"), np.append(np.linspace(-9, 9, 2001), [1e-9, 3e5, -7e7])
    exact = [(float(mpmath.sin(y)), float(mpmath.cos(y) - 1)) for y in map(mpmath.mpf, x.tolist())]
    for of, values in zip((sp.sin(r), sp.cos(r) - 1), np.transpose(exact), strict=True):
        assert np.abs(Potential(of, r).energy(x) - values).max() < 1.2e-16


def test_parameters_have_derivatives_of_a_displacement_alone():
    def found(ks):
        chain = Chain(rotating(ks=ks), 8, mass=(1.0, INERTIA))
        start = chain.at_rest({0: (0.1, 0.0)})
        return gradient(objective.displacement(2, axis=1), chain, start, 5.0, dt=0.05)

    slope = (found(KS + 1e-5).value - found(KS - 1e-5).value) / 2e-5
    assert abs(slope) > 1
    assert found(KS).by("Ks").sum() == pytest.approx(slope, rel=1e-7)


def lossy(loss=0.1, pull=0.02, ks=KS, masses=(1.0, INERTIA)):
    """A row whose units turn against friction and a load, and move against dashpots."""
    c, load, t, v = sp.symbols("c load t v_y")
    turn = Force(
        (0, load * sp.sin(2 * t) - c * v * (1 + v**2)), parameters={"c": 0.01, "load": pull}
    )
    damping = Damping(ground=loss)
    return Chain(rotating(ks=ks), 6, mass=masses, forces=[turn], damping=damping)


def test_forces_and_dashpots_of_sites_act_on_each_of_their_coordinates():
    row, inertia = lossy(), np.array([1.0, INERTIA])
    start = row.at_rest({0: (0.1, 0.0), 3: (0.0, 0.2)})

    def rates(t, state):
        place, speed = state[:-1].reshape(2, 6, 2)
        force = row.forces(place) - 0.1 * speed
        turn = speed[:, 1]
        of_turn = 0.02 * math.sin(2 * t) - 0.01 * turn * (1 + turn**2)
        force[:, 1] += of_turn
        lost = 0.1 * np.sum(speed**2) - of_turn @ turn
        return [*speed.ravel(), *(force / inertia).ravel(), lost]

    begin = np.array([*start.u.ravel(), *start.v.ravel(), 0.0])
    exact = solve_ivp(rates, (0, 8), begin, "DOP853", rtol=1e-12, atol=1e-13).y[:, -1]
    for tol in (1e-4, 1e-8):
        run = simulate(row, start, 8.0, tol=tol)
        assert np.abs([*run.final.u.ravel(), *run.final.v.ravel()] - exact[:-1]).max() < tol
    assert run.energy_error < 1e-8
    assert run.loss[-1] == pytest.approx(exact[-1], rel=1e-8)

    def found(**changed):
        return gradient(objective.displacement(5, 1), lossy(**changed), start, 8.0, dt=0.05)

    here, step, masses = found(), 1e-5, np.tile(inertia, (6, 1))
    for name, value, slope in (
        ("ks", KS, here.by("Ks").sum()),
        ("pull", 0.02, here.by("load").sum()),
        ("loss", 0.1, here.by("ground").sum()),
    ):
        up, down = (found(**{name: value + x}).value for x in (step, -step))
        assert slope == pytest.approx((up - down) / (2 * step), rel=1e-6)
    one = step * np.eye(12)[7].reshape(6, 2)
    up, down = (found(masses=masses + x).value for x in (one, -one))
    assert here.mass[3, 1] == pytest.approx((up - down) / (2 * step), rel=1e-6)


def test_forces_of_coordinates_in_other_units_are_not_taken_to_be_stiffer():
    """A row in micrometres at the stiffness of steel has the motion of one in metres."""
    (v_x, v_y), found = sp.symbols("v_x v_y"), []
    for size, k in ((1.0, 1.0), (1e-6, 1e7), (100.0, 1e7)):
        energy = k * ((U - u) ** 2 / 2 + (U - u) ** 3 / (3 * size) + size**2 * (A - a) ** 2 / 2)
        pair = PairLaw(energy + k * size * (U - u) * (A - a) / 4, FIRST, SECOND)
        w = math.sqrt(k)
        drag = Force((-0.1 * w * v_x, -0.1 * w * size**2 * v_y * (1 + v_y**2 / k)))
        row = Chain(pair, 8, mass=(1.0, size**2), forces=[drag])
        start = row.at_rest({0: (0.05 * size * w, 0.0)})
        run = simulate(row, start, 6 / w, dt=0.05 / w, method="rk8")
        found.append(run.final.u / (size, 1.0))
    for other in found[1:]:
        assert other == pytest.approx(found[0], rel=1e-9, abs=1e-12)


def wrong():
    k = sp.Symbol("k")
    spring = (U - u) ** 2 / 2 + (A - a) ** 2 / 2
    pair, plain = PairLaw(spring, FIRST, SECOND), Potential(u**2, u)
    turning = PairLaw((A + a) ** 2, a, A)
    yield "no value for the parameter k", lambda: PairLaw(k * spring, FIRST, SECOND)
    yield (
        "must each name one symbol|each must name one",
        lambda: PairLaw(spring, FIRST, SECOND, {"c": 1.0}),
    )
    yield "coordinate a occurs in no energy", lambda: PairLaw((U - u) ** 2, FIRST, SECOND)
    yield "as many symbols", lambda: PairLaw(spring, FIRST, (U,))
    yield "is not a SymPy symbol", lambda: PairLaw(spring, (u, 1), SECOND)
    yield "must have 1 to 3", lambda: PairLaw(spring, sp.symbols("a:4"), sp.symbols("b:4"))
    yield "symbols .u, a. of `first`", lambda: PairLaw(spring, FIRST, SECOND, site=A**2)
    yield "must be smooth", lambda: PairLaw(sp.Abs(U - u) + a - A, FIRST, SECOND)
    yield "gradient -0.5 in u at rest", lambda: PairLaw(spring + (U - u) / 2, FIRST, SECOND)
    yield "not a finite number at rest", lambda: PairLaw(spring + 1 / (U - u), FIRST, SECOND)
    yield "rest 'b' is not one", lambda: PairLaw(spring, FIRST, SECOND, rest={"b": 1.0})
    yield "rest 3 must be a dict", lambda: PairLaw(spring, FIRST, SECOND, rest=3)
    yield "inertias of one site", lambda: Chain(pair, 5, mass=np.ones((5, 3)))
    yield "mass 0 of coordinate 1 of site 0", lambda: Chain(pair, 5, mass=(1.0, 0.0))
    yield "dashpots in bonds must not", lambda: Chain(pair, 5, damping=Damping(bond=0.1))
    yield (
        "a force on bonds must not",
        lambda: Chain(pair, 5, forces=[Force(sp.Symbol("rate"), "bonds")]),
    )
    yield "must be two of", lambda: Chain(pair, 5, ends=("free", "loose"))
    yield (
        "no coordinate of the pair law .a. is free",
        lambda: Chain(turning, 3).momentum(Chain(turning, 3).at_rest()),
    )
    yield "must have one form", lambda: Chain([pair, turning], 3)
    yield "not a PairLaw", lambda: Chain([pair, plain], 3)
    yield "lower number", lambda: Network([[0, 0], [1, 0]], [(1, 0)], pair)
    yield "sites have 3 coordinates", lambda: Network([[0, 0, 0], [1, 0, 0]], [(0, 1)], pair)
    yield (
        "have no tension",
        lambda: gradient(
            objective.load(bond=0), Chain(pair, 3), Chain(pair, 3).at_rest({0: (1, 0)}), 1.0, dt=0.1
        ),
    )
    yield "ground must not be given", lambda: dispersion(pair, 1.0, [1.0], ground=plain)
    yield "offset", lambda: PairLattice([[1.0]], [[0.0]], [(0, 0, (1, 2), pair)])
    yield "joins site 0 to itself", lambda: PairLattice([[1.0]], [[0.0]], [(0, 0, 0, pair)])
    yield "not a PairLaw", lambda: PairLattice([[1.0]], [[0.0]], [(0, 0, 1, plain)])
    yield "site of bond 0", lambda: PairLattice([[1.0]], [[0.0]], [(0, 1, 1, pair)])
    row = Chain(ROTATING, 30, mass=(1.0, INERTIA))
    yield "coordinate a of a column", lambda: solitary_wave(row, speed_ratio=1.1)
    unit = kresling_unit()
    yield "each must be one of f, h", lambda: unit.pair(["x"])
    yield "each must be one of f, h", lambda: unit.pair([H, H])
    rope = Unit([F], H, [Member(H + F, 1.0, string=True)], F**2 + (H - 1) ** 2, rest={H: 1, F: 0})
    yield "may slacken", lambda: rope.pair([H])
    stiff = Unit([F], H, [Member(H + F, sp.oo)], F**2 + (H - 1) ** 2, rest={H: 1, F: 0})
    yield "is rigid", lambda: stiff.pair([H])
    yield "must be one or more", lambda: PairLattice([[1.0]], [[0.0]], [])


@pytest.mark.parametrize("number", range(len(list(wrong()))))
def test_what_is_no_pair_law_is_refused(number):
    words, make = list(wrong())[number]
    with pytest.raises(TensegrityError, match=words):
        make()
