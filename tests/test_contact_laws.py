"""Contact laws of an extender in every scene and observable, against plain NumPy and SciPy.

Sizes are those of a laboratory: diameters of 10 um to 0.8 m, overlaps of 1e-6 to 1e-3 radii.
"""

import math
from dataclasses import replace

import numpy as np
import pytest
import sympy as sp
from contact_laws import DMT, KINDS, Given, Table, law_of
from scipy.integrate import solve_ivp

from granular import (
    Bead,
    Contact,
    Striker,
    chain,
    energies,
    fcc_pack,
    hertz,
    hexagonal_pack,
    hunt_crossley,
    kuwabara_kono,
    materials,
    overlaps,
    pack,
    power,
    sensor_force,
    simulate,
    viscous,
    wall_force,
    y_guide,
)
from granular.dissipation import Dissipation
from granular.lammps import to_lammps
from tensegrity import (
    Chain,
    Potential,
    PowerLaw,
    Record,
    Run,
    TensegrityError,
    Wall,
    gradient,
    objective,
)

LOSSES = {"Kuwabara-Kono": (kuwabara_kono, 1e-6), "Hunt-Crossley": (hunt_crossley, 1.0),
          "viscous": (viscous, 2.0)}  # fmt: skip
NAMES = ("steel", "ptfe", "glass", "nylon", "bronze")


class Drawn:
    """Beads, a law, and the units of their contacts: overlap s [m], time [s], speed and force."""

    def __init__(self, kind, seed):
        self.rng = np.random.default_rng(seed)
        of = [materials[x] for x in self.rng.choice(NAMES, 2)]
        self.wall = of[1]
        self.bead = Bead(min(10 ** self.rng.uniform(-5, 0), 0.8), of[0])
        self.s = self.bead.radius * 10 ** self.rng.uniform(-6, -3)
        self.law = law_of(kind, self.s)
        k = hertz(self.bead, self.bead).constant
        self.force = k * self.s**1.5
        self.time = math.sqrt(self.bead.mass * self.s / self.force)
        self.speed = self.s / self.time

    def places(self, count, dim=2):
        x = np.zeros((count, dim))
        x[:, 0] = self.bead.diameter * np.arange(count)
        return x


def pushed(contacts, r, d_rest, u):
    """Compressive forces of a row at displacements, by the plain law."""
    d = d_rest - np.diff(u)
    return np.array([float(c.force(x)) for c, x in zip(contacts, d, strict=True)])


def reference(row, state, t_end, loads, held):
    """Displacements and velocities at t_end of a row under loads, by DOP853."""
    contacts, carried = row.contacts, np.cumsum(loads)[: row.sites - 1]
    d_rest = np.array([c.rest(f) for c, f in zip(contacts, carried, strict=True)])
    n = row.sites
    scale = np.abs(state.u).max() + d_rest.max() + np.abs(state.v).max() * t_end
    units = np.append(np.full(n, scale), np.full(n, scale / t_end))

    def rates(t, y):
        u, v = np.split(y * units, 2)
        f = pushed(contacts, None, d_rest, u) - carried
        a = (np.append(0, f) - np.append(f, 0)) / row.mass
        a[held] = 0
        return np.append(v, a) / units

    start = np.append(state.u, state.v) / units
    run = solve_ivp(rates, (0, t_end), start, "DOP853", rtol=1e-11, atol=1e-13)
    return *np.split(run.y[:, -1] * units, 2), d_rest


