"""A wave launched by an impact at a wanted speed, measured and set beside the asymptotics."""

from __future__ import annotations

import numpy as np

from tensegrity import Chain, LockingError, Record, simulate
from tensegrity.asymptotics import sech2, sound_speed, tent
from tensegrity.observables import arrival, crest, speed, width

TOLERANCE = 1e-6  # of the runs
PIECES = 60  # of the time sound takes: how finely the arrival is looked for


def launch(spring, struck, velocity, sites, travel):
    """Strike the first `struck` masses and follow the leading pulse to bond `travel`.

    Returns
    -------
    run : Run
        Recorded at all sites until the crest is a little beyond `travel`.
    """
    chain = Chain(spring, sites)
    state = chain.at_rest(dict.fromkeys(range(struck), velocity))
    piece = travel / sound_speed(spring) / PIECES
    probe, t_end = state, 0.0
    while crest_place(chain, probe) < travel:
        probe = simulate(chain, probe, piece).final
        t_end += piece
    return simulate(chain, state, t_end, tol=TOLERANCE, record=Record(every=2))


def crest_place(chain, state):
    """Bond that the leading crest has reached; 0 before there is one."""
    r = chain.elongation(state.u)
    return crest(r)[0] if np.argmax(np.abs(r)) > 1 else 0.0


def tuned(spring, ratio, struck, sites, travel, bracket):
    """The impact whose leading pulse runs at `ratio` times the speed of sound.

    Returns
    -------
    velocity : float
        Of the struck masses [m/s].
    run : Run
    """
    from scipy.optimize import brentq

    target = ratio * sound_speed(spring)
    runs = {}

    def excess(velocity):
        try:
            runs[velocity] = launch(spring, struck, velocity, sites, travel)
        except LockingError:
            return target  # too hard a blow: surely too fast
        return speed(runs[velocity], _sensors(travel)) - target

    velocity = brentq(excess, *bracket, xtol=1e-9, rtol=1e-5)
    if velocity not in runs:
        excess(velocity)
    return velocity, runs[velocity]


def _sensors(travel):
    return int(0.7 * travel), int(0.9 * travel)


def comparison(spring, ratio, struck, sites, travel, bracket, around):
    """Measured strain profile beside sech^2 and tent, and the numbers read off them.

    The profile is assembled from several instants, each shifted to its crest, because one
    instant holds only a few masses.
    """
    velocity, run = tuned(spring, ratio, struck, sites, travel, bracket)
    measured = speed(run, _sensors(travel))
    x, strain = _profile(run, spring, measured, travel, around)
    dense = np.linspace(-around, around, 40 * around + 1)
    even = np.interp(dense, x, strain)
    first = {
        "x": x,
        "strain": strain,
    }
    asymptotic = {
        "x": dense,
        "sech2": sech2(spring, ratio, dense) / spring.length,
        "tent": tent(spring, dense) / spring.length,
    }
    numbers = {
        "quantity": [
            "speed over sound speed",
            "impact velocity [m/s]",
            "peak strain",
            "peak over locking stroke",
            "width at 5 % of the peak [sites]",
            "sech^2: peak strain",
            "sech^2: largest deviation over peak",
            "tent: largest deviation over peak",
            "relative energy error",
            "estimated error of the run",
        ],
        "value": [
            measured / sound_speed(spring),
            velocity,
            strain[np.argmax(np.abs(strain))],
            np.abs(strain).max() * spring.length / -spring.domain[0],
            width(dense, even),
            asymptotic["sech2"][len(dense) // 2],
            np.max(np.abs(even - asymptotic["sech2"])) / np.abs(even).max(),
            np.max(np.abs(even - asymptotic["tent"])) / np.abs(even).max(),
            run.energy_error,
            run.error_estimate,
        ],
    }
    return {"measured": first, "asymptotic": asymptotic, "numbers": numbers}


def _profile(run, spring, measured, travel, around):
    """Strain against distance from the crest, from the instants that span one site of travel."""
    bond = int(0.9 * travel)
    passing = run.t - arrival(run, bond)
    chosen = np.abs(passing) * measured <= 1.5
    centre = bond + measured * passing[chosen]
    r = run.scene.elongation(run.u[chosen])
    bonds = np.arange(r.shape[1])
    x = bonds[None, :] - centre[:, None]
    strain = r / spring.length
    near = np.abs(x) <= around + 1
    order = np.argsort(x[near])
    return x[near][order], strain[near][order]


def draw(axes, side, tables, title):
    """Profile with both asymptotics in one axes; the numbers in another."""
    measured, asymptotic = tables["measured"], tables["asymptotic"]
    axes.plot(asymptotic["x"], -asymptotic["sech2"], "C1--", label="sech$^2$")
    axes.plot(asymptotic["x"], -asymptotic["tent"], "C2:", lw=2, label="tent (locking stroke)")
    axes.plot(measured["x"], -measured["strain"], "C0.", ms=3, label="chain, after impact")
    axes.set(xlabel="distance from the crest [sites]", ylabel="compressive strain")
    axes.set_title(title)
    peak = np.max(-measured["strain"])
    crests = [np.max(-asymptotic[name]) for name in ("sech2", "tent")]
    axes.set_ylim(-0.05 * peak, 1.3 * max([peak, *(c for c in crests if c < 2 * peak)]))
    axes.legend(loc="upper right", fontsize=8)
    side.axis("off")
    numbers = tables["numbers"]
    lines = [
        f"{q}\n    {v:.6g}" for q, v in zip(numbers["quantity"], numbers["value"], strict=True)
    ]
    side.text(0, 1, "\n".join(lines), va="top", fontsize=8, transform=side.transAxes)
