"""Tests that are skipped while nothing that they read has changed since they last passed.

`@pytest.mark.unchanged("docs", "README.md")` says what a test reads beside its own file, what that
imports of the tests, and the packages that these import or it names, whole, with those below them.
The digest of all this, of Python and of what is installed is written to `.passed`, which is under
no version control, once the test has passed.  EVERY_TEST=1 runs all, and so does a fresh clone.
"""

import ast
import hashlib
import os
import sys
from functools import cache
from importlib.metadata import distributions

import pytest

PACKAGES = ("derivations", "tensegrity", "granular", "figures", "benchmarks")  # upward
MADE = {"__pycache__", "output", "_build", "_made", ".mypy_cache"}  # folders that are no sources


@cache
def installed():
    """Python, the compiler that was asked for, and all distributions."""
    found = sorted({f"{one.metadata['Name']} {one.version}" for one in distributions()})
    return f"{sys.version} {os.environ.get('CC')} {found}"


@cache
def imported(path):
    """Parts of the names of modules, and of what is in them, that a file imports anywhere."""
    found = set()
    for node in ast.walk(ast.parse(path.read_bytes())):
        if isinstance(node, (ast.Import, ast.ImportFrom)):
            names = [getattr(node, "module", None) or "", *(one.name for one in node.names)]
            found |= {part for name in names for part in name.split(".")}
    return found


def sources(root, path, named):
    """Files and folders that a test reads: its own file's imports are followed in its folder."""
    todo, seen, packages = [path, path.parent / "conftest.py"], set(), set()
    while todo:
        one = todo.pop()
        if one not in seen and one.is_file():
            seen.add(one)
            packages |= imported(one).intersection(PACKAGES) if one.name != "conftest.py" else set()
            todo += [path.parent / f"{name}.py" for name in imported(one)]
    highest = max([PACKAGES.index(name) for name in packages | set(named) if name in PACKAGES],
                  default=-1)  # fmt: skip
    return seen | {root / name for name in (*PACKAGES[: highest + 1], *named)}


@cache
def content(path, changed, size):
    return hashlib.sha256(path.read_bytes()).digest()


def digest(root, places):
    """Digest of the names and contents of files, and of the files in folders."""
    files = {path for one in places for path in (one.rglob("*") if one.is_dir() else [one])}
    whole = hashlib.sha256(installed().encode())
    for path in sorted(files):
        made = path.suffix == ".lock" or not MADE.isdisjoint(path.relative_to(root).parts)
        if path.is_file() and not made:
            about = path.stat()
            whole.update(str(path.relative_to(root)).encode())
            whole.update(content(path, about.st_mtime_ns, about.st_size))
    return whole.hexdigest()


def record(item):
    """The file with the digest with which a test passed."""
    name = hashlib.sha256(item.nodeid.encode()).hexdigest()[:32]
    return item.config.rootpath / ".passed" / name


def read_by(item):
    """Digest of what a marked test reads, as it is now; None of other tests."""
    named = [name for mark in item.iter_markers("unchanged") for name in mark.args]
    if item.get_closest_marker("unchanged") is None:
        return None
    root = item.config.rootpath
    return digest(root, sources(root, item.path, named))


BEFORE, CALLED = pytest.StashKey(), pytest.StashKey()


def pytest_collection_modifyitems(items):
    known = {}  # items of one file mostly read the same
    for item in items:
        marks = tuple(mark.args for mark in item.iter_markers("unchanged"))
        if not marks:
            continue
        key = item.path, marks
        if key not in known:
            known[key] = read_by(item)
        item.stash[BEFORE], path = known[key], record(item)
        if "EVERY_TEST" not in os.environ and path.is_file() and path.read_text() == known[key]:
            item.add_marker(pytest.mark.skip(reason="unchanged since it passed"))


@pytest.hookimpl(wrapper=True)
def pytest_runtest_makereport(item, call):
    report = yield
    if BEFORE in item.stash:
        if call.when == "call":
            item.stash[CALLED] = report.outcome
        passed = report.passed and item.stash.get(CALLED, None) == "passed"
        if call.when == "teardown" and passed and read_by(item) == item.stash[BEFORE]:
            path = record(item)
            path.parent.mkdir(exist_ok=True)
            path.write_text(item.stash[BEFORE])
        elif not report.passed and not report.skipped:
            record(item).unlink(missing_ok=True)
    return report
