"""The first call: what a new law, a new number and a fresh process cost, compilers included.

Compilers are measured in units of compiling ten fixed loops, a new number in units of the same call
once it is warm, and a whole first call in an empty cache in units of a process that imports NumPy,
SciPy's optimize and CasADi.  All is CPU time of a process with those that it started.  Byte code is
written, as where a package is installed.

Peers give the same answer in a fresh process, with steps or a tolerance whose error is at most the
same.  Of them counts what they take from their own import on, and Python with NumPy (`_first`).
"""

from __future__ import annotations

import json
import os
import resource
import statistics
import subprocess
import sys
import tempfile
from importlib.util import find_spec
from pathlib import Path

import numpy as np

from benchmarks import _first
from benchmarks._timing import table
from benchmarks.methods import gap, scenes
from tensegrity import Record, State, simulate

ROOT = Path(__file__).parent.parent
ONE = {"OPENBLAS_NUM_THREADS": "1", "TENSEGRITY_THREADS": "1"}
LOOPS = "".join(
    f"void f{k}(int n, const double *restrict x, double *restrict y) {{ for (int i = 0; i < n; i++)"
    f" y[i] = x[i] * ({k}.5 + x[i] * (x[i] - {k}.25)) + (x[i] > 0 ? x[i] : -x[i]); }}\n"
    for k in range(10)
)
CHAIN = """
def chain(spring, **more):
    scene = Chain(spring, sites=200, **more)
    return simulate(scene, scene.at_rest({0: 0.05}), dt=0.05, t_end=5.0)
"""
STEEL = "steel = Bead({}, materials['steel']); striker = Striker(steel, speed=0.6)\n"
FIRST = {  # calls, with the largest cost of their compilers, and of all over imports
    "power law": ("chain(PowerLaw(1.0, 1.5, 0.01))", 8, 3),
    "polynomial": ("chain(Potential(r**2 / 2 + 0.07 * r**3 + 0.0275 * r**4, r))", 7, 3),
    "rigid prisms": ("chain(Prism(1.0, 0.7, 0.1, 1.0).potential())", 8, 3),
    "elastic prisms": ("chain(Prism(1.0, 0.7, 0.1, 1.0, 20.0, 100.0).potential())", None, None),
    "force": ("chain(PowerLaw(1.0, 1.5, 0.01), forces=(Force(-0.03 * v * sp.Abs(v)),))", 14, None),
    "gradient": (
        "scene = Chain(Prism(1.0, 0.7, 0.05, 1.0).potential(), 31, ends=('free', 'fixed'))\n"
        "peak = objective.peak(objective.load(bond=29))\n"
        "gradient(peak, scene, scene.at_rest({0: 0.05}), 10.0, dt=0.05, method='rkn6',\n"
        "         wanted=('prestrain',))",
        13, None,
    ),
    "guide": (
        f"{STEEL.format('4.76e-3')}"
        "scene = y_guide(stem=19, branch=23, bead=steel, striker=striker)\n"
        "simulate(scene, scene.start(), t_end=100e-6, tol=1e-6)",
        None, 5,
    ),
    "pack": (
        f"{STEEL.format('9.53e-3')}scene = hexagonal_pack(5, 7, bead=steel, striker=striker,\n"
        "    floor=materials['steel'], sides=materials['ptfe'])\n"
        "simulate(scene, scene.start(), t_end=5e-5, tol=1e-5)",
        20, 5,
    ),
}  # fmt: skip
ALGEBRA = ("sp.", " r", "r**")  # in the calls that a user writes with SymPy
NUMBERS = {  # energies of a number x, with the largest cost of another number
    "exponent of a power law": ("PowerLaw(1.0, 1.3 + x, 0.01)", 3),
    "coefficient of a polynomial": ("Potential(r**2 / 2 + x * r**3 / 3 + 0.11 * r**4 / 4, r)", 4),
    "coefficient of exp": ("Potential((1.7 + x) * (sp.exp(-r) + r - 1), r)", 4),
    "stiffness of a piecewise spring": (
        "Potential(sp.Piecewise((r**2 / 2, r < 0), ((1.1 + x) * r**2 / 2, True)), r)", 8,
    ),
}  # fmt: skip
SHAPES = {  # laws after another one, with the largest cost of their compilers
    "PowerLaw(1, 2.25)": ("PowerLaw(1.0, 2.25, 0.01)", 4.5),
    "quartic": ("Potential(r**2 / 2 + r**4 / 4, r)", 3.2),
    "rigid prism": ("Prism(1.0, 0.7, 0.1, 1.0).potential()", 4.2),
}
TOL, TAYLOR = 1e-6, 1e-8  # of heyoka, whose error is that of all steps
ANSWERS = 3
LAST = Record(every=10**9)
PEERS = {  # and the cases that they answer: where contacts open there is no Taylor series
    "heyoka": (_first.WAVE,),
    "numba": (_first.WAVE, _first.BEADS, _first.PACK),
    "jax": (_first.WAVE, _first.BEADS, _first.PACK),
    "lammps": (_first.PACK,),
}
SPENT = """
import json, resource
def spent(call):
    def now():
        both = [resource.getrusage(k) for k in (resource.RUSAGE_SELF, resource.RUSAGE_CHILDREN)]
        return [x.ru_utime + x.ru_stime for x in both]
    before = now()
    call()
    return [b - a for a, b in zip(before, now())]
"""


