"""The text of explicit steps outside of C: for arrays, and for CasADi's expressions of them.

A step is a function (acceleration, u, v, moved) -> u, v, where acceleration(u) gives the
accelerations and moved(change of u) is told of every move.
"""

from __future__ import annotations


def split(kicks, drifts):
    """Kicks of velocities and drifts of displacements in turn; both times dt."""

    def step(acceleration, u, v, moved):
        for kick, drift in zip(kicks, drifts, strict=True):
            if kick:
                v = v + kick * acceleration(u)
            if drift:
                move = drift * v
                moved(move)
                u = u + move
        return u, v

    return step


def merged(method, dt):
    """Steps of a splitting in a row: the first, each of the others, and what closes the last.

    The closing kick of a step and the first of the next are one.
    """
    kicks, drifts = [dt * kick for kick in method.kicks], [dt * drift for drift in method.drifts]
    *opening, closing = kicks
    repeated = [opening[0] + closing, *opening[1:]]
    last = split([closing], [0.0]) if closing else None
    return split(opening, drifts), split(repeated, drifts), last


def nystrom(method, dt):
    """A step of an explicit Runge-Kutta-Nystrom method."""

    def combined(value, factor, coefficients, slopes):
        for coefficient, slope in zip(coefficients, slopes, strict=False):
            if coefficient:
                value = value + factor * coefficient * slope
        return value

    def step(acceleration, u, v, moved):
        slopes = []
        for node, row in zip(method.nodes, method.matrix, strict=True):
            slopes.append(acceleration(combined(u + node * dt * v, dt**2, row, slopes)))
        move = combined(dt * v, dt**2, method.positions, slopes)
        moved(move)
        return u + move, combined(v, dt, method.velocities, slopes)

    return step
