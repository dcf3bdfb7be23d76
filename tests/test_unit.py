"""Units of a user's own: self-stress, stiffness, unloaded states and paths.

Numbers are those of independent computations of the same energies.
"""

import math
import pickle

import numpy as np
import pytest
import sympy as sp
from units import (
    TENTH,
    arch,
    class_two,
    d_bar,
    icosahedron,
    kresling,
    prism,
    snap_back,
    twin_strings,
    x_module,
)

from tensegrity import EquilibriumError, Member, Prism, TensegrityError, Unit, equilibrium_path

FIFTIETH = sp.Rational(1, 50)
W, H = sp.symbols("w h", positive=True)
STIFFNESS = {  # N/m
    "X-module": (x_module(), 4.8127068166777),
    "X-module, rigid bars": (x_module(math.inf), 4.8409090909091),
    "Kresling": (kresling(), 3.7709426984095),
    "Kresling, unequal": (kresling(sp.Rational(1, 2)), 3.6071371060564),
    "prism": (prism(), 2.3165163027189),
    "prism, soft bases": (prism(k_base=5, k_bar=50), 2.1611883584571),
    "prism of four sides": (prism(1, TENTH * 5, TENTH / 2, 8, 30, 4), 0.2564994304038),
    "icosahedron": (icosahedron(), 0.69421487603306),
    "icosahedron, elastic struts": (icosahedron(50), 0.69181013151322),
    "D-bar": (d_bar(), 0.79905382348379),
    "D-bar with hinges": (d_bar(FIFTIETH), 0.92344505027573),
    "twin strings, upright": (twin_strings(), 303.27272727273),
    "class 2": (class_two(), 1.1582581513595),
    "class 2, soft middle": (class_two(10), 1.0903392620197),
}


@pytest.mark.parametrize("name", STIFFNESS)
def test_axial_stiffness_has_all_digits_of_the_reference(name):
    unit, wanted = STIFFNESS[name]
    assert unit.axial_stiffness() == pytest.approx(wanted, rel=5e-14)


def test_axial_stiffness_of_a_prism_is_that_of_its_closed_form_to_the_last_digit():
    for given in ((1.0, 0.7, 0.1, 20.0, 20.0, 3), (1.0, 0.5, 0.05, 8.0, 30.0, 4),
                  (1.3, 0.9, 0.2, math.inf, math.inf, 5)):  # fmt: skip
        base, height, p, k_base, k_bar, n = given
        closed = Prism(base, height, p, 1.0, k_base, k_bar, n).axial_stiffness()
        own = prism(base, height, p, k_base, k_bar, n).axial_stiffness()
        assert own == pytest.approx(closed, rel=2e-16, abs=0)


def test_self_stress_and_natural_lengths_are_those_of_the_closed_forms():
    unit, q = x_module(), 0.1 / 1.1
    cables, verticals, bars = unit.self_stress()
    assert (cables, verticals, bars) == pytest.approx((q, 0.75 * q, -1.25 * q), rel=1e-15)
    natural = 1 / 1.1, 0.75 * (1 - q / 2), 1.25 * (1 + q / 50)
    assert unit.natural_lengths() == pytest.approx(natural, rel=1e-15)
    assert x_module(math.inf).natural_lengths()[2] == 1.25
    lengths = prism(k_bar=50).natural_lengths()
    assert lengths == pytest.approx([*Prism(1, 0.7, 0.1, 1, 20, 50).natural_lengths()], rel=1e-15)
    strings, _, _, *struts = icosahedron(50).self_stress()
    # force density of struts -3/2 of the strings'
    assert struts[0] / 2 == pytest.approx(-1.5 * strings / math.sqrt(1.5), rel=1e-15)


@pytest.mark.parametrize("radius", [sp.Rational(1, 10**6), 1, 100])
@pytest.mark.parametrize("k", [1, 10**7])
def test_states_do_not_depend_on_units_of_length_and_force(radius, k):
    """Lengths beside angles: entries of the matrix differ by the square of a length."""
    found = kresling(k, k, radius=radius).equilibria()
    expected = [(1.8, True), (1.4124506921525, False), (0.76573115864789, True)]
    assert [(s.h / float(radius), s.stable) for s in found] == [
        (pytest.approx(height, rel=1e-12), stable) for height, stable in expected
    ]


