"""An acoustic lens of prism chains: prestrains, pulses at the focus, and the focused field.

All pulses arrive at the focus at the same instant, so that the pressure there is the sum of the
single contributions; this measures alignment, not strength.  The largest pressure on the axis lies
before the focus, nearer to the ends.
"""

from __future__ import annotations

import numpy as np

from figures import _lens
from figures._lens import row
from tensegrity import plotting

NAME = "lens_focus"
GROUP = "lens"

EQUAL = {"centre": 10, "edge": 0}  # chains whose prestrain all have, for comparison
ACROSS = np.linspace(-12.0, 12.0, 193)  # m
ALONG = np.linspace(0.25, 40.0, 160)  # m
GRID = 121, 81  # points of the picture of the field
COARSE = 61, 41  # and of the GIF
BOX = 24.0, 32.0  # m: half width and length shown
INSTANTS = 48  # of the GIF
BEFORE, AFTER = 15.0, 6.0  # s shown about the focus


def grid(shape):
    """Points x, y of the box, (n, 2)."""
    x, y = np.meshgrid(np.linspace(-BOX[0], BOX[0], shape[0]), np.linspace(0, BOX[1], shape[1]))
    return np.stack([x.ravel(), y.ravel()], axis=1)


def chains(lens):
    """Each chain: prestrain, arrival at the end and, as ray, piston and point, at the focus."""
    t = _lens.around(lens)
    pistons = [_lens.top(t, p) for p in lens.pressures(lens.focus, t)]
    points = [_lens.top(t, p) for p in lens.point_pressures(lens.focus, t)]
    rays = lens.arrivals + lens.distances / lens.host_speed
    return {
        "x [m]": lens.places,
        "prestrain": lens.chain_prestrains,
        "arrival [s]": lens.arrivals,
        "width [s]": lens.pulse_widths,
        "ray, late by [s]": rays - lens.focus_time,
        "peak, late by [s]": lens.focus_arrivals - lens.focus_time,
        "sampled peak, late by [s]": np.array([t for t, _ in pistons]) - lens.focus_time,
        "peak [Pa]": np.array([p for _, p in pistons]),
        "peak of a point [Pa]": np.array([p for _, p in points]),
    }


def data():
    """Chains; pressures at the focus; profiles of the largest pressure; fields."""
    lens = _lens.lens()
    t = np.arange(lens.focus_time - 14.0, lens.focus_time + 10.0, _lens.STEP)
    equal = {
        name: lens.pressure(lens.focus, t, lens.chain_prestrains[k]) for name, k in EQUAL.items()
    }
    near = _lens.around(lens, 13.0, 13.0, 0.05)
    axis = _lens.line(0.0, ALONG)
    plane = grid(COARSE)
    times = np.linspace(-BEFORE, AFTER, INSTANTS)
    frames = np.concatenate([lens.pressure(plane, lens.focus_time + s)[None] for s in times])
    return {
        "chains": chains(lens),
        "pressure": {
            "t [s]": t,
            "lens [Pa]": lens.pressure(lens.focus, t),
            "points [Pa]": lens.point_pressures(lens.focus, t).sum(axis=0),
            **{f"{name} [Pa]": p for name, p in equal.items()},
        },
        "across": {
            "x [m]": ACROSS,
            "peak [Pa]": _lens.peaks(lens, _lens.line(ACROSS, lens.focus[1]), near),
        },
        "along": {
            "y [m]": ALONG,
            "peak [Pa]": _lens.peaks(lens, axis, near),
            "points [Pa]": _lens.point_peaks(lens, axis, near),
        },
        "field": {"pressure [Pa]": lens.pressure(grid(GRID), lens.focus_time)},
        "numbers": {
            "coupling": [lens.coupling],
            "focus time [s]": [lens.focus_time],
            "largest delay [s]": [float(lens.delays.max())],
            "energy error": [lens.run().energy_error],
            **{name: [value] for name, value in vars(lens.focusing()).items()},
        },
        "frames": {f"{s:.3f} s": frame for s, frame in zip(times, frames, strict=True)},
    }


