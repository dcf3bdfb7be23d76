"""The largest Lyapunov exponent of a conservative scene.

A perturbation du, dv of a motion follows its tangent, du' = dv, M dv' = -K(u) du.  The reverse loop
of `tensegrity.engine.reverse` propagates derivatives by u and v back through a run; through the
steps of a symmetric splitting taken with a negative dt it goes on in time, and as these steps are
symplectic, the derivatives (a, b) by u and v are the perturbation (M^-1 b, -M^-1 a) itself.  So one
pass computes the motion and its tangents, with the forces of a run and their stiffnesses.
Source: G. Benettin, L. Galgani, A. Giorgilli & J.-M. Strelcyn, Meccanica 15, 9 and 21 (1980).
"""

from __future__ import annotations

import math
from dataclasses import dataclass, field
from types import SimpleNamespace
from typing import TYPE_CHECKING, Any

import numpy as np

from tensegrity import check, plotting
from tensegrity.checked import checked
from tensegrity.engine.bound import stages
from tensegrity.engine.methods import METHODS
from tensegrity.engine.reverse import Layout, ReverseLoop, Totals
from tensegrity.errors import StabilityError, TensegrityError
from tensegrity.printing import Lines, Printed, drawn
from tensegrity.runs.integrate import simulate
from tensegrity.runs.problem import step_count
from tensegrity.runs.record import Record
from tensegrity.scenes.dynamics import dynamics
from tensegrity.scenes.forcing import refuse_driven
from tensegrity.scenes.scene import Scene, State
from tensegrity.typing import Array, Count, Duration, Index
from tensegrity.unit_names import in_units

if TYPE_CHECKING:
    from matplotlib.axes import Axes

METHOD: Any = METHODS["rkn6"]
TANGENTS = 1  # by default
BLOCK = 500  # steps after which tangents are brought to length 1
ROWS = 100  # most times that are stored by default
PART = 0.5  # of the step of a plain run, by default
OFF = 1e-3  # largest change of the energy over the energy


@dataclass(frozen=True, eq=False, repr=False)
class Lyapunov(Printed):
    """Growth of perturbations of a motion; the result of `lyapunov`.

    Attributes
    ----------
    t : ndarray, (T,)
        [s], without 0.
    exponents : ndarray, (T, tangents)
        ln |d(t)|/|d(0)| over t of each perturbation d = (du, dv), in m and m/s [1/s].
    frequency : float
        Bound on the angular frequency at the start [rad/s].
    energy_error : float
        Largest change of the energy over the energy at the start, or the kinetic one.
    dt : float
        Step [s].
    final : State
        State at the end.
    """

    t: Array
    exponents: Array
    frequency: float
    energy_error: float
    dt: float
    final: State = field(repr=False)

    _draw = drawn

    @property
    def exponent(self) -> float:
        """Mean over the tangents at the end [1/s]."""
        return float(self.exponents[-1].mean())

    @property
    def spread(self) -> float:
        """The largest of the deviations of tangents from their mean, and half the difference
        between the growths in both halves of the time [1/s]."""
        middle = max(int(np.searchsorted(self.t, self.t[-1] / 2)), 0)
        last, ends = self.t[-1], self.exponents[-1]
        first = self.exponents[middle] * self.t[middle]
        late = (ends * last - first) / (last - self.t[middle]) if middle < len(self.t) - 1 else ends
        halves = np.abs(late - first / self.t[middle]) / 2
        return float(max(np.abs(ends - ends.mean()).max(), halves.mean()))

    @property
    def regular(self) -> float:
        """ln(1 + w t)/t with the bound w on the frequency [1/s]: perturbations of a regular motion
        grow like t, so that an exponent that is not above this says nothing of chaos."""
        return math.log1p(self.frequency * self.t[-1]) / float(self.t[-1])

    def _lines(self) -> Lines:
        digits = max(1 - math.floor(math.log10(abs(self.exponent) or 1.0)), 0)
        value = f"{self.exponent:.{digits}f} 1/s, spread {self.spread:.1g} 1/s"
        yield f"largest Lyapunov exponent {value}, over {self.t[-1]:g} s"
        if self.exponent <= self.regular:
            yield f"not above {self.regular:.2g} 1/s, that of a regular motion over this time"
        yield (
            f"{self.exponents.shape[1]} tangents, dt = {self.dt:.4g} s, "
            f"energy within {self.energy_error:.1e}"
        )

    def plot(self, ax: Axes | None = None) -> Axes:
        """Exponents over time, both logarithmic, and that of a regular motion.

        Parameters
        ----------
        ax : matplotlib.axes.Axes, optional
            By default of a new figure.

        Returns
        -------
        matplotlib.axes.Axes
        """
        axes: Axes = plotting.axes(ax)
        axes.loglog(self.t, np.where(self.exponents > 0, self.exponents, np.nan))
        axes.loglog(self.t, np.log1p(self.frequency * self.t) / self.t, ":", color="0.5")
        axes.set(xlabel=in_units("time [s]"), ylabel=in_units("exponent [1/s]"))
        return axes


