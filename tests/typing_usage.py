"""How the public names are called, for the type checker: checked by `make lint`, never run.

What they return stands in `interface.txt`; here are types of parts, or by the arguments.  Lines
with `type: ignore` are mistakes; the checker complains of each that it would let pass.
"""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path
from typing import Any, assert_type

import numpy as np
import sympy as sp

import granular
import tensegrity as ts
from granular.design import Choice, Order, Scatter, Sizes, peak_force, robustness, search
from granular.design.finalists import Best
from granular.lammps import run_lammps, to_lammps
from tensegrity.branches.table import Table
from tensegrity.engine import methods
from tensegrity.measure import observables
from tensegrity.measure.pulses import Pulse
from tensegrity.measure.records import Peak
from tensegrity.prisms.problem import EquilibriumPath
from tensegrity.prisms.stability import first_loss, lowest
from tensegrity.structures.structure_path import StructurePath
from tensegrity.typing import Array, Flags
from tensegrity.waves.prediction import Prediction
from tensegrity.waves.solitary import SolitaryWave
from tensegrity.waves.spectrum import Modes


def prisms_and_paths() -> ts.Potential:
    prism = ts.Prism(base=1, height=0.7, prestrain=0.01, k_cross=1.0, k_base=10.0)
    path = ts.equilibrium_path(prism, min_height=0.2, max_height=0.9, past_contact=True)
    assert_type(ts.equilibrium_paths([prism], min_height=0.2), list[EquilibriumPath])
    assert_type(path[3], dict[str, Any])
    assert_type(path[2:5], EquilibriumPath)
    assert_type([event.load for event in path.events if event.kind == "fold"], list[float])
    assert_type(ts.trace(prism.problem()), EquilibriumPath)
    assert_type(ts.trace(ts.Problem(("x", "y"), lambda x, y: x - y)), Table)
    path.to_csv("path.csv")
    path.plot(x="twist", y="load").set_title("twist")
    spring = prism.potential(preload=0.1)
    assert_type(spring, ts.Potential)
    assert_type(spring.domain, tuple[float, float])
    assert_type(spring.length, float | None)
    ts.Prism(base="1", height=0.7, prestrain=0.01, k_cross=1.0)  # type: ignore[arg-type]
    ts.Prism(base=1.0, height=0.7, prestrain=0.01)  # type: ignore[call-arg]
    prism.height = 0.8  # type: ignore[misc]
    ts.equilibrium_path(spring)  # type: ignore[arg-type]
    ts.equilibrium_path(prism, 0.2)  # type: ignore[call-arg,arg-type]
    ts.equilibrium_paths(prism)  # type: ignore[arg-type]
    spring.tension(None)  # type: ignore[arg-type]
    path["load"]  # type: ignore[call-overload]
    return spring


