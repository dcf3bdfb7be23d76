"""Transition waves: fronts that switch a chain of equal units from one state to another.

The equations and their solution are in `front`.  In a chain with springs to the ground the states
are stable equilibria of these; otherwise they are elongations.  The energy released by the front is
dissipated by the dashpots: this balance is independent of the solution and measures its error.
"""

from __future__ import annotations

import math
from dataclasses import dataclass, field, replace
from functools import cached_property
from typing import Annotated

import numpy as np

from tensegrity.checked import checked
from tensegrity.errors import TensegrityError
from tensegrity.root import root
from tensegrity.scenes.chain import Chain, refuse_ring
from tensegrity.scenes.dynamics import dynamics
from tensegrity.scenes.forcing import Damping
from tensegrity.scenes.scene import State
from tensegrity.springs.pair_law import PairLaw
from tensegrity.springs.potential import Potential
from tensegrity.typing import Fraction, Mass
from tensegrity.waves.front import (
    HALF_LENGTH,
    WIDTH,
    Front,
    Line,
    resolved,
    step,
)
from tensegrity.waves.solitary import LEAST_LEVEL, TravellingWave
from tensegrity.waves.travelling import CONVERGED, ITERATIONS, NoWaveError

SAME = 1e-6  # difference of a state from the one that was found, over the step
BALANCED = 1e-9  # force of the ground in its equilibria, over stiffness times step
WIDTHS = (1.0, 0.5, 2.0)  # of initial profiles, over that of the continuum
POINTS = 201, 801, 2001  # of first grids
SITES = 30  # on either side of a standing front
PLACES = 60  # of its middle site


@dataclass(frozen=True, eq=False, repr=False)
class TransitionWave(TravellingWave):
    """A front between two states, computed by `transition_wave`; it moves towards higher sites.

    Attributes are those of `SolitaryWave` with these differences; distances x are from the point
    where the state is the mean of both.

    Attributes
    ----------
    ahead, behind : float
        Displacements [m] with springs to the ground, elongations without.
    released : float
        Energy released at each site [J].
    sound_speed : float
        Of the bonds ahead [sites/s].
    family : str
        "subsonic" or "supersonic", relative to that.
    amplitude : float
        behind - ahead [m].
    energy, momentum : float
        Excess of the front over a jump at x = 0 between its two states [J], [kg m/s]; the chain
        ahead is at rest.
    residual : float
        The larger of two errors: the residual of the equation on a grid twice as fine, over the
        largest force; and the relative difference of the energies released and dissipated.
    """

    ahead: float
    behind: float
    potential: Potential = field(repr=False)
    released: float
    ground: Potential | None = field(repr=False)
    damping: Damping = field(repr=False)

    @cached_property
    def _on_x(self):
        return self._shape.elongation(self.x)

    @checked
    def width(self, level: Annotated[float, f">= {LEAST_LEVEL}", "< 0.5"] = 0.05) -> float:
        """Distance in sites between the points at which the state differs from that ahead, and from
        that behind, by a fraction `level` of the step."""
        part = (self._state(self.x) - self.behind) / -self.amplitude
        ends = []
        for value in (level, 1 - level):
            at = int(np.flatnonzero(np.diff(part >= value))[-1 if value > 0.5 else 0])
            places = float(self.x[at]), float(self.x[at + 1])
            ends.append(root(lambda x, v=value: self._part(x) - v, *places, 1e-13))
        return ends[1] - ends[0]

    def _state(self, x):
        shape = self._shape
        return shape.displacement(x) if self.ground is not None else shape.elongation(x)

    def _part(self, x):
        return float((self._state(x) - self.behind) / -self.amplitude)

    @checked
    def reach(self, tail: Fraction = 1e-9) -> float:
        """Distance from the centre, in sites, beyond which less than `tail` of the step remains."""
        left = np.abs(self._state(self.x) - np.where(self.x > 0, self.ahead, self.behind))
        remaining = np.abs(self.x[left >= tail * abs(self.amplitude)])
        return float(np.max(remaining, initial=0.0))

    @checked
    def launch(
        self,
        chain: Chain,
        at: float,
        direction: Annotated[int, ">= 1", "< 2"] = 1,
        tail: Fraction = 1e-9,
    ) -> State:
        """The state of a chain with free ends that has this front, and is at rest ahead of it.

        Parameters
        ----------
        chain : Chain
            A chain with the springs, masses and dashpots of the front.
        at : float
            Position of the centre in sites.
        direction : int, optional
            1: towards higher sites.
        tail : float, optional
            Fraction of the step below which the front may be cut off at the chain's ends.

        Returns
        -------
        State

        Raises
        ------
        TensegrityError
            The front does not fit the chain, an end of the chain is fixed, or another direction.
        """
        refuse_ring(chain, "a front")
        grounds = [one.expression for one in dynamics(chain).further_forces if one.stores]
        if grounds != ([] if self.ground is None else [self.ground]) or chain.held:
            raise TensegrityError(
                "the chain must have free ends and the same springs to the ground as the front"
            )
        state = super().launch(chain, at, 1, tail)
        ahead = 0.0 if self.ground is not None else self.ahead
        return State(state.u, state.v + self.speed * ahead)

    @property
    def _title(self):
        return f"{self.family} transition wave"

    def _texts(self):
        texts = super()._texts()
        texts.pop("peak")
        states = {"ahead": f"{self.ahead:.6g} m", "behind": f"{self.behind:.6g} m"}
        states["released"] = f"{self.released:.6g} J/site"
        width = {"width": f"{self.width():.4g} sites from 5 % to 95 %"}
        return {"speed": texts.pop("speed")} | states | texts | width


