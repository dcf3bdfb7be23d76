"""The pictures of structures: what they say of the tower and of deployment."""

import numpy as np
import pytest
from scipy.optimize import brentq

from figures import structures_deployment, structures_planes, structures_tower
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


def test_steep_pair_of_bars_leaves_its_symmetric_path_and_joins_it_again_below():
    """Sideways stiffness vanishes where the bars' natural length is l^3/y^2, above and below."""
    path = structures_planes.path_of("pair", 3.0, "stable")
    above, below = (e.shortening for e in path.events if e.kind == "bifurcation")
    height = brentq(lambda y: np.sqrt(10) * y**2 - (1 + y**2) ** 1.5, 2, 3)
    assert above == pytest.approx(3 - height, rel=1e-9)
    assert below == pytest.approx(3 + height, rel=1e-6)
    leans = np.abs(path.positions[:, 2, 0]) > 1e-3
    apart = (path.shortening > above + 1e-3) & (path.shortening < below - 1e-3)
    assert leans[apart].all()
    assert not leans[(path.shortening < above) | (path.shortening > below + 1e-2)].any()
    assert path.stable_height.all()


def test_tall_cross_leans_on_its_stable_branch_and_a_square_one_does_not():
    for height, leans in ((1.0, False), (2.0, True)):
        paths = [structures_planes.path_of("X", height, b) for b in structures_planes.BRANCHES]
        stable, symmetric = (p[p.events[0].row + 1 : p.events[0].row + 9] for p in paths)
        tilt = np.abs(np.diff(stable.positions[:, 2:, 1], axis=1))
        assert (tilt > 1e-3).all() == leans
        assert symmetric.stable_height.all() != leans
        if not leans:
            assert paths[0].load == pytest.approx(paths[1].load, rel=1e-12)