def test_kresling_has_a_second_state_and_a_barrier_in_closed_form():
    for k, energy, height in ((1, 0.048453711417975, 1.4124506921525),
                              (0.5, 0.029843990619245, 1.4486385199655)):  # fmt: skip
        first, barrier, second = kresling(k).equilibria()
        twist = 2 * math.pi / 9
        assert (first.stable, barrier.stable, second.stable) == (True, False, True)
        assert second.f == pytest.approx(math.pi - twist, rel=1e-13)
        squared = 1.8**2 - 4 * math.cos(twist) * math.cos(math.pi / 6)
        assert second.h == pytest.approx(math.sqrt(squared), rel=1e-13)
        assert barrier.f == pytest.approx(math.pi / 2, rel=1e-13)
        assert (barrier.energy, barrier.h) == pytest.approx((energy, height), rel=1e-12)
        assert second.energy == pytest.approx(0, abs=1e-15)
    assert kresling().axial_stiffness(second) == pytest.approx(0.50089079320546, rel=1e-12)


def test_twin_strings_turn_to_either_side_above_the_threshold():
    unit = twin_strings()
    upright, one, other = unit.equilibria()
    assert (upright.stable, one.stable, other.stable) == (False, True, True)
    assert one.phi == pytest.approx(0.33279402291058, rel=1e-12) == pytest.approx(-other.phi)
    assert one.h == pytest.approx(0.9818632394652, rel=1e-13)
    assert one.energy == pytest.approx(-1.2565795730464e-3, rel=1e-10)
    assert unit.axial_stiffness(one) == pytest.approx(7.431212057913, rel=1e-12)
    # p_c = R^2 (1 + cos 2 pi/n)/s0^2
    for p, many in ((1 / 12 - 1e-4, 1), (1 / 12 + 1e-4, 3)):
        assert len(twin_strings(p=p).equilibria()) == many


def test_arch_has_three_states_and_a_box_leaves_out_others():
    found = arch().equilibria()
    heights, energies = [s.h for s in found], [s.energy for s in found]
    assert heights == pytest.approx([0.5, -0.00396188335641, -0.4962581487002], rel=1e-11)
    assert energies == pytest.approx([0, 0.0141488284642, 8.5710894763e-4], rel=1e-9, abs=1e-15)
    assert [s.stable for s in found] == [True, False, True]
    assert [s.h for s in arch().equilibria({"h": (0, 1), sp.Symbol("x"): (0, 1)})] == heights[:1]


def test_rigid_struts_and_slack_strings_have_unloaded_states_too():
    assert [s.w for s in x_module(math.inf).equilibria()] == pytest.approx([1.0], rel=1e-14)
    string, arm = Member(W, 1, string=True), Member(3 - W, 2, natural=1)
    unit = Unit([W], H, [string, arm, Member(H, 1)], (W - 2) ** 2 * (W - 1) ** 2 * 40,
                rest={W: 2, H: 1})  # fmt: skip
    barrier, low = unit.equilibria({W: (0, 1.9)})
    for state, stable in ((barrier, False), (low, True)):
        w = state.w
        force = 80 * (w - 2) * (w - 1) * (2 * w - 3) - 2 * (2 - w)
        assert force == pytest.approx(0, abs=1e-12)
        assert state.stable == stable


