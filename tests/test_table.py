"""Springs of tables: splines of measured tensions, and tables that are written piece by piece."""

import pickle

import numpy as np
import pytest
import sympy as sp
from hypothesis import Phase, given, settings
from hypothesis import strategies as st
from scipy.interpolate import CubicSpline, PchipInterpolator

from tensegrity import (
    Chain,
    LockingError,
    Potential,
    Record,
    ResolutionError,
    State,
    TensegrityError,
    dispersion,
    predict,
    read_curve,
    resume,
    simulate,
    solitary_wave,
)

R = sp.Symbol("r")
GRID = np.linspace(-1.0, 1.0, 21)
CUBIC = GRID + GRID**2 / 2 + GRID**3 / 5  # [N]
EXACT = Potential(R**2 / 2 + R**3 / 6 + R**4 / 20, R, domain=(-1, 1))
KINDS = ("cubic", "monotone", "linear", "smooth")
sizes = st.floats(-5, 2).map(lambda power: 10.0**power)  # of elongations [m]
strains = st.floats(-6, -1).map(lambda power: 10.0**power)
forces = st.floats(3, 8).map(lambda power: 10.0**power)  # EA [N]
seeds = st.integers(0, 2**32 - 1)


def bumpy(seed, count=21):
    """A table with a point (0, 0), of uneven spacings and tensions that need not rise."""
    rng = np.random.default_rng(seed)
    r = np.sort(rng.uniform(-1, 1, count) + 4 * np.arange(count))
    r = r - r[rng.integers(4, count - 4)]
    r /= np.abs(r).max()
    return r, np.where(r == 0, 0.0, np.sin(3 * r) + rng.normal(0, 0.1, count))


def test_the_spline_of_a_cubic_is_that_cubic():
    table = Potential.from_table(GRID, CUBIC)
    r = np.linspace(-0.999, 0.999, 501)
    for name in ("energy", "tension", "stiffness", "stiffness_slope"):
        np.testing.assert_allclose(getattr(table, name)(r), getattr(EXACT, name)(r), 0, 2e-14)
    assert table.kinks == ()
    runs, waves = [], []
    for spring in (table, EXACT):
        chain = Chain(spring, sites=30)
        runs.append(simulate(chain, chain.at_rest({0: 0.3}), 20, tol=1e-10).final)
        waves.append([solitary_wave(spring, speed_ratio=ratio) for ratio in (1.001, 1.1, 1.2)])
    assert np.abs(runs[0].u - runs[1].u).max() < 1e-10
    assert np.abs(runs[0].v - runs[1].v).max() < 1e-10
    for one, other in zip(*waves, strict=True):
        assert one.amplitude == pytest.approx(other.amplitude, rel=1e-10)
        assert one.energy == pytest.approx(other.energy, rel=1e-10)
    assert str(predict(table)) == str(predict(EXACT))
    wavenumbers = np.linspace(0, np.pi, 7)
    bands = [dispersion([spring], [1.0], wavenumbers) for spring in (table, EXACT)]
    np.testing.assert_allclose(*bands, atol=1e-10)


@settings(max_examples=60, deadline=None)
@given(seeds, st.sampled_from(KINDS[:3]), sizes, strains, forces)
def test_a_table_is_the_spline_of_scipy_at_all_scales(seed, kind, length, strain, stiffness):
    r, tension = bumpy(seed)
    size, force = length * strain, stiffness * strain
    spring = Potential.from_table(size * r, force * tension, kind, length=length)
    made = {"cubic": CubicSpline, "monotone": PchipInterpolator}.get(kind)
    exact = made(r, tension) if made else lambda x: np.interp(x, r, tension)
    x = np.linspace(*r[[0, -1]], 203)[1:-1]
    largest = np.abs(exact(x)).max()
    assert np.abs(spring.tension(size * x) / force - exact(x)).max() < 1e-11 * largest
    assert spring.energy(0.0) == 0
    gauss, weights = np.polynomial.legendre.leggauss(4)
    edges = np.unique(np.append(r, x))  # between these it is a polynomial
    half = np.diff(edges)[:, None] / 2
    work = np.sum(exact(edges[:-1, None] + half * (gauss + 1)) * weights * half, axis=1)
    stored = np.append(0, np.cumsum(work))
    stored = (stored - np.interp(0.0, edges, stored)) * size * force
    assert np.abs(spring.energy(size * edges) - stored).max() < 1e-11 * np.abs(stored).max()