def names(code):
    """The imports of a call."""
    lines = ["from tensegrity import *", "from granular import *"][: 1 + ("bead" in code)]
    if any(x in code for x in ALGEBRA):
        lines += ["import sympy as sp", "r, v = sp.symbols('r v')"]
    return "\n".join(lines)


def cpu(command, folder, **more):
    """CPU seconds of a process with those that it started, and what it printed."""
    before = resource.getrusage(resource.RUSAGE_CHILDREN)
    given = {k: v for k, v in os.environ.items() if k != "PYTHONDONTWRITEBYTECODE"}
    answer = subprocess.run(
        command, cwd=ROOT, env=given | ONE | {"XDG_CACHE_HOME": str(folder)}, check=True,
        capture_output=True, text=True, **more,
    )  # fmt: skip
    after = resource.getrusage(resource.RUSAGE_CHILDREN)
    return after.ru_utime + after.ru_stime - before.ru_utime - before.ru_stime, answer.stdout


def fresh(code, repeats=3):
    """Medians of CPU seconds and of what a program prints as JSON, in empty caches."""
    found = []
    for _ in range(repeats):
        with tempfile.TemporaryDirectory() as folder:
            spent, printed = cpu([sys.executable, "-c", code], folder)
        found.append([spent, *(json.loads(printed) if printed.strip() else [])])
    return [statistics.median(x) for x in zip(*found, strict=True)]


def unit(repeats=7):
    """CPU seconds of compiling the fixed loops."""
    command = [os.environ.get("CC", "cc"), "-O3", "-march=native", "-fPIC", "-shared", "-xc", "-"]
    with tempfile.TemporaryDirectory() as folder:
        made = [*command, "-o", f"{folder}/loops.so"]
        return statistics.median(cpu(made, folder, input=LOOPS)[0] for _ in range(repeats))


def first_calls():
    """Rows of first calls: CPU, that of compilers over the unit, all over the imports."""
    each, imports = unit(), fresh("import numpy, scipy.optimize, casadi", 5)[0]
    for name, (code, compilers, whole) in FIRST.items():
        inside = code.replace("\n", "\n    ")
        call = f"{names(code)}\n{CHAIN}{SPENT}\ndef call():\n    {inside}\n"
        spent, _, made = fresh(f"{call}print(json.dumps(spent(call)))")
        yield [name, spent, made / each, str(compilers or "-"), spent / imports, str(whole or "-")]


def new_numbers():
    """Rows of new numbers in a law: the first call over a warm one, and the largest allowed."""
    for name, (energy, most) in NUMBERS.items():
        program = f"""{names("r**")}
import statistics
{CHAIN}{SPENT}
def run(x):
    return sum(spent(lambda: chain({energy})))
run(0.07)
warm = statistics.median(run(0.07) for _ in range(15))
new = statistics.median(run(x) for x in (0.11, 0.13, 0.17, 0.19, 0.23, 0.29, 0.31))
print(json.dumps([warm, new]))"""
        _, warm, new = fresh(program, 1)
        yield [name, 1e3 * warm, new / warm, str(most)]