PATHS = {  # of unit, options and {kind: [{column: value}]}
    "X-module": (x_module(), 0.4, [
        ("slack", {"h": 0.71590909090909, "load": 0.16071397505564, "w": 1.0240331875521}),
        ("fold", {"h": 0.54701809464229, "load": 0.20699407810486, "w": 1.121230143823}),
        ("h", {"h": 0.5, "load": 0.20433981900826})]),
    "X-module, rigid bars": (x_module(sp.oo), 0.4, [
        ("slack", {}), ("fold", {}), ("h", {"h": 0.5, "load": 0.20648039914185})]),
    "Kresling": (kresling(), 0.7, [
        ("fold", {"h": 1.6736853769159, "f": 1.0088105319234, "load": 0.20646787268761}),
        ("fold", {"h": 1.1227789333509, "f": 2.0318395015773, "load": -0.11521925214735})]),
    "Kresling, unequal": (kresling(sp.Rational(1, 2)), 0.7, [
        ("fold", {"h": 1.7031493474324, "f": 0.98288568591315, "load": 0.14649593563337}),
        ("fold", {"h": 1.1587021013809, "f": 2.0175307793514, "load": -0.067391129640838})]),
    "prism": (prism(), 0.3, [
        ("fold", {"h": 0.35545031795379, "phi": 3.1382018313213, "load": 1.2398923284631}),
        ("contact", {"h": 0.34506934079553, "l": 1.0387988721433, "load": 1.238400079764})]),
    "prism, soft bases": (prism(k_base=5, k_bar=50), 0.2, [
        ("fold", {"h": 0.37358164646034, "l": 1.080810441683, "load": 0.68746706330008}),
        ("contact", {"h": 0.27452598067463, "phi": math.pi, "load": 0.62099947902208})]),
    "prism of four sides": (prism(1, TENTH * 5, TENTH / 2, 8, 30, 4), 0.2, [
        ("fold", {"h": 0.22855344849164, "phi": 2.6233984185422, "load": 0.045394119368244})]),
    "icosahedron": (icosahedron(), 0.5, [
        ("a", {"a": 0.6, "b": 0.83430415567738, "load": 0.2986927533328})]),
    "icosahedron, elastic": (icosahedron(50), 0.5, [
        ("a", {"a": 0.6, "c": 0.8280443228123, "load": 0.29622313053411})]),
    "D-bar": (d_bar(), 0.5, [("h", {"w": 1.8722077774285, "load": 0.25147983328257})]),
    "D-bar with hinges": (d_bar(FIFTIETH), 0.5, [
        ("h", {"w": 1.8721169825156, "load": 0.30028814702405})]),
    "class 2": (class_two(), 0.7, [
        ("fold", {"h": 0.71090063590759, "l_m": 1.0377144498111, "load": 1.2398923284631})]),
    "class 2, soft middle": (class_two(10), 0.7, [
        ("fold", {"h": 0.72859632306308, "l_e": 1.0234594777956, "load": 0.79368048191205})]),
}  # fmt: skip
AT = {"X": {"h": 0.5}, "i": {"a": 0.6}, "D": {"h": 0.7}}


@pytest.mark.parametrize("name", PATHS)
def test_events_of_a_path_have_all_digits_of_the_reference(name):
    unit, lowest, wanted = PATHS[name]
    path = equilibrium_path(unit, min_height=lowest, at=AT.get(name[0]))
    events = [e for e in path.events if e.kind != "square"]
    assert [e.kind for e in events] == [kind for kind, _ in wanted]
    for event, (_, columns) in zip(events, wanted, strict=True):
        for column, value in columns.items():
            assert event.at[column] == pytest.approx(value, rel=1e-12), column


def test_path_of_a_prism_is_that_of_its_own_equations():
    unit, own = prism(), Prism(1.0, 0.7, 0.1, 1.0, 20.0, 20.0)
    heights = [0.63, 0.525, 0.4]
    generic = equilibrium_path(unit, min_height=0.35, max_height=0.75, at={"h": heights})
    closed = equilibrium_path(own, min_height=0.35, max_height=0.75, at={"height": heights})
    pairs = {"h": "height", "phi": "twist", "l": "base", "load": "load", "tension_0":
             "cross_tension", "tension_1": "base_tension", "tension_2": "bar_tension"}  # fmt: skip
    one = [e for e in generic.events if e.kind in ("h", "fold")]
    other = [e for e in closed.events if e.kind in ("height", "fold")]
    assert len(one) == len(other) == 4
    for first, second in zip(one, other, strict=True):
        for mine, theirs in pairs.items():
            assert first.at[mine] == pytest.approx(second.at[theirs], rel=1e-13)
    assert generic.stable_load[0] == closed.stable_load[0]
    assert generic.stable_h.all()
    below = generic.h < other[-1].height - 1e-3
    assert not generic.stable_load[below].any()
    assert generic.stable_load[~below & (generic.h > other[-1].height + 1e-3)].all()


def test_snap_back_has_folds_and_turns_in_closed_form():
    path = equilibrium_path(snap_back(), min_height=-0.75)
    length = math.sqrt(1.25)
    fold = math.sqrt(length ** (2 / 3) - 1)
    turn = math.sqrt((length / (1 + 0.05 / 2)) ** (2 / 3) - 1)
    found = [(e.kind, e.x) for e in path.events]
    assert [kind for kind, _ in found] == ["fold", "turn", "turn", "fold"]
    assert [x for _, x in found] == pytest.approx([fold, turn, -turn, -fold], rel=1e-12)
    heights = [-0.58040642354933, -0.59700371817851, 0.59700371817851, 0.58040642354933]
    assert [e.h for e in path.events] == pytest.approx(heights, rel=1e-12)
    middle = np.abs(path.x) < turn - 1e-3
    assert not path.stable_h[middle].any()
    assert path.stable_h[np.abs(path.x) > turn + 1e-3].all()