@checked
def transition_wave(
    spring: Potential,
    mass: Mass = 1.0,
    *,
    ahead: Annotated[float, "m"],
    behind: Annotated[float, "m"],
    ground: Potential | None = None,
    damping: Damping | None = None,
) -> TransitionWave:
    """The front that switches a chain of equal masses and springs between two states.

    Parameters
    ----------
    spring : Potential
        Of each bond.
    mass : float, optional
        Of each site [kg].
    ahead, behind : float
        The states at high and at low sites [m]: with springs to the ground displacements in
        equilibrium, otherwise elongations.
    ground : Potential, optional
        Spring between each site and the ground.
    damping : Damping, optional
        Dashpots with constant coefficients; without springs to the ground, in the bonds only.

    Returns
    -------
    TransitionWave

    Raises
    ------
    TensegrityError
        Bad input; states that release no energy, are unstable, or do not belong to a front (the
        message gives the value that does); an undamped front that radiates; a front pinned by the
        lattice (the message gives the forces between which it stands).
    ResolutionError
        The front decays too slowly, or is too sharp, for the finest grid.

    Examples
    --------
    >>> import sympy as sp
    >>> from tensegrity import Damping, Potential, transition_wave
    >>> u = sp.Symbol("u")
    >>> wells = Potential(u**4 / 4 - 1.35 * u**3 / 3 + 0.35 * u**2 / 2, u)
    >>> front = transition_wave(Potential(u**2 / 2, u), ahead=0.0, behind=1.0, ground=wells,
    ...                         damping=Damping(ground=0.3))
    >>> f"{front.speed:.9f} sites/s, {front.released:.6f} J/site"
    '0.566415511 sites/s, 0.025000 J/site'
    """
    if isinstance(spring, PairLaw) or isinstance(ground, PairLaw):
        raise TensegrityError(
            "fronts of a pair law are not computed: between two unloaded states they stand, by "
            "Rankine and Hugoniot, and moving ones need dashpots, which a pair law does not take"
        )
    damping = Damping() if damping is None else damping
    if damping.bond.ndim or damping.ground.ndim:
        raise TensegrityError("damping of a front must have one coefficient for all bonds or sites")
    if ahead == behind:
        raise TensegrityError(f"ahead and behind are both {ahead:g} m: they must differ")
    line = Line(POINTS[0], HALF_LENGTH)
    begin = Front(
        spring, ground, mass, float(damping.bond), float(damping.ground), ahead, behind, False,
        line, np.zeros(line.points), behind,
    )  # fmt: skip
    return _wave(_on_ground(begin) if ground is not None else _of_bonds(begin), behind)


def _released(front):
    """Energy released at each site [J]."""
    ahead, behind = front.ahead, front.end
    if front.ground is not None:
        at = front.ground.energy([ahead, behind])
        return float(at[0] - at[1])
    force, energy = front.spring.tension([ahead, behind]), front.spring.energy([ahead, behind])
    return float(force.sum() / 2 * (behind - ahead) - (energy[1] - energy[0]))


