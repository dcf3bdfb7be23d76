"""Pictures of driven chains: what they claim, from shorter runs."""

import math

import numpy as np
import pytest

from figures import driven_gap, driven_response, driven_tuning
from tensegrity import Prism

pytestmark = pytest.mark.unchanged()


@pytest.mark.parametrize("name", driven_gap.SCENES)
def test_driven_amplitudes_fall_in_the_gap_as_the_closed_form_says_and_stay_in_the_bands(name):
    spring, masses, (_, low, high, top) = driven_gap.numbers(name)
    assert 0 < low < high < top
    inside, band = 0.55 * low + 0.45 * high, 0.6 * low
    found, balance = driven_gap.ratio(name, inside)
    assert found == pytest.approx(float(driven_gap.decay(spring, masses, inside)), rel=0.02)
    assert found < 0.8
    assert balance < (1e-9 if name == driven_gap.SCENES[0] else 1e-5)
    assert driven_gap.ratio(name, band)[0] == pytest.approx(1.0, abs=0.02)
    for edge in (low, high, top):
        around = driven_gap.decay(spring, masses, edge * np.array([1 - 1e-6, 1 + 1e-6]))
        assert around.min() < 1 == around.max()


def test_the_edges_of_prism_chains_go_with_the_root_of_the_axial_stiffness():
    k = Prism(1.0, driven_tuning.HEIGHT, 0.03, 1.0).axial_stiffness()
    low, high, top = driven_tuning.edges(0.03)
    one, other = driven_tuning.MASSES
    assert low == pytest.approx(math.sqrt(2 * k / other), rel=1e-12)
    assert high == pytest.approx(math.sqrt(2 * k / one), rel=1e-12)
    assert top == pytest.approx(math.sqrt(2 * k * (1 / one + 1 / other)), rel=1e-12)
    assert driven_tuning.edges(0.03, 0.02)[2] != pytest.approx(top, rel=1e-2)


@pytest.mark.slow
def test_ten_beads_pass_waves_one_way_beyond_their_torus_point():
    """What multipliers say of two orientations, runs from rest show."""
    near, far = driven_response.SIDES
    events = driven_response.followed(near).events
    assert [event.kind for event in events] == ["torus"]
    assert events[0].value == pytest.approx(0.00649, abs=1e-5)
    assert not driven_response.followed(far).events
    assert driven_response.followed(far).stable.all()
    for strength, least, most in ((0.004, 1.0, 1.5), (0.04, 1e3, 1e6)):
        ahead, back = (driven_response.transmitted(light, strength)
                       for light in driven_response.SIDES.values())  # fmt: skip
        assert least < ahead / back < most