@settings(max_examples=30, deadline=None)
@given(seeds, st.sampled_from(KINDS), sizes, strains, forces, st.booleans())
def test_a_tension_without_its_kinks_is_smooth(seed, kind, length, strain, stiffness, extrapolate):
    """A cubic through points on one side of a place goes through that on the other."""
    r, tension = bumpy(seed)
    size, force = length * strain, stiffness * strain
    spring = Potential.from_table(size * r, force * tension, kind, extrapolate=extrapolate)
    assert all(exponent >= 1 for _, _, exponent, _ in spring.kinks)
    assert len(spring.kinks) > 0

    def left(x):
        parts = (
            side * strength * np.maximum(side * (x - place), 0) ** exponent
            for place, strength, exponent, side in spring.kinks
        )
        return spring.tension(x) - sum(parts)

    h = 1e-3 * size
    ends = -size * 0.999, size * 0.999
    for place in {kink[0] for kink in spring.kinks}:
        if extrapolate or ends[0] < place < ends[1]:
            points = left(place + h * np.arange(-1, 4))
            scale = np.abs(spring.tension(size * r[1:-1])).max()
            assert abs(points @ [1, -4, 6, -4, 1]) < 1e-6 * scale


@settings(max_examples=12, deadline=None)
@given(seeds, st.sampled_from(KINDS), sizes, strains, forces)
def test_a_tolerance_is_kept_with_any_table(seed, kind, length, strain, stiffness):
    r, tension = bumpy(seed)
    size, force = length * strain, stiffness * strain
    spring = Potential.from_table(size * r, force * (tension + 4 * r), kind, extrapolate=True)
    chain = Chain(spring, 4, mass=1e-3, ends=("fixed", "fixed"))
    speed = size * np.sqrt(force / size / 1e-3)
    state = State(np.zeros(4), speed * np.array([0, 0.4, -0.3, 0]))
    end = 6 * size / speed
    coarse, fine = (simulate(chain, state, end, tol=tol) for tol in (1e-6, 1e-10))
    for name in ("u", "v"):
        gap = getattr(coarse.final, name) - getattr(fine.final, name)
        assert np.abs(gap).max() < 1.5e-6 * np.abs(getattr(fine, name)).max()


def written(r, tension, kind):
    """The energy of a table as a SymPy expression, piece by piece, 0 at the first well."""
    if kind == "linear":
        slopes, stored = np.diff(tension) / np.diff(r), [0.0]
        for k, slope in enumerate(slopes):
            h = r[k + 1] - r[k]
            stored.append(stored[-1] + tension[k] * h + slope * h * h / 2)
        rows = zip(stored, tension, slopes / 2, strict=False)
    else:
        spline = CubicSpline(r, tension).antiderivative()
        rows = spline.c[::-1].T
    zero = float(stored[list(r).index(0)] if kind == "linear" else spline(0.0))
    pieces = [
        (
            sum(float(c) * (R - float(x)) ** n for n, c in enumerate(row)) - zero,
            sp.Lt(R, float(end)),
        )
        for row, x, end in zip(rows, r, r[1:], strict=False)
    ]
    return sp.Piecewise(*pieces[:-1], (pieces[-1][0], True))


WELLS = np.array([-0.5, 0.0, 0.3, 1.0, 1.7, 2.0, 2.5])


