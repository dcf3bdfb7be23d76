"""`python -m tensegrity`: what a bug report says."""

import math
import os
import subprocess
import sys
from pathlib import Path

import pytest
from PIL import Image

from granular import demo
from tensegrity import __main__ as own
from tensegrity.errors import CompilerError, EquilibriumError

pytestmark = pytest.mark.unchanged("granular")

PATHS = os.environ | {"PYTHONPATH": str(Path(__file__).parent.parent)}


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
def test_it_takes_no_arguments_but_help_clean_and_demo(word, code, capsys):
    with pytest.raises(SystemExit) as left:
        own.main([word])
    assert left.value.code == code
    assert "self-test" in capsys.readouterr().out or code


def test_the_demonstration_finds_its_numbers_right_and_draws(tmp_path):
    command = [sys.executable, "-m", "tensegrity", "demo"]
    answer = subprocess.run(
        command, cwd=tmp_path, env=PATHS, capture_output=True, text=True, timeout=300
    )
    assert answer.returncode == 0, answer.stdout + answer.stderr
    assert answer.stdout.count(": error ") == 4
    assert "575.76 N on the floor after 220 us" in answer.stdout
    assert {path.name for path in tmp_path.iterdir()} == {
        "tensegrity-demo.png",
        "tensegrity-demo.gif",
    }
    assert (tmp_path / "tensegrity-demo.png").read_bytes().startswith(b"\x89PNG")
    with Image.open(tmp_path / "tensegrity-demo.gif") as film:
        assert film.n_frames == demo.FRAMES


def test_a_number_of_the_demonstration_that_is_wrong_is_seen():
    found = demo.computed()
    assert all(error <= bound for _, error, bound in demo.checks(found))
    late = found._replace(passed=found.passed + 0.001)
    assert [error <= bound for _, error, bound in demo.checks(late)] == [True, True, False, True]


def test_an_interrupted_demonstration_keeps_what_is_done(tmp_path, monkeypatch, capsys):
    monkeypatch.chdir(tmp_path)
    whole = demo.draw

    def draw(figure, found):
        show, left = whole(figure, found), iter(range(4))

        def stopped(part):
            if next(left, None) is None:
                raise KeyboardInterrupt
            return show(part)

        return stopped

    monkeypatch.setattr(demo, "draw", draw)
    assert demo.main() == demo.INTERRUPTED
    assert [path.name for path in tmp_path.iterdir()] == ["tensegrity-demo.png"]
    said = capsys.readouterr().out
    assert "one instant\ninterrupted" in said
    assert ".gif" not in said
