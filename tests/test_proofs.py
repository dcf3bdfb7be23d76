"""Proofs: enclosures of folds and waves hold the true values, and what is false is not proved."""

import copy
import json
import math
import pickle
from concurrent.futures import ThreadPoolExecutor
from dataclasses import replace
from fractions import Fraction
from itertools import product

import mpmath
import numpy as np
import pytest
import sympy as sp

flint = pytest.importorskip("flint")

from tensegrity import (  # noqa: E402
    Chain,
    Potential,
    PowerLaw,
    Prism,
    TensegrityError,
    equilibrium_path,
    prove,
    simulate,
    solitary_wave,
    verify,
)
from tensegrity.proofs.balls import BallSpring, precision  # noqa: E402
from tensegrity.proofs.folds import krawczyk  # noqa: E402
from tensegrity.proofs.line import Kernel  # noqa: E402
from tensegrity.proofs.ring import Even, Taylor  # noqa: E402
from tensegrity.waves.cosines import Series  # noqa: E402

HARD, SOFT = Prism(1.0, 0.7, 0.01, 1.0), Prism(1.0, 0.25, 0.1, 1.0)
FOLDS = [  # height and load, found by other programs
    (SOFT, "0.096239805736005023394219803423641928793",
     "0.0440847996090815743581826664290242554460979"),
    (Prism(1.0, 0.29, 0.02, 1.0), "0.06792123661066992199", "0.12337253444922067125"),
]  # fmt: skip


def wave_of(prism, ratio):
    return solitary_wave(prism.potential(), speed_ratio=ratio)


@pytest.mark.parametrize(("prism", "height", "load"), FOLDS)
def test_folds_lie_in_their_enclosures(prism, height, load):
    (fold,) = prove(equilibrium_path(prism))
    digits = len(height) - 2
    assert fold.height.radius < 1e-60
    assert abs(Fraction(fold.height.mid) - Fraction(height)) <= Fraction(10) ** -digits
    assert abs(Fraction(fold.load.mid) - Fraction(load)) <= Fraction(10) ** -(len(load) - 2)


def fold_height(prism):
    """Where dF/dh = 0, by the chain rule in the twist and 60 digits, without this package."""
    with mpmath.workdps(60):
        base, rest, p, _ = (
            mpmath.mpf(repr(x)) for x in (prism.base, prism.height, prism.prestrain, 1.0)
        )
        radius2 = base**2 / 3
        bar2 = 2 * radius2 * (1 - mpmath.cos(5 * mpmath.pi / 6)) + rest**2
        natural = mpmath.sqrt(
            2 * radius2 * (1 - mpmath.cos(5 * mpmath.pi / 6 - 2 * mpmath.pi / 3)) + rest**2
        ) / (1 + p)

        def energy(h):
            twist = mpmath.acos(1 - (bar2 - h**2) / (2 * radius2))
            cross = mpmath.sqrt(2 * radius2 * (1 - mpmath.cos(twist - 2 * mpmath.pi / 3)) + h**2)
            return 3 * (cross - natural) ** 2 / 2

        guess = equilibrium_path(prism).events[0].height
        h = mpmath.re(mpmath.findroot(lambda h: mpmath.re(mpmath.diff(energy, h, 2)), guess))
        twist = mpmath.acos(1 - (bar2 - h**2) / (2 * radius2))
        found = h, -mpmath.re(mpmath.diff(energy, h)), twist
        return [mpmath.nstr(x, 28) for x in found]


@pytest.mark.parametrize("prism", [Prism(2.0, 0.5, 0.05, 3.0), Prism(0.01, 0.0025, 0.2, 1e4), SOFT])
def test_folds_are_those_of_many_digits(prism):
    prism = replace(prism, k_cross=1.0) if prism.k_cross == 1.0 else prism
    (fold,) = prove(equilibrium_path(prism))
    height, load, twist = fold_height(prism)
    assert abs(Fraction(fold.height.mid) - Fraction(height)) < 1e-24
    assert abs(Fraction(fold.twist.mid) - Fraction(twist)) < 1e-22
    assert float(fold.load) == pytest.approx(prism.k_cross * float(load), rel=1e-14)


