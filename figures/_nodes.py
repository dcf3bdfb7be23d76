"""Tensions of many prisms at given heights by all 18 coordinates of their nodes.

The largest model of a prism here: no symmetry is assumed and no unknown eliminated.  Upper and
lower nodes lie in parallel planes; Newton's method finds the rest, from the nodes found last.
Source: the talk, part III; the energy is that of `derivations.member`.
"""

from functools import cache

import numpy as np

from derivations.prism import REFERENCE_TWIST
from tensegrity import EquilibriumError
from tensegrity.engine.law import to_casadi

FREE = [3 * node + axis for node in range(6) for axis in (0, 1)]  # horizontal coordinates
UPPER = [11, 14, 17]  # heights of the upper nodes
ITERATIONS = 30
SMALL = 1e-13  # of the lengths: an update that leaves nothing to do


@cache
def _functions(count):
    """Gradient and Hessian of the energy in `count` sets of coordinates, and first positions."""
    import casadi as ca

    from derivations import member, prism

    c, x, shape = ca.SX.sym("c", 6), ca.SX.sym("x", 18), ca.SX.sym("shape", 3)
    energy = to_casadi(member.prism_energy(), (*member.POSITIONS, *member.CONSTANTS))
    hessian, gradient = ca.hessian(energy(*ca.vertsplit(x), *ca.vertsplit(c)), x)
    symbols = (prism.base, prism.twist, prism.height)
    place = to_casadi(member.symmetric_positions(), symbols)(*ca.vertsplit(shape))
    both = ca.Function("both", [x, c], [gradient, ca.densify(hessian)])
    return both.map(count), ca.Function("place", [shape], [ca.vertcat(*place)])


class Nodes:
    """As many prisms of one kind as there are heights.

    Parameters
    ----------
    prism : Prism
        With finite `k_base` and `k_bar`.
    count : int
    """

    def __init__(self, prism, count):
        self._both, place = _functions(count)
        self._constants = [prism.k_cross, prism.k_base, prism.k_bar, *prism.natural_lengths()]
        at_rest = np.array(place([prism.base, float(REFERENCE_TWIST), prism.height])).ravel()
        self._scale, self.places = prism.base, np.tile(at_rest, (count, 1))

    def tension(self, heights):
        """Axial tension [N] of each prism at its height [m]; (count,)."""
        self.places[:, UPPER] = np.asarray(heights)[:, None]
        for _ in range(ITERATIONS):
            gradient, hessian = (np.array(a) for a in self._both(self.places.T, self._constants))
            hessian = hessian.reshape(18, -1, 18).transpose(1, 0, 2)[:, FREE][:, :, FREE]
            rigid = self._rigid()
            stiff = hessian + np.einsum("nim,njm->nij", rigid, rigid)
            update = np.linalg.solve(stiff, -gradient.T[:, FREE, None])[..., 0]
            self.places[:, FREE] += update
            if np.abs(update).max() < SMALL * self._scale:
                return gradient.T[:, UPPER].sum(axis=1)
        raise EquilibriumError(f"no equilibrium of the nodes in {ITERATIONS} iterations")

    def _rigid(self):
        """Rigid motions in the plane, (count, 12, 3)."""
        motions = np.zeros((len(self.places), 6, 2, 3))
        motions[:, :, 0, 0] = motions[:, :, 1, 1] = 1
        flat = self.places.reshape(-1, 6, 3)[:, :, :2]
        motions[:, :, 0, 2], motions[:, :, 1, 2] = -flat[:, :, 1], flat[:, :, 0]
        return motions.reshape(-1, 12, 3) / self._scale
