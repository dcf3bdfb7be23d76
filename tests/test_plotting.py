"""Pictures of results: what is drawn is what was computed, on axes that name their units."""

import matplotlib as mpl
import numpy as np
import pytest
from matplotlib.figure import Figure
from networks import patch
from PIL import Image
from scenes import prism_chain, smooth_blow
from structures import icosahedron

import granular
from tensegrity import (
    Prism,
    Record,
    TensegrityError,
    animate,
    control_path,
    equilibrium_path,
    gradient,
    modes,
    objective,
    plates,
    plotting,
    simulate,
    solitary_wave,
)
from tensegrity.animation import moving

mpl.use("Agg")

STEEL = granular.materials["steel"]
BEAD = granular.Bead(5e-3, STEEL)
ELASTIC = Prism(1.0, 0.7, 0.01, 1.0, k_base=10.0, k_bar=100.0)


def chain_run(**record):
    chain = prism_chain(40)
    return simulate(chain, smooth_blow(chain), 20.0, record=Record(**record))


def packed(**options):
    striker = granular.Striker(BEAD, 1.0)
    return granular.hexagonal_pack(3, 4, bead=BEAD, floor=STEEL, sides=STEEL, striker=striker)


def pack_run(scene=None):
    scene = scene or packed()
    record = Record(interval=4e-6)
    return simulate(scene, scene.start(), 4e-5, method="verlet", dt=1e-7, record=record)


def test_run_of_a_chain_shows_energy_over_sites_and_time():
    run = chain_run()
    axes = run.plot()
    assert (axes.get_xlabel(), axes.get_ylabel()) == ("site", "time [s]")
    image = axes.collections[0]
    assert image.get_array().shape == (len(run.t), 40)
    assert image.get_array().max() == run.scene.site_energy(run).max()


def test_a_picture_needs_all_sites():
    run = chain_run(sites=[1, 2])
    with pytest.raises(TensegrityError, match="2 of 40 sites"):
        run.plot()
    with pytest.raises(TensegrityError, match="2 of 40 sites"):
        animate(run, "run.gif")


@pytest.mark.parametrize("dim", [2, 3])
def test_run_of_a_pack_is_a_map_of_the_largest_energies(dim):
    scene = packed()
    if dim == 3:
        scene = granular.fcc_pack(
            2, 3, bead=BEAD, floor=STEEL, sides=STEEL, striker=granular.Striker(BEAD, 1.0)
        )
    run = pack_run(scene)
    axes = run.plot()
    assert axes.get_xlabel() == "x [mm]"
    assert axes.get_ylabel() == ("y [mm]" if dim == 2 else "z [mm]")
    (sites,) = (c for c in axes.collections if c.get_array() is not None)
    order = np.argsort(sites.get_array())
    largest = scene.site_energy(run).max(axis=0)
    assert np.allclose(sites.get_array()[order], np.sort(largest), rtol=1e-15, atol=0)
    assert (order == np.arange(scene.sites)).all()  # the largest is drawn over the others
    places = 1e3 * scene.positions[np.argsort(largest)][:, [0, -1]]
    assert np.allclose(sites.get_offsets(), places, rtol=1e-12, atol=0)
    limits = [axes.get_xlim(), axes.get_ylim()]
    for (low, high), place in zip(limits, places.T, strict=True):
        assert low < place.min() - 2.5  # a radius [mm]: nothing is clipped
        assert high > place.max() + 2.5


def test_forces_in_a_pack_are_lines_as_wide_as_the_force():
    run = pack_run()
    scene, u = run.scene, run.u[6]
    axes = scene.plot(u=u)
    lines = axes.collections[-1]
    force = scene.contact_forces(u)
    carried = np.sort(force[force > 0])
    assert len(lines.get_segments()) == len(carried)
    widths = np.asarray(lines.get_linewidths())
    clear = carried > 0.05 * carried.max()
    assert np.allclose(widths[clear] / widths[-1], carried[clear] / carried[-1], rtol=1e-12)
    assert f"{carried[-1]:.3g} N" in axes.get_title()
    ends = 1e-3 * np.array(lines.get_segments()[-1])  # the strongest contact
    strongest = scene.bonds[int(force[: len(scene.bonds)].argmax())]
    if force.argmax() < len(scene.bonds):
        assert np.allclose(ends, (scene.positions + u)[strongest], rtol=1e-12)
    assert len(axes.lines) == len(scene.walls)
    at_rest = granular.hexagonal_pack(3, 4, bead=BEAD, floor=STEEL, sides=STEEL, gravity=9.81)
    on_the_floor = at_rest.plot().collections[-1].get_segments()
    feet = [s for s in on_the_floor if abs(np.ptp(s[:, 0])) < 1e-9 and abs(s[:, 1]).min() < 1e-9]
    assert len(feet) == len(at_rest.parts["row 3"])


