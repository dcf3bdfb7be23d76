"""Solitary waves of cells of several masses and springs: `CellWave`, and `genuine` ones."""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping
from contextvars import ContextVar
from dataclasses import dataclass, field
from functools import cached_property
from typing import Any

import numpy as np
from numpy.typing import ArrayLike

from tensegrity import check
from tensegrity.errors import TensegrityError
from tensegrity.printing import Lines, Printed
from tensegrity.root import root
from tensegrity.scenes.chain import refuse_step
from tensegrity.scenes.scene import State
from tensegrity.typing import Array
from tensegrity.waves.by_target import stiffness_above
from tensegrity.waves.cell_profile import CellProfile, Train, least, train, wave_at
from tensegrity.waves.cosines import cosine_sum
from tensegrity.waves.spring_cell import cell_of

EDGE = 3.0  # sites from the end of the box over which a launched wave with a tail is cut off
FALLS = 0.1  # tail at a zero over those on its sides, above which it is a pole
PLACE = 1e-13  # relative error of a zero

_near: ContextVar[CellProfile | None] = ContextVar("near", default=None)


@dataclass(frozen=True, eq=False, repr=False)
class CellWave(Printed):
    """A wave of permanent form in a chain whose cell has several masses and springs.

    Attributes
    ----------
    mass : ndarray, (masses,)
        Of a cell [kg]: of its sites, then of what hangs on them.
    speed, sound_speed : float
        [sites/s].
    excess : float
        speed/sound_speed - 1.
    amplitude : float
        Extremum of the elongation of the first spring [m], extension > 0.
    energy : float
        Mean over the passage of a cell of the energy on the grid [J].
    momentum : float
        [kg m/s]
    residual : float
        Largest |r - P g| over the peak, on a grid 4 times finer; see `tensegrity.waves.cell`.
    resonances : tuple of (float, int)
        Wave numbers [rad/site] and branches of linear waves that move with the wave.
    """

    mass: Array
    speed: float
    sound_speed: float
    excess: float
    residual: float
    resonances: tuple[tuple[float, int], ...]
    _profile: CellProfile = field(repr=False)
    _reference: float = field(repr=False)

    @cached_property
    def _waves(self) -> tuple[Any, Any]:
        """Coefficients of rows, and those of basis vectors, translations as rates."""
        law, of = self._profile.law, self._profile
        forces = of._coefficients(of.pulled)
        across = law.inverse(of.grid.wave_numbers, of.nu)[1].astype(complex)
        phases = np.where(law.odd, -1j, 1.0)
        moved = np.einsum("nij,jn->in", across * (phases * np.conj(phases)), forces)
        return np.einsum("nij,jn->in", of.symbol, forces), moved

    def _sum(self, waves: Any, x: Any) -> Any:
        """Real part of sums of exp(i k x), 0 beyond the box."""
        k, x = self._profile.grid.wave_numbers, np.asarray(x, dtype=float)
        inside = np.abs(x) <= self._profile.grid.half_length
        at = np.where(inside, x, 0.0)
        found = cosine_sum(waves.real.T, k, at) - cosine_sum(waves.imag.T, k, at, np.sin)
        found[~inside] = 0.0
        return self._reference * found

    def elongation(self, x: ArrayLike) -> Array:
        """Elongations [m] of the springs of a cell where their middles are x sites from that of the
        wave, and of those of inner masses; (..., springs)."""
        law = self._profile.law
        waves = law.rows @ (np.where(law.odd, -1j, 1.0)[:, None] * self._waves[0])
        return np.asarray(self._sum(waves, check.numbers("x", x, "sites")))

    def rate(self, x: ArrayLike) -> Array:
        """du/dx [m per site] of each mass x sites from the middle; (..., masses)."""
        law, k = self._profile.law, self._profile.grid.wave_numbers
        moved = np.where(np.arange(len(law.base))[:, None] < 1, 1.0, 1j * k) * self._waves[1]
        return np.asarray(self._sum(law.base @ moved, check.numbers("x", x, "sites")))

    @cached_property
    def amplitude(self) -> float:
        grid = self._profile.grid
        x = np.concatenate([-grid.x[:0:-1], grid.x])
        at = int(np.abs(self.elongation(x)[:, 0]).argmax())
        law = self._profile.law
        waves = law.rows @ (np.where(law.odd, -1j, 1.0)[:, None] * self._waves[0])
        bent = waves * 1j * grid.wave_numbers
        where = root(lambda y: float(self._sum(bent, y)[..., 0]), x[at - 1], x[at + 1], 1e-14)
        return float(self.elongation(where)[0])

    @cached_property
    def energy(self) -> float:
        law, of = self._profile.law, self._profile
        x = np.concatenate([-of.grid.x[:0:-1], of.grid.x])[1:]
        step = of.grid.half_length / of.grid.points
        strains = self.elongation(x).T / self._reference
        bonds = law.energy(strains).sum() * self._reference**2 * law.secant
        moving = self.speed**2 / 2 * (self.mass * self.rate(x) ** 2).sum()
        return float((bonds + moving) * step / law.sites)

    @property
    def speed_ratio(self) -> float:
        """Speed over the sound speed."""
        return 1 + self.excess

    @cached_property
    def _train(self) -> Train:
        return train(self._profile, *self.resonances[0])

    @property
    def _signed(self) -> float:
        """Of the tail [m], in this box."""
        if not self.resonances:
            raise TensegrityError("no resonance: the wave has no tail that could vanish")
        return self._train.amplitude * self._reference

    @cached_property
    def _least(self) -> tuple[float, float, Train]:
        return least(self._profile)

    @property
    def tail(self) -> float:
        """Least tail that a wave with this core has, of the displacement of the mass that moves
        most in it, over the peak; 0.0 where no branch resonates.  By three boxes."""
        if not self.resonances:
            return 0.0
        return abs(self._least[0] * self._reference / self.amplitude)

    @property
    def tail_phase(self) -> float:
        """Phase by which the core scatters waves of the tail [rad]."""
        return self._least[1] if self.resonances else 0.0

    @property
    def sheds(self) -> float:
        """Power [W] of what a launched core leaves behind, waves of twice the least tail."""
        if not self.resonances:
            return 0.0
        law, (k, branch) = self._profile.law, self.resonances[0]
        modal = self._least[0] / self._least[2].part * self._reference
        _, _, slope, _ = law.resonant(k, branch, self._profile.nu)
        apart = slope / (2 * self.speed * k) * law.secant / law.unit_mass  # c less group speed
        return 2 * modal**2 * law.unit_mass * (self.speed * k) ** 2 * apart / law.sites

    def launch(self, chain: Any, at: float, direction: int = 1) -> State:
        """The state of a chain that is at rest except for this wave.

        Parameters
        ----------
        chain : Chain or Network
            With the masses of this wave.  A chain with inner masses is a `Network` in one
            dimension: first the sites of the chain, then the inner ones in the same order.
        at : float
            Position of the middle of the wave, in sites.
        direction : int, optional
            1 towards higher sites, -1 towards lower ones.

        Returns
        -------
        State
            Masses ahead of the wave have u = 0.

        Raises
        ------
        TensegrityError
            Masses that differ, or a chain that is too short.
        """
        if direction not in (-1, 1):
            raise TensegrityError(f"direction {direction} must be 1 or -1")
        law = self._profile.law
        n, hosts = law.sites, list(law.hosts)
        sites = chain.sites * n // (n + len(hosts))
        edge = self._profile.grid.half_length
        if at - edge < 0 or at + edge > sites - 1:
            raise TensegrityError(
                f"the wave at {at:g} needs {edge:.4g} sites on either side, but the ends of the "
                f"chain are {at:g} and {sites - 1 - at:g} sites away"
            )
        mass, each = np.ravel(chain.mass), np.arange(sites)
        for first in range(n):
            kinds = (each + first) % n
            inner = [(j, n + hosts.index(x)) for j, x in enumerate(kinds) if x in hosts]
            wanted = np.concatenate([self.mass[kinds], [self.mass[i] for _, i in inner]])
            if len(wanted) == len(mass) and np.allclose(mass, wanted, rtol=1e-15, atol=0):
                break
        else:
            raise TensegrityError("the masses of the chain differ from those of the wave's cell")
        x = each - at
        longer = self.elongation(x[:-1] + 0.5)[each[:-1], kinds[:-1]] * self._window(x[:-1] + 0.5)
        u = np.concatenate([[0.0], np.cumsum(longer)])
        u -= u[-1] if direction == 1 else 0.0
        v = -direction * self.speed * self.rate(x)[each, kinds] * self._window(x)
        for j, i in inner:
            y = x[j]
            u = np.append(u, u[j] + self.elongation(y)[i] * self._window(y))
            v = np.append(v, -direction * self.speed * self.rate(y)[i] * self._window(y))
        refuse_step(chain, u)
        return State(u.reshape(chain.shape), v.reshape(chain.shape))

    def _window(self, x: Any) -> Any:
        """1 in the box but near its ends, where a tail is cut off."""
        if not self.resonances:
            return np.ones_like(x)
        left = (self._profile.grid.half_length - np.abs(x)) / EDGE
        return np.sin(np.pi / 2 * np.clip(left, 0.0, 1.0)) ** 2

    def _lines(self) -> Lines:
        yield (f"solitary wave of a cell of {len(self.mass)} masses, speed {self.speed:.6g} "
               f"sites/s = {self.speed_ratio:.6g} sound speeds")  # fmt: skip
        yield f"peak {self.amplitude:.6g} m, residual {self.residual:.1e}"
        for k, branch in self.resonances:
            yield f"resonance with branch {branch} at {k:.6g} rad/site"
        yield f"least tail {self.tail:.2g} of the peak" if self.resonances else "no resonance"


