"""The composite claim: the detector says yes and no where it should, and the verdict stands."""

import matplotlib
import numpy as np
import pytest
import sympy as sp

matplotlib.use("Agg")
import matplotlib.pyplot as plt

from figures import _composite, _solitons, _stored, composite
from tensegrity import Chain, Potential, Prism, Record, budget, simulate, solitary_wave

RIGID = Prism(1.0, 0.8, 0.02, 1.0).potential()
FIRST, SECOND = _composite.FOUND
RESULTS, _ = _stored.read(_stored.DATA / "composite_data.npz")


def exact(spring):
    return lambda peak: solitary_wave(spring, amplitude=peak)


def seen(chain, state, sign, front=0.0, spring=RIGID):
    r = chain.elongation(state.u)
    return _solitons.pulses(r, state.v, sign, exact(spring), front, 0.05 * np.abs(r).max())


# the detector


def test_two_solitary_waves_put_into_a_run_are_found():
    waves = [solitary_wave(RIGID, speed_ratio=ratio) for ratio in (1.6, 1.2)]
    chain = Chain(RIGID, 400)
    state = waves[0].launch(chain, 100.3) + waves[1].launch(chain, 160.7)
    run = simulate(chain, state, 60.0 / waves[1].speed, method="rkn6", record=Record(every=10**6))
    found = seen(chain, run.final, -1)
    assert len(found) == 2
    for one, wave in zip(found, waves, strict=True):
        assert one.misfit < 5e-3
        assert one.peak == pytest.approx(wave.amplitude, rel=2e-3)
        assert one.ratio == pytest.approx(wave.speed_ratio, rel=2e-3)
    assert not seen(chain, run.final, 1)


def test_a_wave_that_comes_back_is_refused():
    """Same elongations, opposite velocities: what an end has returned."""
    wave = solitary_wave(RIGID, speed_ratio=1.3)
    chain = Chain(RIGID, 200)
    (there,) = seen(chain, wave.launch(chain, 100.25), -1)
    (back,) = seen(chain, wave.launch(chain, 100.25, direction=-1), -1)
    assert there.misfit < 5e-3
    assert back.misfit > 1


def test_peaks_of_a_dispersive_train_are_refused():
    """A pull on a chain that carries no small rarefaction waves spreads into a train."""
    chain = Chain(RIGID, 250)
    run = simulate(chain, chain.at_rest({0: -0.01}), 150.0 / RIGID.sound_speed(), method="rkn6")
    for sign in (1, -1):
        found = seen(chain, run.final, sign)
        assert found
        assert all(one.misfit > 4 * _solitons.MISFIT for one in found)


def test_a_wave_that_is_scaled_by_a_fifth_is_refused():
    wave = solitary_wave(RIGID, speed_ratio=1.3)
    chain = Chain(RIGID, 200)
    state = wave.launch(chain, 100.25)
    state = type(state)(1.2 * state.u, 1.2 * state.v)
    (one,) = seen(chain, state, -1)
    assert one.misfit > _solitons.MISFIT


def test_only_what_is_ahead_of_sound_and_strong_enough_counts():
    good = _solitons.Found(10.0, -0.1, 0.01, 3.0, energy=1e-3)
    assert good.is_solitary(1.0)
    assert not good._replace(misfit=0.051).is_solitary(1.0)
    assert not good._replace(ahead=-0.1).is_solitary(1.0)
    assert not good._replace(energy=0.9 * _solitons.LEAST).is_solitary(1.0)
    answer = _composite.Answer([good], [], [good, good], 0.0)
    assert answer.verdict(1.0) == (1, 2)
    assert answer._replace(ends=1e-6).verdict(1.0) == (0, 0)


# interfaces


@pytest.fixture(scope="module")
def control():
    """Two cubic springs: the detector's control, without prisms."""
    r, k, a, b = sp.symbols("r k a b")
    law = k * (r**2 / 2 + a * r**3 / 3 + b * r**4 / 4)
    laws = (1.0, 1.0, 0.36), (0.010237, -1.149207, 1.542135)
    near, far = (Potential(law, r, dict(zip((k, a, b), x, strict=True))) for x in laws)
    peak = solitary_wave(near, speed_ratio=1.6).amplitude
    real = _composite.Interface(near, far, (1.0, 1.388055), peak)
    return real, _composite.outcome(real, 700.0, 300, dt=0.12, rows=1)


