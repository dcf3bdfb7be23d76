"""The pictures of exact waves: what they claim of the asymptotics, and that they are drawn."""

import matplotlib
import numpy as np
import pytest

matplotlib.use("Agg")
import matplotlib.pyplot as plt

from figures import solitary_errors, solitary_families, solitary_largest_speed, solitary_profiles


@pytest.fixture(scope="module")
def profiles():
    return solitary_profiles.data()


@pytest.fixture(scope="module")
def errors():
    return solitary_errors.data()


def drawn(module, tables):
    figure = plt.figure()
    module.draw(figure, tables)
    labels = [axes.get_xlabel() for axes in figure.axes]
    plt.close(figure)
    return labels


def test_waves_at_1_05_2_and_3_sound_speeds_span_about_7_3_and_2_prisms(profiles):
    numbers = profiles["numbers"]
    assert 7 < numbers["width"][0] < 8
    assert 2.5 < numbers["width"][1] < 3
    assert 2 < numbers["width"][2] < 2.5
    assert np.nanmax(numbers["residual"]) <= 1e-12
    assert any("sites" in label for label in drawn(solitary_profiles, profiles))


def test_12_16_sound_speeds_are_reached_by_one_of_the_prisms_only(profiles):
    assert "h0.7_c12.16" not in profiles
    table, numbers = profiles["h0.6_c12.16"], profiles["numbers"]
    assert numbers["largest_ratio"][0] < 12.16 < numbers["largest_ratio"][-1]
    gap = np.max(np.abs(table["exact"] - table["tent"])) / np.max(np.abs(table["tent"]))
    assert gap < 0.1


def test_sech2_error_over_the_peak_falls_with_gamma_squared(errors):
    """As the order 4 of the error itself says; the range shrinks with the prestrain."""
    table = errors["sech2_h0.7_p0.1"]
    few = slice(0, 4)
    slope = np.polyfit(np.log(table["gamma"][few]), np.log(table["error"][few]), 1)[0]
    assert slope == pytest.approx(2, abs=0.05)
    at = [
        errors[f"sech2_{name}"]["error"][0] for name in ("h0.7_p0.1", "h0.7_p0.01", "h0.6_p0.001")
    ]
    assert at[0] < at[1] / 4 < at[2] / 16


def test_tent_is_not_reached_at_a_fixed_prism(errors):
    """Its error has a limit above 0 as the stroke is used up: a series in the root of the rest."""
    for shape in solitary_errors.SHAPES:
        table = errors[f"tent_h{shape[0]:g}_p{shape[1]:g}"]
        left, error = np.sqrt(table["stroke_left"]), np.array(table["error"])
        limits = [np.polynomial.Polynomial.fit(left[:n], error[:n], n - 1)(0.0) for n in (3, 4)]
        assert limits[0] == pytest.approx(limits[1], abs=0.005)
        assert min(limits) > 0.03


def test_tent_is_not_reached_without_prestrain_either(errors):
    """At 0.95 of the stroke the error tends to that of the sonic vacuum, above what 0.95 costs."""
    for height in solitary_errors.HEIGHTS:
        table = errors[f"prestrain_h{height:g}"]
        assert table["prestrain"][0] == 0
        assert table["error"][1] == pytest.approx(table["error"][0], rel=1e-3)
        assert table["error"][0] > 1.4 * (1 - solitary_errors.USED)
    assert "prestrain" in drawn(solitary_errors, errors)[-1]


@pytest.mark.slow
def test_width_falls_and_energy_rises_along_every_family():
    tables = solitary_families.data()
    for table in tables.values():
        assert (np.diff(table["width"]) < 0).all()
        assert (np.diff(table["energy"]) > 0).all()
        assert (np.diff(np.abs(table["peak"])) > 0).all()
    assert drawn(solitary_families, tables)[0].startswith("c/c")


@pytest.mark.slow
def test_largest_speed_agrees_at_two_resolutions_and_follows_the_two_body_estimate():
    tables = solitary_largest_speed.data()
    table = tables["map"]
    np.testing.assert_allclose(table["speed_coarse"], table["speed"], rtol=1e-3)
    share = table["speed"] / table["two_body"]
    assert (share > 0.85).all()
    assert (share < 1).all()
    drawn(solitary_largest_speed, tables)
