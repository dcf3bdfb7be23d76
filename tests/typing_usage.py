"""How the public names are called, for the type checker: checked by `make lint`, never run.

Lines with `type: ignore` are mistakes; the checker complains of each that it would let pass.
"""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path
from typing import Any, assert_type

import numpy as np
import sympy as sp

import granular
from granular import (
    Bead,
    BeadChain,
    Contact,
    Guide,
    Material,
    Pack,
    Striker,
    carretero_gonzalez,
    contact_network,
    diamond_guide,
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
    viscous,
    wall_force,
    y_guide,
)
from granular.design import Choice, Order, Scatter, Sizes, peak_force, robustness, search
from granular.design.finalists import Best
from granular.lammps import run_lammps, to_lammps
from tensegrity import (
    METHODS,
    Chain,
    CompilerError,
    ContactError,
    Damping,
    Drive,
    Ensemble,
    EquilibriumError,
    Force,
    Lattice,
    LockingError,
    Network,
    NoLocking,
    Nystrom,
    Polynomial,
    Potential,
    PowerLaw,
    Prism,
    RangeError,
    Record,
    RecordError,
    ResolutionError,
    Run,
    SolitaryWave,
    Splitting,
    StabilityError,
    State,
    Structure,
    TensegrityError,
    Wall,
    angular_momentum,
    animate,
    arrival,
    bands,
    bar_contact,
    bond_force,
    budget,
    catalogue,
    control_path,
    decay,
    directions,
    dispersion,
    duration,
    effective_mass,
    equilibrium,
    equilibrium_path,
    equilibrium_paths,
    first_peak,
    fit,
    floquet,
    gradient,
    held,
    interface,
    largest_peak,
    member_stiffness,
    modes,
    moduli,
    objective,
    orbit_path,
    peaks,
    periodic_orbit,
    phase_shift,
    plates,
    predict,
    pulses,
    read_curve,
    resume,
    sampled,
    sech2,
    simulate,
    solitary_wave,
    speed,
    sweep,
    tail_front,
    tent,
    transition_wave,
    transmission,
    units,
    wall_gaps,
    width,
)
from tensegrity.engine import methods
from tensegrity.measure import observables
from tensegrity.measure.interfaces import Transmission
from tensegrity.measure.pulses import Pulse
from tensegrity.prisms.problem import EquilibriumPath
from tensegrity.prisms.stability import first_loss, lowest
from tensegrity.structures.structure_path import StructurePath
from tensegrity.typing import Array, Flags
from tensegrity.waves.prediction import Prediction
from tensegrity.waves.spectrum import Modes
from tensegrity.waves.transition import TransitionWave


def prisms_and_paths() -> Potential:
    prism = Prism(base=1, height=0.7, prestrain=0.01, k_cross=1.0, k_base=10.0)
    assert_type(prism.height, float)
    assert_type(prism.natural_lengths().bar, float)
    assert_type(prism.axial_stiffness() + prism.locking_height(), float)
    path = equilibrium_path(prism, min_height=0.2, max_height=0.9, past_contact=True)
    assert_type(path, EquilibriumPath)
    assert_type(equilibrium_paths([prism], min_height=0.2), list[EquilibriumPath])
    assert_type(path[3], dict[str, Any])
    assert_type(path[2:5], EquilibriumPath)
    assert_type(path.load - path.height, Array)
    assert_type(path.stable_load, Flags)
    assert_type([event.load for event in path.events if event.kind == "fold"], list[float])
    path.to_csv("path.csv")
    path.plot(x="twist", y="load").set_title("twist")
    spring = prism.potential(preload=0.1)
    assert_type(spring, Potential)
    assert_type(spring.domain, tuple[float, float])
    assert_type(spring.length, float | None)
    assert_type(spring.tension([0.0, 0.1]), Array)
    assert_type(spring.energy(0.0) + spring.stiffness(np.zeros(3)), Array)
    Prism(base="1", height=0.7, prestrain=0.01, k_cross=1.0)  # type: ignore[arg-type]
    Prism(base=1.0, height=0.7, prestrain=0.01)  # type: ignore[call-arg]
    prism.height = 0.8  # type: ignore[misc]
    equilibrium_path(spring)  # type: ignore[arg-type]
    equilibrium_path(prism, 0.2)  # type: ignore[call-arg,arg-type]
    equilibrium_paths(prism)  # type: ignore[arg-type]
    spring.tension(None)  # type: ignore[arg-type]
    path["load"]  # type: ignore[call-overload]
    return spring


