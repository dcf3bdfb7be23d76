"""A step of Newton's method for a breather of 80 prisms, against SciPy and numba.

Each computes v(T/2) and its derivatives by the 80 displacements at rest, to 1e-8 of the largest,
and solves for the correction: SciPy's DOP853 with the variational equations in NumPy, and in numba
the same splitting as here, as an expert writes it, its columns side by side.  Each takes the
coarsest tolerance or the fewest steps that suffice.  Processor time, minima over repeats.
"""

from __future__ import annotations

import time

import numpy as np
import sympy as sp

from benchmarks._peers import has, prism_tension
from benchmarks._timing import record, table
from tensegrity import Chain, Prism, State, periodic_orbit
from tensegrity.orbits.flow import METHOD, Flow

SITES, RATIO, WITHIN, REPEATS = 80, 1.1, 1e-8, 10
PRISM = Prism(1.0, 0.7, 0.1, 1.0)
STEPS, TOLERANCES = (8, 10, 12, 14, 16, 20, 24), (1e-5, 1e-6, 1e-7, 1e-8, 1e-9, 1e-10)


def breather():
    """The orbit, centred on a bond."""
    spring = PRISM.potential()
    x = np.arange(SITES) - (SITES - 1) / 2
    guess = State(0.02 * np.sin(np.pi * x) / np.cosh(0.63 * x), 0 * x)
    top = np.sqrt(spring.stiffness(0.0)) / np.pi
    return periodic_orbit(Chain(spring, SITES), guess, period=1 / (RATIO * top))


def laws():
    """Elongation, tension and stiffness of a prism, as one would type them."""
    r, tension = prism_tension(PRISM)
    return r, tension, sp.diff(tension, r)


def ours(orbit, steps):
    """A function that gives (v, derivatives)."""
    flow, u = Flow(orbit.scene, steps), orbit.state.u

    def run():
        _, v, tangent = flow.tangents(u, 0 * u, orbit.period / 2, of_u=False)
        return v, tangent[:, :SITES]

    return run


def in_scipy(orbit, tol):
    """The same, of 2 N (N + 1) ordinary differential equations."""
    from scipy.integrate import solve_ivp

    r, *both = laws()
    law = sp.lambdify(r, both, "numpy", cse=True)
    start = np.zeros((2, SITES, SITES + 1))
    start[0, :, 0], start[0, :, 1:] = orbit.state.u, np.eye(SITES)

    def side(t, y):
        x, v = y.reshape(2, SITES, SITES + 1)
        stretch = np.diff(x, axis=0)
        force, stiffness = law(stretch[:, 0])
        stretch *= stiffness[:, None]
        stretch[:, 0] = force
        return np.concatenate([v.ravel(), np.diff(stretch, axis=0, prepend=0, append=0).ravel()])

    def run():
        options = {"method": "DOP853", "rtol": tol, "atol": tol}
        y = solve_ivp(side, (0.0, orbit.period / 2), start.ravel(), **options).y[:, -1]
        v = y.reshape(2, SITES, SITES + 1)[1]
        return v[:, 0], v[:, 1:]

    return run


def in_numba(orbit, steps):
    """The same, by loops over sites and columns."""
    import numba

    r, *both = laws()
    law = numba.njit(sp.lambdify(r, both, "math", cse=True), error_model="numpy")
    kicks, drifts = np.array(METHOD.kicks), np.array(METHOD.drifts)

    @numba.njit(error_model="numpy", fastmath={"contract"})
    def loop(u, v, du, dv, steps, dt):
        sites, columns = du.shape
        left = np.zeros(columns)
        for _ in range(steps):
            for a, b in zip(kicks * dt, drifts * dt):  # noqa: B905
                before = 0.0
                left[:] = 0.0
                for i in range(sites):
                    force, stiffness = 0.0, 0.0
                    if i < sites - 1:
                        force, stiffness = law(u[i + 1] - u[i])
                    v[i] += a * (force - before)
                    before = force
                    for j in range(columns):
                        right = stiffness * (du[min(i + 1, sites - 1), j] - du[i, j])
                        dv[i, j] += a * (right - left[j])
                        left[j] = right
                for i in range(sites):
                    u[i] += b * v[i]
                    for j in range(columns):
                        du[i, j] += b * dv[i, j]

    def run():
        u, v, du, dv = orbit.state.u.copy(), np.zeros(SITES), np.eye(SITES), np.zeros((SITES,) * 2)
        loop(u, v, du, dv, steps, orbit.period / 2 / steps)
        return v, dv

    return run


def error(found, exact):
    """Largest error of the derivatives over the largest of them."""
    return float(np.abs(found[1] - exact[1]).max() / np.abs(exact[1]).max())


def sufficient(contestant, orbit, settings, exact):
    """The first of some settings whose error suffices, its call, and the error."""
    for setting in settings:
        run = contestant(orbit, setting)
        off = error(run(), exact)
        if off <= WITHIN:
            return setting, run, off
    raise RuntimeError(f"no setting of {contestant.__name__} suffices: {off:.1e}")


def seconds(run):
    """Processor time of a step of Newton's method [s]."""
    found = []
    for _ in range(REPEATS):
        start = time.process_time()
        v, jacobian = run()
        # the mean displacement stays as it is, for a free chain may be shifted
        np.linalg.solve(jacobian + np.abs(jacobian).max() / SITES, -v)
        found.append(time.process_time() - start)
        if found[-1] > 1:
            break
    return min(found)


def main():
    orbit = breather()
    exact = ours(orbit, 256)()
    contestants = {"tensegrity": (ours, STEPS), "SciPy DOP853": (in_scipy, TOLERANCES)}
    if has("numba"):
        contestants["numba"] = (in_numba, STEPS)
    rows, times = [], {}
    for name, (contestant, settings) in contestants.items():
        setting, run, off = sufficient(contestant, orbit, settings, exact)
        times[name] = seconds(run)
        ratio = times[name] / times["tensegrity"]
        cells = (f"{setting:g}", f"{off:.1e}", f"{1e3 * times[name]:.3g}", f"{ratio:.3g}")
        rows.append((name, *cells))
        if ratio != 1:
            record("orbits", "a step of Newton's method", f"over {name}", 1.0, ratio)
    columns = ["", "steps or tol", "error", "CPU [ms]", "over ours"]
    table(f"Newton's method for a breather of {SITES} prisms", columns, rows)


if __name__ == "__main__":
    main()