def test_a_structure_shows_slack_strings_and_tensions():
    squeezed = icosahedron()
    squeezed = squeezed.at(squeezed.positions * [1, 1, 0.8])
    assert 0 < squeezed.slack.sum() < squeezed.strings
    axes = squeezed.plot()
    assert axes.name == "3d"
    assert axes.get_zlabel() == "z [m]"
    bars, taut, slack = (c for c in axes.collections if c.get_label()[0] != "_")
    assert [c.get_label() for c in (bars, taut, slack)] == ["bars", "strings", "slack strings"]
    assert (taut.get_array() == squeezed.tensions[squeezed.is_string & ~squeezed.slack]).all()
    counts = [len(c._segments3d) for c in (bars, taut, slack)]
    loose = squeezed.slack.sum()
    assert counts == [squeezed.bars, squeezed.strings - loose, loose]
    with pytest.raises(TensegrityError, match="must have projection='3d'"):
        squeezed.plot(Figure().subplots())
    with pytest.raises(TensegrityError, match="must be of the plane"):
        chain_run().plot(axes)


def test_a_wave_shows_its_peak_at_the_origin():
    wave = solitary_wave(prism_chain().springs[0], speed_ratio=1.5)
    axes = wave.plot(Figure().subplots())
    (line,) = axes.lines
    x, r = line.get_data()
    assert x[np.argmin(r)] == 0
    assert np.isclose(r.min(), wave.amplitude, rtol=1e-12)
    assert axes.get_ylabel() == "elongation [m]"


def test_paths_show_load_against_shortening_and_any_other_pair():
    path = equilibrium_path(ELASTIC)
    supports = plates([0, 1, 2], [3, 4, 5])
    of_structure = equilibrium_path(ELASTIC.structure(), supports=supports, max_shortening=0.05)
    for found in (path, of_structure):
        axes = found.plot()
        assert axes.get_xlabel() == "shortening [m]"
        assert axes.get_ylabel() == "load [N], compression > 0"
        assert (axes.lines[0].get_ydata() == found.load).all()
    own = Figure().subplots()
    assert path.plot(own, x="twist", y="base") is own
    assert (own.get_xlabel(), own.get_ylabel()) == ("twist [rad]", "base [m]")
    drawn_in = control_path(ELASTIC.structure(), {3: 0.7, 4: 0.7, 5: 0.7})
    assert drawn_in.plot().get_xlabel() == "control"
    assert drawn_in.plot(y="tension 3").get_ylabel() == "tension of string 3 [N]"


def test_modes_show_their_shape_and_which_of_how_many_they_are():
    found = modes(prism_chain(20), count=4)
    axes = found.plot(number=2)
    assert (axes.lines[0].get_ydata() == found.shapes[2]).all()
    assert axes.get_legend().get_texts()[0].get_text().startswith("mode 3 of 20: ")
    lattice = modes(patch(3), count=5)
    arrows = lattice.plot(number=4).collections[-1]
    direction = np.stack([arrows.U, arrows.V], axis=1)
    assert np.allclose(direction, lattice.shapes[4])
    structure = ELASTIC.structure()
    drawn = structure.modes(2).plot(number=1)
    assert drawn.get_title().startswith("mode 2 of 12: ")
    assert len(drawn.lines) == len(structure.ends)
    with pytest.raises(TensegrityError, match="number 4 must be below 4"):
        found.plot(number=4)


def test_gradients_show_derivatives_at_sites_and_bonds():
    chain = prism_chain(12)
    wanted = objective.peak(objective.load(bond=5))
    found = gradient(wanted, chain, smooth_blow(chain), 10.0, dt=0.02)
    axes = found.plot()
    assert axes.get_xlabel() == "bond"
    assert (axes.lines[1].get_ydata() == found.by("prestrain")).all()
    masses = found.plot(by="mass")
    assert (masses.get_xlabel(), masses.get_ylabel()) == (
        "site", "derivative by mass [value per kg]",
    )  # fmt: skip
    assert (masses.lines[1].get_ydata() == found.mass).all()
    scene = packed()
    of_pack = gradient(objective.peak(objective.load(bond=3)), scene, scene.start(), 4e-5, dt=1e-7)
    by_bead = of_pack.plot(by="mass").collections[-2]
    assert np.allclose(by_bead.get_array(), of_pack.mass)
    by_contact = of_pack.plot(by="stiffness").collections[-1]
    assert np.allclose(by_contact.get_array(), of_pack.by("stiffness")[: len(scene.bonds)])


FILMS = {"profile": (chain_run, {"show": "velocity"}), "map": (pack_run, {"factor": 50})}


