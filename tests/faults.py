"""Random faults of one line: `python -m tests.faults [COUNT]` says how many of them tests notice.

Slips are made in the three packages, Python and C: a comparison or a condition turned round, plus
for minus, `and` for `or`, another number, a count off by one, a statement left out.  All that can
be made stand in the order of a hash of `SEED` and the fault's own name, so that a fault keeps its
place while other lines change; the first COUNT are tried, one by one, in a copy of the tree.  A
fault is noticed by a failing test of the files nearest to it, see `NEAREST`, or by one that does
not end.  `EQUIVALENT` names faults that no test can notice, which are not counted, and says why.
"""

from __future__ import annotations

import argparse
import ast
import contextlib
import hashlib
import os
import re
import shutil
import signal
import subprocess
import sys
import tempfile
from pathlib import Path

ROOT = Path(__file__).parent.parent
PACKAGES = ("derivations", "granular", "tensegrity")
OUTSIDE = shutil.ignore_patterns(".*", "*.egg-info", "build", "_build", "__pycache__")
SEED, COUNT = 35, 200
ASSUMPTIONS = "positive", "real", "nonnegative", "integer"  # of symbols, whose values they leave
PATIENCE = 900  # seconds for the tests of a fault
ENDLESS = -1  # instead of what pytest returns
OTHER = {
    "<": "<=", "<=": "<", ">": ">=", ">=": ">", "==": "!=", "!=": "==", "is": "is not",
    "is not": "is", "in": "not in", "not in": "in", "+": "-", "-": "+", "and": "or", "or": "and",
    "&&": "||", "||": "&&", "+=": "-=", "-=": "+=", "True": "False", "False": "True",
}  # fmt: skip
PYTHON_SIGN = re.compile(r"[\s)]*(<=?|>=?|[=!]=|is not|is|not in|in|[+-]=?|and|or)[\s(]")
C_SIGN = re.compile(r" (<=?|>=?|[=!]=|[+-]=?|&&|\|\|) ")
C_NUMBER = re.compile(r"(?<![\w.])(\d+\.\d*(?:e-?\d+)?|\d+)(?![\w.])")
C_CONDITION = re.compile(r"\bif (\(.+\))(?= \{| [a-z]|$)|(?<= )(\w+)(?= \? )")
C_STATEMENT = re.compile(r"^\s+([\w.>\[\]*-]+ [-+*]?= .+;|\w+\(.*\);)$")
NEAREST = {  # folders and files, and the tests of what stands there; those of its name come first
    "derivations": "derivations_prism derivations_waves derivations_numeric nodes derivations_ledger"
    " claims bistable",
    "granular/design": "design_search design_objective downhill gradients",
    "granular/lammps": "lammps bad_input",
    "granular": "granular_chain granular_guide granular_contact granular_layout packs"
    " packs_at_rest observables",
    "granular/contact": "contact_laws gradient_networks",
    "tensegrity/springs/over_time": "over_time",
    "tensegrity/minimum": "structure_path",
    "tensegrity/catalogue": "catalogue structure bistable",
    "tensegrity/branches": "continuation response structure_path condensed golden",
    "tensegrity/engine/reverse": "gradients gradient_networks golden",
    "tensegrity/engine/disk_cache": "native",
    "tensegrity/engine/native": "native",
    "tensegrity/engine/openings": "openings corners golden",
    "tensegrity/engine": "golden one_engine network openings corners driven methods limits"
    " integrate gradients",
    "tensegrity/gradients": "gradients gradient_input gradient_networks downhill golden",
    "tensegrity/measure": "budget observables pulses interfaces waves",
    "tensegrity/prisms": "prism response condensed fit continuation structure ngon units",
    "tensegrity/runs": "integrate golden resume record_times record_faults observe tolerance sweep"
    " limits archive driven_runs ground",
    "tensegrity/scenes": "network lattice golden driven following clearance ensemble one_engine"
    " limits ground",
    "tensegrity/springs": "polynomial corners classical_potentials search network one_engine golden"
    " copies",
    "tensegrity/structures": "structure structure_frames structure_path structure_snap"
    " structure_control structure_motion",
    "tensegrity/waves": "solitary prediction waves spectrum open_waves classical_potentials units"
    " transition",
    "tensegrity": "check bad_input notebook self_test export readonly copies",
}
EQUIVALENT = {
    "tensegrity/structures/active_set.py: radius = max(np.abs(x - begin).max(), small) -> "
    "radius = max(np.abs(x "
    "+ begin).max(), small)": "the region of the steps grows and shrinks as needed",
    "tensegrity/runs/tolerance.py: refinement = max(math.ceil(finest * factor), "
    "int(finest) + 1 if factor > 1 else 1) -> refinement = max(math.ceil(finest * factor), "
    "int(finest) - 1 if factor "
    "> 1 else 1)": "a number above that of the finest run rounds up to the next whole one",
    "tensegrity/prisms/closed.py: high = most "
    "* (1 - 1e-16) -> high = most * (1 - 1.5e-16)": "both factors are the number next to 1",
    "tensegrity/engine/energies.py: self._fraction_table = (SEARCH_GRID * 3)(*self._each) "
    "-> self._fraction_table "
    "= (SEARCH_GRID * 4)(*self._each)": "a table longer by an entry that is not read",
    'tensegrity/engine/programs.py: return root if e.exp > 0 else put("Pow", root, '
    "place(sp.Integer(-1))) -> return root if "
    'e.exp >= 0 else put("Pow", root, place(sp.Integer(-1)))': "the exponent is 1/2 or -1/2",
    "tensegrity/springs/signals.py: scale = float(np.max(np.abs(signal(np.linspace(0, "
    "t_end, INTERVALS + 1))))) -> scale = float(np.max(np.abs(signal(np.linspace(0, "
    "t_end, INTERVALS + 2)))))": "another sample of the size below which jumps are round-off",
    "tensegrity/engine/reverse.py: self.rows = self.sites + 1 if self.dim else packs + "
    "PACK -> self.rows = self.sites "
    "+ 2 if self.dim else packs + PACK": "a buffer longer by a row that is not read",
    'tensegrity/engine/reverse.py: scratch |= {"low": n, "high": n, "travel": 1} -> '
    "scratch "
    '|= {"low": n, "high": n, "travel": 2}': "a buffer longer by an entry that is not read",
    "tensegrity/prisms/curve.py: new = aim if low < aim < high else (low + min(high, low + "
    "2.0)) / 2 -> new = aim if low < aim < high else "
    "(low + min(high, low + 3.0)) / 2": "the interval of the search is narrowed in any case",
    "tensegrity/springs/polynomial.py: middle, half = low / 2 + high / 2, (high / 2 - low "
    "/ 2) * (1 + 4 * UNIT) -> middle, half = low / 2 + high "
    "/ 2, (high / 2 - low / 2) * (1 - 4 * UNIT)": "the interpolation points move by round-off",
}


