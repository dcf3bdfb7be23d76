"""Equilibrium paths against independent solutions at 30 digits and more.

Two oracles know nothing of the unknowns in which the paths are computed.  The scalar one: at
given twist, equilibrium fixes the ratios of the force densities, so that all natural lengths
meet in one equation of one force density.  The plain one: gradient and Hessian of U(side, phi, h).
"""

import math
from dataclasses import replace

import mpmath
import numpy as np
import pytest
import sympy as sp
from hypothesis import given, settings
from hypothesis import strategies as st

from derivations import prism as derived
from tensegrity import Prism, TensegrityError, equilibrium_path
from tensegrity.branches.continuation import Settings
from tensegrity.branches.problem import trace
from tensegrity.prisms import problem as prism_problem
from tensegrity.prisms.equations import kind_of, numbers, problem

INF = math.inf
DIGITS = 50

PRISMS = {
    "thick, strong prestrain": (1.0, 0.5, 0.4, 1.0, 2.0, 20.0),
    "thickest": (1.0, 0.3, 1e-2, 1.0, 50.0, 300.0),
    "fold before contact": (1.0, 0.6, 0.05, 1.0, 3.0, 3.0),
    "stiff": (2.0, 1.0, 1e-3, 3.0, 1e8, 1e8),
    "stiff bars": (1.0, 0.45, 1e-4, 1.0, 10.0, 1e6),
    "stiff bases": (1.0, 0.35, 0.2, 2.0, 1e5, 10.0),
    "slender": (1.0, 3.0, 1e-4, 1.0, 2.0, 1.0),
    "contact": (1.0, 1.0, 0.1, 1.0, 5.0, 50.0),
}
SMOOTH = {name: p for name, p in PRISMS.items() if name != "contact"}
coordinates = (derived.base, derived.twist, derived.height)
constants = (derived.k_cross, derived.k_base, derived.k_bar, derived.natural_cross,
             derived.natural_base, derived.natural_bar)  # fmt: skip


def plain(expression):
    return sp.lambdify((*coordinates, *constants), expression, "mpmath", cse=True)


@pytest.fixture(scope="module")
def gradient():
    return plain([sp.diff(derived.energy(), x) for x in coordinates])


@pytest.fixture(scope="module")
def hessian():
    return plain(sp.hessian(derived.energy(), coordinates))


@pytest.fixture(scope="module")
def natural():
    symbols = (derived.base, derived.reference_height, derived.prestrain, derived.k_cross,
               derived.k_base, derived.k_bar)  # fmt: skip
    return sp.lambdify(symbols, derived.natural_lengths(), "mpmath")


@pytest.fixture(scope="module")
def scalar():
    """Force densities (base, bar) per that of the cross strings, at given twist."""
    x1, x2, x3 = sp.symbols("x_1 x_2 x_3")
    members = [
        (derived.cross_length_squared(), 3 * x1),
        (derived.base**2, 6 * x2),
        (derived.bar_length_squared(), 3 * x3),
    ]
    balance = [sum(x * sp.diff(squared, q) / 2 for squared, x in members) for q in coordinates[:2]]
    solution = sp.solve(balance, [x2, x3])
    ratios = [sp.simplify(solution[x] / x1) for x in (x2, x3)]
    return sp.lambdify(derived.twist, ratios, "mpmath")


def load_at_twist(scalar, natural, fields, twist, height):
    """The load at given twist, near a given height, from one equation of one force density."""
    base, h0, p0, k1, k2, k3 = (mpmath.mpf(x) for x in fields)
    cross_n, base_n, bar_n = natural(base, h0, p0, k1, k2, k3)
    twist = mpmath.mpf(twist)
    per_base, per_bar = scalar(twist)

    def lengths(x):
        return (
            cross_n / (1 - x / k1),
            base_n / (1 - x * per_base / k2),
            bar_n / (1 - x * per_bar / k3),
        )

    def compatible(x):
        s, side, b = lengths(x)
        return s**2 - b**2 - side**2 * (mpmath.cos(twist) - mpmath.sin(twist) / mpmath.sqrt(3))

    def load(x):
        _, side, b = lengths(x)
        h = mpmath.sqrt(b**2 - mpmath.mpf(2) / 3 * side**2 * (1 - mpmath.cos(twist)))
        return -3 * h * x * (1 + per_bar), h

    guess = -mpmath.mpf(height[1]) / (3 * mpmath.mpf(height[0]) * (1 + per_bar))
    return load(mpmath.findroot(compatible, (guess, guess * (1 + mpmath.mpf(10) ** -12))))


