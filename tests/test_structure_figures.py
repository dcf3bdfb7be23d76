"""The pictures of structures: what they say of the tower and of deployment."""

import numpy as np
import pytest

from figures import structures_deployment, structures_tower


def test_tower_found_from_natural_lengths_is_stable_with_all_strings_taut():
    s = structures_tower.tower()
    assert s.is_stable()
    assert not s.slack.any()
    assert np.abs(s.members.gradient(s.positions)).max() < 1e-12
    assert len(s.self_stress().states) == 1
    assert np.ptp(s.positions[list(structures_tower.LOWER), 2]) < 1e-12
    assert np.ptp(s.positions[list(structures_tower.UPPER), 2]) < 1e-10


def test_prism_and_column_deploy_to_the_reference_stable_and_taut():
    reference = structures_deployment.REFERENCE
    energy = []
    for count, path in structures_deployment.paths():
        height = np.ptp(path.positions[-1][[0, -1], 2])
        assert height == pytest.approx(count * reference.height, rel=1e-10)
        assert np.ptp(path.positions[0][[0, -1], 2]) < 0.25 * height
        assert path.stable_load.all()
        assert not path.slack.any()
        energy.append(path.work[-1] / count)
    assert energy[0] == pytest.approx(energy[1], rel=1e-10)
