"""The objective of a design: the largest force on a wall, of a batch of chains or of any scene.

Chains with the same number of beads run as one batch in a compiled loop, each with its own masses
and contacts.  The result of a chain does not depend on the others in the batch, to the bit, so that
the force of a design is independent of how a list of designs is divided.

Displacement and velocity of the last bead are recorded at each step.  Where its velocity changes
sign its overlap with the wall has a maximum, which is located on the cubic through the values and
slopes at both steps: maxima between the steps are included.

The step is the fraction `STEP_FRACTION` of the time unit of an impact, (m^2/(alpha^2 v))^(1/5), of
the fastest contact that the beads of a design could make in any order.  With it the force is
within 1e-4 of its limit for steel beads of 4 and 10 mm, and with twice the step within 1e-3;
errors are typically a hundred times smaller.  Late maxima, after many collisions, have larger
errors, which chaos amplifies: 1e-2 was observed in chains of soft and hard beads; `search`
therefore verifies its
result with finer steps.  Any other scene of beads, built from a design by a function, is run on
its own (`wall_peak`).
Source: the talk, part II, "Hertz interaction potentials".
"""

from __future__ import annotations

import math
from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass
from typing import Any, NamedTuple

import numpy as np

from granular.beads import Bead, Material, Striker, beads_of
from granular.contact_network import wall_sites
from granular.design.scatter import Scatter
from granular.design.spaces import Designs, Space
from granular.observables import wall_force
from tensegrity import METHODS, PowerLaw, Record, TensegrityError, check, largest_peak, simulate
from tensegrity.checked import checked
from tensegrity.engine import kernel, native
from tensegrity.engine.bonds import Bonds
from tensegrity.engine.march import Wanted
from tensegrity.typing import Array, Duration

METHOD: Any = METHODS["rkn6"]
EXPONENT = 1.5  # of Hertz's law; `granular.contact` derives it
STEP_FRACTION = 0.25  # of the time unit of the fastest contact
PER_DOUBLING = 4  # step counts per factor of 2: chains of equal counts run together
BATCH = 8  # chains in one compiled loop; wider batches are no faster
CHUNK = 512  # steps for which the last bead's motion is stored at a time
MOST = 10**8  # steps
PATIENCE = 1000  # windows that are searched for the arrival of a wave
PART = 16  # chains that one worker is given

Build = Callable[[Sequence[Bead]], tuple[Any, str]]


class Peaks(NamedTuple):
    """Peak forces on the wall.

    Attributes
    ----------
    force : ndarray, (designs,)
        Largest [N].
    first : ndarray, (designs,)
        Time of the maximum of the first pulse [s]; inf if it had none yet.
    """

    force: Array
    first: Array


@checked
def peak_force(
    beads: Sequence[Bead] | Sequence[Sequence[Bead]],
    *,
    striker: Striker,
    wall: Material,
    t_end: Duration,
    dt: Duration | None = None,
) -> float | Array:
    """Largest force on the wall behind a chain of touching beads.

    Parameters
    ----------
    beads : sequence of Bead, or sequence of such sequences
        A design in the order of the axis, from the struck end to the wall; or several.
    striker : Striker
        In contact with the first bead, moving; it may separate.
    wall : Material
        Of the plane wall that the last bead touches.
    t_end : float
        Time after the impact [s], > 0.
    dt : float, optional
        Step [s], > 0, of "rkn6"; shortened so that steps end at `t_end`.  By default such that
        the force is right to 1e-4, see `granular.design.objective`.

    Returns
    -------
    float, or ndarray (designs,)
        [N], > 0, the maxima between the steps included.

    Raises
    ------
    TensegrityError
        Arguments of another type; a wave that does not arrive before `t_end`.
    CompilerError
        No C compiler.

    Examples
    --------
    >>> from granular import Bead, Striker, materials
    >>> steel = materials["steel"]
    >>> big, small = Bead(10e-3, steel), Bead(4e-3, steel)
    >>> stepped = [big] * 10 + [small] * 10
    >>> f = peak_force(stepped, striker=Striker(big, 0.44), wall=steel, t_end=1e-3)
    >>> print(f"{f:.3f}")
    57.664
    """
    chains, single = checked_beads(beads)
    native.require()
    forces = np.empty(len(chains))
    for steps, members in _by_step_count(chains, striker, wall, t_end, dt):
        mine = [chains[k] for k in members]
        peaks = largest(Designs.of(mine), striker, wall, t_end, steps)
        if np.isinf(peaks.first).any():
            number = int(np.argmax(peaks.first))
            late = Designs.of([mine[number]])
            raise not_arrived(members[number], late, striker, wall, t_end)
        forces[members] = peaks.force
    return float(forces[0]) if single else forces