@pytest.mark.parametrize("name", PRISMS)
def test_load_at_prescribed_twist_is_exact(name, scalar, natural):
    """To 1e-11, plus what one unit in the last place of the twist changes the load."""
    fields = PRISMS[name]
    path = equilibrium_path(Prism(*fields))
    rows = [i for i in range(len(path)) if path.load[i] > 0][:: max(1, len(path) // 12)]
    assert len(rows) >= 8
    with mpmath.workdps(DIGITS):
        for i in rows:
            if path.height[i] == 0 or path.twist[i] >= math.pi - 1e-15:
                continue
            near = float(path.height[i]), float(path.load[i])
            twist = float(path.twist[i])
            load, height = load_at_twist(scalar, natural, fields, twist, near)
            step = mpmath.mpf(twist) * 2.0**-52
            moved, lower = load_at_twist(scalar, natural, fields, twist + step, near)
            assert abs(path.load[i] - load) <= 1e-11 * abs(load) + 4 * abs(moved - load)
            assert abs(path.height[i] - height) <= 1e-11 * height + 4 * abs(lower - height)


@pytest.mark.parametrize("name", PRISMS)
def test_every_row_is_in_equilibrium(name, natural, gradient):
    """dU/dl = dU/d phi = 0 and load = -dU/dh, found again by Newton at 50 digits from the row."""
    fields = PRISMS[name]
    path = equilibrium_path(Prism(*fields))
    with mpmath.workdps(DIGITS):
        numbers = [mpmath.mpf(x) for x in fields]
        given = (*numbers[3:], *natural(*numbers))
        for i in range(0, len(path), max(1, len(path) // 8)):
            h = mpmath.mpf(float(path.height[i]))
            if h == 0:
                continue
            side, phi = mpmath.findroot(
                lambda side, phi, h=h: gradient(side, phi, h, *given)[:2],
                (float(path.base[i]), float(path.twist[i])),
                tol=1e-60,
            )
            load = -gradient(side, phi, h, *given)[2]
            close = -gradient(*mpmath.findroot(
                lambda side, phi, h=h: gradient(side, phi, h * (1 + mpmath.eps**0.5), *given)[:2],
                (side, phi), tol=1e-60), h * (1 + mpmath.eps**0.5), *given)[2]  # fmt: skip
            condition = abs((close - load) / mpmath.eps**0.5)  # |h dF/dh|
            assert abs(path.base[i] - side) <= 1e-13 * side
            assert abs(path.load[i] - load) <= 1e-13 * (abs(load) + condition)


@pytest.mark.parametrize("name", SMOOTH)
def test_fold_agrees_with_a_singular_hessian_at_fifty_digits(name, natural, gradient, hessian):
    fields = PRISMS[name]
    path = equilibrium_path(Prism(*fields), past_contact=True)
    folds = [e for e in path.events if e.kind == "fold"]
    assert folds
    with mpmath.workdps(DIGITS):
        numbers = [mpmath.mpf(x) for x in fields]
        given = (*numbers[3:], *natural(*numbers))
        for fold in folds:

            def system(side, phi, h):
                matrix = hessian(side, phi, h, *given)
                return [*gradient(side, phi, h, *given)[:2], mpmath.det(matrix) / matrix[0, 0]]

            start = (fold.base, fold.twist, fold.height)
            state = mpmath.findroot(system, start, tol=1e-50)
            load = -gradient(*state, *given)[2]
            assert abs(fold.load - load) <= 1e-12 * abs(load)
            for computed, exact in zip(start, state, strict=True):
                assert abs(computed - exact) <= 1e-10 * abs(exact)


@pytest.mark.parametrize("name", PRISMS)
@pytest.mark.parametrize("past_contact", [False, True])
def test_stability_is_that_of_the_plain_hessian(name, past_contact, natural, hessian):
    """Positive definite in (side, phi, h) under given load, in (side, phi) under given height."""
    fields = PRISMS[name]
    path = equilibrium_path(Prism(*fields), past_contact=past_contact)
    with mpmath.workdps(DIGITS):
        numbers = [mpmath.mpf(x) for x in fields]
        given = (*numbers[3:], *natural(*numbers))
        for i in range(0, len(path) - 1, 5):
            state = [mpmath.mpf(float(x[i])) for x in (path.base, path.twist, path.height)]
            matrix = hessian(*state, *given)
            by_load = min(mpmath.eigsy(matrix, eigvals_only=True))
            by_height = min(mpmath.eigsy(matrix[:2, :2], eigvals_only=True))
            if abs(by_load) > 1e-6:
                assert path.stable_load[i] == (by_load > 0)
            assert path.stable_height[i] == (by_height > 0)


def test_loss_of_stability_under_load_is_the_fold():
    path = equilibrium_path(Prism(*PRISMS["thick, strong prestrain"]))
    (fold,) = (e for e in path.events if e.kind == "fold")
    assert path.stable_load[: fold.row + 1].all()
    assert not path.stable_load[fold.row + 1 :].any()
    assert path.stable_height.all()


# --- events ----------------------------------------------------------------------------------


def kinds(path):
    return [e.kind for e in path.events]


def test_path_ends_where_the_bars_meet_with_slack_cross_strings(natural):
    fields = PRISMS["contact"]
    path = equilibrium_path(Prism(*fields))
    (contact,) = path.events
    assert contact.kind == "contact"
    assert contact.twist == pytest.approx(math.pi, abs=1e-14)
    cross = math.sqrt(contact.height**2 + contact.base**2 / 3)
    assert cross == pytest.approx(Prism(*fields).natural_lengths().cross, rel=1e-14)
    assert path[-1]["load"] == contact.load
    assert "contact" in str(path)
    assert path.end == "the bars meet on the axis (twist pi)"


@pytest.mark.parametrize("height", [0.3, 0.42, 0.45, 0.47, 0.5])
@pytest.mark.parametrize("base", [0.1, 1.0, 3.0])
def test_thick_prism_goes_flat_at_height_and_load_exactly_zero(base, height):
    path = equilibrium_path(Prism(base, base * height, 0.1, 1.0, 1e5, 1e2))
    assert kinds(path) == ["fold", "flat"]
    assert path.events[-1].height == path.height[-1] == 0.0
    assert path.events[-1].load == path.load[-1] == 0.0


def test_mirror_fold_beyond_flat_is_left_alone():
    path = equilibrium_path(Prism(*PRISMS["thick, strong prestrain"]), past_contact=True)
    assert kinds(path) == ["fold", "flat"]
    assert path.height.min() == 0.0
    assert path.load.min() >= 0.0


def test_past_contact_goes_on_to_a_fold_and_says_so():
    prism = Prism(*PRISMS["contact"])
    path = equilibrium_path(prism, past_contact=True)
    assert kinds(path) == ["contact", "fold", "flat"]
    assert "strings carry compression" in str(path)
    before = equilibrium_path(prism)
    assert path.events[0].load == pytest.approx(before.events[0].load, rel=1e-14)


def test_base_strings_go_slack_in_tension_at_twist_two_thirds_pi(natural, gradient):
    fields = PRISMS["contact"]
    prism = Prism(*fields)
    path = equilibrium_path(prism, max_height=1.3)
    slack = path.events[0]
    lengths = prism.natural_lengths()
    assert kinds(path) == ["slack", "contact"]
    assert slack.twist == pytest.approx(2 * math.pi / 3, abs=1e-13)
    assert slack.base == pytest.approx(lengths.base, rel=1e-14)
    assert slack.height == pytest.approx(math.sqrt(lengths.bar**2 - lengths.base**2), rel=1e-13)
    assert slack.load == pytest.approx(-3 * (slack.height - lengths.cross), rel=1e-12)


def test_beyond_slack_the_prism_without_base_strings_is_in_equilibrium(natural, gradient, hessian):
    fields = PRISMS["contact"]
    path = equilibrium_path(Prism(*fields), max_height=1.3)
    slack = path.events[0]
    beyond = path[: slack.row]
    assert len(beyond) > 100
    assert (beyond.height > slack.height).all()
    with mpmath.workdps(DIGITS):
        numbers = [mpmath.mpf(x) for x in fields]
        given = (numbers[3], mpmath.mpf(0), numbers[5], *natural(*numbers))
        for row in list(beyond)[::20]:
            state = [mpmath.mpf(float(row[x])) for x in ("base", "twist", "height")]
            slopes = gradient(*state, *given)
            assert max(abs(x) for x in slopes[:2]) <= 1e-13
            assert abs(slopes[2] + row["load"]) <= 1e-13
            assert min(mpmath.eigsy(hessian(*state, *given), eigvals_only=True)) > 0
    assert beyond.stable_load.all()


@pytest.mark.parametrize("k_bar", [50.0, INF])
def test_rigid_bases_do_not_go_slack(k_bar):
    prism = Prism(1.0, 1.0, 0.1, 1.0, INF, k_bar)
    path = equilibrium_path(prism, max_height=1.2)
    assert path.twist[0] < 2 * math.pi / 3
    assert kinds(path) == ["contact"]


def test_smooth_energy_keeps_base_strings_in_compression_instead():
    prism = Prism(*PRISMS["contact"])
    path = equilibrium_path(prism, max_height=1.3, past_contact=True)
    (slack,) = (e for e in path.events if e.kind == "slack")
    assert (path.twist[: slack.row] < 2 * math.pi / 3).all()
    assert (path.base[: slack.row] < prism.natural_lengths().base).all()


def test_tension_side_ends_where_the_bars_stand_upright():
    prism = Prism(*PRISMS["contact"])
    path = equilibrium_path(prism, max_height=100.0)
    assert path.height[0] == prism.natural_lengths().bar
    assert path.base[0] == 0.0
    assert "upright" in path.begin


@pytest.mark.parametrize("stiffness", [(10.0, 30.0), (INF, 30.0), (10.0, INF), (INF, INF)])
def test_without_prestrain_the_path_starts_slack(stiffness):
    path = equilibrium_path(Prism(1.0, 0.8, 0.0, 1.0, *stiffness))
    assert kinds(path)[0] == "slack"
    assert path.events[0].row == 0
    assert kinds(path)[-1] == "contact"
    assert path.load[0] == 0
    assert (path.load[1:] > 0).all()
    assert path.stable_load[0]  # no stiffness, but the least energy
    assert "without prestrain" in str(path)


def test_contact_within_the_first_step_is_found():
    p = numbers(Prism(*PRISMS["contact"]))
    whole = trace(problem(), np.zeros(4), p, direction=-1, stop=("contact",))
    near = 0.99 * whole.z[-1] + 0.01 * whole.z[-2]
    late = trace(problem(), near, p, Settings(first=0.1), -1, ("contact",))
    assert len(late) == 2
    assert late.events[0].load == pytest.approx(whole.events[0].load, rel=1e-13)


@pytest.mark.parametrize("largest", [0.5, 3.0])
def test_steps_far_too_coarse_are_shortened_to_the_same_events(monkeypatch, largest):
    coarse = Settings(tolerance=1e4, first=largest, largest=largest, turn=1.5)
    for fields in PRISMS.values():
        path = equilibrium_path(Prism(*fields))
        with monkeypatch.context() as patch:
            patch.setattr(prism_problem, "SETTINGS", coarse)
            rough = equilibrium_path(Prism(*fields))
        assert len(rough) < len(path) / 3
        assert kinds(rough) == kinds(path)
        for one, other in zip(path.events, rough.events, strict=True):
            assert one.load == pytest.approx(other.load, rel=1e-10)


# --- bounds ----------------------------------------------------------------------------------

MODELS = {
    "elastic": (5.0, 50.0),
    "rigid bases": (INF, 50.0),
    "rigid bars": (5.0, INF),
    "rigid": (INF, INF),
}


@pytest.mark.parametrize("model", MODELS)
def test_path_ends_at_the_bounds_asked_for(model):
    prism = Prism(1.0, 1.0, 0.1, 1.0, *MODELS[model])
    path = equilibrium_path(prism, min_height=0.97)
    assert path.height[-1] == pytest.approx(0.97, rel=1e-14)
    assert kinds(path) == []
    path = equilibrium_path(prism, max_load=0.5)
    assert path.load[-1] == pytest.approx(0.5, rel=1e-12)
    path = equilibrium_path(prism, max_height=1.05)
    assert path.height[0] == pytest.approx(1.05, rel=1e-14)
    assert path.load[0] < 0
    assert (np.diff(path.height) < 0).all()
    assert path.height[path.load == 0] == 1.0
    for column in path.columns.values():
        assert np.isfinite(column).all()


@pytest.mark.parametrize(
    ("bounds", "message"),
    [
        ({"min_height": -0.1}, "min_height -0.1 m must be at least 0"),
        ({"min_height": 1.0}, "min_height 1 m must be below the height 1 m"),
        ({"max_load": 0.0}, "max_load 0 N must be above 0"),
        ({"max_height": 1.0}, "max_height 1 m must be above 1"),
        ({"max_height": math.nan}, "max_height nan is not finite"),
        ({"max_load": "much"}, "max_load 'much' is not a number"),
    ],
)
@pytest.mark.parametrize("model", ["elastic", "rigid"])
def test_bad_bounds_are_refused_by_name(model, bounds, message):
    with pytest.raises(TensegrityError, match=message):
        equilibrium_path(Prism(1.0, 1.0, 0.1, 1.0, *MODELS[model]), **bounds)


def test_what_is_no_prism_is_named_before_what_its_path_may_not_have():
    with pytest.raises(TensegrityError, match="prism 'tower' is not a Prism"):
        equilibrium_path("tower", branch="symmetric")


def test_rigid_prism_cannot_go_past_contact():
    with pytest.raises(TensegrityError, match="past_contact=True needs elastic"):
        equilibrium_path(Prism(1.0, 1.0, 0.1, 1.0), past_contact=True)


# --- rigid members as limits -----------------------------------------------------------------


def test_rigid_path_is_finite_up_to_a_contact_of_infinite_load():
    prism = Prism(1.0, 0.7, 0.01, 1.0)
    path = equilibrium_path(prism)
    (contact,) = path.events
    assert contact.load == INF
    assert contact.height == pytest.approx(prism.locking_height(), rel=1e-15)
    assert contact.twist == pytest.approx(math.pi, abs=1e-15)
    assert np.isfinite(path.load).all()
    assert path.load[-1] > 1e3


def test_rigid_rows_keep_the_length_of_the_bars():
    prism = Prism(2.0, 1.4, 0.01, 1.0)
    path = equilibrium_path(prism, max_height=1.6)
    bar = np.sqrt(path.height**2 + 2 / 3 * path.base**2 * (1 - np.cos(path.twist)))
    assert np.allclose(bar, prism.natural_lengths().bar, rtol=4e-16 * 4)


def test_rigid_thick_prism_folds_where_its_stiffness_vanishes():
    prism = Prism(1.0, 0.25, 0.1, 1.0)
    path = equilibrium_path(prism)
    assert kinds(path) == ["fold", "flat"]
    fold = path.events[0]
    potential = prism.potential()
    assert abs(potential.stiffness(fold.height - prism.height)) < 1e-14
    assert path.load.max() <= fold.load


@pytest.mark.parametrize("member", ["both", "bars", "bases"])
def test_elastic_prism_tends_to_the_rigid_one_at_first_order_in_the_compliance(member):
    rigid = Prism(1.0, 0.7, 0.01, 1.0)
    exact = rigid.potential()
    height = 0.66
    stiff = 10.0 ** np.arange(3, 8)
    errors = []
    for k in stiff:
        k_base, k_bar = (INF if member == "bars" else k), (INF if member == "bases" else k)
        path = equilibrium_path(Prism(1.0, 0.7, 0.01, 1.0, k_base, k_bar), min_height=height)
        errors.append(abs(path.load[-1] + float(exact.tension(path.height[-1] - 0.7))))
    order = -np.polyfit(np.log(stiff), np.log(errors), 1)[0]
    assert order == pytest.approx(1.0, abs=0.01)


# --- units, table ----------------------------------------------------------------------------


def test_path_scales_with_its_units():
    one = equilibrium_path(Prism(1.0, 1.0, 0.1, 1.0, 5.0, 50.0))
    other = equilibrium_path(Prism(0.01, 0.01, 0.1, 2e5, 1e6, 1e7))
    assert np.allclose(other.height, 0.01 * one.height, rtol=1e-13)
    assert np.allclose(other.load, 2e3 * one.load, rtol=1e-13, atol=1e-11)
    assert np.allclose(other.events[0].load, 2e3 * one.events[0].load, rtol=1e-13)


def test_path_is_a_table(tmp_path):
    path = equilibrium_path(Prism(1.0, 1.0, 0.1, 1.0, 5.0, 50.0))
    assert path[0]["height"] == 1.0
    assert (path[2:5].load == path.load[2:5]).all()
    assert np.allclose(path.shortening, 1.0 - path.height, atol=0)
    assert path[:3].end == "end of the slice"
    path.to_csv(tmp_path / "path.csv")
    back = np.genfromtxt(tmp_path / "path.csv", delimiter=",", names=True)
    assert (back["load_N"] == path.load).all()
    assert back.dtype.names == (
        "height_m", "twist_rad", "base_m", "load_N", "shortening_m", "stable_load", "stable_height",
        "cross_tension_N", "base_tension_N", "bar_tension_N",
    )  # fmt: skip


def test_path_plots_itself_with_units():
    import matplotlib

    matplotlib.use("Agg")
    axes = equilibrium_path(Prism(1.0, 1.0, 0.1, 1.0, 5.0, 50.0)).plot()
    assert axes.get_xlabel() == "shortening [m]"
    assert axes.get_ylabel() == "load [N], compression > 0"


# --- any admissible prism --------------------------------------------------------------------


def powers(low, high):
    return st.floats(math.log10(low), math.log10(high)).map(lambda x: 10.0**x)


ADMISSIBLE = st.builds(
    Prism, st.just(1.0), powers(0.2, 3), powers(1e-6, 0.4), st.just(1.0), powers(1, 1e8),
    powers(1, 1e8),
)  # fmt: skip


def check_trace(prism, monkeypatch):
    path = equilibrium_path(prism, max_height=1.2 * prism.height)
    assert path.events[-1].kind in ("contact", "flat")
    assert all(np.isfinite(column).all() for column in path.columns.values())
    used = prism_problem.SETTINGS
    halved = replace(used, tolerance=used.tolerance / 16, largest=used.largest / 2)
    with monkeypatch.context() as patch:
        patch.setattr(prism_problem, "SETTINGS", halved)
        fine = equilibrium_path(prism, max_height=1.2 * prism.height)
    assert len(fine) > len(path)
    assert kinds(fine) == kinds(path)
    for one, other in zip(path.events, fine.events, strict=True):
        assert one.height == pytest.approx(other.height, rel=1e-10, abs=1e-15)
        assert one.load == pytest.approx(other.load, rel=1e-9, abs=1e-15)


@settings(max_examples=40, deadline=None)
@given(prism=ADMISSIBLE)
def test_any_admissible_prism_traces_to_the_same_events_with_half_the_step(prism):
    check_trace(prism, pytest.MonkeyPatch())


@pytest.mark.slow
@settings(max_examples=500, deadline=None)
@given(prism=ADMISSIBLE)
def test_five_hundred_prisms_trace_to_the_same_events_with_half_the_step(prism):
    check_trace(prism, pytest.MonkeyPatch())


@settings(max_examples=40, deadline=None)
@given(prism=ADMISSIBLE)
def test_residual_is_round_off_at_every_row_of_any_admissible_prism(prism):
    of = problem(*kind_of(prism))
    start, stop = np.zeros(4 - kind_of(prism)[0]), ("flat", "contact")
    branch = trace(of, start, numbers(prism), prism_problem.SETTINGS, -1, stop)
    assert branch.residual.max() <= 1e-12
