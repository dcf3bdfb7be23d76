"""Two colliding waves emerge shifted in phase and leave almost no energy behind."""

import math
from functools import cache

import tensegrity
from figures import _measure, _scenes
from figures._draw import name_curves
from figures._measure import row
from tensegrity import Chain, LockingError, phase_shift, pulses, simulate, solitary_wave

GROUP = "waves"

PRISM = (0.8, 0.02)  # height, prestrain
SPEEDS = (1.1, 1.3, 1.6, 2.0)
MEETINGS = (0.0, 0.125, 0.25, 0.375, 0.5)  # sites from a mass
SHOWN = (1.6, 0.25)
FILM = (0.7, 0.01)  # height, prestrain
TOO_FAST = 2.5
STEP = 0.02  # sites that the waves travel in a step of the coarser run
WINDOW = 1e-6  # of the peak remains where the energy of a wave is truncated


def outcome(run, wave):
    """Numbers of one collision of two equal waves.

    Parameters
    ----------
    run : Run
        From the launch of both waves on.
    wave : SolitaryWave

    Returns
    -------
    dict
        residue: fraction of the energy in neither wave, outside windows around the peaks;
        exchange: excess of the right-going wave over the other, as a fraction of the energy;
        shift: lead of the right-going wave over an undisturbed one [sites]; window: change of
        the residue with wider windows.
    """
    energy = run.scene.site_energy(run.final)
    outgoing = {pulse.direction: pulse.place for pulse in pulses(run, fraction=0.5)}

    def windows(tail):
        reach = wave.reach(tail)
        ends = [(outgoing[way] - reach, outgoing[way] + reach) for way in (-1, 1)]
        around = [slice(math.floor(low), math.ceil(high) + 1) for low, high in ends]
        return [energy[part].sum() / energy.sum() for part in around]

    left, right = windows(WINDOW)
    return {
        "residue": 1 - left - right,
        "exchange": right - left,
        "shift": phase_shift(run, wave, wave)[0],
        "window": left + right - sum(windows(WINDOW / 10)),
    }


def collide(spring, speed_ratio, meeting, distance=40, travel=120):
    """Numbers of one collision, computed at two resolutions."""
    scene = _scenes.collision(spring, speed_ratio, meeting, distance, travel)
    wave = solitary_wave(spring, speed_ratio=speed_ratio)
    read, step = lambda run: outcome(run, wave), STEP / wave.speed
    return _measure.resolved(scene, read, scene.duration, step=step)[1]


def too_fast():
    """The message for waves so fast that the bars meet."""
    scene = _scenes.collision(_scenes.rigid(*PRISM), TOO_FAST, 0.5, 20, 20)
    try:
        simulate(*scene)
    except LockingError as error:
        return str(error)
    return "the bars do not meet"


@cache
def shown():
    """The run of the collision that is drawn."""
    return simulate(*_scenes.collision(_scenes.rigid(*PRISM), *SHOWN), method="rkn6")


@cache
def filmed():
    """The run of the film, which is that of the first example of README.md."""
    spring = _scenes.rigid(*FILM)
    fast, slow = (solitary_wave(spring, speed_ratio=ratio) for ratio in (2.0, 1.3))
    chain = Chain(spring, sites=100)
    start = fast.launch(chain, at=20) + slow.launch(chain, at=80, direction=-1)
    return simulate(chain, start, t_end=60 / fast.speed, tol=1e-8)


def data():
    """Residue, exchange and shift over speed and meeting place; one density; the locking."""
    spring = _scenes.rigid(*PRISM)
    tables, worst = {n: {"meeting": MEETINGS} for n in ("residue", "exchange", "shift")}, 0.0
    for ratio in SPEEDS:
        found = [collide(spring, ratio, meeting) for meeting in MEETINGS]
        for name, columns in tables.items():
            columns[f"{ratio}"] = [one[name].value for one in found]
            columns[f"{ratio} error"] = [one[name].error for one in found]
        tables["residue"][f"{ratio} window"] = [abs(one["window"].value) for one in found]
        worst = max(worst, *(one["energy error"].value for one in found))
    tables["density"] = _measure.density(shown())
    tables["energy"] = {"largest relative error": [worst]}
    tables["locking"] = {"speed ratio": [TOO_FAST], "message": [too_fast()]}
    return tables


def draw(figure, tables):
    """Energy density, residue and phase shift."""
    figure.set_size_inches(9, 6.5)
    axes = list(figure.subplot_mosaic([["map", "map"], ["left", "shift"]]).values())
    ratio, meeting = SHOWN
    title = f"(a) {ratio} sound speeds, {meeting} sites from a mass"
    _measure.draw_density(axes[0], tables["density"], title)
    for k, speed in enumerate(SPEEDS):
        for ax, name in zip(axes[1:], ("residue", "shift"), strict=True):
            table = tables[name]
            ax.plot(table["meeting"], table[f"{speed}"], f"C{k}o-", label=f"{speed}")
    axes[1].set(yscale="log", ylabel="fraction of the energy\nin neither wave")
    axes[2].set(ylabel="lead over an undisturbed\nwave [sites]")
    axes[1].set_title("(b) little energy is left behind")
    axes[2].set_title("(c) each wave is shifted ahead")
    for ax in axes[1:]:
        ax.set(xlabel="meeting place [sites from a mass]", xlim=(-0.02, 0.6))
        name_curves(ax)
    figure.suptitle("Colliding waves go on (numbers at curves: speed / sound speed)")


def animate(tables, path):
    """Animate a collision of two different waves."""
    tensegrity.animate(filmed(), path)


def table(tables):
    """Rows for the table of the group."""
    claim = "solitons emerge unchanged but for a phase (part I)"
    three = [tables[name] for name in ("residue", "exchange", "shift")]
    for ratio in (1.3, 2.0):
        for k in (0, 2, 4):
            residue, exchange, shift = (one[f"{ratio}"][k] for one in three)
            found = f"left {residue:.3e}, exchanged {exchange:+.1e} of the energy, "
            found += f"shift {shift:+.5f} sites: not exactly"
            error = max(one[f"{ratio} error"][k] for one in three)
            yield row(f"collision {ratio} cs at {MEETINGS[k]:g}", claim, found, error)
    message = tables["locking"]["message"][0]
    yield row(f"collision {TOO_FAST} cs", claim, message, "no number")
