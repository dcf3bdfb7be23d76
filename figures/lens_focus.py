"""An acoustic lens of prism chains doubles the pressure at its focus, and a little before it.

All pulses arrive at the focus at the same instant, so that the pressure there is the sum of the
single contributions; this measures alignment, not strength.  The maximum of the pressure on the
axis lies before the focus; close to the ends it is higher still.
"""

from functools import cache

import numpy as np

from figures._draw import name_curves
from figures._lens import Lens
from tensegrity import Prism, plotting

NAME = "lens_focus"
GROUP = "lens"

EQUAL = {"centre": 10, "edge": 0}  # chains whose prestrain all have, for comparison
ALONG = np.linspace(0.25, 40.0, 160)  # m
GRID = 61, 41  # points of the picture of the field
BOX = 24.0, 32.0  # m: half width and length shown
INSTANTS = 48  # of the GIF
BEFORE, AFTER = 15.0, 6.0  # s shown about the focus


@cache
def lens():
    """21 chains of 40 prisms, 2 m apart, focused 20 m ahead."""
    return Lens(Prism(base=1.0, height=0.8, prestrain=0.01, k_cross=1.0), focus=(0.0, 20.0))


def top(t, pressure):
    """Instant and height of the largest pressure, by the parabola through three instants."""
    k = int(np.clip(np.argmax(pressure), 1, len(t) - 2))
    a, b, c = pressure[k - 1 : k + 2]
    shift = (a - c) / (2 * (a - 2 * b + c))
    return t[k] + shift * (t[k + 1] - t[k]), b - (a - c) * shift / 4


def around(before, after, step=0.02):
    """Instants about that at which the pulses meet."""
    return lens().design.time + np.arange(-before, after + step / 2, step)


def grid(shape):
    """Points x, y of the box, (n, 2)."""
    x, y = np.meshgrid(np.linspace(-BOX[0], BOX[0], shape[0]), np.linspace(0, BOX[1], shape[1]))
    return np.stack([x.ravel(), y.ravel()], axis=1)


def data():
    """Chains; pressures at the focus and along the axis; fields."""
    one, t = lens(), around(14.0, 10.0)
    design, axis = one.design, np.stack([0 * ALONG, ALONG], axis=1)
    single = one.pressures(one.focus, t)
    equal = {f"{name} [Pa]": one.pressure(one.focus, t, design.prestrains[k])
             for name, k in EQUAL.items()}  # fmt: skip
    return {
        "chains": {
            "x [m]": one.places, "prestrain": design.prestrains,
            "width [s]": design.widths, "late by [s]": design.peaks - design.time,
            "peak [Pa]": [top(t, p)[1] for p in single],
        },
        "pressure": {"t [s]": t, "lens [Pa]": one.pressure(one.focus, t), **equal},
        "along": {"y [m]": ALONG,
                  "peak [Pa]": one.pressure(axis, around(13.0, 13.0, 0.05)).max(axis=0)},
        "numbers": {
            "coupling": [one.coupling], "focus time [s]": [design.time],
            "largest delay [s]": [float(np.ptp(one.rays))],
            "energy error": [one.run(design.prestrains, design.until).energy_error],
            **{name: [value] for name, value in one.focusing().items()},
        },
        "frames": {f"{s:.3f} s": one.pressure(grid(GRID), design.time + s)
                   for s in np.linspace(-BEFORE, AFTER, INSTANTS)},
    }  # fmt: skip