@settings(max_examples=6, deadline=None, phases=[Phase.generate])
@given(st.sampled_from(["linear", "cubic"]), sizes, strains, forces, st.booleans(), seeds)
def test_round_off_where_a_written_table_meets_is_no_jump(kind, length, strain, ea, expand, seed):
    """Knots at rest, at a barrier and in a second well, where tensions or energies are 0."""
    size = length * strain
    tension = WELLS * (WELLS - 1) * (WELLS - 2) * ea * strain
    tension[[0, 2, 4, 6]] *= np.random.default_rng(seed).uniform(0.5, 1.5, 4)
    energy = written(size * WELLS, tension, kind)
    spring = Potential(sp.expand(energy) if expand else energy, R, domain=(-0.5 * size, 2.5 * size))
    assert all(exponent == (1 if kind == "linear" else 3) for _, _, exponent, _ in spring.kinks)
    table = Potential.from_table(size * WELLS, tension, kind)
    places = [{round(kink[0] / size, 9) for kink in one.kinks} for one in (spring, table)]
    assert places[0] == places[1]


def test_a_run_over_a_written_table_is_that_over_the_table():
    tension = WELLS * (WELLS - 1) * (WELLS - 2)
    runs = []
    for spring in (
        Potential(written(WELLS, tension, "linear"), R, domain=(-0.5, 2.5)),
        Potential.from_table(WELLS, tension, "linear"),
    ):
        chain = Chain(spring, 3, ends=("fixed", "fixed"))
        runs.append(simulate(chain, State(np.zeros(3), np.array([0, 0.2, 0])), 4.0, tol=1e-8))
    assert np.abs(runs[0].final.u - runs[1].final.u).max() < 1e-8 * np.abs(runs[0].u).max()


@pytest.mark.parametrize("part", [1e-6, 1e-8])
def test_small_jumps_are_still_refused(part):
    energy = written(GRID[::5], CUBIC[::5], "linear")
    moved = sp.Piecewise((energy.args[0][0] + part, R < -0.5), (energy, True))
    spring = Potential(moved, R, domain=(-1, 1))
    assert min(exponent for _, _, exponent, _ in spring.kinks) == -1


def test_noise_is_estimated_and_smoothed():
    exact, noises, r = lambda r: np.tanh(2 * r), [], np.linspace(-0.99, 0.99, 201)

    def springs(count, seed):
        x = np.linspace(-1, 1, count)
        tension = exact(x) + np.random.default_rng(seed).normal(0, 0.01, count)
        return [
            Potential.from_table(x, tension, **one)
            for one in ({"kind": "smooth"}, {"kind": "smooth", "noise": 0.01}, {})
            if one or count < 99
        ]

    for seed in range(25):
        noises += [spring.noise for spring in springs(201, seed)]
        *smoothed, raw = springs(61, seed)
        for spring in smoothed:
            assert np.sqrt(np.mean((spring.tension(r) - exact(r)) ** 2)) < 0.008
    assert np.mean(noises[::2]) == pytest.approx(0.01, rel=0.03)
    assert np.std(noises[::2]) < 0.0007  # 0.01/sqrt(2 * 200) of independent numbers, and no more
    assert np.mean(noises[1::2]) == pytest.approx(0.01, rel=0.03)
    for one, is_smooth in ((raw, False), (smoothed[0], True)):
        wrong = one.stiffness(0.9 * r) - 2 / np.cosh(1.8 * r) ** 2
        assert (np.abs(wrong).max() < 0.3) == is_smooth


def test_a_preload_moves_the_origin_to_the_state_that_carries_it():
    spring = Potential.from_table(GRID, CUBIC - 0.02, preload=0.1, length=2.0)
    rest = spring.length - 2.0
    assert EXACT.tension(rest) == pytest.approx(-0.08, rel=1e-12)
    assert spring.tension(0.0) == spring.energy(0.0) == 0
    r = np.linspace(-0.9, 1, 50)
    moved = EXACT.tension(rest + r) + 0.08
    np.testing.assert_allclose(spring.tension(r), moved, atol=1e-14)
    assert spring.domain == pytest.approx((-1 - rest, 1 - rest), abs=1e-15)
    assert solitary_wave(spring, speed_ratio=1.05).residual < 1e-12


