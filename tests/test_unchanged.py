"""Tests are skipped only while what they read is as it was when they passed."""

import os
import subprocess
import sys
from pathlib import Path

import pytest
import unchanged

TEST = """import pytest
from helper import read

pytestmark = pytest.mark.unchanged("docs", "notes.md")


def test_it():
    import tensegrity.springs
    assert read() == "good"
    with pytest.raises(OSError):
        open("no such file")


@pytest.mark.skipif("not __import__('pathlib').Path('here').exists()")
def test_other():
    pass
"""
HELPER = """from pathlib import Path


def read():
    return Path("docs/page").read_text()
"""


@pytest.fixture
def checkout(tmp_path):
    """What has a test that reads a page, with a helper, and two of the packages."""
    files = {
        "tests/test_it.py": TEST, "tests/helper.py": HELPER, "docs/page": "good",
        "docs/_build/index": "", "tensegrity/engine/loop.c": "int x;", "derivations/prism.py": "",
        "tensegrity/__init__.py": "", "tensegrity/springs.py": "", "granular/bead.py": "",
        "notes.md": "", "tests/conftest.py": "", "pyproject.toml": "[tool.pytest.ini_options]\n"
        "addopts = '--strict-markers'\nmarkers = ['unchanged(*paths): of files']\n",
    }  # fmt: skip
    for name, text in files.items():
        (tmp_path / name).parent.mkdir(parents=True, exist_ok=True)
        (tmp_path / name).write_text(text)
    return tmp_path


def counted(checkout, **environment):
    """Outcomes of the first test and the second, as letters."""
    given = {name: value for name, value in os.environ.items() if name != "EVERY_TEST"}
    given["PYTHONPATH"] = os.pathsep.join([str(Path(__file__).parent), str(checkout)])
    command = [
        sys.executable,
        "-B",
        "-m",
        "pytest",
        "-q",
        "-p",
        "unchanged",
        "-p",
        "no:cacheprovider",
    ]
    answer = subprocess.run(
        [*command, "-p", "no:xdist", "-p", "no:hypothesispytest", "tests"], cwd=checkout,
        env=given | environment, capture_output=True, text=True,
    )  # fmt: skip
    return answer.stdout[:2]


def test_what_passed_is_skipped_until_something_that_it_reads_changes(checkout):
    assert [counted(checkout) for _ in range(2)] == [".s", "ss"]
    (checkout / "tests" / "helper.py").write_text(HELPER + "\n")
    assert counted(checkout) == ".s"
    assert counted(checkout, EVERY_TEST="1") == ".s"


def test_a_digest_changes_with_each_file_that_is_read_and_with_no_other(checkout):
    """A file made beside the sources, and a package above what is imported, are not read."""

    def digest():
        test = checkout / "tests" / "test_it.py"
        return unchanged.digest(checkout, unchanged.sources(checkout, test, ["docs", "notes.md"]))

    seen = [digest()]
    for name in ("granular/bead.py", "docs/_build/index"):
        (checkout / name).write_text("other")
        assert digest() == seen[0]
    for name in ("tests/helper.py", "tensegrity/engine/loop.c", "derivations/prism.py", "notes.md"):
        (checkout / name).write_text("y = 1")
        seen.append(digest())
    (checkout / "docs" / "new").write_text("")
    seen.append(digest())
    (checkout / "docs" / "page").rename(checkout / "docs" / "renamed")
    assert len({*seen, digest()}) == len(seen) + 1


def test_what_failed_or_was_skipped_runs_again(checkout):
    (checkout / "docs" / "page").write_text("bad")
    assert [counted(checkout) for _ in range(2)] == ["Fs", "Fs"]
    (checkout / "docs" / "page").write_text("good")
    (checkout / "here").write_text("")
    assert [counted(checkout) for _ in range(2)] == ["..", "ss"]
    assert len(list((checkout / ".passed").iterdir())) == 2


def test_what_changes_while_a_test_runs_is_not_recorded(checkout):
    text = TEST.replace(
        "    import tensegrity", "    open('notes.md', 'a').write('x')\n    import tensegrity"
    )
    (checkout / "tests" / "test_it.py").write_text(text)
    assert counted(checkout) == ".s"
    assert not (checkout / ".passed").exists()
