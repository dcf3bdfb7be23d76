"""The claims of the sources: each says where its numbers stand, and they are there."""

import tomllib
from inspect import getsource
from pathlib import Path

import pytest
from claims import VERDICTS, claims, numbers

from derivations import ledger
from derivations.argument import Verdict
from figures import _guide, _lens, _measure, _packs, pictures
from figures._files import PRINTED, write_tables

ROOT = Path(__file__).parent.parent
OUTPUT = ROOT / "figures" / "output"
HELPERS = (_guide, _lens, _measure, _packs)  # have the columns of lines that are printed
ENTRIES = {entry.name: entry for entry in ledger.entries()}
NUMBERS = [(claim["name"], one) for claim in claims() for one in claim.get("numbers", ())]


def test_claims_are_whole():
    names = [claim["name"] for claim in claims()]
    assert len(names) == len(set(names)) > 50
    for claim in claims():
        assert claim["verdict"] in VERDICTS
        assert claim["seed"] in ("talk", "paper")
        assert all(claim[key] for key in ("says", "place", "about", "when"))
        assert claim["verdict"] == "open" or claim.get("numbers") or claim.get("ledger")


@pytest.mark.parametrize(("name", "one"), NUMBERS)
def test_a_number_names_a_picture_table_and_column_that_exist(name, one):
    module = pictures()[one["picture"]]
    text = getsource(module)
    if one.get("table", PRINTED) == PRINTED:
        assert hasattr(module, "table")
        text += "".join(getsource(helper) for helper in HELPERS if helper.__name__ in text
                        or helper.__name__.split(".")[1] in text)  # fmt: skip
    else:
        assert f'"{one["table"]}"' in text
    assert f'"{one["column"]}"' in text


def test_numbers_of_pictures_that_were_made_are_found():
    for claim in claims():
        list(numbers(claim, OUTPUT))  # a KeyError otherwise


def test_ledger_entries_are_known_and_what_it_leaves_open_is_decided():
    named = {entry for claim in claims() for entry in claim.get("ledger", ())}
    assert named <= set(ENTRIES)
    left = {name for name, entry in ENTRIES.items() if entry.verdict is Verdict.NO_DATA}
    assert left <= named
    formulas = tomllib.loads((ROOT / "docs" / "formulas.toml").read_text())["formulas"]
    assert {name for found in formulas.values() for name in found} <= set(ENTRIES)


def test_a_number_is_read_with_its_error(tmp_path):
    claim = {
        "numbers": [
            {"picture": "granular_fig2", "row": "speed", "column": "here", "error": "spread"},
            {"picture": "granular_fig2", "row": "speed", "column": "here", "error": "of it"},
            {"picture": "granular_fig3", "row": "speed", "column": "here"},
        ]
    }
    lines = [
        {"quantity": "other", "here": 1.0, "of it": 0.5},
        {"quantity": "speed", "here": 2.0, "of it": 0.25},
        {"quantity": "spread", "here": 3.0, "of it": ""},
    ]
    (tmp_path / "granular").mkdir()
    write_tables(tmp_path / "granular" / "granular_fig2.csv", {}, lines)
    found = [(value, error) for _, value, error in numbers(claim, tmp_path)]
    assert found == [("2.0", "3.0"), ("2.0", "0.25"), (None, None)]
    claim["numbers"][0]["row"] = "width"
    with pytest.raises(KeyError, match="width"):
        list(numbers(claim, tmp_path))
