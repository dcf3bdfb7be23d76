"""Rules for pictures, as far as a drawn figure shows whether it keeps them."""

from __future__ import annotations

import re
from itertools import combinations, pairwise, zip_longest

import numpy as np
from matplotlib.collections import PathCollection, QuadMesh
from matplotlib.colors import to_hex, to_rgb, to_rgba
from matplotlib.text import Text

from figures._draw import panels

PRINTED = 9.0  # in; pictures are shown at most so wide: a wider one is made smaller with its text
SMALLEST = 8.0  # pt
PANELS = CURVES = 6
TOUCH = 1.5  # px that two texts may share
SAME = 1.0  # px between curves that coincide
CONTRAST = 3.0  # least ratio of luminances of what is drawn and what lies behind it
MATH = re.compile(r"\$[^$]*\$")
NOT_UNITS = re.compile(r"(?<![A-Za-z])(?:u(?:m|s|N|J)|k_[a-z]+|V_?[tir]|F_?[tir])(?![A-Za-z])")
NAMED = re.compile(r"[A-Za-z]{3}|^[xyz] \[")  # a word, or a coordinate
LETTER = re.compile(r"\(([a-z])\)")


def broken(figure):
    """Rules that a figure breaks.

    Parameters
    ----------
    figure : matplotlib.figure.Figure
        As it was drawn.

    Returns
    -------
    list of str
        A sentence for each breach.
    """
    figure.canvas.draw()
    several = panels(figure)
    rules = (sizes, words, letters, named_axes, curves, legends, overlaps, colours)
    return [line for rule in rules for line in rule(figure, several)]


def texts(figure):
    """Visible texts that say something, with their boxes in pixels."""
    hidden = set()
    for axes in figure.axes:
        for axis in axes._axis_map.values():
            shown = axis._update_ticks() if axes.axison and axis.get_visible() else []
            for tick in {*axis.majorTicks, *axis.minorTicks}.difference(shown):
                hidden |= {tick.label1, tick.label2}
            if not (axes.axison and axis.get_visible()):
                hidden |= {axis.label, axis.offsetText}
        if not axes.get_visible():
            hidden |= set(axes.findobj(Text))
    renderer, found = figure.canvas.get_renderer(), []
    for one in figure.findobj(Text):
        if one.get_text().strip() and one.get_visible() and one not in hidden:
            box = one.get_window_extent(renderer)
            if box.width > 0 and np.isfinite(box.extents).all():
                found.append((one, box))
    return found


def sizes(figure, _):
    """Text at the size at which it is printed."""
    width, _ = figure.get_size_inches()
    factor = min(1.0, PRINTED / width)
    small = {}
    for one, _ in texts(figure):
        if (size := one.get_fontsize() * factor) < SMALLEST - 1e-6:
            small.setdefault(round(size, 1), one.get_text())
    for size, text in sorted(small.items()):
        yield f"text of {size:g} pt where {width:g} in are printed {PRINTED:g} in wide: {text!r}"


def words(figure, _):
    """Units and symbols as they are written in print."""
    for one, _ in texts(figure):
        plain = MATH.sub("", one.get_text())
        if found := NOT_UNITS.search(plain):
            yield f"{found.group()!r} in {one.get_text()!r}: µ or TeX"


def letters(figure, several):
    """Panels, their number, what they hold, and their letters."""
    called = []
    if len(several) > PANELS:
        yield f"{len(several)} panels"
    for k, axes in enumerate(several):
        held = [*axes.lines, *axes.collections, *axes.patches, *axes.images]
        if not held and not axes.texts:
            yield f"panel {k} is empty"
        if len(several) > 1:
            said = [axes.get_title(loc=where) for where in ("left", "center", "right")]
            said += [one.get_text() for one in axes.texts]
            called.append({found.group(1) for one in said if (found := LETTER.match(one))})
    wanted = [chr(ord("a") + k) for k in range(len(several))]
    if len(several) > 1 and sorted(x for one in called for x in one) != wanted:
        yield f"panels are called {called}, not {', '.join(wanted)}"


def named_axes(_, several):
    """Axes named by words, where they have numbers."""
    for k, axes in enumerate(several):
        if not axes.axison:
            continue
        for name, axis in axes._axis_map.items():
            shown = [tick for tick in axis.get_ticklabels() if tick.get_text().strip()]
            if not (axis.get_visible() and shown and any(x.get_visible() for x in shown)):
                continue
            label = axis.label.get_text()
            numbers = [x for x in shown if re.search(r"\d", x.get_text())]
            if numbers and not label and not _beside(axes, name, several):
                yield f"the {name} axis of panel {k} has no name"
            elif label and not NAMED.search(MATH.sub("", label)):
                yield f"the {name} axis of panel {k} has no word: {label!r}"


def _beside(axes, name, several):
    """Whether a panel that shares an axis names it, or the figure does."""
    group = axes._shared_axes[name].get_siblings(axes) if name in "xy" else []
    named = any(one._axis_map[name].label.get_text() for one in group if one in several)
    whole = getattr(axes.figure, f"get_sup{name}label", lambda: "")()
    return named or bool(whole)


def drawn_curves(axes):
    """Lines through more than two points, in pixels: no frames, arrows, axes or marks."""
    found = []
    for line in axes.lines:
        path = line.get_transform().transform(np.column_stack(line.get_data()).astype(float))
        whole = path[np.isfinite(path).all(axis=1)]
        is_curve = line.get_linestyle() not in ("None", "none", " ", "") and len(whole) > 2
        if is_curve and line.get_visible() and not hasattr(axes, "get_zlim"):
            found.append((line, whole))
    return found


