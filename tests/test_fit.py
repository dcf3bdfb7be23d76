"""Prisms fitted to curves: what is found, how sure it is, and what a curve cannot tell."""

import inspect
from dataclasses import replace

import numpy as np
import pytest
from scipy import stats

from tensegrity import EquilibriumError, Prism, TensegrityError, fit
from tensegrity.prisms.curve import Curve, traced_loads

STRONG = 2495.05288548
THIN = Prism.from_members(0.13, 0.08, 0.1623, STRONG / 0.13, STRONG / 0.08, 7.686e6 / 0.1623)
OFFSET = 2e-4
SHORTENING = np.linspace(0.0, 4.8e-3, 61)[1:] - OFFSET  # the prism's own up to 4.8 mm
LOAD = -THIN.potential().tension(-(SHORTENING + OFFSET))
NOISE = 0.01 * LOAD.max()


def noisy(seed):
    return LOAD + NOISE * np.random.default_rng(seed).standard_normal(60)


def test_clean_curve_gives_its_prism_back():
    start = Prism(THIN.base, THIN.height, 0.04, THIN.k_cross, 0.9 * THIN.k_base, THIN.k_bar)
    found = fit(SHORTENING, LOAD, start, noise=NOISE)
    assert found.prism.prestrain == pytest.approx(THIN.prestrain, rel=1e-7)
    assert found.prism.k_base == pytest.approx(THIN.k_base, rel=1e-8)
    assert found.offset == pytest.approx(OFFSET, rel=1e-7)


@pytest.mark.parametrize(
    "prism",
    [
        Prism(1.0, 1.0, 0.1, 2.0, 5.0, 50.0),
        Prism(1.0, 1.2, 0.1, 2.0, 5.0, 50.0, sides=5),
        Prism(1.0, 1.0, 0.1, 2.0, k_bar=50.0),
        Prism(1.0, 1.0, 0.1, 2.0, k_base=5.0),
    ],
)
def test_curve_and_its_derivatives_are_those_of_traced_branches(prism):
    x = np.linspace(-0.02, 0.15, 12)
    theta = np.array([0.1, 0.05, -0.1, 0.2, 1e-3])
    theta[:-1] *= np.isfinite(
        [getattr(prism, n) for n in ("prestrain", "k_cross", "k_base", "k_bar")]
    )
    curve = Curve(prism, x)
    found, slopes = curve(theta)

    def traced(t):
        return traced_loads(curve.prism_at(t), x + t[-1])

    assert np.abs(found - traced(theta)).max() < 1e-14 * found.max()
    for k in np.flatnonzero(theta):
        h = 1e-5 * np.eye(5)[k]
        difference = (traced(theta + h) - traced(theta - h)) / 2e-5
        assert np.abs(slopes[:, k] - difference).max() < 1e-7 * np.abs(slopes).max()
    with pytest.raises(TensegrityError, match="exceeds the range of this prism"):
        curve(np.array([0, 0, 0, 0, 2.0]))
    assert np.abs(curve(theta)[0] - found).max() < 1e-14 * found.max()


def test_errors_and_condition_are_those_of_the_reference():
    found = fit(SHORTENING, LOAD, THIN, noise=NOISE)
    assert found.errors["prestrain"] / found.values["prestrain"] == pytest.approx(0.051, rel=0.02)
    assert found.errors["k_base"] / found.values["k_base"] == pytest.approx(0.008, rel=0.02)
    assert found.errors["offset"] == pytest.approx(3.0e-5, rel=0.03)
    assert 10 < found.condition < 40


def test_curve_cannot_tell_strings_from_prestrain_nor_bars():
    found = fit(SHORTENING, LOAD, THIN, ("prestrain", "k_cross", "k_base"), noise=NOISE)
    assert found.correlation[0, 1] < -0.999
    assert found.errors["k_cross"] > found.values["k_cross"]
    words = " ".join(found.unidentified)
    assert "only the combination k_cross p0/(1 + p0) is known" in words
    assert "k_bar: doubling it" in words
    assert "not identified: k_bar" in str(found)


