"""Observers that a user gives to a run: functions of the time and the state."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from typing import TYPE_CHECKING, Any, TypeAlias

from tensegrity import check
from tensegrity.errors import TensegrityError
from tensegrity.runs.record import OutputStates, Record

if TYPE_CHECKING:
    from typing import TypeAlias

    from tensegrity.typing import Array

    ObserverFunction: TypeAlias = Callable[[float, Array, Array], Any]
    Observe: TypeAlias = (
        ObserverFunction
        | tuple[ObserverFunction, Record]
        | Sequence[ObserverFunction | tuple[ObserverFunction, Record]]
    )


class UserObserver(OutputStates):
    """Observer that calls a user's function with the states at some instants.

    Parameters
    ----------
    function : callable (t, u, v)
    record : Record
        The instants.
    """

    def __init__(self, function: ObserverFunction, record: Record, *rest: Any) -> None:
        super().__init__(record, *rest)
        self.function = function

    def ends(self, motion: Any, k: int) -> str | None:
        """Call the function at the instant number k; the reason why the run ends there, or None."""
        self.last = self.state(motion, k)
        for array in self.last[:2]:
            array.flags.writeable = False
        u, v = (array.view() for array in self.last[:2])  # which cannot be made writeable
        self.count, t, self.failed = k + 1, self.time(k), False
        name = getattr(self.function, "__name__", type(self.function).__name__)
        try:
            return f"{name} ended the run at t = {t:.6g} s" if self.function(t, u, v) else None
        except Exception as error:
            self.failed = True
            return f"{name} raised {check.shown(error)} at t = {t:.6g} s"

    def step(self, k: int) -> int:
        """Number of whole steps up to the instant number k."""
        return int(self._plan.step[k])


def user_observers(observe: Any, record: Record, scene: Any, t_end: float) -> tuple[Any, ...]:
    """Pairs of a function and its record, from the argument `observe` of `simulate`.

    Parameters
    ----------
    observe : callable, (callable, Record), a sequence of these, or None
    record : Record
        Instants of functions that have no record of their own.
    scene : Scene
    t_end : float
        Duration of the run [s].

    Returns
    -------
    tuple of (callable, Record)

    Raises
    ------
    TensegrityError
        Not a function, not a record, or a record that says more than instants.
    """
    if observe is None:
        return ()
    one = callable(observe) or (
        isinstance(observe, tuple) and len(observe) == 2 and isinstance(observe[1], Record)
    )
    pairs = []
    for given in [observe] if one else check.sequence("observe", observe, "functions"):
        function, when = given if isinstance(given, tuple) and len(given) == 2 else (given, None)
        if not callable(function):
            raise TensegrityError(
                f"observe {check.shown(function)} is not a function (t, u, v), nor it and a Record"
            )
        if when is not None:
            check.kind("record of an observer", when, Record)
            for name in ("sites", "path", "checkpoint"):
                if getattr(when, name) is not None:
                    raise TensegrityError(
                        f"{name} in an observer's record: it gives instants only, of all sites"
                    )
            when.check(scene.sites, t_end)
        pairs.append((function, record.instants if when is None else when))
    return tuple(pairs)
