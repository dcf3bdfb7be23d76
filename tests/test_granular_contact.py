"""Materials, beads and contact laws."""

import math

import pytest
from scipy.integrate import quad

from granular import Bead, Contact, hertz, materials, power
from tensegrity import TensegrityError

TABLES = {  # GPa, -, kg/m^3
    "the talk": {
        "steel": (193.00, 0.30, 8000),
        "ptfe": (1.46, 0.46, 2200),
        "rubber": (0.30, 0.49, 2200),
        "bronze": (76.00, 0.41, 8500),
        "glass": (62.00, 0.20, 2425),
        "nylon": (3.55, 0.40, 1085),
    },
    "granular network": {
        "steel": (193, 0.30, 8000),
        "ptfe": (1.46, 0.46, 2200),
        "parylene": (15, 0.38, 1289),
    },
}


@pytest.mark.parametrize("source", TABLES)
def test_materials_are_those_of_the_printed_tables(source):
    printed = TABLES[source]
    assert set(printed) == {m.name for m in materials.values() if source in m.source}
    for name, (modulus, poisson, density) in printed.items():
        found = materials[name]
        assert found.modulus == pytest.approx(modulus * 1e9, rel=1e-15)
        assert (found.poisson, found.density) == (poisson, density)


def test_six_materials_of_the_talk_and_three_of_the_paper():
    talk = {m.name for m in materials.values() if "the talk" in m.source}
    paper = {m.name for m in materials.values() if "granular network" in m.source}
    assert talk == {"steel", "ptfe", "rubber", "bronze", "glass", "nylon"}
    assert paper == {"steel", "ptfe", "parylene"}


@pytest.mark.parametrize(("name", "printed"), [("steel", 0.45e-3), ("ptfe", 0.123e-3)])
def test_printed_masses_are_density_times_volume_to_one_percent(name, printed):
    bead = Bead(4.76e-3, materials[name])
    assert bead.mass == pytest.approx(printed, rel=1.1e-2)
    assert bead.mass != pytest.approx(printed, rel=2e-3)  # so a printed mass is worth giving


def test_heavy_striker_has_the_radius_of_its_density():
    bead = Bead.of_mass(5.33e-3, materials["steel"])
    assert Bead(bead.diameter, bead.material).mass == pytest.approx(5.33e-3, rel=1e-14)


def test_coated_bead_keeps_mass_and_place_of_its_core():
    core = Bead(4.76e-3, materials["steel"], 0.45e-3)
    bead = core.coated(materials["parylene"], 50e-6)
    assert (bead.mass, bead.diameter) == (core.mass, core.diameter)
    assert bead.contact_radius == pytest.approx(2.43e-3, rel=1e-14)
    assert bead.material is materials["parylene"]


@pytest.mark.parametrize("other", ["steel", "ptfe", "nylon"])
def test_hertz_constant_balances_boussinesq_sinking(other):
    """At the centre and the rim of the contact the bodies' sinking fills overlap minus gap.

    Sinking by quadrature of Boussinesq's point loads under the half-sphere pressure that carries
    the force; the two materials differ, so mixed-up Poisson ratios would show.
    """
    one = Bead(4.76e-3, materials["steel"])
    two = Bead(9.53e-3, materials[other])
    overlap = 1e-6
    force = hertz(one, two).constant * overlap**1.5
    curvature = 1 / one.radius + 1 / two.radius
    contact = math.sqrt(overlap / curvature)
    pressure = 3 * force / (2 * math.pi * contact**2)
    compliance = sum(
        (1 - b.material.poisson**2) / (math.pi * b.material.modulus) for b in (one, two)
    )
    centre = 2 * math.pi * quad(lambda s: math.sqrt(1 - (s / contact) ** 2), 0, contact)[0]
    assert compliance * pressure * centre == pytest.approx(overlap, rel=1e-9)
    # at the rim: chords through it at an angle, each carrying a half circle of pressure
    chord = quad(lambda w: math.pi / 2 * contact * math.cos(w) ** 2, -math.pi / 2, math.pi / 2)[0]
    rim = overlap - contact**2 * curvature / 2
    assert compliance * pressure * chord == pytest.approx(rim, rel=1e-9)


def test_wall_is_the_limit_of_a_large_bead():
    bead, ptfe = Bead(4.76e-3, materials["steel"]), materials["ptfe"]
    wall = hertz(bead, ptfe).constant
    errors = [abs(hertz(bead, Bead(d, ptfe)).constant / wall - 1) for d in (10.0, 100.0)]
    assert errors[1] < 3e-5
    assert errors[0] / errors[1] == pytest.approx(10, rel=1e-2)


def test_power_law_of_any_exponent_is_the_same_for_all():
    law = power(2.0, 2.5)
    contact = law(Bead(1e-2, materials["glass"]), materials["nylon"])
    assert contact == Contact(2.0, 2.5)
    assert float(contact.spring().tension(-0.3)) == pytest.approx(-2.0 * 0.3**2.5, rel=1e-14)
    assert contact.overlap(2.0 * 0.3**2.5) == pytest.approx(0.3, rel=1e-14)


@pytest.mark.parametrize(
    ("make", "words"),
    [
        (lambda: materials["wood"], "wood.*steel"),
        (lambda: Contact(1.0, 0.0), "exponent 0 must be above 0"),
        (lambda: hertz(Bead(1e-3, materials["steel"]), "wall"), "neither a Bead nor a Material"),
        (lambda: hertz("steel", Bead(1e-3, materials["steel"])), "'steel' is not a Bead"),
        (lambda: Bead.of_mass(1e-3, "steel"), "material 'steel' is not a Material; take one of"),
    ],
)
def test_bad_input_is_refused_with_its_bound(make, words):
    with pytest.raises(TensegrityError, match=words):
        make()