def test_file_of_two_columns_is_read(tmp_path):
    path = tmp_path / "curve.csv"
    np.savetxt(path, np.column_stack([SHORTENING, LOAD]), delimiter=",", header="shortening,load")
    found = fit(path, None, THIN)
    assert found.prism.prestrain == pytest.approx(THIN.prestrain, rel=1e-6)


def test_what_cannot_be_fitted_is_refused(tmp_path):
    for wrong, words in (
        (lambda: fit(SHORTENING[:3], LOAD[:3], THIN), "3 points are fewer than 4"),
        (lambda: fit(SHORTENING * 10, LOAD, THIN), "exceeds the range of this prism"),
        (lambda: fit(SHORTENING, LOAD[:5], THIN), "load has shape"),
        (lambda: fit(SHORTENING, LOAD, THIN, ("height",)), "must be one of prestrain"),
        (lambda: fit(SHORTENING, LOAD, Prism(1.0, 0.7, 0.1, 1.0)), "elastic members"),
        (lambda: fit(tmp_path / "none.csv", None, THIN), "none.csv cannot be read"),
    ):
        with pytest.raises(TensegrityError, match=words):
            wrong()


LINEAR = Prism(1.0, 0.7, 0.1, 2.0, k_bar=1e9)  # its loads are k_cross times a function
ALONG = np.linspace(0.002, 0.02, 8)
SLOPE = traced_loads(LINEAR, ALONG) / LINEAR.k_cross
SCATTERED = traced_loads(LINEAR, ALONG) + 0.002 * np.random.default_rng(3).standard_normal(8)


@pytest.mark.parametrize("noise", [None, 0.002])
def test_interval_and_band_of_a_linear_parameter_are_the_closed_ones(noise):
    found = fit(ALONG, SCATTERED, LINEAR, ("k_cross",), offset=False, noise=noise)
    value = SLOPE @ SCATTERED / (SLOPE @ SLOPE)
    size = noise or np.linalg.norm(SCATTERED - value * SLOPE) / np.sqrt(7)
    error = size / np.linalg.norm(SLOPE)
    for level in (0.5, 0.95):
        tail = (1 + level) / 2
        wide = error * (stats.t.ppf(tail, 7) if noise is None else stats.norm.ppf(tail))
        assert found.intervals(level)["k_cross"] == pytest.approx(
            (value - wide, value + wide), abs=2e-4 * wide
        )
    np.testing.assert_allclose(found.band(), error * SLOPE, rtol=1e-6)


def test_squares_of_the_band_add_up_to_a_noise_for_each_parameter():
    found = fit(SHORTENING, noisy(0), THIN)
    assert np.sum(found.band() ** 2) == pytest.approx(3 * found.noise**2, rel=1e-9)


@pytest.mark.parametrize("noise", [None, NOISE])
def test_band_drawn_is_that_of_95_percent(noise):
    few = slice(None, None, 10)
    found = fit(SHORTENING[few], noisy(0)[few], THIN, noise=noise)
    from matplotlib.figure import Figure

    axes = found.plot(Figure().add_subplot())
    shown = {one.get_label(): np.transpose(one.get_data()) for one in axes.lines}
    np.testing.assert_array_equal(shown["points"], np.transpose([found.shortening, found.load]))
    np.testing.assert_array_equal(np.sort(shown["fitted prism"][:, 1]), np.sort(found.computed()))
    assert axes.get_xlabel() == "shortening [m]"
    assert axes.get_ylabel() == "axial load [N], compression > 0"
    edge = axes.collections[0].get_paths()[0].vertices
    width = stats.t.ppf(0.975, 3) if noise is None else stats.norm.ppf(0.975)
    for x, y, band in zip(found.shortening, found.computed(), found.band(), strict=True):
        heights = edge[np.isclose(edge[:, 0], x, rtol=0, atol=1e-12), 1]
        assert (heights.min(), heights.max()) == pytest.approx((y - width * band, y + width * band))


@pytest.mark.parametrize(("name", "other"), [("prestrain", "k_base"), ("k_base", "prestrain")])
def test_fits_at_the_ends_of_an_interval_leave_more_by_student_s_quantile(name, other):
    few = slice(None, None, 4)
    x, y = SHORTENING[few], noisy(1)[few]
    found = fit(x, y, THIN)
    limit = np.sum(found.residuals**2) + (stats.t.ppf(0.975, 12) * found.noise) ** 2
    for end in found.intervals()[name]:
        there = fit(x, y, replace(found.prism, **{name: end}), (other,))
        assert np.sum(there.residuals**2) == pytest.approx(limit, rel=1e-3)


