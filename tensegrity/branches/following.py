"""A whole branch in one call of compiled code: the caller of `follow.c`."""

from __future__ import annotations

import ctypes

import numpy as np

ROOM = 256  # rows, at first
MANY = "{} rows do not reach an end"
SHORT = "the step fell below {:g}"
BIFURCATION = "bifurcation"
ENDED, FULL, TOO_MANY, TOO_SHORT, NEEDED, REFUSED = range(6)  # what `follow` returns
BEGIN, STEP = range(2)


ARRAYS = ("p", "settings", "stop", "newton", "rows", "events", "before", "here", "signs", "kinds")
COUNTS = ("points", "room", "events_room", "count", "found", "next", "kind", "direction")


class _Call(ctypes.Structure):
    """As `branch` in follow.c."""

    _fields_ = (
        [(name, ctypes.c_void_p) for name in (*ARRAYS, "places")]
        + [("step", ctypes.c_double)]
        + [(name, ctypes.c_longlong) for name in COUNTS]
    )


def followed(machine, z, p, settings, direction, stop):
    """A branch from next to a point.

    Parameters
    ----------
    machine : Machine
        Compiled.
    z, p : ndarray, (m,), (k,)
    settings : Settings
    direction : {1, -1}
    stop : collection of str

    Returns
    -------
    tuple, or None where the start needs more care
        Rows and events, (n, size) each; for each event its kind and its row; and the kind of
        event, or the failure, that ends the branch.
    """
    kinds, size, k = machine.kinds, machine.size, len(p)
    most = 2 * len(kinds) + (len(machine.folds) + 1) * len(machine.roots) + 1  # between two looks
    newton = (ctypes.c_void_p * (len(kinds) + 1))(*machine.addresses)
    stops = (ctypes.c_longlong * (len(kinds) + 1))(*(kind in stop for kind in kinds))
    # parameters, settings, two points and signs side by side: an address is asked for once
    block = np.empty(k + 5 + 3 * size)
    block[:k] = p
    block[k : k + 5] = (
        settings.tolerance,
        settings.residual,
        settings.smallest,
        settings.largest,
        settings.turn,
    )
    block[k + 5 + size : k + 5 + size + machine.m] = z
    at = block.ctypes.data
    at_points = at + 8 * (k + 5)
    call = _Call(
        p=at, settings=at + 8 * k, before=at_points, here=at_points + 8 * size,
        signs=at_points + 16 * size, stop=ctypes.addressof(stops),
        newton=ctypes.addressof(newton), step=min(settings.first, settings.largest),
        points=settings.points, direction=direction,
    )  # fmt: skip
    rows, events = np.empty((min(ROOM, settings.points + 1), size)), np.empty((4 * most, size))
    places = np.empty((2, len(events)), dtype=np.int64)
    while True:
        call.rows, call.events, call.kinds = (
            rows.ctypes.data,
            events.ctypes.data,
            places.ctypes.data,
        )
        call.places = call.kinds + 8 * len(events)
        call.room, call.events_room = len(rows), len(events)
        answer = machine.library.follow(ctypes.byref(call))
        if answer == FULL:
            rows, events = (np.concatenate([x, np.empty_like(x)]) for x in (rows, events))
            places = np.concatenate([places, np.empty_like(places)], axis=1)
        elif answer == NEEDED:
            newton[call.kind] = machine.address(kinds[call.kind])
        else:
            break
    if answer == REFUSED:
        return None
    found, named = call.found, (*kinds, BIFURCATION)
    if answer == ENDED:
        end = kinds[call.kind]
    else:
        full = answer == TOO_MANY
        end = MANY.format(settings.points) if full else SHORT.format(settings.smallest)
    listed = [(named[kind], row) for kind, row in zip(*places[:, :found].tolist(), strict=True)]
    return rows[: call.count].copy(), events[:found], listed, end
