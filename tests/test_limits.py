"""Where methods fail: both sides of each edge, and the page that tells of them."""

import re
from pathlib import Path
from types import SimpleNamespace

import numpy as np
import pytest
from oracle import LIMITS, ORDERS

from figures import (
    chosen,
    limits_contacts,
    limits_drift,
    limits_locking,
    limits_round_off,
    limits_stability,
)
from figures._draw import render
from figures._gallery import write_page
from figures._limits import EXPLICIT

pytestmark = pytest.mark.unchanged("docs")

PAGE = Path(__file__).parent.parent / "docs" / "pictures" / "limits.md"
NUMBER = re.compile(r"-?\d+(?:\.\d+)?(?:e[+-]?\d+)?")
ROUND_OFF = 1e-10  # numbers below are sizes of round-off: other processors have others


@pytest.fixture(scope="module")
def stability():
    return limits_stability.data()


@pytest.fixture(scope="module")
def contacts():
    return limits_contacts.data(("verlet", "rkn6", "rk4", "corrected6"), (1.0, 2.0))


def rows(table):
    return [dict(zip(table, row, strict=True)) for row in zip(*table.values(), strict=True)]


def test_the_fastest_mode_begins_to_grow_within_two_percent_of_the_predicted_limit(stability):
    for row in rows(stability["limits"]):
        assert row["below"] < row["limit"] < row["above"]
        assert row["above"] - row["below"] < 0.02001 * row["limit"]
        assert abs(row["growth below"]) < 0.05 * row["growth predicted"]
        assert row["growth above"] == pytest.approx(row["growth predicted"], rel=0.05)


def test_the_loop_grows_as_the_eigenvalues_of_a_step_say_all_around_the_limit(stability):
    for name in EXPLICIT:
        t = stability[name]
        predicted = np.interp(t["dt omega"], t["line"], t["predicted"])
        top = predicted.max()
        inside = np.abs(t["dt omega"] / LIMITS[name] - 1) > 1e-6
        assert np.max(np.abs(t["growth"] - predicted)[inside]) < 0.15 * top


def test_nothing_grows_at_any_step_of_an_implicit_method(stability):
    assert min(stability["implicit"]["dt omega"]) > max(stability["limits"]["limit"])
    assert np.max(np.abs(stability["implicit"]["growth"])) < 1e-9


def test_order_is_kept_in_closed_contacts_lost_in_opening_ones_restored_by_corrections(contacts):
    for row in rows(contacts["orders"]):
        assert row["closed"] == pytest.approx(row["nominal"], abs=0.2)
        if row["method"] == limits_contacts.CORRECTED:
            assert row["opening"] > limits_contacts.HERTZ + 3 - 0.3
        elif row["nominal"] > limits_contacts.HERTZ + 1:
            assert row["opening"] < row["nominal"] - 0.7
    for row in rows(contacts["exponents"]):
        assert row[limits_contacts.PLAIN] == pytest.approx(row["exponent"] + 1, abs=0.3)
        assert row[limits_contacts.CORRECTED] > row["exponent"] + 3 - 0.4


def test_corrected_steps_agree_with_a_hundred_thousand_without():
    chain, state = limits_contacts.scene("opening")
    found = limits_contacts.exact("opening")
    n = 100_000
    fixed = limits_contacts.moved(chain, state, "rkn6", limits_contacts.DURATION / n, n)
    assert limits_contacts.events() > 5
    assert limits_contacts.gap(found, fixed) < 1e-10


def test_frequency_near_locking_grows_with_the_power_three_quarters_of_the_stroke_left():
    gaps = np.geomspace(1e-6, 1e-4, 3)
    limits = [limits_locking.stability_step(gap, "verlet") for gap in gaps]
    assert limits_locking.slope(gaps, limits) == pytest.approx(0.75, abs=0.005)


@pytest.mark.parametrize("gap", [1e-4, 1e-2])
def test_a_fixed_step_is_kept_below_the_limit_of_the_turning_point_and_refused_above(gap):
    limit = limits_locking.stability_step(gap, "verlet")
    assert limits_locking.outcome(gap, 0.7 * limit)[0] == "accepted"
    how, message = limits_locking.outcome(gap, 1.2 * limit)
    assert how == "StabilityError"
    assert "between sites 0 and 1" in message


