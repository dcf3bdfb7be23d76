"""Pictures of unstable waves, of breathers, and of what a light mass traps of a wave."""

import numpy as np
import pytest

from figures import orbits_breathers as breathers
from figures import orbits_trapped as trapping
from figures import orbits_wave as waves
from tensegrity import solitary_wave

pytestmark = pytest.mark.unchanged()


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


def test_a_deviation_grows_in_a_run_as_its_multiplier_says():
    faster, slower = (waves.perturbed(sign) for sign in (1, -1))
    predicted = np.log(1.00335357)
    for run in (faster, slower):
        assert waves.growth(run) == pytest.approx(predicted, rel=3e-4)
    assert faster["peak"][-1] > 0.78 > 0.73 > faster["peak"][0] > 0.7
    assert slower["peak"][-1] < 0.45


def test_a_stable_wave_meets_its_own_radiation_on_a_ring():
    wave = solitary_wave(waves.LAW, speed=waves.STABLE)
    for sites, largest in ((60, 1.00330), (100, 1.00216582)):
        found = np.abs(np.linalg.eigvals(waves.passed(wave, sites, True)[0])).max()
        assert found == pytest.approx(largest, abs=5e-6)
    alone = np.abs(np.linalg.eigvals(waves.passed(wave, 61, False)[0]))
    assert np.sort(alone)[-3:] == pytest.approx([0.98974456, 1, 1], abs=2e-5)


def test_a_breather_on_a_light_bead_is_unstable_where_its_energy_falls_with_its_frequency():
    _, orbits = breathers.family("light")
    energy = np.array([one.energy for one in orbits])
    unstable = np.array([breathers.largest(one) for one in orbits]) > 1 + 1e-3
    falls = np.diff(energy) < 0  # frequencies fall along the rows
    first = int(np.argmax(energy))
    assert np.sum(unstable[first:-1] != falls[first:]) <= 2
    assert unstable.sum() > 15
