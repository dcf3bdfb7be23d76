"""Balance of energy and momentum of the part of a chain beyond a bond.

Beyond bond j lie the sites above j with their bonds.  The tension T of the bond acts on the first
of these sites, so that the part gains momentum at the rate -T and energy at the rate -T v, where v
is the velocity of that site.  These rates, integrated over the recorded instants by a spline of
degree 7, must equal the changes computed from the sites themselves: the balance closes only if the
run is accurate and recorded densely enough, and if the far end is free.  Dashpots and further
forces count where they act: in the bond with its tension, beyond it with their power and their sum.
For bond 0 of a chain whose first site is held, it is the balance of the reaction at that end.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from tensegrity import check
from tensegrity.engine.force_law import SITE, AppliedForce
from tensegrity.engine.forced import values_on_chain
from tensegrity.errors import TensegrityError
from tensegrity.printing import printed
from tensegrity.runs.record import require_all_sites
from tensegrity.runs.run import Run
from tensegrity.scenes.chain import Chain
from tensegrity.scenes.dynamics import dynamics
from tensegrity.scenes.force import applied_forces
from tensegrity.typing import Array

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

    if not isinstance(run, Run):
        raise TensegrityError(f"run is {type(run).__name__}, not a Run")
    chain = run.scene
    if not isinstance(chain, Chain):
        raise TensegrityError(f"the scene of the run is {type(chain).__name__}, not a Chain")
    if chain.tune:
        raise TensegrityError(
            "the work of springs that change in time does not pass through a bond"
        )
    bond = check.whole("bond", bond, least=0, below=chain.sites - 1)
    require_all_sites(run)
    if chain.ends[1] != "free":
        raise TensegrityError("the last site is fixed: its force is not part of this budget")
    if len(run.t) <= DEGREE:
        raise TensegrityError(f"{len(run.t)} instants recorded, must be above {DEGREE}")
    bonds = chain.bond_energy(run.u)
    kinetic = 0.5 * chain.mass * run.v**2
    energy = kinetic[:, bond + 1 :].sum(axis=1) + bonds[:, bond + 1 :].sum(axis=1)
    momentum = run.v[:, bond + 1 :] @ chain.mass[bond + 1 :]
    tension = chain.bond_tension(run.u)[:, bond]
    rates = np.stack([-tension * run.v[:, bond + 1], -tension], axis=1)
    for one in applied_forces(chain, as_forces=True):
        rates += _beyond(one, run, bond)
    work, impulse = make_interp_spline(run.t, rates, DEGREE).antiderivative()(run.t).T
    gaps = [np.abs(x - x[0] - y).max() for x, y in ((energy, work), (momentum, impulse))]
    change = np.abs(momentum - momentum[0]).max()
    return Budget(
        run.t, energy, momentum, work, impulse,
        float(gaps[0] / (abs(run.energy[0]) or 1.0)), float(gaps[1] / (change or 1.0)),
    )  # fmt: skip


def _beyond(one: AppliedForce, run: Run, bond: int) -> Array:
    """Rates of energy and momentum by a force on what is beyond a bond, (T, 2) [W], [N]."""
    bonds, at = dynamics(run.scene).loop_bonds, one.places
    force = values_on_chain(one, bonds, run.t, run.u, run.v)
    if one.law.on == SITE:
        here = force[:, at > bond]
        return np.stack([np.sum(here * run.v[:, at[at > bond]], axis=1), here.sum(axis=1)], axis=1)
    rate, pull = np.diff(run.v, axis=1)[:, at], force[:, at == bond].sum(axis=1)
    lost = np.sum((force * rate)[:, at > bond], axis=1)
    return np.stack([-lost - pull * run.v[:, bond + 1], -pull], axis=1)
