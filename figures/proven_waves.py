"""Solitary waves are proved to exist in hardening and in softening prisms, on the infinite line.

A proof ends where the wave is larger than the disc about rest in which the energy is analytic: in
the softening prism the flat state is as far below rest, so that rarefaction beyond that elongation
is left out; in the hardening one the disc ends with the locking of the bars, and proofs become dear
before: one at 4.2 sound speeds holds, one at 5 does not.  The terms of the sech^2 series have
errors of the orders 2, 4 and 6 in the decay rate, with the constants that the next term gives.
"""

import math

import numpy as np

from figures._draw import note
from figures._measure import row
from tensegrity import Prism, predict, prove, solitary_wave

GROUP = "waves"

PRISMS = {  # name: prism, speeds over that of sound
    "hardening": (Prism(1.0, 0.7, 0.01, 1.0), (1.02, 1.33, 2.0, 3.0)),
    "softening": (Prism(1.0, 0.25, 0.1, 1.0), (1.001, 1.015, 1.05, 1.15, 1.4, 1.6)),
}
ALMOST = 1 - 1e-9  # of the radius of the disc
SMALL, KAPPAS = Prism(1.0, 0.7, 0.1, 1.0), 0.05 * 2.0 ** np.arange(5.0)


def proven(prism, ratios):
    """Radii over the peak, and the peak over the nearest end of the domain."""
    spring = prism.potential()
    table = {name: [] for name in ("speed_ratio", "peak", "radius", "peak_radius", "z1", "left")}
    for ratio in ratios:
        wave = solitary_wave(spring, speed_ratio=ratio)
        proof = prove(wave, period=math.inf)
        size = abs(wave.amplitude)
        found = (ratio, wave.amplitude, proof.radius / size, proof.peak.radius / size, proof.z1,
                 1 - size / min(map(abs, spring.domain)))  # fmt: skip
        for column, value in zip(table.values(), found, strict=True):
            column.append(value)
    return table


def errors():
    """Errors of one to three terms over the peak."""
    spring = SMALL.potential()
    family = predict(spring)["compression"]
    table = {"kappa": KAPPAS} | {f"order_{n}": [] for n in (1, 2, 3)}
    for kappa in KAPPAS.tolist():
        excess, x = 2 * math.sinh(kappa / 2) / kappa - 1, np.linspace(0, 20 / kappa, 801)
        wave = solitary_wave(spring, excess=excess)
        for n in (1, 2, 3):
            gap = np.abs(family.small(x, excess, n) - wave.elongation(x)).max()
            table[f"order_{n}"].append(float(gap / abs(wave.amplitude)))
    return table, {"constant": list(family.small_errors)}


def data():
    """What is proved of both prisms; errors of the series and their constants."""
    tables = {name: proven(*of) for name, of in PRISMS.items()}
    soft = PRISMS["softening"][0].potential()  # where a wave is as large as the disc
    end = solitary_wave(soft, amplitude=-ALMOST * soft.domain[0]).speed_ratio
    tables["end"] = {"softening": [end]}
    tables["errors"], tables["constants"] = errors()
    return tables


def table(tables):
    """What is proved, and the orders of the errors."""
    for name, one in ((name, tables[name]) for name in PRISMS):
        words = f"{len(one['radius'])} waves up to {max(one['speed_ratio']):g} cs"
        yield row(f"{name} prism: solitary waves proved on the infinite line", "existence", words,
                  f"radius at most {max(one['radius']):.1e} of the peak")  # fmt: skip
    (end,) = tables["end"]["softening"]
    yield row("softening prism: the wave is as large as the disc of analyticity", "",
              f"at {end:.4f} cs", "proofs end before")  # fmt: skip
    kappa = tables["errors"]["kappa"]
    for n, constant in enumerate(tables["constants"]["constant"], 1):
        error = tables["errors"][f"order_{n}"]
        order = math.log(error[1] / error[0]) / math.log(kappa[1] / kappa[0])
        yield row(f"sech^2 series of {n} terms, prestrain 0.1: power of gamma", str(2 * n),
                  f"{order:.3f}", f"constant {constant:.4g}")  # fmt: skip


def draw(figure, tables):
    """Radii against speed; errors of the series."""
    figure.set_size_inches(9.5, 4.4)
    radii, series = figure.subplots(1, 2)
    for colour, name in zip(("C0", "C3"), PRISMS, strict=True):
        one = tables[name]
        ratio = one["speed_ratio"]
        radii.semilogy(ratio, one["radius"], ".-", color=colour, label=f"{name}, profile")
        radii.semilogy(ratio, one["peak_radius"], ".--", color=colour, label=f"{name}, peak")
    (end,) = tables["end"]["softening"]
    radii.axvline(end, color="C3", lw=0.8, ls=":")
    note(radii, "softening waves are\nlarger than the disc", (end, 1e-17), (5, 0), color="C3",
         fontsize=9)  # fmt: skip
    radii.set(xlabel="speed over that of sound", ylabel="proved radius over the peak",
              ylim=(6e-18, 1e-11), title="Distance of the true wave")  # fmt: skip
    radii.legend(loc="upper left", ncols=2, fontsize=8, frameon=False)
    kappa = np.array(tables["errors"]["kappa"])
    for n, constant in enumerate(tables["constants"]["constant"], 1):
        words = f"{n} term{'s' * (n > 1)}: slope {2 * n}"
        series.loglog(kappa, tables["errors"][f"order_{n}"], "o", color=f"C{n}", ms=4)
        series.loglog(kappa, constant * kappa ** (2 * n), "-", color=f"C{n}", lw=1, label=words)
    series.set(xlabel="decay rate $\\gamma$ [1/site]", ylabel="largest error over the peak",
               title="Terms of the sech$^2$ series")  # fmt: skip
    series.set_xticks(kappa, [f"{x:g}" for x in kappa])
    series.set_xticks([], minor=True)
    series.legend(loc="lower right", fontsize=9, frameon=False)
