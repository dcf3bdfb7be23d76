"""Random scenes of all kinds, for what has to hold on any of them: {kind: function of a seed}.

Each gives scene, state and duration, in units in which masses and stiffnesses are about 1.
"""

from functools import cache

import numpy as np
import sympy as sp

from granular import Bead, Striker, materials, y_guide
from tensegrity import Chain, Ensemble, Network, Potential, PowerLaw, Prism, State


@cache
def prism(number, elastic=False):
    """One of few prisms: each is compiled, or fitted, once."""
    rng = np.random.default_rng(number)
    soft = {"k_base": rng.uniform(2, 20), "k_bar": rng.uniform(20, 200)} if elastic else {}
    spring = Prism(1.0, rng.uniform(0.5, 1.2), 10 ** rng.uniform(-3, -1), 1.0, **soft)
    return spring.potential(preload=0.0 if not elastic else rng.uniform(0, 0.02))


def blow(rng, chain, energy, site=None):
    """One mass moving with an energy."""
    site = int(rng.integers(0, chain.sites)) if site is None else site
    return chain.at_rest({site: np.sqrt(2 * energy / chain.mass[site]) * rng.choice([-1, 1])})


def bounce(rng):
    """Two bodies and a linear contact: free, a half sine, free; see `half_sine`."""
    k, v, gap = rng.uniform(0.2, 5), rng.uniform(0.1, 2), rng.uniform(0.2, 8)
    masses = rng.uniform(0.5, 2, 2)
    chain = Chain(PowerLaw(k, 1.0), 2, masses)
    omega = np.sqrt(k * np.sum(1 / masses))
    after = rng.uniform(1.2, 6) * np.pi / omega
    return chain, State([0.0, gap], [v, 0.0]), gap / v + after


def half_sine(chain, state, t):
    """u and v of `bounce` at instants t, in closed form."""
    (gap, v), m = (state.u[1], state.v[0]), chain.mass
    k = float(chain.springs[0].stiffness(-1.0))
    omega = np.sqrt(k * np.sum(1 / m))
    since = np.clip(t - gap / v, 0, None)
    inside = since < np.pi / omega
    apart = np.where(inside, -v / omega * np.sin(omega * since), v * (since - np.pi / omega))
    apart = np.where(since == 0, gap - v * t, apart)
    rate = np.where(inside, -v * np.cos(omega * since), v)
    centre, moving = (m @ state.u) / m.sum() + t * (m @ state.v) / m.sum(), m[0] * v / m.sum()
    u = np.stack([centre - apart * m[1] / m.sum(), centre + apart * m[0] / m.sum()], axis=1)
    v = np.stack([moving - rate * m[1] / m.sum(), moving + rate * m[0] / m.sum()], axis=1)
    return u, v


def contacts(rng, exponent=None):
    """A row of open contacts of any exponent, some with gaps, some masses moving."""
    sites = int(rng.integers(2, 40))
    if exponent is None:
        exponent = float(rng.choice([1.0, 1.5, 2.0, 2.5, 3.0, np.round(rng.uniform(1, 3), 2)]))
    chain = Chain(PowerLaw(rng.uniform(0.3, 3), exponent), sites, rng.uniform(0.3, 3, sites))
    gaps = rng.uniform(0, 0.3, sites - 1) * (rng.random(sites - 1) < 0.4)
    v = rng.normal(0, 1, sites) * (rng.random(sites) < 0.3)
    v[0] = rng.uniform(0.2, 1.5)
    return chain, State(np.append(0, np.cumsum(gaps)), v), rng.uniform(3, 30)


def corners(rng):
    """The same with an exponent below 1."""
    sites = int(rng.integers(2, 10))
    chain = Chain(PowerLaw(1.0, float(np.round(rng.uniform(0.5, 0.95), 2))), sites)
    return chain, chain.at_rest({0: rng.uniform(0.3, 1.5)}), rng.uniform(3, 15)


def preloaded(rng):
    """Contacts of spheres under a preload, which a blow may open or not."""
    sites = int(rng.integers(5, 120))
    chain = Chain(PowerLaw(1.0, 1.5, preload=rng.uniform(0.05, 1)), sites)
    return chain, blow(rng, chain, 10 ** rng.uniform(-5, 0)), rng.uniform(5, 40)


def locking(rng):
    """Prisms, with up to nearly all the energy that locks one in one mass."""
    spring = prism(int(rng.integers(0, 4)))
    chain = Chain(spring, int(rng.integers(5, 150)))
    energy = rng.uniform(0.02, 0.97) * float(spring.energy(spring.domain[0]))
    omega = 2 * np.sqrt(float(spring.stiffness(0.0)))
    return chain, blow(rng, chain, energy), rng.uniform(10, 60) / omega


def elastic(rng):
    """Softer ones, not near their folds."""
    spring = prism(int(rng.integers(0, 2)), elastic=True)
    chain = Chain(spring, int(rng.integers(5, 40)), ends=("fixed", "free"))
    energy = 10 ** rng.uniform(-4, -1) * float(spring.energy(0.3 * spring.domain[0]))
    omega = 2 * np.sqrt(float(spring.stiffness(0.0)))
    return chain, blow(rng, chain, energy, 1), rng.uniform(10, 30) / omega


@cache
def toda():
    """An energy of the user's own."""
    r = sp.Symbol("r")
    return Potential(sp.exp(-r) + r - 1, r)