def structures() -> Structure:
    prism = Prism.from_members(0.13, 0.08, 0.1623, 2e4, k_base=3e4, k_bar=5e7, sides=3)
    one: Structure = prism.structure(mass=0.1)
    s = prism.column(count=2, chirality="same", plates=False)
    assert_type(s.self_stress().feasible, Array)
    assert_type(s.mechanisms(), Array)
    assert_type(s.prestressed(prestrain={6: 0.1}).relaxed(), Structure)
    assert_type(s.modes(3, held([0, 1, 2])).frequencies, Array)
    assert_type(s.is_stable(), bool)
    state = equilibrium(s, loads={8: (0.0, 0.0, -1.0)}, supports=held([0, 1, 2]))
    assert_type(state.tensions, Array)
    assert_type(state.slack, Flags)
    path = equilibrium_path(s, supports=plates([0, 1, 2], [6, 7, 8]), branch="symmetric")
    assert_type(path, StructurePath)
    assert_type(path.tensions, Array)
    assert_type(control_path(s, {6: 0.1}), StructurePath)
    fixed = held([0], axes=[0, 1]) + plates([0, 1, 2], normal=(0.0, 0.0, 1.0))
    load = {8: (0.0, 0.0, -1.0)}
    drawn = control_path(s, {6: 0.1}, fixed, branch="symmetric", loads=load)
    assert_type(drawn.positions, Array)
    assert_type(drawn.slack, Flags)
    assert_type(equilibrium_path(s, supports=fixed, loads=load, max_shortening=0.1), StructurePath)
    assert_type(s.nearest_form(), Structure)
    assert_type(s.at(s.positions, natural_lengths=s.natural_lengths), Structure)
    assert_type(s.at_mass([1.0] * 9), Structure)
    assert_type(s.self_stress().gap, float)
    assert_type(state.stable, bool)
    assert_type(state.reactions, Array)
    assert_type(first_loss(prism, "tilting").load, float)
    values, symmetric = lowest(prism, path, support="plates", count=2)
    assert_type(values, Array)
    assert_type(symmetric, Flags)
    touch = bar_contact(path, diameter=8e-3)
    assert touch is None or assert_type(touch.load, float) > 0
    assert_type(member_stiffness(1e9, 1e-6, 0.1), float)
    result = fit([0.0, 1e-3], [0.0, 1.0], prism, free=("prestrain",), offset=False, noise=0.1)
    assert_type(result.prism, Prism)
    assert_type(result.band(), Array)
    assert_type(result.intervals(level=0.9), dict[str, tuple[float, float]])
    assert_type(fit("curve.csv", None, prism).degrees, float)
    assert_type(read_curve("curve.csv", x="-mm", y="kN", columns=(0, "Force")).load, Array)
    assert_type(fit(*read_curve(Path("curve.csv")), prism).offset, float)
    assert_type(catalogue.expandable_octahedron(strut=0.3, k_bar=[1e6] * 6), Structure)
    assert_type(catalogue.tower(stages=3, mass=0.1).bars, int)
    assert_type(catalogue.truncated_tetrahedron().strings, int)
    assert_type([catalogue.snelson_x(), catalogue.dome(), catalogue.plate()], list[Structure])
    assert_type(catalogue.twin_strings(4, torque=0.1), Potential)
    assert_type(catalogue.twin_prism(4, prestrain=0.1), Structure)
    catalogue.geodesic(12)  # type: ignore[arg-type]
    fit("curve.csv")  # type: ignore[call-arg]
    assert_type(s.network(), Network)
    Structure([[0, 0], [1, 0]], bars=3)  # type: ignore[arg-type]
    control_path(s, [0.1])  # type: ignore[arg-type]
    control_path(s, {6: 0.1}, loads=[1.0])  # type: ignore[arg-type]
    plates(0)  # type: ignore[arg-type]
    return one


