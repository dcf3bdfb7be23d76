"""`python -m derivations`: write the report, or check the ledger."""

from __future__ import annotations

import argparse
import os
import runpy
import sys
import time
from collections.abc import Callable, Iterable, Sequence
from functools import partial
from importlib import import_module
from pathlib import Path
from types import ModuleType
from typing import Any

from tqdm import tqdm

from derivations import ledger, report
from derivations.argument import NAMES, Verdict

UNIT, PRISM, RIGID = "unit", "prism", ("base", "bars")
UNITS_OF_PRISMS = "tensegrity.prisms.equations"  # by its name: nothing here imports that package


def check(progress: Callable[[Iterable[Any]], Iterable[Any]]) -> int:
    """Derive every entry of the ledger anew and compare; returns the number of disagreements."""
    start, checks = time.perf_counter(), []
    for entry in progress(ledger.entries()):
        checks.append(ledger.check(entry))
        tqdm.write(str(checks[-1]), file=sys.stdout)
    failed = [c for c in checks if not c.confirmed]
    for verdict in (Verdict.MISPRINT, Verdict.CONVENTION):
        print(f"\n{verdict.value}:")
        for c in checks:
            if c.entry.verdict is verdict:
                print(f"  {c.entry.name}: {c.entry.note}")
    print(
        f"\n{len(checks)} entries, {len(checks) - len(failed)} decided, {len(failed)} disagree, "
        f"{time.perf_counter() - start:.0f} s"
    )
    return len(failed)


def units_of(file: Path) -> dict[str, Any]:
    """What a file in Python has at its end that can say its argument, by name."""
    made = runpy.run_path(str(file))
    return {
        name: one for name, one in made.items()
        if name[0] != "_" and hasattr(one, "argument") and not isinstance(one, (type, ModuleType))
    }  # fmt: skip


def _unit_of_prism(sides: int, connectivity: int, rigid: Sequence[str]) -> dict[str, Any]:
    """A prism as a unit all of whose sizes are symbols, by name."""
    make = import_module(UNITS_OF_PRISMS).symbolic_unit
    unit = make(sides, connectivity, *(one in rigid for one in RIGID))
    kinds = (f"rigid_{one}" for one in RIGID if one in rigid)
    return {"_".join([PRISM, str(sides), str(connectivity), *kinds]): unit}


def _parser() -> argparse.ArgumentParser:
    parser = argparse.ArgumentParser(prog="python -m derivations", description=__doc__)
    parser.add_argument(
        "name", nargs="?", metavar="NAME",
        help=f"this derivation only ({', '.join(NAMES)}), with --latex also an entry of the "
        "ledger; `unit`, with a file in Python that makes units; or `prism` with --sides",
    )  # fmt: skip
    parser.add_argument("file", nargs="?", type=Path, help="the file, after `unit`")
    parser.add_argument(
        "--sides", type=int, metavar="N",
        help="after `prism`: what follows for the prism of N sides, at least 3, as a unit",
    )  # fmt: skip
    parser.add_argument(
        "--connectivity", type=int, metavar="C",
        help="nodes from the upper end of a bar back to that of the cross string from the same "
        "lower node, below N/2; 1 by default. At rest the twist is pi/2 + C pi/N",
    )  # fmt: skip
    parser.add_argument(
        "--rigid", action="append", choices=RIGID,
        help="rigid base strings or bars of this prism; by default its page has elastic ones, and "
        "the limits of rigid ones. May be given twice",
    )  # fmt: skip
    parser.add_argument("--latex", action="store_true", help="print LaTeX, write nothing")
    parser.add_argument("--check", action="store_true", help="check the ledger, write nothing")
    parser.add_argument(
        "--output", type=Path, help="file or folder of the page; by default the current folder"
    )
    return parser


def _units(parser: argparse.ArgumentParser, given: argparse.Namespace) -> dict[str, Any]:
    """The units that are asked for, by name; none if derivations are."""
    if (given.name == UNIT) != (given.file is not None):
        parser.error("`unit` takes a file in Python, and nothing else does")
    if given.sides is None and (given.connectivity is not None or given.rigid):
        parser.error("--connectivity and --rigid are for `prism` with --sides")
    if given.sides is not None:
        if given.name != PRISM:
            parser.error("--sides is for `prism`")
        connectivity = 1 if given.connectivity is None else given.connectivity
        try:
            return _unit_of_prism(given.sides, connectivity, given.rigid or ())
        except ValueError as error:
            parser.error(str(error))
    units = units_of(given.file) if given.file else {}
    if given.file and not units:
        parser.error(f"{given.file} has no unit at the end")
    return units


def main(arguments: Sequence[str] | None = None) -> int:
    """Run the command; returns its exit status."""
    parser = _parser()
    given = parser.parse_args(arguments)
    progress = partial(tqdm, disable=None, file=sys.stderr)
    if given.check and (given.name or given.output):
        parser.error("--check takes neither a name nor --output")
    if given.name not in (None, UNIT, *NAMES) and not given.latex:
        parser.error(f"{given.name!r} is not one of {', '.join((UNIT, *NAMES))}")
    units = _units(parser, given)
    if given.check:
        return 1 if check(progress) else 0
    names = (given.name,) if given.name else NAMES
    if given.latex:
        return _print_latex(parser, units, names)
    target = given.output or Path()
    if not target.suffix:
        name = next(iter(units)) if given.sides else given.name or "derivations"
        target = target / f"{name}.html"
    what = f"The derivation {given.name}" if given.name else f"All {len(names)} derivations"
    what += ", with the ledger's entries"
    what = f"The units {', '.join(units)}" if units else what
    source = given.file.name if given.file else "lengths and energies of the members"
    _write(target, _page_of(units, source) if units else report.page(names, progress))
    print(f"{what}: {target.resolve()}")
    return 0


def _print_latex(parser: Any, units: dict[str, Any], names: Sequence[str]) -> int:
    texts = map(report.tex, (one.argument() for one in units.values()))
    try:
        print(*(texts if units else map(report.tex_of, names)))
    except ValueError as error:
        parser.error(str(error))
    return 0


def _page_of(units: dict[str, Any], source: str) -> str:
    sections = [
        report.Section(name, f"The unit {name}", report.typeset(unit.argument()))
        for name, unit in units.items()
    ]
    return report.whole(sections, f"What follows from {source}, derived by program.")


def _write(target: Path, text: str) -> None:
    target.parent.mkdir(parents=True, exist_ok=True)
    beside = target.with_name(f".{target.name}.{os.getpid()}")
    try:
        beside.write_text(text, encoding="utf-8")
        os.replace(beside, target)
    finally:  # packages above this one have a helper for it
        beside.unlink(missing_ok=True)


if __name__ == "__main__":
    sys.exit(main())