def table(tables):
    """Arrivals, gains, and the size of the neglected coupling."""
    chain, seen, numbers = (tables[k] for k in ("chains", "pressure", "numbers"))
    peak = top(seen["t [s]"], seen["lens [Pa]"])[1]
    arrivals = np.ptp(chain["late by [s]"]) / np.min(chain["width [s]"])
    found = {key: value[0] for key, value in numbers.items()}
    lines = {
        "prestrain of the centre": (float(chain["prestrain"][10]), "0.05287"),
        "prestrain of the edge": (float(chain["prestrain"][0]), "0.09433"),
        "largest delay [s]": (found["largest delay [s]"], "5.5228"),
        "arrivals at the focus over the pulse": (float(arrivals), "< 1e-3"),
        "alignment: peak over the sum of single peaks": (peak / np.sum(chain["peak [Pa]"]),
                                                         ">= 0.999"),
        **{f"peak over equal chains of the {name}'s prestrain":
           (peak / top(seen["t [s]"], seen[f"{name} [Pa]"])[1], "") for name in EQUAL},
        "gain: peak over equal chains of the median prestrain": (found["gain"], ""),
        "largest pressure on the axis from 10 to 30 m, at y [m]": (found["place"], "17.1"),
        "that pressure over that at the focus": (found["largest"] / found["peak"], "1.058"),
        "energy transmitted to the fluid over that of the blows": (found["transmitted"], ""),
        "one-way coupling, rho c A/(m cs)": (found["coupling"], "<< 1"),
        "energy error of the run": (found["energy error"], ""),
    }  # fmt: skip
    return [{"case": "21 chains, focus 20 m ahead", "quantity": key, "value": value,
             "reference": reference} for key, (value, reference) in lines.items()]  # fmt: skip


def draw(figure, tables):
    """Prestrains, pressures at the focus, the field, and pressures along the axis."""
    figure.set_size_inches(9, 7)
    (a, b), (c, d) = figure.subplots(2, 2)
    chain, seen, focus = tables["chains"], tables["pressure"], lens().focus
    found = {key: values[0] for key, values in tables["numbers"].items()}
    a.plot(chain["x [m]"], chain["prestrain"], "o-", ms=4)
    a.set(xlabel="place x of the chain [m]", ylabel="prestrain", title="prestrains of the chains")
    t = seen["t [s]"] - found["focus time [s]"]
    for name, label in (("lens", "lens"), *((k, f"all as {k}") for k in EQUAL)):
        b.plot(t, 1e6 * seen[f"{name} [Pa]"], lw=1, label=label)
    b.set(xlabel="time from the focus [s]", ylabel="pressure [µPa]",
          title=f"at the focus: {found['gain']:.2f} times equal chains")  # fmt: skip
    name_curves(b, at=np.argmax, spread=16)
    paint(figure, c, tables["frames"], min(tables["frames"], key=lambda s: abs(float(s[:-2]))))
    c.set_title(f"as the pulses meet; {100 * found['transmitted']:.2g} % of the energy radiated")
    d.semilogy(tables["along"]["y [m]"], 1e6 * tables["along"]["peak [Pa]"])
    d.axvline(focus[1], color="0.6", lw=0.8)
    d.text(focus[1] + 0.5, 6, "focus", color="0.4")
    d.plot(found["place"], 1e6 * found["largest"], "C3o", ms=5, zorder=3)
    d.set(xlabel="distance y from the ends [m]", ylabel="largest pressure [µPa]",
          title="along the axis; dot: maximum near the focus")  # fmt: skip


def paint(figure, axes, frames, name, most=5.0):
    """One frame of the field in colours, the focus as a cross, the ends as a line of marks."""
    image = axes.imshow(
        1e6 * np.reshape(frames[name], GRID[::-1]), origin="lower",
        extent=(-BOX[0], BOX[0], 0, BOX[1]), cmap="RdBu_r",
        vmin=-most, vmax=most, interpolation="bilinear", aspect="equal",
    )  # fmt: skip
    axes.plot(*lens().focus, "k+", ms=10)
    axes.plot(lens().places, np.zeros(21), "k|", ms=6, clip_on=False)
    axes.set(xlabel="x [m]", ylabel="y [m]")
    axes.grid(False)
    figure.colorbar(image, ax=axes, label="pressure [µPa]", shrink=0.8)
    return image


def animate(tables, path):
    """The field as it converges and passes, as a GIF."""
    import matplotlib.pyplot as plt

    figure, axes = plt.subplots(figsize=(7.5, 5), dpi=80, layout="constrained")
    frames = tables["frames"]
    image = paint(figure, axes, frames, next(iter(frames)))

    def show(name):
        image.set_data(1e6 * np.reshape(frames[name], GRID[::-1]))
        axes.set_title(f"{float(name.split()[0]):+6.2f} s from the focus", family="monospace")

    plotting.film(path, figure, frames, show, rate=10)
