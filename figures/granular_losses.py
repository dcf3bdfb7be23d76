"""Losses in the contacts of the half guide of seeds/001, against what its experiments measured."""

from __future__ import annotations

import math

import numpy as np

from derivations import contact, losses
from figures import _guide, granular_fig2
from figures._guide import STEEL, row
from granular import (
    Striker,
    carretero_gonzalez,
    chain,
    hertz,
    hunt_crossley,
    kuwabara_kono,
    simulate,
    viscous,
    y_guide,
)
from tensegrity import PowerLaw, Record, first_peak, solitary_wave

NAME = "granular_losses"
GROUP = "granular"

MEASURED = {"V_i [m/s]": 566.96, "V_t [m/s]": 506.64, "V_r [m/s]": 415.92,
            "F_i/F_t": 2.0, "F_i/F_r": 8.4}  # fmt: skip
LABELS = ("$V_i$", "$V_t$", "$V_r$", "$F_i/F_t$", "$F_i/F_r$")
LAWS = {
    "Kuwabara-Kono": kuwabara_kono,
    "Hunt-Crossley": hunt_crossley,
    "viscous": viscous,
    "Carretero-Gonzalez, a = 1.8": lambda **given: carretero_gonzalez(a=1.8, **given),
}
NUDGE = {"V_i [m/s]": -0.004, "V_t [m/s]": -0.008, "F_i/F_t": 0.016}  # of labels that would touch
AT = 0.5  # m/s, of the restitution by which laws are compared
RESTITUTIONS = np.array([0.98, 0.96, 0.93, 0.91, 0.89, 0.87, 0.84, 0.8])
DRAWN = 0.93  # the restitution of the curves
END, DT = 450e-6, 0.4e-6  # s
SENSORS = (("stem 1", 16), ("branch 1", 8))
SPEEDS = np.geomspace(0.01, 10.0, 25)  # m/s
LITTLE = (1e-8, 3e-8, 1e-7)  # s: constants of the decay
ROW, FIRST, LAST = 90, 20, 60  # beads, and contacts at which the decay is read


def followed(law=None, friction=None, dt=DT):
    """A run of the half guide."""
    given = {} if law is None else {"law": law}
    guide = y_guide(bead=STEEL, striker=_guide.light(granular_fig2.SPEED), friction=friction,
                    **given)  # fmt: skip
    method = "rkn6" if law is None and friction is None else "rk8"
    record = Record(every=1)
    return simulate(guide, guide.start(), END, method=method, dt=dt, record=record)


def five(run):
    """The numbers that the paper measured: V_i, V_t, V_r [m/s], F_i/F_t and F_i/F_r."""
    speeds, (incident, transmitted, reflected) = granular_fig2.ratios(
        {"peaks": granular_fig2.located(run)}
    )
    return [*speeds, incident / transmitted, incident / reflected]


def data():
    """The five numbers for each law and restitution, sensor curves, restitutions, and decays."""
    elastic, lossy = followed(), followed(kuwabara_kono(restitution=DRAWN, speed=AT))
    found = {"elastic": {"restitution": np.ones(1), **_named([five(elastic)])}}
    for name, law in LAWS.items():
        each = [five(followed(law(restitution=e, speed=AT))) for e in RESTITUTIONS]
        found[name] = {"restitution": RESTITUTIONS, **_named(each)}
    fine = five(followed(kuwabara_kono(restitution=DRAWN, speed=AT), dt=DT / 2))
    rubbing = five(followed(friction=(0.3, 0.01)))
    decay = _decay()
    return found | {
        "friction 0.3": {"restitution": np.ones(1), **_named([rubbing])},
        "half the step": {"restitution": np.array([DRAWN]), **_named([fine])},
        "elastic curves": _guide.curves(elastic, SENSORS),
        "lossy curves": _guide.curves(lossy, SENSORS),
        "collisions": _collisions(),
        "decay": decay,
        "growths": _growths(decay),
    }


def _named(rows):
    return dict(zip(MEASURED, np.array(rows).T, strict=True))


