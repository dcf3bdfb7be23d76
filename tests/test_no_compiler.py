"""Without a compiler: what does not step in time goes on, what does is refused before any work."""

import json
import os
import subprocess
import sys
from concurrent.futures import ThreadPoolExecutor
from pathlib import Path

import numpy as np
import pytest
import sympy as sp
from test_continuation import followed

from tensegrity import Chain, Prism, Record, simulate

ROOT = Path(__file__).parent.parent
WITHOUT = "import sys; sys.modules['ziglang'] = None; sys.path.insert(0, 'tests')\n"


def outcome(code, folder):
    """What code prints in a process that finds no compiler, nor anything that another one kept."""
    environment = {k: x for k, x in os.environ.items() if k != "CC"}
    environment |= {"PATH": "", "PYTHONPATH": str(ROOT), "XDG_CACHE_HOME": str(folder / "cache")}
    answer = subprocess.run(
        [sys.executable, "-W", "error", "-c", WITHOUT + code], cwd=ROOT, env=environment,
        capture_output=True, text=True, timeout=600,
    )  # fmt: skip
    assert answer.returncode == 0, answer.stderr
    return answer.stdout


def numbers():
    """Numbers of what needs no compiler, by what gives them."""
    from derivations import rigid_response
    from granular import Bead, fcc_pack, materials
    from tensegrity import (
        Chain,
        Polynomial,
        PowerLaw,
        Prism,
        State,
        dispersion,
        equilibrium,
        equilibrium_path,
        equilibrium_paths,
        fit,
        held,
        modes,
        plates,
        predict,
        solitary_wave,
    )

    rigid, soft = Prism(1.0, 0.7, 0.1, 1.0), Prism(1.0, 0.7, 0.1, 1.0, 2.0, 20.0)
    spring, elastic = rigid.potential(0.01), soft.potential()
    path, paths = equilibrium_path(soft), equilibrium_paths([soft, rigid])
    height, load = path.height[:9], path.load[:9]
    fitted = fit(soft.height - height, load, soft, ("prestrain", "k_cross"), noise=1e-4)
    wave = solitary_wave(spring, speed_ratio=1.2)
    (family,) = predict(PowerLaw(1.0, 1.5, preload=0.1)).families
    chain = Chain([spring, elastic] * 4 + [spring], 10)
    u, r = 0.01 * np.sin(np.arange(10.0)), np.linspace(-0.02, 0.02, 5)
    structure, ends = soft.structure(mass=1.0), (range(3), range(3, 6))
    state = equilibrium(structure, {3: (0, 0, -0.02)}, supports=held(ends[0]))
    squeezed = equilibrium_path(structure, supports=plates(*ends), max_load=0.05)
    steel = materials["steel"]
    pack = fcc_pack(2, 2, bead=Bead(5e-3, steel), floor=steel, sides=steel, gravity=9.81)
    found = {
        "derivations": [float(x) for x in rigid_response.lock_order()],
        "potentials": [
            one.tension(r) for one in (spring, elastic, Polynomial(spring, -0.03, 0.03))
        ],
        "path": [path.load, [event.at["load"] for event in path.events]],
        "paths": [one.load for one in paths],
        "fit": list(fitted.values.values()),
        "wave": [wave.speed, wave.amplitude],
        "family": [family.speeds, family.crests],
        "chain": [chain.forces(u), chain.energy(State(u, u)), chain.stiffness(u).toarray()],
        "modes": [modes(chain).frequencies, dispersion([spring], [1.0], np.array([0.5]))],
        "structure": [structure.modes().frequencies, squeezed.load, state.positions],
        "pack": [pack.at_rest().u],
    }
    return {
        name: np.concatenate([np.ravel(x) for x in one]).tolist() for name, one in found.items()
    }


@pytest.fixture(scope="module")
def without(tmp_path_factory):
    """What needs no compiler, and branches, in a process without one."""
    code = """
import json, test_continuation, test_no_compiler
print(json.dumps([test_no_compiler.numbers(), test_continuation.followed()]))"""
    return json.loads(outcome(code, tmp_path_factory.mktemp("without")))


def test_what_does_not_step_in_time_needs_no_compiler(without):
    found, _ = without
    for name, one in numbers().items():
        scale = np.abs(one)[np.isfinite(one)].max()  # a path's own points lie on it to 1e-7
        np.testing.assert_allclose(found[name], one, rtol=1e-7, atol=1e-12 * scale, err_msg=name)