def structures() -> ts.Structure:
    prism = ts.Prism.from_members(0.13, 0.08, 0.1623, 2e4, k_base=3e4, k_bar=5e7, sides=3)
    one: ts.Structure = prism.structure(mass=0.1)
    s = prism.column(count=2, chirality="same", plates=False)
    assert_type(s.modes(3, ts.held([0, 1, 2])).frequencies, Array)
    ts.equilibrium(s, loads={8: (0.0, 0.0, -1.0)}, supports=ts.held([0, 1, 2]))
    path = ts.equilibrium_path(s, supports=ts.plates([0, 1, 2], [6, 7, 8]), branch="symmetric")
    assert_type(ts.control_path(s, {6: 0.1}), StructurePath)
    fixed = ts.held([0], axes=[0, 1]) + ts.plates([0, 1, 2], normal=(0.0, 0.0, 1.0))
    load = {8: (0.0, 0.0, -1.0)}
    ts.control_path(s, {6: 0.1}, fixed, branch="symmetric", loads=load)
    assert_type(
        ts.equilibrium_path(s, supports=fixed, loads=load, max_shortening=0.1), StructurePath
    )
    assert_type(s.nearest_form(ts.held([0, 1, 2])), ts.Structure)
    assert_type(s.self_stress(fixed, groups=[[0, 1, 2]]).mechanism_stiffness, Array)
    assert_type(s.prestressed(tension={6: 0.1}, supports=fixed), ts.Structure)
    assert_type(first_loss(prism, "tilting").load, float)
    lowest(prism, path, support="plates", count=2)
    touch = ts.bar_contact(path, diameter=8e-3)
    assert touch is None or assert_type(touch.load, float) > 0
    assert_type(ts.member_stiffness(1e9, 1e-6, 0.1), float)
    result = ts.fit([0.0, 1e-3], [0.0, 1.0], prism, free=("prestrain",), offset=False, noise=0.1)
    assert_type(result.intervals(level=0.9), dict[str, tuple[float, float]])
    assert_type(ts.read_curve("curve.csv", x="-mm", y="kN", columns=(0, "Force")).load, Array)
    assert_type(ts.fit(*ts.read_curve(Path("curve.csv")), prism).offset, float)
    assert_type(ts.catalogue.expandable_octahedron(strut=0.3, k_bar=[1e6] * 6), ts.Structure)
    assert_type(ts.catalogue.tower(stages=3, mass=0.1).bars, int)
    assert_type(ts.catalogue.truncated_tetrahedron().strings, int)
    assert_type(
        [ts.catalogue.snelson_x(), ts.catalogue.dome(), ts.catalogue.plate()], list[ts.Structure]
    )
    assert_type(ts.catalogue.twin_strings(4, torque=0.1), ts.Potential)
    assert_type(ts.catalogue.twin_prism(4, prestrain=0.1), ts.Structure)
    assert_type(ts.catalogue.geodesic("cube"), ts.Structure)
    ts.fit("curve.csv")  # type: ignore[call-arg]
    ts.Structure([[0, 0], [1, 0]], bars=3)  # type: ignore[arg-type]
    ts.control_path(s, [0.1])  # type: ignore[arg-type]
    ts.control_path(s, {6: 0.1}, loads=[1.0])  # type: ignore[arg-type]
    ts.plates(0)  # type: ignore[arg-type]
    return one


def springs(spring: ts.Potential) -> Sequence[ts.Potential]:
    r, k = sp.symbols("r k")
    toda = ts.Potential(k * (sp.exp(-r) + r - 1), r, {k: 2.0}, length=1.0, domain=(-1.0, 1.0))
    beads = ts.PowerLaw(stiffness=1.0, exponent=1.5, preload=2)
    fitted = ts.Polynomial(spring, -0.1, 0.1, error=1e-8)
    assert_type(beads.parameters, dict[str, float])
    with ts.units(length="mm", mass="t"):
        assert_type(ts.Potential.from_table([-1, 0, 1], [-1, 0, 1], "linear").noise, float)
    assert_type(ts.Potential.from_table(Path("spring.csv"), None), ts.Potential)
    ts.Potential(toda, r, domain=(0.0,))  # type: ignore[arg-type]
    return toda, beads, fitted


