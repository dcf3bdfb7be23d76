"""Runs and gradients give what they gave: `golden.py` says how its file is made."""

import numpy as np
import pytest
from golden import ROUND_OFF, cases, machine, results, stored

CASES = cases()


@pytest.fixture(scope="module")
def golden():
    return stored()


@pytest.mark.parametrize("name", CASES)
def test_a_result_is_what_it_was(golden, name):
    wanted = {k.split("|", 1)[1]: v for k, v in golden.items() if k.startswith(f"{name}|")}
    found = results(CASES[name])
    assert found.keys() == wanted.keys()
    same = str(golden["machine"]) == machine()
    for field, value in wanted.items():
        if same or value.dtype.kind == "U":
            numbers = value.dtype.kind in "fc"
            assert np.array_equal(found[field], value, equal_nan=numbers), field
        elif field not in (
            "steps",
            "error_estimate",
        ):  # of runs that are compared to their last digits
            scale = np.max(np.abs(value), initial=0.0, where=np.isfinite(value))
            near = {"rtol": 0, "atol": ROUND_OFF * scale, "equal_nan": True}
            assert found[field].shape == value.shape, field
            assert np.allclose(found[field], value, **near), field


def test_there_are_no_other_results(golden):
    assert {name.split("|")[0] for name in golden} == {*CASES, "machine"}