def another(text: str) -> str:
    """Another number: a whole one off by one, else half as much again."""
    return str(int(text) + 1) if text.isdigit() else repr(1.5 * float(text) or 1.0)


def python_slips(text: str):
    """(Line, from, to, new text) of each slip of a Python file, from 0, in bytes of the line."""
    lines = text.encode().splitlines()

    def here(node, other):
        return node.lineno == node.end_lineno and (
            node.lineno - 1, node.col_offset, node.end_col_offset, other)  # fmt: skip

    def between(left, right):
        row, start, end = left.end_lineno - 1, left.end_col_offset, right.col_offset
        found = row == right.lineno - 1 and PYTHON_SIGN.match(lines[row][start:end].decode())
        return found and (row, start + found.start(1), start + found.end(1), OTHER[found[1]])

    def visit(node):
        if (
            isinstance(node, (ast.JoinedStr, ast.Raise, ast.Import, ast.ImportFrom))
            or (isinstance(node, ast.If) and "TYPE_CHECKING" in ast.dump(node.test))
            or (isinstance(node, ast.keyword) and node.arg in ASSUMPTIONS)
        ):
            return
        if isinstance(node, ast.Compare):
            yield between(node.left, node.comparators[0])
        elif isinstance(node, ast.BoolOp):
            yield between(*node.values[:2])
        elif isinstance(node, ast.BinOp) and isinstance(node.op, (ast.Add, ast.Sub)):
            yield between(node.left, node.right)
        elif isinstance(node, ast.AugAssign) and isinstance(node.op, (ast.Add, ast.Sub)):
            yield between(node.target, node.value)
        elif isinstance(node, ast.Constant) and type(node.value) in (int, float, bool):
            yield here(node, str(not node.value) if type(node.value) is bool
                       else another(repr(node.value)))  # fmt: skip
        elif isinstance(node, (ast.If, ast.While, ast.IfExp)) and not isinstance(
            node.test, ast.Compare
        ):
            test = node.test
            part = lines[test.lineno - 1][test.col_offset : test.end_col_offset].decode()
            yield here(test, f"(not ({part}))")
        elif isinstance(node, ast.Expr) and isinstance(node.value, ast.Call):
            yield here(node, "pass")
        elif isinstance(node, ast.Assign):
            place = node.targets[0]
            yield isinstance(place, (ast.Attribute, ast.Subscript)) and here(node, "pass")
        for field, child in ast.iter_fields(node):
            if field not in ("annotation", "returns"):
                for one in child if isinstance(child, list) else [child]:
                    if isinstance(one, ast.AST):
                        yield from visit(one)

    return [slip for slip in visit(ast.parse(text)) if slip]


