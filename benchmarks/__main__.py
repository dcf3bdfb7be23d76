"""Run benchmarks: `python -m benchmarks [NAME...]`; all where none is named."""

import argparse
import importlib
import pkgutil
import sys

import benchmarks


def main():
    """Entry point; returns the exit code."""
    modules = [m.name for m in pkgutil.iter_modules(benchmarks.__path__) if m.name[0] != "_"]
    names = [name.replace("_", "-") for name in modules]
    parser = argparse.ArgumentParser(prog="python -m benchmarks", description=__doc__)
    parser.add_argument("names", nargs="*", metavar="NAME", help=", ".join(names))
    chosen = parser.parse_args().names or names
    for name in chosen:
        if name not in names:
            parser.error(f"unknown benchmark {name!r}; there are {', '.join(names)}")
    for name in chosen:
        importlib.import_module(f"benchmarks.{name.replace('-', '_')}").main()
    return 0


if __name__ == "__main__":
    sys.exit(main())
