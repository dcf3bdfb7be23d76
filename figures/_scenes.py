"""The wave scenes: small pure functions that return a chain, its state and a duration.

Base, cross strings and masses are those of the units: base 1 m, k_cross 1 N/m, mass 1 kg, unless
a scene states otherwise.  Source: the talk, part III.
"""

from functools import cache

from figures._measure import Scene
from tensegrity import Chain, Polynomial, Potential, PowerLaw, Prism, solitary_wave

VISITED = 0.6, 0.9  # of the domain of the softening prism that a polynomial covers


@cache
def rigid(height, prestrain, preload=0.0, k_cross=1.0):
    """Spring of a prism with rigid bases and bars."""
    return Prism(1.0, height, prestrain, k_cross).potential(preload)


@cache
def softening_exact(preload=0.05):
    """Spring of a thick elastic prism that softens up to a limit point."""
    return Prism(1.0, 0.5, 0.4, 1.0, k_base=2.0, k_bar=20.0).potential(preload)


@cache
def softening(preload=0.05):
    """The same as a polynomial over most of its domain: an order of magnitude cheaper to run."""
    exact = softening_exact(preload)
    return Polynomial(exact, VISITED[0] * exact.domain[0], VISITED[1] * exact.domain[1])


def softening_sound_speed(preload=0.05):
    """Speed of sound in the softening chain [sites/s]."""
    return softening(preload).sound_speed()


def launched(wave, sites, at, travel):
    """An exact wave on a chain of its own springs."""
    chain = Chain(wave.potential, sites, mass=wave.mass)
    return Scene(chain, wave.launch(chain, at=at), travel / wave.speed)


def impact(spring, sites, speeds, duration, ends=("free", "free"), mass=1.0):
    """Sites given a velocity: {site: velocity}."""
    chain = Chain(spring, sites, mass, ends)
    return Scene(chain, chain.at_rest(speeds), duration)


def collision(spring, speed_ratio, meeting, distance=40, travel=120):
    """Two equal waves head-on that meet at `meeting`, counted from a mass in the middle."""
    wave = solitary_wave(spring, speed_ratio=speed_ratio)
    sites = 2 * (travel + distance) + 1
    chain, middle = Chain(spring, sites), sites // 2 + meeting
    state = wave.launch(chain, middle - distance) + wave.launch(chain, middle + distance, -1)
    return Scene(chain, state, (distance + travel) / wave.speed)


def linear(stiffness):
    """Spring of a linear chain."""
    import sympy as sp

    r, k = sp.symbols("r k")
    return Potential(k * r**2 / 2, r, {k: stiffness}, length=1.0)


def power(exponent, preload=0.0):
    """Spring of a power law; precompressed by 1 m under a preload of 1 N."""
    return PowerLaw(1.0, exponent, preload, length=1.0)
