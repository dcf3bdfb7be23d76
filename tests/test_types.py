"""What `py.typed` promises: signatures that say what they take and give."""

import ast
import importlib
import tomllib
from pathlib import Path

import pytest

pytestmark = pytest.mark.unchanged("granular", "pyproject.toml", "tests")

ROOT = Path(__file__).parent.parent
MODULES = sorted(
    path
    for package in ("tensegrity", "granular", "derivations")
    for path in (ROOT / package).glob("*.py")
    if path.stem != "once"
)
PUBLIC = [  # doors
    "tensegrity",
    "tensegrity.objective",
    "tensegrity.catalogue",
    "tensegrity.files",
    "granular",
    "granular.design",
    "granular.lammps",
]


def public_functions(body, within=""):
    """Functions, and methods of classes, whose names do not begin with one underscore."""
    for node in body:
        name = getattr(node, "name", "")
        if name.startswith("_") and not name.startswith("__"):
            continue
        if isinstance(node, ast.ClassDef):
            yield from public_functions(node.body, f"{name}.")
        elif isinstance(node, ast.FunctionDef):
            yield f"{within}{name}", node


def untyped(function):
    """Names of what has no annotation: arguments but self and cls, and "return"."""
    given = function.args
    extra = [one for one in (given.vararg, given.kwarg) if one]
    every = [*given.posonlyargs, *given.args, *given.kwonlyargs, *extra]
    missing = [a.arg for a in every if a.annotation is None and a.arg not in ("self", "cls")]
    return missing + ["return"] * (function.returns is None)


@pytest.mark.parametrize("path", MODULES, ids=lambda path: f"{path.parent.name}.{path.stem}")
def test_public_callables_say_what_they_take_and_give(path):
    found = dict(public_functions(ast.parse(path.read_text()).body))
    assert {name: untyped(one) for name, one in found.items() if untyped(one)} == {}


def relaxed():
    """Modules about which the type checker is not strict."""
    settings = tomllib.loads((ROOT / "pyproject.toml").read_text())["tool"]["mypy"]
    assert settings["strict"]
    assert "tests/typing_usage.py" in settings["files"]
    return {name for one in settings["overrides"] for name in one["module"]}


def test_every_public_name_is_used_before_the_type_checker():
    tree = ast.parse((ROOT / "tests" / "typing_usage.py").read_text())
    used = {node.id for node in ast.walk(tree) if isinstance(node, ast.Name)}
    used |= {node.attr for node in ast.walk(tree) if isinstance(node, ast.Attribute)}
    names = {name for door in PUBLIC for name in importlib.import_module(door).__all__}
    assert names - used == set()


def test_checker_is_strict_about_the_modules_of_public_names():
    assert relaxed().isdisjoint(PUBLIC)
    assert not [name for name in relaxed() if name.startswith("granular")]
