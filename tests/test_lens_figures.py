"""The pictures of the lens: what they say of its focus, of errors and of coupling."""

import numpy as np
import pytest

from figures import lens_focus

pytestmark = pytest.mark.unchanged()


def test_a_peak_is_read_between_the_samples():
    t = np.linspace(-2.0, 2.0, 41)
    instant, height = lens_focus.top(t, 3 - (t - 0.03) ** 2)
    assert (instant, height) == pytest.approx((0.03, 3.0), abs=1e-12)


def test_a_map_covers_the_box_row_by_row():
    points = lens_focus.grid((5, 3)).reshape(3, 5, 2)
    assert points[0, 0].tolist() == [-lens_focus.BOX[0], 0.0]
    assert points[-1, -1].tolist() == list(lens_focus.BOX)


@pytest.mark.slow
def test_errors_of_one_percent_cost_little():
    """Peak at the focus over the sum of its own single peaks, and over that of the lens."""
    lens, t = lens_focus.lens(), lens_focus.around(4.0, 4.0)
    wrong = 1 + 0.01 * np.random.default_rng(0).standard_normal(lens.chains)
    each = lens.pressures(lens.focus, t, lens.chain_prestrains * wrong)
    peak = lens_focus.top(t, each.sum(axis=0))[1]
    of_own = peak / sum(lens_focus.top(t, one)[1] for one in each)
    assert 0.97 < of_own < 0.999
    of_lens = peak / lens_focus.top(t, lens.pressure(lens.focus, t))[1]
    assert of_lens == pytest.approx(of_own, abs=0.02)
