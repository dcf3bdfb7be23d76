"""What a light mass traps of a wave is its breather."""

import numpy as np
import pytest

from figures import orbits_trapped as trapping


def test_what_a_light_mass_traps_is_its_breather():
    run, energy = trapping.struck(trapping.LIGHT, 1.4)
    left = trapping.trapped(run, trapping.LIGHT)
    assert np.ptp(left) < 1e-4 * left.mean()  # it stays
    assert left.mean() / energy == pytest.approx(0.0673, abs=2e-4)
    orbit = trapping.breather(float(left.mean()))
    assert trapping.share(run, orbit) > 0.9997
    assert trapping.frequency(run) * orbit.period == pytest.approx(1, abs=2e-6)
    heavy, energy = trapping.struck(trapping.HEAVY, 1.4)
    assert trapping.trapped(heavy, trapping.HEAVY).mean() < 1e-5 * energy
