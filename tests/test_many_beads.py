"""Packs of many beads: what is searched, stored and refused."""

import tracemalloc

import numpy as np
import pytest
from scipy.spatial import cKDTree

from granular import Bead, fcc_pack, materials
from tensegrity import Network, PowerLaw, TensegrityError
from tensegrity.readonly import Repeated
from tensegrity.scenes import near_pairs
from tensegrity.springs.collection import numbered

STEEL = Bead(diameter=10e-3, material=materials["steel"])
PER_BEAD = 700  # bytes while a pack of some thousand beads is built, six contacts each


@pytest.mark.parametrize("count", [near_pairs.FEW, near_pairs.FEW + 1])
@pytest.mark.parametrize("dim", [1, 2, 3])
def test_near_pairs_are_those_of_all_distances(dim, count):
    x = np.random.default_rng(dim).random((count, dim)) * [1.0, 2.0, 0.5][:dim]
    far = np.linalg.norm(x[:, None] - x, axis=-1)
    wanted = np.argwhere(np.triu(far <= 0.2, 1))
    found = near_pairs.near_pairs(x, 0.2)
    np.testing.assert_array_equal(found.ends, wanted)
    np.testing.assert_array_equal(found.distance, far[tuple(wanted.T)])


def test_near_pairs_of_several_slabs_are_those_of_one_search():
    count, reach = 2 * near_pairs.SLAB + 1, 2e-3
    x = np.random.default_rng(0).random((count, 2))
    pairs = np.sort(cKDTree(x).query_pairs(reach, output_type="ndarray"), axis=1)
    found = near_pairs.near_pairs(x, reach)
    np.testing.assert_array_equal(found.ends, pairs[np.lexsort(pairs.T[::-1])])
    assert len(pairs) > 2 * near_pairs.PART


def test_a_repeated_search_is_answered_from_one_that_reached_as_far():
    x = np.random.default_rng(0).random((50, 2))
    with near_pairs.searched_once():
        wide = near_pairs.near_pairs(x, 0.3)
        assert near_pairs.near_pairs(x.copy(), 0.2) is wide
        assert len(near_pairs.near_pairs(x, 0.4).ends) > len(wide.ends)
        assert len(near_pairs.near_pairs(2 * x, 0.3).ends) < len(wide.ends)
    assert len(near_pairs.near_pairs(x, 0.2).ends) < len(wide.ends)


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
    assert stored < 400 * scene.sites
    assert most < PER_BEAD * scene.sites + 3e7  # and one slab


def test_sites_that_the_loop_cannot_number_are_refused():
    with pytest.raises(
        TensegrityError, match="600000000 sites and walls must be at most 536870912"
    ):
        Network(np.broadcast_to(0.0, (600_000_000, 3)), [], PowerLaw(1.0, 1.5))
    with pytest.raises(TensegrityError, match="1000000000 sites and walls must be at most"):
        fcc_pack(1000, 1000, bead=STEEL)