@checked
def lyapunov(
    scene: Scene,
    state: State,
    t_end: Duration,
    *,
    dt: Duration | None = None,
    every: Count | None = None,
    tangent: State | None = None,
    seed: Index = 0,
) -> Lyapunov:
    """Largest Lyapunov exponent: the rate at which perturbations of a motion grow.

    Parameters
    ----------
    scene : Scene
        Neither driven nor damped, with a fixed list of contacts; not an ensemble.
    state : State
        Where the motion starts.
    t_end : float
        Duration [s].
    dt : float, optional
        Step [s] of a method of order 6; by default half of that of `simulate`.
    every : int, optional
        Number of steps between two stored rows; by default 100 rows at most.
    tangent : State, optional
        Initial perturbation; by default a random one, with `seed`.
    seed : int, optional

    Returns
    -------
    Lyapunov
        Over short times the exponent is a number of the motion and the perturbation, reproducible
        to the digits that e^(exponent t) times round-off leaves; where contacts open, to 4 or 5.
        Over long times it is a statistic: two digits and a spread.

    Raises
    ------
    TensegrityError
        Bad input, a driven or damped scene, springs without a second derivative, or no
        perturbation.
    StabilityError
        The energy is not conserved to 1e-3: a smaller dt is needed.

    Examples
    --------
    Eight masses between walls, whose springs stiffen:

    >>> import sympy as sp
    >>> from tensegrity import Chain, Potential, lyapunov
    >>> r = sp.Symbol("r")
    >>> chain = Chain(Potential(r**2 / 2 + r**4 / 4, r), 10, ends=("fixed", "fixed"))
    >>> found = lyapunov(chain, chain.at_rest({1: 2.0}), 2000.0)
    >>> 0.01 < found.exponent < 0.04 and found.exponent > found.regular
    True
    """
    of: Any = dynamics(scene)
    scene.check(state)
    if not isinstance(scene, Scene) or of.follows:
        raise TensegrityError("contacts of the scene must be 'fixed' for tangents")
    refuse_driven(scene, "a Lyapunov exponent")
    if dt is None:
        trial = simulate(scene, state, t_end, method="rkn6", record=Record(every=10**9))
        dt = PART * trial.dt
    steps = max(1, step_count(SimpleNamespace(t_end=t_end), dt))
    dt = t_end / steps
    every = max(1, -(-steps // ROWS)) if every is None else every
    frequency = float(of.frequency(of.ranges_at(state.u)))
    mass = np.broadcast_to(scene.mass.reshape(scene.sites, -1), (scene.sites, scene.dim)).copy()
    moving = 1 / mass
    moving[list(scene.held)] = 0.0
    start = _tangents(scene, tangent, seed)
    layout = Layout(of.loop_bonds, ((),) * len(of.loop_bonds.laws))
    loop = ReverseLoop(layout, METHOD, -dt, Totals(layout, len(start)))
    sites = layout.sites
    by_u, by_v = (x[:, :sites].reshape(len(start), sites, -1) for x in (loop.ub, loop.vb))
    loop.set(state.u, state.v)
    by_v[:], by_u[:] = mass * start[:, 0], -mass * start[:, 1]
    energy, grown, done = scene.energy(state), np.zeros(len(start)), 0
    scale = max(abs(energy), float(of.kinetic(state.v).sum()))
    off, t, rows = 0.0, [], []
    while done < steps:
        stop = min(done + every, steps)
        while done < stop:
            some = min(BLOCK, stop - done)
            _go(loop, some, -dt)
            done += some
            moves = np.sum((by_v * moving) ** 2 + (by_u * moving) ** 2, axis=(1, 2))
            size = np.sqrt(moves)  # derivatives by the places of held sites do not count
            by_u /= size[:, None, None]
            by_v /= size[:, None, None]
            grown = grown + np.log(size)
        u, v = (x.reshape(1, *scene.shape) for x in _finite(loop.state(), done * dt))
        off = max(off, abs(float(of.energies(u, v)[0]) - energy))
        if off > OFF * (scale or 1.0):
            raise StabilityError(
                f"dt {dt:.6g} s is too large: at t = {done * dt:.6g} s the energy is off by "
                f"{off:.3g} J of {scale:.6g} J"
            )
        t.append(done * dt)
        rows.append(grown / t[-1])
    return Lyapunov(
        np.array(t), np.array(rows), frequency, off / (scale or 1.0), dt, State(u[0], v[0])
    )


def _go(loop: ReverseLoop, steps: int, dt: float) -> None:
    """Undo so many steps: the closing kick of the last one, which these lack, and then these."""
    scene, usual = loop.scene, stages(METHOD, dt)
    if usual["closing"]:
        scene.filled["kicks"][0], scene.filled["drifts"][0] = usual["kicks"][-1], 0.0
        scene.stages, scene.closing = 1, 0
        loop.reverse(1, 1, opened=False)
        scene.filled["kicks"][0], scene.filled["drifts"][0] = usual["kicks"][0], usual["drifts"][0]
        scene.stages, scene.closing = usual["stages"], 1
    loop.reverse(steps, steps, opened=False)


def _finite(state: tuple[Array, Array], t: float) -> tuple[Array, Array]:
    """A state, unless it is not finite."""
    if not all(np.isfinite(x).all() for x in state):
        raise StabilityError(f"the motion is not finite at t = {t:.6g} s: a smaller dt is needed")
    return state


def _tangents(scene: Scene, tangent: State | None, seed: int) -> Array:
    """Perturbations of length 1, of u and then v, (tangents, 2, sites, dim); 0 where held."""
    if tangent is None:
        given = np.random.default_rng(seed).normal(size=(TANGENTS, 2, scene.sites, scene.dim))
    else:
        check.kind("tangent", tangent, State)
        if tangent.u.shape != scene.shape:
            raise TensegrityError(f"tangent has shape {tangent.u.shape}, must be {scene.shape}")
        given = np.stack([tangent.u, tangent.v])[None].reshape(1, 2, scene.sites, scene.dim)
    given[:, :, list(scene.held)] = 0.0
    size = np.sqrt(np.sum(given**2, axis=(1, 2, 3)))
    if not size.all():
        raise TensegrityError("tangent is 0 at all sites that move: no perturbation")
    made: Array = given / size[:, None, None, None]
    return made