def elastic_fold(prism, guess):
    """Base, twist, height where the load has a limit, by the energy alone and 40 digits."""
    with mpmath.workdps(40):
        given = (prism.height, prism.prestrain, prism.k_cross, prism.k_base, prism.k_bar)
        rest, p, *k = (mpmath.mpf(repr(x)) for x in given)
        turn = 5 * mpmath.pi / 6

        def lengths(base, twist, height):
            radius2 = base**2 / 3
            across = [2 * radius2 * (1 - mpmath.cos(twist - x)) for x in (2 * mpmath.pi / 3, 0)]
            cross, bar = (mpmath.sqrt(x + height**2) for x in across)
            return cross, base, bar

        one, counts = mpmath.mpf(1), (3, 6, 3)
        at_rest = lengths(one, turn, rest)
        slopes = [[mpmath.diff(lambda *z, m=m: lengths(*z)[m], (one, turn, rest), d)
                   for m in range(3)] for d in ((1, 0, 0), (0, 1, 0))]  # fmt: skip
        cross = k[0] * at_rest[0] * p / (1 + p)
        pulled = mpmath.matrix([[counts[m] * row[m] for m in (1, 2)] for row in slopes])
        base, bar = mpmath.lu_solve(pulled, mpmath.matrix([-3 * row[0] * cross for row in slopes]))
        natural = [x - t / y for x, t, y in zip(at_rest, (cross, base, bar), k, strict=True)]

        def energy(*z):
            parts = zip(counts, k, lengths(*z), natural, strict=True)
            return sum(c * y * (x - n) ** 2 / 2 for c, y, x, n in parts)

        def slope(z, *along):
            return mpmath.diff(energy, tuple(z), tuple(along.count(i) for i in range(3)))

        def residual(*z):
            stiff = mpmath.matrix(3, 3)
            for i, j in product(range(3), range(3)):
                stiff[i, j] = slope(z, i, j)
            return [slope(z, 0), slope(z, 1), mpmath.det(stiff)]

        root = mpmath.findroot(residual, guess, tol=1e-40, maxsteps=12)
        return [mpmath.nstr(x, 34) for x in (*root, -slope(root, 2))]


def test_the_fold_of_an_elastic_prism_is_that_of_its_energy():
    prism = Prism(1.0, 0.7, 0.1, 1.0, k_base=20.0, k_bar=20.0)
    path = equilibrium_path(prism)
    ((fold,), event) = prove(path), path.events[0]
    known = elastic_fold(prism, (event.base, event.twist, event.height))
    for found, wanted in zip((fold.base, fold.twist, fold.height, fold.load), known, strict=True):
        assert found.radius < 1e-60
        assert abs(Fraction(found.mid) - Fraction(wanted)) < 1e-30
    assert fold.radius < 1e-60


ELASTIC = [
    (0.5, 0.4, 5.0, math.inf, 3),
    (0.5, 0.4, math.inf, 20.0, 3),
    (0.5, 0.4, 2.0, 20.0, 3),
    (0.7, 0.2, 9.0, 90.0, 3),
    (0.3, 0.3, 100.0, 100.0, 3),
    (0.4, 0.2, 50.0, 50.0, 4),
]
MORE = (0.3, 0.1, 30.0, 10.0, 5), (0.29, 0.02, math.inf, math.inf, 5)
ELASTIC += [pytest.param(*one, marks=pytest.mark.slow) for one in MORE]


@pytest.mark.parametrize(("height", "prestrain", "k_base", "k_bar", "sides"), ELASTIC)
def test_folds_of_other_prisms_hold_those_of_their_paths(height, prestrain, k_base, k_bar, sides):
    path = equilibrium_path(Prism(1.0, height, prestrain, 1.0, k_base, k_bar, sides=sides))
    events = [event for event in path.events if event.kind == "fold"]
    found = prove(path)
    assert len(found) == len(events)
    for fold, event in zip(found, events, strict=True):
        assert fold.radius < 1e-30
        for name in ("height", "load", "twist", "base"):
            assert float(getattr(fold, name)) == pytest.approx(event.at[name], abs=1e-12)


