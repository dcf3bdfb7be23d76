"""No law of losses gives all five numbers that the paper measured."""

import math

import numpy as np

from figures import _guide, granular_fig2
from figures._draw import name_curves
from figures._guide import STEEL
from granular import (
    carretero_gonzalez,
    hunt_crossley,
    kuwabara_kono,
    simulate,
    viscous,
    y_guide,
)
from tensegrity import Record

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
AT = 0.5  # m/s, of the restitution by which laws are compared
RESTITUTIONS = np.array([0.98, 0.96, 0.93, 0.91, 0.89, 0.87, 0.84, 0.8])
DRAWN = 0.93  # the restitution of the curves
END, DT = 450e-6, 0.4e-6  # s
SENSORS = (("stem 1", 16), ("branch 1", 8))


def followed(law=None, friction=None, dt=DT, by=1.0):
    """A run of the half guide."""
    given = {} if law is None else {"law": law}
    guide = y_guide(
        bead=STEEL, striker=_guide.light(by * granular_fig2.SPEED), friction=friction, **given
    )
    method = "rkn6" if law is None and friction is None else "rk8"
    return simulate(guide, guide.start(), END, method=method, dt=dt, record=Record(every=1))


def five(run):
    """The numbers that the paper measured: V_i, V_t, V_r [m/s], F_i/F_t and F_i/F_r."""
    speeds, (incident, transmitted, reflected) = granular_fig2.ratios(
        {"peaks": granular_fig2.located(run)}
    )
    return [*speeds, incident / transmitted, incident / reflected]


def data():
    """The five numbers for each law and restitution, and sensor curves."""
    law = kuwabara_kono(restitution=DRAWN, speed=AT)
    elastic, lossy = followed(), followed(law)
    found = {"elastic": named([1.0], [elastic])}
    for name, laws in LAWS.items():
        runs = (followed(laws(restitution=e, speed=AT)) for e in RESTITUTIONS)
        found[name] = named(RESTITUTIONS, runs)
    return found | {
        "friction 0.3": named([1.0], [followed(friction=(0.3, 0.01))]),
        "half the step": named([DRAWN], [followed(law, dt=DT / 2)]),
        "reflected": {
            "peak [N]": [granular_fig2.located(run)["height [N]"][4] for run in (elastic, lossy)]
        },
        "elastic curves": _guide.curves(elastic, SENSORS),
        "lossy curves": _guide.curves(lossy, SENSORS),
    }


def named(restitutions, runs):
    """The five numbers of runs, as columns."""
    columns = zip(MEASURED, np.array([five(run) for run in runs]).T, strict=True)
    return {"restitution": np.array(restitutions), **dict(columns)}


def misfit(tables, name):
    """Largest relative deviation of the five numbers from those measured, by restitution."""
    each = [tables[name][key] / value - 1 for key, value in MEASURED.items()]
    return np.abs(each).max(axis=0)


def restitution_for(tables, key, name="Kuwabara-Kono"):
    """The restitution at which a number is the measured one; NaN where none is."""
    e = np.append(1.0, tables[name]["restitution"])
    values = np.append(tables["elastic"][key], tables[name][key])
    order = np.argsort(values)
    return float(np.interp(MEASURED[key], values[order], e[order], math.nan, math.nan))


def table(tables):
    """The five numbers, and the constants that would give them."""
    k, found = list(RESTITUTIONS).index(DRAWN), {}
    before, after = tables["reflected"]["peak [N]"]
    plain, lossy = tables["elastic"], tables["Kuwabara-Kono"]
    for key, value in MEASURED.items():
        e = restitution_for(tables, key)
        found[f"{key} without losses"] = plain[key][0], "", value
        found[f"{key} at restitution {DRAWN}"] = lossy[key][k], "", value
        found[f"restitution that gives {key}"] = "none" if math.isnan(e) else e
    for law in ("elastic", *LAWS):
        found[f"largest misfit at the best constant, {law}"] = misfit(tables, law).min()

    def change(name, of, k):
        return max(abs(tables[name][key][0] / of[key][k] - 1) for key in MEASURED)

    found |= {
        "change of these numbers with half the step": change("half the step", lossy, k),
        "change of these numbers by friction with the walls, 0.3": change("friction 0.3", plain, 0),
        "reflected peak with losses over that without": after / before,
    }
    return _guide.rows("losses", found)


def draw(figure, tables):
    """Sensor forces with and without losses; the five numbers against the restitution."""
    figure.set_size_inches(9, 4.2)
    curves, numbers = figure.subplots(1, 2)
    for kind, style in (("elastic curves", "-"), ("lossy curves", "--")):
        for k, (part, bead) in enumerate(SENSORS):
            force = tables[kind][f"{part} {bead} [N]"]
            t = 1e6 * tables[kind]["t [s]"]
            curves.plot(t, force, f"C{k}{style}", lw=1.2)
            if style == "-":
                at = t[force.argmax()] + 8, 0.93 * force.max()
                curves.annotate(f"{part}, bead {bead}", at, color=f"C{k}")
    curves.set(xlabel="time [µs]", ylabel="force at the sensor [N]", xlim=(100, 420),
               title=f"dashed: restitution {DRAWN} at {AT} m/s")  # fmt: skip
    kuwabara = tables["Kuwabara-Kono"]
    e = np.append(1.0, kuwabara["restitution"])
    for label, (key, value) in zip(LABELS, MEASURED.items(), strict=True):
        numbers.plot(e, np.append(tables["elastic"][key], kuwabara[key]) / value, label=label)
    numbers.axhline(1, color="0.6", lw=0.8)
    numbers.set(xlabel=f"restitution of two beads at {AT} m/s", ylabel="computed over measured",
                xlim=(1.0, 0.79))  # fmt: skip
    name_curves(numbers, spread=13)
