"""The pictures of the lens: what they say of its focus, of errors and of coupling."""

import numpy as np
import pytest

from figures import _lens, lens_errors, lens_focus


def test_a_peak_is_read_between_the_samples():
    t = np.linspace(-2.0, 2.0, 41)
    instant, height = _lens.top(t, 3 - (t - 0.03) ** 2)
    assert (instant, height) == pytest.approx((0.03, 3.0), abs=1e-12)


def test_a_map_covers_the_box_row_by_row():
    points = lens_focus.grid((5, 3)).reshape(3, 5, 2)
    assert points[0, 0].tolist() == [-lens_focus.BOX[0], 0.0]
    assert points[-1, -1].tolist() == list(lens_focus.BOX)


@pytest.mark.slow
def test_errors_of_one_percent_cost_little():
    of_lens, of_own = lens_errors.detuned(0.01, seed=0)
    assert 0.97 < of_own < 0.999
    assert of_lens == pytest.approx(of_own, abs=0.02)
