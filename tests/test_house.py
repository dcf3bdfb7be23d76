"""The house stays small: files, functions, chains of imports, members of scenes, what tests see.

Each limit stands beside the value that is aimed at, where it is not reached yet.
"""

import ast
import re
import sys
from collections import Counter
from functools import cache
from pathlib import Path

import pytest
from networks import patch
from scenes import prism_chain
from syntax import tree

import granular
from tests import faults

pytestmark = pytest.mark.unchanged("benchmarks", "docs", "tests", "CONTRIBUTING.md")

ROOT = Path(__file__).parent.parent
PACKAGES = ("derivations", "tensegrity", "granular")
LONGEST = 450  # lines of a file
DECISIONS = 20  # and one more paths through a function that decides so often
MOST_ARGUMENTS = 10  # of a private function
CHAIN = 38  # modules, each imported by the one before; aim: 30
MEMBERS = {"Chain": 24, "Network": 32, "BeadChain": 40, "Guide": 40, "Pack": 41}
DEFINITIONS = (ast.FunctionDef, ast.AsyncFunctionDef, ast.ClassDef)
DIALECT = re.compile(
    r"_*(judge|rung|outlook|book|course|crew|kept|told|sound|remembered|seeds|sow|asked|rises|apart"
    r"|likely)_*"
)
FUNCTION_IN_C = re.compile(r"^[a-z][\w *]*[ *](\w+)\(", re.MULTILINE)
MOST_TERMS = 40
INSIDE = re.compile(r"\btensegrity\.(engine|runs|scenes\.\w*(dynamics|batch))\b")
LOOKING_INSIDE = 10  # files of tests
REPLACED = 54  # parts of the house that tests replace; figures have 25; aim: those
CLOCK = re.compile(r"\b(monotonic|perf_counter|process_time|sleep)\b")
CLOCKS = {
    "browser.py",
    "test_live.py",
    "test_live_page.py",
}  # files of tests that wait for a browser


@cache
def sources():
    """{path from the root: syntax tree} of the three packages."""
    paths = [p for room in PACKAGES for p in sorted((ROOT / room).rglob("*.py"))]
    return {str(p.relative_to(ROOT)): tree(p) for p in paths}


def functions():
    """(Path and name, node) of every function."""
    for path, whole in sources().items():
        for node in ast.walk(whole):
            if isinstance(node, (ast.FunctionDef, ast.AsyncFunctionDef)):
                yield f"{path} {node.name}", node


def complexity(function):
    """McCabe's number: one more than the decisions, those of functions inside with them."""
    count = 1
    for node in ast.walk(function):
        if isinstance(node, ast.BoolOp):
            count += len(node.values) - 1
        elif isinstance(node, ast.comprehension):
            count += 1 + len(node.ifs)
        else:
            count += isinstance(node, (ast.If, ast.For, ast.While, ast.ExceptHandler, ast.IfExp,
                                       ast.Assert, ast.match_case))  # fmt: skip
    return count


def test_no_file_is_long():
    paths = [p for room in PACKAGES for p in (ROOT / room).rglob("*.[pch]*") if p.is_file()]
    found = {str(p.relative_to(ROOT)): p for p in paths if p.suffix in (".py", ".c", ".h")}
    lines = {name: len(p.read_text().splitlines()) for name, p in found.items()}
    assert {k: n for k, n in lines.items() if n > LONGEST} == {}


def test_no_function_is_tangled():
    found = {name: complexity(node) for name, node in functions()}
    assert {k: n for k, n in found.items() if n > DECISIONS} == {}


def test_no_private_function_has_many_arguments():
    for name, node in functions():
        given = node.args
        count = len([*given.posonlyargs, *given.args, *given.kwonlyargs])
        private = node.name.startswith("_") and not node.name.endswith("__")
        assert not private or count <= MOST_ARGUMENTS, name