def checked_beads(beads: Any) -> tuple[list[tuple[Bead, ...]], bool]:
    """Designs as tuples of beads, and whether it was one only."""
    if isinstance(beads, Bead) or not isinstance(beads, Sequence) or not len(beads):
        raise TensegrityError(f"beads {check.shown(beads)} are not a sequence of Beads")
    single = isinstance(beads[0], Bead)
    chains: list[tuple[Bead, ...]] = []
    for number, chain in enumerate([beads] if single else beads):
        where = "" if single else f" of design {number}"
        if not isinstance(chain, Sequence) or not len(chain):
            raise TensegrityError(f"design {number} is {check.shown(chain)}, not a row of Beads")
        chains.append(beads_of(chain, where))
    return chains, single


def step_count(unit: float, t_end: float, dt: float | None) -> int:
    """Number of steps to `t_end`.

    Parameters
    ----------
    unit : float
        Time unit of the fastest contact [s].
    t_end : float
        [s], > 0.
    dt : float or None
        Largest step [s], at most `unit`.  None: the default step, with the number of steps rounded
        up such that many designs have the same number and run in one batch.

    Returns
    -------
    int
        >= 1.

    Raises
    ------
    TensegrityError
        A step above `unit`, or more steps than `MOST`.
    """
    if dt is not None and dt > unit:
        raise TensegrityError(
            f"dt {dt:g} s must be at most {unit:g} s, the time unit of the fastest contact"
        )
    wanted = t_end / (STEP_FRACTION * unit if dt is None else dt)
    if not wanted <= MOST:
        raise TensegrityError(
            f"t_end {t_end:g} s takes {wanted:.3g} steps, must be at most {MOST:g}"
        )
    if dt is None:
        wanted = 2 ** (math.ceil(PER_DOUBLING * math.log2(max(wanted, 1.0))) / PER_DOUBLING)
    return max(math.ceil(wanted), 1)


def _by_step_count(
    chains: Sequence[Sequence[Bead]],
    striker: Striker,
    wall: Material,
    t_end: float,
    dt: float | None,
) -> Iterator[tuple[int, list[int]]]:
    """Step counts, and the numbers of the chains of one length with each count."""
    sets: dict[tuple[int, int], list[int]] = {}
    units: dict[frozenset[Bead], float] = {}
    for number, chain in enumerate(chains):
        kinds = frozenset((striker.bead, *chain))
        if kinds not in units:
            units[kinds] = float(Designs.of([list(kinds)]).unit(wall, striker.speed)[0])
        steps = step_count(units[kinds], t_end, dt)
        sets.setdefault((len(chain), steps), []).append(number)
    for (_, steps), numbers in sets.items():
        yield steps, numbers


def largest(
    designs: Designs,
    striker: Striker,
    wall: Material,
    t_end: float,
    steps: int,
    gaps: Array | float = 0.0,
    speed: Array | None = None,
) -> Peaks:
    """Largest force of each design on the wall, and the instant of the first maximum.

    Parameters
    ----------
    designs : Designs
    striker : Striker
    wall : Material
    t_end : float
        [s], > 0.
    steps : int
    gaps : ndarray, (designs, contacts), optional
        Initial separations [m], >= 0, that of the striker first.
    speed : ndarray, (designs,), optional
        Of the striker [m/s]; by default its own.

    Returns
    -------
    Peaks
        Arrays (designs,).
    """
    peaks, moving, count = [], None, len(designs)
    gaps = np.broadcast_to(gaps, (count, designs.mass.shape[1] + 1))
    speed = np.broadcast_to(striker.speed if speed is None else speed, count)
    for done in range(0, count, BATCH):
        some = np.minimum(np.arange(done, done + BATCH), count - 1)
        batch = designs[some]
        beads = batch.behind(striker.bead)
        contacts = np.ascontiguousarray(beads.contacts(wall).T)
        moving = moving or _Moving(len(contacts), BATCH, t_end / steps)
        moving.start(contacts, 1 / beads.mass.T, speed[some], gaps[some].T)
        peaks.append(_peaks(moving, contacts[-1], steps))
    return Peaks(*(np.concatenate(x)[: len(designs)] for x in zip(*peaks, strict=True)))


