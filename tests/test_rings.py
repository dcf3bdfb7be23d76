"""Rings: against closed forms, another integrator, and numbers of another computation."""

from pathlib import Path

import numpy as np
import pytest
import sympy as sp
from scipy.integrate import solve_ivp
from scipy.special import ellipe, ellipj, ellipk

from tensegrity import (
    METHODS,
    Chain,
    Damping,
    Drive,
    Ensemble,
    Force,
    PairLaw,
    Potential,
    PowerLaw,
    Record,
    Run,
    State,
    TensegrityError,
    budget,
    dispersion,
    floquet,
    gradient,
    modes,
    objective,
    periodic_orbit,
    pulses,
    resume,
    simulate,
    solitary_wave,
    spectrum,
    tail_front,
)

r, t, x = sp.symbols("r t x")
TODA = Potential(sp.exp(-r) + r - 1, r)
ALPHA, BETA4 = Potential(r**2 / 2 + r**3 / 12, r), Potential(r**2 / 2 + 0.3 * r**4 / 4, r)
SOFT = Potential(sp.Symbol("k") * r**2 / 2 + r**3 / 12, r, parameters={"k": 1.0})


def ring(spring, sites, **more):
    return Chain(spring, sites, ends="periodic", **more)


def toda(sites, waves, m):
    """Speed, period in time and elongations (bond, time) of a cnoidal wave of `TODA`."""
    length, whole, second = sites / waves, ellipk(m), ellipe(m)
    w = (1 / ellipj(2 * whole / length, m)[0] ** 2 - 1 + second / whole) ** -0.5
    rate = w / (2 * whole)

    def elongation(n, t):
        dn = ellipj(2 * whole * (n / length - rate * t), m)[2]
        return -np.log(1 + w**2 * (dn**2 - second / whole))

    return length * rate, 1 / rate, elongation


@pytest.mark.parametrize(
    ("sites", "waves", "m", "speed", "period", "stretch"),
    [
        (16, 1, 0.9, 0.996484329247, 16.056449188817, 0.008180495317248855),
        (24, 2, 0.99, 1.007312798008, 11.912883489347, 0.1753873496160281),
        (32, 1, 0.999, 1.005568654441, 31.82278987981, 0.012679762071525116),
    ],
)
def test_a_cnoidal_wave_of_toda_returns_after_ten_periods(sites, waves, m, speed, period, stretch):
    c, lasts, elongation = toda(sites, waves, m)
    assert (c, lasts) == pytest.approx((speed, period), rel=1e-12)
    n, h = np.arange(sites), 1e-3
    start = elongation(n, 0.0)
    assert start.sum() == pytest.approx(stretch, rel=1e-12)
    central = [(elongation(n, k * h) - elongation(n, -k * h)) / (2 * k * h) for k in (1, 2, 3)]
    rates = (15 * central[0] - 6 * central[1] + central[2]) / 10
    u, v = (np.append(0, np.cumsum(y)[:-1]) for y in (start, rates))
    chain = ring(TODA, sites, stretch=stretch)
    record = Record(times=[0.0, 0.3 * period, 10 * period])
    run = simulate(chain, State(u, v - v.mean()), 10 * period, tol=1e-11, record=record)
    found = chain.elongation(run.u)
    assert np.abs(found[1] - elongation(n, 0.3 * period)).max() < 1e-10
    assert np.abs(found[2] - start).max() < 1e-9
    assert found.sum(axis=1) == pytest.approx(3 * [stretch], rel=1e-11)