def table(tables):
    """Arrivals, gains, the focal spot, and the size of the neglected coupling."""
    chain, seen, numbers = (tables[k] for k in ("chains", "pressure", "numbers"))
    pulse = float(np.min(chain["width [s]"]))
    t = seen["t [s]"]
    peak = _lens.top(t, seen["lens [Pa]"])[1]
    late = "late by [s]"
    name = "21 chains, focus 20 m ahead"
    rays, peaks, seen_peaks = (chain[f"{k}, {late}"] for k in ("ray", "peak", "sampled peak"))
    return [
        row(name, "prestrain of the centre", float(chain["prestrain"][10]), "0.05287"),
        row(name, "prestrain of the edge", float(chain["prestrain"][0]), "0.09433"),
        row(name, "largest delay [s]", numbers["largest delay [s]"][0], "5.5228"),
        row(name, "pulse, width at half its peak [s]", pulse),
        row(name, "arrivals at the focus over the pulse, own peak of each end",
            float(np.ptp(peaks) / pulse), "< 1e-3"),
        row(name, "the same by samples", float(np.ptp(seen_peaks) / pulse), "< 1e-3"),
        row(name, "the same of rays from the centres", float(np.ptp(rays) / pulse)),
        row(name, "alignment: peak over the sum of single peaks",
            f"1 - {1 - numbers['alignment'][0]:.1e}", ">= 0.999"),
        row(name, "the same by samples", peak / chain["peak [Pa]"].sum(), ">= 0.999"),
        row(name, "the same, ends as points",
            _lens.top(t, seen["points [Pa]"])[1] / chain["peak of a point [Pa]"].sum()),
        row(name, "peak of points over that of pistons",
            _lens.top(t, seen["points [Pa]"])[1] / peak),
        *(row(name, f"peak over equal chains of prestrain {chain['prestrain'][k]:.5f} ({place})",
              peak / _lens.top(t, seen[f"{place} [Pa]"])[1]) for place, k in EQUAL.items()),
        row(name, "width of the spot across, at half the peak [m]",
            _lens.half_width(tables["across"]["x [m]"], tables["across"]["peak [Pa]"])),
        row(name, "gain: peak over equal chains of the median prestrain", numbers["gain"][0]),
        row(name, "largest pressure on the axis from 10 to 30 m, at y [m]", numbers["place"][0],
            "17.1"),
        row(name, "that pressure over that at the focus",
            numbers["largest"][0] / numbers["peak"][0], "1.058"),
        row(name, "energy transmitted to the fluid over that of the blows",
            numbers["transmitted"][0]),
        row(name, "one-way coupling, rho c A/(m cs)", numbers["coupling"][0], "<< 1"),
        row(name, "energy error of the run", numbers["energy error"][0]),
    ]  # fmt: skip


