"""What a step with a known quadrature error is corrected by where contacts open or close.

The force of a contact is strength overlap^exponent, from an opening on 0.  A method of steps
integrates it like the quadrature that its kicks are, and the error of that next to a root of the
overlap is known in closed form: `derivations.openings`.  Here are its tables, and the same text
as in `openings.c` in NumPy, where there is no compiler.
"""

from __future__ import annotations

import math

import numpy as np

from tensegrity.engine import forces
from tensegrity.once import once

NEAR = 1.0  # steps beside one that stands alone, whose events tell in it
SERIES, ROUNDS = 24, 4  # terms of the motion in linear contacts; in which their forces are found
DEGREE = 20  # of the polynomials for the zeta functions, which are as good as their sums
TERMS, BERNOULLI = 8, (1 / 6, -1 / 30, 1 / 42, -1 / 30, 5 / 66, -691 / 2730, 7 / 6, -3617 / 510)
LOWEST, HIGHEST = 1.0, 3.0  # exponents for which the order was seen
TREATED = 3  # order over the exponent where contacts are corrected


def hurwitz(s, q):
    """Hurwitz' zeta function of real order s, not 1, for q > 0: sum of (q + n)^-s, continued.

    SciPy's is no number for s < 1.  The first terms, and Euler's and Maclaurin's sum of the rest.
    """
    q = np.asarray(q, dtype=np.longdouble)  # large terms nearly cancel
    total = sum((q + n) ** -s for n in range(TERMS))
    far = q + TERMS
    total = total + far ** (1 - s) / (s - 1) + far**-s / 2
    rising, factorial = s, 2.0
    for k, number in enumerate(BERNOULLI, start=1):
        total = total + number / factorial * rising * far ** (-s - 2 * k + 1)
        rising *= (s + 2 * k - 1) * (s + 2 * k)
        factorial *= (2 * k + 1) * (2 * k + 2)
    return np.asarray(total, dtype=float)


@once
def zetas(exponent):
    """Coefficients in t = 2 q - 1 of zeta(s, 1 + q), for s = -exponent, -exponent - 1 and
    1 - exponent; (3, DEGREE + 1).  What is left of zeta(s, q) is q^-s."""
    from numpy.polynomial import chebyshev

    t = chebyshev.chebpts1(DEGREE + 8)
    orders = -exponent, -exponent - 1, 1 - exponent
    found = [chebyshev.chebfit(t, hurwitz(s, 1 + (1 + t) / 2), DEGREE) for s in orders]
    return np.array([chebyshev.cheb2poly(one) for one in found])


def beta(exponent):
    """Integral of (y (1 - y))^exponent over (0, 1)."""
    return math.exp(2 * math.lgamma(exponent + 1) - math.lgamma(2 * exponent + 2))


def is_treated(exponent):
    """Whether contacts of that exponent are corrected; NaN is not."""
    return (exponent >= LOWEST) & (exponent <= HIGHEST)


