"""The chart of the continuation benchmark shows every method that was measured, and no other."""

import csv

import matplotlib.pyplot as plt

from benchmarks.continuation import chart

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