def cell_wave(springs: Any, mass: Any, inner: Any, name: str, value: float) -> CellWave:
    """The wave of a cell with a given speed.

    Parameters
    ----------
    springs, mass, inner
        As of `solitary_wave`.
    name : {"speed", "speed_ratio", "excess"}
    value : float

    Returns
    -------
    CellWave

    Raises
    ------
    TensegrityError
        Bad input, or no wave is found.
    """
    if name not in ("speed", "speed_ratio", "excess"):
        raise TensegrityError(
            f"{name} given: a wave of a cell is given by its speed, speed_ratio or excess alone"
        )
    if inner is not None and not isinstance(inner, Mapping):
        raise TensegrityError(f"inner {check.shown(inner)} must be a dict of sites")
    law = cell_of(springs, check.finite("mass", check.floats("mass", mass)), inner)
    if not law.at_rest.any():
        raise TensegrityError("a cell without stiffness at rest has no sound speed: precompress it")
    above = stiffness_above(name, value, law.sound_speed, law.unit_mass, law.secant)
    nu = above / law.secant
    profile, residual = wave_at(law, nu, _near.get())
    return CellWave(
        law.masses, law.sound_speed * math.sqrt(1 + nu), law.sound_speed,
        math.expm1(math.log1p(nu) / 2), residual, law.resonances(nu), profile, law.reference,
    )  # fmt: skip


