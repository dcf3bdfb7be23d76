"""A rarefaction wave leads where the end is held or pulled, never where a free end is pushed."""

import numpy as np

from figures import _measure, _scenes
from figures._draw import note
from figures._measure import Number, row
from tensegrity import Chain, Drive, LockingError, Record, arrival, simulate, solitary_wave

GROUP = "waves"

PRELOAD = 0.05  # N
SITES, DURATION = 600, 450.0  # s: sound travels 540 sites
SENSORS = (300, 500)  # bonds
STEP = 0.1  # s
SHAKEN = 0.3, 4.0  # m, s: largest displacement of the driven end, and its duration
CLOSE = 1e-3  # least excess over sound, and closeness to the exact wave's speed, of a soliton
HARD = 0.15  # m/s, the blow that is shown
SPEEDS = (0.1, 0.15, 0.2)  # m/s

BLOWS = {  # velocities of the sites per speed of the blow, held first site or not, its mass
    "held end, next mass pushed": ({1: 1.0}, "fixed", 1.0),
    "held end, next mass pulled": ({1: -1.0}, "fixed", 1.0),
    "free end pulled": ({0: -1.0}, "free", 1.0),
    "free end pushed": ({0: 1.0}, "free", 1.0),
    "free end, light striker (mass 0.2)": ({0: 1.0}, "free", 0.2),
    "free end, heavy striker (mass 5)": ({0: 1.0}, "free", 5.0),
    "free end, five masses pushed": (dict.fromkeys(range(5), 1.0), "free", 1.0),
}

SHOWN = {"held": "held end, next mass pushed", "free": "free end pushed"}
PUSHED = [blow for blow, (given, _, _) in BLOWS.items() if min(given.values()) > 0]  # compressive
# colour and symbol of what leads
MARKS = {"soliton": "C1o", "forming": "C4d", "compression": "C0s", "collapse": "C3v"}


def struck(blow, speed, sites=SITES, duration=DURATION):
    """The scene of one blow."""
    velocities, end, first = BLOWS[blow]
    mass = np.append(first, np.ones(sites - 1))
    speeds = {site: speed * v for site, v in velocities.items()}
    return _scenes.impact(_scenes.softening(PRELOAD), sites, speeds, duration, (end, "free"), mass)


def shaken(by=1.0, sites=SITES, duration=DURATION):
    """The scene whose first mass is pushed in and taken back: u = by d exp(-((t - 4 T)/T)^2)."""
    import sympy as sp

    t, (way, time) = sp.Symbol("t"), SHAKEN
    drive = Drive(displacement=by * way * sp.exp(-(((t - 4 * time) / time) ** 2)))
    chain = Chain(_scenes.softening(PRELOAD), sites, 1.0, drive={0: drive})
    return _measure.Scene(chain, chain.at_rest(), duration)


def leading(run):
    """Speed and peak of the first pulse, and the speed of the tail behind it.

    The tail's front is its first large extremum of the other sign.

    Returns
    -------
    dict
        speed, tail: over the speed of sound; peak: elongation [m].
    """
    ratio, peak = leader(run)
    behind = np.diff(SENSORS)[0] / np.diff([tail(run, bond) for bond in SENSORS])[0]
    return {"speed": ratio, "tail": float(behind) / sound_speed(run), "peak": peak}


def leader(run):
    """Speed of the first pulse over that of sound, and its peak [m]."""
    fast, peak = _measure.leader(run, SENSORS)
    return fast / sound_speed(run), peak


def sound_speed(run):
    """[sites/s]"""
    return run.scene.springs[-1].sound_speed(run.scene.mass[-1])


def tail(run, bond):
    """Instant at which the front of the tail passes a bond [s]."""
    instant, amplitude = _measure.peak(run, bond)
    left = run.sites.index(bond)
    elongation = run.u[:, left + 1] - run.u[:, left]
    return arrival(run, bond, after=run.t[(run.t > instant) & (elongation * amplitude < 0)][0])


def kind(blow, speed):
    """What leads after one blow, and its numbers.

    Returns
    -------
    word : str
        "soliton": a rarefaction wave that is supersonic and as fast as the exact wave of its
        peak; "forming": a rarefaction that is not (yet); "compression"; "collapse": a
        prism softened past its limit point and left the range of the equilibrium path.
    speed : float
        Over the speed of sound; 0 where nothing was measured.
    """
    sensors = [site for bond in SENSORS for site in (bond, bond + 1)]
    record = Record(every=4, sites=sensors)
    try:
        run = simulate(*struck(blow, speed), method="rkn6", dt=STEP, record=record)
    except LockingError:
        return "collapse", 0.0
    ratio, peak = leader(run)
    if peak < 0:
        return "compression", ratio
    exact = exact_wave(peak).speed_ratio
    formed = ratio > 1 + CLOSE and abs(ratio - exact) < CLOSE
    return ("soliton" if formed else "forming"), ratio