def new_shapes():
    """Rows of laws of another shape in a process that has run one: compilers over the unit."""
    each = unit()
    for name, (energy, most) in SHAPES.items():
        program = (
            f"{names('r**')}\n{CHAIN}{SPENT}\nchain(PowerLaw(1.0, 1.5, 0.01))\n"
            f"print(json.dumps(spent(lambda: chain({energy}))))"
        )
        yield [name, fresh(program)[2] / each, str(most)]


def runs():
    """{case: (scene, state, t_end)} of what peers answer too."""
    beads, pack = map(_first.scene_of, (_first.BEADS, _first.PACK))
    thermal = 0.02 * np.random.default_rng(0).standard_normal(pack.shape)  # m/s
    return {
        _first.WAVE: scenes()["wave"],
        _first.BEADS: (beads, beads.at_rest({0: 0.1}), 72.0),
        _first.PACK: (pack, State(0 * thermal, thermal), 2e-5),
    }


def verlet_steps(run, exact):
    """Steps of velocity Verlet for an error of `TOL`, from its errors at two numbers of steps."""
    scene, state, t_end = run
    found = []
    for steps in (4000, 8000):
        last = simulate(scene, state, t_end, dt=t_end / steps, method="verlet", record=LAST).final
        found.append(gap((last.u, last.v), exact))
    order = np.log2(found[0] / found[1])
    print(f"order of Verlet seen: {order:.2f}")
    return int(8000 * 1.02 * (found[1] / TOL) ** (1 / order))


def against_peers():
    """Rows of the same answers by peers: CPU seconds of the first and of further ones, both over
    those here, and the error."""
    there, base = [who for who in PEERS if find_spec(who)], fresh("import numpy")[0]
    for who in PEERS:
        if who not in there:
            print(f"skipped: {who} is not installed; pip install '.[bench]'")
    for case, run in runs().items():
        last = simulate(*run, tol=1e-3 * TOL, record=LAST).final
        exact, steps, ours = (last.u, last.v), None, None
        for who in ("here", *there):
            if case not in PEERS.get(who, (case,)):
                continue
            setting = {"here": TOL, "heyoka": TAYLOR}.get(who)
            if setting is None:
                setting = steps = steps or verlet_steps(run, exact)
            cold, warm, error = answered(case, run, who, setting, exact)
            cold += base * (who != "here")
            ours = ours or (cold, warm)
            yield [f"{case}: {who}", cold, warm, error, cold / ours[0], warm / ours[1]]


def answered(case, run, who, setting, exact):
    """CPU seconds of the first answer and of a further one, and the error; see `_first`."""
    found = []
    for _ in range(ANSWERS):
        with tempfile.TemporaryDirectory() as folder:
            file = Path(folder, "state.npz")
            np.savez(file, u=run[1].u, v=run[1].v, t_end=run[2])
            given = case, who, str(setting), str(file)
            command = [sys.executable, "-m", "benchmarks._first", *given]
            found.append(json.loads(cpu(command, folder)[1].splitlines()[-1]))
            with np.load(file) as last:
                u, v = last["u"], last["v"]
    wide = u.shape[1:]  # LAMMPS gives two coordinates
    error = gap((u, v), [x[..., : wide[0]] if wide else x for x in exact])
    return *(statistics.median(x) for x in zip(*found, strict=True)), error


def main():
    """Print the costs of first calls, of new numbers, of new shapes, and those of peers."""
    columns = ["", "CPU [s]", "compilers", "at most", "over imports", "at most"]
    table("first calls", columns, list(first_calls()), ours=("compilers", "over imports"))
    columns = ["", "warm [ms]", "new / warm", "at most"]
    table("new numbers", columns, list(new_numbers()), ours=("new / warm",))
    table("another shape", ["", "compilers", "at most"], list(new_shapes()), ours=("compilers",))
    columns = ["", "first [s]", "warm [s]", "error", "first/here", "warm/here"]
    title = f"the same answer, error {TOL:g}, CPU"
    table(title, columns, list(against_peers()), theirs=("first/here", "warm/here"))


if __name__ == "__main__":
    main()