def genuine(make: Callable[[float], CellWave], low: float, high: float, count: int = 5) -> Array:
    """Parameters at which the tail of a wave vanishes.

    Parameters
    ----------
    make : callable (float) -> CellWave
        The wave with a parameter, such as a ratio of masses, from `solitary_wave`.
    low, high : float
        Between which zeros of the signed tail are sought.
    count : int, optional
        Parameters at which it is computed first, at least 2.

    Returns
    -------
    ndarray
        Ascending; empty where there is none.

    Raises
    ------
    TensegrityError
        Bad input, or a wave does not exist or has no resonance.
    """
    if not callable(make):
        raise TensegrityError(f"make {check.shown(make)} must be a function of a number")
    low = check.number("low", low)
    high, count = (
        check.number("high", high, above=low),
        check.whole("count", count, least=2, below=10_000),
    )
    known: dict[float, float] = {}
    token = _near.set(None)

    def signed(at: float) -> float:
        if at not in known:
            wave = make(at)
            check.kind("result of make", wave, CellWave)
            _near.set(wave._profile)
            known[at] = wave._signed
        return known[at]

    try:
        places = np.linspace(low, high, count).tolist()
        values = [signed(x) for x in places]
        found = []
        for k in range(count - 1):
            if values[k] * values[k + 1] > 0:
                continue
            zero = root(signed, places[k], places[k + 1], relative=PLACE)
            if abs(signed(zero)) <= FALLS * min(abs(values[k]), abs(values[k + 1])):
                found.append(zero)
    finally:
        _near.reset(token)
    return np.array(found)
