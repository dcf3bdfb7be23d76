"""One answer in a fresh process, by this toolkit or by a peer: `python -m benchmarks._first`.

Arguments are a case, who, a setting (a tolerance, or a number of steps), and a file with u, v and
the duration, in which u and v of the answer replace the first two.  Printed are the CPU seconds of
the first answer, and the least of further ones, as JSON.  Here the whole process counts, with
Python, all imports, rows, energies and the compiler.  Of a peer only what it takes from its own
import on counts, without Python, NumPy, SymPy and what makes the scene.
"""

from __future__ import annotations

import json
import resource
import sys

import numpy as np

from tensegrity import Chain, PowerLaw, Prism, State, simulate

AGAIN = 3
PRISM = Prism(1.0, 0.7, 0.01, 1.0)
WAVE, BEADS, PACK = "wave, 128 prisms", "60 Hertz beads", "pack of 833 beads"


def scene_of(case):
    """The scene of a case."""
    if case == WAVE:
        return Chain(PRISM.potential(), 128)
    if case == BEADS:
        return Chain(PowerLaw(1.0, 1.5), 60)
    from benchmarks._network import pack

    return pack(7, 17)


def answer_of_peer(case, who, scene):
    """A function (state, t_end, setting) -> call that returns u and v."""
    import sympy as sp

    from benchmarks import _peers, lammps, network
    from tensegrity.precision import peers

    def of_pack(state, t_end, steps):
        if who != "lammps":
            made = {"numba": network.in_numba, "jax": _peers.pack_in_jax}[who]
            return made(scene, state.v, steps, t_end / steps)
        walls, module = network.in_box(scene), lammps.library()

        def run():
            peer = lammps.Peer(module, scene.positions, walls, velocities=state.v)
            peer.core.command(f"timestep {t_end / steps:.17g}")
            peer.run(steps)
            return peer.positions() - scene.positions[:, :2], peer.velocities()

        return run

    if case == PACK:
        return of_pack
    r = sp.Symbol("r")
    hertz = r, -(sp.Max(-r, 0) ** sp.Rational(3, 2))
    tension = _peers.prism_tension(PRISM) if case == WAVE else hertz
    made = {"heyoka": peers.heyoka, "numba": peers.numba_verlet, "jax": peers.jax_verlet}[who]

    def of_chain(state, t_end, setting):
        (entry,) = made(scene, state, t_end, tension, [setting])
        return lambda: entry.prepare()()

    return of_chain


def spent():
    """CPU seconds of this process and of those that it started."""
    both = [resource.getrusage(k) for k in (resource.RUSAGE_SELF, resource.RUSAGE_CHILDREN)]
    return sum(x.ru_utime + x.ru_stime for x in both)


def main(case, who, setting, file):
    """Answer, again, and print what both took."""
    with np.load(file) as given:
        state, t_end = State(given["u"], given["v"]), float(given["t_end"])
    began, scene, setting = 0.0, scene_of(case), json.loads(setting)
    if who == "here":

        def run():
            last = simulate(scene, state, t_end, tol=setting).final
            return last.u, last.v

    else:
        make = answer_of_peer(case, who, scene)
        began = spent()
        run = make(state, t_end, setting)
    u, v = run()
    first, again = spent() - began, []
    for _ in range(AGAIN):
        began = spent()
        run()
        again.append(spent() - began)
    np.savez(file, u=u, v=v)
    print(json.dumps([first, min(again)]))


if __name__ == "__main__":
    main(*sys.argv[1:])
