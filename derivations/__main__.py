"""`python -m derivations`: write the report, or check the ledger."""

from __future__ import annotations

import argparse
import os
import sys
import time
from collections.abc import Callable, Iterable, Sequence
from functools import partial
from pathlib import Path
from typing import Any

from tqdm import tqdm

from derivations import ledger, report
from derivations.argument import NAMES, Verdict


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


def main(arguments: Sequence[str] | None = None) -> int:
    """Run the command; returns its exit status."""
    parser = argparse.ArgumentParser(prog="python -m derivations", description=__doc__)
    parser.add_argument("name", nargs="?", choices=NAMES, help="this derivation only")
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
    names = (given.name,) if given.name else NAMES
    target = given.output or Path()
    if not target.suffix:
        target = target / f"{given.name or 'derivations'}.html"
    text = report.page(names, progress)
    target.parent.mkdir(parents=True, exist_ok=True)
    beside = target.with_name(f".{target.name}.{os.getpid()}")
    try:
        beside.write_text(text, encoding="utf-8")
        os.replace(beside, target)
    finally:  # packages above this one have a helper for it
        beside.unlink(missing_ok=True)
    what = f"The derivation {given.name}" if given.name else f"All {len(names)} derivations"
    print(f"{what}, with the ledger's entries: {target.resolve()}")
    return 0


if __name__ == "__main__":
    sys.exit(main())