def chains(spring: ts.Potential) -> ts.Run:
    chain = ts.Chain(spring, sites=20, mass=np.ones(20), ends=("fixed", "free"))
    ts.Chain([spring] * 19, 20, [1.0] * 20)
    state = chain.at_rest({0: 0.1}) + ts.State([0.0] * 20, np.zeros(20)).reversed()
    record = ts.Record(every=2, sites=[1, 2], path="rows.npy")
    run = ts.simulate(chain, state, 10, method="verlet", dt=0.1, record=record)
    assert_type(run.energy_error, float)
    assert_type(run.final.v, Array)
    assert_type(run.error_estimate, float | None)
    run.plot().set_ylim(0.0, 1.0)
    ts.animate(run, "run.gif", "velocity", frames=20, rate=10, factor=1.0)
    assert_type(chain.bond_tension(run.u), Array)
    assert_type(chain.energy(run.final), float)
    lanes = ts.Ensemble(chain, count=8)
    ts.simulate(lanes, lanes.at_rest({1: np.linspace(0.0, 0.1, 8)}), 10.0, tol=1e-6)
    ts.Ensemble(scenes=[chain, ts.Chain(spring, 20, mass=2.0)])
    assert_type(chain.forces(run.final.u), Array)
    chain.stiffness([0.0] * 20).toarray()
    ts.Chain(spring, 20.5)  # type: ignore[arg-type]
    ts.Chain(1.0, 20)  # type: ignore[arg-type]
    ts.Chain(spring, 20, ends="free")  # type: ignore[arg-type]
    ts.Ensemble(spring, 3)  # type: ignore[arg-type]
    ts.State(np.zeros(3))  # type: ignore[call-arg]
    ts.Record(every=0.5)  # type: ignore[arg-type]
    ts.Record(times=1.0)  # type: ignore[arg-type]
    ts.Ensemble([chain], scenes=[chain])  # type: ignore[misc]
    chain.forces(None)  # type: ignore[arg-type]
    ts.simulate(chain, state)  # type: ignore[call-overload]
    ts.simulate(spring, state, 1.0)  # type: ignore[call-overload]
    ts.simulate(chain, np.zeros(20), 1.0)  # type: ignore[call-overload]
    ts.simulate(chain, state, 1.0, tol="1e-8")  # type: ignore[call-overload]
    ts.simulate(chain, state, 1.0, "verlet")  # type: ignore[call-overload]
    return run


def recorded(chain: ts.Chain, state: ts.State) -> ts.Run:
    record = ts.Record(sites=[0], times=[0.5, 1.0], interval=0.25, path="rows.npy", checkpoint=60)
    run = ts.simulate(chain, state, 10.0, method=ts.METHODS["rkn6"], record=record)
    run.save("run.npz")
    assert_type(ts.Run.load(Path("run.npz")), ts.Run)
    assert_type(ts.resume("rows.npy"), ts.Run)
    ts.resume(run)  # type: ignore[arg-type]
    ts.resume("rows.npy", state)  # type: ignore[arg-type]
    run.save()  # type: ignore[call-arg]
    ts.Record(path=3)  # type: ignore[arg-type]
    ts.simulate(chain, state, 10.0, method=6)  # type: ignore[call-overload]
    return run


def networks(spring: ts.Potential) -> Array:
    floor = ts.Wall.between((-1, 0), (5, 0), side=(0, 1))
    ts.Wall(point=[0.0, 0.0], normal=np.array([0.0, 1.0]))
    beads = ts.PowerLaw(1.0, 1.5)
    at = [(0.0, 0.5), (1.0, 0.5)]
    network = ts.Network(
        at, [(0, 1)], spring, radius=0.5, walls=[floor], wall_contacts=[(0, 0)], wall_spring=beads
    )
    run = ts.simulate(network, network.at_rest({0: (0.3, -0.1)}), 2.0)
    assert_type(network.momentum(run.final), Array)
    assert run.impulse is not None
    ts.Network([[0.0], [1.0]], [(0, 1)], spring)
    loose = ts.Network(
        [(0.0, 0.0, 0.0), (3.0, 0.0, 0.0)],
        [],
        (),
        radius=1.0,
        contacts="follow",
        law=lambda site, other: beads if isinstance(other, ts.Wall) else spring,
    )
    assert_type(ts.angular_momentum(loose, run.final), float | Array)
    assert_type(ts.directions(loose, run.u), Array)
    assert_type(ts.wall_gaps(loose, run.u), Array)
    ts.Network([(0.0, 0.5)], [], (), radius=1.0, contacts="follow", law=1.5)  # type: ignore[arg-type]
    ts.Network([(0.0, 0.5)], [], spring, walls=floor)  # type: ignore[arg-type]
    ts.Network([(0.0, 0.5)], [], spring, 1.0, 1.0, (), [])  # type: ignore[call-arg]
    return run.impulse