def test_interval_is_open_where_the_curve_sets_no_bound():
    found = fit(SHORTENING, noisy(0), THIN, ("prestrain", "k_base", "k_bar"), noise=NOISE)
    low, high = found.intervals()["k_bar"]
    assert 0 < low < THIN.k_bar
    assert high == np.inf
    rough = LOAD + 20 * NOISE * np.random.default_rng(1).standard_normal(60)
    found = fit(SHORTENING, rough, THIN, noise=20 * NOISE)
    assert found.intervals()["prestrain"] == (0.0, np.inf)


def test_interval_does_not_stop_at_a_parameter_that_ran_away():
    x = np.linspace(0.0, 0.1, 15)
    prism = Prism(1.0, 1.0, 0.1, 2.0, k_base=5.0)
    load = traced_loads(prism, x)
    load += 0.01 * load.max() * np.random.default_rng(1).standard_normal(15)
    found = fit(x, load, prism, ("prestrain", "k_cross", "k_base"))
    assert found.values["prestrain"] > 1e6
    true = fit(x, load, prism, ("prestrain", "k_base"))
    assert np.sum(true.residuals**2) < 1.2 * np.sum(found.residuals**2)
    low, high = found.intervals()["k_cross"]
    assert low < 2.0 < high


def test_fit_at_the_border_of_equilibria_has_no_interval():
    x, prism = np.linspace(0.0, 0.2, 15), Prism(1.0, 1.0, 0.1, 2.0, k_bar=50.0)
    found = fit(x, 0.5 * traced_loads(prism, x), prism, ("prestrain",), offset=False)
    with pytest.raises(EquilibriumError, match="at the border of prisms with equilibria"):
        found.intervals()


@pytest.mark.parametrize("offset", [True, False])
@pytest.mark.parametrize("noise", [None, NOISE])
@pytest.mark.parametrize("side", [1, -1])
def test_loads_of_the_wrong_sign_are_named(offset, noise, side):
    with pytest.raises(EquilibriumError, match=r"oppose .* compression must count as positive"):
        fit(side * SHORTENING, -side * noisy(0), THIN, offset=offset, noise=noise)


@pytest.mark.parametrize("noise", [None, NOISE])
def test_a_curve_with_both_signs_reversed_is_named(noise):
    with pytest.raises(EquilibriumError, match=r"with both signs reversed .* must count as posit"):
        fit(-SHORTENING, -noisy(0), THIN, noise=noise)


def test_a_curve_of_extension_is_fitted_as_it_is():
    x = np.linspace(-3e-3, -1e-4, 40)
    load = -THIN.potential().tension(-x) + np.random.default_rng(1).normal(0.0, 0.1, 40)
    found = fit(x, load, replace(THIN, prestrain=0.9 * THIN.prestrain), offset=False)
    assert abs(found.prism.prestrain - THIN.prestrain) < 3 * found.errors["prestrain"]


def test_the_printed_fit_shows_the_loads_and_their_unit():
    found = fit(SHORTENING, LOAD, THIN, noise=NOISE)
    assert f"load {LOAD.min():.6g} to {LOAD.max():.6g} N" in " ".join(str(found).split())


@pytest.mark.parametrize("places", [(10, 11), (3, 40), (32, 54), (0, 1), (58, 59), (19, 30)])
def test_two_loads_in_another_unit_are_named(places):
    load = noisy(0)
    load[list(places)] *= 1e3
    worst = np.argmax(np.abs(load))
    with pytest.raises(EquilibriumError, match=rf"at index {worst}, .* loads must be in N"):
        fit(SHORTENING, load, THIN)