def mixed(rng):
    """Prisms, contacts and others in one chain of unequal masses."""
    kinds = [prism(0), toda(), PowerLaw(2.0, 1.5, preload=0.3), PowerLaw(1.0, 3.0, preload=0.1)]
    sites = int(rng.integers(4, 50))
    springs = [kinds[k] for k in rng.integers(0, len(kinds), sites - 1)]
    chain = Chain(springs, sites, rng.uniform(0.5, 2, sites))
    return chain, blow(rng, chain, 10 ** rng.uniform(-5, -3)), rng.uniform(5, 40)


def lanes(rng):
    """Chains side by side, each with its own blow, some with contacts."""
    spring = prism(0) if rng.random() < 0.5 else PowerLaw(1.0, 1.5)
    chain = Chain(spring, int(rng.integers(4, 20)))
    batch = Ensemble(chain, int(rng.integers(1, 12)))
    return batch, batch.at_rest({0: rng.uniform(0.01, 0.04, batch.count)}), rng.uniform(10, 40)


def guide(rng):
    """A small fork of steel beads."""
    steel = Bead(4.76e-3, materials["steel"], mass=0.45e-3)
    scene = y_guide(
        int(rng.integers(3, 9)), int(rng.integers(3, 9)), half_angle=rng.uniform(0.3, 0.8),
        bead=steel, wall=materials["ptfe"], striker=Striker(steel, rng.uniform(0.2, 1)),
    )  # fmt: skip
    return scene, scene.start(), rng.uniform(20e-6, 65e-6)  # no bead beyond a wall


def pack(rng):
    """Discs that touch on a lattice, with masses of their own, some moving."""
    rows, columns = (int(x) for x in rng.integers(2, 5, 2))
    at = np.array([(i + 0.5 * (j % 2), j * np.sqrt(0.75)) for j in range(rows)
                   for i in range(columns)])  # fmt: skip
    far = np.linalg.norm(at[:, None] - at, axis=-1)
    bonds = np.argwhere(np.triu(np.abs(far - 1) < 1e-9, 1))
    scene = Network(
        at, bonds, PowerLaw(1.0, float(rng.choice([1.5, 2.0]))), mass=rng.uniform(0.5, 2, len(at))
    )
    moved = {int(s): rng.normal(0, 0.02, 2) for s in rng.integers(0, len(at), 2)}
    return scene, scene.at_rest(moved), rng.uniform(5, 30)


@cache
def slack_string(stiffness):
    """Pulls, and does not push."""
    r = sp.Symbol("r")
    return Potential(stiffness * sp.Max(r, 0) ** 2 / 2, r)


def slack(rng):
    """A net of strings that go slack."""
    at = np.array([(i, j) for i in range(3) for j in range(3)], dtype=float)
    far = np.linalg.norm(at[:, None] - at, axis=-1)
    bonds = np.argwhere(np.triu(far < 1.1, 1))
    scene = Network(at, bonds, slack_string(1.0), lengths=rng.uniform(0.8, 1.1), held=[0, 2, 6, 8])
    return scene, scene.at_rest({4: rng.normal(0, 0.3, 2)}), rng.uniform(3, 15)


@cache
def law_in_pieces(exponent):
    """Stiffer from some elongation on, and by a power beyond some compression."""
    r, k, a, b = sp.symbols("r k a b", real=True)
    power = sp.Rational(exponent) + 1
    energy = r**2 / 2 + k * sp.Max(r - a, 0) ** 2 / 2 + k * sp.Max(-r - b, 0) ** power / power
    return Potential(energy, r, {k: 1.0, a: 0.1, b: 0.1})


def pieces(rng):
    """Springs whose forces have two corners each."""
    law = law_in_pieces(str(rng.choice(["1", "3/2", "2", "5/2"])))
    given = {"k": rng.uniform(0.5, 4), "a": rng.uniform(0, 0.2), "b": rng.uniform(0, 0.2)}
    sites = int(rng.integers(2, 30))
    chain = Chain(law.varied(given), sites, rng.uniform(0.5, 2, sites))
    return chain, blow(rng, chain, 10 ** rng.uniform(-3, -1)), rng.uniform(5, 30)


KINDS = {
    f.__name__: f
    for f in (bounce, contacts, corners, preloaded, locking, elastic, mixed, lanes, guide, pack,
              slack, pieces)
}  # fmt: skip
EXPONENTS = 1.0, 1.25, 1.5, 1.75, 2.0, 2.25, 2.5, 2.75, 3.0


def opening(seed):
    """(Scene, state, duration) with contacts that open, or other corners, a tolerance from 1e-11 to
    1e-3, and the generator that drew them; most are rows of contacts."""
    rng = np.random.default_rng(seed)
    others = bounce, preloaded, pack, slack, pieces, guide
    if rng.random() < 0.8:
        made = contacts(rng, float(rng.choice(EXPONENTS)))
    else:
        made = others[int(rng.integers(len(others)))](rng)
    return made, 10 ** rng.uniform(-11, -3), rng


TOLERANCES = 10.0 ** -np.arange(2, 11)
LOOSEST = {"corners": 1e-6, "bounce": 1e-7, "contacts": 1e-8, "slack": 1e-7, "pieces": 1e-8}


def draw(seed):
    """Kind, (scene, state, duration) and tolerance."""
    rng = np.random.default_rng(seed)
    kind = list(KINDS)[int(rng.integers(0, len(KINDS)))]
    made = KINDS[kind](rng)
    least = LOOSEST.get(kind, 1e-10)
    allowed = TOLERANCES[0.99 * least < TOLERANCES]
    return kind, made, float(rng.choice(allowed))