def test_cubic_laws_reflect_a_solitary_rarefaction_and_transmit_one_of_each_sign(control):
    _, one = control
    energy = one.incident.energy
    first = one.fine.back[0]
    assert first.is_solitary(energy)
    assert first.misfit < 5e-3
    assert one.fine.leading[0].misfit < 5e-3
    assert one.fine.leading[0].ratio > 3
    strongest = one.fine.train[0]
    assert strongest.is_solitary(energy)
    assert strongest.energy / energy == pytest.approx(4e-4, rel=0.1)
    assert one.moved < 1e-3


@pytest.mark.parametrize("seed", range(4))
def test_what_the_far_chain_holds_is_what_the_incident_wave_brought_less_what_stays(seed):
    """Momentum, on random interfaces: of the sites, and as the impulse of the bond between."""
    rng = np.random.default_rng(seed)
    near, far = (
        Prism(1.0, *rng.uniform((0.6, 0.02), (1.0, 0.2)), rng.uniform(0.2, 1)).potential()
        for _ in range(2)
    )
    masses = tuple(rng.uniform(0.5, 2, 2))
    peak = -0.3 * rng.uniform() * near.domain[1] - 0.02
    peak = max(peak, 0.3 * near.domain[0])
    real = _composite.Interface(near, far, masses, peak)
    wave = real.wave()
    begun = _composite.start(real, wave, 60, 60)
    duration = begun.arrival + 20.0 / max(*real.sounds, wave.speed)
    run = simulate(
        begun.chain, begun.state, duration, method="rkn6", tol=None, record=Record(every=1)
    )
    momentum = begun.chain.mass * run.v
    near_part, far_part = momentum[:, :60].sum(axis=1), momentum[:, 60:].sum(axis=1)
    assert np.abs((near_part + far_part) / wave.momentum - 1).max() < 1e-9
    passed = budget(run, 59)
    assert abs(far_part[-1]) > 0.05 * abs(wave.momentum)
    assert passed.impulse[-1] == pytest.approx(far_part[-1] - far_part[0], rel=1e-5)


def test_a_reflected_rarefaction_that_holds_all_that_goes_back_asks_for_more_tension(control):
    """near + far = 1 with near < 0 gives far > 1; compressions make the rest pull still more."""
    _, one = control
    near, far, pushed = one.momenta()
    assert near + far == pytest.approx(1, abs=1e-9)
    assert one.fine.back[0].momentum * one.incident.momentum > 0  # seen in a mirror
    assert pushed < 0


def found(name):
    return _composite.made(dict(zip(_composite.NAMES, _composite.FOUND[name], strict=True)))


@pytest.mark.parametrize("name", [FIRST, SECOND])
def test_interfaces_are_from_acoustically_hard_to_soft(name):
    real = found(name)
    assert real.impedances[1] < real.impedances[0]
    assert real.sounds[1] < real.sounds[0]


def test_both_interfaces_reflect_and_transmit_what_the_page_says():
    """By the exact prisms, as stored; the compressions leave late and one after the other."""
    tables = RESULTS
    (back,) = composite.solitary(tables, FIRST, "back")
    assert back["energy"] == pytest.approx(0.289, abs=0.002)
    first, second = composite.solitary(tables, FIRST, "train")
    assert first["energy"] == pytest.approx(0.0292, abs=5e-4)
    assert 100 < first["delay"] < second["delay"] - 50
    assert max(x["misfit"] for x in (back, first, second)) < 0.01
    pressed = max(composite.solitary(tables, SECOND, "pressed"), key=lambda x: x["energy"])
    assert pressed["energy"] == pytest.approx(0.646, abs=0.002)
    for name in _composite.FOUND:
        value = dict(zip(tables[name]["quantity"], tables[name]["value"], strict=True))
        assert value["momentum error"] < 1e-9
        assert value["largest change of a peak at half the step"] < 1e-4
        assert value["at an end, over the peak"] < _composite.QUIET


@pytest.mark.slow
def test_the_first_interface_does_both_from_its_parameters():
    real = found(FIRST)
    one = _composite.outcome(real, _composite.duration(real))
    assert one.does_both
    assert one.fine.back[0].energy / one.incident.energy == pytest.approx(0.289, abs=0.002)
    near, far, pushed = one.momenta()
    assert near + far == pytest.approx(1, abs=1e-9)
    assert pushed < far < 0  # pushes: what follows the reflected rarefaction pays for it


def test_words_and_pictures_are_made_of_what_was_computed():
    tables = RESULTS
    assert "Momentum is conserved" in composite.text(tables)
    figure = plt.figure(layout="constrained")
    composite.draw(figure, tables)
    plt.close(figure)
    for row in composite.table(tables):
        assert all(row.values())
