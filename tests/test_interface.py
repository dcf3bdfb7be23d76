"""The public interface: names, signatures and declared checks, held by `interface.txt`.

`python tests/test_interface.py` writes that file anew, after a change that is meant.
"""

import importlib
import inspect
import re
from pathlib import Path

import pytest

from tensegrity.checked import declared

pytestmark = pytest.mark.unchanged("granular", "tests/interface.txt")

DOORS = (
    "tensegrity",
    "tensegrity.objective",
    "tensegrity.catalogue",
    "tensegrity.files",
    "granular",
    "granular.design",
    "granular.lammps",
)
MOST = 100  # names, those of the catalogue and the later ones apart
LATER = {
    "Problem",
    "trace",
    "catalogue",
    "files",
    "read",
    "write",
    "interface",
    "phase_shift",
    "pulses",
    "read_curve",
    "transmission",
}
LATER |= {"Scatter", "robustness"}
LATER |= {"TimeSeries", "fit_run", "read_record"}
LATER |= {"Formula", "Member", "Unit"}
LATER |= {"Lattice", "Matrix", "bands", "decay", "effective_mass", "moduli", "sheath"}
LATER |= {"floquet", "orbit_path", "periodic_orbit"}
LATER |= {"transition_wave", "units"}
LATER |= {"lyapunov", "periodic_wave", "shock", "spectrum"}
LATER |= {"PairLattice", "PairLaw", "prove", "verify"}
LATER |= {"Force", "carretero_gonzalez", "hunt_crossley", "kuwabara_kono", "viscous"}
LATER |= {"WorkPrecision", "compare_models", "prism_models", "work_precision"}
LATER |= {"dmt", "tsuji"}
HELD = Path(__file__).parent / "interface.txt"


def signature(thing):
    try:
        found = str(inspect.signature(thing))
    except (TypeError, ValueError):
        return ""
    found = re.sub(r"<function (\w+) at \w+>", r"\1", found.replace("'", ""))
    for name, said in declared(thing).items():
        words = {k: v for k, v in said.keywords.items() if k != "wanted"}
        words = ", ".join(f"{k} {v if k != 'allowed' else '/'.join(v)}" for k, v in words.items())
        kind = re.compile(rf"\b{name}: {said.kind.__name__}\b")
        found = kind.sub(
            lambda hit, words=words: f"{hit[0]} ({words or 'checked'})", found, count=1
        )
    return found


def members(cls):
    """Public methods and properties that a class defines itself or inherits from this project."""
    for name in sorted(vars(cls) | {k: 0 for base in cls.__mro__ for k in vars(base)}):
        owner = next(base for base in cls.__mro__ if name in vars(base))
        ours = owner.__module__.split(".")[0] in ("tensegrity", "granular")
        if ours and not name.startswith("_"):
            one = inspect.getattr_static(cls, name)
            plain = getattr(one, "__func__", one)
            yield f"    {name}{signature(plain) if callable(plain) else ''}"


def names():
    """{door.name: thing}, each thing once."""
    found = {}
    for door in DOORS:
        module = importlib.import_module(door)
        for name in sorted(module.__all__):
            thing = getattr(module, name)
            if not any(thing is other for other in found.values()):
                found[f"{door}.{name}"] = thing
    return found


def interface():
    """Lines of the file: every public name with its signature, members of classes indented."""
    lines = []
    for name, thing in names().items():
        if inspect.isclass(thing):
            lines += [f"{name}{signature(thing)}", *members(thing)]
        else:
            lines.append(f"{name}{signature(thing) if callable(thing) else ''}")
    return lines


def test_names_and_signatures_are_those_that_were_agreed():
    assert interface() == HELD.read_text().splitlines()


def test_public_names_are_few():
    found = [name.rpartition(".") for name in names()]
    first = [name for door, _, name in found if door != "tensegrity.catalogue"]
    assert len(set(first) - LATER) <= MOST


def test_doors_expose_nothing_else():
    for door in ("tensegrity.objective", "granular.lammps", "granular.design"):
        module = importlib.import_module(door)
        public = {name for name in vars(module) if not name.startswith("_")}
        assert door != "tensegrity.objective" or public == set(module.__all__)
        assert set(module.__all__) <= public


if __name__ == "__main__":
    HELD.write_text("\n".join(interface()) + "\n")