def _peaks(moving: _Moving, wall_contact: Array, steps: int) -> Peaks:
    """The same for the chains of one loop, from their start."""
    dt, overlap = moving.dt, np.zeros(wall_contact.size)
    first = np.full(overlap.shape, math.inf)
    for done in range(0, steps, CHUNK):
        u, v = moving.follow(min(CHUNK, steps - done))
        step, chain = np.nonzero((v[:-1] > 0) & (v[1:] <= 0))
        ends = u[step, chain], u[step + 1, chain], dt * v[step, chain], dt * v[step + 1, chain]
        fraction, top = _largest(*ends)
        np.maximum.at(overlap, chain, top)
        np.minimum.at(first, chain, (done + step + fraction) * dt)
    return Peaks(wall_contact * np.maximum(overlap, u[-1]) ** EXPONENT, first)


class _Moving:
    """Chains in motion, of which the last bead is followed.

    Sites are numbered from the wall, so that those recorded at all steps come first.  A compiled
    loop merges the closing kick of a step with the next one; its contribution to the last bead's
    velocity is added from the bead's two contacts.
    """

    def __init__(self, count: int, chains: int, dt: float) -> None:
        self.dt, self._law = dt, PowerLaw(1.0, EXPONENT).law
        self._table = np.zeros((count * chains, len(self._law.parameters)))  # 0: no preload
        self._springs = np.arange(count * chains).reshape(count, chains)
        self._weights = np.zeros((count + 1, chains))  # the wall is held
        self._u, self._v = np.zeros((2, count + 1, chains))

    def start(self, contacts: Array, weights: Array, speed: Array, gaps: Array) -> None:
        """Start other chains.

        Parameters
        ----------
        contacts : ndarray, (count, chains)
            Constants of the contacts, the wall's last [N/m^1.5].
        weights : ndarray, (count, chains)
            Inverse masses, the striker's first [1/kg].
        speed : ndarray, (chains,)
            Of the striker [m/s].
        gaps : ndarray, (count, chains)
            Initial separations in the contacts [m], >= 0.
        """
        self._table[:, 0] = contacts[::-1].ravel()
        self._weights[1:] = weights[::-1]
        self._u[1:], self._v[:] = np.cumsum(gaps[::-1], axis=0), 0
        self._v[-1] = -speed
        kinds, self._done = np.zeros(self._springs.size, dtype=int), 0
        bonds = Bonds((self._law,), kinds, self._table.copy(), self._springs, self._weights)
        if not hasattr(self, "_loop"):
            self._loop = kernel.bind(self._u, self._v, bonds, METHOD, self.dt)
            self._kick = METHOD.kicks[-1] * self.dt  # nothing was left at the start
        self._loop.retune(bonds)

    def follow(self, steps: int) -> tuple[Array, Array]:
        """Displacement and velocity of the last bead before and after each of the next steps."""
        u, v = np.empty((2, steps + 1, 3, self._weights.shape[1]))  # of wall and last two beads
        u[0], v[0] = self._u[:3], self._v[:3]
        at, end = self._done + np.arange(1, steps + 1), self._done + steps
        self._loop.go(self._done, end, [Wanted(at, u[1:], v[1:], raw=True)])
        self._done = end
        last, before = -u[:, 1], -u[:, 2]
        squeeze, pull = np.maximum(before - last, 0.0), np.maximum(last, 0.0)
        near, far = self._table[:, 0].reshape(self._springs.shape)[:2]
        push = far * squeeze * np.sqrt(squeeze) - near * pull * np.sqrt(pull)  # `EXPONENT`
        return last, self._kick * self._weights[1] * push - v[:, 1]


