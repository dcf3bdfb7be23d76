"""Imports go downward only, without cycles, and `import tensegrity` stays light."""

import ast
import subprocess
import sys
from functools import cache
from graphlib import TopologicalSorter
from pathlib import Path

import pytest
from syntax import tree

pytestmark = pytest.mark.unchanged("benchmarks")

ROOT = Path(__file__).parent.parent
PACKAGES = ("derivations", "tensegrity", "granular", "figures", "benchmarks")
BASE = [
    "unit_names",
    "errors",
    "typing",
    "check",
    "checked",
    "columns",
    "likelihood",
    "once",
    "readonly",
    "root",
    "frames",
    "minimum",
    "notebook",
    "plotting",
    "printing",
]  # modules that every room may use
ROOMS = [  # inside tensegrity: each may import what stands before it
    "engine",
    "springs",
    "branches",
    "unit",
    "scenes",
    "structures",
    "lattices",
    "prisms",
    "catalogue",
    "runs",
    "precision",
    "waves",
    "proofs",
    "orbits",
    "measure",
    "gradients",
    "files",
]
ABOVE = ["objective", "animation", "__main__"]  # modules for users that no room uses


@cache
def nodes():
    """Path, and every node of what stands there, of every module of ours: read once."""
    paths = [p for package in PACKAGES for p in sorted((ROOT / package).rglob("*.py"))]
    return [(path, list(ast.walk(tree(path)))) for path in paths]


@cache
def imports():
    """(importing module, imported module of ours) for every import, wherever it stands."""
    found = []
    for path, inside in nodes():
        name = ".".join(path.relative_to(ROOT).with_suffix("").parts)
        for node in inside:
            if isinstance(node, ast.Import):
                targets = [alias.name for alias in node.names]
            elif isinstance(node, ast.ImportFrom) and node.module:
                targets = [f"{node.module}.{alias.name}" for alias in node.names]
            else:
                targets = []
            found += [(name.removesuffix(".__init__"), target) for target in targets
                      if target.split(".")[0] in PACKAGES]  # fmt: skip
    return found


def test_packages_import_downward_only():
    lowest = {"derivations": 0, "tensegrity": 1, "granular": 2, "figures": 3, "benchmarks": 4}
    for importer, imported in imports():
        upper, lower = importer.split(".")[0], imported.split(".")[0]
        assert upper == lower or lowest[lower] < lowest[upper], f"{importer} imports {imported}"


def test_no_modules_import_each_other_in_a_circle():
    modules = {".".join(p.relative_to(ROOT).with_suffix("").parts).removesuffix(".__init__")
               for package in PACKAGES for p in (ROOT / package).rglob("*.py")}  # fmt: skip
    needs = {module: set() for module in modules}
    for importer, imported in imports():
        found = imported if imported in modules else imported.rpartition(".")[0]
        assert found in modules, f"{importer} imports {imported}, which is no file"
        needs[importer].add(found)
    TopologicalSorter(needs).prepare()  # CycleError names the circle


def place(module):
    """Where in the order a module of tensegrity stands, by the second part of its name."""
    return [*BASE, *ROOMS, *ABOVE].index(module.split(".")[1])


def test_rooms_of_tensegrity_import_downward_only():
    """Also inside a room no module imports another that imports it: see the test of circles."""
    parts = {p.stem for p in (ROOT / "tensegrity").glob("*.py")} - {"__init__"}
    parts |= {p.parent.name for p in (ROOT / "tensegrity").glob("*/__init__.py")}
    assert parts == {*BASE, *ROOMS, *ABOVE}, "give each room a place in the order"
    for importer, imported in imports():
        if importer.startswith("tensegrity.") and imported.startswith("tensegrity."):
            assert imported.split(".")[1] in (*BASE, *ROOMS, *ABOVE), (
                f"{importer} imports {imported} from the package itself"
            )
            assert place(imported) <= place(importer), f"{importer} imports {imported}"


def test_rooms_say_what_lives_in_them():
    for room in ROOMS:
        text = (ROOT / "tensegrity" / room / "__init__.py").read_text()
        assert len(ast.get_docstring(ast.parse(text)) or "") > 60, room


def test_derivations_use_sympy_only():
    allowed = {"sympy", "mpmath", "derivations", "tqdm"} | set(sys.stdlib_module_names)
    for path in (ROOT / "derivations").glob("*.py"):
        for node in ast.walk(tree(path)):
            names = []
            if isinstance(node, ast.Import):
                names = [alias.name for alias in node.names]
            elif isinstance(node, ast.ImportFrom):
                names = [node.module or ""]
            for name in names:
                assert name.split(".")[0] in allowed, f"{path.name} imports {name}"


def test_importing_tensegrity_loads_no_heavy_package():
    heavy = "sympy matplotlib casadi scipy numba tqdm"
    code = f"import sys, tensegrity; print(*[m for m in '{heavy}'.split() if m in sys.modules])"
    answer = subprocess.run(
        [sys.executable, "-c", code], cwd=ROOT, capture_output=True, text=True, check=True
    )
    assert answer.stdout.split() == []


def private(name):
    named_tuple = name in ("_asdict", "_replace")  # its public methods
    return name.startswith("_") and not name.endswith("__") and not named_tuple


def room_of(path):
    """A package, or a room of tensegrity."""
    parts = path.relative_to(ROOT).parts
    return parts[:2] if parts[0] == "tensegrity" and len(parts) > 2 else parts[:1]


def test_private_names_stay_in_their_room():
    """What begins with an underscore is used where it is defined only; figures have files of
    their own that begin so."""
    rooms = {}
    for path, inside in nodes():
        rooms.setdefault(room_of(path), []).append((path, inside))
    for modules in rooms.values():
        known = {f"{path.stem}" for path, _ in modules}
        room = [(path, node) for path, inside in modules for node in inside]
        for _, node in room:
            if isinstance(node, (ast.FunctionDef, ast.ClassDef)):
                known.add(node.name)
            elif isinstance(node, ast.Attribute) and isinstance(node.ctx, ast.Store):
                known.add(node.attr)
            elif isinstance(node, ast.Name) and isinstance(node.ctx, ast.Store):
                known.add(node.id)
        for path, node in room:
            if isinstance(node, ast.Attribute):
                used, own = [node.attr], getattr(node.value, "id", "") in ("self", "cls")
            elif isinstance(node, ast.ImportFrom):
                used, own = [alias.name for alias in node.names], False
            else:
                continue
            for name in used:
                assert own or not private(name) or name in known, f"{path} uses {name}"