def _refuse_gain(front):
    released = _released(front)
    if released <= 0:
        raise TensegrityError(
            f"the energy released, {released:.6g} J/site, must be above 0: a damped front moves "
            "the other way, or not at all"
        )


def _on_ground(front):
    """The front in a chain with springs to the ground."""
    spring, ground, jump = front.spring, front.ground, front.behind - front.ahead
    stiffness = []
    for name in ("ahead", "behind"):
        at = getattr(front, name)
        stiffness.append(float(ground.stiffness(at)))
        if stiffness[-1] <= 0:
            raise TensegrityError(
                f"stiffness {stiffness[-1]:g} N/m of the ground at the state {name}, {at:g} m, "
                "must be above 0: it is unstable"
            )
        wrong = float(ground.tension(at)) / stiffness[-1]
        if abs(wrong) > BALANCED * abs(jump):
            raise TensegrityError(
                f"the state {name}, {at:g} m, is no equilibrium of the ground: the next one is "
                f"near {at - wrong:.9g} m"
            )
    _refuse_gain(front)
    if not (front.bond or front.site):
        raise TensegrityError("a front over springs to the ground radiates without damping")
    bond, length = float(spring.stiffness(0.0)), 0.0
    top = spring.sound_speed(front.mass)
    if not 0 < top < math.inf:
        words = "must be finite and above 0: bonds without stiffness carry no front between wells"
        raise TensegrityError(f"the speed of sound is {top:g} sites/s, {words}")

    def missed(speed):  # power less dissipation of a profile of hyperbolic tangents
        nonlocal length
        length = math.sqrt(8 * bond * (1 - (speed / top) ** 2) / sum(stiffness))
        rate = front.site / (3 * length) + front.bond * 4 / (15 * length**3)
        return speed * rate * jump**2 - _released(front)

    damped = f"dashpots of {front.site:g} N s/m to the ground and {front.bond:g} N s/m in the bonds"
    missing = -missed(fastest := top * (1 - 1e-9))
    if missing > 0:
        released = _released(front)
        raise NoWaveError(
            f"{damped} dissipate at most {released - missing:.3g} J/site in a front slower than "
            f"sound, {top:g} sites/s, by the continuum; must be at least the {released:.3g} J/site "
            "released"
        )
    speed = root(missed, 0.0, fastest)
    x, failed = front.line.x, None
    profiles = [jump * (step(x * WIDTH / (part * length)) - step(x)) for part in WIDTHS]
    try:
        return _first(replace(front, w=w, unknown=speed) for w in profiles)
    except NoWaveError as error:
        failed = error
    low, high = standing_forces(spring, ground, front.ahead, front.behind)
    if low <= 0 <= high:
        raise TensegrityError(
            f"the front is pinned: it stands where each site is pushed with {low:.9g} N to "
            f"{high:.9g} N; no moving one was found"
        )
    raise type(failed)(f"{damped}: {failed}")


def _of_bonds(front):
    """The front in a chain without springs to the ground."""
    spring, mass = front.spring, front.mass
    if front.site:
        raise TensegrityError("dashpots to the ground stop the sites, which move behind this front")
    stiffness = spring.stiffness([front.ahead, front.behind])
    if stiffness.min() <= 0 or front.stiffness <= 0:
        raise TensegrityError(
            f"no front: stiffnesses {stiffness[0]:g} and {stiffness[1]:g} N/m ahead and behind and "
            f"m c^2 = {front.stiffness:g} N/m, by Rankine and Hugoniot, must be above 0"
        )
    slower = stiffness < front.stiffness
    if not front.bond and not slower.all():
        raise TensegrityError(
            f"a front without damping radiates where it is slower than sound: its speed "
            f"{front.speed:.6g} sites/s, by Rankine and Hugoniot, must be above "
            f"{math.sqrt(stiffness.max() / mass):.6g}"
        )
    if front.bond:
        _refuse_gain(front)
    overtaken = bool(slower[0] and not slower[1])
    front = replace(front, overtaken=overtaken, unknown=0.0 if overtaken else front.behind)
    return _first(front.on(Line(points, HALF_LENGTH)) for points in POINTS)


def _first(fronts):
    """The first of some approximations that leads to a front."""
    failed = None
    for front in fronts:
        try:
            return resolved(front)
        except NoWaveError as error:
            failed = error
    raise failed


