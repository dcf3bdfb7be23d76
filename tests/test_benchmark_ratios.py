"""Ratios of benchmarks: what is recorded, saved, and told when it is compared."""

import json
import sys
from types import SimpleNamespace

import numpy as np
import pytest

from benchmarks import __main__ as program
from benchmarks import _timing

pytestmark = pytest.mark.unchanged()


@pytest.fixture
def fake(monkeypatch):
    """A benchmark in place of `fresh`; its ratios are in the dictionary."""
    slower = {"by": 1.0}

    def main():
        rows = [("12 beads", 7.0, 2.0 * slower["by"], 4.0, "<= 3"), ("none", 1.0, np.nan, "-", "")]
        heads = ["", "ns", "ours/bare", "peer/ours", "target"]
        _timing.table("loop (12 ms), here", heads, rows, ["ours/bare"], ["peer/ours"])
        _timing.record("call", "whole", "over its steps", 3.0, 4.0)

    monkeypatch.setitem(sys.modules, "benchmarks.fresh", SimpleNamespace(main=main))
    return slower


RATIOS = {
    "fresh/loop/12 beads/ours/bare": 2.0,
    "fresh/loop/12 beads/peer/ours": 0.25,
    "fresh/call/whole/over its steps": 0.75,
}


def test_ratios_are_saved_and_no_times(fake, tmp_path):
    file = tmp_path / "ratios.json"
    assert program.main(["--save", str(file), "fresh"]) == 0
    saved = json.loads(file.read_text())
    assert saved.pop("ratios") == RATIOS
    assert saved.keys() == {"commit", "cpu", "compiler", "date"}
    assert all(saved.values())


@pytest.mark.parametrize(
    ("by", "code", "mark"),
    [(1.0, 0, "+0%"), (1.14, 0, "+14%"), (1.16, 1, "+16% WORSE"), (0.84, 0, "-16% better")],
)
def test_what_changed_by_more_than_15_per_cent_is_marked(fake, tmp_path, capsys, by, code, mark):
    file = tmp_path / "ratios.json"
    program.main(["--save", str(file), "fresh"])
    saved = json.loads(file.read_text())
    saved["ratios"] |= {"fresh/gone/x/y": 1.0, "engine/not/run/now": 1.0}
    file.write_text(json.dumps(saved))
    fake["by"] = by
    capsys.readouterr()
    assert program.main(["--compare", str(file), "fresh"]) == code
    said = capsys.readouterr().out.splitlines()
    lines = {key: line.split() for line in said for key in RATIOS if line.endswith(key)}
    assert lines.keys() == RATIOS.keys()
    then, now, *words = lines["fresh/loop/12 beads/ours/bare"]
    assert (then, now) == ("2", f"{2 * by:.3g}")
    assert " ".join(words).startswith(mark + " fresh/")
    assert any("only then" in line and line.endswith("fresh/gone/x/y") for line in said)
    assert not any("engine/not" in line for line in said)


def test_an_unknown_benchmark_is_refused(capsys):
    with pytest.raises(SystemExit):
        program.main(["no-such-thing"])
    assert "unknown benchmark 'no-such-thing'" in capsys.readouterr().err
