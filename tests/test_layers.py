"""Imports go downward only, without cycles, and `import tensegrity` stays light."""

import ast
import subprocess
import sys
from graphlib import TopologicalSorter
from pathlib import Path

ROOT = Path(__file__).parent.parent
PACKAGES = ("derivations", "tensegrity", "granular", "figures", "benchmarks")
ORDER = [  # inside tensegrity: each may import what stands before it
    "typing",
    "errors",
    "once",
    "check",
    "readonly",
    "codegen",
    "native",
    "methods",
    "geometry",
    "forces",
    "bonds",
    "compiled",
    "plain",
    "interpreted",
    "implicit",
    "pieces",
    "kernel",
    "table",
    "arclength",
    "events",
    "continuation",
    "potential",
    "polynomial",
    "springs",
    "condensed",
    "prism",
    "response",
    "nodes",
    "limit",
    "scene",
    "stepping",
    "lattice",
    "ensemble",
    "walls",
    "clearance",
    "following",
    "network_input",
    "network",
    "rows",
    "record",
    "archive",
    "plotting",
    "run",
    "book",
    "loops",
    "march",
    "tolerance",
    "integrate",
    "resume",
    "asymptotics",
    "observables",
    "budget",
    "tuning",
    "excess",
    "travelling",
    "family",
    "solitary",
]


def imports():
    """(importing module, imported module of ours) for every import, wherever it stands."""
    for package in PACKAGES:
        for path in sorted((ROOT / package).rglob("*.py")):
            name = ".".join(path.relative_to(ROOT).with_suffix("").parts)
            for node in ast.walk(ast.parse(path.read_text())):
                if isinstance(node, ast.Import):
                    targets = [alias.name for alias in node.names]
                elif isinstance(node, ast.ImportFrom) and node.module:
                    targets = [f"{node.module}.{alias.name}" for alias in node.names]
                else:
                    targets = []
                for target in targets:
                    if target.split(".")[0] in PACKAGES:
                        yield name.removesuffix(".__init__"), target


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


def test_modules_of_tensegrity_import_downward_only():
    files = {p.stem for p in (ROOT / "tensegrity").glob("*.py")} - {"__init__"}
    assert files <= set(ORDER), f"give {files - set(ORDER)} a place in the order"
    for importer, imported in imports():
        if importer.startswith("tensegrity.") and imported.startswith("tensegrity."):
            upper, lower = importer.split(".")[1], imported.split(".")[1]
            if lower in ORDER:
                assert ORDER.index(lower) < ORDER.index(upper), f"{importer} imports {imported}"
            else:  # a name of a public module: only from a package above
                raise AssertionError(f"{importer} imports {imported} from the package itself")


def test_derivations_use_sympy_only():
    allowed = {"sympy", "mpmath", "derivations", "tqdm"} | set(sys.stdlib_module_names)
    for path in (ROOT / "derivations").glob("*.py"):
        for node in ast.walk(ast.parse(path.read_text())):
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