def test_rings_of_fermi_pasta_ulam_and_tsingou_after_1000_seconds():
    j = np.arange(32)
    chain = ring(ALPHA, 32)
    run = simulate(chain, State(np.cos(2 * np.pi * j / 32), 0 * j), 1000, tol=1e-11)
    u, v = (np.fft.fft(y, norm="ortho") for y in (run.final.u, run.final.v))
    energies = (np.abs(v) ** 2 + 4 * np.sin(np.pi * j / 32) ** 2 * np.abs(u) ** 2) / 2
    pairs = energies[1:8] + energies[-1:-8:-1]
    known = [
        0.0606032679, 0.157750018, 0.0741562153, 0.0072263514, 0.0065471069, 0.0006157628,
        0.0002604731,
    ]  # fmt: skip
    assert pairs == pytest.approx(known, abs=6e-11)
    assert run.final.u[0] == pytest.approx(-0.3413361197, rel=1e-9)
    up = State(0.5 * np.cos(6 * np.pi * j / 32), 0 * j)
    hard = simulate(ring(BETA4, 32), up, 1000, method="rk8", dt=0.02)
    u, v = (np.fft.fft(y, norm="ortho")[[3, -3]] for y in (hard.final.u, hard.final.v))
    third = np.sum(np.abs(v) ** 2 + 4 * np.sin(3 * np.pi / 32) ** 2 * np.abs(u) ** 2) / 2
    assert third == pytest.approx(0.675393772, rel=1e-9)
    assert hard.final.u[0] == pytest.approx(0.4732700636, rel=1e-9)


@pytest.mark.parametrize("method", [name for name in METHODS if name != "midpoint"])
def test_the_pi_mode_has_the_period_of_its_elliptic_integral(method):
    m = 8 * 0.3 * 0.7**2 / (4 + 16 * 0.3 * 0.7**2)
    period = 4 * ellipk(m) / np.sqrt(4 + 16 * 0.3 * 0.7**2)
    assert period == pytest.approx(2.622221126476, rel=1e-12)
    start = 0.7 * (-1.0) ** np.arange(16)
    offs = [
        np.abs(simulate(ring(BETA4, 16), State(start, 0 * start), period, method=method,
                        dt=period / n).final.u - start).max()
        for n in (100, 200)
    ]  # fmt: skip
    assert offs[1] < 3e-8
    assert offs[1] < 1e-12 or offs[0] / offs[1] > 0.9 * 2 ** METHODS[method].order


def independent(chain, tension, state, t_end, drag=0.0, driven=None):
    """u after t_end by DOP853, from forces typed here."""
    n, mass = chain.sites, chain.mass

    def rates(time, y):
        u, v = y[:n].copy(), y[n:].copy()
        if driven:
            u[0], v[0] = driven[0](time), driven[1](time)
        f = tension(np.append(np.diff(u), u[0] - u[-1] + chain.stretch), time)
        a = (f - np.roll(f, 1) - drag * v) / mass
        if driven:
            a[0] = driven[2](time)
        return np.concatenate([v, a])

    start = np.concatenate([state.u, state.v])
    return solve_ivp(rates, (0, t_end), start, rtol=1e-11, atol=1e-12, method="DOP853").y[:n, -1]


def test_contacts_of_a_ring_open_and_close():
    rng = np.random.default_rng(0)
    chain = ring(PowerLaw(1.0, 1.5), 12, stretch=-0.3, mass=np.linspace(1, 2, 12))
    state = State(0.05 * rng.normal(size=12), 0.3 * rng.normal(size=12))
    known = independent(chain, lambda r, _: -(np.clip(-r, 0, None) ** 1.5), state, 20.0)
    for method in ({"tol": 1e-9}, {"method": "corrected6", "dt": 0.01}):
        assert np.abs(simulate(chain, state, 20.0, **method).final.u - known).max() < 1e-7


def test_drives_drag_and_springs_that_change():
    driven = ring(BETA4, 8, drive={0: Drive(displacement=0.1 * sp.sin(t))}, damping=Damping(0, 0.1))
    start = driven.at_rest()
    motion = (lambda s: 0.1 * np.sin(s), lambda s: 0.1 * np.cos(s), lambda s: -0.1 * np.sin(s))
    known = independent(driven, lambda r, _: r + 0.3 * r**3, start, 30.0, 0.1, motion)
    run = simulate(driven, start, 30.0, tol=1e-9)
    assert np.abs(run.final.u - known).max() < 1e-9
    assert run.energy_error < 1e-10
    cubic = Force(-0.2 * sp.Symbol("v") ** 3)
    assert simulate(ring(BETA4, 8, forces=[cubic]), start, 10.0, tol=1e-8).energy_error < 1e-8
    changing = ring(SOFT.over_time(k=1 + 0.1 * sp.sin(t)), 6, stretch=0.2)
    state = State(0.1 * np.arange(6) % 0.17, np.zeros(6))
    known = independent(changing, lambda r, s: (1 + 0.1 * np.sin(s)) * r + r**2 / 4, state, 5.0)
    run = simulate(changing, state, 5.0, tol=1e-10)
    assert np.abs(run.final.u - known).max() < 1e-9
    assert run.energy_error < 1e-9


