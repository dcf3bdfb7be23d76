"""Scenes that several tests share, and what interrupts a run of them."""

from pathlib import Path

import numpy as np

from tensegrity import Chain, Ensemble, Prism, Record

AT_A_TIME = 8_000_000  # bonds x stages x steps, some 20 ms: an interrupt waits no longer


def prism_chain(sites=64, ends=("free", "free")):
    """A chain of stiffening prisms."""
    return Chain(Prism(1.0, 0.8, 0.02, 1.0).potential(), sites, ends=ends)


def smooth_blow(chain, speed=0.03):
    """The first four masses pushed."""
    return chain.at_rest(dict.fromkeys(range(4), speed))


def blow(sites=24):
    """The chain, and its blow."""
    chain = prism_chain(sites)
    return chain, smooth_blow(chain)


def lanes(count=9):
    """Chains side by side, each with its own blow."""
    ensemble = Ensemble(prism_chain(12), count)
    return ensemble, ensemble.at_rest({1: np.linspace(0.01, 0.03, count)})


def many_steps(bonds, stages=1):
    """So many that a run is not done at once: two thirds of them are, and the others in turn."""
    return 6 * AT_A_TIME // (bonds * stages)


def ctrl_c(t):
    """An observer that an interrupt meets at an instant [s]."""

    def interrupted(*_):
        raise KeyboardInterrupt

    return interrupted, Record(times=[t])


def with_memory(monkeypatch, size):
    """Let the system have so many bytes of free memory."""
    text = f"MemAvailable: {int(size) // 1024} kB"
    monkeypatch.setattr(Path, "read_text", lambda path, *_: text)


def plain_forces(chain, u):
    """Forces on the sites, bond by bond in plain Python."""
    f = np.zeros(len(u))
    for j, spring in enumerate(chain.springs):
        tension = float(spring.tension(u[j + 1] - u[j]))
        f[j] += tension
        f[j + 1] -= tension
    return f
