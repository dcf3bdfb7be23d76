"""The pictures of the response draw what their numbers say."""

import matplotlib
import numpy as np
import pytest

matplotlib.use("Agg")
import matplotlib.pyplot as plt

from figures import (
    response_prestrain,
    response_states,
)

pytestmark = pytest.mark.unchanged()

MODULES = (
    response_prestrain,
    response_states,
)


@pytest.mark.parametrize("module", MODULES)
def test_picture_is_drawn_from_its_numbers_with_units_on_its_axes(module):
    tables = module.data()
    for table in tables.values():
        for column in table.values():
            if not isinstance(column[0], str):
                assert np.isfinite(np.asarray(column, dtype=float)).all()
    figure = plt.figure()
    module.draw(figure, tables)
    flat = [axes for axes in figure.axes if axes.name != "3d"]
    assert all("[" in axes.get_xlabel() or "prestrain" in axes.get_xlabel() for axes in flat)
    assert module.GROUP == "response"
    plt.close(figure)
