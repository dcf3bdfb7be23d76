"""Errors of prestrain of 1 % cost the lens 2 % of its peak, and the fluid's reaction far less."""

from __future__ import annotations

import functools

import numpy as np

from figures import _lens
from figures._draw import name_curves
from figures._lens import row
from tensegrity import Chain, Prism

NAME = "lens_errors"
GROUP = "lens"

ERRORS = (0.003, 0.01, 0.03)  # standard deviations of the relative error of a prestrain
SEEDS = range(20)
DENSITIES = (1e-3, 3e-3, 1e-2, 3e-2, 1e-1)  # kg/m^3, of the fluid
TOLERANCE = 1e-10  # of the integrator of SciPy


def detuned(error, seed):
    """Peak at the focus over that of the lens, and over the sum of its own single peaks."""
    lens = _lens.lens()
    t = _lens.around(lens, 4.0, 4.0)
    wrong = 1 + error * np.random.default_rng(seed).standard_normal(lens.chains)
    each = lens.pressures(lens.focus, t, lens.chain_prestrains * wrong)
    peak = _lens.top(t, each.sum(axis=0))[1]
    whole = _lens.top(t, lens.pressure(lens.focus, t))[1]
    return peak / whole, peak / sum(_lens.top(t, p)[1] for p in each)


@functools.cache
def pushed_back(resistance):
    """First peak of the acceleration of the centre's last mass, where a dashpot [N s/m] stands for
    the most that a fluid can resist, rho c A: its instant and value, by SciPy."""
    from scipy.integrate import solve_ivp

    lens = _lens.lens()
    prestrain = float(lens.chain_prestrains.min())
    members = Prism(lens.prism.base, lens.prism.height, prestrain, lens.prism.k_cross)
    chain = Chain(members.potential(), lens.sites)

    def slope(t, y):
        u, v = y.reshape(2, -1)
        acceleration = chain.forces(u)
        acceleration[-1] -= resistance * v[-1]
        return np.concatenate([v, acceleration])

    t_end = float(lens.arrivals.max()) + 2.0
    start = chain.at_rest({0: lens.velocity})
    t = np.arange(t_end - 5.0, t_end, _lens.STEP)
    run = solve_ivp(
        slope, (0, t_end), np.concatenate([start.u, start.v]), "DOP853", t_eval=t,
        rtol=TOLERANCE, atol=TOLERANCE * lens.velocity,
    )  # fmt: skip
    push = np.array([slope(0.0, y)[-1] for y in run.y.T])
    return _lens.top(t, push)


def data():
    """Fractions of the peak for each error and seed; changes of a pulse for each density."""
    shares = {"seed": np.array(SEEDS)}
    for error in ERRORS:
        found = np.array([detuned(error, seed) for seed in SEEDS])
        shares |= {f"{error:g} of the lens": found[:, 0], f"{error:g} of its own": found[:, 1]}
    lens = _lens.lens()
    numbers = np.array(DENSITIES) * lens.coupling / lens.host_density
    resistances = [rho * lens.host_speed * lens.area for rho in DENSITIES]
    free, later = pushed_back(0.0), np.array([pushed_back(z) for z in resistances])
    return {
        "shares": shares,
        "coupling": {
            "density [kg/m3]": np.array(DENSITIES),
            "rho c A/(m cs)": numbers,
            "peak falls by": 1 - later[:, 1] / free[1],
            "peak is earlier by [s]": free[0] - later[:, 0],
        },
    }


def table(tables):
    """Ranges of the fractions, and the change of a pulse at the density of the lens."""
    rows = []
    for error in ERRORS:
        case = f"errors of prestrain of {100 * error:g} %, {len(SEEDS)} seeds"
        for kind, words in (("lens", "that of the lens"), ("its own", "the sum of single peaks")):
            key = f"{error:g} of its own" if kind == "its own" else f"{error:g} of the lens"
            found = tables["shares"][key]
            reference = "0.98 to 0.995" if (error, kind) == (0.01, "its own") else ""
            text = f"{found.min():.4f} to {found.max():.4f}, mean {found.mean():.4f}"
            rows.append(row(case, f"peak over {words}", text, reference))
    coupling = tables["coupling"]
    for k in (0, -1):
        case = f"rho c A/(m cs) = {coupling['rho c A/(m cs)'][k]:.2g}, with the fluid's reaction"
        rows.append(row(case, "peak of the end falls by", float(coupling["peak falls by"][k])))
        rows.append(row(case, "and is earlier by [s]",
                        float(coupling["peak is earlier by [s]"][k])))  # fmt: skip
    return rows


def draw(figure, tables):
    """Fractions for each error, change of the peak against the coupling."""
    figure.set_size_inches(9, 4.2)
    a, b = figure.subplots(1, 2)
    for k, error in enumerate(ERRORS):
        found = tables["shares"][f"{error:g} of the lens"]
        a.plot(k + np.linspace(-0.2, 0.2, len(found)), found, "C0o", ms=4)
    a.set_xticks(range(len(ERRORS)), [f"{100 * e:g} %" for e in ERRORS])
    a.set(xlabel="standard deviation of the errors of prestrain",
          ylabel="peak over that of the exact lens", title=f"{len(SEEDS)} lenses each")  # fmt: skip
    coupling = tables["coupling"]
    number = coupling["rho c A/(m cs)"]
    b.loglog(number, coupling["peak falls by"], "o-", label="peak of\nthe end")
    b.loglog(number, number, "k:", lw=1, label="slope 1")
    b.set(xlabel=r"coupling number $\rho c A / (m c_s)$", ylabel="relative change by the fluid",
          title="what one-way coupling leaves out")  # fmt: skip
    b.set_xlim(right=3 * number.max())
    name_curves(b)
