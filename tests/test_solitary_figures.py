"""The pictures of exact waves: what they claim of the asymptotics, and that they are drawn."""

from itertools import product

import matplotlib
import numpy as np
import pytest

matplotlib.use("Agg")
import matplotlib.pyplot as plt

from derivations import waves
from figures import proven_waves, solitary_errors, solitary_families
from tensegrity import Prism, predict, solitary_wave, tent
from tensegrity.waves.curve import largest_speed

pytestmark = pytest.mark.unchanged()


@pytest.fixture(scope="module")
def errors():
    return solitary_errors.data()


def drawn(module, tables):
    figure = plt.figure()
    module.draw(figure, tables)
    labels = [axes.get_xlabel() for axes in figure.axes]
    plt.close(figure)
    return labels


def test_12_16_sound_speeds_are_reached_by_one_of_the_prisms_only():
    ratios = []
    for shape in ((0.7, 0.01), (0.6, 0.001)):
        spring = Prism(1.0, *shape, 1.0).potential()
        ratios.append(predict(spring)["compression"].speeds[1] / spring.sound_speed())
    assert ratios[0] < 12.16 < ratios[1]
    wave, x = solitary_wave(spring, speed_ratio=12.16), np.linspace(-3, 3, 601)
    assert wave.residual <= 1e-12
    assert np.abs(wave.elongation(x) - tent(spring, x)).max() < 0.1 * -spring.domain[0]


def test_sech2_error_over_the_peak_falls_with_gamma_squared(errors):
    """As the order 4 of the error itself says; the range shrinks with the prestrain."""
    assert solitary_errors.order(errors) == pytest.approx(2, abs=0.05)
    at = [
        errors[f"sech2_{name}"]["error"][0] for name in ("h0.7_p0.1", "h0.7_p0.01", "h0.6_p0.001")
    ]
    assert at[0] < at[1] / 4 < at[2] / 16


def test_tent_is_not_reached_at_a_fixed_prism(errors):
    """Its error has a limit above 0 as the stroke is used up: a series in the root of the rest."""
    for shape in solitary_errors.SHAPES:
        table = errors[f"tent_h{shape[0]:g}_p{shape[1]:g}"]
        left, error = np.sqrt(table["stroke_left"]), np.array(table["error"])
        limits = [np.polynomial.Polynomial.fit(left[:n], error[:n], n - 1)(0.0) for n in (3, 4)]
        assert limits[0] == pytest.approx(limits[1], abs=0.005)
        assert min(limits) > 0.03


@pytest.mark.slow
def test_width_falls_and_energy_rises_along_every_family():
    tables = solitary_families.data()
    for table in tables.values():
        assert (np.diff(table["width"]) < 0).all()
        assert (np.diff(table["energy"]) > 0).all()
        assert (np.diff(np.abs(table["peak"])) > 0).all()
    assert drawn(solitary_families, tables)[0].startswith("speed over that of sound")


@pytest.mark.slow
def test_largest_speed_agrees_at_two_resolutions_and_follows_the_two_body_estimate():
    for slenderness, prestrain in product(np.geomspace(0.36, 3.0, 6), np.geomspace(1e-4, 0.3, 5)):
        spring = Prism(1.0, slenderness, prestrain, 1.0).potential()
        fine, coarse = (largest_speed(spring, closest=closest) for closest in (4e-3, 8e-3))
        assert coarse == pytest.approx(fine, rel=1e-3)
        locking = float(spring.energy(spring.domain[0]))
        values = {waves.mass: 1.0, waves.stroke: -spring.domain[0], waves.locking_energy: locking}
        assert 0.85 < fine / float(waves.largest_speed().subs(values)) < 1


@pytest.mark.slow
def test_proofs_reach_round_off_and_terms_have_their_orders(monkeypatch):
    pytest.importorskip("flint")
    few = {name: (prism, ratios[1:2]) for name, (prism, ratios) in proven_waves.PRISMS.items()}
    monkeypatch.setattr(proven_waves, "PRISMS", few)
    tables = proven_waves.data()
    assert all(max(tables[name]["radius"]) < 1e-11 for name in few)
    orders = [row["measured"] for row in proven_waves.table(tables)][3:]
    assert list(map(float, orders)) == pytest.approx([2, 4, 6], abs=0.02)
    assert drawn(proven_waves, tables)[0] == "speed over that of sound"
