"""One gradient of 60 prisms by one peer: `python -m benchmarks._adjoint PEER STEPS`.

Prints the CPU seconds of a gradient, the most memory of the process in MB, the value, and the
norm of the derivatives by the prestrains.  Peers store states of the run: JAX every one,
through lax.scan, diffrax with its default adjoint some, from which it computes the others again.
"""

from __future__ import annotations

import resource
import sys
import time

import numpy as np

BONDS, DT, HEIGHT, SPEED, SITE = 60, 0.05, 0.7, 0.05, 20
PRESTRAINS = np.linspace(0.01, 0.05, BONDS)


def ours(steps):
    from tensegrity import Chain, Prism, gradient, objective

    springs = [Prism(1.0, HEIGHT, p, 1.0).potential() for p in PRESTRAINS]
    chain = Chain(springs, BONDS + 1, ends=("free", "fixed"))
    chosen, state = objective.displacement(SITE), chain.at_rest({0: SPEED})

    def call():
        found = gradient(chosen, chain, state, steps * DT, dt=DT, wanted=("prestrain",))
        return found.value, found.by("prestrain")

    return call


def energy_in(np_):
    """Energy of bonds (elongations, prestrains) by the plain closed form."""
    a2 = 1.0 / 3.0  # circumradius squared of a base of 1 m
    c0, s0 = np.cos(5 * np.pi / 6), np.sin(5 * np.pi / 6)

    def energy(r, prestrain):
        h = HEIGHT + r
        cosine = c0 + (h**2 - HEIGHT**2) / (2 * a2)  # b^2 = h^2 + 2 a^2 (1 - cos phi)
        sine = np_.sqrt(1 - cosine**2)
        third = -cosine / 2 + np.sqrt(3) / 2 * sine  # cos(phi - 2 pi/3)
        length = np_.sqrt(h**2 + 2 * a2 * (1 - third))
        at_rest = np_.sqrt(HEIGHT**2 + 2 * a2 * (1 - (-c0 / 2 + np.sqrt(3) / 2 * s0)))
        return 1.5 * (length - at_rest / (1 + prestrain)) ** 2

    return energy


def _jax():
    import jax

    jax.config.update("jax_enable_x64", True)
    import jax.numpy as jnp

    energy = energy_in(jnp)
    tension = jax.vmap(jax.grad(energy), (0, 0))
    held = np.ones(BONDS + 1)
    held[-1] = 0

    def force(u, prestrains):
        f = tension(u[1:] - u[:-1], prestrains)
        return held * (jnp.append(f, 0) - jnp.append(0, f))

    start = np.zeros(BONDS + 1)
    start[0] = SPEED
    return jax, jnp, force, jnp.zeros(BONDS + 1), jnp.asarray(start)


def jax(steps):
    package, jnp, force, u, v = _jax()

    def value(prestrains):
        def step(state, _):
            u, v = state
            v = v + DT / 2 * force(u, prestrains)
            u = u + DT * v
            v = v + DT / 2 * force(u, prestrains)
            return (u, v), None

        (end, _), _ = package.lax.scan(step, (u, v), None, length=steps)
        return end[SITE]

    function = package.jit(package.value_and_grad(value))
    return lambda: [np.asarray(x) for x in function(jnp.asarray(PRESTRAINS))]


def diffrax(steps):
    import diffrax as package

    jaxlib, jnp, force, u, v = _jax()
    terms = (
        package.ODETerm(lambda t, y, p: y), package.ODETerm(lambda t, y, p: force(y, p))
    )  # fmt: skip

    def value(prestrains):
        found = package.diffeqsolve(
            terms,
            package.SemiImplicitEuler(),
            0.0,
            steps * DT,
            DT,
            (u, v + DT / 2 * force(u, prestrains)),
            prestrains,
            max_steps=steps + 1,
        )  # kicks half a step before the drifts: Verlet with its velocities half a step ahead
        return found.ys[0][0][SITE]

    function = jaxlib.jit(jaxlib.value_and_grad(value))
    return lambda: [np.asarray(x) for x in function(jnp.asarray(PRESTRAINS))]


def main(peer, steps):
    """Time one call after a first."""
    call, times = {"ours": ours, "jax": jax, "diffrax": diffrax}[peer](int(steps)), []
    value, slopes = call()
    for _ in range(3):
        began = time.process_time()
        call()
        times.append(time.process_time() - began)
    most = resource.getrusage(resource.RUSAGE_SELF).ru_maxrss / 1e3
    print(min(times), most, float(value), float(np.linalg.norm(slopes)))


if __name__ == "__main__":
    main(*sys.argv[1:])
