"""The wave scenes of the talk: what the pictures claim, at smaller sizes or fewer points."""

import math

import matplotlib
import numpy as np
import pytest

matplotlib.use("Agg")
import matplotlib.pyplot as plt
from scipy.optimize import minimize_scalar

from figures import (
    _impact,
    _measure,
    _scenes,
    chosen,
    wave_collision,
    wave_composite,
    wave_mitigation,
    wave_power_law,
    wave_softening,
    wave_speeds,
    wave_supercompact,
    wave_tuning,
)
from tensegrity import (
    EquilibriumError,
    LockingError,
    PowerLaw,
    Prism,
    Record,
    StabilityError,
    budget,
    simulate,
    solitary_wave,
)

WAVES = [
    picture for name, picture in chosen(["waves"]).items()
    if name.startswith("wave_") and hasattr(picture, "table")
]  # fmt: skip


def numbers(table):
    return {name: number.value for name, number in _measure.from_table(table).items()}


# 1. from near sound to far above it


@pytest.fixture(scope="module")
def fast():
    prism, how = wave_speeds.WAVES[3.0]
    return _impact.comparison(_scenes.rigid(*prism), 3.0, **how)[0]


def test_wave_after_an_impact_is_the_exact_wave_of_its_speed(fast):
    found = numbers(fast["numbers"])
    tuned = _measure.from_table(fast["numbers"])["speed over sound speed"]
    assert abs(tuned.value - 3.0) <= 2 * tuned.error < 1e-5  # tuned with the coarser run
    assert found["emerged - exact, over the peak"] < 1e-6
    for name in ("launched", "emerged"):
        width = found[f"width, {name} [sites]"]
        assert width == pytest.approx(found["width, exact [sites]"], abs=1e-4)
    assert abs(found["speed of the launched wave over exact - 1"]) < 1e-6
    assert found["energy error"] < 1e-9


def test_waves_span_about_7_3_and_2_prisms():
    widths = [
        solitary_wave(_scenes.rigid(*prism), speed_ratio=ratio).width()
        for ratio, (prism, _) in wave_speeds.WAVES.items()
    ]
    assert 7 < widths[0] < 8
    assert widths[1:] == sorted(widths[1:], reverse=True)
    assert 2 < widths[3] < 2.2 < widths[2] < 2.5 < widths[1] < 3


def test_sech2_fits_better_nearer_to_sound_and_with_more_prestrain():
    table = wave_speeds.near_sound()
    assert table["0.1"][0] < 0.1 < table["0.1"][1] < table["0.01"][1]


# 2. super-compact waves


def test_waves_stay_two_and_a_half_prisms_wide_as_the_prestrain_vanishes():
    widths = [wave_supercompact.at_amplitude(p0).width() for p0 in (0.1, 1e-3, 1e-5, 0.0)]
    assert widths == sorted(widths, reverse=True)
    assert widths[2] == pytest.approx(widths[3], abs=0.01)
    cubic = solitary_wave(PowerLaw(1.0, 3.0), amplitude=-1.0).width()
    assert wave_supercompact.at_amplitude(0.0, 1e-3).width() == pytest.approx(cubic, abs=1e-3)


# 3. softening chain


def test_blow_beside_a_held_end_becomes_a_supersonic_rarefaction_wave():
    assert wave_softening.kind("held end, next mass pushed", 0.15)[0] == "soliton"
    word, speed = wave_softening.kind("free end pushed", 0.15)
    assert word == "compression"
    assert speed < 1


def test_softening_past_the_limit_point_is_a_clear_error():
    assert wave_softening.kind("free end, heavy striker (mass 5)", 0.2) == ("collapse", 0.0)
    scene = wave_softening.struck("free end, heavy striker (mass 5)", 0.2, 40, 60.0)
    with pytest.raises(LockingError, match=r"between sites .* got there at t = "):
        simulate(*scene, method="rkn6", dt=0.05)