def test_gradients_of_a_ring_are_those_of_finite_differences():
    mass, start, step = np.array([1, 2, 1, 1, 1.5, 1]), 0.1 * np.arange(6) % 0.17, 1e-5
    chain = ring(SOFT, 6, stretch=0.2, mass=mass)
    found = gradient(objective.displacement(2), chain, State(start, 0 * start), 3.0, dt=0.01)

    def value(k=1.0, more=0.0, further=0.0):
        other = ring(SOFT.varied({"k": k}), 6, stretch=0.2, mass=mass + more)
        state = State(start + further, 0 * start)
        return simulate(other, state, 3.0, dt=0.01, method=found.run.method).final.u[2]

    each = np.eye(6)[[0, 5]] * step
    for by, name in ((found.u, "further"), (found.mass, "more")):
        slopes = [(value(**{name: x}) - value(**{name: -x})) / (2 * step) for x in each]
        assert by[[0, 5]] == pytest.approx(slopes, abs=1e-9)
    slope = (value(1 + step) - value(1 - step)) / (2 * step)
    assert found.by("k").sum() == pytest.approx(slope, abs=1e-9)
    driven = ring(SOFT, 6, drive={0: Drive(displacement=0.1 * sp.sin(t))})
    rest = driven.at_rest()
    found = gradient(objective.displacement(2), driven, rest, 3.0, dt=0.02, method="rk8")
    ends = [
        simulate(driven, State(rest.u, rest.v + s * np.eye(6)[5]), 3.0, dt=0.02, method="rk8")
        for s in (step, -step)
    ]
    slope = (ends[0].final.u[2] - ends[1].final.u[2]) / (2 * step)
    assert found.v[5] == pytest.approx(slope, abs=1e-9)


def test_modes_orbits_energies_and_ensembles():
    chain = ring(BETA4, 8)
    found = modes(chain, count=8)
    known = np.sort(dispersion(BETA4, 1.0, 2 * np.pi * np.arange(8) / 8)[:, 0])
    assert found.frequencies == pytest.approx(known, abs=1e-7)
    u = 0.1 * np.random.default_rng(1).normal(size=(8, 3))
    state = State(u[:, 1].copy(), u[:, 0].copy())
    assert chain.site_energy(state).sum() == pytest.approx(chain.energy(state), rel=1e-13)
    nearby = u[:, 1] + 1e-6 * np.eye(8)[7]
    slope = (chain.energy(State(nearby, state.v)) - chain.energy(state)) / 1e-6
    assert chain.forces(u[:, 1])[7] == pytest.approx(-slope, abs=1e-5)
    bend = (chain.forces(u[:, 1]) - chain.forces(nearby)) / 1e-6
    assert chain.stiffness(u[:, 1]).toarray()[7] == pytest.approx(bend, abs=1e-5)
    run = simulate(Ensemble(chain, 3), State(u, 0 * u), 5.0, dt=0.01)
    alone = simulate(chain, State(u[:, 1].copy(), 0 * u[:, 1]), 5.0, dt=0.01)
    assert np.array_equal(run.final.u[:, 1], alone.final.u)
    up = State([0.7, -0.7] * 2, [0.0] * 4)
    orbit = periodic_orbit(ring(BETA4, 4), up, period=2.622221126476)
    assert np.abs(orbit.state.u - up.u).max() < 1e-9
    assert np.prod(np.abs(floquet(orbit).multipliers)) == pytest.approx(1, rel=1e-8)


def test_a_ring_is_stored_and_goes_on(tmp_path):
    chain = ring(PowerLaw(1.0, 1.5, preload=0.1), 6, stretch=-0.1)
    state = State(np.zeros(6), 0.1 * np.eye(6)[5])
    path = Path(tmp_path, "rows.npy")
    run = simulate(chain, state, 5.0, dt=0.01, record=Record(path=path, checkpoint=0.0))
    run.save(tmp_path / "kept")
    assert Run.load(next(tmp_path.glob("kept*"))).scene == chain
    assert np.array_equal(resume(path).final.u, run.final.u)
    assert "ring, stretch -0.1 m" in repr(chain)
    assert chain != ring(PowerLaw(1.0, 1.5, preload=0.1), 6)
    run.plot()