class Openings:
    """Contacts of a scene that open, for steps of `dt`.

    Attributes
    ----------
    place, side, strength : ndarray, (corners, *shape of the springs of all bonds)
        A contact is closed where its overlap, side (elongation - place), is positive [m]; then
        its tension has the part side strength overlap^exponent [N].  A force with several corners
        is that of several contacts; NaN behind the last one of a bond.
    row : ndarray of int, shape of these
        In `exponents`.
    exponents : ndarray, (rows,)
    tables : ndarray, (rows, 3, DEGREE + 1)
    """

    def __init__(self, bonds, method, dt):
        self.bonds, self.dt = bonds, dt
        self.nodes, self.weights, self.offsets = method.rule
        place, strength, exponent, side = np.moveaxis(bonds.openings, -1, 0)
        within = is_treated(exponent)
        self.exponents = np.unique(exponent[within])
        rows = np.searchsorted(self.exponents, np.where(within, exponent, 0.0))
        self.place, self.side, self.strength = (
            np.where(within, x, np.nan)[:, bonds.group] for x in (place, side, strength)
        )
        self.row = np.where(within, rows, 0)[:, bonds.group]
        self.tables = np.array([zetas(x) for x in self.exponents.tolist()])
        self.betas = np.array([beta(x) for x in self.exponents.tolist()])
        self._first, self._second = forces.ends(bonds)
        mass = np.asarray(bonds.inverse_mass, dtype=float)
        self._weights = mass if bonds.contacts is None else bonds.contacts.weights(mass)

    def overlaps(self, u, v):
        """Overlap of each contact, (corners, bonds), and its change in a step at the rate of the
        moment [m]."""
        r, along = forces.elongations(self.bonds, u)
        w = v[self._second] - self._of_pair(v[self._first])
        rate = w if self.bonds.contacts is None else np.sum(along * w, axis=-1)
        return self.side * (r - self.place), self.side * self.dt * rate

    def _of_pair(self, x):
        """Rows of the first sites, 0 for walls."""
        if self.bonds.contacts is None:
            return x
        return np.where((self.bonds.contacts.kind == 0)[:, None], x, 0.0)

    def corrected(self, u, v, a, before, begins=False, alone=False):
        """Correct u and v after a step, in place; returns the overlaps then.  Contacts are known
        by number of the corner, and of the bond.

        Parameters
        ----------
        u, v, a : ndarray
            Rows of displacements, velocities and accelerations at the end of the step.
        before : tuple
            What `overlaps` said at its begin.
        begins : bool, optional
            Whether it is the first of a run: then no kicks were before.
        alone : bool, optional
            Whether no steps are before it and none behind.
        """
        (w0, d0), (w1, d1) = before, self.overlaps(u, v)
        passed = (w0 > 0) != (w1 > 0)
        turned = (w0 * d0 < 0) & (w1 * d1 > 0)
        near = 4 * np.minimum(np.abs(w0), np.abs(w1)) < np.abs(d0) + np.abs(d1)
        there = u.copy(), v.copy()
        for b in map(tuple, np.argwhere(passed | (turned & near) | alone | begins).tolist()):
            line = self._line_of(b, *there, a)
            for x, *push in self._pushes(b, line, w0[b], d0[b], w1[b], d1[b], begins, alone):
                self._give(b, w1[b], x, *push, *line(x), u, v)
        return self.overlaps(u, v)

    def _pushes(self, b, line, w0, d0, w1, d1, begins, alone):
        """For each event in a step, and beside one that stands alone: where, and the sums of
        `_event` or of `_touch`."""
        p, swing = through(w0, d0, w1, d1), self._swing(b, line)
        found = []  # place, and whether it opens
        if (w0 > 0) != (w1 > 0):
            found = [(root(p, 0.0, 1.0), w0 > 0)]
            if self.exponents[self.row[b]] == 1:
                return self._linear(b, line, w0, d0, w1, d1, found[0][0])
        elif w0 * d0 < 0 < w1 * d1:
            turn = root((p[1], 2 * p[2], 3 * p[3], 0.0), 0.0, 1.0)
            pull = 2 * p[2] + 6 * p[3] * turn - swing(turn)
            felt = value(p, self.nodes) + pull * self.offsets > 0
            if (value(p, turn) > 0) != (w0 > 0) and np.any(felt != (w0 > 0)):  # else it is left
                found = [(root(p, 0.0, turn), True), (root(p, turn, 1.0), False)]
                if not w0 > 0:
                    (one, _), (other, _) = found
                    return [self._touch(b, p, one, other, swing((one + other) / 2))]
        beside = [(0.0, -NEAR, False)] * (alone or begins) + [(1.0, 1 + NEAR, True)] * alone
        found += [
            (root(p, *sorted((here, there))), opens)
            for here, there, opens in beside
            if value(p, here) > 0 > value(p, there)
        ]
        return [self._of_step(b, p, x, opens, swing(x), begins, alone) for x, opens in found]

    def _linear(self, b, line, w0, d0, w1, d1, x):
        """The same of a contact of exponent 1 that opened or closed: its kicks and its motion are
        those of a linear spring beside forces that grow linearly, which the ends of the step tell.
        """
        opens, turn, along = w0 > 0, self._swing(b, line)(x), line(x)[0]
        ends = [self._weights[row[b[1]]] for row in (self._first, self._second)]
        own = self.dt**2 * self.strength[b] * float(np.sum(along**2 * sum(ends)))
        kicks, motion, end, rate = np.zeros(2), np.zeros(2), w1, d1
        for _ in range(ROUNDS):
            way, change = w1 - w0 - d0 - turn / 2 + own * kicks[1], d1 - d0 - turn + own * kicks[0]
            grows = 6 * (change - 2 * way)
            kicks = self._kicked(own, w0, d0, change - grows / 2, grows, turn)
        force, sign = change - grows / 2 + turn, 1
        if opens:  # from its open end on, backwards
            force, sign = force + grows, -1
        for _ in range(ROUNDS):
            w, change = (end, -rate) if opens else (w0, d0)
            p = w, change, force / 2, sign * grows / 6
            if not w <= 0 < value(p, 1.0):
                return []
            x = root(p, 0.0, 1.0)
            motion = moved(own, slope(p, x), force + sign * grows * x, sign * grows, 1 - x)
            if not opens:
                break
            begin = w0 - value(p, 1.0) + own * motion[1], d0 + slope(p, 1.0) - own * motion[0]
            end, rate = end + sum(begin), rate + begin[1]
        if opens:
            x, motion = 1 - x, (motion[0], motion[0] - motion[1])
        total, shift = self.strength[b] * (np.array(motion) - kicks)
        moment = shift - (1 - x) * total
        return [(x, total, moment, -moment)]

    def _kicked(self, own, w, rate, force, grows, turn):
        """Sum over the kicks of a step of an overlap, where it is positive, and that times the time
        left: of a linear contact that pulls with `own`."""
        sums = np.zeros(2)
        for at, ahead, weight in zip(self.nodes, [*self.nodes[1:], 1.0], self.weights, strict=True):
            part = weight * max(w + turn * at**2 / 2, 0.0)
            sums += part, part * (1 - at)
            rate += weight * (force + grows * at) - own * part
            w += (ahead - at) * rate
        return sums

    def _line_of(self, b, u, v, a):
        """`_line` of contact b at a place of the step that ends with u, v and a."""
        return lambda x: self._line(b, self.dt * (1 - x), u, v, a)

    def _swing(self, b, line):
        def swing(x):
            _, turn, length = line(x)
            return self.side[b] * self.dt**2 * length * (turn @ turn)

        return swing

    def shown(self, u, v, a, before, after):
        """Make of copies of u and v at the end of a step what is looked at, in place.

        An event is corrected for all kicks before and behind it at once: of a contact that closed
        in the step for those to come, of one that opens in the next not yet for those that were.

        Parameters
        ----------
        u, v, a : ndarray
        before, after : tuple
            `overlaps` at the begin and at the end of the step.
        """
        (w0, d0), (w1, d1) = before, after
        for b in map(tuple, np.argwhere((w1 > 0) & ((w0 <= 0) | (w1 < -2 * d1))).tolist()):
            p, opens = through(w0[b], d0[b], w1[b], d1[b]), w0[b] > 0
            if opens and not value(p, 2.0) < 0:
                continue
            x = root(p, 1.0, 2.0) if opens else root(p, 0.0, 1.0)
            line, rate = self._line_of(b, u, v, a), abs(slope(p, x))
            if rate > 0:
                swing = self._swing(b, line)(x)
                total = self._event(b, p, x, opens, swing)[1]
                total += self._between(b, p, x, opens, swing, int(opens))[0]
                push = (total if opens else -total), 0.0, 0.0
                self._give(b, w1[b], 1.0, *push, *line(1.0), u, v)

    def _between(self, b, p, x, opens, swing, start):
        """The part of the error, and of its moment, that the kicks of one step make, which begins
        `start` steps behind this one: of a force up to an event at x, or from there on."""
        alpha, rate = self.exponents[self.row[b]], abs(slope(p, x))
        curvature = 2 * p[2] + 6 * p[3] * x
        away = x - start - self.nodes if opens else start + self.nodes - x
        far = x - start if opens else 1 + start - x
        these, ends = (away > 0) & (away <= far), np.array([max(far - 1, 0.0), far])
        away, weights, ahead = away[these], self.weights[these], self.offsets[these]
        bend, lead = (alpha * k / rate for k in (curvature / 2, curvature - swing))
        kicks = np.sum(weights * away ** (alpha - 1) * (away + bend * away**2 + lead * ahead))
        exact = np.diff(ends ** (alpha + 1) * (1 / (alpha + 1) + bend * ends / (alpha + 2)))
        first = np.sum(weights * away ** (alpha + 1)) - np.diff(ends ** (alpha + 2)) / (alpha + 2)
        size = self.strength[b] * rate**alpha
        return size * (kicks - exact[0]), (-size if opens else size) * first[0]

    def _of_step(self, b, p, x, opens, swing, begins, alone):
        """As `_event`, or without kicks of steps that are not beside this one."""
        passes = abs(slope(p, x)) > 0
        if passes and (alone or (opens and begins)):
            total, moment = self._between(b, p, x, opens, swing, 0)
            return x, -total, moment, -moment
        x, total, moment, _ = self._event(b, p, x, opens, swing)
        if passes and x < 0:  # there are no kicks before a run begins
            kicks, before = self._between(b, p, x, opens, swing, -1)
            total, moment = total + kicks, moment - before
        return x, total, moment, -moment

    def _event(self, b, p, x, opens, swing=0.0):
        """Root, and the sums that impulse, moment and turning of the line take from it."""
        alpha, rate = self.exponents[self.row[b]], abs(slope(p, x))
        curvature = 2 * p[2] + 6 * p[3] * x
        z0, z2, z3 = self._sums(self.row[b], x, opens)
        size = self.strength[b] * rate ** (alpha - 1)
        way = -1.0 if opens else 1.0
        next_order = curvature * z2 / 2 + (curvature - swing) * z3
        total = -size * (rate * z0 + alpha * next_order)
        return x, total, way * size * rate * z2, -way * size * rate * z2

    def _touch(self, b, p, one, other, swing):
        """The same of a contact that closed and opened again."""
        alpha, strength = self.exponents[self.row[b]], self.strength[b]
        middle, length = (one + other) / 2, other - one
        curvature = 2 * p[2] + 6 * p[3] * middle
        exact = abs(curvature / 2) ** alpha * length ** (2 * alpha + 1) * self.betas[self.row[b]]
        w = value(p, self.nodes) + (curvature - swing) * self.offsets
        inside = (w > 0) & (self.nodes > 0) & (self.nodes < 1)
        force = self.weights * np.where(inside, np.abs(w), 0.0) ** alpha
        total = strength * (exact - np.sum(force))
        return middle, total, strength * np.sum((self.nodes - middle) * force), 0.0

    def _sums(self, row, x, opens):
        """Sums over the kicks of a step, and of all others, of the zeta functions."""
        alpha = self.exponents[row]
        q = np.mod(x - self.nodes if opens else self.nodes - x, 1.0)
        least = q ** (alpha - 1)
        powers = least * q, least * q * q, least
        t = 2 * q - 1
        z0, z2, z3 = (
            np.polynomial.polynomial.polyval(t, table) + power
            for table, power in zip(self.tables[row], powers, strict=True)
        )
        weights = self.weights
        return weights @ z0, weights @ z2, (weights * self.offsets) @ z3

    def _give(self, b, w, x, total, moment, turning, line, turned, _, u, v):
        """Impulse and moment to both rows of contact b, equal and opposite."""
        dt, back = self.dt, (1 - x) * self.dt
        impulse, shift = dt * self.side[b] * total, dt**2 * self.side[b] * moment
        impulse = impulse * line + dt**2 * self.side[b] * turning * turned
        shift = shift * line + back * impulse
        rows = int(self._first[b[1]]), int(self._second[b[1]])
        mobility = np.max(self._weights[rows[0]] + self._weights[rows[1]])
        if np.sum(np.abs(shift)) * mobility >= abs(w):
            shift = 0 * shift  # the contact would change side once more
        if self.bonds.contacts is None:
            impulse, shift = impulse[0], shift[0]
        for row, sign in zip(rows, (1, -1), strict=True):
            v[row] += sign * self._weights[row] * impulse
            u[row] += sign * self._weights[row] * shift

    def _line(self, b, back, u, v, a):
        """Direction of contact b a time `back` ago, its rate of change, and the length of what
        turns; 0 where nothing does."""
        c, dim, (_, b) = self.bonds.contacts, self.bonds.dim, b
        if c is None:
            return np.ones(1), np.zeros(1), 0.0
        pair = c.kind[b] == 0
        place, velocity, pull = (
            x[self._second[b]] - (x[self._first[b]] if pair else 0.0) for x in (u, v, a)
        )
        reference = c.geometry[:dim, b]
        if not pair or dim == 1:
            return reference, np.zeros(dim), 0.0
        apart = reference + place - back * velocity + back**2 / 2 * pull
        velocity = velocity - back * pull
        length = math.sqrt(apart @ apart)
        line = apart / length
        return line, (velocity - line * (line @ velocity)) / length, length


