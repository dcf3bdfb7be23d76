"""The pictures of structures: what they say of the tower and of deployment."""

import numpy as np
import pytest

from figures import structures_deployment, structures_tower
from tensegrity import EquilibriumError, equilibrium


def test_tower_found_from_natural_lengths_is_stable_with_all_strings_taut():
    s = structures_tower.tower()
    assert s.is_stable()
    assert not s.slack.any()
    assert np.abs(s.members.gradient(s.positions)).max() < 1e-12
    assert len(s.self_stress().states) == 1
    assert np.ptp(s.positions[list(structures_tower.LOWER), 2]) < 1e-12
    assert np.ptp(s.positions[list(structures_tower.UPPER), 2]) < 1e-10


def test_prism_and_column_are_drawn_in_from_nearly_flat_to_the_reference():
    reference = structures_deployment.REFERENCE
    for count in structures_deployment.COUNTS:
        path = structures_deployment.deployed(count)
        top = path.positions[:, -1, 2]
        assert top[-1] == pytest.approx(count * reference.height, rel=0.01)  # less by its weight
        assert top[0] < 0.17 * top[-1]
        drawn = path.tensions[:, structures_deployment.cross_strings(count)]
        assert (drawn[-1] > 100 * drawn[0]).all()
        assert path.stable_load.all()
        assert not path.slack.any()
        assert path.work[-1] > 0


def test_no_shape_of_a_heavier_prism_lies_below_the_fold():
    path = structures_deployment.paid_out()
    (fold,) = path.events
    assert fold.kind == "fold"
    reference = structures_deployment.REFERENCE
    s = reference.structure()
    loads = structures_deployment.weights(s, structures_deployment.HEAVY)
    height = path.positions[fold.row, -1, 2]
    for share, stands in ((0.999, True), (1.001, False)):  # of the control at the fold
        lengths = s.natural_lengths.copy()
        lengths[3:6] *= 1 + (structures_deployment.LONG - 1) * share * fold.control
        above = s.at(path.positions[fold.row - 2], natural_lengths=lengths)
        found = equilibrium(above, loads, structures_deployment.GROUND)
        assert (found.positions[-1, 2] > 0.9 * height) == stands


def test_unloaded_prism_of_long_cross_strings_has_no_shape_to_start_from():
    s = structures_deployment.REFERENCE.structure()
    lengths = s.natural_lengths.copy()
    lengths[3:6] *= structures_deployment.LONG
    with pytest.raises(EquilibriumError, match="all members without stress"):
        s.at(s.positions, natural_lengths=lengths).relaxed()
