"""Sites that a wave has not reached are left out of the steps, and no bit depends on it."""

import numpy as np
import pytest

from tensegrity import Chain, Ensemble, PowerLaw, Prism, Record, State, simulate

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
