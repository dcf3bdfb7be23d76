"""A whole branch in one call of compiled code: the caller of `follow.c`."""

from __future__ import annotations

import ctypes

import numpy as np

from tensegrity.branches.arclength import virtual_start

ROOM = 256  # rows, at first
MANY = "{} rows do not reach an end"
SHORT = "the step fell below {:g}"
BIFURCATION = "bifurcation"
ENDED, FULL, TOO_MANY, TOO_SHORT, NEEDED = range(5)  # what `follow` returns


class _Call(ctypes.Structure):
    """As `branch` in follow.c."""

    _fields_ = (
        [(name, ctypes.c_void_p) for name in
         "p settings stop newton rows events before here signs kinds places".split()]
        + [("step", ctypes.c_double)]
        + [(name, ctypes.c_longlong) for name in
           "points room events_room count found next kind".split()]
    )  # fmt: skip


def followed(machine, here, p, settings, stop):
    """The rows of a branch from a point, its events as (kind, row, numbers), and the kind of
    event, or the failure, that ends it."""
    kinds, step = machine.kinds, min(settings.first, settings.largest)
    size = machine.judged + 3 + len(kinds)
    most = 2 * len(kinds) + (len(machine.folds) + 1) * len(machine.roots) + 1  # between two looks
    names = "tolerance residual smallest largest turn".split()
    newton = (ctypes.c_void_p * (len(kinds) + 1))(*machine.addresses)
    before, now = virtual_start(here, step).numbers, here.numbers
    now[machine.judged + 1] = step
    numbers = {
        "p": np.array(p),
        "settings": np.array([getattr(settings, name) for name in names]),
        "stop": np.array([kind in stop for kind in kinds], dtype=np.int64),
        "before": np.concatenate([before, np.zeros(size - len(before))]),
        "here": now,
        "signs": np.array(here.tests),
    }
    call = _Call(step=step, points=settings.points, count=1, newton=ctypes.addressof(newton))
    rows, events = np.empty((min(ROOM, settings.points + 1), size)), np.empty((4 * most, size))
    rows[0] = here.numbers
    places = np.empty((2, len(events)), dtype=np.int64)
    for name, array in numbers.items():
        setattr(call, name, array.ctypes.data)
    while True:
        call.rows, call.events = rows.ctypes.data, events.ctypes.data
        call.kinds, call.places = places[0].ctypes.data, places[1].ctypes.data
        call.room, call.events_room = len(rows), len(events)
        answer = machine.functions.library.follow(ctypes.byref(call))
        if answer == FULL:
            rows, events = (np.concatenate([x, np.empty_like(x)]) for x in (rows, events))
            places = np.concatenate([places, np.empty_like(places)], axis=1)
        elif answer == NEEDED:
            newton[call.kind] = machine.address(kinds[call.kind])
        else:
            break
    found, named = call.found, (*kinds, BIFURCATION)
    listed = [
        (named[kind], row, numbers)
        for kind, row, numbers in zip(*places[:, :found].tolist(), events[:found], strict=True)
    ]
    ends = {TOO_MANY: MANY.format(settings.points), TOO_SHORT: SHORT.format(settings.smallest)}
    end = kinds[call.kind] if answer == ENDED else ends[answer]
    return rows[: call.count].copy(), listed, end
