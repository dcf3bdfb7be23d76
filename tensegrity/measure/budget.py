"""Total forces of bonds, and the balance of energy and momentum of a chain beyond a bond.

Beyond bond j lie the sites above j with their bonds.  The tension T of the bond acts on the first
of these sites, so that the part gains momentum at the rate -T and energy at the rate -T v, where v
is the velocity of that site.  These rates, integrated over the recorded instants by a spline of
degree 7, must equal the changes computed from the sites themselves: the balance closes only if the
run is accurate and recorded densely enough, and if the far end is free.  Dashpots and further
forces count where they act: in the bond with its tension, beyond it with their power and their sum.
For bond 0 of a chain whose first site is held, it is the balance of the reaction at that end.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass
from typing import Any

import numpy as np

from tensegrity import check
from tensegrity.engine.force_law import BOND, SITE
from tensegrity.engine.forced import values_between
from tensegrity.errors import TensegrityError
from tensegrity.measure.observables import directions
from tensegrity.printing import printed
from tensegrity.runs.record import require_all_sites
from tensegrity.runs.run import Run
from tensegrity.scenes.chain import Chain, refuse_ring
from tensegrity.scenes.dynamics import dynamics
from tensegrity.scenes.network import Network
from tensegrity.typing import Array, Indices

DEGREE = 7  # of the spline that is integrated


@dataclass(frozen=True, eq=False)
class Budget:
    """Energy and momentum beyond a bond.

    Attributes
    ----------
    t : ndarray, (T,)
        [s]
    energy, momentum : ndarray, (T,)
        Of the sites beyond the bond [J], [kg m/s], from their displacements and velocities.
    work, impulse : ndarray, (T,)
        Transferred through the bond since the first instant, and by dashpots and further forces
        beyond it, by quadrature [J], [kg m/s].
    energy_error, momentum_error : float
        Largest difference between both evaluations, relative to the energy of the whole chain at
        the first instant and to the largest change of the momentum; absolute if that is 0.
    """

    t: Array
    energy: Array
    momentum: Array
    work: Array
    impulse: Array
    energy_error: float
    momentum_error: float

    __str__ = printed(t="s", energy="J", momentum="kg m/s", work="J", impulse="kg m/s")
    __repr__ = __str__


def bond_force(run: Run) -> Array:
    """Force of each bond during a run: that of its spring, its dashpot and all further forces.

    Parameters
    ----------
    run : Run
        Of a `Chain` or a `Network` of fixed contacts, with all sites recorded.

    Returns
    -------
    ndarray, (T, bonds)
        [N], tension > 0; that of a spring counts from its equilibrium under a preload.

    Raises
    ------
    TensegrityError
        Bad input; a run of another scene, or one in which contacts form or springs change in time.

    Examples
    --------
    >>> from tensegrity import Chain, Damping, PowerLaw, bond_force, simulate
    >>> chain = Chain(PowerLaw(1.0, 1.5, preload=1.0), sites=3, damping=Damping(bond=0.2))
    >>> run = simulate(chain, chain.at_rest({0: 0.05}), t_end=1.0, tol=1e-8)
    >>> print(bond_force(run)[0].round(6))  # of the dashpot alone
    [-0.01  0.  ]
    """
    scene = _recorded_whole(run, Chain, Network)
    if dynamics(scene).follows:
        raise TensegrityError("contacts form in this run: their forces belong to no list of bonds")
    total = np.array(scene.bond_tension(run.u))
    on_line = np.ones((1, total.shape[1], 1))
    along = on_line if run.u.ndim == 2 else directions(scene, run.u)
    for on, at, force in _further(run):
        inside = np.flatnonzero((on == BOND) & (at < total.shape[1]))  # others touch walls
        at, force = at[inside], force[:, inside]
        total[:, at] += np.sum(force * along[:, at], axis=-1)
    return total


def _recorded_whole(run: Run, *kinds: Any) -> Any:
    """The scene of a run with all its sites, if it is of these kinds."""
    scene: Any = check.kind("run", run, Run).scene
    if not isinstance(scene, kinds):
        names = " or a ".join(kind.__name__ for kind in kinds)
        raise TensegrityError(f"the scene of the run is {type(scene).__name__}, not a {names}")
    if dynamics(scene).springs.changing:
        raise TensegrityError(
            "the work of springs that change in time does not pass through a bond"
        )
    require_all_sites(run)
    return scene


def _further(run: Run) -> Iterator[tuple[str, Indices, Array]]:
    """What dashpots and further forces act on, their places, and the forces on the first end of
    each, (T, places, dim) [N]."""
    of = dynamics(run.scene)
    bonds = of.contact_bonds
    for one in of.acting.applied(as_forces=True):
        yield one.law.on, one.places, values_between(one, bonds, run.t, run.u, run.v)


def budget(run: Run, bond: int) -> Budget:
    """Energy and momentum of the part of a chain beyond a bond, evaluated in two ways.

    Parameters
    ----------
    run : Run
        Of a chain whose last end is free, with all sites recorded.  Springs that change in time
        are refused: the work of the change does not pass through the bond.
    bond : int
        Bond j joins sites j and j + 1.

    Returns
    -------
    Budget

    Raises
    ------
    TensegrityError
        Bad input; a run of another scene, or with too few recorded sites or instants.

    Examples
    --------
    >>> from tensegrity import Chain, PowerLaw, budget, simulate
    >>> chain = Chain(PowerLaw(1.0, 1.5, preload=1.0), sites=100)
    >>> run = simulate(chain, chain.at_rest({0: 0.05}), t_end=70, tol=1e-8)
    >>> balance = budget(run, 40)
    >>> print(f"{1e3 * balance.energy[-1]:.4f} mJ", balance.energy_error < 1e-7)
    1.1877 mJ True
    """
    from scipy.interpolate import make_interp_spline

    chain = _recorded_whole(run, Chain)
    refuse_ring(chain, "the budget of a part")
    bond = check.whole("bond", bond, least=0, below=chain.sites - 1)
    if chain.ends[1] != "free":
        raise TensegrityError("the last site is fixed: its force is not part of this budget")
    if len(run.t) <= DEGREE:
        raise TensegrityError(f"{len(run.t)} instants recorded, must be above {DEGREE}")
    bonds = chain.bond_energy(run.u)
    kinetic = 0.5 * chain.mass * run.v**2
    energy = kinetic[:, bond + 1 :].sum(axis=1) + bonds[:, bond + 1 :].sum(axis=1)
    momentum = run.v[:, bond + 1 :] @ chain.mass[bond + 1 :]
    tension = bond_force(run)[:, bond]
    rates = np.stack([-tension * run.v[:, bond + 1], -tension])
    for on, at, force in _further(run):
        beyond = at > bond
        speed = run.v if on == SITE else np.diff(run.v, axis=1)  # of the second end from the first
        rates[0] -= np.sum(force[:, beyond, 0] * speed[:, at[beyond]], axis=1)
        rates[1] -= np.sum(force[:, beyond, 0], axis=1) if on == SITE else 0.0
    work, impulse = make_interp_spline(run.t, rates.T, DEGREE).antiderivative()(run.t).T
    gaps = [np.abs(x - x[0] - y).max() for x, y in ((energy, work), (momentum, impulse))]
    change = np.abs(momentum - momentum[0]).max()
    return Budget(
        run.t, energy, momentum, work, impulse,
        float(gaps[0] / (abs(run.energy[0]) or 1.0)), float(gaps[1] / (change or 1.0)),
    )  # fmt: skip
