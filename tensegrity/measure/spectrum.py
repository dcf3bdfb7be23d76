"""Wave numbers and frequencies in the recorded motion of a run, by Fourier transforms.

A travelling wave a cos(q j - w t) of site j has the amplitude a at its wave number q and frequency
w.  In time the rows are weighted by a Hann window, in space too unless they are a whole ring;
between two frequencies a line is located by a parabola through the logarithms of amplitudes, with
an error below .016 of the resolution 2 pi/T.
Source: F. J. Harris, Proc. IEEE 66, 51 (1978), windows; M. Gasior & J. L. Gonzalez, AIP Conf. Proc.
732, 276 (2004), parabola.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field
from typing import TYPE_CHECKING, Any

import numpy as np

from tensegrity import check, plotting
from tensegrity.checked import checked
from tensegrity.errors import TensegrityError
from tensegrity.printing import Lines, Printed, drawn
from tensegrity.runs.run import Run
from tensegrity.scenes.chain import Chain
from tensegrity.scenes.dynamics import dynamics
from tensegrity.typing import Array, Fraction, Indices
from tensegrity.unit_names import in_units
from tensegrity.waves.spectrum import dispersion

if TYPE_CHECKING:
    from matplotlib.axes import Axes

UNEVEN = 1e-6  # of the interval, by which rows may be farther apart or nearer
LEAST = 8  # rows: of fewer no line can be located
SHOWN = 3  # largest waves that are printed
CURVE = 400  # wave numbers at which bands are drawn
CELLS = 4  # cells of which a chain must consist, for its bands to be drawn


@dataclass(frozen=True, eq=False, repr=False)
class Spectrum(Printed):
    """Amplitudes of the waves in a motion; the result of `spectrum`.

    Attributes
    ----------
    wavenumbers : ndarray, (wavenumbers,)
        Phase between neighbouring sites [rad], ascending, above -pi and at most pi where these are
        all recorded; > 0 of waves that travel towards higher sites.
    frequencies : ndarray, (frequencies,)
        Angular frequencies [rad/s], ascending from 0.
    amplitude : ndarray, (frequencies, wavenumbers) or (frequencies, wavenumbers, dim)
        Of the waves, in the unit of the rows: a cos(q j - w t) has a at q and w; a standing wave
        has half of its amplitude at q and half at -q, all of it where q is 0 or pi.
    of : str
        Name and unit of the rows.
    cell : (list of Potential, ndarray) or None
        Springs and masses [kg] of one cell, if the scene is a chain of equal cells.
    """

    wavenumbers: Array
    frequencies: Array
    amplitude: Array = field(repr=False)
    of: str = "u [m]"
    cell: tuple[Any, Array] | None = field(default=None, repr=False)

    _draw = drawn

    @property
    def total(self) -> Array:
        """Amplitudes of all coordinates together, (frequencies, wavenumbers)."""
        size = self.amplitude
        return size if size.ndim == 2 else np.asarray(np.sqrt(np.sum(size**2, axis=-1)))

    @property
    def participation(self) -> float:
        """Participation number: how many wave numbers share the motion, (sum p)^2 / sum p^2 of the
        sums p of squared amplitudes; 0 without motion."""
        largest = self.total.max(initial=0.0)
        if not largest:
            return 0.0
        shares = np.sum((self.total / largest) ** 2, axis=0)
        return float(shares.sum() ** 2 / np.sum(shares**2))

    @checked
    def ridge(self, least: Fraction = 1e-3) -> tuple[Array, Array]:
        """The strongest frequency at each wave number.

        Parameters
        ----------
        least : float, optional
            Amplitude, over the largest of all, below which a wave number is left out.

        Returns
        -------
        wavenumbers, frequencies : ndarray, (lines,)
            [rad], [rad/s], between the frequencies of the spectrum by a parabola through the
            logarithms of three amplitudes.
        """
        total = self.total
        strong = np.flatnonzero(total.max(axis=0) > least * total.max(initial=0.0))
        top = total[:, strong].argmax(axis=0)
        at = np.clip(top, 1, len(total) - 2)
        three = [total[at + k, strong] for k in (-1, 0, 1)]
        inside = (top == at) & (np.min(three, axis=0) > 0)
        low, middle, high = np.log(np.where(inside, three, 1.0))
        bend = np.where(inside, low - 2 * middle + high, -1.0)
        shift = np.where(inside, (low - high) / (2 * bend), 0.0)
        return self.wavenumbers[strong], self.frequencies[1] * (top + shift)

    def _lines(self) -> Lines:
        apart = self.frequencies[1]
        yield (
            f"spectrum of {self.of}: {len(self.wavenumbers)} wave numbers, frequencies to "
            f"{self.frequencies[-1]:.6g} rad/s, {apart:.6g} rad/s apart"
        )
        yield f"  {self.participation:.4g} wave numbers take part"
        size = self.total.max(axis=0)
        q, w = self.ridge()
        size = size[np.isin(self.wavenumbers, q)]
        for k in np.argsort(-size)[:SHOWN]:
            yield f"  {q[k]:+.6f} rad a site at {w[k]:.6f} rad/s: amplitude {size[k]:.4g}"

    def plot(self, ax: Axes | None = None) -> Axes:
        """Amplitudes over wave number and frequency, and the bands of a chain of equal cells.

        Parameters
        ----------
        ax : matplotlib.axes.Axes, optional
            By default of a new figure.

        Returns
        -------
        matplotlib.axes.Axes
            Amplitudes on a logarithmic scale; bands are dashed, and end with the wave numbers.
        """
        axes: Axes = plotting.axes(ax)
        image = axes.pcolormesh(
            self.wavenumbers, self.frequencies, self.total, shading="nearest", rasterized=True,
            **plotting.logarithmic(self.total),
        )  # fmt: skip
        axes.figure.colorbar(image, ax=axes, label=in_units(f"amplitude of {self.of}"))
        if self.cell is not None:
            springs, masses = self.cell
            q = np.linspace(self.wavenumbers[0], self.wavenumbers[-1], CURVE)
            axes.plot(
                q, dispersion(springs, masses.tolist(), len(masses) * q), "--", color="w", lw=1
            )
        top = self.frequencies[-1]
        axes.set(xlabel="wave number [rad/site]", ylabel=in_units("frequency [rad/s]"))
        axes.set_ylim(0, top)
        return axes


@checked
def spectrum(run: Run, sites: Sequence[int] | None = None, of: str = "u") -> Spectrum:
    """Wave numbers, frequencies and amplitudes of the waves in a run.

    Parameters
    ----------
    run : Run
        Of a chain, or of a network whose sites stand in a row in the order of their numbers;
        recorded at even intervals.  Its resolution is 2 pi over their duration; frequencies above
        pi over the interval appear below it.
    sites : sequence of int, optional
        Recorded sites, evenly spaced and ascending; by default all that are recorded.
    of : {"u", "v"}, optional
        Displacements or velocities.

    Returns
    -------
    Spectrum

    Raises
    ------
    TensegrityError
        Sites or instants that are not evenly spaced, fewer than 8 instants, or sites that were not
        recorded.

    Examples
    --------
    >>> import numpy as np
    >>> import sympy as sp
    >>> from tensegrity import Chain, Potential, Record, State, dispersion, simulate, spectrum
    >>> r = sp.Symbol("r")
    >>> chain = Chain(Potential(r**2 / 2, r), sites=32)
    >>> sound = State(0.1 * np.cos(np.pi / 4 * (np.arange(32) + 0.5)), np.zeros(32))
    >>> run = simulate(chain, sound, 255.5, dt=0.05, record=Record(interval=0.5))
    >>> q, w = spectrum(run).ridge(0.9)
    >>> print(q / np.pi, w.round(3), dispersion(chain.springs[0], 1.0, [np.pi / 4])[0].round(3))
    [-0.25  0.25] [0.766 0.766] [0.765]
    """
    if not isinstance(of, str) or of not in ("u", "v"):
        raise TensegrityError(f"of {check.shown(of)} must be 'u' or 'v'")
    columns, step = _columns(run, sites)
    whole = len(columns) == run.scene.sites and getattr(run.scene, "ends", None) == "periodic"
    q, w, size = of_rows(run.t, getattr(run, of)[:, columns], step, whole)
    return Spectrum(q, w, size, f"{of} [{'m' if of == 'u' else 'm/s'}]", _cell(run.scene))


def of_rows(t: Array, rows: Array, step: int = 1, whole: bool = False) -> tuple[Array, ...]:
    """Wave numbers, frequencies and amplitudes of rows.

    Parameters
    ----------
    t : ndarray, (T,)
        Evenly spaced [s].
    rows : ndarray, (T, places) or (T, places, dim)
    step : int, optional
        Sites from one place to the next.
    whole : bool, optional
        Whether the places are a whole ring.

    Returns
    -------
    wavenumbers, frequencies, amplitude : ndarray
        As of `Spectrum`.

    Raises
    ------
    TensegrityError
        Instants that are not evenly spaced, or fewer than 8.
    """
    count, places = rows.shape[:2]
    if count < LEAST:
        raise TensegrityError(f"{count} instants are too few for a spectrum, must be {LEAST}")
    intervals, interval = np.diff(t), (t[-1] - t[0]) / (count - 1)
    uneven = int(np.argmax(np.abs(intervals - interval)))
    if not abs(intervals[uneven] - interval) <= UNEVEN * interval:
        raise TensegrityError(
            f"instants {t[uneven]:.9g} s and {t[uneven + 1]:.9g} s are {intervals[uneven]:.6g} s "
            f"apart, must be {interval:.6g} s: record at even intervals"
        )
    in_time, in_space = _hann(count), np.ones(places) if whole else _hann(places)
    weighted = rows * (in_time[:, None] * in_space).reshape(count, places, *[1] * (rows.ndim - 2))
    size = np.abs(np.fft.ifft(np.fft.rfft(weighted, axis=0), axis=1)) * places
    size *= 2 / (in_time.sum() * in_space.sum())
    size[0] /= 2
    if count % 2 == 0:
        size[-1] /= 2
    q = 0.0 - 2 * np.pi * np.fft.fftfreq(places)  # above -pi, at most pi
    order = np.argsort(q)
    return (
        q[order] / step,
        2 * np.pi * np.fft.rfftfreq(count, interval),
        size[:, (-np.arange(places) % places)[order]],
    )


def _hann(count: int) -> Array:
    """Weights of one period of Hann's window; 1 of a single row."""
    return np.ones(1) if count == 1 else 0.5 - 0.5 * np.cos(2 * np.pi * np.arange(count) / count)