def test_beyond_a_table_is_an_error_or_its_tangent():
    spring = Potential.from_table(GRID, CUBIC)
    with pytest.raises(
        LockingError, match="elongation 1 m is at or above 1 m, where the table ends"
    ):
        spring.tension(1.0)
    further = Potential.from_table(GRID, CUBIC, extrapolate=True)
    r = np.array([-3.0, -1.0, 1.0, 4.0])
    np.testing.assert_allclose(further.tension(r), [-1.9, -0.7, 1.7, 9.5], rtol=1e-13)
    np.testing.assert_allclose(further.stiffness(r[[0, 3]]), [0.6, 2.6], rtol=1e-13)
    v1 = 1 / 2 + 1 / 6 + 1 / 20
    assert further.energy(4.0) == pytest.approx(v1 + 1.7 * 3 + 2.6 * 9 / 2, rel=1e-13)


def test_tables_are_stored_and_compared_by_content(tmp_path):
    noisy = CUBIC + 0.01 * np.random.default_rng(2).normal(size=21)
    for kind in KINDS:
        more = {"kind": kind, "extrapolate": True, "length": 3.0}
        spring = Potential.from_table(GRID, noisy, **more)
        same = Potential.from_table(GRID[::-1].tolist(), noisy[::-1], **more)
        other = Potential.from_table(GRID, noisy + 1e-9 * np.sign(GRID), **more)
        assert spring == same == pickle.loads(pickle.dumps(spring)) != other
        assert hash(spring) == hash(same)
        assert spring.law == other.law  # one kernel
        chain = Chain(spring, 6)
        path = tmp_path / f"{kind}.npy"
        run = simulate(
            chain, chain.at_rest({0: 0.1}), 3.0, tol=1e-6, record=Record(path=path, checkpoint=0.0)
        )
        again = resume(path)
        assert again.scene == chain
        assert again.scene.springs[0].noise == spring.noise
        assert np.array_equal(again.u, run.u)


def test_a_measured_curve_becomes_a_spring(tmp_path):
    path = tmp_path / "spring.csv"
    rows = [f"{-1e3 * x:.9f},{-1e-3 * f:.12f}" for x, f in zip(GRID, CUBIC, strict=True)]
    path.write_text("\n".join(["Shortening (mm),Load (kN)", *rows]))
    shortening, load = read_curve(path, x="mm", y="kN")
    spring = Potential.from_table(-shortening, -load)
    assert spring.stiffness(0.0) == pytest.approx(1.0, rel=1e-9)


REFUSED = {
    "unsorted": (([-1, 0.5, 0, 1], [1, 2, 3, 4]), {}, "elongation 0 m follows 0.5 m"),
    "repeated": (([-1, 0, 0, 1], [1, 2, 3, 4]), {}, "elongation 0 m follows 0 m.* one tension"),
    "nan": (([-1, 0, np.nan, 1], [1, 2, 3, 4]), {}, "elongation is nan at index 2"),
    "nan in the tension": (([-1, 0, 1, 2], [1, 2, 3, np.inf]), {}, "tension is inf at index 3"),
    "too few": (([-1, 0, 1], [1, 2, 3]), {}, "points of a cubic table 3 must be at least 4"),
    "too many": ((np.arange(101) - 9, np.arange(101)), {}, "of a cubic table 101 must be .* 101"),
    "0 outside": (([1, 2, 3, 4], [1, 2, 3, 4]), {}, "from 1 m to 4 m must contain 0 m inside"),
    "0 at an end": (([0, 2, 3, 4], [1, 2, 3, 4]), {}, "must contain 0 m inside"),
    "lengths": (([-1, 0, 1, 2], [1, 2, 3]), {}, "must be of one length"),
    "noise": (([-1, 0, 1, 2], [1, 2, 3, 4]), {"noise": 0.1}, "noise 0.1 N of a cubic table"),
    "preload": (([-1, 0, 1, 2], [1, 2, 3, 4]), {"preload": 9.0}, "no tension -9 N"),
    "steep": (([-1, 0, 1e-9, 1], [0, 0, 1, 1]), {}, "has an error of"),
}


@pytest.mark.parametrize(("table", "more", "words"), REFUSED.values(), ids=REFUSED)
def test_a_table_that_is_none_is_refused_by_name(table, more, words):
    error = ResolutionError if words == "has an error of" else TensegrityError
    with pytest.raises(error, match=words):
        Potential.from_table(*table, **more)
