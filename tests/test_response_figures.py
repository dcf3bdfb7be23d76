"""The pictures of the response draw what their numbers say."""

import matplotlib
import numpy as np
import pytest

matplotlib.use("Agg")
import matplotlib.pyplot as plt

from figures import (
    response_limit_load,
    response_model_map,
    response_outside,
    response_prestrain,
    response_rigidity,
    response_states,
)

MODULES = (
    response_limit_load,
    response_outside,
    response_prestrain,
    response_rigidity,
    response_states,
)


@pytest.mark.parametrize("module", MODULES, ids=lambda m: m.NAME)
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


def test_more_rigid_members_carry_more_at_equal_shortening():
    tables = response_rigidity.data()
    for member in ("base", "bar"):
        at = [
            np.interp(0.05, t["shortening"], t["load"])
            for name, t in tables.items()
            if name.startswith(member)
        ]
        assert (np.diff(at) > 0).all()


def test_model_map_shows_tilting_for_slender_prisms_only(monkeypatch):
    monkeypatch.setattr(response_model_map, "SLENDERNESS", np.array([0.4, 0.8, 2.0]))
    monkeypatch.setattr(response_model_map, "PRESTRAINS", np.array([0.01, 0.2]))
    tables = response_model_map.data()
    fraction = np.array(tables["map"]["tilt_fraction"]).reshape(3, 2)
    assert np.isnan(fraction[:2]).all()
    assert (fraction[2] < 0.5).all()
    figure = plt.figure()
    response_model_map.draw(figure, tables)
    plt.close(figure)
