"""Prisms fitted to curves: what is found, how sure it is, and what a curve cannot tell."""

import numpy as np
import pytest

from tensegrity import Prism, TensegrityError, fit
from tensegrity.prisms.curve import Curve, loads

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
        return loads(curve.made(t), x + t[-1])

    assert np.abs(found - traced(theta)).max() < 1e-14 * found.max()
    for k in np.flatnonzero(theta):
        h = 1e-5 * np.eye(5)[k]
        difference = (traced(theta + h) - traced(theta - h)) / 2e-5
        assert np.abs(slopes[:, k] - difference).max() < 1e-7 * np.abs(slopes).max()
    with pytest.raises(TensegrityError, match="goes beyond this prism"):
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
    assert "only k_cross p0/(1 + p0) is known" in words
    assert "k_bar: doubled" in words
    assert "not identified: k_bar" in str(found)


def test_file_of_two_columns_is_read(tmp_path):
    path = tmp_path / "curve.csv"
    np.savetxt(path, np.column_stack([SHORTENING, LOAD]), delimiter=",", header="shortening,load")
    found = fit(path, prism=THIN)
    assert found.prism.prestrain == pytest.approx(THIN.prestrain, rel=1e-6)


def test_what_cannot_be_fitted_is_refused(tmp_path):
    for wrong, words in (
        (lambda: fit(SHORTENING[:3], LOAD[:3], THIN), "3 points are fewer than 4"),
        (lambda: fit(SHORTENING * 10, LOAD, THIN), "beyond this prism"),
        (lambda: fit(SHORTENING, LOAD[:5], THIN), "of one length"),
        (lambda: fit(SHORTENING, LOAD, THIN, ("height",)), "must be one of prestrain"),
        (lambda: fit(SHORTENING, LOAD, Prism(1.0, 0.7, 0.1, 1.0)), "elastic members"),
        (lambda: fit(SHORTENING, LOAD, THIN, noise=0.0), "noise 0 N must be above 0"),
        (lambda: fit(tmp_path / "none.csv", prism=THIN), "no CSV file"),
    ):
        with pytest.raises(TensegrityError, match=words):
            wrong()


@pytest.mark.slow
def test_intervals_of_95_percent_cover_93_to_97():
    true = {"prestrain": THIN.prestrain, "k_base": THIN.k_base, "offset": OFFSET}
    hits = dict.fromkeys(true, 0)
    for seed in range(500):
        found = fit(SHORTENING, noisy(seed), THIN, noise=NOISE)
        for name, value in true.items():
            hits[name] += abs(found.values[name] - value) < 1.96 * found.errors[name]
    assert all(0.93 <= count / 500 <= 0.97 for count in hits.values()), hits
