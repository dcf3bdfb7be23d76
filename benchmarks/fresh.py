"""A fresh process: CPU seconds from its start to its first result, with a warm and a cold cache.

Each program runs in a process of its own, whose CPU time, with that of the compiler it may start,
is what the system says of it when it has ended: the wall clock lies on shared cores.  The jobs of
README.md are among them.  What importing NumPy takes is left out of the last column.  The cold
cache is a new folder each time: everything is derived, generated and compiled.  Byte code is
written, as where a package is installed.
"""

from __future__ import annotations

import os
import re
import resource
import subprocess
import sys
import tempfile
from pathlib import Path

from benchmarks._timing import record

ROUNDS = 5
ROOT = Path(__file__).parent.parent

CHAIN = "chain = Chain(spring, 100); run = simulate(chain, chain.at_rest({0: 0.01}), 20.0)"
PROGRAMS = {
    "python": "",
    "import numpy": "import numpy",
    "import tensegrity": "import tensegrity",
    "rigid prisms": f"spring = Prism(1.0, 0.7, 0.01, 1.0).potential(); {CHAIN}",
    "preloaded prisms": f"spring = Prism(1.0, 0.7, 0.1, 1.0).potential(0.01); {CHAIN}",
    "elastic prisms": f"spring = Prism(1.0, 0.7, 0.01, 1.0, 10.0, 100.0).potential(); {CHAIN}",
    "Hertz chain": f"spring = PowerLaw(1.0, 1.5); {CHAIN}",
    "path, elastic": "equilibrium_path(Prism(1.0, 0.5, 0.4, 1.0, 2.0, 20.0))",
    "path, rigid": "equilibrium_path(Prism(1.0, 0.5, 0.4, 1.0))",
    "solitary wave": "solitary_wave(Prism(1.0, 0.7, 0.01, 1.0).potential(), 1.0, speed_ratio=1.05)",
}
README = (ROOT / "README.md").read_text()
SECTIONS = re.findall(r"^### (.*?)$.*?```python\n(.*?)```", README, re.DOTALL | re.MULTILINE)
PROGRAMS |= {f"README, {name}": code for name, code in SECTIONS}
NAMES = "from tensegrity import Chain, PowerLaw, Prism, equilibrium_path, simulate, solitary_wave"
LATE = ("sympy", "casadi", "scipy")
"""What takes most of the time without a cache, and must not be imported with a warm one."""


def seconds(program, cache):
    """CPU seconds of a process, with what it started, and which of `LATE` it imported."""
    names = NAMES if "(" in program else "pass"
    code = f"{names}\n{program}\nimport sys; print(*[x for x in {LATE} if x in sys.modules])"
    environment = {k: v for k, v in os.environ.items() if k != "PYTHONDONTWRITEBYTECODE"}
    before = resource.getrusage(resource.RUSAGE_CHILDREN)
    answer = subprocess.run(
        [sys.executable, "-c", code], cwd=ROOT, env=environment | {"XDG_CACHE_HOME": str(cache)},
        check=True, capture_output=True, text=True,
    )  # fmt: skip
    after = resource.getrusage(resource.RUSAGE_CHILDREN)
    spent = after.ru_utime - before.ru_utime + after.ru_stime - before.ru_stime
    return spent, answer.stdout.splitlines()[-1].split() if answer.stdout else []


def measure(rounds=ROUNDS):
    """{program: (least CPU seconds warm, CPU seconds cold, what it imported warm)}."""
    cold, warm, late = {}, {}, {}
    for name, program in PROGRAMS.items():
        with tempfile.TemporaryDirectory() as folder:
            cold[name] = seconds(program, folder)[0]
            warm[name] = seconds(program, folder)[0]
    with tempfile.TemporaryDirectory() as folder:
        for program in PROGRAMS.values():
            seconds(program, folder)
        for _ in range(rounds):
            for name, program in PROGRAMS.items():
                spent, late[name] = seconds(program, folder)
                warm[name] = min(warm[name], spent)
    return {name: (warm[name], cold[name], late[name]) for name in PROGRAMS}


def main():
    """Print CPU seconds of each program, with a warm and with a cold cache."""
    found = measure()
    base = found["import numpy"][0]
    print("CPU seconds of a fresh process to its first result, least of several")
    print(f"{'':>20}{'cold':>9}{'warm':>9}{'beyond numpy':>14}  imported")
    for name, (warm, cold, late) in found.items():
        imported = ", ".join(late) or "-"
        record("CPU seconds", name, "cold over import numpy", cold, base)
        record("CPU seconds", name, "warm over import numpy", warm, base)
        print(f"{name:>20}{cold:9.3f}{warm:9.3f}{warm - base:14.3f}  {imported}")


if __name__ == "__main__":
    main()