def waves(spring: ts.Potential, chain: ts.Chain) -> ts.State:
    wave: SolitaryWave = ts.solitary_wave(spring, speed_ratio=2, family="compression")
    ts.genuine(lambda light: ts.solitary_wave(spring, [1, light], speed_ratio=2), 0.1, 0.9)
    assert_type(wave.energy_slope + ts.floquet(wave).growth, float)
    assert_type(ts.floquet(wave).stable, bool)
    ts.prove(wave, period=40, exact="double")
    assert_type(ts.verify("wave.json").proved, bool)
    ts.floquet(chain)  # type: ignore[arg-type]
    orbit = ts.periodic_orbit(chain, chain.at_rest(), period=1.0)
    assert_type(ts.floquet(orbit).growth + orbit.energy + orbit.residual, float)
    assert_type(ts.orbit_path(orbit, by="period", until=1.1).stable, Flags)
    assert_type(ts.predict(spring), Prediction)
    assert_type(ts.modes(ts.Chain(spring, 5), count=3), Modes)
    shaker = ts.Drive(displacement=sp.sin(sp.Symbol("t")))
    damped = ts.Chain(spring, 5, drive={0: shaker}, damping=ts.Damping(ground=[0.1] * 5))
    assert_type(ts.simulate(damped, damped.at_rest(), 1.0).work, Array | None)
    ts.Drive(force=([0.0, 1.0], np.zeros(2)))
    drag = ts.Force(-sp.Symbol("v"), at=[0], parameters={})
    ts.Chain(spring, 3, ground=spring, forces=[ts.Force(spring, at=[0])])
    ts.Chain(spring, 2, ground=[spring, spring])
    ts.Chain(spring, 5, forces=(drag,))
    ts.Chain(spring, 5, forces=drag)  # type: ignore[arg-type]
    ts.Chain(spring, 5, drive={"0": shaker})  # type: ignore[dict-item]
    assert_type(ts.modes(ts.Chain(spring, 5)).frequencies, Array)
    assert_type(ts.dispersion([spring, spring], 1.0, [0.1], ground=spring), Array)
    q, other = sp.symbols("q other")
    pair = ts.PairLaw((other - q) ** 2 / 2, [q], [other], {"k": 1.0}, site=0, rest={q: 0.0})
    assert_type(pair.free, tuple[bool, ...])
    lattice = ts.PairLattice([[1.0]], [[0.0]], [(0, 0, 1, pair)], mass=(1.0,))
    assert_type(ts.bands(lattice, [[1.0]]).frequencies, Array)
    row = ts.Lattice([(0, 0)], [(1, 0)], strings=[(0, 0, 1)]).prestressed([0.1])
    assert_type(ts.bands(row, [[0.1]]).frequencies, Array)
    assert_type(ts.moduli(row).speeds([1, 0]), Array)
    assert_type(ts.effective_mass(row, [0], [0.1]), Array)
    assert_type(ts.decay(row, [0.1], 0, 0.0), Any)
    cast = ts.catalogue.square().embedded(ts.Matrix(1.0, 0.3, 1.0), cast="released")
    assert_type(ts.moduli(cast).speeds([1, 0]), Array)
    assert_type(cast.stress, Array)
    assert_type(ts.sheath(ts.Prism(1, 0.7, 0.1, 1), G=1.0, outer=2.0), ts.Potential)
    planar = [ts.catalogue.square(), ts.catalogue.triangular(), ts.catalogue.honeycomb(side=1.0)]
    cells = [ts.catalogue.kagome(), ts.catalogue.octahedra(layers=1), ts.catalogue.x_strip()]
    assert_type(planar + cells, list[ts.Lattice])
    assert_type(ts.catalogue.resonators(masses=(1.0, 2.0)), ts.Lattice)
    assert_type(ts.catalogue.x_plate().network((2, 2)), ts.Network)
    ts.files.write("x.stl", ts.catalogue.dome(), radius=0.01)
    assert_type(ts.files.read("x.csv"), Any)
    assert_type(ts.predict(spring)["compression"].speeds, tuple[float, float])
    assert_type(ts.interface(spring, spring, (40, 60), mass=(1.0, 2.0)), ts.Chain)
    assert_type(spring.sound_speed(), float)
    assert_type(ts.predict(spring)["compression"].small([0.0], 0.01, order=2), Array)
    assert_type(ts.sech2(spring, 1.1, 0.0, order=3) - ts.tent(spring, [0.0]), Array)
    ts.solitary_wave(spring, 1.0, 2.0)  # type: ignore[call-arg, arg-type]
    ts.transition_wave(spring, ahead=0.0, behind=1, ground=spring, damping=ts.Damping(0.1))
    ts.transition_wave(spring, 1.0, ahead=0.0)  # type: ignore[call-arg]
    wave.launch(spring, at=40)  # type: ignore[arg-type]
    return wave.launch(chain, at=40, direction=-1)