def check_row(kind, seed):
    """A chain under gravity and preload before a wall: motion, overlaps, forces, energies."""
    at = Drawn(kind, seed)
    load = at.force * float(at.rng.choice([0.0, 1.0]))
    row = chain([at.bead] * 4, preload=load, gravity=load / at.bead.mass / 3, end=at.wall,
                law=at.law)  # fmt: skip
    v = at.speed * 0.2 * at.rng.standard_normal(4)
    state = row.at_rest(dict(enumerate(v)))
    t_end = 6 * at.time
    run = simulate(row, state, t_end, dt=t_end / 1000, method="rkn6", record=Record(every=50))
    weights = [load + load / 3, *[load / 3] * 3, 0.0]
    u, v, d_rest = reference(row, state, t_end, weights, [4])
    smooth = kind != "table"  # whose forces have corners within the steps
    np.testing.assert_allclose(run.final.v, v, rtol=0, atol=at.speed * (1e-8 if smooth else 1e-5))
    np.testing.assert_allclose(run.final.u, u, rtol=0, atol=at.s * (1e-8 if smooth else 1e-5))
    d = d_rest - np.diff(run.u, axis=1)
    np.testing.assert_allclose(row.overlaps(run.u), d, rtol=0, atol=1e-12 * d.max())
    force = np.stack([c.force(d[:, j]) for j, c in enumerate(row.contacts)], axis=1)
    bound = 1e-11 * np.abs(force).max()
    np.testing.assert_allclose(row.contact_forces(run.u), force, rtol=0, atol=bound)
    np.testing.assert_allclose(wall_force(run, "end"), force[:, -1], rtol=0, atol=bound)
    np.testing.assert_allclose(sensor_force(run, "chain", 2), force[:, :2].mean(axis=1),
                               rtol=0, atol=bound)  # fmt: skip
    stored = np.array(
        [[c.stored(x) for c, x in zip(row.contacts, line, strict=True)] for line in d]
    )
    found = energies(run)
    np.testing.assert_allclose(found.stored.sum(axis=1), stored.sum(axis=1), rtol=0,
                               atol=1e-11 * np.abs(stored).max())  # fmt: skip
    assert overlaps(run)[0] >= d[:, :3].max() * (1 - 1e-12)


def check_pack(kind, seed, contacts):
    """A pair, and three on a floor: overlaps and energies at rest, forces in balance."""
    at = Drawn(kind, seed)
    pair = pack(at.places(2), at.bead, law=at.law, contacts=contacts)
    contact, u = at.law(at.bead, at.bead), pair.at_rest().u[None]
    rest = contact.rest(0.0) if contact.attracts else 0.0
    np.testing.assert_allclose(pair.overlaps(u), [[rest]], rtol=1e-6, atol=1e-14 * at.bead.diameter)
    stored = energies(simulate(pair, pair.at_rest(), at.time, dt=at.time / 50)).stored[0].sum()
    wanted = contact.stored(rest)
    assert stored == pytest.approx(wanted, rel=1e-9, abs=1e-9 * at.force * at.s)
    side = at.bead.diameter * np.array([[0.0, 0.5], [1.0, 0.5], [0.5, 0.5 + math.sqrt(0.75)]])
    box = {"floor": (Wall((0, 0), (0, 1)), at.wall),
           "left": (Wall((-at.bead.radius, 0), (1, 0)), at.wall),
           "right": (Wall((3 * at.bead.radius, 0), (-1, 0)), at.wall)}  # fmt: skip
    g = at.force / at.bead.mass
    heap = pack(side, at.bead, box, contacts, gravity=g, law=at.law)
    x = side + heap.equilibrium.u
    pull = np.zeros((3, 2))
    wall = at.law(at.bead, at.wall)
    for i, j in ((0, 1), (0, 2), (1, 2)):
        apart = x[j] - x[i]
        size = np.linalg.norm(apart)
        pull[j] += contact.force(at.bead.diameter - size) * apart / size
        pull[i] -= contact.force(at.bead.diameter - size) * apart / size
    for i in (0, 1):
        pull[i, 1] += wall.force(at.bead.radius - x[i, 1])
    pull[0, 0] += wall.force(-x[0, 0])
    pull[1, 0] -= wall.force(x[1, 0] - at.bead.diameter)
    pull[:, 1] -= g * at.bead.mass
    digits = 1e-9 + 1e-14 * at.bead.radius / at.s  # of the overlaps, differences of places
    np.testing.assert_allclose(pull, 0, atol=digits * at.force)


