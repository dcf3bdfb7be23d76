"""Results that take long, stored with the sources and the command that they come from.

`stored` is for a function without arguments that returns tables {table: {column: sequence}}, such
as the histories of a search.  Its tables are stored in one compressed .npz of numbers and text,
without pickles: in `figures/data`, under version control, or, if they were computed again here, in
`figures/output/data`.  A file is valid for the same sources: the module of the function, all that
it imports from `figures`, directly or not, and the modules of the packages in which objects
imported by these are defined.  Names of modules, comments, docstrings, layout, texts of errors, the
printing of objects, and functions of a picture that only show numbers (`SHOWING`) do not count.
Deeper dependencies on the packages are left to a slow test, which computes every result again.
"""

import ast
import fcntl
import hashlib
import inspect
import os
import sys
from functools import cache, wraps
from pathlib import Path

import numpy as np

from figures._files import write

HERE = Path(__file__).parent
ROOT = HERE.parent
DATA, MADE = HERE / "data", HERE / "output" / "data"
PACKAGES = ("derivations", "tensegrity", "granular", "figures")
NAMES, SOURCES, COMMAND, SECONDS = "names", "sources", "command", "seconds"
SHOWING = ("draw", "animate", "table", "text")  # functions of a picture, from its tables
PRINTING = ("__str__", "__repr__")
RESULTS = {}  # {name: the function itself}, of all modules imported so far
fresh = False  # whether only results that were computed here count


def stored(picture):
    """Store the tables that a function returns; it is called at most once in a process.

    Parameters
    ----------
    picture : str
        Name of a picture, or a group, that shows them.
    """

    def decorate(make):
        name = f"{make.__module__.rpartition('.')[2].strip('_')}_{make.__name__}"
        RESULTS[name] = make

        @cache
        @wraps(make)
        def tables():
            command = f"python -m figures {picture} --fresh --update"
            folders = (MADE,) if fresh else (MADE, DATA)
            return current(name, make, sources(make.__module__), command, folders)

        return tables

    return decorate


def current(name, make, of, command, folders):
    """The tables of a result: from the first folder with a file of these sources, or computed now
    and written to the first folder.

    Parameters
    ----------
    name : str
    make : callable () -> {table: {column: sequence}}
    of : {source: digest}
    command : str
    folders : sequence of Path
    """
    path = folders[0] / f"{name}.npz"
    folders[0].mkdir(parents=True, exist_ok=True)
    with open(path.with_suffix(".lock"), "w") as lock:
        fcntl.flock(lock, fcntl.LOCK_EX)  # another process may be at it: its result is taken
        there = [folder / path.name for folder in folders if (folder / path.name).is_file()]
        for one in there:
            tables, about = read(one)
            if not changed(about, of):
                return tables
        why, before = "there is no stored one", ""
        if there:
            why = f"{', '.join(changed(about, of))} changed since it was stored"
            before = f"; it took {about[SECONDS]:.0f} s of processor time then"
        print(f"computing {name}: {why}{before}", flush=True)
        began = spent()
        tables = make()
        about = {SOURCES: of, COMMAND: command, SECONDS: spent() - began}
        write(path, lambda beside: save(beside, tables, about))
        return read(path)[0]


def spent():
    """Processor time of this process and of those that it has waited for [s]."""
    return sum(os.times()[:4])


def save(path, tables, about):
    """Write tables and their sources as arrays, columns by number."""
    names = [(table, column) for table, columns in tables.items() for column in columns]
    arrays = {str(k): np.asarray(tables[table][column]) for k, (table, column) in enumerate(names)}
    if any(array.dtype.kind not in "biufU" for array in arrays.values()):
        raise ValueError(f"columns of {Path(path).name} that are neither numbers nor text")
    parts = {name: np.array(value) for name, value in about.items() if name != SOURCES}
    parts |= {NAMES: np.array(names), SOURCES: np.array(list(about[SOURCES].items()))}
    np.savez_compressed(path, **parts, **arrays)


def read(path):
    """The tables of a file and their sources; text is returned as lists."""
    tables = {}
    with np.load(path, allow_pickle=False) as arrays:
        for k, (table, column) in enumerate(arrays[NAMES]):
            values = arrays[str(k)]
            values = values.tolist() if values.dtype.kind == "U" else values
            tables.setdefault(str(table), {})[str(column)] = values
        about = {COMMAND: str(arrays[COMMAND]), SECONDS: float(arrays[SECONDS])}
        about[SOURCES] = {str(name): str(digest) for name, digest in arrays[SOURCES]}
    return tables, about


def changed(about, of):
    """Modules that differ, under any name, from those with which a result was computed."""
    was, now = about[SOURCES], set(of.values())
    return sorted(
        [name for name, one in of.items() if one not in was.values()]
        + [name for name, one in was.items() if one not in now and name not in of]
    )


@cache
def sources(name):
    """{module: digest} of what a result of a module depends on."""
    todo, seen = [name], {}
    while todo:
        one = todo.pop()
        if one not in seen:
            seen[one] = digest(Path(sys.modules[one].__file__))
            if one.split(".")[0] == "figures":
                todo += sorted(used(sys.modules[one]))
    return seen


def used(module):
    """Names of the modules of ours, this one aside, in which what a module imports is defined."""
    for value in vars(module).values():
        name = value.__name__ if inspect.ismodule(value) else getattr(value, "__module__", None)
        if isinstance(name, str) and name.split(".")[0] in PACKAGES and name != __name__:
            yield name


@cache
def digest(path):
    """Digest of a source that does not depend on comments, docstrings, imports, texts of errors and
    layout, nor on how an object prints or a picture shows its numbers."""
    text = path.read_bytes()
    if path.suffix == ".py":
        tree = ast.parse(text)
        if b"\nGROUP = " in text:  # a picture
            tree.body = [node for node in tree.body if getattr(node, "name", "") not in SHOWING]
        text = repr(form(tree)).encode()
    return hashlib.sha256(text).hexdigest()[:16]


def form(node):
    """A syntax tree as nested tuples, the same in every version of Python, without docstrings,
    printing and imports: imported modules are sources themselves, and may be renamed."""
    if isinstance(node, list):
        return [form(one) for one in node if not isinstance(one, (ast.Import, ast.ImportFrom))
                and getattr(one, "name", "") not in PRINTING]  # fmt: skip
    if not isinstance(node, ast.AST) or isinstance(node, ast.Raise):
        return type(node).__name__ if isinstance(node, ast.AST) else node
    fields = dict(ast.iter_fields(node))
    if isinstance(node, (ast.Module, ast.ClassDef, ast.FunctionDef, ast.AsyncFunctionDef)):
        fields["body"] = node.body[ast.get_docstring(node, clean=False) is not None :]
    if isinstance(node, ast.JoinedStr):  # some versions put empty text between its parts
        fields["values"] = [x for x in node.values if getattr(x, "value", None) != ""]
    parts = [(k, form(value)) for k, value in fields.items() if value is not None and value != []]
    return type(node).__name__, parts


@cache
def everything():
    """The digest of all that a picture may depend on: of the sources of all packages."""
    paths = [p for package in PACKAGES for p in sorted((ROOT / package).rglob("*.*"))]
    parts = [p.read_bytes() for p in paths if p.suffix in (".py", ".c", ".h")]
    return hashlib.sha256(b"".join(parts)).hexdigest()[:16]