def springs(spring: Potential) -> Sequence[Potential]:
    r, k = sp.symbols("r k")
    toda = Potential(k * (sp.exp(-r) + r - 1), r, {k: 2.0}, length=1.0, domain=(-1.0, 1.0))
    beads = PowerLaw(stiffness=1.0, exponent=1.5, preload=2)
    fitted = Polynomial(spring, -0.1, 0.1, error=1e-8)
    assert_type(beads.parameters, dict[str, float])
    assert_type(fitted.error_estimate, float)
    PowerLaw(1.0, "3/2")  # type: ignore[arg-type]
    Polynomial(1.0, -0.1, 0.1)  # type: ignore[arg-type]
    assert_type(fitted.degree, int)
    with units(length="mm", mass="t"):
        assert_type(Potential.from_table([-1, 0, 1], [-1, 0, 1], "linear").noise, float)
    Potential.from_table([-1, 0, 1], 1.0, kind=3)  # type: ignore[arg-type]
    Potential(toda, r, domain=(0.0,))  # type: ignore[arg-type]
    return toda, beads, fitted


def chains(spring: Potential) -> Run:
    chain = Chain(spring, sites=20, mass=np.ones(20), ends=("fixed", "free"))
    Chain([spring] * 19, 20, [1.0] * 20)
    state = chain.at_rest({0: 0.1}) + State([0.0] * 20, np.zeros(20)).reversed()
    assert_type(state, State)
    assert_type(state.u, Array)
    record = Record(every=2, sites=[1, 2], path="rows.npy")
    run = simulate(chain, state, 10, method="verlet", dt=0.1, record=record)
    assert_type(run.energy_error, float)
    assert_type(run.final.v, Array)
    assert_type(run.error_estimate, float | None)
    run.plot().set_ylim(0.0, 1.0)
    animate(run, "run.gif", "velocity", frames=20, rate=10, factor=1.0)
    assert_type(chain.bond_tension(run.u), Array)
    assert_type(chain.energy(run.final), float)
    lanes = Ensemble(chain, count=8)
    runs = simulate(lanes, lanes.at_rest({1: np.linspace(0.0, 0.1, 8)}), 10.0, tol=1e-6)
    assert_type(runs[0].energy, Array)
    various = Ensemble(scenes=[chain, Chain(spring, 20, mass=2.0)])
    assert_type(various.select(various.at_rest(), 1), State)
    assert_type(various.count, int)
    assert_type(chain.forces(run.final.u), Array)
    chain.stiffness([0.0] * 20).toarray()
    Chain(spring, 20.5)  # type: ignore[arg-type]
    Chain(1.0, 20)  # type: ignore[arg-type]
    Chain(spring, 20, ends="free")  # type: ignore[arg-type]
    Ensemble(spring, 3)  # type: ignore[arg-type]
    State(np.zeros(3))  # type: ignore[call-arg]
    Record(every=0.5)  # type: ignore[arg-type]
    Record(times=1.0)  # type: ignore[arg-type]
    Ensemble([chain], scenes=[chain])  # type: ignore[misc]
    chain.forces(None)  # type: ignore[arg-type]
    simulate(chain, state)  # type: ignore[call-overload]
    simulate(spring, state, 1.0)  # type: ignore[call-overload]
    simulate(chain, np.zeros(20), 1.0)  # type: ignore[call-overload]
    simulate(chain, state, 1.0, tol="1e-8")  # type: ignore[call-overload]
    simulate(chain, state, 1.0, "verlet")  # type: ignore[call-overload]
    return run


def recorded(chain: Chain, state: State) -> Run:
    record = Record(sites=[0], times=[0.5, 1.0], interval=0.25, path="rows.npy", checkpoint=60)
    run = simulate(chain, state, 10.0, method=METHODS["rkn6"], record=record)
    run.save("run.npz")
    assert_type(Run.load(Path("run.npz")), Run)
    assert_type(resume("rows.npy"), Run)
    resume(run)  # type: ignore[arg-type]
    resume("rows.npy", state)  # type: ignore[arg-type]
    run.save()  # type: ignore[call-arg]
    Record(path=3)  # type: ignore[arg-type]
    simulate(chain, state, 10.0, method=6)  # type: ignore[call-overload]
    return run