def springs_elsewhere(spring: ts.Potential) -> None:
    spring.to_c(3.0)  # type: ignore[arg-type]


def measured(chain: ts.Chain, run: ts.Run) -> float:
    ts.budget(run, 5)
    assert_type(ts.pulses(run, fraction=0.2), list[Pulse])
    assert_type(ts.pulses(run)[0].wave, ts.SolitaryWave | None)
    found = ts.pulses(run)[0].wave
    assert found is not None
    assert_type(ts.phase_shift(run, found, found), tuple[float, float])
    assert_type(ts.transmission(run).reflected, tuple[Pulse, ...])
    assert_type(ts.spectrum(run, sites=[0, 2], of="v").ridge(0.1), tuple[Array, Array])
    ring = ts.Chain(chain.springs[0], 8, ends="periodic", stretch=0.1)
    ts.Chain(chain.springs[0], 8, ends="ring")  # type: ignore[arg-type]
    assert_type(ring.stretch, float)
    grown = ts.lyapunov(chain, run.final, 10.0, dt=0.1, tangent=run.final, seed=1)
    assert_type(grown.exponent, float)
    cnoidal = ts.periodic_wave(chain.springs[0], 2.0, period=8, height=0.1, mean=0.01)
    assert_type(cnoidal.launch(ring, at=2.0, direction=-1), ts.State)
    assert_type(ts.shock(chain.springs[0], -0.1, ahead=0.0, mass=2.0).wave, ts.SolitaryWave)
    ts.periodic_wave(chain.springs[0], speed=1.0)  # type: ignore[call-arg]
    assert_type(observables.peak(chain.elongation(run.final.u)), tuple[float, float])
    assert_type(observables.passage(run.t, run.u[:, 0], run.v[:, 0]), float)
    times = ts.arrival(run, 3, direction=-1, after=0.5) + ts.duration(run, 3, level=0.1)
    front = ts.tail_front(chain, run.final)
    ts.budget(chain, 5)  # type: ignore[arg-type]
    ts.bond_force(chain)  # type: ignore[arg-type]
    ts.speed(run, 5)  # type: ignore[call-overload]
    ts.arrival(chain, 3)  # type: ignore[call-overload]
    return times + front + ts.speed(run, (3, 9)) + ts.width(run.t, run.energy)


def changing(state: ts.State) -> ts.Run:
    spring = ts.Prism(1.0, 0.7, 0.01, 1.0).potential().over_time(prestrain=0.01 + sp.Symbol("t"))
    assert_type(spring, ts.Potential)
    chain = ts.Chain([spring, spring.at(0.5)], 3)
    run = ts.simulate(chain, state, 1.0, dt=0.01)
    assert_type(run.work, Array | None)
    assert_type(ts.speed(run, (3, 9)), float)
    ts.PowerLaw(1.0, 1.5).over_time(stiffness="t")
    ts.budget(run.final, 5)  # type: ignore[arg-type]
    return run