@pytest.mark.parametrize("name", FILMS)
def test_a_film_has_the_frames_that_were_asked_for_and_moves(name, tmp_path):
    make, options = FILMS[name]
    animate(make(), tmp_path / "run.gif", frames=5, rate=10, **options)
    with Image.open(tmp_path / "run.gif") as film:
        assert (film.format, film.n_frames) == ("GIF", 5)
        assert film.info["duration"] == 100
        frames = []
        for number in range(5):
            film.seek(number)
            frames.append(np.asarray(film.convert("RGB"), dtype=int))
    assert all(np.abs(one - frames[0]).max() > 50 for one in frames[1:])
    assert [p.name for p in tmp_path.iterdir()] == ["run.gif"]


@pytest.mark.parametrize("of", ["profile", "map", "axes off"])
def test_a_film_draws_again_what_moves_and_has_the_pixels_of_whole_drawings(of):
    pictures = []
    for whole in (False, True):
        run = pack_run() if of == "map" else chain_run()
        figure = Figure(figsize=(4.13, 3.17), dpi=83, layout="constrained")
        ax = figure.subplots()
        show = moving(run, ax)
        ax.plot([0, 30], ax.get_ylim(), "C1", lw=9, alpha=0.5, zorder=2, label="over it")
        ax.plot([0, 30], ax.get_ylim()[::-1], "C2", lw=9, alpha=0.5, zorder=1, label="below it")
        ax.legend(loc="center")
        ax.text(0.1, 0.5, "a text over what moves", transform=ax.transAxes)
        if of == "axes off":
            ax.set_axis_off()
        given = (lambda row, show=show: show(row) and None) if whole else show
        pictures.append(np.array(list(plotting.drawn(figure, [0, 2, 5, 1], given))))
        assert not any(artist.get_animated() for artist in ax.get_children())
    assert (pictures[0][0] != pictures[0][1]).any()
    np.testing.assert_array_equal(*pictures)


def test_a_pack_is_seen_from_any_side_with_far_beads_behind_and_slow_ones_clear(tmp_path):
    pack = granular.fcc_pack(
        2, 2, bead=BEAD, floor=STEEL, sides=STEEL, striker=granular.Striker(BEAD, 1.0)
    )
    run = simulate(pack, pack.start(), 2e-5, record=Record(interval=1e-5))
    ax, deep = Figure().subplots(), np.tile(pack.positions[:, 1], (3, 1))
    moving(run, ax, deep, view=(-90.0, 0.0))(0)  # along y, as without a view
    disks = ax.collections[0]
    assert (np.diff(disks.get_array()) <= 1e-12).all()  # those behind are drawn first
    seen, places = (np.round(x, 9) for x in (disks.get_offsets(), 1e3 * pack.positions[:, [0, 2]]))
    np.testing.assert_array_equal(*(x[np.lexsort(x.T)] for x in (np.asarray(seen), places)))
    opacity = disks.cmap([0.0, 0.5, 1.0])[:, 3]
    assert opacity[0] < 0.1 < opacity[1] < opacity[2] == 1
    ax = Figure().subplots()
    moving(run, ax, view=(30.0, 90.0))(0)  # from above, turned
    turned = np.asarray(ax.collections[0].get_offsets()) / 1e3
    spans = [np.linalg.norm(x[:, None] - x, axis=-1) for x in (turned, pack.positions[:, :2])]
    np.testing.assert_allclose(*(np.sort(x.ravel()) for x in spans), atol=1e-12)
    animate(run, tmp_path / "pack.gif", view=(-60.0, 20.0))
    assert Image.open(tmp_path / "pack.gif").n_frames == 3
    with pytest.raises(TensegrityError, match=r"view .* of a scene that is not in space"):
        animate(chain_run(), tmp_path / "chain.gif", view=(0.0, 0.0))


def test_values_of_ones_own_colour_the_sites():
    from tensegrity.animation import moving

    run = pack_run()
    values = np.arange(run.v[..., 0].size, dtype=float).reshape(run.v.shape[:2])
    axes = Figure().subplots()
    draw = moving(run, axes, values, label="number", top=1e3, widest=2.0)
    draw(3)
    (sites,) = (c for c in axes.collections if c.get_array() is not None)
    assert (np.sort(sites.get_array()) == values[3]).all()
    assert sites.norm.vmax == 1e3
    assert axes.get_title().startswith("t = 12.00 µs; widest line 2 N")


@pytest.mark.parametrize(
    ("path", "options", "words"),
    [
        ("run.avi", {}, "must end in .gif or .mp4"),
        ("run.mp4", {}, "needs the program ffmpeg"),
        ("run.gif", {"show": "heat"}, "'heat' must be one of elongation, velocity, energy"),
        ("run.gif", {"show": np.zeros((2, 2))}, "shape"),
        ("run.gif", {"frames": 0}, "frames 0 must be at least 1"),
        ("none/run.gif", {}, "cannot be written: No such file"),
    ],
)
def test_what_is_no_film_is_refused(path, options, words, tmp_path, monkeypatch):
    monkeypatch.setenv("PATH", "")
    with pytest.raises(TensegrityError, match=words):
        animate(chain_run(every=500), tmp_path / path, **options)
    assert list(tmp_path.iterdir()) == []
