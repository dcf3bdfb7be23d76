"""Runs and gradients give what they gave: `golden.py` says how its file is made."""

import numpy as np
import pytest
from golden import LOOSER, NOTHING, ROUND_OFF, cases, machine, results, stored

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
    (bound,) = [x for start, x in LOOSER.items() if name.startswith(start)] or [ROUND_OFF]
    for field, value in wanted.items():
        if same or value.dtype.kind == "U":
            numbers = value.dtype.kind in "fc"
            assert np.array_equal(found[field], value, equal_nan=numbers), field
        elif not of_its_digits(name, field):
            scale = np.max(np.abs(value), initial=0.0, where=np.isfinite(value))
            near = 1e-12 if f"{name}|{field}" in NOTHING else bound * scale
            assert found[field].shape == value.shape, field
            assert np.allclose(found[field], value, rtol=0, atol=near, equal_nan=True), field


def of_its_digits(name, field):
    """Whether a result depends on last digits: of runs that are compared with each other, and
    where the rows of a path fall."""
    row = name.startswith("paths") and not field.startswith(("event", "end"))
    return row or field in ("steps", "error_estimate")


def test_there_are_no_other_results(golden):
    assert {name.split("|")[0] for name in golden} == {*CASES, "machine"}
