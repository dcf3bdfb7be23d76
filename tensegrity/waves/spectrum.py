"""Small vibrations: modes of a scene about an equilibrium, and dispersion of a periodic chain.

Both linearise the forces.  The modes of a finite scene solve K x = w^2 M x with its sparse tangent
stiffness matrix K.  In a chain of identical cells the waves are u(n + 1) = exp(i q) u(n): those
of `tensegrity.lattices.bloch` in one dimension, as singular values, whose error is the round-off of
the largest frequency even as w tends to zero.
Source: L. Brillouin, Wave Propagation in Periodic Structures (1946), chapters III and IV.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import ArrayLike

from tensegrity import check, plotting
from tensegrity.checked import checked
from tensegrity.errors import EquilibriumError, TensegrityError
from tensegrity.lattices.bands import bands
from tensegrity.lattices.bloch import PairLattice, singular_frequencies
from tensegrity.minimum import lowest, round_off
from tensegrity.printing import Lines, Printed
from tensegrity.scenes.acting import per_coordinate
from tensegrity.scenes.dynamics import dynamics
from tensegrity.scenes.ensemble import Ensemble
from tensegrity.scenes.forcing import driven_entries
from tensegrity.scenes.pair_dynamics import is_pair_law
from tensegrity.scenes.picture import Picture
from tensegrity.scenes.scene import SMALLEST_MASS, Scene, State
from tensegrity.springs.potential import Potential
from tensegrity.typing import Array, Count, Motion

if TYPE_CHECKING:
    from matplotlib.axes import Axes

BOUND = 1e-6  # of the largest stiffness over mass: how far below zero the search starts
AT_REST = 1e-6  # force left on a site of an equilibrium, over those that meet there
MOVED = 1e-9  # the same over the largest stiffness times a length


@dataclass(frozen=True, eq=False, repr=False)
class Modes(Printed):
    """Normal modes of a scene about an equilibrium.

    Attributes
    ----------
    frequencies : ndarray, (count,)
        Angular frequencies [rad/s], ascending; 0 for motions without stiffness.
    shapes : ndarray, (count, *shape of the scene)
        Displacements of each [1/sqrt(kg)]: the sum of m u^2 is 1, the largest entry above 0.
    scene : Scene
    total : int
        Number of all modes of the scene, of which these are the first.
    """

    frequencies: Array
    shapes: Array
    scene: Scene = field(repr=False)
    total: int

    def __len__(self) -> int:
        return len(self.frequencies)

    def _lines(self) -> Lines:
        yield f"modes 1 to {len(self)} of {self.total}"
        for number, (frequency, shape) in enumerate(
            zip(self.frequencies, self.shapes, strict=True)
        ):
            motion = np.sum(shape.reshape(self.scene.sites, -1) ** 2, axis=1)
            yield (
                f"  {number + 1}: {frequency:.6g} rad/s, {frequency / (2 * np.pi):.6g} Hz, "
                f"site {int(motion.argmax())} moves most"
            )

    @checked
    def energies(self, motion: Motion) -> Array:
        """Energy of each mode by the linear law, (v^2 + w^2 u^2)/2 with the amplitudes u and v.

        Parameters
        ----------
        motion : State or Run
            Of the scene, all sites recorded; u counts from rest.

        Returns
        -------
        ndarray, (count,) or (instants, count)
            [J].  Of modes of one frequency, such as waves both ways along a ring, the sum counts;
            it is conserved where forces are linear.

        Raises
        ------
        TensegrityError
            A motion of another scene.

        Examples
        --------
        >>> from tensegrity import Chain, PowerLaw, modes
        >>> chain = Chain(PowerLaw(1.0, 1.0), sites=4, ends="periodic")
        >>> print(modes(chain, count=4).energies(chain.at_rest({0: 2.0})).sum().round(9))
        2.0
        """
        if not isinstance(motion, Motion):
            raise TensegrityError(f"motion {check.shown(motion)} is neither a State nor a Run")
        u = check.rows("displacements", motion.u, self.scene.shape)
        v = check.rows("velocities", motion.v, u.shape[u.ndim - len(self.scene.shape) :])
        if u.shape != v.shape:
            raise TensegrityError(f"displacements have shape {u.shape}, velocities {v.shape}")
        rows, shapes = (*u.shape[: u.ndim - len(self.scene.shape)], -1), self.shapes
        shapes = shapes.reshape(len(self), -1).T
        along = [dynamics(self.scene).momenta(x).reshape(rows) @ shapes for x in (u, v)]
        return np.asarray((along[1] ** 2 + (self.frequencies * along[0]) ** 2) / 2)

    def plot(self, ax: Axes | None = None, number: int = 0) -> Axes:
        """Draw a mode: of a chain displacement against site, of a network as arrows at its sites.

        Parameters
        ----------
        ax : matplotlib.axes.Axes, optional
            By default of a new figure.
        number : int, optional
            Of the mode, from 0.

        Returns
        -------
        matplotlib.axes.Axes

        Raises
        ------
        TensegrityError
            `ax` is not a Matplotlib axes, or there is no such mode.
        """
        number = check.whole("number", number, least=0, below=len(self))
        words = f"mode {number + 1} of {self.total}: {self.frequencies[number]:.6g} rad/s"
        shape = self.shapes[number]
        if shape.ndim > 1:
            picture = Picture(self.scene, ax)
            picture.arrows(shape)
            picture.ax.set_title(words, fontsize=10)
            return picture.ax
        drawn: Axes = plotting.axes(ax)
        drawn.plot(shape, "o-", ms=3, label=words)
        drawn.set(xlabel="site", ylabel="displacement [1/$\\sqrt{\\mathrm{kg}}$]")
        drawn.legend(frameon=False)
        return drawn


@checked
def modes(scene: Scene, about: State | None = None, count: Count = 10) -> Modes:
    """The normal modes of lowest frequency of a scene.

    Parameters
    ----------
    scene : Scene
        A `Chain`, a `Network`, or a scene built by `granular`, with its springs to the ground.
        Sites that are held, or whose motion is prescribed, are fixed; dashpots and prescribed
        forces are ignored.
    about : State, optional
        An equilibrium, with velocities 0; by default the scene at rest.
    count : int, optional
        Number of modes, in ascending order of frequency; all modes if there are fewer.

    Returns
    -------
    Modes

    Raises
    ------
    TensegrityError
        Bad input.
    EquilibriumError
        The forces at `about` do not balance, or the equilibrium is unstable.

    Examples
    --------
    Six unit masses between fixed ends, 2 sqrt(k/m) sin(j pi/14):

    >>> import sympy as sp
    >>> from tensegrity import Chain, Potential, modes
    >>> r = sp.Symbol("r")
    >>> chain = Chain(Potential(r**2 / 2, r), sites=8, ends=("fixed", "fixed"))
    >>> modes(chain, count=3).frequencies.round(4)
    array([0.445 , 0.8678, 1.247 ])
    """
    if isinstance(scene, Ensemble):
        raise TensegrityError("scene is an Ensemble: give one of its scenes")
    if not all(one.stores for one in dynamics(scene).further_forces):
        raise TensegrityError("modes: not for scenes with forces other than those of springs")
    u = scene.at_rest().u if about is None else _equilibrium(scene, about)
    listed = dynamics(scene).listed(u).scene
    stiffness = listed.stiffness(u)
    _refuse_moving(listed, u, stiffness)
    moves = np.ones(scene.shape, dtype=bool)
    moves[list(scene.held)] = False
    moves.reshape(-1)[driven_entries(scene, True)[0]] = False
    free = np.flatnonzero(moves.ravel())
    count = min(count, free.size)
    mass = _inertia(scene, free)
    of = stiffness[free][:, free], mass
    squares, vectors = lowest(*of, np.zeros((free.size, 0)), count, BOUND)
    if squares.min(initial=0.0) < 0:
        raise EquilibriumError(
            f"the equilibrium is unstable: the lowest stiffness over mass is below "
            f"{-round_off(*of):.3g} 1/s^2"
        )
    shapes = np.zeros((count, moves.size))
    shapes[:, free] = vectors.T
    largest = shapes[np.arange(count), np.abs(shapes).argmax(axis=1)]
    shapes *= np.sign(largest)[:, None]
    return Modes(np.sqrt(squares), shapes.reshape(count, *scene.shape), scene, free.size)


def _inertia(scene: Scene, free: Any) -> Any:
    """Masses of the free coordinates [kg], or of bonds with mass their mass matrix."""
    if scene.bond_mass is None:
        return per_coordinate(scene, scene.mass).ravel()[free]
    from scipy.sparse import eye_array, kron

    whole = kron(dynamics(scene).mass_matrix, eye_array(scene.dim), format="csr")
    return whole[free][:, free]


def _equilibrium(scene: Scene, about: State) -> Array:
    scene.check(about)
    fastest = float(np.max(np.abs(about.v), initial=0.0))
    if fastest:
        raise EquilibriumError(f"velocity {fastest:g} m/s of an equilibrium must be 0")
    return about.u


def _refuse_moving(scene: Scene, u: Array, stiffness: Any) -> None:
    """Refuse displacements at which the forces on some site are not balanced."""
    of, left = dynamics(scene), float(np.max(np.abs(scene.forces(u)), initial=0.0))
    tensions = np.abs(of.springs.evaluate("tension", of.elongations(u)))
    meet = float(np.max(tensions, initial=0.0)) + float(np.max(np.abs(scene.loads), initial=0.0))
    lengths = [spring.length or 1.0 for spring in of.springs.different]
    stiffest = float(np.max(stiffness.diagonal(), initial=0.0))
    allowed = AT_REST * meet + MOVED * stiffest * min(lengths, default=1.0)
    if left > allowed:
        raise EquilibriumError(
            f"the unbalanced force {left:.6g} N on a site must be at most {allowed:.6g} N: the "
            "state is not an equilibrium"
        )


def dispersion(
    springs: Potential | Sequence[Potential],
    masses: float | Sequence[float],
    wavenumbers: ArrayLike,
    ground: Potential | Sequence[Potential] | None = None,
) -> Array:
    """Dispersion relation of a periodic chain: the angular frequencies of its linear waves.

    Parameters
    ----------
    springs : Potential or sequence of Potential
        Springs of one cell, measured from their equilibrium: spring j joins masses j and j + 1,
        and the last spring joins the last mass to the first one of the next cell.  A `PairLaw`, or
        several, may take their place.
    masses : float or sequence of float
        Masses of one cell [kg], > 0: one for each spring, or one for all; of pair laws the
        inertias of one site, (dim,), or of all, (sites, dim).
    wavenumbers : array_like, (wavenumbers,)
        Phase difference between adjacent cells [rad].
    ground : Potential or sequence of Potential, optional
        Springs between the masses of a cell and the ground, measured from their equilibrium.

    Returns
    -------
    ndarray, (wavenumbers, branches)
        [rad/s], ascending in each row, with one branch for each mass of a cell.  Of pair laws they
        are below 0 where a wave is unstable, see `bands`.

    Raises
    ------
    TensegrityError
        Bad input, or a spring whose stiffness at rest is negative or not finite.

    Examples
    --------
    Acoustic and optical branch of a diatomic chain, with the band gap at q = pi:

    >>> import numpy as np
    >>> import sympy as sp
    >>> from tensegrity import Potential, dispersion
    >>> r = sp.Symbol("r")
    >>> dispersion(Potential(r**2 / 2, r), [1.0, 2.0], [0.0, np.pi]).round(4)
    array([[0.    , 1.7321],
           [1.    , 1.4142]])
    """
    if is_pair_law(springs):
        return _of_pairs(_cell("springs", springs), masses, wavenumbers, ground)
    stiffness = _stiffnesses("springs", springs)
    held = np.zeros(1) if ground is None else _stiffnesses("ground", ground)
    m = np.array(
        [check.number("mass", x, least=SMALLEST_MASS, unit="kg") for x in _cell("masses", masses)]
    )
    count = max(len(stiffness), len(m), len(held))
    if {len(stiffness), len(m), len(held)} - {1, count}:
        more = "" if ground is None else f", {len(held)} springs to the ground"
        raise TensegrityError(f"{len(stiffness)} springs{more} and {len(m)} masses form no cell")
    q = check.floats("wavenumbers", wavenumbers)
    if q.ndim != 1:
        raise TensegrityError(f"wavenumbers have shape {q.shape}, must be (wavenumbers,)")
    q = check.vector("wavenumbers", q, q.shape)
    stiffness, m, held = (np.broadcast_to(x, count) for x in (stiffness, m, held))
    each = np.arange(count)
    ends = np.stack([each, (each + 1) % count], axis=1)
    next_cell = (each == count - 1).astype(np.int64)[:, None]
    if ground is not None:  # one more node, of infinite mass
        ends = np.concatenate([ends, np.stack([each, np.full(count, count)], axis=1)])
        next_cell = np.concatenate([next_cell, 0 * next_cell])
        stiffness, m = np.append(stiffness, held), np.append(m, np.inf)
    roots = np.sqrt(stiffness)[:, None, None]
    return singular_frequencies(ends, next_cell, roots, m, q[:, None])[:, -count:]


def _of_pairs(laws: Sequence[Any], masses: Any, wavenumbers: ArrayLike, ground: Any) -> Array:
    """Frequencies of a row of pair laws."""
    if ground is not None:
        raise TensegrityError("ground must not be given with a pair law, which has `site`")
    count = len(laws)
    bonds = [(j, (j + 1) % count, int(j == count - 1), law) for j, law in enumerate(laws)]
    places = np.arange(count, dtype=float)[:, None]
    lattice = PairLattice([[float(count)]], places, bonds, masses)
    q = check.floats("wavenumbers", wavenumbers)
    if q.ndim != 1:
        raise TensegrityError(f"wavenumbers have shape {q.shape}, must be (wavenumbers,)")
    return bands(lattice, q[:, None]).frequencies


def _stiffnesses(name: str, given: Any) -> Array:
    """Stiffnesses at rest [N/m] of the springs of a cell."""
    springs = _cell(name, given)
    for number, spring in enumerate(springs):
        check.kind(f"spring {number} of {name}", spring, Potential)
    stiffnesses = np.array([float(spring.stiffness(0.0)) for spring in springs])
    bad = np.flatnonzero(~(np.isfinite(stiffnesses) & (stiffnesses >= 0)))
    if bad.size:
        raise TensegrityError(
            f"stiffness {stiffnesses[bad[0]]:g} N/m of spring {bad[0]} at rest must be at least 0"
        )
    return stiffnesses


def _cell(name: str, given: Any) -> tuple[Any, ...]:
    """The springs or masses of a cell as a tuple, at least one."""
    if isinstance(given, (str, bytes, dict)):
        raise TensegrityError(f"{name} {check.shown(given)} must be a sequence")
    many = given.ndim if isinstance(given, np.ndarray) else isinstance(given, Sequence)
    cell = tuple(given) if many else (given,)
    if not cell:
        raise TensegrityError(f"{name} of a cell is empty, must have one or more")
    return cell
