"""The charts of the benchmarks show everything that was measured, and nothing else."""

import csv

import matplotlib.pyplot as plt
import pytest

import tensegrity as ts
from benchmarks import kernel, work_precision
from benchmarks.continuation import chart
from tensegrity import Chain, PowerLaw
from tensegrity.precision.result import WorkRow

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


def test_chart_of_work_and_precision_writes_picture_and_table_whole(tmp_path):
    chain = Chain(PowerLaw(1.0, 1.5), 3)
    one = ts.work_precision(chain, chain.at_rest({0: 1.0}), 3.0, ["verlet", "rk4"], seconds=2.0)
    picture, table = work_precision.chart({"one": one, "two": one}, tmp_path)
    height, width, _ = plt.imread(picture).shape
    assert width > height > 400
    with open(table) as file:
        rows = list(csv.DictReader(file))
    assert [row["scene"] for row in rows] == ["one"] * len(one.rows) + ["two"] * len(one.rows)
    assert [float(row["error"]) for row in rows] == 2 * [row.error for row in one.rows]


def test_polynomials_are_shown_where_none_is_cheaper_and_better():
    rows = [WorkRow("a", "", 0.1, 9, 1e-4, 2.0), WorkRow("a", "", 0.1, 9, 1e-3, 1.0),
            WorkRow("b", "", 0.1, 9, 1e-3, 3.0)]  # fmt: skip
    assert work_precision.front(rows) == [rows[1], rows[0]]
