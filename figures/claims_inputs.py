"""Inputs that change by 1 % move numbers of claims about as much, but where motion is chaotic.

Each number that the claims take from a single run is computed again with its input, such as the
speed of the blow, larger by 1e-6 and by 1 %.  Of the draws of the composite, in which four inputs
change at random, the largest change is shown.  Late numbers of lines between walls, means over a
time, fluctuate.  Numbers below 1e-6 are errors, and left out.  Of protectors `protectors_robust`
changes the input: the sizes of beads and the gaps between them.
"""

import math
from functools import partial
from importlib import import_module

import numpy as np

from figures import (
    _impact,
    _scenes,
    composite_spread,
    granular_losses,
    wave_collision,
    wave_composite,
    wave_mitigation,
    wave_power_law,
    wave_softening,
    wave_speeds,
    wave_tuning,
)
from figures._files import lines, side_by_side
from granular import kuwabara_kono
from tensegrity import LockingError, Record, simulate, solitary_wave

NAME = "claims_inputs"
GROUP = "claims"

CHANGES = {"1e-6": 1e-6, "1 %": 1e-2}  # relative, of an input
LEAST = 1e-6  # smaller numbers are errors, not results
EXACT = (1.05, 2.0, 3.0)  # speeds over that of sound of waves that are launched
FASTEST = 12.16  # of the one that emerges
STILL = 1e-13  # changes below it are drawn there


def printed(module, by):
    """{(row, quantity): number} of the numbers that a picture of beads prints."""
    lines = module.table(module.data(by))
    numbers = {(line["quantity"], ""): line["here"] for line in lines}
    return {row: here for row, here in numbers.items() if isinstance(here, (int, float))}


def of(row, numbers, *quantities):
    """Some numbers {quantity: value} of one row, or all."""
    return {(row, quantity): numbers[quantity] for quantity in quantities or numbers}


def lossy(by):
    """What the half guide with losses reflects."""
    law = kuwabara_kono(restitution=granular_losses.DRAWN, speed=granular_losses.AT)
    ratios = granular_losses.five(granular_losses.followed(law, by=by))
    return {(f"F_i/F_r at restitution {granular_losses.DRAWN}", ""): ratios[-1]}


def power_law(by):
    """What leads in precompressed chains of power laws whose ends are struck."""
    found, record = {}, Record(every=2)
    for n in wave_power_law.STRUCK:
        for blow, speed in wave_power_law.BLOWS.items():
            scene = wave_power_law.struck(n, by * speed)
            run = simulate(*scene, method="rkn6", dt=0.05, record=record)
            row = f"power law n = {n:g}, precompressed, free end {blow} at {abs(speed)} m/s"
            found |= of(row, wave_power_law.leading(run))
    return found


def widths(by):
    """Widths of exact waves of other speeds, and of one that emerges from another blow."""
    found = of(f"wave at {FASTEST:g} cs, emerged", emerged(by))
    for ratio in EXACT:
        wave = solitary_wave(_scenes.rigid(0.7, 0.01), speed_ratio=by * ratio)
        found |= of(f"wave at {ratio:g} cs, launched", {"width": wave.width()})
    return found


def emerged(by):
    """The wave near locking, after a blow that is harder by a factor; nan where bars meet."""
    prism, how = wave_speeds.WAVES[FASTEST]
    spring, travel = _scenes.rigid(*prism), how["travel"]
    velocity = _impact.tuned(spring, FASTEST, travel, how["bracket"])
    wave = solitary_wave(spring, speed_ratio=FASTEST)
    try:
        run = simulate(*_impact.struck(spring, FASTEST, by * velocity, travel), method="rkn6",
                       dt=_impact.step(wave), record=Record(every=_impact.EVERY))  # fmt: skip
    except LockingError:
        return dict.fromkeys(("speed", "width", "peak"), math.nan)
    return _impact.leading(run, travel)


def collisions(by):
    """What collisions of waves of other speeds leave behind."""
    found = {}
    for ratio, meeting in ((1.3, 0.0), (2.0, 0.25)):
        spring = _scenes.rigid(*wave_collision.PRISM)
        wave = solitary_wave(spring, speed_ratio=by * ratio)
        run = simulate(*_scenes.collision(spring, by * ratio, meeting), method="rkn6",
                       dt=wave_collision.STEP / wave.speed)  # fmt: skip
        one = wave_collision.outcome(run, wave)
        found |= of(f"collision {ratio} cs at {meeting:g}", one, "residue", "exchange", "shift")
    return found


def changing(by):
    """Waves of other speeds in chains whose prestrain changes."""
    found = {}
    for name, ramp in wave_tuning.RAMPS.items():
        runs = wave_tuning.tuned(ramp, wave_tuning.STEP, by * wave_tuning.RATIO)
        one = wave_tuning.outcome(*runs)
        row = f"prestrain {wave_tuning.BEFORE:g} to {wave_tuning.AFTER:g} while a wave travels"
        found |= of(f"{row}, {name} ({ramp:g} s)", one, "before", "after", "fraction")
    return found


