"""Scenes that several tests share, and runs in extended precision as their reference."""

import numpy as np

from tensegrity import Chain, Prism
from tensegrity.engine.compiled import Compiled
from tensegrity.engine.kernel import bind
from tensegrity.engine.methods import METHODS
from tensegrity.runs import march
from tensegrity.scenes.dynamics import dynamics


def prism_chain(sites=64, ends=("free", "free")):
    """A chain of stiffening prisms."""
    return Chain(Prism(1.0, 0.8, 0.02, 1.0).potential(), sites, ends=ends)


def smooth_blow(chain, speed=0.03):
    """The first four masses pushed."""
    return chain.at_rest(dict.fromkeys(range(4), speed))


def short_attempts(monkeypatch, steps=1):
    """Let a march attempt so many steps at a time."""
    monkeypatch.setattr(march, "BLOCK", 0)
    monkeypatch.setattr(march, "FEWEST", steps)
    monkeypatch.setattr(march, "FIRST", 1)


def interrupted(monkeypatch, at, steps=1, error=KeyboardInterrupt, counts=lambda motion: True):
    """Ctrl-C, or an error, comes with the attempt of that number, each of so many steps, of those
    that count; the list of all, as it grows."""
    calls, attempt = [], march._attempt

    def counted(motion, *rest):
        if counts(motion):
            calls.append(motion.done)
            if len(calls) == at:
                raise error
        return attempt(motion, *rest)

    short_attempts(monkeypatch, steps)
    monkeypatch.setattr(march, "_attempt", counted)
    return calls


def extended(chain, state, method, dt, steps):
    """u and v after some steps of the same generated text, compiled in long double."""
    u, v = state.u.astype(np.longdouble), state.v.astype(np.longdouble)
    engine = Compiled.of(dynamics(chain).loop_bonds, extended=True)
    bind(u, v, dynamics(chain).loop_bonds, METHODS[method], dt, engine).advance(steps)
    return u, v


def plain_forces(chain, u):
    """Forces on the sites, bond by bond in plain Python."""
    f = np.zeros(len(u))
    for j, spring in enumerate(chain.springs):
        tension = float(spring.tension(u[j + 1] - u[j]))
        f[j] += tension
        f[j + 1] -= tension
    return f