def test_a_pulse_whose_tail_is_not_seen_leads_all_the_same():
    for blow, speed in (("heavy striker (mass 5)", 0.15), ("five masses pushed", 0.2)):
        word, ratio = wave_softening.kind(f"free end, {blow}", speed)
        assert word == "compression"
        assert 0.9 < ratio < 1


def test_only_a_collapse_is_taken_for_one(monkeypatch):
    def unstable(*_, **__):
        raise StabilityError("dt 0.1 s is beyond 0.01 s")

    monkeypatch.setattr(wave_softening, "simulate", unstable)
    with pytest.raises(StabilityError):
        wave_softening.kind("free end pushed", 0.2)


def test_only_pushed_blows_answer_for_a_compressive_disturbance():
    numbers = dict.fromkeys(
        ("speed", "exact speed", "fraction", "tail", "energy error", "momentum error"),
        _measure.Number(1.0, 1e-9),
    )
    tables = dict.fromkeys(("held", "free", "shaken"), _measure.as_table(numbers))
    tables["map"] = {blow: ["soliton", "compression"] for blow in wave_softening.BLOWS}
    row = next(r for r in wave_softening.table(tables) if "blows at" in r["scene"])
    assert "5 pushed blows" in row["scene"]
    assert "held end, next mass pushed; free end pushed" in row["measured"]
    assert "pulled" not in row["measured"]


def test_force_at_the_held_end_closes_the_momentum():
    scene = wave_softening.struck("held end, next mass pushed", 0.15, 80, 60.0)
    run = simulate(*scene, method="rkn6", dt=0.025, record=Record(every=1))
    found = budget(run, 0)
    assert found.momentum_error < 1e-10
    assert run.energy_error < 1e-9
    assert abs(found.momentum[-1] - found.momentum[0]) > 1e-3


# 4. composite chains


def interface(name):
    """A case with one run at its coarser step."""
    case = wave_composite.cases()[name]._replace(before=480)
    wave, scene = wave_composite.composite(case)
    record = Record(every=wave_composite.EVERY)
    run = simulate(*scene, method="rkn6", dt=case.step, record=record)
    return case, run, wave_composite.outcome(run, wave, case)


def test_soft_branch_stiff_when_stretched_reflects_a_solitary_rarefaction_wave():
    case, run, found = interface("rarefaction, hard to soft (stiff when stretched)")
    exact = solitary_wave(case.near, amplitude=found["back peak"]).speed_ratio
    assert 1.01 < found["back"] == pytest.approx(exact, rel=1e-9)
    assert found["impulse"] < 0 < wave_composite.acoustics(case)
    assert (found["compression"], found["rarefaction"]) == (0, 3)
    assert found["momentum error"] < 1e-10
    assert run.energy_error < 1e-9


def test_weak_soft_branch_answers_late_with_compression():
    case, _, found = interface("rarefaction, hard to soft (weak)")
    assert found["on peak"] < 0
    assert found["on"] > 1.05
    assert found["late"] > 10
    assert found["compression"] >= 2 > found["rarefaction"]  # a train
    assert found["back peak"] < 0
    assert found["energy"] > 5 * wave_composite.acoustics(case) ** 2


def balance(case):
    """Budget of the part beyond the interface, in a short chain that is densely recorded."""
    reach = solitary_wave(case.near, speed_ratio=case.ratio).reach(wave_composite.CUT)
    short = case._replace(before=math.ceil(2 * reach) + 6, after=60)
    _, scene = wave_composite.composite(short, 40)
    run = simulate(*scene, method="rkn6", dt=case.step / 8, record=Record(every=1))
    return budget(run, short.before)


@pytest.mark.parametrize("name", [name for name in wave_composite.cases() if "weak" in name])
def test_budget_of_the_interface_closes(name):
    found = balance(wave_composite.cases()[name])
    assert found.energy_error < 1e-9
    assert found.momentum_error < 1e-10
    assert abs(found.work[-1]) > 0