def test_a_wave_goes_around_where_the_stretch_is_its_own():
    wave = solitary_wave(ALPHA, speed_ratio=1.2)
    needed = -wave.shift
    chain = ring(ALPHA, 60, stretch=needed)
    run = simulate(chain, wave.launch(chain, at=30.0), 60 / wave.speed, tol=1e-10)
    start = wave.launch(chain, at=30.0)
    assert np.abs(run.final.v - start.v).max() < 1e-8 * np.abs(start.v).max()
    with pytest.raises(TensegrityError, match=r"stretch 0 m of the ring must be .*the wave"):
        wave.launch(ring(ALPHA, 60), at=30.0)


def test_spectra_of_rings():
    """Travelling waves read their amplitudes without a window in space; 28 of them lie on the band
    to a twentieth of the resolution, the pi-mode at its own frequency."""
    j, linear = np.arange(32), Potential(r**2 / 2, r)
    k = np.array([k for k in range(-15, 17) if k not in (0, 1, -1, 16)])
    q, phase = 2 * np.pi * k / 32, np.random.default_rng(2).uniform(0, 6, len(k))
    w = 2 * np.abs(np.sin(q / 2))
    start = State(*(np.sum(a * f(q * j[:, None] + phase), axis=1)
                    for a, f in ((0.1, np.cos), (0.1 * w, np.sin))))  # fmt: skip
    record = Record(interval=0.5)
    run = simulate(ring(linear, 32), start, 1023.5, method="rkn6", dt=0.05, record=record)
    found = spectrum(run)
    ridge = dict(zip(*(x.round(9) for x in found.ridge(0.3)), strict=True))
    assert len(ridge) == len(k) == 28
    off = [abs(ridge[x] - y) for x, y in zip(q.round(9), w, strict=True)]
    assert max(off) < 0.05 * 2 * np.pi / 1024
    at = np.abs(found.wavenumbers - q[3]).argmin()
    whole = np.sqrt(np.sum(found.amplitude[:, at] ** 2) / 1.5)  # of Hann's window
    assert whole == pytest.approx(0.1, rel=1e-3)
    assert found.participation == pytest.approx(28, rel=1e-3)
    up = 0.7 * (-1.0) ** np.arange(4)  # of 16 sites it is unstable
    run = simulate(ring(BETA4, 4), State(up, 0 * up), 204.7, tol=1e-10, record=Record(interval=0.1))
    (q,), (w,) = spectrum(run).ridge(0.2)
    assert q == np.pi
    assert abs(w - 2 * np.pi / 2.622221126476) < 0.016 * 2 * np.pi / 204.8
    assert w == pytest.approx(2.39637679, abs=5e-9)


def test_what_a_ring_has_not_is_named():
    law = PairLaw((t - x) ** 2 / 2, [x], [t])
    chain, still = ring(ALPHA, 20), State(np.zeros(20), 0.1 * np.eye(20)[3])
    run = simulate(chain, still, 1.0, dt=0.1)
    calls = {
        "method 'midpoint': not for rings": lambda: simulate(
            chain, still, 1.0, method="midpoint", dt=0.1
        ),
        "no dashpots in the bonds": lambda: ring(ALPHA, 6, damping=Damping(0.1)),
        "none in the bonds of a ring": lambda: ring(ALPHA, 6, forces=[Force(r * t, on="bonds")]),
        "stretch 0.1 m is that of a ring": lambda: Chain(ALPHA, 6, stretch=0.1),
        "stretch inf m is not finite": lambda: ring(ALPHA, 6, stretch=np.inf),
        "must be two of": lambda: Chain(ALPHA, 6, ends="ring"),
        "5 springs for 6 bonds": lambda: ring([ALPHA] * 5, 6),
        "not of pair laws": lambda: ring(law, 6),
        "pulses: not for rings": lambda: pulses(run),
        "the budget of a part: not for rings": lambda: budget(run, 5),
        "the front of a tail: not for rings": lambda: tail_front(chain, still),
    }
    for words, call in calls.items():
        with pytest.raises(TensegrityError) as said:
            call()
        assert words in str(said.value), said.value
