"""`python -m derivations`: write the report, or check the ledger."""

from __future__ import annotations

import argparse
import os
import runpy
import sys
import time
from collections.abc import Callable, Iterable, Sequence
from functools import partial
from pathlib import Path
from types import ModuleType
from typing import Any

from tqdm import tqdm

from derivations import ledger, report
from derivations.argument import NAMES, Verdict

UNIT = "unit"


def check(progress: Callable[[Iterable[Any]], Iterable[Any]]) -> int:
    """Derive every entry of the ledger anew and compare; returns the number of disagreements."""
    start, checks = time.perf_counter(), []
    for entry in progress(ledger.entries()):
        checks.append(ledger.check(entry))
        tqdm.write(str(checks[-1]), file=sys.stdout)
    failed = [c for c in checks if not c.confirmed]
    for verdict in (Verdict.SLIP, Verdict.CONVENTION):
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


def main(arguments: Sequence[str] | None = None) -> int:
    """Run the command; returns its exit status."""
    parser = argparse.ArgumentParser(prog="python -m derivations", description=__doc__)
    parser.add_argument(
        "name", nargs="?", metavar="NAME",
        help=f"this derivation only ({', '.join(NAMES)}), with --latex also an entry of the "
        "ledger; or `unit`, with a file in Python that makes units",
    )  # fmt: skip
    parser.add_argument("file", nargs="?", type=Path, help="the file, after `unit`")
    parser.add_argument("--latex", action="store_true", help="print LaTeX, write nothing")
    parser.add_argument("--check", action="store_true", help="check the ledger, write nothing")
    parser.add_argument(
        "--output", type=Path, help="file or folder of the page; by default the current folder"
    )
    given = parser.parse_args(arguments)
    progress = partial(tqdm, disable=None, file=sys.stderr)
    if given.check:
        if given.name or given.output:
            parser.error("--check takes neither a name nor --output")
        return 1 if check(progress) else 0
    if given.name not in (None, UNIT, *NAMES) and not given.latex:
        parser.error(f"{given.name!r} is not one of {', '.join((UNIT, *NAMES))}")
    if (given.name == UNIT) != (given.file is not None):
        parser.error("`unit` takes a file in Python, and nothing else does")
    units = units_of(given.file) if given.file else {}
    if given.file and not units:
        parser.error(f"{given.file} has no unit at the end")
    names = (given.name,) if given.name else NAMES
    if given.latex:
        return _print_latex(parser, units, names)
    target = given.output or Path()
    if not target.suffix:
        target = target / f"{given.name or 'derivations'}.html"
    what = f"The derivation {given.name}" if given.name else f"All {len(names)} derivations"
    what += ", with the ledger's entries"
    what = f"The units {', '.join(units)}" if units else what
    _write(target, _page_of(units, given.file) if units else report.page(names, progress))
    print(f"{what}: {target.resolve()}")
    return 0


def _print_latex(parser: Any, units: dict[str, Any], names: Sequence[str]) -> int:
    texts = map(report.tex, (one.argument() for one in units.values()))
    try:
        print(*(texts if units else map(report.tex_of, names)))
    except ValueError as error:
        parser.error(str(error))
    return 0


def _page_of(units: dict[str, Any], file: Path) -> str:
    sections = [
        report.Section(name, f"The unit {name}", report.typeset(unit.argument()))
        for name, unit in units.items()
    ]
    return report.whole(sections, f"What follows from {file.name}, derived by program.")


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
