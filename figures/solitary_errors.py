"""Near the sound speed sech² errs by the square of gamma; near locking no wave is the tent."""

import numpy as np

from figures._draw import name_curves
from figures._limits import slope
from figures._measure import row
from tensegrity import Chain, Prism, Record, sech2, simulate, solitary_wave, speed, tent

GROUP = "waves"

SHAPES = ((0.7, 0.1), (0.7, 0.01), (0.6, 0.001))  # (height, prestrain)
GAMMAS = np.geomspace(0.05, 2.0, 8)
STROKES_LEFT = np.geomspace(0.001, 0.3, 9)
SITES, LEAD, BETWEEN = 620, 40, (60, 510)  # of a wave launched at 2 cs, and timed


def sech2_error(wave):
    """Largest deviation of sech^2 over the peak."""
    x = np.linspace(0, 20 / np.sqrt(24 * (wave.speed_ratio - 1)), 801)
    gap = sech2(wave.potential, wave.speed_ratio, x) - wave.elongation(x)
    return float(np.max(np.abs(gap)) / abs(wave.amplitude))


def tent_error(wave):
    """Largest deviation of the tent over the stroke."""
    x = np.linspace(0, 3, 3001)
    gap = tent(wave.potential, x) - wave.elongation(x)
    return float(np.max(np.abs(gap)) / -wave.potential.domain[0])


def launched(wave):
    """Relative change of the form and of the speed of a wave over 500 sites."""
    chain = Chain(wave.potential, SITES)
    record = Record(every=2, sites=[x for b in BETWEEN for x in (b, b + 1)])
    run = simulate(chain, wave.launch(chain, LEAD), 500 / wave.speed, method="rkn6", dt=0.02,
                   record=record)  # fmt: skip
    lost = chain.elongation(run.final.u) - chain.elongation(wave.launch(chain, LEAD + 500).u)
    form = np.abs(lost).max() / abs(wave.amplitude)
    return {"form": form, "speed": abs(speed(run, BETWEEN) / wave.speed - 1)}


def data():
    """Relative errors along both limits; changes of a wave along a chain."""
    wave = solitary_wave(Prism(1.0, 0.7, 0.01, 1.0).potential(), speed_ratio=2.0)
    tables = {"checks": {name: [lost] for name, lost in launched(wave).items()}}
    for shape in SHAPES:
        spring, name = Prism(1.0, *shape, 1.0).potential(), f"h{shape[0]:g}_p{shape[1]:g}"
        waves = [solitary_wave(spring, speed_ratio=1 + g**2 / 24) for g in GAMMAS.tolist()]
        tables[f"sech2_{name}"] = {"gamma": GAMMAS, "error": list(map(sech2_error, waves))}
        sizes = (1 - STROKES_LEFT) * spring.domain[0]
        waves = [solitary_wave(spring, amplitude=size) for size in sizes.tolist()]
        tables[f"tent_{name}"] = {
            "stroke_left": STROKES_LEFT,
            "speed_ratio": [wave.speed_ratio for wave in waves],
            "error": list(map(tent_error, waves)),
        }
    return tables


def order(tables):
    """Power of gamma in the error of sech^2, over the four smallest; 2 is expected."""
    one = tables["sech2_h0.7_p0.1"]
    return slope(one["gamma"][:4], one["error"][:4])


def table(tables):
    """The order of the error, and what changes along a chain."""
    words = "sech^2, prestrain 0.1: power of gamma in the relative error"
    expected = "O(gamma^4), relative to a peak O(gamma^2)"
    yield row(words, expected, f"{order(tables):.3f}", "fit to four waves")
    for name, (lost,) in tables["checks"].items():
        words = f"exact waves: launched at 2 cs, 500 sites: {name}"
        yield row(words, "permanent form", f"{lost:.1e}", "the chain's step")


def draw(figure, tables):
    """sech^2 towards the sound speed; the tent towards locking."""
    figure.set_size_inches(9, 4.2)
    near, locking = figure.subplots(1, 2)
    for height, prestrain in SHAPES:
        name, how = f"h{height:g}_p{prestrain:g}", {"label": f"prestrain {prestrain:g}"}
        near.loglog(*tables[f"sech2_{name}"].values(), ".-", **how)
        left, _, error = tables[f"tent_{name}"].values()
        locking.semilogx(left, error, ".-", **how)
    near.loglog(GAMMAS, 0.02 * GAMMAS**2, "k:", lw=1, label="slope 2")
    near.set_xlabel("excess over the sound speed, $\\gamma = (24 (c/c_s - 1))^{1/2}$")
    near.set_ylabel("largest error of sech$^2$ over the peak")
    locking.axhline(0, color="k", lw=0.8)
    locking.set(xlabel="fraction of the stroke left", ylim=-0.01)
    locking.set_ylabel("largest error of the tent over the stroke")
    for axes in (near, locking):
        name_curves(axes)