def planted(random, n, rank):
    """A system with a root of 50 random digits, of that rank there, and its derivatives."""
    root = [Fraction(int("".join(map(str, random.integers(0, 10, 50)))), 10**50) for _ in range(n)]
    linear = random.integers(-9, 10, (n, n))
    linear[rank:] = 0
    bent = random.integers(-9, 10, (n, n, n))

    def off(x):
        return [y - flint.fmpq(r.numerator, r.denominator) for y, r in zip(x, root, strict=True)]

    def residual(x):
        d = off(x)
        return [sum((int(linear[i, j]) * d[j] for j in range(n)), flint.arb(0))
                + sum((int(bent[i, j, k]) * d[j] * d[k] for j in range(n) for k in range(n)),
                      flint.arb(0)) for i in range(n)]  # fmt: skip

    def jacobian(x):
        d = off(x)
        return flint.arb_mat([[int(linear[i, j]) + sum(
            (int(bent[i, j, k] + bent[i, k, j]) * d[k] for k in range(n)), flint.arb(0)
        ) for j in range(n)] for i in range(n)])  # fmt: skip

    return root, residual, jacobian


def test_no_box_of_200_random_systems_misses_its_root():
    random, proved = np.random.default_rng(11), 0
    for number in range(200):
        n = 1 + number % 4
        full = bool(number % 5)  # every fifth root is a multiple one, of which nothing is proved
        root, residual, jacobian = planted(random, n, n if full else n - 1)
        start = [float(r) + 1e-7 * float(random.normal()) for r in root]
        with precision(256):
            try:
                box, width = krawczyk(residual, jacobian, [flint.arb(x) for x in start])
            except TensegrityError:
                continue
            assert full
            proved += 1
            for one, exact in zip(box, root, strict=True):
                assert one.contains(flint.fmpq(exact.numerator, exact.denominator))
                assert float(one.rad()) < 1e-40
                assert float(one.rad()) < width
    assert proved > 140
    with pytest.raises(TensegrityError, match="no root"), precision(256):
        krawczyk(lambda x: [x[0] ** 2 + 1e-12], lambda x: flint.arb_mat([[2 * x[0]]]),
                 [flint.arb(1e-3)])  # fmt: skip


def test_decimals_and_binary_values_are_told_apart():
    path = equilibrium_path(SOFT)
    (one,), (other,) = prove(path), prove(path, exact="double")
    assert one.height.mid.startswith("0.096239805736005023394219")
    assert other.height.mid.startswith("0.096239805736005023932")


CASES = [  # ring, speed over sound, peak of another proof, and its radius
    (HARD, 20.0, 1.3275, -0.02680015087, 4.9e-11),
    (HARD, 20.0, 2.0, -0.04508046357, 7.1e-10),
    (SOFT, 40.0, 1.01507, 0.017288453218833, 1e-15),
    (SOFT, 40.0, 1.02966, 0.029543761367997, 1e-15),
    (SOFT, 40.0, 1.06109, 0.049467459661735, 1e-15),
]


@pytest.mark.parametrize(("prism", "period", "ratio", "peak", "near"), CASES)
def test_waves_of_hardening_and_softening_prisms_exist(prism, period, ratio, peak, near):
    wave = wave_of(prism, ratio)
    proof = prove(wave, period=period)
    assert proof.proved, proof.reason
    assert abs(float(proof.peak) - peak) < near
    assert proof.centre_radius < 1e-17 * abs(peak)
    assert proof.z1 < 0.1
    size = abs(wave.amplitude)
    assert abs(float(proof.peak) - wave.amplitude) <= proof.radius + proof.tail + 1e-12 * size


@pytest.mark.parametrize("ratio", [1.05, 1.5, 2.0])
def test_on_its_own_ring_a_wave_is_within_round_off_of_a_true_one(ratio):
    wave = wave_of(HARD, ratio)
    proof = prove(wave)
    assert proof.proved, proof.reason
    assert proof.radius < 1e-11 * abs(wave.amplitude)
    assert proof.peak.contains(Fraction(proof.peak.mid))
    assert proof.tail < 1e-12 * abs(wave.amplitude)


@pytest.mark.parametrize(
    ("prism", "ratio", "on_ring"),
    [(SOFT, 1.01507, 0.017288453218833), (HARD, 1.3275, None),
     pytest.param(SOFT, 1.06109, None, marks=pytest.mark.slow),
     pytest.param(HARD, 2.0, None, marks=pytest.mark.slow)],
)  # fmt: skip
def test_softening_and_hardening_waves_exist_on_the_infinite_line(prism, ratio, on_ring):
    wave = wave_of(prism, ratio)
    proof, ring = prove(wave, period=math.inf), prove(wave)
    assert proof.proved, proof.reason
    size = abs(wave.amplitude)
    assert "infinite line" in str(proof)
    assert proof.peak.radius < 1e-13 * size
    assert proof.radius < 1e-11 * size
    assert proof.tail < 1e-11 * size
    between = abs(Fraction(proof.peak.mid) - Fraction(ring.peak.mid))
    assert between <= proof.peak.radius + ring.peak.radius + ring.tail
    if on_ring:  # a ring of 40 sites, whose wave differs by the tail
        assert abs(float(proof.peak) - on_ring) == pytest.approx(2.6e-11, rel=0.02)