def test_branches_without_a_compiler_have_the_same_events(without):
    """Rows may lie elsewhere by round-off that the step control saw; events may not."""
    _, found = without
    for name, (end, columns, events) in followed().items():
        other_end, other_columns, other_events = found[name]
        assert other_end == end, name
        np.testing.assert_allclose(other_columns, columns, rtol=1e-5, atol=1e-6, err_msg=name)
        assert [e[:2] for e in other_events] == [[kind, row] for kind, row, _ in events], name
        for (*_, one), (*_, other) in zip(events, other_events, strict=True):
            np.testing.assert_allclose(other, one, rtol=1e-11, atol=1e-13, err_msg=name)


def refused(folder):
    """What each call that steps in time says."""
    from granular import Bead, Striker, materials
    from granular.design import Sizes, peak_force, search
    from tensegrity import (
        Chain,
        CompilerError,
        Drive,
        Prism,
        Record,
        gradient,
        objective,
        resume,
        simulate,
        sweep,
    )

    prism, steel = Prism(1.0, 0.7, 0.1, 1.0), materials["steel"]
    chain = Chain(prism.potential(), 6)
    start, kept = chain.at_rest({0: 0.01}), Record(path=folder / "new.npy", checkpoint=0.0)
    driven = Chain(prism.potential(), 6, drive={0: Drive(force=0.01)})
    tuned = Chain(prism.potential().over_time(prestrain=0.1 + sp.Symbol("t") / 99), 6)
    bead = Bead(5e-3, steel)
    blow = {"striker": Striker(bead, 0.5), "wall": steel, "t_end": 1e-3}
    sizes, file = Sizes(4, (4e-3, 6e-3), 0.02, steel), folder / "new.json"

    def run(t):
        return simulate(chain, start, t)

    calls = {
        "simulate": lambda: simulate(chain, start, 1.0, tol=1e-6, record=kept),
        "driven": lambda: simulate(driven, driven.at_rest(), 1.0, dt=0.1, record=kept),
        "resume": lambda: resume(folder / "old.npy"),
        "gradient": lambda: gradient(objective.displacement(2), chain, start, 1.0, dt=0.1),
        "tuned": lambda: simulate(tuned, start, 1.0, dt=0.1),
        "sweep": lambda: sweep(run, [1, 2], None, file),
        "threads": lambda: sweep(run, [1, 2], pool, file),
        "search": lambda: search(sizes, **blow, method="cma", checkpoint=file),
        "downhill": lambda: search(sizes, **blow, method="gradient", checkpoint=file),
        "peak_force": lambda: peak_force([bead] * 4, **blow),
    }
    pool, found = ThreadPoolExecutor(1), {}
    for name, call in calls.items():
        try:
            call()
        except CompilerError as error:
            found[name] = str(error)
    return found, list(calls)


def test_what_steps_in_time_is_refused_in_one_line_before_any_work(tmp_path):
    chain = Chain(Prism(1.0, 0.7, 0.1, 1.0).potential(), 6)
    record = Record(path=tmp_path / "old.npy", checkpoint=0.0)
    simulate(chain, chain.at_rest({0: 0.01}), 1.0, dt=0.1, record=record)
    before = sorted(tmp_path.iterdir())
    code = f"""
import json, pathlib, test_no_compiler as t
print(json.dumps(t.refused(pathlib.Path({str(tmp_path)!r}))))"""
    found, calls = json.loads(outcome(code, tmp_path))
    assert list(found) == calls
    (line,) = set(found.values())
    assert "\n" not in line
    for word in ("time stepping needs a C compiler", "pip install ziglang", "gcc", "clang", "CC"):
        assert word in line
    assert sorted(tmp_path.iterdir()) == sorted([*before, tmp_path / "cache"])


INTERRUPTED = """
import os, signal
import casadi as ca
from tensegrity import Prism, equilibrium_path

class Pressed:  # CasADi converts it by a call of Python, in which Ctrl-C comes
    def __init__(self, of): self.of = of
    def __DM__(self):
        os.kill(os.getpid(), signal.SIGINT)
        return ca.DM(self.of)

def pressing(function, *of): return call(function, Pressed(of[0]), *of[1:])

signal.signal(signal.SIGINT, signal.default_int_handler)  # a shell may have ignored it
soft, call = Prism(1.0, 0.7, 0.1, 1.0, 2.0, 20.0), ca.Function.__call__
spring, whole = soft.potential(), equilibrium_path(soft)
for compute in (lambda: spring.tension(0.01), lambda: equilibrium_path(soft)):
    ca.Function.__call__ = pressing
    try:
        compute()
        print("lost")
    except KeyboardInterrupt:
        print("interrupted")
    ca.Function.__call__ = call
"""


def test_ctrl_c_is_no_other_error_and_is_not_lost_in_casadi(tmp_path):
    assert outcome(INTERRUPTED, tmp_path) == "interrupted\ninterrupted\n"
