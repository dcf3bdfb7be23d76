"""The table of faults does not rot: what it breaks stands in the code, what it runs exists."""

import os
import re
import signal
import subprocess
import sys
import time

import pytest
from faults import FAULTS, PATIENCE, ROOT, SLOWER, Fault, chosen, limit, main, survives, times

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


def test_a_test_that_does_not_end_notices_a_fault_and_is_ended(tmp_path):
    (tmp_path / "waits.py").write_text("LONG = 0\n")
    (tmp_path / "test_waits.py").write_text(
        "import time\nimport waits\n\n\ndef test_waits():\n    time.sleep(waits.LONG)\n"
    )
    fault = Fault("waits.py", "LONG = 0", "LONG = 1000", "test_waits.py::test_waits")
    started = time.monotonic()
    assert not survives(tmp_path, fault, seconds=3)
    assert time.monotonic() - started < 30


def test_a_test_has_time_by_what_it_took_unbroken(tmp_path):
    report = tmp_path / "report.xml"
    report.write_text(
        "<testsuites><testsuite>"
        '<testcase classname="tests.test_x" name="test_y[a]" time="2.5"/>'
        '<testcase classname="tests.test_x" name="test_y[b]" time="0.5"/>'
        '<testcase classname="tests.test_x" name="test_yes" time="100"/>'
        "</testsuite></testsuites>"
    )
    for test, seconds in (("test_y", 3.0), ("test_y[b]", 0.5), ("test_none", 0.0)):
        fault = Fault("x.py", "a", "b", f"tests/test_x.py::{test}")
        assert limit(fault, times(report)) == PATIENCE + SLOWER * seconds


def alive(number):
    """Whether a process runs."""
    try:
        with open(f"/proc/{number}/stat") as file:
            return file.read().rpartition(")")[2].split()[0] != "Z"
    except OSError:
        return False


@pytest.mark.skipif(not sys.platform.startswith("linux"), reason="processes are looked up in /proc")
@pytest.mark.parametrize("ended", [signal.SIGTERM, signal.SIGINT, signal.SIGKILL])
def test_what_a_trial_started_ends_with_it(tmp_path, ended):
    """The test itself, too, where the one who tries is killed."""
    (tmp_path / "test_waits.py").write_text(
        "import os, time\n\n\ndef test_waits():\n"
        "    open('number', 'w').write(str(os.getpid()))\n    time.sleep(1000)\n"
    )
    program = (
        "import signal, sys\nfrom pathlib import Path\nfrom faults import outcome\n"
        "signal.signal(signal.SIGTERM, lambda *_: sys.exit(1))\n"
        "signal.signal(signal.SIGINT, signal.default_int_handler)\n"  # a shell may ignore it
        "outcome(Path(sys.argv[1]), ['test_waits.py'], 1000)\n"
    )
    path = {"PYTHONPATH": str(ROOT / "tests")}
    trial = subprocess.Popen(
        [sys.executable, "-c", program, str(tmp_path)], env={**os.environ, **path},
        stderr=subprocess.DEVNULL,
    )  # fmt: skip
    number = tmp_path / "number"
    wait_until(lambda: number.exists() and number.read_text())
    trial.send_signal(ended)
    trial.wait(20)
    wait_until(lambda: not alive(int(number.read_text())))


def wait_until(condition):
    deadline = time.monotonic() + 30
    while not condition():
        assert time.monotonic() < deadline
        time.sleep(0.05)


def test_help_is_no_failure(capsys):
    with pytest.raises(SystemExit) as left:
        main(["--help"])
    assert left.value.code == 0
    assert "breaks a copy of the tree" in capsys.readouterr().out
