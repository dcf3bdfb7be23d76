"""Near locking the usable step shrinks with the stroke left; steps far beyond it are refused."""

import numpy as np

from figures._draw import name_curves
from figures._limits import COLOURS, EXPLICIT, grid, moved, prism_chain, slope
from tensegrity import METHODS, LockingError, Record, StabilityError, State, simulate
from tensegrity.scenes.dynamics import dynamics

GROUP = "limits"

GAPS = np.geomspace(1e-5, 1e-1, 13)  # fraction of the stroke left at closest approach
ENERGY_ERROR = 1e-6  # after runs that count as good
FINER = 1.15  # between the steps tried
IN_A_ROW = 4
FIXED = 1e-3  # s, of a natural unit of time: the fixed step that is watched
OVER = 1.001  # energy of the blow that locks, over the one that just does


def collision(gap, over=1.0):
    """Two masses that meet head-on and stop with a part of the stroke left: chain and state."""
    chain = prism_chain(2)
    spring = chain.springs[0]
    speed = np.sqrt(over * spring.energy((1 - gap) * spring.domain[0]))
    return chain, chain.at_rest({0: float(speed), 1: -float(speed)})


def duration(chain, state):
    """Time after which the masses fly apart again: three times that to cross the stroke [s]."""
    return 3 * -chain.springs[0].domain[0] / (2 * state.v[0])


def stability_step(gap, method):
    """Stability limit at the stiffness of the turning point [s]."""
    chain, _ = collision(gap)
    stop = (1 - gap) * chain.springs[0].domain[0]
    return METHODS[method].stability_limit / dynamics(chain).frequency([(stop, 0.0)])


def energy_error(gap, method, dt):
    """Relative error of the energy after the collision, in the bare loop; nan where it broke."""
    chain, state = collision(gap)
    steps = int(np.ceil(duration(chain, state) / dt))
    u, v = moved(chain, state, method, duration(chain, state) / steps, steps)
    if not np.isfinite([u, v]).all() or not chain.springs[0].domain[0] < u[1] - u[0] < np.inf:
        return np.nan
    try:
        return abs(chain.energy(State(u, v)) / chain.energy(state) - 1)
    except LockingError:
        return np.nan


def good_step(gap, method):
    """Largest step, of a row of them below the stability limit, with a small energy error [s].

    The next smaller steps must have it too, since a single one may be accidental.
    """
    dt, good = stability_step(gap, method), 0
    while good < IN_A_ROW:
        good = good + 1 if energy_error(gap, method, dt) <= ENERGY_ERROR else 0
        dt /= FINER
    return dt * FINER**IN_A_ROW


def outcome(gap, dt, over=1.0):
    """How a run with a fixed step ends: "accepted" or the name of the error, and its message."""
    chain, state = collision(gap, over)
    try:
        simulate(chain, state, duration(chain, state), dt=dt, record=Record(every=10**9))
    except (StabilityError, LockingError) as error:
        return type(error).__name__, str(error)
    return "accepted", ""


def data():
    """Steps against the stroke left; fixed steps there; the blow that locks."""
    limits = {f"limit of {name} [s]": [stability_step(g, name) for g in GAPS] for name in EXPLICIT}
    errors = [energy_error(g, "verlet", FIXED) for g in GAPS]
    steps = {f"step of {name} [s]": [good_step(g, name) for g in GAPS] for name in EXPLICIT}
    found, blows = [outcome(g, FIXED)[0] for g in GAPS], [100 * FIXED, FIXED]
    return {
        "steps": {"stroke left": GAPS} | {k: np.array(v) for k, v in (limits | steps).items()},
        "fixed": {"stroke left": GAPS, "outcome": found,
                  "energy error of the bare loop": np.array(errors)},
        "locks": {"dt [s]": blows, "outcome": [outcome(0.0, dt, OVER)[0] for dt in blows]},
    }  # fmt: skip


def powers(tables):
    """Power of the stroke left in the steps needed, of each method, close to locking."""
    t = tables["steps"]
    near = t["stroke left"] <= 0.01
    return {name: slope(t["stroke left"][near], t[f"step of {name} [s]"][near])
            for name in EXPLICIT}  # fmt: skip


def text(tables):
    """The section of the page."""
    t, fixed = tables["steps"], tables["fixed"]
    accepted = [g for g, how in zip(GAPS, fixed["outcome"], strict=True) if how == "accepted"]
    refused = np.array(fixed["outcome"]) != "accepted"
    worst = np.nanmax(fixed["energy error of the bare loop"][refused])
    near = int(np.argmin(np.abs(GAPS - 1e-3)))
    rows = [[name, f"{power:.2f}", f"{t[f'step of {name} [s]'][near]:.1e}"]
            for name, power in powers(tables).items()]  # fmt: skip
    head = ["method", "power of the stroke left", "step with a thousandth left [s]"]
    return (
        "The force of a rigid prism grows like the inverse root of the stroke left, the largest "
        "frequency like its power -3/4: the step must shrink with the power 3/4. Two masses "
        "that meet head-on and turn back with less than a hundredth of the stroke left need, "
        f"for an energy error of {ENERGY_ERROR:.0e}, steps that fall with the powers of the table "
        "(the energy at stake falls too, with the root, which in theory leaves "
        f"3/4 - 1/(2 order)).\n\n{grid(head, rows)}\n\n"
        f"A fixed step of {FIXED:g} s with verlet is accepted down to {min(accepted):.1e} of the "
        "stroke; closer, `simulate` ends the run with a `StabilityError` that names the time and "
        "the sites, where the bare loop would have gone on with an energy wrong by up to "
        f"{worst:.2g} of itself. "
        f"A blow with {OVER - 1:.1%} more energy than the spring holds ends with a "
        "`LockingError`, whatever the step. `tol=` and the default step refine themselves."
    )


def draw(figure, tables):
    """Steps against the stroke left; the energy after fixed steps."""
    figure.set_size_inches(9, 4.5)
    left, right = figure.subplots(1, 2)
    t, fixed = tables["steps"], tables["fixed"]
    for name in EXPLICIT:
        left.loglog(GAPS, t[f"step of {name} [s]"], "o-", ms=3, color=COLOURS[name], label=name)
        left.loglog(GAPS, t[f"limit of {name} [s]"], ":", color=COLOURS[name])
    ends = GAPS[[0, -1]]
    left.loglog(ends, 3 * ends**0.75, "k--", lw=1, label="power 3/4")
    left.axhline(FIXED, color="0.5", lw=0.8)
    left.set(xlabel="fraction of the stroke left", ylabel="step [s]; dotted: stability limit")
    left.set(title=f"steps for the energy to {ENERGY_ERROR:g}", xlim=(5e-6, 3))
    name_curves(left)
    accepted = np.array([how == "accepted" for how in fixed["outcome"]])
    error = fixed["energy error of the bare loop"]
    right.loglog(GAPS[accepted], error[accepted], "C0o", label="accepted")
    right.loglog(GAPS[~accepted], error[~accepted], "C3x", label="refused: StabilityError")
    right.set(xlabel="fraction of the stroke left", ylabel="error of the energy, bare loop")
    right.set_title(f"verlet, dt = {FIXED:g} s")
    right.legend(fontsize=8)