def draw(figure, tables):
    """Draw prestrains, pressures at the focus, the field, and profiles."""
    figure.set_size_inches(13, 8)
    (a, b, c), (d, e, f) = figure.subplots(2, 3)
    chain, seen, focus = tables["chains"], tables["pressure"], _lens.lens().focus
    a.plot(chain["x [m]"], chain["prestrain"], "o-", ms=4)
    a.set(xlabel="x of the chain [m]", ylabel="prestrain", title="prestrains of the chains")
    twin = a.twinx()
    twin.plot(chain["x [m]"], chain["arrival [s]"], "C1s-", ms=3)
    twin.set_ylabel("arrival at the end [s]", color="C1")
    twin.grid(False)
    t = seen["t [s]"] - tables["numbers"]["focus time [s]"][0]
    b.plot(t, 1e6 * seen["lens [Pa]"], label="lens")
    b.plot(t, 1e6 * seen["points [Pa]"], "k:", lw=1, label="ends as points")
    for place, k in EQUAL.items():
        label = f"all {chain['prestrain'][k]:.4f} ({place})"
        b.plot(t, 1e6 * seen[f"{place} [Pa]"], lw=1, label=label)
    b.set(xlabel="time from the focus [s]", ylabel="pressure [uPa]")
    b.legend(fontsize=8, loc="lower left")
    c.plot(chain["x [m]"], 1e3 * chain["peak, late by [s]"], "o-", ms=4, label="peak of a piston")
    c.plot(chain["x [m]"], 1e3 * chain["ray, late by [s]"], "s-", ms=3,
           label="ray from its centre")  # fmt: skip
    c.set(xlabel="x of the chain [m]", ylabel="late at the focus [ms]",
          title=f"arrivals; the pulse is {np.min(chain['width [s]']):.2f} s wide")  # fmt: skip
    c.legend(fontsize=8)
    field = 1e6 * np.reshape(tables["field"]["pressure [Pa]"], GRID[::-1])
    paint(figure, d, field, focus)
    across, along = tables["across"], tables["along"]
    e.plot(across["x [m]"], 1e6 * across["peak [Pa]"])
    e.set(xlabel="x [m]", ylabel="largest pressure [uPa]", title="across, at y = 20 m", ylim=0)
    f.semilogy(along["y [m]"], 1e6 * along["peak [Pa]"], label="pistons")
    f.semilogy(along["y [m]"], 1e6 * along["points [Pa]"], "k:", lw=1, label="points")
    f.axvline(focus[1], color="0.6", lw=0.8)
    f.text(focus[1] + 0.5, f.get_ylim()[1] * 0.6, "focus", fontsize=8, color="0.4")
    found = {key: values[0] for key, values in tables["numbers"].items()}
    largest = found["place"], 1e6 * found["largest"]
    more = 100 * (found["largest"] / found["peak"] - 1)
    f.plot(*largest, "C3o", ms=5, zorder=3)
    line = {"arrowstyle": "-", "color": "C3", "lw": 0.8}
    words = f"largest: {largest[0]:.2f} m,\n{more:.1f} % above focus"
    f.annotate(words, largest, (4, 9), fontsize=8, color="C3", arrowprops=line)
    lacks = f"1 - {1 - found['alignment']:.0e} of the sum of single peaks"
    b.set_title(f"at the focus: {found['gain']:.2f} times equal chains,\n{lacks}", fontsize=10)
    percent = f"{100 * found['transmitted']:.2g} %"
    d.set_title(
        f"when the pulses meet; {percent} of the\nblows' energy is transmitted", fontsize=10
    )
    f.set(xlabel="y [m]", ylabel="largest pressure [uPa]", title="along the axis")
    f.legend(fontsize=8)


def paint(figure, axes, field, focus, most=5.0):
    """A field [uPa] in colours, the focus as a cross, the ends as a line of marks."""
    image = axes.imshow(
        field, origin="lower", extent=(-BOX[0], BOX[0], 0, BOX[1]), cmap="RdBu_r",
        vmin=-most, vmax=most, interpolation="bilinear", aspect="equal",
    )  # fmt: skip
    axes.plot(*focus, "k+", ms=10)
    axes.plot(_lens.lens().places, np.zeros(21), "k|", ms=6, clip_on=False)
    axes.set(xlabel="x [m]", ylabel="y [m]")
    axes.grid(False)
    figure.colorbar(image, ax=axes, label="pressure [uPa]", shrink=0.8)
    return image


def animate(tables, path):
    """The field as it converges and passes, as a GIF."""
    import matplotlib.pyplot as plt

    figure, axes = plt.subplots(figsize=(7.5, 5), dpi=80, layout="constrained")
    fields = {name: 1e6 * np.reshape(p, COARSE[::-1]) for name, p in tables["frames"].items()}
    image = paint(figure, axes, next(iter(fields.values())), _lens.lens().focus)

    def show(name):
        image.set_data(fields[name])
        axes.set_title(f"{float(name.split()[0]):+6.2f} s from the focus", family="monospace")

    plotting.film(path, figure, fields, show, rate=10)
