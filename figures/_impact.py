"""A wave launched by an impact at a wanted speed, beside the exact wave and the asymptotics."""

from __future__ import annotations

import math

import numpy as np

from figures import _measure, _scenes
from tensegrity import LockingError, Record, arrival, sech2, simulate, solitary_wave, speed, tent

FINE = 0.008  # of its width that the wave goes in a step of the coarser run
EVERY = 4  # steps between recorded instants
TIMED = (0.7, 0.9)  # of the way: where the pulse is timed
SPANNED = 1.0  # sites of travel around the crest from which a profile is assembled
INSTANTS = 8  # of them


def struck(spring, ratio, velocity, travel):
    """The first mass struck, followed until a wave of that speed is a little beyond `travel`."""
    duration = 1.03 * travel / (ratio * spring.sound_speed())
    return _scenes.impact(spring, travel + 20, {0: velocity}, duration)


def tuned(spring, ratio, travel, bracket):
    """Velocity of the struck mass [m/s] at which the leading pulse has a wanted speed.

    Parameters
    ----------
    ratio : float
        Wanted speed over that of sound.
    travel : int
        Sites after which the speed is taken.
    bracket : (float, float)
        Velocities [m/s] between which it is looked for.
    """
    from scipy.optimize import brentq

    wave = solitary_wave(spring, speed_ratio=ratio)
    bonds = _bonds(travel)
    sites = [site for bond in bonds for site in (bond, bond + 1)]

    def excess(velocity):
        scene = struck(spring, ratio, velocity, travel)
        record = Record(every=EVERY, sites=sites)
        try:
            run = simulate(*scene, method="rkn6", dt=step(wave), record=record)
        except LockingError:
            return wave.speed  # too hard a blow: surely too fast
        return speed(run, bonds) - wave.speed

    return brentq(excess, *bracket, xtol=1e-9, rtol=1e-7)


def step(wave):
    """A step [s] in which a wave goes a small part of its width."""
    return FINE * wave.width() / wave.speed


def _bonds(travel):
    return tuple(int(part * travel) for part in TIMED)


def comparison(spring, ratio, travel, bracket, around):
    """Profiles at one speed: exact, launched, emerged from an impact, and both asymptotics.

    Returns
    -------
    tables : dict
        "profiles", "launched", "emerged", "asymptotic": strain (extension > 0) against the
        distance from the crest; "numbers", with errors.
    run : Run
        Of the impact.
    """
    velocity = tuned(spring, ratio, travel, bracket)
    blow = struck(spring, ratio, velocity, travel)
    interval = EVERY * step(solitary_wave(spring, speed_ratio=ratio))
    run, found = _measure.resolved(blow, lambda run: _numbers(run, travel), interval)
    wave = solitary_wave(spring, speed=found["speed"].value)
    reach = math.ceil(wave.reach()) + 2
    along = _scenes.launched(wave, travel + 2 * reach, reach, 0.95 * travel)
    launched, again = _measure.resolved(along, lambda run: _numbers(run, travel), interval)
    x = np.linspace(-around, around, 40 * around + 1)
    exact = wave.elongation(x)
    gaps = {
        name: float(np.abs(profile - exact).max() / abs(wave.amplitude))
        for name, profile in (("sech2", sech2(spring, ratio, x)), ("tent", tent(spring, x)))
    }
    emerged = profile(run, travel, found["speed"].value, around)
    off = np.abs(emerged["strain"] * spring.length - wave.elongation(emerged["x"])).max()
    numbers = {
        "speed over sound speed": _of_sound(found["speed"], spring),
        "impact velocity [m/s]": _measure.Number(velocity, 1e-7 * velocity),
        "width, launched [sites]": again["width"],
        "width, emerged [sites]": found["width"],
        "width, exact [sites]": _measure.Number(wave.width(), wave.residual),
        "speed of the launched wave over exact - 1": _measure.Number(
            again["speed"].value / wave.speed - 1, again["speed"].error / wave.speed
        ),
        "emerged - exact, over the crest": _measure.Number(
            float(off / abs(wave.amplitude)), found["crest"].error / abs(wave.amplitude)
        ),
        "crest over locking stroke": _measure.Number(
            wave.amplitude / spring.domain[0], wave.residual
        ),
        "sech^2 - exact, over the crest": _measure.Number(gaps["sech2"], wave.residual),
        "tent - exact, over the crest": _measure.Number(gaps["tent"], wave.residual),
        "energy error": max(found["energy error"], again["energy error"]),
    }
    tables = {
        "curves": {
            "x": x,
            "exact": exact / spring.length,
            "sech2": sech2(spring, ratio, x) / spring.length,
            "tent": tent(spring, x) / spring.length,
        },
        "launched": profile(launched, travel, again["speed"].value, around),
        "emerged": emerged,
        "numbers": _measure.as_table(numbers),
    }
    return tables, run


def _numbers(run, travel):
    bond = _bonds(travel)[1]
    pulse = _measure.Passing(run, bond)
    measured = speed(run, _bonds(travel))
    return {"speed": measured, "width": measured * pulse.duration(), "crest": pulse.crest}


def _of_sound(number, spring):
    sound = spring.sound_speed()
    return _measure.Number(number.value / sound, number.error / sound)


def profile(run, travel, measured, around):
    """Strain against distance from the crest, from the instants that span a few sites of travel.

    One instant holds only a few masses of a short wave.
    """
    bond = _bonds(travel)[1]
    passing = (run.t - arrival(run, bond)) * measured
    span = np.flatnonzero(np.abs(passing) <= SPANNED / 2)
    chosen = span[:: max(1, len(span) // INSTANTS)]
    r = run.scene.elongation(run.u[chosen])
    x = np.arange(r.shape[1]) - bond - passing[chosen][:, None]
    near = np.abs(x) <= around
    order = np.argsort(x[near])
    return {"x": x[near][order], "strain": r[near][order] / run.scene.springs[0].length}


def draw(axes, tables, title):
    """Profiles of one speed."""
    curves = tables["curves"]
    axes.plot(curves["x"], -curves["sech2"], "C1--", label="sech$^2$")
    axes.plot(curves["x"], -curves["tent"], "C2:", lw=2, label="tent (locking stroke)")
    axes.plot(curves["x"], -curves["exact"], "C7", lw=1, label="exact wave")
    marks = {"emerged": ("C0.", "chain, after an impact"), "launched": ("C3+", "chain, launched")}
    for name, (mark, label) in marks.items():
        axes.plot(tables[name]["x"], -tables[name]["strain"], mark, ms=4, label=label)
    axes.set(xlabel="distance from the crest [sites]", ylabel="compressive strain")
    axes.set_title(title, fontsize=10)
    crest = -curves["exact"].min()
    tops = [-curves[name].min() for name in ("sech2", "tent")]
    axes.set_ylim(-0.05 * crest, 1.15 * max([crest, *(t for t in tops if t < 3 * crest)]))