# 5. collisions


def test_collisions_leave_a_residue_that_depends_on_the_place():
    spring = _scenes.rigid(*wave_collision.PRISM)
    on, off, between = (wave_collision.collide(spring, 1.6, at) for at in (0.0, 0.25, 0.5))
    assert abs(on["exchange"].value) < 1e-9 > abs(between["exchange"].value)
    assert abs(off["exchange"].value) > 0.01
    for found in (on, off, between):
        assert found["residue"].value > 100 * found["residue"].error
        assert abs(found["window"].value) < found["residue"].value / 100
        assert 0.5 < found["shift"].value < 1
        assert found["energy error"].value < 1e-9


def test_impact_that_locks_is_a_clear_error():
    assert "the bars meet" in wave_collision.too_fast()
    scene = _scenes.impact(_scenes.rigid(0.8, 0.02), 20, {0: 1.0}, 10.0)
    with pytest.raises(LockingError, match=r"bars meet .* between sites 0 and 1 got there at t ="):
        simulate(*scene)


# 6. tuning

WHITE = (np.nan, np.nan)


def test_preload_stiffens_one_prism_and_softens_the_other():
    stiff = wave_tuning.chart({"height": 0.8}, -0.02, [0.01], [0.0, 0.02])
    assert np.all(np.diff(stiff["sound speed"]) > 0)
    assert np.all(np.diff(stiff["wave speed"]) > 0)
    members = wave_tuning.MAPS["softening"][0]
    soft = wave_tuning.chart(members, 0.02, [0.1], [0.0, 0.06, 0.12])
    assert soft["impedance"][0] > soft["impedance"][1]
    assert np.isnan(soft["sound speed"][2])


def test_row_of_a_map_counts_the_prisms_without_a_wave():
    some = {"prestrain": [0.1] * 4, "preload": [0.0, 0.1, 0.2, 0.3], "width": [2.0, 2.0, *WHITE],
            "sound speed": [1.0, 1.0, 1.0, np.nan], "wave speed": [2.0, 2.0, *WHITE],
            "impedance": [1.0] * 4}  # fmt: skip
    names = ("before", "after", "fraction", "peak", "work", "energy", "momentum")
    change = _measure.as_table(dict.fromkeys(names, _measure.Number(1.0, 1e-9)))
    tables = dict.fromkeys(("stiffening map", "softening map"), some)
    rows = list(wave_tuning.table(tables | dict.fromkeys(wave_tuning.RAMPS, change)))
    assert "1 of 4 beyond the limit point; 1 of 4 have no wave of that peak" in rows[0]["measured"]


def test_preload_beyond_the_limit_point_is_a_clear_error():
    prism = Prism(1.0, 0.5, 0.1, 1.0, k_base=2.0, k_bar=20.0)
    with pytest.raises(EquilibriumError, match=r"preload 0\.12 N is beyond .* N, the largest"):
        prism.potential(0.12)


def test_wave_speeds_up_as_the_strings_are_drawn_in_and_the_energy_balances():
    found = wave_tuning.outcome(*wave_tuning.tuned(wave_tuning.RAMPS["quick"], 0.1))
    assert found["after"] > 1.5 * found["before"]
    assert found["work"] > 0.5
    assert found["energy"] < 1e-9
    assert found["momentum"] < 1e-10
    assert abs(found["peak"]) < 0.01


# 7. power laws


def test_normal_power_law_speeds_go_with_a_power_of_the_size():
    found = wave_power_law.scaling(1.5)
    assert found["power"].error < 1e-10
    assert found["constant"].error < 1e-6