def _collisions():
    """Restitution of two beads against their speed of approach."""
    table = {"speed [m/s]": SPEEDS}
    for name, law in LAWS.items():
        pair = law(restitution=0.9, speed=AT)(STEEL, STEEL)
        table[name] = np.array([pair.restitution(STEEL.mass / 2, v)[0] for v in SPEEDS])
    return table


def _decay():
    """Largest overlaps along a struck row, for some constants of Kuwabara-Kono."""
    table = {"contact": np.arange(FIRST, LAST)}
    for c in LITTLE:
        beads = chain([STEEL] * ROW, striker=Striker(STEEL, granular_fig2.SPEED),
                      law=kuwabara_kono(c))  # fmt: skip
        run = simulate(beads, beads.start(), 6e-4, dt=DT / 4, method="rk8", record=Record(every=2))
        overlap = beads.overlaps(run.u)
        table[decay_name(c)] = np.array(
            [first_peak(run.t, overlap[:, k])[1] for k in table["contact"]]
        )
    return table


def decay_name(c):
    return f"c = {1e9 * c:g} ns"


def _growths(decay):
    """By how much overlap^(-1/4) grows from contact to contact: by `derivations.losses` with
    Nesterenko's wave and with the exact one, and in the runs."""
    symbols = {contact.mass: STEEL.mass, contact.constant: hertz(STEEL, STEEL).constant}
    each = [float(losses.growth().subs(symbols | {losses.time: c})) for c in LITTLE]
    runs = [np.polyfit(decay["contact"], decay[decay_name(c)] ** -0.25, 1)[0] for c in LITTLE]
    exact = exact_rate() / float(losses.rate()) * np.array(each)
    return {"c [s]": np.array(LITTLE), "Nesterenko": np.array(each), "exact": exact,
            "runs": np.array(runs)}  # fmt: skip


def exact_rate():
    """K of `derivations.losses` with the profile of the exact wave instead of Nesterenko's."""
    wave = solitary_wave(PowerLaw(1.0, 1.5, length=1.0), speed=1.0)
    xi = np.maximum(-wave.strain, 0.0)
    slope = np.gradient(xi, wave.x)
    lost = wave.speed * np.trapezoid(1.5 * np.sqrt(xi) * slope**2, wave.x)
    return float(lost / (2.5 * wave.energy) / xi.max() ** 0.25)


def misfit(tables, name):
    """Largest relative deviation of the five numbers from those measured, by restitution."""
    each = [tables[name][key] / value - 1 for key, value in MEASURED.items()]
    return np.abs(each).max(axis=0)


def restitution_for(tables, key, name="Kuwabara-Kono"):
    """The restitution at which a number is the measured one; NaN where none is."""
    e = np.append(1.0, tables[name]["restitution"])
    values = np.append(tables["elastic"][key], tables[name][key]) - MEASURED[key]
    where = np.flatnonzero(values[1:] * values[:-1] <= 0)
    if not where.size:
        return math.nan
    k = where[0]
    return float(e[k] + (e[k + 1] - e[k]) * values[k] / (values[k] - values[k + 1]))


def table(tables):
    """The five numbers, and the constants that would give them."""
    name, found = "losses", []
    k = int(np.flatnonzero(RESTITUTIONS == DRAWN)[0])
    lossy = tables["Kuwabara-Kono"]
    for key, value in MEASURED.items():
        found.append(
            row(name, f"{key} without losses", float(tables["elastic"][key][0]), "", value)
        )
        found.append(row(name, f"{key} at restitution {DRAWN}", float(lossy[key][k]), "", value))
        e = restitution_for(tables, key)
        found.append(row(name, f"restitution that gives {key}", "none" if math.isnan(e) else e))
    for law in ("elastic", *LAWS):
        found.append(row(name, f"largest misfit at the best constant, {law}",
                         float(misfit(tables, law).min())))  # fmt: skip
    half, rubbing, growths = (tables[key] for key in ("half the step", "friction 0.3", "growths"))
    found += [
        row(name, "change of these numbers with half the step",
            max(abs(float(half[key][0] / lossy[key][k]) - 1) for key in MEASURED)),
        row(name, "change of these numbers by friction with the walls, 0.3",
            max(abs(float(rubbing[key][0] / tables["elastic"][key][0]) - 1) for key in MEASURED)),
        row(name, "reflected peak with losses over that without", reflected(tables)),
        *(row(name, f"growth of overlap^(-1/4) at {decay_name(c)} over that of the {kind} wave",
              float(growths["runs"][k] / growths[kind][k]))
          for k, c in enumerate(LITTLE) for kind in ("Nesterenko", "exact")),
    ]  # fmt: skip
    return found