def exact_wave(peak):
    """The wave of a peak [m]."""
    return solitary_wave(_scenes.softening(PRELOAD), amplitude=peak)


def measured(scene):
    """Numbers of one scene with their errors, and the finer run."""
    run, found = _measure.resolved(scene, leading, 4 * STEP)
    if found["peak"].value > 0:
        wave = exact_wave(found["peak"].value)
        found["exact speed"] = Number(wave.speed_ratio, wave.residual)
        found["fraction"] = Number(wave.energy / run.energy[0], 2 * found["peak"].error)
    return run, found


def data():
    """The map of blows; numbers, density and last instant of the blows that are shown."""
    found = {blow: [kind(blow, speed) for speed in SPEEDS] for blow in BLOWS}
    tables = {"shaken": _measure.as_table(measured(shaken())[1]), "map": {"blow [m/s]": SPEEDS}}
    for k, ending in enumerate(("", ": c/cs")):
        each = {f"{blow}{ending}": [pair[k] for pair in row] for blow, row in found.items()}
        tables["map"] |= each
    for name, blow in SHOWN.items():
        run, found = measured(struck(blow, HARD))
        tables[name] = _measure.as_table(found)
        tables[f"{name}_density"] = _measure.density(run)
        r = run.scene.elongation(run.final.u)
        tables[f"{name}_last"] = {"bond": np.arange(r.size), "elongation": r}
    return tables


def draw(figure, tables):
    """Density of one blow and its front at the end, and the map."""
    figure.set_size_inches(9, 8)
    axes = figure.subplot_mosaic([["density", "last"], ["map"] * 2])
    _measure.draw_density(axes["density"], tables["held_density"], f"{SHOWN['held']}, {HARD} m/s")
    (bond, elongation), ax = tables["held_last"].values(), axes["last"]
    front = _scenes.softening_sound_speed(PRELOAD) * DURATION
    near = np.abs(bond - front) < 60
    ax.plot(bond[near], elongation[near], "C0.-", ms=3, lw=0.8)
    ax.axvline(front, color="0.5", lw=0.8)
    ax.set(xlabel="bond", ylabel="elongation [m]", title="its last instant; line: sound")
    ax = axes["map"]
    for y, blow in enumerate(BLOWS):
        for x, word in enumerate(tables["map"][blow]):
            ax.plot(x, y, MARKS[word], ms=9)
            note(ax, word, (x, y), (10, 0), va="center")
    ax.set(xlabel="speed of the blow [m/s]", ylabel="how the chain is struck")
    ax.set(xlim=(-0.3, 2.8), ylim=(len(BLOWS) - 0.5, -0.5))
    ax.set_xticks(range(len(SPEEDS)), SPEEDS)
    ax.set_yticks(range(len(BLOWS)), BLOWS)
    ax.set_title("what leads (rarefaction: soliton, forming)")


def table(tables):
    """Rows for the table of the group."""
    held, free, driven = (_measure.from_table(tables[name]) for name in (*SHOWN, "shaken"))
    speed, exact, tail = (held[name] for name in ("speed", "exact speed", "tail"))
    found = (
        f"{speed.value:.6f} cs with {held['fraction'].value:.3f} of the energy; the exact wave of "
        f"that peak {exact.value:.6f} cs (off by {abs(speed.value - exact.value):.0e}: the pulse "
        "still sheds its tail)"
    )
    scene = f"softening chain, {SHOWN['held']}, {HARD} m/s"
    yield row(scene, "leading rarefaction soliton, supersonic", found, speed.error)
    found = f"{tail.value:.6f} cs, first extremum behind the wave"
    yield row(scene, "oscillatory tail, subsonic", found, tail.error)
    claim = "compressive disturbance becomes a rarefaction wave"
    speed, exact = driven["speed"], driven["exact speed"].value
    found = f"does: {speed.value:.6f} cs, the exact wave of that peak {exact:.6f} cs"
    scene = f"softening chain, end driven {SHAKEN[0]:g} m in and back"
    yield row(scene, claim, found, speed.error)
    found = f"does not: compression leads, {free['speed'].value:.6f} cs"
    scene = f"softening chain, {SHOWN['free']}, {HARD} m/s"
    yield row(scene, claim, found, free["speed"].error)
    solitons = "; ".join(b for b in PUSHED if "soliton" in tables["map"][b]) or "none"
    scene = f"softening chain, {len(PUSHED)} pushed blows at {len(SPEEDS)} speeds"
    yield row(scene, claim, f"only with: {solitons}", f"closer than {CLOSE:g} to the exact wave")