def test_a_blow_locks_with_more_than_the_energy_of_the_stroke_and_turns_with_less():
    spring = limits_locking.collision(0.5)[0].springs[0]
    assert spring.energy(spring.domain[0]) > 0
    assert limits_locking.outcome(0.0, 1e-5, over=1.001)[0] == "LockingError"
    assert limits_locking.outcome(0.0, 1e-5, over=0.99)[0] == "accepted"


def test_steps_for_a_small_energy_error_fall_as_predicted_near_locking():
    gaps = (1e-4, 1e-2)
    for name in ("rkn6", "rk4"):
        steps = [limits_locking.good_step(gap, name) for gap in gaps]
        expected = 3 / 4 - 1 / (2 * ORDERS[name])
        assert limits_locking.slope(gaps, steps) == pytest.approx(expected, abs=0.08)


def test_the_classical_method_loses_energy_as_predicted_and_symplectic_ones_do_not():
    tables = limits_drift.data(steps=300_000)
    change = tables["rk4"]["change of the energy"]
    late = slice(len(change) // 2, None)
    assert change[-1] < -0.01
    np.testing.assert_allclose(change[late], tables["rk4"]["predicted"][late], rtol=0.02)
    for name in ("verlet", "rkn6"):
        size = np.abs(tables[name]["change of the energy"])
        assert size[late].max() < 2 * size[: late.start].max()


@pytest.mark.needs_extended
def test_round_off_of_the_energy_is_a_random_walk_and_drift_makes_it_worse():
    tables = limits_round_off.data(steps=16_000)
    for name, expected in limits_round_off.EXPECTED.items():
        assert limits_round_off.powers(tables, name) == pytest.approx(expected, abs=0.35)
    assert tables["drifting"]["energy"][-1] > 100 * tables["at_rest"]["energy"][-1]


def section(name):
    """Words of the page below a picture."""
    _, _, after = PAGE.read_text().partition(f"({name}.png)\n\n")
    return after.split("\n\n## ")[0].strip()


def assert_tells(told, fresh):
    """The same words, and numbers that differ by at most a tenth, or the last digit."""
    assert NUMBER.split(told) == NUMBER.split(fresh)
    for one, two in zip(NUMBER.findall(told), NUMBER.findall(fresh), strict=True):
        a, b = float(one), float(two)
        if max(abs(a), abs(b)) < ROUND_OFF and a and b:
            assert 0.1 < a / b < 10, (one, two)
        else:
            assert a == pytest.approx(b, rel=0.1, abs=0.1 if re.fullmatch(r"\d\.\d", one) else 0)


def test_the_page_tells_the_stability_limits_that_are_found(stability):
    assert_tells(section("limits_stability"), limits_stability.text(stability))


def test_a_wrong_number_or_word_on_the_page_is_noticed(stability):
    told = limits_stability.text(stability)
    for wrong in (told.replace("3.1414", "4.1414"), told.replace("resonance", "coincidence")):
        with pytest.raises(AssertionError):
            assert_tells(wrong, told)


def test_the_page_has_all_pictures_of_the_group():
    told = set(re.findall(r"\((limits_\w+)\.png\)", PAGE.read_text()))
    assert told == set(chosen(["limits"]))
    assert all((PAGE.parent / f"{name}.png").is_file() for name in told)


def test_a_picture_that_tells_something_gets_a_section(tmp_path):
    fake = SimpleNamespace(
        __doc__="A picture to show.\n\nMore.",
        data=lambda: {"one": {"x": [1.0]}},
        draw=lambda figure, tables: figure.subplots().plot(tables["one"]["x"]),
        text=lambda tables: f"It is {tables['one']['x'][0]:g}.",
    )
    assert render("fake", fake, tmp_path) == []
    expected = "## A picture to show\n\n![A picture to show](fake.png)\n\nIt is 1.\n"
    assert (tmp_path / "fake.md").read_text() == expected


def test_a_page_is_written_only_where_all_its_sections_were_made(tmp_path):
    names = list(chosen(["limits"]))
    for name in names:
        (tmp_path / f"{name}.md").write_text(f"## {name}\n")
    assert write_page("limits", names[:-1], tmp_path) == []
    assert write_page("waves", names, tmp_path) == []
    (page,) = write_page("limits", names, tmp_path)
    assert [line[3:] for line in page.read_text().splitlines() if line.startswith("##")] == names


@pytest.mark.slow
@pytest.mark.needs_extended
@pytest.mark.parametrize("name", chosen(["limits"]))
def test_the_page_tells_what_the_pictures_find(name):
    module = chosen([name])[name]
    assert_tells(section(name), module.text(module.data()))
