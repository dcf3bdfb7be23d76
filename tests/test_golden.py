"""Runs and gradients give what they gave: `golden.py` says how its file is made."""

import numpy as np
import pytest
from golden import PATH, ROUND_OFF, cases, machine, results

CASES = cases()


@pytest.fixture(scope="module")
def golden():
    with np.load(PATH) as file:
        return {name: file[name] for name in file.files}


@pytest.mark.parametrize("name", CASES)
def test_a_result_is_what_it_was(golden, name):
    wanted = {k.split("|")[1]: v for k, v in golden.items() if k.startswith(f"{name}|")}
    found = results(CASES[name])
    assert found.keys() == wanted.keys()
    same = str(golden["machine"]) == machine()
    for field, value in wanted.items():
        if same or value.dtype.kind == "U":
            assert np.array_equal(found[field], value), field
        elif field not in (
            "steps",
            "error_estimate",
        ):  # of runs that are compared to their last digits
            scale = np.max(np.abs(value), initial=0.0)
            assert np.abs(found[field] - value).max(initial=0.0) <= ROUND_OFF * scale, field


def test_there_are_no_other_results(golden):
    assert {name.split("|")[0] for name in golden} == {*CASES, "machine"}
