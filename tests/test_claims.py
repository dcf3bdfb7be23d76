"""The claims of the sources: each says where its numbers stand, and they are there."""

import tomllib
from inspect import getsource
from pathlib import Path

import pytest
from claims import VERDICTS, changes, claims, numbers

from derivations import ledger
from derivations.argument import Verdict
from figures import _composite, _guide, _measure, _packs, claims_inputs, pictures
from figures._files import PRINTED, write_tables

pytestmark = pytest.mark.unchanged("docs")

ROOT = Path(__file__).parent.parent
OUTPUT = ROOT / "figures" / "output"
HELPERS = (_composite, _guide, _measure, _packs)  # have the columns of lines that are printed
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


FAMILIES = {  # pictures of numbers from exact waves, fits to several runs, or derivations
    "solitary_errors", "wave_supercompact", "softening_families", "granular_uniform", "composite",
    "proven_waves",
}  # fmt: skip
FOLLOWED = {*claims_inputs.CASES, "composite_spread"}
ABOUT = ("Solitary waves on tensegrity chains", "Softening and composite chains",
         "The Y-shaped guide", "The full guide")  # fmt: skip


def test_numbers_of_single_runs_are_followed_as_their_input_changes():
    shown = {one["picture"] for claim in claims() if claim["about"] in ABOUT
             for one in claim.get("numbers", ())}  # fmt: skip
    assert shown >= FAMILIES
    assert shown <= FOLLOWED | FAMILIES


def sizes(picture, change, *, but=()):
    found = claims_inputs.moved(picture)
    assert found
    k = list(claims_inputs.CHANGES).index(change)
    return {row: abs(moved[k]) for (row, _), (_, moved) in found.items()
            if not any(word in row for word in but)}  # fmt: skip


@pytest.mark.parametrize("picture", ["wave_power_law", "wave_softening", "granular_steps"])
def test_numbers_change_about_as_much_as_their_input(picture):
    assert 0 < max(sizes(picture, "1e-6").values()) < 1e-5
    assert 0 < max(sizes(picture, "1 %").values()) < 0.05


def test_lines_between_walls_become_chaotic():
    """Until 2 ms as much as the input, and from 20 ms on by a tenth."""
    moved = sizes("packs_thermal", "1e-6")
    early = {row: x for row, x in moved.items() if " 0 to " in row}
    late = {row: x for row, x in moved.items() if "heavy over light beads, 20 to 40" in row}
    assert max(early.values()) < 1e-6
    assert 0.01 < max(late.values()) < 0.3


@pytest.mark.slow
@pytest.mark.parametrize(
    "picture", sorted(set(claims_inputs.CASES) - {"packs_thermal", "granular_energy"})
)
def test_numbers_of_no_run_of_a_chain_or_guide_are_chaotic(picture):
    counts = ("fraction of phases",)
    assert max(sizes(picture, "1e-6", but=counts).values()) < 1e-4
    assert max(sizes(picture, "1 %", but=counts).values()) < 0.1


def test_changes_of_a_number_are_read(tmp_path):
    (tmp_path / claims_inputs.GROUP).mkdir()
    line = {"picture": "granular_fig2", "row": "speed", "quantity": "", "input": "speed",
            "value": 2.0, "1e-6": 3e-9, "1 %": 4e-5}  # fmt: skip
    write_tables(tmp_path / "claims" / "claims_inputs.csv", {}, [line])
    (found,) = changes({"picture": "granular_fig2", "row": "speed"}, tmp_path)
    assert (found["1e-6"], found["1 %"]) == ("3e-09", "4e-05")
    assert changes({"picture": "granular_fig2", "row": "width"}, tmp_path) == []