def test_upright_twin_strings_bifurcate_where_the_bars_are_pulled():
    path = equilibrium_path(twin_strings(), min_height=0.99, max_height=1.01)
    (event,) = path.events
    assert (event.kind, event.multiplicity) == ("bifurcation", 1)
    assert event.h == pytest.approx(1.0004575620966, abs=2e-12)
    assert (path.stable_h == (path.h > event.h)).all()


def test_tension_and_energy_agree_with_the_load():
    path = equilibrium_path(x_module(), min_height=0.4, max_height=0.8)
    fine = equilibrium_path(x_module(), min_height=0.4, at={"h": np.linspace(0.42, 0.7, 29)})
    at = [e for e in fine.events if e.kind == "h"]
    energy, load, h = (np.array([e.at[name] for e in at]) for name in ("energy", "load", "h"))
    work = -np.gradient(energy, h, edge_order=2)[2:-2]
    assert work == pytest.approx(load[2:-2], rel=1e-3)
    assert (path.tension_1[path.h < 0.7159] == 0).all()
    assert (path.tension_1 >= 0).all()
    assert path.h[0] == 0.8
    rest = np.flatnonzero(path.h == 0.75)
    assert path.load[rest] == 0
    assert (np.diff(path.h) < 0).all()


def test_stiff_members_lose_no_digits():
    """Against the prism's own equations, from which what cancels at rest is removed by hand."""
    stiff = {"k_base": 1e6, "k_bar": 1e6}
    own = equilibrium_path(Prism(1.0, 0.7, 0.1, 1.0, **stiff), at={"height": 0.7 - 1e-8})
    unit = equilibrium_path(prism(1.0, 0.7, 0.1, 10**6, 10**6), min_height=0.65,
                            at={"h": 0.7 - 1e-8})  # fmt: skip
    assert unit.events[0].load == pytest.approx(own.events[0].load, rel=3e-8)
    assert unit.events[0].load > 0


def test_string_unstressed_at_rest_is_slack_where_it_shortens():
    bars, low = Member(sp.sqrt(W**2 + H**2), 50, 2), Member(H, 2, 2)
    unit = Unit([W], H, [Member(W, 1, 2, string=True), low, bars], rest={W: 1, H: 0.75})
    path = equilibrium_path(unit, min_height=0.5, max_height=0.9)
    assert (path.tension_0[path.h > 0.75] == 0).all()
    assert (path.tension_0[path.h < 0.75] > 0).all()
    assert path.tension_2[path.h > 0.75] == pytest.approx(0, abs=1e-12)


def test_strings_go_slack_and_taut_again():
    """A string beside a spring that is longer at first and then shorter."""
    slope = (H - 1) * (H - sp.Rational(3, 2))
    string = Member(2 + slope, 1000, string=True, natural=sp.Rational(3, 2) + sp.Rational(1, 2))
    unit = Unit([], H, [string, Member(H, 1)], rest={H: sp.Rational(3, 2)})
    path = equilibrium_path(unit, min_height=0.5)
    kinds = [(e.kind, round(e.h, 12)) for e in path.events]
    assert kinds == [("taut", 1.0)]
    assert path.load == pytest.approx(
        1.5 - path.h - 1000 * np.maximum(slope_at(path.h), 0) * (2 * path.h - 2.5), rel=1e-11,
        abs=1e-11,
    )  # fmt: skip


def slope_at(h):
    return (h - 1) * (h - 1.5)


def test_rigid_strings_have_events_too():
    unit = Unit([W], H, [Member(W, sp.oo, 2, string=True), Member(H, 2, 2, string=True),
                         Member(sp.sqrt(W**2 + H**2), 50, 2)],
                rest={W: 1, H: sp.Rational(3, 4)})  # fmt: skip
    path = equilibrium_path(unit, min_height=0.5, max_height=0.9)
    assert (path.tension_0[path.h < 0.75] > 0).all()
    assert (path.tension_0[path.h > 0.75] == 0).all()
    assert path.w[path.h < 0.75] == pytest.approx(1.0, rel=1e-14)