def of_methods() -> list[float]:
    methods.find("verlet")
    assert_type(ts.Nystrom("rule", 2, 0.05, (0.5,), ((0.0,),), (0.5,), (1.0,)).stages, int)
    own = ts.Splitting("own", 2, 0.05, (0.5, 0.5), drifts=(1.0,), limitations="never")
    ts.Splitting("own", 2, 0.05, kicks=0.5, drifts=1.0)  # type: ignore[arg-type]
    ts.Splitting("own", 2, 0.05, (0.5, 0.5), (1.0,), "none")  # type: ignore[call-arg]
    own.check()
    ts.METHODS[2]  # type: ignore[index]
    return [method.stability_limit * method.stages for method in ts.METHODS.values()]


def differentiated(chain: ts.Chain, state: ts.State) -> Array:
    load = ts.objective.load(bond=3)
    found = ts.gradient(
        ts.objective.peak(load), chain, state, t_end=10.0, dt=0.05, wanted=("prestrain",)
    )
    other = ts.objective.of([load, ts.objective.energy([1])], lambda t, y: (float(y[0, -1]), 0 * y))
    more = [ts.objective.impulse(wall=0), ts.objective.arrival(2, displacement=0.1), other]
    more += [ts.objective.p_norm(ts.objective.velocity(1), p=8, over=(0.0, 1.0))]
    more += [ts.objective.misfit(ts.objective.displacement(1), [0.5], values=[0.1])]
    ts.gradient(more, chain, state, 10.0, dt=0.05, method="rkn6", checkpoints=10)
    ts.gradient(3.0, chain, state, 10.0, dt=0.05)  # type: ignore[call-overload]
    by: Array = found.by("prestrain")
    return by


def refused(spring: ts.Potential) -> str:
    try:
        spring.tension(-10.0)
    except (ts.LockingError, ts.StabilityError, ts.ContactError) as error:
        return f"{error} after {error.run.steps} steps"
    except (ts.RangeError, ts.NoLocking, ts.ResolutionError) as error:
        raise error from None
    except (ts.EquilibriumError, ts.RecordError) as error:
        raise error from None
    except ts.CompilerError as error:
        known: ts.TensegrityError = error
        raise known from None
    return ""


def beads() -> ts.Run:
    brass = granular.Material("brass", modulus=100e9, poisson=0.34, density=8500)
    bead = granular.Bead(4.76e-3, granular.materials["steel"], mass=0.45e-3)
    striker = granular.Striker(granular.Bead.of_mass(1e-3, brass), speed=0.5)
    line = granular.chain([bead, bead.coated(brass, 1e-6)] * 5, striker=striker, gravity=9.81)
    assert_type(line, granular.BeadChain)
    assert_type(granular.hertz(bead, bead).overlap(1.0), float)
    assert_type(granular.hertz(bead, bead).overlap(np.ones(2)), Array)
    assert_type(granular.hertz(bead, bead).spring(), ts.Potential)
    for law in (
        granular.kuwabara_kono(1e-6),
        granular.hunt_crossley(0.1),
        granular.viscous(0.1),
        granular.carretero_gonzalez(1.0, 1.5),
        granular.tsuji(restitution=0.5),
        granular.dmt(0.05),
    ):
        assert_type(law(bead, brass), granular.Contact)
    assert_type(
        granular.chain([bead] * 2, law=granular.viscous(restitution=0.9, speed=1.0)),
        granular.BeadChain,
    )
    y = granular.y_guide(bead=bead, branches=(bead, bead), wall=brass, law=granular.power(1e9, 1.5))
    assert_type(y, granular.Guide)
    assert_type(granular.diamond_guide(3, 5, bead=bead, striker=striker).start(), ts.State)
    assert_type(y.parts["stem 1"], tuple[int, ...])
    run = granular.simulate(y, y.start(), 1e-4)
    granular.Bead("0.005", brass)  # type: ignore[arg-type]
    granular.Bead(0.005, "steel")  # type: ignore[arg-type]
    granular.Striker(bead)  # type: ignore[call-arg]
    granular.materials[0]  # type: ignore[index]
    granular.chain(bead)  # type: ignore[arg-type]
    granular.y_guide(bead=bead, branches=bead)  # type: ignore[arg-type]
    granular.y_guide(bead=bead, law=1.5)  # type: ignore[arg-type]
    granular.chain([bead] * 2, gravty=9.81)  # type: ignore[call-arg]
    granular.chain([bead] * 2, friction=(0.2, 0.01))  # type: ignore[call-arg]
    granular.power("hertz", 1.5)  # type: ignore[arg-type]
    granular.hertz(bead, 1.0)  # type: ignore[arg-type]
    return run


