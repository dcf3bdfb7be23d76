"""An acoustic lens whose focus is moved across and along the axis by the prestrains alone."""

from __future__ import annotations

import numpy as np

from figures import _lens
from figures._lens import row

NAME = "lens_moved"
GROUP = "lens"

FOCI = ((0.0, 20.0), (-6.0, 20.0), (12.0, 20.0), (0.0, 10.0), (0.0, 40.0))  # m
SPAN, POINTS = 16.0, 129  # m to both sides of each focus, and points there
LARGEST = 61, 41  # points of the maps of the largest pressure
BOX = 24.0, 2.0, 50.0  # m: half width of these, nearest and farthest y
DEPTH = np.linspace(2.0, 60.0, 117)  # m: of the profiles along


def name(focus):
    """The coordinates of a focus as text."""
    return f"{focus[0]:g}, {focus[1]:g}"


def box():
    """Points x, y of the maps, (n, 2)."""
    x = np.linspace(-BOX[0], BOX[0], LARGEST[0])
    y = np.linspace(*BOX[1:], LARGEST[1])
    return np.stack([axis.ravel() for axis in np.meshgrid(x, y)], axis=1)


def data():
    """Prestrains; largest pressures across, along and in the plane; numbers of each focus."""
    tables = {"prestrains": {"x [m]": _lens.lens().places}}
    tables |= {kind: {} for kind in ("across", "along", "plane", "numbers")}
    for focus in FOCI:
        lens, key = _lens.lens(focus), name(focus)
        x = focus[0] + np.linspace(-SPAN, SPAN, POINTS)
        passed = (DEPTH[-1] - focus[1]) / lens.host_speed + 5.0
        t, wide = _lens.around(lens, 8.0, 8.0, 0.1), _lens.around(lens, 35.0, passed, 0.2)
        fine = _lens.around(lens)
        each = lens.pressures(focus, fine)
        peak = _lens.top(fine, each.sum(axis=0))[1]
        across = _lens.peaks(lens, _lens.line(x, focus[1]), t)
        there = np.array([_lens.top(fine, p)[0] for p in each])
        tables["prestrains"][key] = lens.chain_prestrains
        tables["across"] |= {f"{key} x [m]": x, f"{key} [Pa]": across}
        along = _lens.point_peaks(lens, _lens.line(focus[0], DEPTH), wide)
        tables["along"] |= {"y [m]": DEPTH, key: along}
        tables["plane"][key] = _lens.point_peaks(lens, box(), wide)
        tables["numbers"][key] = [
            float(np.ptp(there) / lens.pulse_widths.min()),
            peak / sum(_lens.top(fine, p)[1] for p in each),
            float(_lens.top(x, across)[0]),
            _lens.half_width(x, across),
            float(lens.delays.max()),
        ]
    return tables


def largest_along(along, focus):
    """y [m] where the pressure of ends as points is largest about a focus."""
    y = along["y [m]"]
    near = (focus[1] / 2 <= y) & (y <= 1.5 * focus[1])
    return float(_lens.top(y[near], along[name(focus)][near])[0])


def table(tables):
    """Printed lines for each focus."""
    rows = []
    for focus in FOCI:
        key = name(focus)
        late, share, place, width, delay = tables["numbers"][key]
        chosen = tables["prestrains"][key]
        where = f"focus at ({key}) m"
        rows += [
            row(where, "prestrains", f"{chosen.min():.5f} to {chosen.max():.5f}"),
            row(where, "largest delay [s]", delay),
            row(where, "arrivals over the pulse", late, "< 1e-3"),
            row(where, "alignment: peak below the sum of single peaks by", 1 - share, "<= 1e-3"),
            row(where, "largest across at x [m]", place, f"{focus[0]:g}"),
            row(where, "width of the spot across [m]", width),
            row(
                where,
                "largest along, from half to one and a half of the way, at y [m]",
                largest_along(tables["along"], focus),
                f"< {focus[1]:g}",
            ),
        ]
    return rows


def draw(figure, tables):
    """Prestrains, profiles across and along, maps of the largest pressure."""
    figure.set_size_inches(15, 8.5)
    upper, lower = figure.subfigures(2, 1, height_ratios=(1, 1))
    (a, b, c), maps = upper.subplots(1, 3), lower.subplots(1, len(FOCI), sharey=True)
    x = tables["prestrains"]["x [m]"]
    for k, focus in enumerate(FOCI):
        key, colour = name(focus), f"C{k}"
        a.plot(x, tables["prestrains"][key], "o-", ms=3, color=colour, label=f"({key}) m")
        across = tables["across"]
        b.plot(across[f"{key} x [m]"], 1e6 * across[f"{key} [Pa]"], color=colour)
        b.plot(focus[0], 1e6 * across[f"{key} [Pa]"].max(), "x", color=colour)
        if focus[0] == 0:
            c.plot(tables["along"]["y [m]"], 1e6 * tables["along"][key], color=colour)
            c.axvline(focus[1], color=colour, lw=0.8, ls=":")
        plane = np.reshape(tables["plane"][key], LARGEST[::-1])
        image = maps[k].imshow(
            1e6 * plane, origin="lower", extent=(-BOX[0], BOX[0], *BOX[1:]), cmap="magma",
            vmin=0, vmax=6, aspect="equal", interpolation="bilinear",
        )  # fmt: skip
        maps[k].plot(*focus, "+", color="cyan", ms=9)
        maps[k].set(xlabel="x [m]", title=f"focus ({key}) m")
        maps[k].grid(False)
    maps[0].set_ylabel("y [m]")
    lower.colorbar(image, ax=maps, label="largest pressure, ends as points [uPa]")
    a.set(xlabel="x of the chain [m]", ylabel="prestrain", title="prestrains for each focus")
    a.legend(fontsize=8)
    b.set(xlabel="x [m]", ylabel="largest pressure [uPa]", ylim=0,
          title="across, through each focus")  # fmt: skip
    c.set(xlabel="y [m]", ylabel="largest pressure [uPa]", ylim=0, title="along; foci dotted")