def test_a_unit_is_equal_to_its_copies_and_says_what_it_is():
    unit = x_module()
    again = pickle.loads(pickle.dumps(unit))
    assert again == unit != x_module(51)
    assert hash(again) == hash(unit)
    assert again.axial_stiffness() == unit.axial_stiffness()
    path = equilibrium_path(unit, min_height=0.6)
    assert "slack: h 0.715909" in str(path)
    assert unit.problem().unit == unit


def test_an_axial_stiffness_at_a_state_needs_an_equilibrium():
    unit = kresling()
    with pytest.raises(EquilibriumError, match="rest is no equilibrium: a force is left on f"):
        unit.axial_stiffness({"h": 1.8, "f": 0.8})
    with pytest.raises(TensegrityError, match="lacks the coordinate f"):
        unit.axial_stiffness({"h": 1.8})


BAR = Member(sp.sqrt(W**2 + H**2), 50, 2)
CABLE, POST = Member(W, 1, 2, string=True), Member(H, 2, 2)
REST, K = {W: 1, H: sp.Rational(3, 4)}, sp.Symbol("k")
REFUSED = {
    "rest is no equilibrium: a force is left on w 1 N": lambda: Unit(
        [W], H, [POST], W, rest=REST),
    "no self-stress at rest: the lengths of the 0 members without prestrain have rank 0, and a "
    "force is left on w 0.181818 N": lambda: Unit(
        [W], H, [CABLE, POST], H - H + W * 0, rest=REST, prestrain={CABLE: 0.1, POST: 0}),
    "the prestrain leaves 1 states of self-stress open: give prestrain or natural of w, h, ": lambda
        : Unit([W], H, [Member(W, 2), POST, BAR, CABLE], rest=REST, prestrain={CABLE: 0.1}),
    "coordinate h is in no length of a member and no energy": lambda: Unit(
        [W], H, [CABLE], rest=REST),
    "the inner coordinates have a motion without stiffness at rest: x 1, y -1": lambda: Unit(
        sp.symbols("x y"), H, [POST], (sp.Symbol("x") + sp.Symbol("y")) ** 2,
        rest={H: 1, "x": 0, "y": 0}).problem(),
    "string w: tension -0.111111 N at rest must be at least 0": lambda: Unit(
        [W], H, [CABLE, POST, BAR], rest=REST, prestrain={CABLE: -0.1}),
    "no value for the symbol k": lambda: Unit(
        [W], H, [Member(W, K), POST, BAR], rest=REST).axial_stiffness(),
    "log(w - 1) is -inf at rest, must be a finite number": lambda: Unit(
        [W], H, [CABLE, POST], sp.log(W - 1), rest=REST),
    "sqrt(w - 2) is (0.0 + 1.0j) at rest, must be a finite number": lambda: Unit(
        [W], H, [CABLE, POST], sp.sqrt(W - 2), rest=REST),
    "k 0 N/m must be above 0": lambda: Member(W, 0),
    "count 0 must be at least 1": lambda: Member(W, 1, 0),
    "length 2 contains no coordinate": lambda: Member(2, 1),
    "prestrain 0.1 of w: a rigid member has none": lambda: Unit(
        [W], H, [Member(W, sp.oo), POST, BAR], rest=REST, prestrain={Member(W, sp.oo): 0.1}),
    "length 1 m of the rigid member w at rest must be its natural length 2 m": lambda: Unit(
        [W], H, [Member(W, sp.oo, natural=2), POST, BAR], rest=REST),
    "rest lacks the coordinate h": lambda: Unit([W], H, [CABLE, POST], rest={W: 1}),
    "parameters: 'c' is no parameter of the unit": lambda: Unit(
        [W], H, [CABLE, POST], parameters={"c": 1}, rest=REST),
    "prestrain of Member(": lambda: Unit([W], H, [CABLE, POST], rest=REST, prestrain={BAR: 0.1}),
    "min_height 0.8 must be below 0.75": lambda: x_module().problem(min_height=0.8),
    "max_height 0.7 must be above 0.75": lambda: x_module().problem(max_height=0.7),
    "box: 'q' is no coordinate of the unit": lambda: x_module().equilibria({"q": (0, 1)}),
    "box of w 0 must be above 1": lambda: x_module().equilibria({"w": (1, 0)}),
}  # fmt: skip


@pytest.mark.parametrize("words", REFUSED)
def test_wrong_units_are_refused_by_name_value_and_bound(words):
    with pytest.raises(TensegrityError) as error:
        REFUSED[words]()
    assert words in str(error.value)