def check_following(kind, seed):
    """Two beads that meet, after a gap, as a plain integration in NumPy has it."""
    at = Drawn(kind, seed)
    places = at.places(2)
    places[1] += [2 * at.s, 0.3 * at.bead.diameter]
    places[1, 0] = math.sqrt((at.bead.diameter + 2 * at.s) ** 2 - places[1, 1] ** 2)
    scene = pack(places, at.bead, law=at.law)
    contact, m = at.law(at.bead, at.bead), at.bead.mass
    n = (places[1] - places[0]) / np.linalg.norm(places[1] - places[0])
    v = 0.7 * at.speed * n
    run = simulate(scene, scene.at_rest({0: v}), 8 * at.time, dt=8 * at.time / 20_000,
                   record=Record(every=500))  # fmt: skip
    touch = 2 * at.s / (0.7 * at.speed)

    def rates(t, y):
        f = float(contact.force(y[0] * at.s)) / at.force
        return y[1], -2 * f

    def parted(t, y):
        return y[0] + 1e-300

    parted.terminal, parted.direction = True, -1
    span = 8 - touch / at.time
    ends = solve_ivp(rates, (0, span), (0.0, 0.7), "DOP853", events=parted, rtol=1e-12, atol=1e-14)
    across = (run.final.v[0] - run.final.v[1]) @ n / at.speed
    assert across == pytest.approx(ends.y[1, -1], abs=2e-3)
    np.testing.assert_allclose(run.final.v.sum(axis=0), v, rtol=0, atol=1e-9 * at.speed)
    assert run.energy_error < 2e-3
    assert m > 0


@pytest.mark.parametrize("kind", KINDS)
def test_a_row_moves_and_is_measured_as_by_plain_numpy(kind):
    for seed in range(2):
        check_row(kind, seed)


@pytest.mark.parametrize(("kind", "contacts"), [
    pytest.param(kind, contacts, marks=[pytest.mark.slow] * ((k + j) % 2))
    for k, kind in enumerate(KINDS) for j, contacts in enumerate(("fixed", "follow"))
])  # fmt: skip
def test_packs_rest_where_the_law_says(kind, contacts):
    for seed in range(3):
        check_pack(kind, seed, contacts)


@pytest.mark.parametrize("kind", KINDS)
def test_contacts_that_form_obey_the_law(kind):
    check_following(kind, 1)


STEEL = materials["steel"]
BEAD = Bead(10e-3, STEEL)
S = 2e-7  # m: overlap at which DMT's pull is Hertz's force


def laws_with_losses():
    for kind in ("corrected", "table"):
        for name, (loss, constant) in LOSSES.items():
            is_slow = (kind == "table") != (name == "Kuwabara-Kono")
            yield pytest.param(kind, loss(constant), id=f"{kind} {name}",
                               marks=[pytest.mark.slow] * is_slow)  # fmt: skip


def lossy(kind, loss):
    law = law_of(kind, S)
    return lambda one, other: replace(law(one, other), dissipation=loss(one, other).dissipation)


@pytest.mark.parametrize(("kind", "loss"), list(laws_with_losses()))
def test_losses_take_their_elastic_force_from_the_law(kind, loss):
    """Restitution by NumPy's force and its difference quotient, of `restitution` and of a run."""
    law, speed = lossy(kind, loss), 0.1
    contact, m = law(BEAD, BEAD), BEAD.mass / 2
    c = contact.dissipation

    def force(d, rate):
        f, h = float(contact.force(d)), 1e-6 * d
        slope = (float(contact.force(d + h)) - float(contact.force(d - h))) / (2 * h) if d else 0.0
        part = {"Kuwabara-Kono": slope, "Hunt-Crossley": f, "viscous": float(d > 0)}
        return max(f + c.constant * part[c.model] * rate, 0.0)

    def rates(t, y):
        return y[1], -force(max(y[0], 0) * 1e-6, y[1] * speed) * 1e-6 / (m * speed**2)

    def parted(t, y):
        return y[0] if y[1] < 0 else 1.0

    parted.terminal = True
    run = solve_ivp(rates, (0, 100), (0, 1.0), "DOP853", events=parted, rtol=1e-10, atol=1e-13)
    e = contact.restitution(m, speed)[0]
    assert e == pytest.approx(-run.y[1, -1], abs=1e-5)
    assert e < 0.999
    row = chain([BEAD], striker=Striker(BEAD, speed), law=law)
    run = simulate(row, row.start(), 8e-5, dt=8e-5 / 20_000, method="rk8")
    assert (run.final.v[1] - run.final.v[0]) / speed == pytest.approx(e, abs=1e-4)
    assert run.energy[-1] + run.loss[-1] == pytest.approx(run.energy[0], rel=1e-5)
    forces = row.contact_forces(run.u[::100], run.v[::100])[:, 0]
    d, rate = row.overlaps(run.u[::100])[:, 0], -np.diff(run.v[::100], axis=1)[:, 0]
    wanted = [force(max(x, 0.0), y) for x, y in zip(d, rate, strict=True)]
    np.testing.assert_allclose(forces, wanted, rtol=0, atol=1e-5 * max(wanted))