def curves(_, several):
    """Few curves, of which none hides another."""
    for k, axes in enumerate(several):
        found = drawn_curves(axes)
        if len(found) > CURVES:
            yield f"panel {k} has {len(found)} curves"
            continue
        for (one, path), (other, second) in combinations(found, 2):
            alike = one.get_linestyle() == other.get_linestyle() and not (
                one.get_marker() not in ("None", None) or other.get_marker() not in ("None", None)
            )
            if alike and coincide(path, second) and coincide(second, path):
                yield f"two curves of panel {k} coincide: {one.get_label()}, {other.get_label()}"


def coincide(path, other):
    """Whether all points of a path lie on another one, whose points go from left to right."""
    if (np.diff(other[:, 0]) <= 0).any():
        return len(path) == len(other) and np.abs(path - other).max() < SAME
    y = np.interp(path[:, 0], *other.T, left=np.inf, right=np.inf)
    return bool(np.all(np.abs(y - path[:, 1]) < SAME))


def legends(figure, several):
    """Curves are named where they are, and what explains the rest covers no data."""
    for k, axes in enumerate(several):
        if (legend := axes.get_legend()) is None:
            continue
        box = legend.get_window_extent(figure.canvas.get_renderer())
        for path in covered(axes):
            if passes(path, box):
                yield f"the legend of panel {k} lies over data"
                break
        if len(drawn_curves(axes)) > 1:
            yield f"curves of panel {k} are named in a legend, not where they are"


def covered(axes):
    """What a legend must not cover, in pixels: lines and points."""
    for line in axes.lines:
        yield line.get_transform().transform(np.column_stack(line.get_data()).astype(float))
    for one in axes.collections:
        offsets = np.asarray(one.get_offsets(), dtype=float)
        if len(offsets) > 1:
            yield from (
                one.get_offset_transform().transform(offsets)[[k, k]] for k in range(len(offsets))
            )


def passes(path, box):
    """Whether a path goes through a box."""
    path = path[np.isfinite(path).all(axis=1)]
    if len(path) == 1:
        return bool(box.contains(*path[0]))
    for start, end in pairwise(path):
        points = start + np.linspace(0, 1, 33)[:, None] * (end - start)
        inside = (points > box.min) & (points < box.max)
        if inside.all(axis=1).any():
            return True
    return False


def contrast(one, other):
    """Ratio of the relative luminances of two colours, of which the first may let the other show
    through (WCAG 2, 1.4.3)."""
    *one, alpha = to_rgba(one)
    other = np.array(to_rgb(other))
    both = np.stack([alpha * np.array(one) + (1 - alpha) * other, other])
    linear = np.where(both <= 0.04045, both / 12.92, ((both + 0.055) / 1.055) ** 2.4)
    low, high = sorted(linear @ [0.2126, 0.7152, 0.0722])
    return (high + 0.05) / (low + 0.05)


def colours(figure, several):
    """Curves, marks and texts stand out from what is behind them."""
    faint = {}
    for k, axes in enumerate(several):
        behind = axes.get_facecolor() if axes.axison else figure.get_facecolor()
        behind = behind if to_rgba(behind)[3] else figure.get_facecolor()
        found = [(line.get_color(), line.get_alpha(), line) for line, _ in drawn_curves(axes)]
        for line in axes.lines:
            if line.get_marker() not in ("None", None, "", " ") and line.get_visible():
                edge, face = line.get_markeredgecolor(), line.get_markerfacecolor()
                edge = edge if line.get_markeredgewidth() > 0 else face
                best = max((edge, face), key=lambda one: contrast(one, behind))
                found.append((best, line.get_alpha(), line))
        for points in axes.collections:
            if isinstance(points, PathCollection):
                for face, edge in zip_longest(points.get_facecolors(), points.get_edgecolors()):
                    both = [one for one in (face, edge) if one is not None]
                    best = max(both, key=lambda one: contrast(one, behind), default=None)
                    found += [(best, points.get_alpha(), points)] if best is not None else []
        for colour, alpha, artist in found:
            ratio = contrast(to_rgba(colour, alpha), behind)
            if ratio < CONTRAST:
                faint.setdefault((k, to_hex(colour)), (ratio, artist.get_label()))
    for (k, colour), (ratio, label) in faint.items():
        yield f"{colour} in panel {k} has a contrast of {ratio:.1f}: {label}"
    for one, _ in texts(figure):
        patch = one.get_bbox_patch()
        held = [] if one.axes is None else [*one.axes.images, *one.axes.patches]
        held += [] if one.axes is None else [*one.axes.findobj(QuadMesh)]
        plain = not held  # what lies behind is one colour
        behind = patch.get_facecolor() if patch else "white"
        if (patch or plain) and (ratio := contrast(one.get_color(), behind)) < CONTRAST:
            yield f"{one.get_text()!r} has a contrast of {ratio:.1f}"


def overlaps(figure, _):
    """Texts that touch, or run out of the picture."""
    found = texts(figure)
    width, height = figure.canvas.get_width_height()
    for one, box in found:
        if box.x0 < -TOUCH or box.y0 < -TOUCH or box.x1 > width + TOUCH or box.y1 > height + TOUCH:
            yield f"{one.get_text()!r} runs out of the picture"
    for (one, box), (other, second) in combinations(found, 2):
        across = min(box.x1, second.x1) - max(box.x0, second.x0)
        along = min(box.y1, second.y1) - max(box.y0, second.y0)
        if min(across, along) > TOUCH and not (
            one.get_rotation() % 90 or other.get_rotation() % 90
        ):
            yield f"{one.get_text()!r} touches {other.get_text()!r}"
