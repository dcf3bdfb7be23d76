"""The table of faults does not rot: what it breaks stands in the code, what it runs exists."""

import re

import pytest
from faults import FAULTS, ROOT, Fault, chosen, main, survives

ROOMS = ("derivations/", "tensegrity/", "granular/", "figures/", "docs/")


@pytest.mark.parametrize("fault", FAULTS, ids=lambda f: f"{f.file}: {f.text.strip()[:40]}")
def test_a_fault_can_be_made_and_its_test_exists(fault):
    source = (ROOT / fault.file).read_text()
    assert fault.broken(source) != source
    assert fault.file.startswith(ROOMS)
    path, name = fault.test.split("::")
    assert re.search(rf"^def {re.escape(name.split('[')[0])}\(", (ROOT / path).read_text(), re.M)


def test_text_that_stands_twice_or_never_is_refused():
    for source in ("a + b, a + b", "c"):
        with pytest.raises(ValueError, match="must be once"):
            Fault("x.py", "a + b", "a - b", "test_x.py::test_x").broken(source)
    assert len(set(FAULTS)) == len(FAULTS)


def test_a_fault_that_no_test_sees_is_said_to_survive(tmp_path):
    (tmp_path / "sums.py").write_text("def add(a, b):\n    return a + b\n")
    (tmp_path / "test_sums.py").write_text(
        "from sums import add\n\n\ndef test_good():\n    assert add(1, 2) == 3\n\n\n"
        "def test_blind():\n    assert add(1, 0) == 1\n"
    )
    noticed, missed, typo = (
        Fault("sums.py", "a + b", fault, f"test_sums.py::{test}")
        for fault, test in (("a - b", "test_good"), ("a - b", "test_blind"), ("a +", "test_good"))
    )
    assert not survives(tmp_path, noticed)
    assert survives(tmp_path, missed)
    assert survives(tmp_path, typo)  # code that cannot be read proves no test
    assert (tmp_path / "sums.py").read_text().endswith("a + b\n")


def test_a_word_that_picks_no_fault_is_a_failure(capsys):
    assert chosen(["clearance"])
    assert main(["no such fault"])
    assert "no fault" in capsys.readouterr().out
