"""The charts of the benchmarks show everything that was measured, and nothing else."""

import csv

import matplotlib.pyplot as plt
import numpy as np
import pytest

from benchmarks import _race, kernel, methods
from benchmarks.continuation import chart

pytestmark = pytest.mark.unchanged("docs")

FOUND = {"this": [(1e-4, 9, 3e-5, 1e-3), (1e-6, 12, 6e-6, 2e-3)], "other": [(0.1, 8, 4e-5, 3e-3)]}


def test_chart_writes_picture_and_table_whole(tmp_path):
    picture, table = chart(FOUND, tmp_path)
    height, width, _ = plt.imread(picture).shape
    assert width > height > 400
    with open(table) as file:
        rows = [
            tuple(float(x) if i else x for i, x in enumerate(r)) for r in list(csv.reader(file))[1:]
        ]
    assert rows == [(name, *row) for name, several in FOUND.items() for row in several]
    assert sorted(tmp_path.iterdir()) == sorted([picture, table])


LAWS = [
    ("rigid", "formula", 2.0, 0.0, 1e-15),
    ("rigid", "degree 7", 0.9, 2e-5, 9e-5),
    ("rigid", "degree 19", 1.7, 2e-14, 1e-13),
    ("elastic", "2 iterations", 56.0, 1e-15, 5e-15),
]


def test_chart_of_the_kernels_writes_picture_and_table_whole(tmp_path):
    picture, table = kernel.chart(LAWS, tmp_path)
    height, width, _ = plt.imread(picture).shape
    assert width > height > 400
    with open(table) as file:
        rows = [
            tuple(float(x) if i > 1 else x for i, x in enumerate(r))
            for r in list(csv.reader(file))[1:]
        ]
    assert rows == LAWS


def test_the_cheapest_law_is_the_fastest_of_those_good_enough():
    assert kernel.cheapest(LAWS, "rigid", "degree", 1e-3) == 0.9
    assert kernel.cheapest(LAWS, "rigid", "degree", 1e-11) == 1.7
    assert kernel.cheapest(LAWS, "elastic", "degree", 1) != kernel.cheapest(LAWS, "rigid", "f", 1)


RACE = [
    ("rkn6", "9 steps", 1e-3, 0.01, 0.0),
    ("rkn6", "18 steps", 1e-9, 0.04, 0.0),
    ("other", "coarse", 1e-2, 0.02, 1.5),
    ("other", "fine", 1e-8, 0.08, 1.5),
]


def test_time_at_an_error_lies_on_the_power_law_between_two_runs():
    assert _race.seconds(RACE, "rkn6", 1e-6) == pytest.approx(0.02)
    assert _race.seconds(RACE, "rkn6", 1e-2) == 0.01
    assert _race.seconds(RACE, "rkn6", 1e-10) == np.inf
    found = _race.ratios(RACE, "other")
    assert found[3] == pytest.approx(0.04 / (0.01 * 4 ** (1 / 3)))  # at 1e-5


def test_chart_of_speed_shows_the_call_the_best_loops_and_other_programs():
    more = [("verlet", "9 steps", 1e-4, 0.05, 0.0), ("verlet +p", "9 steps", 1e-4, 0.02, 0.0),
            ("simulate", "tol 1e-05", 1e-6, 0.05, 0.0)]  # fmt: skip
    found, bare = _race.shown(RACE + more), _race.BARE
    assert list(found) == ["simulate", bare, f"{bare} +p", "other"]
    assert found[bare] == [(0.01, 1e-3), (0.04, 1e-9)]  # another was slower and no better
    assert found[f"{bare} +p"] == [(0.02, 1e-4)]
    assert found["simulate"] == [(0.05, 1e-6)]


def test_chart_of_work_and_precision_writes_picture_and_table_whole(tmp_path):
    picture, table = _race.chart({"one": RACE, "two": RACE[:2]}, tmp_path)
    height, width, _ = plt.imread(picture).shape
    assert width > height > 400
    with open(table) as file:
        rows = list(csv.reader(file))[1:]
    assert [row[0] for row in rows] == ["one"] * 4 + ["two"] * 2
    assert [float(row[3]) for row in rows[:4]] == [row[2] for row in RACE]


def test_evaluations_for_an_error_lie_on_the_power_law_between_two_runs():
    counts, errors = np.array([10.0, 20.0, 40.0]), np.array([1e-2, 1e-4, 1e-6])
    assert methods.needed(counts, errors, 1e-3) == pytest.approx(10 * np.sqrt(2))
    assert np.isnan(methods.needed(counts, errors, 1e-7))
    assert methods.needed(counts, errors, 0.1) == 10