def sensed(run: ts.Run) -> Array:
    force = granular.sensor_force(run, "stem 1", 3)
    assert_type(ts.first_peak(run.t, force, between=(0.0, 1.0)), Peak[float])
    assert_type(ts.largest_peak(run.t, force, between=(0.0, 1.0)), Peak[float])
    assert_type(ts.first_peak(run.t, force, noise=0.1).instant_error, float)
    assert_type(ts.peaks(run.t, force, noise=0.1).height_error, Array)
    assert_type(ts.sampled(run.t, force, interval=1e-6), tuple[Array, Array])
    assert_type(ts.peaks(run.t, force), Peak[Array])
    assert_type(granular.energies(run).parts, dict[str, Array])
    assert_type(granular.overlaps(run, "stem 1"), tuple[float, float])
    assert_type(ts.speed(run, "stem 1", (3, 7)), float)
    guide = run.scene
    assert_type(granular.contact_network.wall_sites(guide, "floor"), list[int])
    assert_type(granular.contact_network.wall_forces(guide, run.u, "floor"), Array)
    granular.energies(run)
    series = ts.read_record("scope.csv", "CH1", scale=20.0, offset=0.1, time=1e-6, unit="N")
    assert_type(series.filtered(below=2e4).since(1e-4), ts.TimeSeries)
    assert_type(series.noise, float)
    assert_type(ts.peaks(series).instant, Array)
    assert_type(ts.arrival(series, after=0.1) + ts.speed((series, series), 0.1), float)
    ts.Drive(force=series)
    ts.arrival(series, 3)  # type: ignore[call-overload]
    sensors = {ts.objective.load(bond=1): series}
    fitted = ts.fit_run(sensors, lambda k: ts.Chain(ts.PowerLaw(k, 1.5), 3), {"k": 1.0}, dt=0.1)
    assert_type(fitted.intervals(level=0.9), dict[str, tuple[float, float]])
    assert_type(fitted.residuals, tuple[Array, ...])
    ts.first_peak(run)  # type: ignore[arg-type]
    granular.sensor_force(run, 3, "stem 1")  # type: ignore[call-overload]
    granular.energies(run.final)  # type: ignore[arg-type]
    return run.momentum()[:, 0] + granular.sensor_force(run, [1])[:, 0]