def moved(own, rate, force, grows, far):
    """The sums of `Openings._kicked` of the motion itself, for a time `far` from its closing."""
    terms = [0.0, rate * far, force * far**2 / 2]
    terms.append((grows * far**3 - own * far**2 * terms[1]) / 6)
    for k in range(4, SERIES):
        terms.append(-own * far**2 * terms[k - 2] / (k * (k - 1)))
    k, terms = np.arange(1, SERIES), np.array(terms[1:])
    return far * np.sum(terms / (k + 1)), far**2 * np.sum(terms / ((k + 1) * (k + 2)))


def through(w0, d0, w1, d1):
    """Coefficients of the cubic through values and slopes at 0 and 1."""
    return w0, d0, 3 * (w1 - w0) - 2 * d0 - d1, 2 * (w0 - w1) + d0 + d1


def value(p, x):
    """Of the cubic with these coefficients, the constant first."""
    return p[0] + x * (p[1] + x * (p[2] + x * p[3]))


def slope(p, x):
    """Of the same."""
    return p[1] + x * (2 * p[2] + x * 3 * p[3])


def root(p, low, high):
    """Where a cubic passes zero between two places on different sides of it."""
    below = value(p, low) > 0
    x = (low + high) / 2
    for _ in range(60):
        y, rate = value(p, x), slope(p, x)
        low, high = (x, high) if (y > 0) == below else (low, x)
        new = x - y / rate if rate else low
        new = new if low < new < high else (low + high) / 2
        if abs(new - x) <= 1e-16:
            break
        x = new
    return x
