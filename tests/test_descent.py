"""The largest force behind a chain of beads and its slopes by diameters."""

import numpy as np
import pytest

from granular import Bead, Striker, materials
from granular.descent import descend, wall_peak
from tensegrity import TensegrityError

STEEL = materials["steel"]
BLOW = {"material": STEEL, "striker": Striker(Bead(10e-3, STEEL), 0.44), "wall": STEEL}
SIZES = 1e-3 * np.array([8.17466, 7.19593, 6.18252, 4.58887, 5.36603, 10, 10, 10, 8.38780, 10,
                         8.27483, 7.66425, 5.67855, 5.46421, 10, 4, 6.35630, 4.66605, 4,
                         4])  # fmt: skip


@pytest.mark.slow
def test_a_good_protector_of_twenty_diameters_lets_through_25_85_newtons():
    """Found elsewhere by basin hopping; several peaks are alike to the digits of the sizes."""
    force, slopes = wall_peak(SIZES, t_end=4e-4, dt=5e-8, **BLOW)
    assert force == pytest.approx(25.85289, abs=2e-3)
    assert slopes.shape == (20,)


@pytest.mark.parametrize("p", [None, 32])
def test_slopes_are_those_of_differences(p):
    sizes = np.linspace(8e-3, 5e-3, 6)
    run_of = {"t_end": 2e-4, "dt": 2e-7, "p": p, **BLOW}
    force, slopes = wall_peak(sizes, **run_of)
    h = 1e-9
    for bead in (0, 3, 5):
        moved = h * np.eye(6)[bead]
        low, high = (wall_peak(sizes + x, **run_of)[0] for x in (-moved, moved))
        exact = (high - low) / (2 * h)
        assert slopes[bead] == pytest.approx(exact, rel=1e-5, abs=1e-6 * force / sizes[0])


def test_a_norm_is_a_part_of_the_peak():
    sizes, run_of = np.linspace(8e-3, 5e-3, 6), {"t_end": 2e-4, "dt": 2e-7, **BLOW}
    peak = wall_peak(sizes, **run_of)[0]
    parts = [wall_peak(sizes, p=p, **run_of)[0] / peak for p in (8, 32, 128)]
    assert 0.4 < parts[0] < parts[1] < parts[2] < 1


def test_no_diameters_are_refused():
    for wrong in ([], [[1e-3]], [-1e-3], "x"):
        with pytest.raises(TensegrityError):
            wall_peak(wrong, t_end=1e-4, dt=1e-7, **BLOW)


def test_descent_keeps_length_and_bounds_and_comes_below_its_start():
    sizes = np.array([9e-3, 5e-3, 8e-3, 6e-3])
    run_of = {"t_end": 1e-4, "dt": 4e-7, **BLOW}
    found = descend(sizes, between=(4e-3, 10e-3), **run_of)
    assert found.diameters.sum() == pytest.approx(sizes.sum(), rel=1e-6)
    assert found.diameters.min() >= 4e-3
    assert found.diameters.max() <= 10e-3 * (1 + 1e-12)
    assert found.force < 0.9 * wall_peak(sizes, **run_of)[0]
    alone = wall_peak(found.diameters, **run_of)[0]  # of two maxima alike that of the larger sample
    assert alone <= found.force * (1 + 1e-12)
    assert found.force == pytest.approx(alone, rel=1e-7)
    with pytest.raises(TensegrityError, match="length 1 m: 4 diameters"):
        descend(sizes, between=(4e-3, 10e-3), length=1.0, **run_of)
