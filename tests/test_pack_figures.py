"""The pictures of packs: their numbers are those of the reference."""

import pytest

from figures import _packs, chosen

pytestmark = pytest.mark.unchanged()


def numbers(rows):
    return {line["quantity"]: (line["here"], line["reference"]) for line in rows}


def test_a_direct_hit_has_the_reference_s_force():
    assert _packs.direct(_packs.STEEL, 1.65) == pytest.approx(708.8095685, rel=1e-9)
    assert _packs.direct(_packs.STEEL, 1.0) == pytest.approx(388.6412001, rel=1e-9)
    assert _packs.direct(_packs.GLASS, 1.65) == pytest.approx(255.3743040, rel=1e-9)


def test_the_pictures_of_packs_are_one_group():
    assert {"packs_floor", "packs_space"} < set(chosen(["packs"]))