def softening(by):
    """What leads in softening chains after other blows."""
    blow, hard = wave_softening.SHOWN, wave_softening.HARD
    held, tail = "leading rarefaction soliton, supersonic", "oscillatory tail, subsonic"
    scenes = {
        held: wave_softening.struck(blow["held"], by * hard),
        f"softening chain, end driven {wave_softening.SHAKEN[0]:g} m in and back":
            wave_softening.shaken(by),
        f"softening chain, {blow['free']}, {hard} m/s":
            wave_softening.struck(blow["free"], by * hard),
    }  # fmt: skip
    found = {}
    for row, scene in scenes.items():
        run = simulate(*scene, method="rkn6", dt=wave_softening.STEP, record=Record(every=4))
        one = wave_softening.leading(run)
        if row == held:
            found |= of(tail, {"speed": one["tail"]})
        found |= of(row, one, "speed", "peak")
    return found


def interfaces(by):
    """What interfaces reflect of waves of other peaks."""
    found = {}
    for name in ("compression, soft (weak) to hard", "rarefaction, soft to hard"):
        case = wave_composite.cases()[name]
        peak = by * solitary_wave(case.near, speed_ratio=case.ratio).amplitude
        ratio = solitary_wave(case.near, amplitude=peak).speed_ratio
        wave, scene = wave_composite.composite(case._replace(ratio=ratio))
        run = simulate(
            *scene, method="rkn6", dt=case.step, record=Record(every=wave_composite.EVERY)
        )
        one = wave_composite.outcome(run, wave, case)
        found |= of(f"composite, {name}: reflection", one, "energy", "impulse")
    return found


def barriers(by):
    """How the peak force falls with the number of units, after other blows."""
    (few, many), found, last = (wave_mitigation.FITTED, wave_mitigation.UNITS[-1]), {}, []
    for name in ("softening", "stiffening"):
        peak = [wave_mitigation.peaks(name, count, by)["peak"].value for count in (few, many)]
        last.append(peak[1])
        row = f"peak force at the wall, {name}, {few} to {many} units"
        found |= of(row, {"power of the units": math.log(peak[1] / peak[0], many / few)})
    row = f"barrier of {many} units of 10 um, equal energy"
    return found | of(row, {"peak over that of stiffening units": last[0] / last[1]})


BLOW = "speed of the blow"
PRINT = ("granular_fig2", "granular_fig3", "granular_fig4", "granular_fig5", "granular_fig6",
         "granular_trapping", "granular_energy", "granular_quasiparticle", "granular_steps",
         "packs_thermal", "packs_floor", "packs_space")  # fmt: skip
OWN = {  # picture: (input, its numbers with that times a factor)
    "granular_losses": (BLOW, lossy),
    "wave_power_law": (BLOW, power_law),
    "wave_speeds": ("speed of the wave or of the blow", widths),
    "wave_collision": ("speed of both waves", collisions),
    "wave_tuning": ("speed of the wave", changing),
    "wave_softening": ("speed of the blow, or way of the end", softening),
    "wave_composite": ("peak of the incident wave", interfaces),
    "wave_mitigation": (BLOW, barriers),
}
CASES = OWN | {name: (BLOW, partial(printed, import_module(f"figures.{name}"))) for name in PRINT}


def relative(value, first):
    """Change over a number."""
    return value / first - 1


def moved(picture):
    """{(row, quantity): (value, its changes)} of one picture."""
    values = CASES[picture][1]
    first, *others = (values(1 + change) for change in (0.0, *CHANGES.values()))
    return {key: (value, [relative(one.get(key, math.nan), value) for one in others])
            for key, value in first.items() if abs(value) > LEAST}  # fmt: skip


def drawn():
    """The same of the draws of the composite: the largest change."""
    tables, found = composite_spread.data(), {}
    for what in ("energy of reflected rarefactions", "transmitted compressions"):
        first, *others = (composite_spread.spread(tables, x)[what] for x in (0, *CHANGES.values()))
        most = [np.abs(relative(one, first[0])).max() for one in others]
        found["changes up to 0.01", what] = first[0], most
    return found


def data():
    """A line for each number."""
    everything = {name: (given, moved(name)) for name, (given, _) in CASES.items()}
    everything[composite_spread.NAME] = "peak, stiffnesses and preload", drawn()
    names = ("picture", "row", "quantity", "input", "value", *CHANGES)
    return {"numbers": side_by_side([
        dict(zip(names, (picture, *key, given, value, *changes), strict=True))
        for picture, (given, numbers) in everything.items()
        for key, (value, changes) in numbers.items()
    ])}  # fmt: skip


def table(tables):
    """The lines themselves."""
    return lines(tables["numbers"])


def draw(figure, tables):
    """Changes of all numbers, pictures below each other."""
    figure.set_size_inches(9, 6.5)
    axes, one = figure.subplots(), tables["numbers"]
    rows = {picture: -k for k, picture in enumerate(dict.fromkeys(one["picture"]))}
    for k, name in enumerate(CHANGES):
        y = np.array([rows[x] for x in one["picture"]]) + 0.12 - 0.24 * k
        axes.plot(np.maximum(np.abs(one[name]), STILL), y, f"C{k}o", ms=4, alpha=0.6, mew=0)
        axes.axvline(CHANGES[name], color=f"C{k}", lw=0.8, ls=":")
        axes.text(CHANGES[name], 0.7, f"input + {name}", color=f"C{k}", ha="center")
    axes.set(xscale="log", xlabel="relative change of a number (at the left edge: none)",
             ylabel="picture that a number is from", xlim=(STILL / 2, 9))  # fmt: skip
    axes.set_yticks(list(rows.values()), list(rows))
