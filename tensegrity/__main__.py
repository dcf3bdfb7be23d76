"""`python -m tensegrity`: the installation and a self-test of a few seconds, for bug reports.

It prints versions, the compiler, the cache folder and the number of threads, then compares a few
numbers with independent values: a derived stiffness, the speed of an exact wave, the impact of two
beads, a path of equilibria.  The exit code is 0 if all agree, otherwise 1.

`python -m tensegrity --clean` empties the cache folder instead; `python -m tensegrity demo` presses
a prism, strikes a chain and a pack, and draws what it finds.
"""

from __future__ import annotations

import math
import platform
import sys
import time
from argparse import ArgumentParser
from importlib import import_module
from importlib.metadata import PackageNotFoundError, version
from typing import NamedTuple

import numpy as np

import tensegrity
from tensegrity.engine.disk_cache import cache_folder, trim
from tensegrity.engine.native import described, require
from tensegrity.engine.threaded import threads
from tensegrity.errors import CompilerError, TensegrityError
from tensegrity.measure.observables import speed
from tensegrity.prisms.path import equilibrium_path
from tensegrity.prisms.prism import Prism
from tensegrity.runs.integrate import simulate
from tensegrity.runs.record import Record
from tensegrity.scenes.chain import Chain
from tensegrity.springs.power_law import PowerLaw
from tensegrity.waves.solitary import solitary_wave

PACKAGES = ("numpy", "scipy", "sympy", "casadi", "matplotlib", "tqdm", "cmaes", "ziglang", "dask",
            "mpi4py", "xarray", "pandas")  # fmt: skip
DEMO = "granular.demo"  # by its name, since nothing here imports that package


class Check(NamedTuple):
    """A result of the self-test: its description, its error, and the bound of the error."""

    words: str
    error: float
    bound: float


def stiffness() -> list[Check]:
    """Stiffness of a prism at rest: the compiled derived potential against the closed form."""
    prism = Prism(base=1.0, height=0.7, prestrain=0.01, k_cross=1.0)
    computed, known = float(prism.potential().stiffness(0.0)), prism.axial_stiffness()
    words = f"axial stiffness {computed:.12g} N/m against the closed form"
    return [Check(words, abs(computed / known - 1), 1e-13)]


def wave() -> list[Check]:
    """An exact wave on a chain: its speed, and the conservation of energy."""
    spring = Prism(base=1.0, height=0.7, prestrain=0.01, k_cross=1.0).potential()
    exact = solitary_wave(spring, speed_ratio=2.0)
    chain = Chain(spring, sites=80)
    record = Record(every=1, sites=[30, 31, 60, 61])
    run = simulate(chain, exact.launch(chain, at=15), 50 / exact.speed, tol=1e-9, record=record)
    c = speed(run, (30, 60))
    return [
        Check(f"wave of residual {exact.residual:.1e}", exact.residual, 1e-12),
        Check(f"speed on a chain {c:.9g} sites/s", abs(c / exact.speed - 1), 1e-7),
        Check(f"energy over {run.steps} steps of {run.method}", run.energy_error, 1e-8),
    ]


def impact() -> list[Check]:
    """Impact of two equal beads of Hertz's law, which exchange their velocities."""
    chain = Chain(PowerLaw(1.0, 1.5), sites=2)
    run = simulate(chain, chain.at_rest({0: 1.0}), 6.0, tol=1e-9)
    words = f"beads exchange velocities {run.final.v[0]:+.1e}, {run.final.v[1]:.12g} m/s"
    error = float(np.abs(run.final.v - [0.0, 1.0]).max())
    return [Check(words, error, 1e-7)]


def path() -> list[Check]:
    """Equilibria of an elastic prism by continuation, against its potential."""
    prism = Prism(base=1.0, height=0.5, prestrain=0.4, k_cross=1.0, k_base=2.0, k_bar=20.0)
    branch, spring = equilibrium_path(prism), prism.potential()
    load = -spring.tension(np.clip(branch.height - prism.height, *spring.domain))
    error = float(np.abs(load - branch.load).max() / np.abs(branch.load).max())
    words = f"path of {len(branch)} equilibria, largest load {branch.load.max():.9g} N"
    return [Check(words, error, 1e-10)]


CHECKS = (stiffness, wave, impact, path)


def installed() -> str:
    """Versions, compiler, cache folder and threads, one line each."""
    versions = [f"tensegrity {tensegrity.__version__}"]
    for name in PACKAGES:
        try:
            versions.append(f"{name} {version(name)}")
        except PackageNotFoundError:
            continue
    try:
        require()
        compiler = described()
    except CompilerError as error:
        compiler = f"none: {error}"
    kernels = sum(1 for entry in cache_folder().glob("*/kernel.so"))
    rows = {
        "versions": ", ".join(versions),
        "python": f"{platform.python_version()} on {platform.platform()}",
        "compiler": compiler,
        "cache": f"{cache_folder()}, {kernels} kernels",
        "threads": str(threads()),
    }
    return "\n".join(f"{name:10s}{words}" for name, words in rows.items())


def main(arguments: list[str] | None = None) -> int:
    """Print what is installed and the self-test, empty the cache, or run the demonstration.

    Returns
    -------
    int
        0 if every number agrees, otherwise 1.
    """
    parser = ArgumentParser(prog="python -m tensegrity", description=__doc__)
    parser.add_argument("--clean", action="store_true", help="empty the cache of compiled kernels")
    words = "write tensegrity-demo.png and .gif"
    parser.add_argument("command", nargs="?", choices=["demo"], help=words)
    given = parser.parse_args(arguments)
    if given.command == "demo":
        return int(import_module(DEMO).main())
    if given.clean:
        print(f"{trim(0, age=0.0) / 1e6:.1f} MB freed in {cache_folder()}")
        return 0
    print(installed())
    started, failed = time.perf_counter(), 0
    for check in CHECKS:
        try:
            results = check()
        except (TensegrityError, ArithmeticError, OSError, RuntimeError) as error:
            results = [Check(f"{check.__name__}: {type(error).__name__}: {error}", math.inf, 0.0)]
        for words, error, bound in results:
            right = error <= bound  # also not a number is wrong
            failed += not right
            print(
                f"{'ok' if right else 'WRONG':10s}{words}, off by {error:.1e} (at most {bound:g})"
            )
    seconds = time.perf_counter() - started
    print(f"{'self-test':10s}{'passed' if not failed else f'{failed} WRONG'} in {seconds:.1f} s")
    return int(failed > 0)


if __name__ == "__main__":
    sys.exit(main())
