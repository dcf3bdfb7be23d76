"""Run benchmarks: `python -m benchmarks [NAME...]`; by default all.

`--save FILE` writes the ratios measured, `--compare FILE` holds them against those of a file.
`answer --against COMMIT` measures small and whole calls alternately with those of a commit.
"""

import argparse
import importlib
import json
import pkgutil
import subprocess
import sys
from datetime import UTC, datetime
from pathlib import Path

import benchmarks
from benchmarks import _timing
from tensegrity.check import replacing
from tensegrity.engine.native import described

MARGIN = 0.15  # by which a ratio may differ between two runs


def stamp():
    """The conditions of a measurement: commit, CPU, compiler, date."""
    here = Path(__file__).parent
    command = ["git", "-C", str(here), "describe", "--always", "--dirty", "--exclude=*"]
    commit = subprocess.run(command, capture_output=True, text=True, check=False).stdout.strip()
    try:
        lines = Path("/proc/cpuinfo").read_text().splitlines()
    except OSError:
        lines = []
    cpu = next((line.split(":")[1].strip() for line in lines if "model name" in line), "unknown")
    date = f"{datetime.now(UTC):%Y-%m-%d}"
    return {"commit": commit or "unknown", "cpu": cpu, "compiler": described(), "date": date}


def compare(then, now):
    """Print earlier and present ratios; returns how many are worse by more than `MARGIN`."""
    for name in sorted(now.keys() - {"ratios"}):
        print(f"{name:>10}: {then[name]}  ->  {now[name]}")
    before, after, worse = then["ratios"], now["ratios"], 0
    for key in sorted(before.keys() | after.keys()):
        old, new = before.get(key), after.get(key)
        mark = "only then" if new is None else "only now"
        if old and new:
            change = new / old - 1
            word = "WORSE" if change > MARGIN else "better" if change < -MARGIN else ""
            mark, worse = f"{change:+.0%} {word}", worse + (word == "WORSE")
        shown = "".join(f"{'-' if x is None else format(x, '.3g'):>10}" for x in (old, new))
        print(f"{shown}  {mark:14} {key}")
    return worse


def main(arguments=None):
    """Entry point; returns the exit code, 1 where a ratio is worse than in the file."""
    modules = [m.name for m in pkgutil.iter_modules(benchmarks.__path__) if m.name[0] != "_"]
    names = [name.replace("_", "-") for name in modules]
    parser = argparse.ArgumentParser(prog="python -m benchmarks", description=__doc__)
    parser.add_argument("names", nargs="*", metavar="NAME", help=", ".join(names))
    parser.add_argument("--save", metavar="FILE", type=Path)
    parser.add_argument("--compare", metavar="FILE", type=Path)
    parser.add_argument("--against", metavar="COMMIT")
    given = parser.parse_args(arguments)
    chosen = given.names or names
    for name in chosen:
        if name not in names:
            parser.error(f"unknown benchmark {name!r}; there are {', '.join(names)}")
    then = given.compare and json.loads(given.compare.read_text())  # before hours are spent
    ratios = {}
    for name in chosen:
        _timing.RATIOS.clear()
        main_of = importlib.import_module(f"benchmarks.{name.replace('-', '_')}").main
        main_of(against=given.against) if given.against and name == "answer" else main_of()
        ratios |= {f"{name}/{key}": value for key, value in _timing.RATIOS.items()}
    now = {**stamp(), "ratios": ratios}
    if given.save:
        with replacing(given.save) as new:
            new.write_text(json.dumps(now, indent=1) + "\n")
    if not then:
        return 0
    then["ratios"] = {k: x for k, x in then["ratios"].items() if k.split("/")[0] in chosen}
    return int(compare(then, now) > 0)


if __name__ == "__main__":
    sys.exit(main())