def protectors(bead: granular.Bead) -> list[granular.Bead]:
    steel, striker = granular.materials["steel"], granular.Striker(bead, speed=1)
    how = {"a": 1.0}
    single = peak_force([bead] * 3, striker=striker, wall=steel, t_end=1e-3)
    assert_type(single, float | Array)
    peak_force([[bead] * 3] * 2, striker=striker, wall=steel, t_end=1e-3, dt=1e-6)
    for space in (
        Order([bead, bead]),
        Sizes(3, (4e-3, 5e-3), 13e-3, steel),
        Choice(count=3, diameter=5e-3, materials=[steel, granular.materials["ptfe"]]),
    ):
        best = search(space, striker=striker, wall=steel, t_end=1e-3, method="ga", budget=100)
        assert_type(best, Best)
        assert_type(best.history, Array)
    search(how, striker=striker, wall=steel, t_end=1e-3)  # type: ignore[arg-type]
    deviations = Scatter(diameters=0.01, gaps=1e-6, draws=8)
    search(Order([bead, bead]), striker=striker, wall=steel, t_end=1e-3, scatter=deviations)
    varied = robustness([bead] * 3, striker=striker, wall=steel, t_end=1e-3, speed=0.01)
    assert_type(varied.peaks, Array)
    assert_type(varied.quantile(0.5), float)
    peak_force([bead], striker=striker, wall="steel", t_end=1e-3)  # type: ignore[arg-type]
    chain = ts.Chain(ts.PowerLaw(1.0, 1.5), sites=5)
    compared = ts.work_precision(chain, chain.at_rest({0: 1.0}), 5.0, ["verlet"], ["dop853"])
    assert_type(compared, ts.WorkPrecision)
    assert_type(compared.best(1e-3).evaluations, int)
    models = ts.prism_models(ts.Prism(1.0, 0.7, 0.1, 1.0, 5.0, 50.0), 3, 0.02)
    assert_type(ts.compare_models(models, max, 1.0).simplest(0.01).seconds, float)
    assert_type(ts.sweep(abs, [1, 2], checkpoint="sweep.npz"), list[Any])
    return best.beads


def units() -> ts.Unit:
    w, h = sp.symbols("w h", positive=True)
    cables = ts.Member(w, 1.0, count=2, string=True)
    bars = ts.Member(sp.sqrt(w**2 + h**2), np.inf, 2)
    members, rest = [cables, ts.Member(h, 2.0, 2), bars], {w: 1.0, h: 0.75}
    unit = ts.Unit([w], h, members, rest=rest, prestrain={cables: 0.1}, events={"flat": h})
    assert_type(unit.self_stress(), list[float])
    assert_type(unit.natural_lengths(), list[float])
    assert_type(unit.argument(), list[Any])
    ts.Chain(unit.potential(preload=0.01), 3)
    ts.equilibrium_path(unit, min_height=0.4)
    unit.axial_stiffness(1, 2)  # type: ignore[call-arg]
    return unit.about({"w": 1.0, "h": 0.75})


def packs(bead: granular.Bead) -> ts.Run:
    steel, striker = granular.materials["steel"], granular.Striker(bead, speed=1)
    cubic = granular.fcc_pack(
        4, 3, bead=bead, floor=steel, sides=steel, striker=striker, struck=(0, 1)
    )
    assert_type(cubic, granular.Pack)
    granular.hexagonal_pack(
        rows=3, columns=4, bead=[bead] * 11, floor=steel, striker=striker, struck=1,
        offset=(-1, 2.0), direction=np.array([1, -2]), gap=1e-4, contacts="follow",
    )  # fmt: skip
    floor = ts.Wall((0, 0), (0, 1)), steel
    loose = granular.pack([(0.1, 0.1), (0.2, 0.1)], bead, {"floor": floor}, contacts="fixed")
    loose.at_rest({0: (1.0, 0.0)})
    run = ts.simulate(cubic, cubic.start(), 1e-5)
    granular.wall_force(run, "floor", each=True)
    path = to_lammps(cubic, cubic.start(), 1e-4, 1e-7, "in.beads", every=10)
    assert_type(path, Path)
    assert_type(run_lammps(cubic, cubic.start(), 1e-4, 1e-7, ranks=2, path=path), ts.Run)
    granular.pack([(0.1, 0.1)], "steel")  # type: ignore[arg-type]
    granular.fcc_pack(4, 3, bead=bead, floor="steel")  # type: ignore[arg-type]
    granular.fcc_pack(bead=bead, struck=1)  # type: ignore[arg-type]
    return run