def networks(spring: Potential) -> Array:
    floor = Wall.between((-1, 0), (5, 0), side=(0, 1))
    Wall(point=[0.0, 0.0], normal=np.array([0.0, 1.0]))
    beads = PowerLaw(1.0, 1.5)
    network = Network(
        positions=[(0.0, 0.5), (1.0, 0.5)],
        bonds=[(0, 1)],
        spring=spring,
        radius=0.5,
        walls=[floor],
        wall_contacts=[(0, 0)],
        wall_spring=beads,
        held=[1],
    )
    run = simulate(network, network.at_rest({0: (0.3, -0.1)}), 2.0)
    assert_type(network.momentum(run.final), Array)
    assert run.impulse is not None
    line = Network([[0.0], [1.0]], [(0, 1)], spring)
    assert_type(line.forces([[0.0], [0.1]]), Array)
    loose = Network(
        [(0.0, 0.0, 0.0), (3.0, 0.0, 0.0)],
        [],
        (),
        radius=1.0,
        contacts="follow",
        law=lambda site, other: beads if isinstance(other, Wall) else spring,
    )
    assert_type(angular_momentum(loose, run.final), float | Array)
    assert_type(directions(loose, run.u), Array)
    assert_type(wall_gaps(loose, run.u), Array)
    Network([(0.0, 0.5)], [], (), radius=1.0, contacts="follow", law=1.5)  # type: ignore[arg-type]
    Network([(0.0, 0.5)], [], spring, walls=floor)  # type: ignore[arg-type]
    Network([(0.0, 0.5)], [], spring, 1.0, 1.0, (), [])  # type: ignore[call-arg]
    return run.impulse


def waves(spring: Potential, chain: Chain) -> State:
    wave = solitary_wave(spring, speed_ratio=2, family="compression")
    assert_type(wave, SolitaryWave)
    assert_type(wave.width(0.1) + wave.speed + float(wave.shift), float)
    assert_type(wave.energy_slope + floquet(wave).growth, float)
    assert_type(floquet(wave).stable, bool)
    floquet(chain)  # type: ignore[arg-type]
    orbit = periodic_orbit(chain, chain.at_rest(), period=1.0)
    assert_type(orbit.state, State)
    assert_type(floquet(orbit).growth + orbit.energy + orbit.residual, float)
    assert_type(orbit.run(), Run)
    assert_type(orbit_path(orbit, by="period", until=1.1).stable, Flags)
    assert_type(predict(spring), Prediction)
    assert_type(modes(Chain(spring, 5), count=3), Modes)
    shaker = Drive(displacement=sp.sin(sp.Symbol("t")))
    assert_type(shaker.at([0.0, 1.0]), Array)
    damped = Chain(spring, 5, drive={0: shaker}, damping=Damping(ground=[0.1] * 5))
    assert_type(simulate(damped, damped.at_rest(), 1.0).work, Array | None)
    Drive(force=([0.0, 1.0], np.zeros(2)))
    drag = Force(-sp.Symbol("v"), at=[0], parameters={})
    Chain(spring, 3, ground=spring, forces=[Force(spring, at=[0])])
    Chain(spring, 2, ground=[spring, spring])
    assert_type(drag.values(0.0, [1.0]), Array)
    Chain(spring, 5, forces=(drag,))
    Chain(spring, 5, forces=drag)  # type: ignore[arg-type]
    Chain(spring, 5, drive={"0": shaker})  # type: ignore[dict-item]
    assert_type(modes(Chain(spring, 5)).frequencies, Array)
    assert_type(dispersion([spring, spring], 1.0, [0.1], ground=spring), Array)
    row = Lattice([(0, 0)], [(1, 0)], strings=[(0, 0, 1)]).prestressed([0.1])
    assert_type(row, Lattice)
    assert_type(bands(row, [[0.1]]).frequencies, Array)
    assert_type(moduli(row).speeds([1, 0]), Array)
    assert_type(effective_mass(row, [0], [0.1]), Array)
    assert_type(decay(row, [0.1], 0, 0.0), Any)
    assert_type(row.stability().kind, str)
    assert_type(Prism(1.0, 0.7, 0.1, 1.0, 5.0, 50.0).column(periodic=True), Lattice)
    assert_type(catalogue.column(periodic=True), Lattice)
    for cell in (catalogue.square(), catalogue.triangular(), catalogue.honeycomb(side=1.0)):
        assert_type(cell, Lattice)
    assert_type(catalogue.kagome(), Lattice)
    assert_type(catalogue.octahedra(layers=1), Lattice)
    assert_type(catalogue.resonators(masses=(1.0, 2.0)), Lattice)
    assert_type(catalogue.x_strip(), Lattice)
    assert_type(catalogue.x_plate().network((2, 2)), Network)
    bands("x", [[0.1]])  # type: ignore[arg-type]
    dispersion("x", 1.0, [0.1])  # type: ignore[arg-type]
    assert_type(predict(spring)["compression"].speeds, tuple[float, float])
    assert_type(predict(spring)["compression"].curve(excess=[0.1, 0.2]).width, Array)
    assert_type(interface(spring, spring, (40, 60), mass=(1.0, 2.0)), Chain)
    interface(chain, spring)  # type: ignore[arg-type]
    assert_type(wave.excess, float)
    assert_type(wave.strain - wave.elongation(wave.x), Array)
    assert_type(spring.sound_speed(), float)
    assert_type(sech2(spring, 1.1, 0.0) - tent(spring, [0.0]), Array)
    solitary_wave(spring, 1.0, 2.0)  # type: ignore[call-arg]
    front = transition_wave(spring, ahead=0.0, behind=1, ground=spring, damping=Damping(0.1))
    assert_type(front, TransitionWave)
    assert_type(front.launch(Chain(spring, 3), 1), State)
    transition_wave(spring, 1.0, ahead=0.0)  # type: ignore[call-arg]
    solitary_wave(spring, amplitude="0.1")  # type: ignore[arg-type]
    wave.launch(spring, at=40)  # type: ignore[arg-type]
    sech2(chain, 1.1, 0.0)  # type: ignore[arg-type]
    return wave.launch(chain, at=40, direction=-1)


