"""The pictures of packs: their numbers are those of the reference."""

import pytest

from figures import _packs, chosen, packs_forming, packs_rest


def numbers(rows):
    return {line["quantity"]: (line["here"], line["reference"]) for line in rows}


def test_a_direct_hit_has_the_reference_s_force():
    assert _packs.direct(_packs.STEEL, 1.65) == pytest.approx(708.8095685, rel=1e-9)
    assert _packs.direct(_packs.STEEL, 1.0) == pytest.approx(388.6412001, rel=1e-9)
    assert _packs.direct(_packs.GLASS, 1.65) == pytest.approx(255.3743040, rel=1e-9)


def test_the_pictures_of_packs_are_one_group():
    assert {"packs_floor", "packs_plane", "packs_space"} < set(chosen(["packs"]))


@pytest.mark.slow
def test_contacts_that_form_are_counted_as_the_reference_s():
    found = packs_forming.table(packs_forming.data())
    for line in found:
        if line["figure"] == "gas" and line["quantity"].startswith("pairs"):
            assert line["here"] == line["reference"]
        if line["quantity"].startswith("energy error"):
            assert line["here"] < 1e-8
    cue, known = numbers(found)["wall peak [N]"]
    assert cue == pytest.approx(known, rel=1e-5)


@pytest.mark.slow
def test_packs_at_rest_carry_their_weight():
    for words, (here, known) in numbers(packs_rest.table(packs_rest.data())).items():
        if "less 1" in words:
            assert abs(here - known) < 1e-10