@pytest.mark.parametrize("name", LOSSES)
@pytest.mark.parametrize("exponent", [0.8, 1.0])
def test_losses_act_in_contact_only(name, exponent):
    """Also where the elastic force begins with a slope."""
    loss, constant = LOSSES[name]

    def law(one, other):
        return replace(loss(constant)(one, other), constant=1e6, exponent=exponent)

    row = chain([BEAD] * 2, law=law, gaps=[1e-6])
    state = row.at_rest({0: 0.1})
    assert row.contact_forces(state.u, state.v) == 0
    run = simulate(row, state, 5e-6, dt=1e-7)
    np.testing.assert_array_equal(run.v, run.v[:1].repeat(len(run.t), axis=0))


def test_a_collision_under_adhesion_has_the_known_duration():
    """3.34196753730 in units in which mass, constant and speed are 1, for a pull of 0.1."""
    e, time = DMT(1.0, pull=0.1).restitution(1.0, 1.0)
    assert e == 1
    assert time == pytest.approx(3.34196753730, abs=1e-9)


def test_gaps_count_from_the_touch():
    row = chain([BEAD] * 4, law=law_of("DMT", S), gaps=[0.0, 1e-6, 3e-6])
    np.testing.assert_allclose(row.overlaps(row.at_rest().u), [S, -1e-6, -3e-6], atol=1e-20)


@pytest.mark.parametrize("kind", [
    pytest.param(kind, marks=[pytest.mark.slow] * (kind == "old DMT")) for kind in KINDS
])  # fmt: skip
def test_guides_and_packs_of_all_kinds_rest(kind):
    law = law_of(kind, S)
    guide = y_guide(4, 5, bead=BEAD, law=law, end=STEEL, gravity=9.81)
    hexagonal = hexagonal_pack(3, 3, bead=BEAD, law=law, floor=STEEL, sides=STEEL, gravity=9.81)
    cubic = fcc_pack(2, 2, bead=BEAD, law=law, floor=STEEL, contacts="follow", gravity=9.81,
                     sides=STEEL)  # fmt: skip
    for scene in (guide, hexagonal, cubic):
        assert scene.equilibrium.residual < 1e-10
        run = simulate(scene, scene.at_rest(), 2e-5, dt=1e-7)
        assert np.abs(run.v).max() < 1e-9
        assert np.abs(run.u - run.u[0]).max() < 1e-3 * S


@pytest.mark.parametrize("kind", ["DMT", "corrected"])
def test_derivatives_by_parameters_move_the_rest_too(kind):
    row = chain([BEAD] * 3, law=law_of(kind, S), preload=1.0)
    peak, state = objective.peak(objective.load(bond=1)), row.at_rest({0: 1e-2})
    found = gradient(peak, row, state, 5e-5, dt=2e-7)
    for name in row.springs[0].parameters:
        if name == "overlap":
            continue
        sides = []
        for sign in (1, -1):
            moved = [x.varied({name: x.parameters[name] * (1 + sign * 1e-5)}) for x in row.springs]
            line = Chain(moved, row.sites, row.mass)
            sides.append(gradient(peak, line, state, 5e-5, dt=2e-7).value)
        step = 2e-5 * row.springs[0].parameters[name]
        assert found.by(name).sum() == pytest.approx((sides[0] - sides[1]) / step, rel=1e-5)