def _largest(start: Array, stop: Array, rise: Array, fall: Array) -> tuple[Array, Array]:
    """Place in a step, from 0 to 1, and value of the maximum of the cubic with these values and
    slopes times the step; the first slope is > 0, the second <= 0."""
    gain = stop - start
    bend, twist = 3 * gain - 2 * rise - fall, rise + fall - 2 * gain
    share = rise / (np.sqrt(np.maximum(bend**2 - 3 * twist * rise, 0.0)) - bend)
    share = np.clip(share, 0.0, 1.0)
    return share, start + share * (rise + share * (bend + share * twist))


def not_arrived(
    number: int, design: Designs, striker: Striker, wall: Material, t_end: float
) -> TensegrityError:
    """The error for a wave that does not arrive in time, which states when it would.

    Parameters
    ----------
    number : int
        Of the design, for the message.
    design : Designs
        That design alone.
    striker : Striker
    wall : Material
    t_end : float
        [s], > 0.

    Returns
    -------
    TensegrityError
    """
    unit = float(design.behind(striker.bead).unit(wall, striker.speed)[0])
    longer, when = t_end, ""
    while longer < PATIENCE * t_end and longer / unit < MOST / 1000:
        longer *= 2
        peaks = largest(design, striker, wall, longer, math.ceil(longer / (STEP_FRACTION * unit)))
        if np.isfinite(peaks.first[0]):
            when = f": its first maximum at the wall comes at {peaks.first[0]:.4g} s"
            break
        when = f", nor before {longer:.3g} s"
    return TensegrityError(
        f"t_end {t_end:g} s is before the wave through design {number} arrives{when}"
    )


def wall_peak(build: Build, beads: Sequence[Bead], t_end: float, dt: float) -> tuple[float, float]:
    """Largest force on a wall [N], between the steps too, and when [s].

    It is that of `tensegrity.largest_peak` among the forces at all steps.  If the largest force is
    the last one and still increasing, it is inf: the wave has not arrived.

    Parameters
    ----------
    build : callable
        Maps beads to a scene with a striker and the name of one of its walls.
    beads : sequence of Bead
    t_end, dt : float
        [s].

    Returns
    -------
    force, time : float
        [N], compression > 0, and [s].

    Raises
    ------
    TensegrityError
        `build` fails, or does not return a scene and the name of a wall.
    """
    try:
        scene, name = build(beads)
    except (TypeError, ValueError) as error:
        raise TensegrityError(f"build {check.shown(build)} gives no scene: {error}") from error
    record = Record(every=1, sites=wall_sites(scene, name))
    run = simulate(scene, scene.start(), t_end, method=METHOD, dt=dt, record=record)
    time, force = largest_peak(run.t, wall_force(run, name))
    return (force, time) if force > 0 and time < run.t[-1] else (math.inf, t_end)


@dataclass(frozen=True)
class Problem:
    """The objective function: maps rows of genes to forces on the wall; sent to workers.

    Attributes
    ----------
    space : Space
    striker : Striker
    wall : Material
    t_end, dt : float
        [s].
    build : callable or None
    scatter : Scatter or None
        The objective is then a quantile over its draws, which are the same for every design.
    """

    space: Space
    striker: Striker
    wall: Material
    t_end: float
    dt: float
    build: Build | None
    scatter: Scatter | None = None

    def __call__(self, genes: Array) -> Array:
        """Forces [N]; inf where the wave has not arrived before `t_end`."""
        if self.build is None:
            steps = step_count(self.dt, self.t_end, self.dt)
            designs, scatter = self.space.designs(genes), self.scatter or Scatter(draws=1)
            varied = scatter.varied(designs, self.striker.speed)
            peaks = largest(varied[0], self.striker, self.wall, self.t_end, steps, *varied[1:])
            forces = np.where(np.isfinite(peaks.first), peaks.force, np.inf)
            return scatter.worth(forces.reshape(len(designs), -1))
        each = (wall_peak(self.build, self.space.beads(x), self.t_end, self.dt) for x in genes)
        return np.array([force for force, _ in each])

    unit = "design"

    @property
    def part(self) -> int:
        """Designs that one worker is given."""
        return PART if self.build is None else 1