def test_noise_that_residuals_or_round_off_contradict_is_refused():
    for load, noise in ((noisy(0), 1e-300), (noisy(0), 1e-4), (LOAD, 1e-300), (LOAD, 1e-10)):
        with pytest.raises(TensegrityError, match="N must be at least"):
            fit(SHORTENING, load, THIN, noise=noise)
    for noise in (np.nan, np.inf, 0.0, -1.0, 1e101):
        with pytest.raises(TensegrityError, match="noise"):
            fit(SHORTENING, LOAD, THIN, noise=noise)
    fine = fit(SHORTENING, LOAD, THIN, noise=1e-8)
    assert np.isfinite(fine.correlation).all()
    assert fine.intervals()["offset"] == pytest.approx(
        (OFFSET - 1.96 * fine.errors["offset"], OFFSET + 1.96 * fine.errors["offset"]), rel=1e-9
    )


def test_loads_of_any_size_are_fitted_or_refused_by_name():
    for size in (1e-300, 1e-30, 1e30, 1e303):
        with pytest.raises(EquilibriumError, match="loads must be in N"):
            fit(SHORTENING, size * LOAD, THIN)
    with pytest.raises(TensegrityError, match="all loads are 0 N"):
        fit(SHORTENING, 0 * LOAD, THIN)


def test_level_lies_between_0_and_1():
    found = fit(ALONG, SCATTERED, LINEAR, ("k_cross",), offset=False)
    for level in (0, 1, -1, 2, np.nan, np.inf):
        with pytest.raises(TensegrityError, match="level"):
            found.intervals(level)
    for level in (1e-300, 1 - 1e-16):
        low, high = found.intervals(level)["k_cross"]
        assert low <= found.values["k_cross"] <= high


def test_a_fit_has_to_be_given_a_prism():
    assert inspect.signature(fit).parameters["prism"].default is inspect.Parameter.empty


@pytest.mark.slow
@pytest.mark.parametrize("count", [8, 15, 40, 200])
def test_intervals_and_band_of_95_percent_cover_93_to_97(count):
    x = np.linspace(0.0, 4.8e-3, count + 1)[1:] - OFFSET
    load = traced_loads(THIN, x + OFFSET)
    true = {"prestrain": THIN.prestrain, "k_base": THIN.k_base, "offset": OFFSET}
    hits, band = dict.fromkeys(true, 0), 0.0
    width = stats.t.ppf(0.975, count - 3)
    for seed in range(1000):
        scatter = NOISE * np.random.default_rng(seed).standard_normal(count)
        found = fit(x, load + scatter, THIN)
        for name, (low, high) in found.intervals().items():
            hits[name] += low < true[name] < high
        band += np.mean(np.abs(found.computed() - load) < width * found.band())
    print(count, hits, band)
    assert all(930 <= hit <= 970 for hit in (*hits.values(), band)), (hits, band)


@pytest.mark.slow
def test_intervals_of_95_percent_cover_93_to_97():
    true = {"prestrain": THIN.prestrain, "k_base": THIN.k_base, "offset": OFFSET}
    hits = dict.fromkeys(true, 0)
    for seed in range(500):
        found = fit(SHORTENING, noisy(seed), THIN, noise=NOISE)
        for name, value in true.items():
            hits[name] += abs(found.values[name] - value) < 1.96 * found.errors[name]
    assert all(0.93 <= count / 500 <= 0.97 for count in hits.values()), hits


def test_intervals_end_where_the_profile_has_grown_that_much_along_bent_valleys():
    """Base or bars come to be rigid on the way.  The profile here is that of `fit`, from the
    fit and from stiff members."""
    given = Prism(0.31, 0.267, 0.066, 2.46, 245.0, 220.0)
    x = np.linspace(0.01, 1.0, 15) * 0.0331
    noise = 0.0126
    y = traced_loads(given, x) + noise * np.random.default_rng(15).standard_normal(15)
    found = fit(x, y, given, free=("k_bar", "k_base", "k_cross"), noise=noise)
    for end in found.intervals()["k_cross"]:
        left = []
        for stiff in ({}, {"k_base": 1e5}, {"k_bar": 1e5}):
            start = replace(found.prism, k_cross=end, **stiff)
            try:
                held = fit(x, y, start, free=("k_bar", "k_base"), noise=noise)
            except EquilibriumError:
                continue
            left.append(np.sum(held.residuals**2) - np.sum(found.residuals**2))
        assert min(left) == pytest.approx((stats.norm.ppf(0.975) * noise) ** 2, rel=3e-3)