def standing_forces(
    spring: Potential, ground: Potential, ahead: float, behind: float
) -> tuple[float, float]:
    """The range of forces on each site [N] in which the lattice pins a front.

    Parameters
    ----------
    spring, ground : Potential
        Of the bonds, and to the ground.
    ahead, behind : float
        Equilibria of the latter [m].

    Returns
    -------
    low, high : float
        Forces towards higher sites.

    Raises
    ------
    NoWaveError
        No standing front is found: the chain is too stiff.
    """
    from scipy.optimize import minimize_scalar

    jump, u = behind - ahead, np.repeat([behind, ahead], [SITES, SITES + 1]).astype(float)
    move = np.eye(2 * SITES, 2 * SITES + 1, 1) - np.eye(2 * SITES, 2 * SITES + 1)

    def held(middle, u):
        """Displacements with that of the middle site given, and the force on each site."""
        u, force = np.append(u[:SITES], [middle, *u[SITES + 1 :]]), 0.0
        for _ in range(ITERATIONS):
            r = move @ u
            matrix = move.T @ (spring.stiffness(r)[:, None] * move) + np.diag(ground.stiffness(u))
            matrix[:, SITES] = -1.0  # of the force, the unknown of that site
            gap = move.T @ spring.tension(r) + ground.tension(u) - force
            moves = np.linalg.solve(matrix, -gap)
            force, moves[SITES] = force + float(moves[SITES]), 0.0
            u = u + moves
            if np.max(np.abs(moves)) < CONVERGED * abs(jump):
                break
        return u, force

    middles, start = ahead + jump * np.linspace(0.02, 0.98, PLACES), held(ahead + jump / 2, u)[0]
    below, above = [], []
    for part, rows in ((middles[PLACES // 2 - 1 :: -1], below), (middles[PLACES // 2 :], above)):
        u = start
        for middle in part:
            rows.append(held(middle, u))
            u = rows[-1][0]
    rows = below[::-1] + above
    forces = np.array([force for _, force in rows])
    inner, extremes = np.arange(1, PLACES - 1), []
    for sign in (1, -1):
        of = sign * forces
        least = inner[(of[1:-1] < of[:-2]) & (of[1:-1] < of[2:])]
        if not len(least):
            raise NoWaveError("no standing front was found")
        k = int(least[np.argmin(of[least])])
        best = minimize_scalar(
            lambda x, k=k, sign=sign: sign * held(x, rows[k][0])[1],
            bounds=sorted(middles[[k - 1, k + 1]]), method="bounded", options={"xatol": 1e-10},
        )  # fmt: skip
        extremes.append(sign * float(best.fun))
    return extremes[0], extremes[1]


def _wave(front, given):
    """The wave of a front that was found for a given state behind."""
    jump, mass, speed = front.end - front.ahead, front.mass, front.speed
    if abs(front.end - given) > SAME * abs(jump):
        raise TensegrityError(
            f"with {front.ahead:.9g} m ahead the state behind a front must be {front.end:.12g} m, "
            f"not {given:.9g} m (Rankine and Hugoniot, and the energy dissipated)"
        )
    released, line, shape = _released(front), front.line, front.shape()
    lost = abs(front.dissipated - released) / (released if front.bond or front.site else 1.0)
    sound = front.spring.sound_speed(mass) if front.ground is not None else math.sqrt(
        float(front.spring.stiffness(front.ahead)) / mass)  # fmt: skip
    (u, _), (r, _), slope = front.state, front.elongation, front.slope
    v, ends = -speed * slope, np.array([front.ahead, front.end])
    energy, ended = mass * v**2 / 2 + front.spring.energy(r), front.spring.energy(ends)
    velocity = 0.0
    if front.ground is not None:
        energy, ended = energy + front.ground.energy(u), front.ground.energy(ends)
    else:
        velocity = -speed * jump
    between = ended[0] + (ended[1] + mass * velocity**2 / 2 - ended[0]) * step(line.x)
    return TransitionWave(
        potential=front.spring, mass=mass, x=line.x, speed=speed, sound_speed=sound,
        excess=speed / sound - 1 if sound else math.inf,
        family="supersonic" if speed > sound else "subsonic", amplitude=jump,
        energy=line.integral(energy - between),
        momentum=mass * line.integral(v - velocity * step(line.x)),
        residual=max(front.defect(), lost), _shape=shape, ahead=front.ahead, behind=front.end,
        released=released, ground=front.ground, damping=Damping(front.bond, front.site),
    )  # fmt: skip