def _columns(run: Run, sites: Sequence[int] | None) -> tuple[Indices, int]:
    """Columns of evenly spaced sites, and their distance in sites."""
    column = {site: k for k, site in enumerate(run.sites)}
    numbers = run.sites
    if sites is not None:
        given = check.sequence("sites", sites, "site numbers")
        numbers = tuple(check.whole("site", s, least=0, below=run.scene.sites) for s in given)
    if not numbers:
        raise TensegrityError("sites is empty: no spectrum")
    for site in numbers:
        if site not in column:
            raise TensegrityError(f"site {site} was not recorded")
    steps = np.unique(np.diff(numbers))
    if len(steps) > 1 or (len(steps) and steps[0] < 1):
        raise TensegrityError(
            f"sites {check.shown(list(numbers))} must ascend in even steps for wave numbers"
        )
    return np.array([column[s] for s in numbers]), int(steps[0]) if len(steps) else 1


def _cell(scene: Any) -> tuple[Any, Array] | None:
    """Springs and masses of the smallest cell that a chain repeats."""
    if not isinstance(scene, Chain) or dynamics(scene).further_forces:
        return None
    if dynamics(scene).springs.changing:
        return None
    kind = dynamics(scene).springs.group
    for count in range(1, scene.sites // CELLS + 1):
        if all(np.array_equal(x[count:], x[:-count]) for x in (kind, scene.mass)):
            return list(scene.springs[:count]), scene.mass[:count]
    return None
