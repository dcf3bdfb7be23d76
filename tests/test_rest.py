"""Sites that a wave has not reached are left out of the steps, of a network by tiles, and no bit
depends on it."""

import numpy as np
import pytest

from granular import Bead, Striker, fcc_pack, materials
from tensegrity import Chain, Ensemble, Network, PowerLaw, Prism, Record, State, simulate

FAINT = 1e-295  # m/s: a far end that moves so slowly keeps all sites in the steps
SPRINGS = {
    "prism": Prism(1.0, 0.7, 0.1, 1.0).potential(),
    "preloaded prism": Prism(1.0, 0.7, 0.2, 1.0).potential(0.01),
    "elastic prism": Prism(1.0, 0.5, 0.4, 1.0, 2.0, 20.0).potential(0.05),
    "bead": PowerLaw(1.3, 1.5),
    "preloaded bead": PowerLaw(0.8, 1.5, preload=0.01),
    "linear contact": PowerLaw(1.0, 1.0),
    "square contact": PowerLaw(1.0, 2.0, preload=0.002),
}


def scenes():
    """Chains of one spring, of two in turn, of springs of their own, and a batch."""
    rng = np.random.default_rng(3)
    for name, spring in SPRINGS.items():
        yield name, Chain(spring, 300, ends=("free", "free" if len(name) % 2 else "fixed"))
    bead, contact = SPRINGS["bead"], SPRINGS["linear contact"]
    yield "interface", Chain([bead] * 61 + [contact] * 250, 312, rng.uniform(0.5, 2, 312))
    own = [PowerLaw(float(k), 1.5) for k in rng.uniform(0.5, 2, 199)]
    yield "own", Chain(own, 200, rng.uniform(0.5, 2, 200))
    yield "batch", Ensemble([Chain(PowerLaw(k, 1.5), 150) for k in np.linspace(1, 2, 8)])


@pytest.mark.parametrize(("scene", "method"), [
    pytest.param(scene, method, id=f"{name}-{method}")
    for name, scene in scenes() for method in ("verlet", "rkn6", "corrected6")
])  # fmt: skip
@pytest.mark.parametrize("site", [0, 40])
def test_a_scene_of_which_all_sites_move_has_the_same_bits(scene, method, site):
    start = scene.at_rest({site: 0.05})
    v, last = start.v.copy(), scene.sites - 1
    chain = scene.scenes[0] if isinstance(scene, Ensemble) else scene
    v[last - (last in chain.held)] = FAINT
    options = {"dt": 0.08, "method": method, "record": Record(every=7)}
    runs = [simulate(scene, state, 150.0, **options) for state in (start, State(start.u, v))]
    assert np.mean(runs[0].v[:, -20] == 0) > 0.03  # it rests for a while
    for name in ("u", "v"):
        one, other = (getattr(run, name) for run in runs)
        moved = np.maximum(np.abs(one), np.abs(other)) > 1e-100
        np.testing.assert_array_equal(one[moved], other[moved])


def row(order, preload=0.0, **options):
    """Sites of the plane in rows, (rows, sites) of their numbers, joined by contacts."""
    places = np.empty((order.size, 2))
    places[order] = np.stack(np.meshgrid(np.arange(order.shape[1]), np.arange(len(order)) * 3), -1)
    bonds = np.concatenate([np.stack([one[:-1], one[1:]], axis=1) for one in order])
    return Network(places, bonds, PowerLaw(1.0, 1.5, preload=preload), **options)


def networks():
    """Networks of several tiles with a start, a step [s] and an end [s]."""
    steel = materials["steel"]
    bead = Bead(9.53e-3, steel)
    sides, striker = materials["ptfe"], Striker(bead, 1.0)
    for name, side, t_end in (("pack", 4, 2e-4), ("pack on two threads", 12, 1e-4)):
        pack = fcc_pack(70, side, bead=bead, floor=steel, sides=sides, striker=striker)
        yield pytest.param(pack, pack.start(), 5e-7, t_end, id=name)
    order = np.random.default_rng(5).permuted(np.arange(1600).reshape(-1, 100), axis=1)
    order = order.reshape(2, 800)
    site = int(order[0, 400])
    # The forces on each site, which are not 0, balance exactly.
    held = [int(one[end]) for one in order for end in (0, -1)]
    preloaded = row(order, preload=0.01, held=held)
    yield pytest.param(preloaded, preloaded.at_rest({site: [0.1, 0]}), 0.05, 60.0, id="preloaded")
    # At rest, but not at the reference positions.
    shifted = row(order)
    start = shifted.at_rest({site: [0.1, 0]})
    yield pytest.param(shifted, State(start.u + 0.25, start.v), 0.05, 60.0, id="shifted")
    # Neighbours in different tiles: an impulse where a contact closes acts on a tile at rest.
    order = np.arange(1024).reshape(4, 256).T.reshape(1, -1)
    gaps = row(order, lengths=np.where(np.arange(1023) % 3, 1.0, 0.98))
    yield pytest.param(gaps, gaps.at_rest({0: [0.1, 0]}), 0.05, 60.0, id="gaps")


@pytest.mark.parametrize(("scene", "start", "dt", "t_end", "method"), [
    pytest.param(*given.values, method, id=f"{given.id}-{method}",
                 marks=[pytest.mark.slow] * ((method == "corrected6") != (given.id == "gaps")))
    for given in networks() for method in ("verlet", "rkn6", "corrected6")
])  # fmt: skip
def test_a_network_of_which_all_tiles_move_has_the_same_bits(
    scene, start, dt, t_end, method, monkeypatch
):
    monkeypatch.setenv("TENSEGRITY_THREADS", "2")
    free = [site for site in range(scene.sites) if site not in scene.held]
    v = start.v.copy()
    v[free] += FAINT
    options = {"dt": dt, "method": method, "record": Record(every=20)}
    runs = [simulate(scene, state, t_end, **options) for state in (start, State(start.u, v))]
    assert np.mean(~runs[0].v.any(axis=-1)) > 0.2
    for name in ("u", "v"):
        one, other = (getattr(run, name) for run in runs)
        moved = np.maximum(np.abs(one), np.abs(other)) > 1e-100
        np.testing.assert_array_equal(one[moved], other[moved])
