"""The edges of dispersive shocks.

A step from one elongation to another spreads as a train of waves between two edges: a solitary wave
at the leading one, linear waves at the trailing one.  The modulation of such a train is followed
along dk/ds, s = (V''/m)^(1/2), by the linear relation w = 2 s sin(k/2) alone.  For every spring it
integrates in closed form: cosh^2(k/4) = s_behind/s_ahead for the decay k of the leading wave, and
cos^2(k/4) = s_ahead/s_behind for the wave number k of the trailing ones.
Source: G. A. El, Chaos 15, 037103 (2005), fitting of the edges.
"""

from __future__ import annotations

import math
from dataclasses import dataclass, field
from functools import cached_property

import numpy as np

from tensegrity import check
from tensegrity.checked import checked
from tensegrity.errors import TensegrityError
from tensegrity.printing import Lines, Printed
from tensegrity.scenes.chain import Chain, refuse_ring
from tensegrity.scenes.scene import State
from tensegrity.springs.potential import Potential
from tensegrity.typing import Mass
from tensegrity.waves.solitary import SolitaryWave, solitary_wave

STEPS = 257  # states between both sides of a shock in which the stiffness is compared
NODES = 64  # of the integral of the sound speed
LARGEST = 2.0  # ratio of sound speeds up to which the trailing edge exists


@dataclass(frozen=True, eq=False, repr=False)
class Shock(Printed):
    """The edges of the train of waves into which a step spreads; the result of `shock`.

    Attributes
    ----------
    spring : Potential
    mass : float
        Of each site [kg].
    behind, ahead : float
        Elongations on both sides [m]; the train moves towards higher sites.
    lead, trail : float
        Speeds of its leading and trailing edge [sites/s].
    lead_wavenumber, trail_wavenumber : float
        Of the leading solitary wave the decay of its tail, and the wave number of the linear waves
        at the trailing edge [rad/site].
    piston : float
        Velocity behind the train relative to that ahead [m/s], by which the step spreads as one
        train: with another one, a second wave travels back.
    """

    spring: Potential = field(repr=False)
    mass: float
    behind: float
    ahead: float
    lead: float
    trail: float
    lead_wavenumber: float
    trail_wavenumber: float
    piston: float

    @cached_property
    def wave(self) -> SolitaryWave:
        """The solitary wave on the state ahead that moves at the leading edge's speed; its
        elongations count from there.  Where this is not 0, the spring must be an expression."""
        spring = self.spring
        if self.ahead:
            r, energy, law = spring.law.elongation, spring.expression, spring.parameters
            if {str(x) for x in energy.free_symbols - {r}} != set(law):
                raise TensegrityError(f"ahead must be 0 m for a wave: {spring!r} is no expression")
            low, high = (end - self.ahead for end in spring.domain)
            moved = energy.subs(r, r + self.ahead) - float(spring.tension(self.ahead)) * r
            spring = Potential(moved, r, parameters=law, domain=(low, high))
        sign = "rarefaction" if self.behind > self.ahead else "compression"
        wave: SolitaryWave = solitary_wave(spring, self.mass, speed=self.lead, family=sign)
        return wave

    @checked
    def launch(self, chain: Chain, at: float) -> State:
        """The step in a chain whose ends are far away.

        Parameters
        ----------
        chain : Chain
            Of free ends, with the shock's spring and mass.
        at : float
            Position of the step in sites.

        Returns
        -------
        State
            At rest ahead of the step, with u = 0 at its last site; behind it all sites have the
            velocity `piston`.  Where the chain's ends are not held by the tensions of both sides,
            waves start from there.
        """
        refuse_ring(chain, "a shock")
        if any(s != self.spring for s in set(chain.springs)) or np.any(chain.mass != self.mass):
            raise TensegrityError("the springs or masses of the chain differ from the shock's")
        at = check.number("at", at, above=0, below=chain.sites - 1)
        r = np.where(np.arange(chain.sites - 1) + 0.5 < at, self.behind, self.ahead)
        u = np.append(-np.cumsum(r[::-1])[::-1], 0.0)
        return State(u, np.where(np.arange(chain.sites) < at, self.piston, 0.0))

    def _lines(self) -> Lines:
        yield f"shock from {self.behind:.6g} m behind to {self.ahead:.6g} m ahead"
        yield f"leading edge {self.lead:.9g} sites/s, trailing edge {self.trail:.9g} sites/s"
        yield f"velocity behind {self.piston:.6g} m/s"


@checked
def shock(spring: Potential, behind: float, ahead: float = 0.0, mass: Mass = 1.0) -> Shock:
    """Speeds of the edges of the train of waves into which a step of the elongation spreads.

    Parameters
    ----------
    spring : Potential
    behind, ahead : float
        Elongations on both sides [m], > 0 in extension; the train moves towards higher sites.
    mass : float, optional
        Of each site [kg].

    Returns
    -------
    Shock

    Raises
    ------
    TensegrityError
        Bad input; a state without stiffness; sound that is not faster behind than ahead, or not
        monotonic between: such steps spread otherwise; or a ratio of the sound speeds of 2 or
        more, where there is no trailing edge.

    Examples
    --------
    >>> import sympy as sp
    >>> from tensegrity import Potential, shock
    >>> r = sp.Symbol("r")
    >>> shock(Potential(sp.exp(-r) + r - 1, r), behind=-0.5)
    shock from -0.5 m behind to 0 m ahead
    leading edge 1.18300795 sites/s, trailing edge 0.715974583 sites/s
    velocity behind 0.568051 m/s
    """
    behind, ahead = (
        check.number(name, value, unit="m")
        for name, value in (("behind", behind), ("ahead", ahead))
    )
    if behind == ahead:
        raise TensegrityError(f"behind {behind:g} m must differ from ahead: there is no step")
    between = spring.stiffness(np.linspace(behind, ahead, STEPS))
    if not between.min() > 0:
        raise TensegrityError(f"stiffness {between.min():g} N/m within the step must be above 0")
    sound = np.sqrt(between / mass)
    first, last = float(sound[0]), float(sound[-1])
    if not np.all(np.diff(sound) < 0):
        raise TensegrityError(
            f"sound is to become slower from behind, {first:.6g} sites/s, to ahead, {last:.6g} "
            "sites/s, all the way: this step spreads otherwise"
        )
    if not first < LARGEST * last:
        raise TensegrityError(
            f"sound behind is {first / last:.4g} times as fast as ahead, must be below "
            f"{LARGEST:g}: there is no trailing edge"
        )
    decay, wavenumber = (
        4 * math.acosh(math.sqrt(first / last)),
        4 * math.acos(math.sqrt(last / first)),
    )
    nodes, weights = np.polynomial.legendre.leggauss(NODES)
    middle, half = (behind + ahead) / 2, (ahead - behind) / 2
    speeds = np.sqrt(spring.stiffness(middle + half * nodes) / mass)
    return Shock(
        spring, mass, behind, ahead, last * math.sinh(decay / 2) / (decay / 2),
        first * math.cos(wavenumber / 2), decay, wavenumber, float(half * (weights @ speeds)),
    )  # fmt: skip
