"""The ladder of models: its largest models are independent of the smaller ones they judge."""

import numpy as np
import pytest

from figures import _nodes, models_ladder
from figures._nodes import Nodes
from figures.models_ladder import ELASTIC, enough, guide, ladder, under_load
from tensegrity import EquilibriumError, Prism


def errors(one):
    return dict(zip(one["model"], one["error"], strict=True))


def test_all_coordinates_of_the_nodes_give_the_tension_of_the_eliminated_unknowns():
    soft = Prism(1.0, 0.8, 0.02, 1.0, k_base=20.0, k_bar=200.0)
    elongation = np.linspace(-0.06, 0.02, 9)
    nodes = Nodes(soft, 9)
    expected = soft.potential().tension(elongation)
    np.testing.assert_allclose(nodes.tension(soft.height + elongation), expected, atol=1e-13)
    bars = nodes.places.reshape(9, 6, 3)[:, 3:] - nodes.places.reshape(9, 6, 3)[:, :3]
    assert np.ptp(np.linalg.norm(bars, axis=2), axis=1).max() < 1e-12  # alike: symmetry was kept


def test_nodes_that_find_no_equilibrium_say_so(monkeypatch):
    monkeypatch.setattr(_nodes, "ITERATIONS", 2)
    with pytest.raises(EquilibriumError, match="no equilibrium of the nodes"):
        Nodes(ELASTIC, 1).tension([0.95 * ELASTIC.height])


def test_a_prism_under_load_needs_the_more_the_smaller_the_error():
    one = under_load()
    found = errors(one)
    fits = [e for name, e in found.items() if "degree" in name]
    assert found["rigid"] > fits[0] > fits[1] > fits[2]
    assert found["elastic, exact"] < 1e-9
    assert enough(one, 1e-2).startswith("rigid")
    assert enough(one, 1e-8).startswith("elastic, degree")


def test_one_dimension_is_enough_in_the_stem():
    found = errors(guide(models_ladder.GUIDES["stem"]))
    assert max(found.values()) < 1e-8


def test_behind_the_junction_the_branches_as_one_row_are_enough_for_a_hundredth():
    found = errors(guide(models_ladder.GUIDES["stem_and_junction"]))
    assert found["1D, straight on"] > 0.1
    assert 1e-5 < found["1D, branches as one"] < 2e-3
    assert found["2D"] < 1e-8


def test_the_simplest_model_that_is_good_enough_is_named():
    one = ladder({"rough": lambda: np.array([0.9, 0.0]), "fine": lambda: np.array([1.0, 0.0])},
                 np.array([1.0, 0.0]))  # fmt: skip
    assert one["error"].tolist() == pytest.approx([0.1, 0.0])
    assert enough(one, 0.2).startswith("rough")
    assert enough(one, 0.05).startswith("fine")
    one["error"][1] = 0.07
    assert enough(one, 0.05) == "none"


@pytest.mark.slow
def test_a_chain_of_prisms_needs_the_more_the_smaller_the_error():
    one = models_ladder.prisms_in_a_row()
    found = errors(one)
    assert found["rigid"] > 1e-3
    assert found["elastic, exact"] == pytest.approx(found["18 coordinates"], rel=0.1)
    assert [enough(one, level).split(" (")[0] for level in models_ladder.LEVELS] == [
        "rigid", "elastic, degree 7", "elastic, degree 11",
    ]  # fmt: skip
