"""The loops of the toolkit in extended precision, as a reference for those in double, and for
processors with narrower vectors."""

import shutil

import numpy as np

from tensegrity import METHODS
from tensegrity.engine.compiled import Compiled, compiled
from tensegrity.engine.kernel import bind
from tensegrity.scenes.dynamics import dynamics


def loop(scene, state, method, dt):
    """The same generated text, compiled in long double."""
    bonds = dynamics(scene).loop_bonds
    u, v = (np.array(x, dtype=np.longdouble) for x in dynamics(scene).arrays(state))
    return bind(u, v, bonds, METHODS[method], dt, Compiled.of(bonds, extended=True))


def extended(scene, state, method, dt, steps):
    """u and v of the sites after some steps."""
    bound = loop(scene, state, method, dt)
    bound.advance(steps)
    return bound.u[: scene.sites], bound.v[: scene.sites]


def rows(scene, state, t_end, steps, at):
    """u and v after steps `at` of the corrected method, rounded: double has too few digits to tell
    an error of 1e-11 where motions part."""
    bound, done, found = loop(scene, state, "corrected6", np.longdouble(t_end) / steps), 0, []
    for k in at.tolist():
        if k:
            bound.advance_open(k - done, done > 0)
            for array, given in zip(bound.output, (bound.u, bound.v), strict=True):
                array[...] = given
            bound._postprocess(*bound._addresses, *(x.ctypes.data for x in bound.output))
        done, shown = k, bound.output if k else (bound.u, bound.v)
        found.append([x[: scene.sites].astype(float) for x in shown])
    return np.moveaxis(found, 1, 0)


def lacking(monkeypatch, flag):
    """Compile for a processor without what a flag says; scenes made before keep their kernels."""
    monkeypatch.setenv("CC", f"{shutil.which('cc') or shutil.which('gcc')} {flag}")
    compiled.cache_clear()
