"""Softening units lower the peak of a blow the more of them there are, stiffening ones never."""

import numpy as np
from scipy.interpolate import make_interp_spline
from scipy.optimize import brentq

from figures import _measure, _scenes
from figures._draw import name_curves
from figures._limits import slope
from figures._measure import row

GROUP = "waves"

DEGREE = 7  # of the spline through the force at the wall
BLOW = 0.06  # m/s, of the first mass: the energy is the same for all
UNITS = (10, 20, 50, 100, 200, 400, 1000)
FITTED = 100  # units from which the exponent is fitted
INTERVALS = {"stiffening": 0.1, "softening": 0.4, "linear": 0.4}  # s, between recorded instants
# of sound, over the length of the chain: before the recording begins, and to its end
WAYS = {"stiffening": (0.6, 0.85), "softening": (0.8, 1.5), "linear": (0.8, 1.3)}
UNIT_SIZE, BARRIER = 10e-6, 0.01  # m, the talk's estimate: 1000 units


def springs():
    """The chains that are compared."""
    prisms = {"stiffening": _scenes.rigid(0.8, 0.02), "softening": _scenes.softening()}
    return prisms | {"linear": _scenes.linear(1.0)}


def barrier(spring, units, way, speed=BLOW):
    """So many units before a wall, the first mass struck; followed while sound goes `way`."""
    duration = (way * units + 8) / spring.sound_speed()
    return _scenes.impact(spring, units + 1, {0: speed}, duration, ("free", "fixed"))


def at_wall(run):
    """The force that reaches the wall, above the preload.

    Returns
    -------
    dict
        peak: force [N]; spread: impulse over peak, until the force last falls below half of it:
        how long a constant force would take [s].
    """
    t, load = run.t, -run.scene.springs[-1].tension(run.u[:, 1] - run.u[:, 0])
    push = make_interp_spline(t, load, DEGREE)
    sampled = push(t)
    top = int(np.argmax(sampled))
    peak = float(push(brentq(push.derivative(), t[top - 1], t[top + 1])))
    last = int(np.flatnonzero(sampled > peak / 2)[-1])
    end = brentq(lambda instant: float(push(instant)) - peak / 2, t[last], t[last + 1])
    return {"peak": peak, "spread": float(push.integrate(t[0], end)) / peak}


def peaks(name, units, by=1.0):
    """Force and spread at the wall behind a number of units of a chain, with errors; `by` is a
    factor of the speed of the blow."""
    scene = barrier(spring := springs()[name], units, WAYS[name][1], by * BLOW)
    quiet = WAYS[name][0] * units / spring.sound_speed()
    return _measure.resolved(scene, at_wall, INTERVALS[name], [units - 1, units], quiet=quiet)[1]


def data():
    """Peak, spread and impulse at the wall for each chain and number of units."""
    tables = {}
    for name in springs():
        found = [peaks(name, units) for units in UNITS]
        tables[name] = {"units": UNITS}
        for key in found[0]:
            tables[name][key] = [one[key].value for one in found]
            tables[name][f"{key} error"] = [one[key].error for one in found]
    return tables


def exponent(columns):
    """Exponent of the peak force in the number of units, and how it changes on half the range."""
    units, peak = (np.array(columns[name], float) for name in ("units", "peak"))
    parts = (units >= least for least in (FITTED, 2 * FITTED))
    found, other = (slope(units[part], peak[part]) for part in parts)
    return found, abs(found - other)


def draw(figure, tables):
    """Peak and spread over the number of units."""
    figure.set_size_inches(9, 4.2)
    both = figure.subplots(1, 2)
    for name in springs():
        for axes, key in zip(both, ("peak", "spread"), strict=True):
            axes.loglog(tables[name]["units"], tables[name][key], "o-", label=name)
    both[0].axvline(BARRIER / UNIT_SIZE, color="0.5", ls=":", lw=1)
    both[0].set(ylabel="peak force at the wall, above preload [N]")
    both[1].set(ylabel="spread: impulse over peak force [s]")
    for axes in both:
        axes.set(xlabel="units between the blow and the wall")
        name_curves(axes)


def table(tables):
    """Rows for the table of the group."""
    claim = "softening units mitigate an impact without dissipation, given enough of them"
    for name in springs():
        power, error = exponent(tables[name])
        scene = f"peak force at the wall, {name}, {FITTED} to {UNITS[-1]} units"
        error = f"{error:.1g} (upper half of the range)"
        yield row(scene, claim, f"falls as units^{power:.4f}", error)
    units = round(BARRIER / UNIT_SIZE)
    stiff, soft = (tables[name] for name in ("stiffening", "softening"))
    k = UNITS.index(units)
    low, high = soft["peak"][k], stiff["peak"][k]
    found = (
        f"peak {low:.6f} N against {high:.6f} N of stiffening units: {1 - low / high:.1%} less; "
        f"over that of {UNITS[0]} units {low / soft['peak'][0]:.3f} (stiffening "
        f"{high / stiff['peak'][0]:.3f}); spread over "
        f"{soft['spread'][k] / stiff['spread'][k]:.0f} times the time"
    )
    scene = f"barrier of {units} units of 10 um, equal energy"
    error = max(soft["peak error"][k], stiff["peak error"][k])
    yield row(scene, "about 1 cm of 10 um units protects", found, error)