def reflected(tables):
    """Height of the reflected pulse in stem 1 with losses over that without."""
    heights = []
    for kind in ("elastic curves", "lossy curves"):
        t, force = tables[kind]["t [s]"], tables[kind]["stem 1 16 [N]"]
        after = first_peak(t, force)[0] + granular_fig2.BEYOND
        heights.append(first_peak(t, force, (after, math.inf))[1])
    return heights[1] / heights[0]


def draw(figure, tables):
    figure.set_size_inches(10, 7.2)
    (curves, numbers), (collisions, decay) = figure.subplots(2, 2)
    for kind, style in (("elastic curves", "-"), ("lossy curves", "--")):
        for k, (part, bead) in enumerate(SENSORS):
            force = tables[kind][f"{part} {bead} [N]"]
            curves.plot(1e6 * tables[kind]["t [s]"], force, f"C{k}{style}", lw=1.2)
    for k, (part, bead) in enumerate(SENSORS):
        force = tables["elastic curves"][f"{part} {bead} [N]"]
        at = 1e6 * tables["elastic curves"]["t [s]"][force.argmax()]
        curves.annotate(f"{part}, bead {bead}", (at + 8, 0.93 * force.max()), color=f"C{k}")
    curves.set(xlabel="time [µs]", ylabel="force at the sensor [N]", xlim=(100, 420))
    curves.set_title(f"(a) Losses (dashed, restitution {DRAWN}) slow and lower the pulses")
    kuwabara = tables["Kuwabara-Kono"]
    e = np.append(1.0, kuwabara["restitution"])
    for k, (key, value) in enumerate(MEASURED.items()):
        ratio = np.append(tables["elastic"][key], kuwabara[key]) / value
        numbers.plot(e, ratio, f"C{k}")
        at = 0.797, ratio[-1] + NUDGE.get(key, 0.0)
        numbers.annotate(LABELS[k], at, color=f"C{k}", va="center")
    numbers.axhline(1, color="0.6", lw=0.8)
    numbers.set(xlabel=f"restitution of two beads at {AT} m/s", ylabel="computed over measured",
                xlim=(1.0, 0.77))  # fmt: skip
    numbers.set_title("(b) No constant gives all five measured numbers")
    for k, name in enumerate(LAWS):
        values = tables["collisions"][name]
        collisions.semilogx(SPEEDS, values, f"C{k}", label=name)
    collisions.legend(fontsize=8, loc="lower left")
    collisions.set(xlabel="speed of approach [m/s]", ylabel="restitution")
    collisions.set_title("(c) The laws differ in how losses grow with speed")
    table = tables["decay"]
    for k, c in enumerate(LITTLE):
        overlap = table[decay_name(c)]
        decay.plot(table["contact"], (overlap / overlap[0]) ** -0.25, f"C{k}.", ms=4)
        each = tables["growths"]["exact"][k] * overlap[0] ** 0.25
        line = 1 + each * (table["contact"] - FIRST)
        decay.plot(table["contact"], line, f"C{k}", lw=1)
        decay.annotate(decay_name(c), (LAST, line[-1]), color=f"C{k}", va="center")
    decay.set(xlabel="contact", ylabel=r"(overlap/first)$^{-1/4}$", xlim=(FIRST - 2, LAST + 12))
    decay.set_title("(d) Overlaps decay as derived (lines)")
