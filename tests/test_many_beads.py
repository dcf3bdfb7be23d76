"""Packs of many beads: what is searched, stored and refused."""

import tracemalloc

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from scipy.spatial import cKDTree

from granular import Bead, fcc_pack, materials
from tensegrity import Network, PowerLaw, TensegrityError
from tensegrity.readonly import Repeated
from tensegrity.scenes import near_pairs
from tensegrity.springs.collection import numbered

STEEL = Bead(diameter=10e-3, material=materials["steel"])
PER_BEAD = 400  # bytes while a pack of some thousand beads is built, six contacts each


@st.composite
def spheres(draw):
    """Centres, radii, a bound of the gap and some pairs: of a lattice, where gaps are equal to the
    bound, or anywhere; in boxes of any aspect ratio, also at one place, far apart and far away."""
    dim, random = draw(st.integers(1, 3)), np.random.default_rng(draw(st.integers(0, 99)))
    count, on_lattice = draw(st.integers(1, 150)), draw(st.booleans())
    extent = [draw(st.sampled_from([0.0, 3.0, 10.0, 1e3, 1e9])) for _ in range(dim)]
    x = random.random((count, dim)) * extent + draw(st.sampled_from([0.0, -7.0, 1e6, 1e15]))
    radius = 0.25 + draw(st.sampled_from([0.0, 0.5])) * random.random(count)
    listed = random.integers(0, count, (draw(st.integers(0, 40)), 2))
    listed = np.unique(listed[listed[:, 0] != listed[:, 1]], axis=0)
    skin = draw(st.sampled_from([1e-9, 0.5, 1.5]))
    return np.round(x) if on_lattice else x, radius, skin, listed


def all_compared(x, radius, skin, listed):
    """The pairs of `near_pairs` and their gaps, from all distances."""
    i, j = np.triu_indices(len(x), 1)
    gap = np.linalg.norm(x[j] - x[i], axis=-1) - radius[i] - radius[j]
    left_out = {tuple(sorted(pair)) for pair in listed.tolist()}
    new = [pair not in left_out for pair in zip(i.tolist(), j.tolist(), strict=True)]
    some = (gap < skin) & np.array(new, dtype=bool)
    return np.stack([i, j], axis=1)[some], gap[some]


@given(spheres())
@settings(max_examples=100, deadline=None)
def test_near_pairs_are_those_of_all_distances(given):
    for found in (near_pairs.near_pairs(*given), near_pairs._compared(*given)):
        for one, other in zip(found, all_compared(*given), strict=True):
            np.testing.assert_array_equal(one, other)


def test_near_pairs_of_many_points_are_those_of_a_tree():
    count, reach = 200_000, 3e-3
    x = np.random.default_rng(0).random((count, 2)) * [1.0, 0.5]
    pairs = np.sort(cKDTree(x).query_pairs(reach, output_type="ndarray"), axis=1)
    found = near_pairs.near_pairs(x, np.full(count, reach / 4), reach / 2)
    np.testing.assert_array_equal(found.ends, pairs[np.lexsort(pairs.T[::-1])])


@pytest.mark.parametrize("dim", [2, 3])
def test_cells_that_touch_have_different_numbers(dim):
    around = np.indices((3,) * dim).reshape(dim, -1)
    for power in range(7, 30):
        numbers = near_pairs.strides(2**power)[:dim] @ around % 2**power
        assert len(set(numbers.tolist())) == 3**dim


def test_a_repeated_sequence_is_that_of_its_items():
    one, two, three = PowerLaw(1.0, 1.5), PowerLaw(2.0, 1.5), PowerLaw(3.0, 1.5)
    items = [two, one, two, PowerLaw(1.0, 1.5)]
    found = Repeated.of(items)
    assert items == list(found)
    assert found == items
    assert found == Repeated.of(tuple(items))
    assert len(found.different) == 3  # equal ones at two addresses
    for other in (items[::-1], [*items, two], Repeated.of(items[1:])):
        assert found != other
    assert found[1:3] == items[1:3]
    assert found[-1] == items[-1]
    assert found + Repeated.of([three, two]) == [*items, three, two]
    assert len((found + items).different) == 3
    np.testing.assert_array_equal(found.each(lambda x: x.values[0]), [2, 1, 2, 1])


@pytest.mark.parametrize("high", [5, 10**12])
def test_keys_are_numbered_by_first_place(high):
    keys = np.random.default_rng(1).integers(-2, 5, 300) * high
    wanted = list(dict.fromkeys(keys.tolist()))
    found, index = numbered(keys)
    assert found.tolist() == wanted
    np.testing.assert_array_equal(found[index], keys)


def test_a_pack_is_built_within_some_hundred_bytes_a_bead():
    walls = {"floor": materials["steel"], "sides": materials["ptfe"]}
    fcc_pack(3, 3, bead=STEEL, **walls)  # what is computed once
    tracemalloc.start()
    try:
        scene = fcc_pack(20, 30, bead=STEEL, **walls)
        stored, most = tracemalloc.get_traced_memory()
    finally:
        tracemalloc.stop()
    assert stored < 320 * scene.sites
    assert most < PER_BEAD * scene.sites + 8e6  # and one block of pairs


def test_sites_that_the_loop_cannot_number_are_refused():
    with pytest.raises(
        TensegrityError, match="600000000 sites and walls must be at most 536870912"
    ):
        Network(np.broadcast_to(0.0, (600_000_000, 3)), [], PowerLaw(1.0, 1.5))
    with pytest.raises(TensegrityError, match="1000000000 sites and walls must be at most"):
        fcc_pack(1000, 1000, bead=STEEL)
