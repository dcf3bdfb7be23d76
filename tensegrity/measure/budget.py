"""What passes through a bond of a chain: energy and momentum of the part beyond it, over time.
Beyond bond j lie the sites above j with their bonds.  The bond pulls the first of them back with
its tension T, so the part gains momentum at the rate -T and energy at the rate -T v, v being
that site's velocity.  Integrated over recorded instants, by a spline of degree 7, this must give
what the sites themselves hold: a balance that a run closes only if it is right, recorded densely
enough, and the far end is free.  With bond 0 of a chain whose first site is held it is the
balance of the force at the held end.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from tensegrity import check
from tensegrity.errors import TensegrityError
from tensegrity.printing import printed
from tensegrity.runs.run import Run
from tensegrity.scenes.chain import Chain
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
        Passed through the bond since the first instant, by quadrature [J], [kg m/s].
    energy_error, momentum_error : float
        Largest difference of the two accounts, over the size of the energy of the whole chain at
        the first instant and over the largest change of the momentum; absolute where that is 0.
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
    """Energy and momentum of the part of a chain beyond a bond, by two accounts.

    Parameters
    ----------
    run : Run
        Of a chain whose last end is free, all sites recorded.  Springs that change while it
        runs are refused: the work of the change does not pass through the bond.
    bond : int
        Bond j joins sites j and j + 1.

    Raises
    ------
    TensegrityError
        Bad input, or another run, one of another scene or too few of its sites or instants.
    """
    from scipy.interpolate import make_interp_spline

    if not isinstance(run, Run):
        raise TensegrityError(f"run is {type(run).__name__}, not a Run")
    chain = run.scene
    if not isinstance(chain, Chain):
        raise TensegrityError(f"the scene of the run is {type(chain).__name__}, not a Chain")
    if chain.tune:
        raise TensegrityError("the springs change in time: their work passes through no bond")
    bond = check.whole("bond", bond, least=0, below=chain.sites - 1)
    if run.sites != tuple(range(chain.sites)):
        raise TensegrityError(f"{len(run.sites)} of {chain.sites} sites recorded: record all")
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
    work, impulse = make_interp_spline(run.t, rates, DEGREE).antiderivative()(run.t).T
    gaps = [np.abs(x - x[0] - y).max() for x, y in ((energy, work), (momentum, impulse))]
    change = np.abs(momentum - momentum[0]).max()
    return Budget(
        run.t, energy, momentum, work, impulse,
        float(gaps[0] / (abs(run.energy[0]) or 1.0)), float(gaps[1] / (change or 1.0)),
    )  # fmt: skip
