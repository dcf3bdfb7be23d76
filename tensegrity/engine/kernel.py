"""The compiled loop that advances a scene.

| | chain | network in 1, 2, 3 dimensions |
|---|---|---|
| parameters in common, or of each bond | yes | yes |
| batch of scenes | in blocks of 64, a loop each | a loop each |
| threads | of blocks; parts of long chains, splittings | of scenes; parts of large, splittings |
| walls, loads | no: a network on a line has them | yes |
| bonds with mass | no | yes, one thread; all methods but "midpoint" |
| ring | yes, one scene, one thread; all methods but "midpoint" | no |
| "corrected6" | yes, also batches, one thread | yes |
| implicit steps | yes, a batch scene by scene | yes, one thread |
| fitted forces | yes | yes |
| prescribed motions, forces in time | yes, one scene, one thread | yes, one thread |
| dashpots | in bonds and to the ground | in bonds and to the ground |
| forces of velocity | yes, Runge-Kutta, one thread | yes, Runge-Kutta, one thread |
| springs that change in time | yes, all equal, one scene, one thread | yes, all equal, one thread |

Bonds that join neighbours in order, without walls and loads, are a chain whatever the class of the
scene: a stage is one pass over them.  A processor advances a batch of short chains in the time of
one, as their sites fill SIMD registers; the contacts of a network fill these already.
"""

from __future__ import annotations

from tensegrity.engine import threaded
from tensegrity.engine.bound import Bound
from tensegrity.engine.compiled import compiled
from tensegrity.engine.methods import Splitting


def bind(u, v, bonds, method, dt, loop=None, divided=True):
    """Prepare a loop that advances the rows `u` and `v` in place.

    Parameters
    ----------
    u, v : ndarray, C-contiguous
        (sites,), (sites, batch), or (rows, dim): sites, walls, and a spare row.
    bonds : Bonds
    method : Method
    dt : float
        Step [s].
    loop : Compiled, optional
        By default the loop of the bonds.
    divided : bool, optional
        Whether a long chain or a large network may be advanced on several threads.

    Returns
    -------
    Bound

    Raises
    ------
    CompilerError
        There is no C compiler.
    """
    batch = 1 if bonds.dim or u.ndim == 1 else u.shape[1]
    if loop is None:
        loop = compiled(bonds.laws, bonds.own, bonds.dim, batch)
    large = len(bonds.group) > threaded.MANY if bonds.dim else u.size > threaded.LONG and batch == 1
    divided = divided and large and bonds.independent and bonds.stretch is None
    divided = divided and isinstance(method, Splitting)
    count = threaded.threads() if divided else 1
    if count > 1:
        kind = threaded.ThreadedNetwork if bonds.dim else threaded.ThreadedChain
        return kind(loop, u, v, bonds, method, dt, count)
    return Bound(loop, u, v, bonds, method, dt)