def c_slips(text: str):
    """The same of a file of C."""
    bare = re.sub(r"/\*.*?\*/", lambda m: re.sub(r"[^\n]", " ", m[0]), text, flags=re.S)
    for row, line in enumerate(re.sub(r'//.*|"[^"\n]*"', "", bare).splitlines()):
        if line.startswith("#"):
            continue
        yield from ((row, *m.span(1), OTHER[m[1]]) for m in C_SIGN.finditer(line))
        yield from ((row, *m.span(1), another(m[1])) for m in C_NUMBER.finditer(line))
        for m in C_CONDITION.finditer(line):
            yield row, *m.span(m.lastindex), f"(!({m[m.lastindex]}))"
        yield from ((row, *m.span(1), ";") for m in C_STATEMENT.finditer(line))


def faults() -> list[tuple[str, Path, list[bytes]]]:
    """(Name, file, its lines then) of all faults, in their order."""
    found = {}
    for path in sorted(p for room in PACKAGES for p in (ROOT / room).rglob("*.[pch]*")):
        text, file = path.read_text() if path.is_file() else "", path.relative_to(ROOT)
        if path.suffix in (".py", ".c", ".h"):
            lines = text.encode().splitlines(keepends=True)
            for row, start, end, new in (python_slips if path.suffix == ".py" else c_slips)(text):
                line = lines[row][:start] + new.encode() + lines[row][end:]
                name = f"{file}: {lines[row].decode().strip()} -> {line.decode().strip()}"
                broken = [*lines[:row], line, *lines[row + 1 :]]
                found.setdefault(name, (file, broken))
    order = sorted(found, key=lambda name: hashlib.sha256(f"{SEED} {name}".encode()).digest())
    return [(name, *found[name]) for name in order]


def nearest(file: Path) -> list[str]:
    """Files of tests for a source file: those of its name, then those of the longest part of its
    path that `NEAREST` knows."""
    place = max((k for k in NEAREST if str(file).startswith(k)), key=len)
    named = sorted(p.stem for p in (ROOT / "tests").glob(f"test_*{file.stem}*.py"))
    stems = dict.fromkeys(named + [f"test_{x}" for x in NEAREST[place].split()])
    return [f"tests/{stem}.py" for stem in stems]


def outcome(tree: Path, tests: list[str], seconds: float | None = None) -> int:
    """What pytest returns for some tests of a tree; what it started ends with it.  Without a limit
    of time it says what it finds."""
    path = os.pathsep.join([str(tree), str(tree / "tests")])
    kernels = {"XDG_CACHE_HOME": str(tree.parent), "PYTHONDONTWRITEBYTECODE": "1"}
    child = subprocess.Popen(
        [sys.executable, "-m", "pytest", "-x", "-q", "-m", "not slow", "-p", "no:cacheprovider",
         *tests], cwd=tree, env={**os.environ, "PYTHONPATH": path, **kernels},
        stdout=seconds and subprocess.DEVNULL, stderr=seconds and subprocess.DEVNULL,
        start_new_session=True,
    )  # fmt: skip
    try:
        return child.wait(seconds)
    except subprocess.TimeoutExpired:
        return ENDLESS
    finally:
        with contextlib.suppress(ProcessLookupError):
            os.killpg(child.pid, signal.SIGKILL)
        child.wait()


def is_noticed(tree: Path, file: Path, broken: list[bytes], tests: list[str]) -> bool:
    """Whether the tests of the tree at `tree`, left as it was, notice a file's other text."""
    whole = (tree / file).read_bytes()
    try:
        (tree / file).write_bytes(b"".join(broken))
        return outcome(tree, tests, PATIENCE) != 0  # a file that cannot be read is noticed, too
    finally:
        (tree / file).write_bytes(whole)


def main(words: list[str]) -> int:
    """Try the chosen faults; 1 if tests fail without any."""
    parser = argparse.ArgumentParser(prog="python -m tests.faults", description=__doc__)
    parser.add_argument("count", nargs="?", type=int, default=COUNT, metavar="COUNT")
    parser.add_argument("--after", type=int, default=0, metavar="N", help="leave out the first N")
    given = parser.parse_args(words)
    chosen = [f for f in faults()[given.after : given.count] if f[0] not in EQUIVALENT]
    noticed = 0
    with tempfile.TemporaryDirectory() as folder:
        tree = Path(folder) / "tree"
        shutil.copytree(ROOT, tree, ignore=OUTSIDE)
        if outcome(tree, sorted({test for _, file, _ in chosen for test in nearest(file)})) != 0:
            print("tests fail before any fault")
            return 1
        for tried, (name, file, broken) in enumerate(chosen, 1):
            found = is_noticed(tree, file, broken, nearest(file))
            noticed += found
            print(f"{tried:4} {'noticed ' if found else 'SURVIVES'} {name}", flush=True)
    left_out = given.count - given.after - len(chosen)
    print(f"{noticed} of {len(chosen)} noticed, {noticed / len(chosen):.0%}; {left_out} equivalent")
    return 0


if __name__ == "__main__":
    signal.signal(signal.SIGTERM, lambda *_: sys.exit(128 + signal.SIGTERM))  # with its children
    sys.exit(main(sys.argv[1:]))