def imported(parent, modules):
    """Modules of ours that one imports where it runs: not those for the type checker alone."""
    for node in ast.iter_child_nodes(parent):
        if isinstance(node, ast.If) and "TYPE_CHECKING" in ast.dump(node.test):
            continue
        names = []
        if isinstance(node, ast.Import):
            names = [one.name for one in node.names]
        elif isinstance(node, ast.ImportFrom) and node.module:
            names = [node.module, *(f"{node.module}.{one.name}" for one in node.names)]
        yield from (name for name in names if name in modules)
        yield from imported(node, modules)


def test_chains_of_imports_are_short():
    modules = {p.removesuffix(".py").removesuffix("/__init__").replace("/", "."): t
               for p, t in sources().items()}  # fmt: skip
    needs = {name: set(imported(t, modules)) - {name} for name, t in modules.items()}

    def longest(name, above=()):
        if name not in found:
            below = [longest(k, (*above, name)) for k in needs[name] if k not in above]
            found[name] = (name, *max(below, key=len, default=()))
        return found[name]

    found = {}
    chain = max(map(longest, modules), key=len)
    assert len(chain) <= CHAIN, " -> ".join(chain)


def test_names_are_words_of_the_field():
    """A module, a class or a function has no name that only its authors understand."""
    found = []
    for folder in (
        "derivations",
        "tensegrity",
        "granular",
        "figures",
        "benchmarks",
        "docs",
        "tests",
    ):
        for path in (ROOT / folder).rglob("*.py"):
            nodes = list(ast.walk(tree(path)))
            names = [path.stem, *(node.name for node in nodes if isinstance(node, DEFINITIONS))]
            found += [(path, name) for name in names if DIALECT.fullmatch(name.lower())]
    live = ROOT / "docs" / "live"
    for path in [*(ROOT / "tensegrity").rglob("*.[ch]"), *live.glob("*.c"), *live.glob("*.js")]:
        names = FUNCTION_IN_C.findall(path.read_text())
        found += [(path, name) for name in names if DIALECT.fullmatch(name.lower())]
    assert found == []


def test_the_glossary_is_short():
    rows = (ROOT / "CONTRIBUTING.md").read_text().partition("## Words")[2].partition("\n## ")[0]
    terms = re.findall(r"^\| (?!term |---)(.+?) \|", rows, re.MULTILINE)
    assert 30 <= len(set(terms)) == len(terms) <= MOST_TERMS


def test_scenes_have_few_public_members():
    steel = granular.materials["steel"]
    bead = granular.Bead(5e-3, steel)
    scenes = (
        prism_chain(4), patch(3), granular.chain([bead] * 4), granular.y_guide(3, 3, bead=bead),
        granular.fcc_pack(2, 2, bead=bead, floor=steel, sides=steel),
    )  # fmt: skip
    for scene in scenes:
        found = [member for member in dir(scene) if not member.startswith("_")]
        assert len(found) <= MEMBERS[type(scene).__name__], found


@cache
def texts():
    """{name: text} of the files of tests but this one."""
    paths = sorted((ROOT / "tests").glob("*.py"))
    return {path.name: path.read_text() for path in paths if path != Path(__file__)}


def test_few_tests_look_inside():
    found = [name for name, text in texts().items() if INSIDE.search(text)]
    assert len(found) <= LOOKING_INSIDE, found


def replaced(name):
    """What tests replace a part of: modules, classes, and their names as text."""
    for node in ast.walk(tree(ROOT / "tests" / name)):
        if isinstance(node, ast.Call) and ast.unparse(node.func).endswith(".setattr"):
            yield ast.unparse(node.args[0]).strip("'")


def test_no_test_replaces_a_part_of_the_house():
    """What the system gives may be replaced: that a disk is full is not seen otherwise."""
    found = Counter()
    for name in texts():
        for what in replaced(name):
            found[name] += what.split(".")[0] not in {*sys.stdlib_module_names, "Path"}
    assert sum(found.values()) <= REPLACED, found


def test_no_test_waits_for_a_clock():
    assert {name for name, text in texts().items() if CLOCK.search(text)} <= CLOCKS


def test_every_source_has_tests_that_are_nearest():
    for path in (Path(name) for name in sources()):
        found = faults.nearest(path)
        assert found, path
        assert all((ROOT / test).exists() for test in found), path