class Half(Contact):
    """Springs from rest, without the overlap there."""

    def spring(self, preload=0.0, length=None):
        return DMT(self.constant, pull=1.0).spring(preload, length)


class Far(Contact):
    """A linear spring that also pulls."""

    @property
    def potential(self):
        r = sp.Symbol("r")
        return Potential(self.constant * r**2 / 2, r)


def loose(**options):
    return pack([[0.0, 0.0], [1.1 * BEAD.diameter, 0.0]], BEAD, **options)


def doubled(one, other):
    return Contact(2 * hertz(one, other).constant)


def mixed(one, other):
    return replace(kuwabara_kono(1e-6)(one, other), constant=1e9, exponent=2.0)


REFUSED = [
    ("not Hertz's", lambda: chain([BEAD] * 2, law=law_of("DMT", S))),
    ("not Hertz's", lambda: chain([BEAD] * 2, law=law_of("old DMT", S))),
    ("not Hertz's", lambda: y_guide(4, 4, bead=BEAD, law=law_of("table", S))),
    ("not Hertz's", lambda: pack([[0.0], [BEAD.diameter]], BEAD, law=law_of("corrected", S))),
    ("not Hertz's", lambda: loose(law=power(1e9, 1.5))),
    ("not Hertz's", lambda: loose(law=doubled)),
    ("not Hertz's", lambda: loose(law=mixed)),
    ("touches no bead", lambda: loose(law=power(1e9, 1.5), contacts="fixed")),
    ("touches no bead", lambda: loose(law=doubled, contacts="fixed")),
    ("touches no bead", lambda: loose(law=hunt_crossley(0.1), contacts="fixed")),
    ("touches no wall", lambda: pack(
        [[0.0, BEAD.diameter]], BEAD, {"floor": (Wall((0, 0), (0, 1)), STEEL)}, "fixed",
        law=doubled)),
]  # fmt: skip


@pytest.mark.parametrize(("words", "make"), REFUSED)
def test_lammps_is_given_no_other_law_than_its_own(words, make, tmp_path):
    scene = make()
    with pytest.raises(TensegrityError, match=words):
        to_lammps(scene, scene.at_rest(), 1e-5, 1e-7, tmp_path / "in.x")
    assert not list(tmp_path.iterdir())


def test_lammps_is_given_hertzs_law_by_whatever_function_says_it(tmp_path):
    texts = []
    for law in (hertz, lambda one, other: Contact(hertz(one, other).constant)):
        scene = loose(law=law)
        texts.append(to_lammps(scene, scene.at_rest(), 1e-5, 1e-7, tmp_path / "in").read_text())
    assert texts[0] == texts[1]


@pytest.mark.parametrize(
    ("words", "call"),
    [
        ("losses of Kuwabara-Kono", lambda: chain(
            [BEAD] * 2, law=lossy("DMT", kuwabara_kono(1e-6)))),
        ("attracts and it rubs", lambda: y_guide(
            4, 4, bead=BEAD, law=law_of("DMT", S), friction=(0.1, 0.01))),
        ("not the overlap there", lambda: pack([[0.0], [1.0]], BEAD, law=lambda a, b: Half(1e9))),
        ("not the overlap there", lambda: chain([BEAD] * 2, law=lambda a, b: Half(1e9))),
        ("partners that are apart", lambda: pack(
            [[0.0], [BEAD.diameter]], BEAD, law=lambda a, b: Far(1e9))),
        ("never borne", lambda: Table(1.0, overlaps=(1e-6, 2e-6), forces=(1.0, 1.0)).overlap(2.0)),
        ("not Hertz's", lambda: gradient(
            objective.load(bond=0), (row := chain([BEAD] * 3, law=law_of("corrected", S))),
            row.at_rest({0: 0.01}), 1e-5, dt=1e-7).by("diameter")),
        ("no share of the whole", lambda: energies(simulate(
            (row := chain([BEAD] * 3, law=law_of("DMT", S))), row.at_rest(), 1e-6, dt=1e-7,
        )).fractions),
    ],
)  # fmt: skip
def test_what_a_law_cannot_say_is_refused(words, call):
    with pytest.raises(TensegrityError, match=words):
        call()


