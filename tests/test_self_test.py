"""`python -m tensegrity`: what a bug report says."""

import math
import subprocess
import sys

import pytest

from tensegrity import __main__ as own
from tensegrity.errors import CompilerError, EquilibriumError


def test_it_names_what_is_installed_and_finds_its_numbers_right():
    command = [sys.executable, "-m", "tensegrity"]
    answer = subprocess.run(command, capture_output=True, text=True, timeout=120)
    assert answer.returncode == 0, answer.stdout + answer.stderr
    rows = dict(line.split(maxsplit=1) for line in answer.stdout.splitlines() if line[0] != "o")
    assert {"versions", "python", "compiler", "cache", "threads", "self-test"} == rows.keys()
    assert "numpy 2" in rows["versions"] or "numpy 1" in rows["versions"]
    assert rows["self-test"].startswith("passed")
    assert answer.stdout.count("\nok ") == 6
    assert answer.stderr == ""


def off(error):
    return lambda: [own.Check("a number", error, 1e-9)]


def failing():
    raise EquilibriumError("lost")


@pytest.mark.parametrize("check", [off(2e-9), off(math.nan), off(math.inf), failing])
def test_a_number_that_is_wrong_or_none_fails_it(monkeypatch, capsys, check):
    monkeypatch.setattr(own, "CHECKS", (off(1e-10), check))
    assert own.main([]) == 1
    said = capsys.readouterr().out
    assert "1 WRONG in" in said
    assert said.count("\nWRONG ") == 1


def test_without_a_compiler_it_says_so_and_goes_on(monkeypatch, capsys):
    def none(*_):
        raise CompilerError("no C compiler found")

    monkeypatch.setattr(own, "require", none)
    monkeypatch.setattr(own, "CHECKS", (off(0.0),))
    assert own.main([]) == 0
    assert "none: no C compiler found" in capsys.readouterr().out


@pytest.mark.parametrize(("word", "code"), [("--help", 0), ("-h", 0), ("--no", 2), ("no", 2)])
def test_it_takes_no_arguments_but_help_and_clean(word, code, capsys):
    with pytest.raises(SystemExit) as left:
        own.main([word])
    assert left.value.code == code
    assert "self-test" in capsys.readouterr().out or code