def springs_elsewhere(spring: Potential) -> None:
    assert_type(spring.to_c("spring.c"), Path)
    spring.to_c(3.0)  # type: ignore[arg-type]


def measured(chain: Chain, run: Run) -> float:
    passed = budget(run, 5)
    assert_type(bond_force(run), Array)
    assert_type(passed.energy - passed.work, Array)
    assert_type(passed.momentum_error, float)
    assert_type(pulses(run, fraction=0.2), list[Pulse])
    assert_type(pulses(run)[0].wave, SolitaryWave | None)
    found = pulses(run)[0].wave
    assert found is not None
    assert_type(phase_shift(run, found, found), tuple[float, float])
    assert_type(transmission(run, row=-1), Transmission)
    assert_type(transmission(run).reflected, tuple[Pulse, ...])
    assert_type(transmission(run).transmitted_delays, Array)
    assert_type(observables.peak(chain.elongation(run.final.u)), tuple[float, float])
    assert_type(observables.passage(run.t, run.u[:, 0], run.v[:, 0]), float)
    times = arrival(run, 3, direction=-1, after=0.5) + duration(run, 3, level=0.1)
    front = tail_front(chain, run.final)
    budget(chain, 5)  # type: ignore[arg-type]
    bond_force(chain)  # type: ignore[arg-type]
    speed(run, 5)  # type: ignore[call-overload]
    arrival(chain, 3)  # type: ignore[arg-type]
    pulses(chain, run.final)  # type: ignore[arg-type]
    pulses(run, run.final)  # type: ignore[arg-type]
    return times + front + speed(run, (3, 9)) + width(run.t, run.energy)


def tuned(state: State) -> Run:
    def spring_at(t: float) -> Potential:
        return Prism(1.0, 0.7, 0.01 + 0.01 * t, 1.0).potential()

    chain = Chain(spring_at(0.0), 20, tune=spring_at)
    run = simulate(chain, state, 1.0, dt=0.01)
    assert_type(run.work, Array | None)
    assert_type(speed(run, (3, 9)), float)
    Chain(spring_at(0.0), 20, tune=spring_at(0.0))  # type: ignore[arg-type]
    budget(run.final, 5)  # type: ignore[arg-type]
    return run