def test_abnormal_power_law_has_rarefaction_waves_only_when_precompressed():
    assert "no solitary wave" in wave_power_law.no_wave()
    ratios = {}
    for n, blow in ((1.5, "pushed"), (1.5, "pulled"), (0.5, "pushed"), (0.5, "pulled")):
        run = simulate(*wave_power_law.struck(n, wave_power_law.BLOWS[blow]), method="rkn6")
        ratios[n, blow] = wave_power_law.leading(run)["ratio"]
    assert ratios[1.5, "pushed"] > 1 > ratios[1.5, "pulled"]
    assert ratios[0.5, "pulled"] > 1 > ratios[0.5, "pushed"]


# 8. mitigation


def test_peak_force_of_a_linear_barrier_as_its_modes_give_it():
    units = 20
    stiffness = 2 * np.eye(units) - np.eye(units, k=1) - np.eye(units, k=-1)
    stiffness[0, 0] = 1
    squared, modes = np.linalg.eigh(stiffness)

    def push(t):  # of the last bond on the wall: the displacement of the last mass
        return (
            wave_mitigation.BLOW
            * modes[-1]
            @ (modes[0] * np.sin(np.sqrt(squared) * t) / np.sqrt(squared))
        )

    t = np.linspace(0, 32, 3201)
    first = t[np.argmax([push(x) for x in t])]
    best = minimize_scalar(lambda x: -push(x), bounds=(first - 0.1, first + 0.1), method="bounded",
                           options={"xatol": 1e-10})  # fmt: skip
    found = wave_mitigation.peaks("linear", units)["peak"]
    assert found.value == pytest.approx(-best.fun, rel=1e-6)
    assert found.error < 1e-6


def test_softening_units_spread_the_blow_and_stiffening_ones_do_not():
    peaks = {
        name: [wave_mitigation.peaks(name, units)["peak"].value for units in (20, 80)]
        for name in ("stiffening", "softening")
    }
    assert peaks["stiffening"][1] == pytest.approx(peaks["stiffening"][0], rel=1e-2)
    assert peaks["softening"][1] < 0.65 * peaks["softening"][0]
    assert peaks["softening"][0] < 0.3 * peaks["stiffening"][0]


# what is drawn and printed


def test_density_shows_shares_of_the_largest_energy():
    wave = solitary_wave(_scenes.rigid(0.8, 0.02), speed_ratio=2.0)
    run = simulate(*_scenes.launched(wave, 250, 20, 30), method="rkn6")
    table = _measure.density(run)
    sites = np.array([float(name) for name in table if name != "time"])
    assert sites.size == 125  # in pairs
    energy = np.array([table[name] for name in table if name != "time"])
    assert energy.max() == 1
    assert energy.min() == _measure.FAINTEST
    assert sites[np.argmax(energy[:, 0])] == pytest.approx(20, abs=2)
    figure = plt.figure()
    _measure.draw_density(figure.subplots(), table)
    assert (figure.axes[0].get_xlabel(), figure.axes[0].get_ylabel()) == ("site", "time [s]")
    plt.close(figure)


def test_errors_of_numbers_are_the_difference_of_two_resolutions():
    scene = _scenes.impact(_scenes.rigid(0.8, 0.02), 20, {0: 0.03}, 10.0)
    errors = [
        _measure.resolved(scene, lambda run: {"v": run.final.v[5]}, step, step=step)[1]["v"].error
        for step in (0.4, 0.2)
    ]
    assert errors[0] > 16 * errors[1] > 0


@pytest.mark.slow
@pytest.mark.parametrize("module", WAVES)
def test_every_scene_draws_and_says_what_it_measured(module, tmp_path):
    tables = module.data()
    figure = plt.figure(layout="constrained")
    module.draw(figure, tables)
    figure.savefig(tmp_path / "picture.png")
    plt.close(figure)
    for row in module.table(tables):
        assert set(row) == {"scene", "claim in the talk", "measured", "method error"}
        assert all(row.values())
    if hasattr(module, "animate"):
        module.animate(tables, tmp_path / "motion.gif")
        assert (tmp_path / "motion.gif").read_bytes().startswith(b"GIF")
