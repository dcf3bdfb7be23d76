"""Docstrings: sections of public functions with several arguments, and examples that run."""

import ast
import doctest
import importlib
import inspect
import re
from pathlib import Path

import pytest
from test_interface import names

pytestmark = pytest.mark.unchanged("granular", "README.md", "docs")

ROOT = Path(__file__).parent.parent
PACKAGES = ("derivations", "tensegrity", "granular")
MOST_BARE = 2  # arguments of a function that one sentence may describe
MOST_USED = 30  # public names with an example that runs: those that the guide calls most


def is_overload(node):
    return any("overload" in ast.dump(one) for one in node.decorator_list)


def public(body, within=""):
    """Functions and methods without an underscore, (name, node), overloads left out."""
    for node in body:
        name = getattr(node, "name", "_")
        if name.startswith("_"):
            continue
        if isinstance(node, ast.ClassDef):
            yield from public(node.body, f"{within}{name}.")
        elif isinstance(node, ast.FunctionDef) and not is_overload(node):
            yield f"{within}{name}", node


def wanted_sections(node):
    """What a numpydoc docstring of this function has to have."""
    given = node.args
    names = [one.arg for one in (*given.posonlyargs, *given.args, *given.kwonlyargs)]
    if len([name for name in names if name not in ("self", "cls")]) <= MOST_BARE:
        return set()
    found = {type(one) for one in ast.walk(node)}
    returns = any(isinstance(one, ast.Return) and one.value for one in ast.walk(node))
    made = {"Yields"} if found & {ast.Yield, ast.YieldFrom} else {"Returns"} if returns else set()
    return {"Parameters"} | made | ({"Raises"} if ast.Raise in found else set())


def test_public_functions_of_several_arguments_have_all_sections():
    missing = []
    for path in (p for package in PACKAGES for p in (ROOT / package).rglob("*.py")):
        for name, node in public(ast.parse(path.read_text()).body):
            text = ast.get_docstring(node) or ""
            lacks = {one for one in wanted_sections(node) if f"{one}\n---" not in text}
            if lacks - ({"Returns", "Yields"} if "Yields\n---" in text else set()):
                missing.append(f"{path.relative_to(ROOT)} {name}: {', '.join(sorted(lacks))}")
    assert missing == []


def modules_with_examples():
    for package in PACKAGES:
        for path in sorted((ROOT / package).rglob("*.py")):
            if ">>> " in path.read_text():
                yield ".".join(path.relative_to(ROOT).with_suffix("").parts)


class Finder(doctest.DocTestFinder):
    """One that knows where a `checked` function was defined."""

    def _from_module(self, module, thing):
        return super()._from_module(module, inspect.unwrap(thing))


@pytest.mark.parametrize("name", list(modules_with_examples()))
def test_examples_give_what_they_say(name, tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    module = importlib.import_module(name.removesuffix(".__init__"))
    found = [test for test in Finder().find(module) if test.examples]
    assert found
    assert [test.name for test in found if doctest.DocTestRunner().run(test).failed] == []


def test_names_that_are_used_most_have_an_example():
    pages = [ROOT / "README.md", *sorted((ROOT / "docs" / "guide").glob("*.md"))]
    text = "\n".join(page.read_text() for page in pages)
    calls = {
        name: len(re.findall(rf"(?<![\w.]){name.rpartition('.')[2]}\(", text)) for name in names()
    }
    most = sorted(calls, key=lambda name: (-calls[name], name))[:MOST_USED]
    assert [name for name in most if ">>> " not in (inspect.getdoc(names()[name]) or "")] == []