def of_methods() -> list[float]:
    verlet = methods.find("verlet")
    assert_type(verlet, methods.Method)
    assert_type(verlet.symplectic, bool)
    assert_type(Nystrom("rule", 2, 0.05, (0.5,), ((0.0,),), (0.5,), (1.0,)).stages, int)
    own = Splitting("own", 2, 0.05, (0.5, 0.5), drifts=(1.0,), limitations="never")
    assert_type(own.step_matrix(0.1)[0], Array)
    Splitting("own", 2, 0.05, kicks=0.5, drifts=1.0)  # type: ignore[arg-type]
    Splitting("own", 2, 0.05, (0.5, 0.5), (1.0,), "none")  # type: ignore[call-arg]
    own.check()
    METHODS[2]  # type: ignore[index]
    return [method.stability_limit * method.stages for method in METHODS.values()]


def differentiated(chain: Chain, state: State) -> Array:
    load = objective.load(bond=3)
    found = gradient(objective.peak(load), chain, state, t_end=10.0, dt=0.05, wanted=("prestrain",))
    other = objective.of([load, objective.energy([1])], lambda t, y: (float(y[0, -1]), 0 * y))
    more = [objective.impulse(wall=0), objective.arrival(2, displacement=0.1), other]
    more += [objective.p_norm(objective.velocity(1), p=8, over=(0.0, 1.0))]
    more += [objective.misfit(objective.displacement(1), [0.5], values=[0.1])]
    gradient(more, chain, state, 10.0, dt=0.05, method="rkn6", checkpoints=10)
    objective.peak(3.0)  # type: ignore[arg-type]
    objective.load("bond")  # type: ignore[arg-type]
    gradient(3.0, chain, state, 10.0, dt=0.05)  # type: ignore[call-overload]
    by: Array = found.by("prestrain")
    return by


def refused(spring: Potential) -> str:
    try:
        spring.tension(-10.0)
    except (LockingError, StabilityError, ContactError) as error:
        return f"{error} after {error.run.steps} steps"
    except (RangeError, NoLocking, ResolutionError, EquilibriumError, RecordError) as error:
        raise error from None
    except CompilerError as error:
        known: TensegrityError = error
        raise known from None
    return ""


def beads() -> Run:
    brass = Material("brass", modulus=100e9, poisson=0.34, density=8500)
    assert_type(materials["steel"], Material)
    bead = Bead(4.76e-3, materials["steel"], mass=0.45e-3)
    assert_type(bead.mass + bead.radius + bead.contact_radius, float)
    striker = Striker(Bead.of_mass(1e-3, brass), speed=0.5)
    line = granular.chain([bead, bead.coated(brass, 1e-6)] * 5, striker=striker, gravity=9.81)
    assert_type(line, BeadChain)
    assert_type(hertz(bead, brass), Contact)
    assert_type(hertz(bead, bead).overlap(1.0), float)
    assert_type(hertz(bead, bead).overlap(np.ones(2)), Array)
    assert_type(hertz(bead, bead).spring(), Potential)
    for law in (
        kuwabara_kono(1e-6),
        hunt_crossley(0.1),
        viscous(0.1),
        carretero_gonzalez(1.0, 1.5),
    ):
        assert_type(law(bead, brass), Contact)
    assert_type(granular.chain([bead] * 2, law=viscous(restitution=0.9, speed=1.0)), BeadChain)
    y = y_guide(bead=bead, branches=(bead, bead), wall=brass, law=power(1e9, 1.5))
    assert_type(y, Guide)
    assert_type(diamond_guide(3, 5, bead=bead, striker=striker).start(), State)
    assert_type(y.parts["stem 1"], tuple[int, ...])
    run = granular.simulate(y, y.start(), 1e-4)
    Bead("0.005", brass)  # type: ignore[arg-type]
    Bead(0.005, "steel")  # type: ignore[arg-type]
    Striker(bead)  # type: ignore[call-arg]
    materials[0]  # type: ignore[index]
    granular.chain(bead)  # type: ignore[arg-type]
    y_guide(bead=bead, branches=bead)  # type: ignore[arg-type]
    y_guide(bead=bead, law=1.5)  # type: ignore[arg-type]
    granular.chain([bead] * 2, gravty=9.81)  # type: ignore[call-arg]
    granular.chain([bead] * 2, friction=(0.2, 0.01))  # type: ignore[call-arg]
    power("hertz", 1.5)  # type: ignore[arg-type]
    hertz(bead, 1.0)  # type: ignore[arg-type]
    return run