@pytest.mark.parametrize("text", ["1.01", pytest.param("1.001", marks=pytest.mark.slow),
                                  pytest.param("1.05", marks=pytest.mark.slow)])  # fmt: skip
def test_todas_soliton_lies_in_its_enclosure_on_the_line(text):
    r = sp.Symbol("r")
    wave = solitary_wave(Potential(sp.exp(-r) + r - 1, r), speed=float(text))
    proof = prove(wave, period=math.inf)
    with mpmath.workdps(50):
        kappa = mpmath.findroot(lambda x: mpmath.sinh(x) / x - mpmath.mpf(text), 0.1)
        peak = mpmath.nstr(-mpmath.log(1 + mpmath.sinh(kappa) ** 2), 40)
    assert proof.proved, proof.reason
    assert proof.peak.contains(peak)
    assert proof.peak.radius < 1e-14 * abs(float(peak))


def test_the_kernel_of_the_line_has_the_moments_and_the_size_that_bound_it():
    """By the inverse Fourier transform, of m c^2 = 1.2 and V''(0) = 1."""
    kernel, rate = Kernel(flint.arb("1.2"), flint.arb(1), flint.fmpq(60)), 0.4
    points, half = 2**16, 200.0
    x = (np.arange(points) - points // 2) * (2 * half / points)
    k = 2 * np.pi * np.fft.fftfreq(points, 2 * half / points)
    s = np.sinc(k / 2 / np.pi) ** 2
    g = np.fft.fftshift(np.fft.ifft(s / (1.2 - s)).real) * points / (2 * half)
    assert g.min() > -1e-7 * g.max()
    weight, h = np.exp(rate * np.abs(x)), 2 * half / points
    for q, w in ((0.0, 1.0), (rate, np.where(np.abs(x) < 25, weight, 0.0))):
        both = float(kernel.moment(flint.arb(q))) * (2 if q else 1)
        assert both / 2 * (1 - 1e-6) <= (g * w).sum() * h <= both * (1 + 1e-6)
        assert np.sqrt(((g * w) ** 2).sum() * h) <= float(kernel.size(flint.arb(q)))
    assert not kernel.moment(flint.arb(2)).is_finite()
    assert not kernel.size(flint.arb(2)).is_finite()


def test_a_certificate_is_verified_from_its_file(tmp_path):
    proof = prove(wave_of(SOFT, 1.03), period=40.0)
    proof.save(tmp_path / "wave.json")
    again = verify(tmp_path / "wave.json")
    assert again.peak.contains(proof.peak.mid)
    for name in ("radius", "centre_radius", "tail"):
        assert getattr(again, name) == pytest.approx(getattr(proof, name), rel=1e-6)
    stored = json.loads((tmp_path / "wave.json").read_text())

    def refused(words, **changed):
        (tmp_path / "edited.json").write_text(json.dumps(stored | changed))
        with pytest.raises(TensegrityError, match=words):
            verify(tmp_path / "edited.json")

    refused("does not hold", speed=str(Fraction(stored["speed"]) * Fraction(101, 100)))
    refused("does not hold", centre_radius="1e-30")
    refused("does not hold", centre_radius="1e-3")
    refused("does not hold", radius="1e-3")
    refused("does not hold", tail="1e-30")
    handed = stored["handed"]
    refused("does not hold", handed=[repr(float(handed[0]) + 1e-9), *handed[1:]])
    refused("does not hold|no certificate", ring="30")
    refused("no certificate", period="30")
    refused("no certificate", ring="-40", period="-40")
    refused("does not hold", peak={"mid": "0.03", "radius": "1e-20"})
    centre = stored["centre"]
    refused("does not hold", centre=[str(Fraction(centre[0]) * 2), *centre[1:]])
    refused("does not hold|not analytic", centre=[str(Fraction(x) / 2) for x in centre])
    refused("no certificate", format="another")
    refused("no certificate", centre=["x"])
    refused("no certificate", spring={"energy": {"steps": [["open", 0]], "results": [0]},
                                      "parameters": []})  # fmt: skip
    text = (tmp_path / "wave.json").read_text()
    (tmp_path / "cut.json").write_text(text[: len(text) // 2])
    with pytest.raises(TensegrityError, match="no certificate"):
        verify(tmp_path / "cut.json")
    with pytest.raises(TensegrityError):
        verify(tmp_path / "none.json")


def test_a_certificate_of_the_line_is_verified_from_its_file(tmp_path):
    file = tmp_path / "wave.json"
    proof = prove(wave_of(SOFT, 1.03), period=math.inf)
    proof.save(file)
    again, stored = verify(file), json.loads(file.read_text())
    assert again.peak.contains(proof.peak.mid)
    for name in ("radius", "centre_radius", "tail"):
        assert getattr(again, name) == pytest.approx(getattr(proof, name), rel=1e-6)
    for words, edit in (("must be above 0", {"rate": "-0.5"}), ("does not hold", {"rate": "5"}),
                        ("does not hold", {"tail": "1e-30"})):  # fmt: skip
        file.write_text(json.dumps(stored | edit))
        with pytest.raises(TensegrityError, match=words):
            verify(file)


def test_what_is_false_is_not_proved():
    wave = wave_of(SOFT, 1.03)
    series = wave._shape
    half = replace(wave, _shape=Series(series.grid, series.rates / 2))
    fast = replace(wave, speed=1.01 * wave.speed)
    for false, period in product((half, fast), (40.0, math.inf)):
        proof = prove(false, period=period)
        assert not proof.proved
        assert proof.reason
        assert proof.radius == np.inf
        with pytest.raises(TensegrityError, match="nothing is proved"):
            proof.save("never.json")
    with pytest.raises(TensegrityError, match="the wave is 0"):
        prove(replace(wave, _shape=Series(series.grid, 0 * series.rates)), period=40.0)


def test_a_perturbed_wave_is_as_far_from_the_true_one_as_it_was_moved():
    wave = wave_of(SOFT, 1.03)
    grid, rates = wave._shape.grid, wave._shape.rates.copy()
    rates[6] += 1e-6 / grid.box[6]
    moved = replace(wave, _shape=Series(grid, rates))
    true, proof = prove(wave), prove(moved)
    assert 1e-6 <= proof.radius < 1.01e-6
    assert proof.peak.contains(true.peak.mid)
    assert true.radius < 1e-13


def test_what_is_not_analytic_is_refused():
    r = sp.Symbol("r")
    for potential in (PowerLaw(1.0, 1.5), Potential(r**2 / 2 + sp.Abs(r) ** 3 / 3, r)):
        wave = solitary_wave(potential, speed=1.2)
        with pytest.raises(TensegrityError, match="not analytic"):
            prove(wave)
    elastic = Prism(1.0, 0.7, 0.1, 1.0, k_base=20.0, k_bar=20.0)
    with pytest.raises(TensegrityError, match="no expression"):
        prove(solitary_wave(elastic.potential(), speed_ratio=1.1))
    assert prove(equilibrium_path(Prism(1.0, 0.9, 0.01, 1.0))) == ()
    with pytest.raises(TensegrityError, match="exact 'binary'"):
        prove(wave, exact="binary")
    with pytest.raises(TensegrityError, match="is not a SolitaryWave"):
        prove(1.0)
    with pytest.raises(TensegrityError, match="period"):
        prove(wave_of(SOFT, 1.03), period=1.0)


def test_springs_of_ones_own_and_precompressed_contacts_have_proofs(tmp_path):
    r, k = sp.symbols("r k")
    own = Potential(k * r**2 / 2 + r**3 / 6, r, {"k": 1.0})
    toda = Potential(sp.exp(-r) + r - 1, r)
    for potential, ratio in ((own, 1.1), (toda, 1.01), (PowerLaw(1.0, 1.5, preload=1.0), 1.01)):
        proof = prove(solitary_wave(potential, speed_ratio=ratio))
        assert proof.proved, proof.reason
        proof.save(tmp_path / "own.json")
        assert verify(tmp_path / "own.json").proved
    kappa = mpmath.findroot(lambda x: mpmath.sinh(x) / x - 1.01, 0.25)
    wave = solitary_wave(toda, speed=float(mpmath.sinh(kappa) / kappa))
    proof, peak = prove(wave), -mpmath.log(1 + mpmath.sinh(kappa) ** 2)  # Toda's closed form
    assert abs(float(proof.peak) - peak) < 1e-11


def test_balls_of_the_energy_hold_its_value_and_slopes():
    """At random elongations of random prisms, against 50 digits of the same geometry."""
    random = np.random.default_rng(5)
    for _ in range(20):
        h, p = (round(float(x), 3) for x in random.uniform([0.2, 0.01], [1.0, 0.5]))
        prism = Prism(1.0, h, p, 1.0)
        spring = prism.potential()
        low, high = spring.domain
        at = Fraction(repr(round(float(random.uniform(0.9 * low, 0.9 * high)), 6)))
        with precision(200):
            found = BallSpring.of(spring, "decimals").series(
                flint.arb(flint.fmpq(at.numerator, at.denominator)), 3, 200
            )
        floats = (
            spring.energy(float(at)),
            spring.tension(float(at)),
            spring.stiffness(float(at)) / 2,
        )
        scale = [abs(x) + 1e-3 for x in floats]
        for ball, value, size in zip(found, floats, scale, strict=True):
            assert float(ball.rad()) < 1e-40 * size
            assert float(ball) == pytest.approx(float(value), abs=1e-10 * size)


def test_a_certified_wave_runs_unchanged():
    wave = wave_of(SOFT, 1.03)
    proof = prove(wave)
    chain = Chain(SOFT.potential(), 160)
    start = wave.launch(chain, at=40.0)
    run = simulate(chain, start, 60.0 / wave.speed, tol=1e-9)
    later = wave.launch(chain, at=100.0)
    drift = np.abs(np.diff(run.final.u) - np.diff(later.u)).max()
    assert drift < 1e-8
    assert proof.radius < drift


def test_what_a_taylor_polynomial_leaves_out_is_in_the_bound():
    """Of 1/(1 - r), whose coefficients come near Cauchy's bound, at constant series."""
    random = np.random.default_rng(7)
    for _ in range(100):
        terms, order = int(random.integers(4, 30)), int(random.integers(1, 4))
        radius = flint.arb(float(random.uniform(0.8, 0.95)))
        at = flint.arb(float(random.uniform(-0.6, 0.6)))
        with precision(200):
            law = Taylor([flint.arb(1)] * terms, radius, 1 / (1 - radius))
            found = law.of(order, Even(flint.arb_poly([at]), flint.arb(0)), 5)
            true = flint.arb(order).fac() / (1 - at) ** (order + 1)
            assert abs(found.modes[0] - true) <= found.rest
            assert abs(true) <= law.bound(order, abs(at))


def test_a_series_that_loses_terms_is_refused_and_not_filled_up():
    r = sp.Symbol("r")
    spring = BallSpring.of(Potential(r**2 / 2 + r**3, r), "decimals")
    steps = [["Given", 0], ["sin", 0], ["Ratio", -1, 1], ["Pow", 0, 2], ["Mul", 1, 3]]
    quotient = replace(spring, energy={"steps": steps, "results": [4]}, parameters=())
    with pytest.raises(TensegrityError, match="no Taylor series"):
        quotient.series(flint.arb(0), 6)


def test_proofs_from_four_threads_copied_and_in_other_units_are_the_same():
    wave, path = wave_of(SOFT, 1.03), equilibrium_path(SOFT)
    alone = prove(wave, period=40.0), prove(path)
    tasks = [lambda: prove(wave, period=40.0), lambda: prove(path)] * 4
    with ThreadPoolExecutor(4) as pool:
        found = [task.result() for task in [pool.submit(task) for task in tasks]]
    assert all(str(x) == str(alone[k % 2]) for k, x in enumerate(found))
    again = pickle.loads(pickle.dumps(alone[0]))
    assert str(again) == str(copy.deepcopy(alone[0])) == str(alone[0])
    for size in (1e-6, 100.0):  # heights and peaks scale with lengths, at the stiffness of steel
        prism = Prism(size, 0.25 * size, 0.1, 1e7)
        (fold,) = prove(equilibrium_path(prism))
        scaled = Fraction(fold.height.mid) / Fraction(repr(size))
        assert abs(scaled - Fraction(alone[1][0].height.mid)) < 1e-15
        other = prove(wave_of(prism, 1.03), period=40.0)
        assert other.proved, other.reason
        assert float(other.peak) / size == pytest.approx(float(alone[0].peak), rel=1e-12)