def test_a_file_holds_no_contact_of_another_law(tmp_path):
    row = chain([BEAD] * 3, law=law_of("DMT", S))
    run = simulate(row, row.at_rest({0: 1e-3}), 1e-5, dt=1e-7)
    run.save(tmp_path / "run.npz")
    with pytest.raises(TensegrityError, match="build the scene again"):
        _ = Run.load(tmp_path / "run.npz").scene.contacts


def test_newtons_cradle_of_three_balls():
    """E. J. Hinch, S. Saint-Jean, Proc. R. Soc. A 455, 3201 (1999)."""
    row = chain([BEAD] * 3)
    run = simulate(row, row.at_rest({0: 1.0}), 1e-3, tol=1e-9)
    np.testing.assert_allclose(run.final.v, [-0.0709524, 0.0764031, 0.9945493], atol=6e-8)


def test_little_viscosity_follows_the_series():
    """R. Ramirez and others, Phys. Rev. E 60, 4465 (1999), with b = (3/2) c in units of the
    collision: 1 - 1.153449 b + 0.798267 b^2, to 0.265 b^(5/2)."""
    for b in (0.01, 0.03, 0.1):
        loss = Dissipation("Kuwabara-Kono", b / 1.5)
        e = Contact(1.0, 1.5, loss).restitution(1.0, 1.0)[0]
        assert abs(e - (1 - 1.153449 * b + 0.798267 * b**2)) < 0.265 * b**2.5
        assert e != 1 - 1.153449 * b


@pytest.mark.slow
@pytest.mark.parametrize("kind", KINDS)
def test_laws_hold_at_many_scales(kind):
    for seed in range(100, 200):
        check_row(kind, seed)
        check_pack(kind, seed, ["fixed", "follow"][seed % 2])
    for seed in range(100, 110):
        check_following(kind, seed)
    print(f"{kind}: 100 rows, 200 packs at rest, 10 collisions")


@pytest.mark.parametrize("loss", [
    pytest.param(viscous(1.0), marks=pytest.mark.slow),
    pytest.param(hunt_crossley(0.1), marks=pytest.mark.slow),
    kuwabara_kono(1e-6),
])  # fmt: skip
def test_numbers_and_parameters_of_a_law_lose_the_same(loss):
    """Also where a parameter has the name that a number goes by, a power is a float, or a number is
    negative."""
    r, k = sp.Symbol("r"), sp.Symbol("constant 0")
    cubic = sp.Float(2.3e10) * (-r) ** 3 / 3
    laws = [
        Potential(sp.Heaviside(-r) * (k * r**2 / 2 + cubic), r, {"constant 0": 3.7e6}),
        Potential(sp.Heaviside(-r) * (sp.Float(3.7e6) * r**2 / 2 + cubic), r),
        Potential(sp.Float(3.7e6) * sp.Max(-r, 0) ** sp.Float(2.37), r),
        PowerLaw(3.7e6 * 2.37, 1.37),
    ]
    found, bead = [], Bead(4.76e-3, materials["steel"])
    for law in laws:
        contact = Given(1.0, 1.5, loss(bead, bead).dissipation, law)
        row = chain([bead] * 3, striker=Striker(bead, speed=0.5), law=lambda *_, c=contact: c)
        end = simulate(row, row.start(), 2e-5, dt=1e-8).final.v
        found.append([*contact.restitution(1e-3, 1.0), *end])
    assert found[0] == pytest.approx(found[1], rel=1e-9)
    assert found[2] == pytest.approx(found[3], rel=1e-9)