def sensed(run: Run) -> Array:
    force = sensor_force(run, "stem 1", 3)
    assert_type(force, Array)
    assert_type(first_peak(run.t, force, between=(0.0, 1.0)), tuple[float, float])
    assert_type(largest_peak(run.t, force, between=(0.0, 1.0)), tuple[float, float])
    assert_type(first_peak(run.t, force, noise=0.1).instant_error, float)
    assert_type(peaks(run.t, force, noise=0.1).height_error, Array)
    assert_type(sampled(run.t, force, interval=1e-6), tuple[Array, Array])
    assert_type(peaks(run.t, force), tuple[Array, Array])
    assert_type(energies(run).parts, dict[str, Array])
    assert_type(overlaps(run, "stem 1"), tuple[float, float])
    assert_type(speed(run, "stem 1", (3, 7)), float)
    guide = run.scene
    assert_type(contact_network.wall_sites(guide, "floor"), list[int])
    assert_type(contact_network.wall_forces(guide, run.u, "floor"), Array)
    found = energies(run)
    assert_type(found.fractions + found.effective_number, Array)
    assert_type(found.participation_ratio + found.virial_ratio, Array)
    first_peak(run.t)  # type: ignore[call-overload]
    sensor_force(run, 3, "stem 1")  # type: ignore[call-overload]
    energies(run.final)  # type: ignore[arg-type]
    return run.momentum()[:, 0] + sensor_force(run, [1])[:, 0]


def protectors(bead: Bead) -> list[Bead]:
    steel, striker = materials["steel"], Striker(bead, speed=1)
    how = {"a": 1.0}
    single = peak_force([bead] * 3, striker=striker, wall=steel, t_end=1e-3)
    assert_type(single, float | Array)
    peak_force([[bead] * 3] * 2, striker=striker, wall=steel, t_end=1e-3, dt=1e-6)
    for space in (
        Order([bead, bead]),
        Sizes(3, (4e-3, 5e-3), 13e-3, steel),
        Choice(count=3, diameter=5e-3, materials=[steel, materials["ptfe"]]),
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
    assert_type(sweep(abs, [1, 2], checkpoint="sweep.npz"), list[Any])
    return best.beads


def packs(bead: Bead) -> Run:
    steel, striker = materials["steel"], Striker(bead, speed=1)
    cubic = fcc_pack(4, 3, bead=bead, floor=steel, sides=steel, striker=striker, struck=(0, 1))
    assert_type(cubic, Pack)
    planar = hexagonal_pack(
        rows=3, columns=4, bead=[bead] * 11, floor=steel, striker=striker, struck=1,
        offset=(-1, 2.0), direction=np.array([1, -2]), gap=1e-4, contacts="follow",
    )  # fmt: skip
    assert_type(planar.places, Array)
    floor = Wall((0, 0), (0, 1)), steel
    loose = pack([(0.1, 0.1), (0.2, 0.1)], bead, {"floor": floor}, contacts="fixed")
    loose.at_rest({0: (1.0, 0.0)})
    run = simulate(cubic, cubic.start(), 1e-5)
    assert_type(wall_force(run, "floor"), Array)
    wall_force(run, "floor", each=True)
    path = to_lammps(cubic, cubic.start(), 1e-4, 1e-7, "in.beads", every=10)
    assert_type(path, Path)
    assert_type(run_lammps(cubic, cubic.start(), 1e-4, 1e-7, ranks=2, path=path), Run)
    pack([(0.1, 0.1)], "steel")  # type: ignore[arg-type]
    fcc_pack(4, 3, bead=bead, floor="steel")  # type: ignore[arg-type]
    fcc_pack(bead=bead, struck=1)  # type: ignore[arg-type]
    return run
