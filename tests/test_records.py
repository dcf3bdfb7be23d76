"""Records of instruments and programs: one signal in each layout, what is missing or wrong."""

import re

import numpy as np
import pytest

from tensegrity import (
    Chain,
    Drive,
    Potential,
    PowerLaw,
    Prism,
    TensegrityError,
    TimeSeries,
    arrival,
    first_peak,
    fit,
    largest_peak,
    peaks,
    read_record,
    sampled,
    simulate,
    speed,
)

DT, START, COUNT = 4e-7, -1e-4, 1250
T = START + DT * np.arange(COUNT)  # [s]
VOLTS = np.exp(-(((T - 1.5e-4) / 3e-5) ** 2)) + 0.01 * np.random.default_rng(1).normal(size=COUNT)


def rows(*columns, separator=",", end=""):
    return [separator.join(map(repr, map(float, row))) + end for row in zip(*columns, strict=True)]


def tektronix_2000():
    """A header beside the first rows."""
    keys = ["Record Length,1.250000e+03", f"Sample Interval,{DT!r}", "Trigger Point,2.5e+02", "",
            "", "", "Source,CH1", "Vertical Units,V", "Vertical Scale,5.0e-01",
            "Vertical Offset,0.0", "Horizontal Units,s", "Horizontal Scale,5e-05", "Pt Fmt,Y",
            "Yzero,0.0", "Probe Atten,1.0", "Model Number,TDS2014", "Serial Number,C01",
            "Firmware Version,FV:v22.01"]  # fmt: skip
    keys = [(key or ",") + "," for key in keys] + [",,"] * (COUNT - len(keys))
    return [f"{key},{row}," for key, row in zip(keys, rows(T, VOLTS), strict=True)]


def tektronix_4000():
    return ["Model,MSO4034", "Firmware Version,2.48", "", "Point Format,Y,", "Horizontal Units,s,",
            "Horizontal Scale,4e-05,", "Sample Interval,4e-07,", "Record Length,1250,",
            "Gating,0.0% to 100.0%,", "Probe Attenuation,10,1", "Vertical Units,V,V",
            "Vertical Offset,0,0", "Label,,", "TIME,CH1,CH2", *rows(T, VOLTS, 0 * T)]  # fmt: skip


def keysight():
    return ["x-axis,1,2", "second,Volt,Volt", *rows(T, VOLTS, 0 * T)]


def digilent():
    return ["#Digilent WaveForms Oscilloscope Acquisition", "#Device Name: Discovery2",
            "#Date Time: 2024-05-01 10:00:00.0 (UTC)", "#Sample rate: 2.5MHz",
            "#Samples: 1250", "#Trigger: Source: Channel 1", "",
            "Time (s),Channel 1 (V),Channel 2 (V)", *rows(T, VOLTS, 0 * T)]  # fmt: skip


def rigol():
    numbered = [f"{n},{v!r},," for n, v in enumerate(VOLTS.tolist())]
    return ["X,CH1,Start,Increment", f"Sequence,Volt,{START!r},{DT!r}", *numbered]


def rigol_5000():
    return [f"CH1V,t0 = {START!r}s, tInc = {DT!r},", *rows(VOLTS, end=",,")]


def picoscope():
    """Milliseconds and millivolts in a row of units, semicolons and decimal commas."""
    points = rows(1e3 * T, 1e3 * VOLTS, separator=";")
    return ["\ufeffZeit;Kanal A", "(ms);(mV)", "", *(row.replace(".", ",") for row in points)]


LAYOUTS = {
    tektronix_2000: {}, tektronix_4000: {"channel": "CH1"}, keysight: {}, digilent: {},
    rigol: {}, rigol_5000: {"channel": "CH1"}, picoscope: {"channel": "Kanal A"},
}  # fmt: skip


@pytest.mark.parametrize("layout", LAYOUTS)
def test_one_signal_in_the_layouts_of_all_oscilloscopes(tmp_path, layout):
    path = tmp_path / "scope.csv"
    path.write_text("\r\n".join([*layout(), ""]), encoding="utf-8")
    found = read_record(path, **LAYOUTS[layout])
    assert found.t == pytest.approx(T, abs=1e-12)
    assert found.values == pytest.approx(VOLTS, rel=1e-14)
    assert (found.unit, found.lost) == ("V", [])
    assert found.noise == pytest.approx(0.01, rel=0.1)
    force = read_record(path, scale=-20.0, offset=3.0, **LAYOUTS[layout])
    assert force.values == pytest.approx(-20 * VOLTS + 3, rel=1e-13)
    assert (force.unit, force.noise) == ("N", pytest.approx(20 * found.noise, rel=1e-9))


def test_channels_by_name_without_and_with_unit_and_by_number(tmp_path):
    path = tmp_path / "scope.csv"
    path.write_text("\n".join(digilent()))
    for channel in ("Channel 2", "Channel 2 (V)", 2):
        assert not read_record(path, channel).values.any()
    path.write_text("\n".join(digilent()), encoding="utf-16")
    assert read_record(path, "Channel 1", time="Time").values == pytest.approx(VOLTS, rel=1e-14)


def test_instants_that_were_printed_rounded_are_replaced_by_a_clock(tmp_path):
    path = tmp_path / "scope.csv"
    path.write_text(
        "\n".join(["s,V", *(f"{t:.0e},{v:.17g}" for t, v in zip(T, VOLTS, strict=True))])
    )
    with pytest.raises(TensegrityError, match=r"line 3, column 0: .*rounded\? give time=interval"):
        read_record(path)
    found = read_record(path, 1, time=DT)
    assert found.t == pytest.approx(DT * np.arange(COUNT))


def test_lost_samples_are_named_and_nothing_stands_in_for_them(tmp_path):
    lines = keysight()
    lines[12] = lines[12].split(",")[0] + ",9.91E+37,0.0"
    lines[13] = lines[13].split(",")[0] + ",,0.0"
    del lines[100:105]
    path = tmp_path / "scope.csv"
    path.write_text("\n".join(lines))
    found = read_record(path)
    assert len(found) == COUNT - 7
    (first, two), (second, five) = found.lost
    assert (first, two) == (pytest.approx(T[9]), 2)
    assert (second, five) == (pytest.approx(T[97]), 5)
    assert "2 lost after" in str(found)
    assert peaks(found).instant == pytest.approx([1.5e-4], abs=1e-6)
    with pytest.raises(TensegrityError, match=r"2 samples lost after .* cannot be filtered"):
        found.filtered(below=1e5)
    numbered = [one for k, one in enumerate(rigol()) if k not in (50, 51)]
    path.write_text("\n".join(numbered))
    assert [count for _, count in read_record(path).lost] == [2]


LOG = """LAMMPS (2 Aug 2023)
timestep 1e-7
Per MPI rank memory allocation (min/avg/max) = 4.4 | 4.4 | 4.4 Mbytes
   Step          Temp         f_wall
         0   0              0
        10   0.5            1.5
WARNING: something is odd (src/thermo.cpp:1)
        20   0.25           2.5
Loop time of 0.01 on 1 procs for 20 steps with 40 atoms
Per MPI rank memory allocation (min/avg/max) = 4.4 | 4.4 | 4.4 Mbytes
   Step          Temp         f_wall
        20   0.25           2.5
        30   0.125          3.5
Loop time of 0.01 on 1 procs for 10 steps with 40 atoms
"""


def test_tables_of_a_log_of_lammps_are_joined(tmp_path):
    path = tmp_path / "log.lammps"
    path.write_text(LOG)
    found = read_record(path, "f_wall", time=1e-7)
    assert found.t == pytest.approx([0, 1e-6, 2e-6, 3e-6])
    assert found.values.tolist() == [0, 1.5, 2.5, 3.5]
    with pytest.raises(TensegrityError, match="column Step: give the duration of a step, time="):
        read_record(path, "f_wall")
    path.write_text(LOG.replace("Temp", "Time"))
    assert read_record(path, "f_wall", time="Step").t.tolist() == [0, 10, 20, 30]
    with pytest.raises(TensegrityError, match=r"line 8, column Time: time 0\.25 s follows 0.5 s"):
        read_record(path, "f_wall")


def dumped(step, time=None):
    atoms = [f"{k} 1 {0.1 * k} {step + k}" for k in (3, 1, 2)]  # unsorted, as of several processes
    units = ["ITEM: TIME", repr(time)] if time is not None else []
    return ["ITEM: TIMESTEP", str(step), *units, "ITEM: NUMBER OF ATOMS", "3",
            "ITEM: BOX BOUNDS ff ff ff", "0 1", "0 1", "0 1",
            "ITEM: ATOMS id type x fx", *atoms]  # fmt: skip


def test_of_a_dump_the_property_of_an_atom_is_read(tmp_path):
    path = tmp_path / "dump.lammpstrj"
    path.write_text("\n".join(dumped(0) + dumped(50)))
    found = read_record(path, (2, "fx"), time=1e-6)
    assert (found.t.tolist(), found.values.tolist()) == ([0, pytest.approx(5e-5)], [2, 52])
    path.write_text("\n".join(dumped(0, 0.25) + dumped(50, 0.5)))
    assert read_record(path, (2, "fx")).t.tolist() == [0.25, 0.5]
    for channel, words in [
        ((4, "fx"), "no atom 4"), ((2, "fy"), r"names columns \('TIME', 'fy'\)"),
        ("fx", "must be an atom and a property"),
    ]:  # fmt: skip
        with pytest.raises(TensegrityError, match=words):
            read_record(path, channel)


def test_arrays_of_numpy(tmp_path):
    np.save(tmp_path / "two.npy", np.column_stack([T, VOLTS]))
    np.save(tmp_path / "one.npy", VOLTS)
    np.savez(tmp_path / "named.npz", time=T, force=VOLTS, other=0 * T)
    for found in (
        read_record(tmp_path / "two.npy"),
        read_record(tmp_path / "named.npz", "force"),
        read_record(tmp_path / "named.npz", "force", time="time"),
        read_record(tmp_path / "one.npy", time=DT),
    ):
        assert (found.values == VOLTS).all()
        assert np.diff(found.t) == pytest.approx(np.diff(T))
    with pytest.raises(TensegrityError, match="column 'load' is not one of time, force, other"):
        read_record(tmp_path / "named.npz", "load")
    (tmp_path / "broken.npz").write_bytes(b"PK\x03\x04")
    with pytest.raises(TensegrityError, match=r"broken.npz cannot be read"):
        read_record(tmp_path / "broken.npz")


def test_datasets_of_hdf5_with_their_units(tmp_path):
    h5py = pytest.importorskip("h5py")
    with h5py.File(tmp_path / "daq.h5", "w") as file:
        file["run 3/force"], file["run 3/t"] = 1e-3 * VOLTS, 1e3 * T
        file["run 3/force"].attrs["units"], file["run 3/t"].attrs["units"] = "kN", "ms"
    found = read_record(tmp_path / "daq.h5", "run 3/force", time="run 3/t")
    assert found.unit == "N"
    assert found.values == pytest.approx(VOLTS)
    assert found.t == pytest.approx(T)
    with pytest.raises(TensegrityError, match=r"log\.h5 cannot be read"):
        read_record(tmp_path / "log.h5")


def test_frames_of_pandas():
    pd = pytest.importorskip("pandas")
    frame = pd.DataFrame({"time": T, "force": VOLTS})
    by_index = frame.set_index("time")
    late = pd.to_timedelta(T - START, unit="s")
    for found in (read_record(frame), read_record(by_index), read_record(by_index["force"])):
        assert (found.t == T).all()
        assert (found.values == VOLTS).all()
    for index in (late, pd.Timestamp("2024-05-01") + late):
        found = read_record(pd.Series(VOLTS, index), unit="V")
        assert found.t == pytest.approx(T - START, abs=1.1e-9)  # of nanoseconds
    frame.loc[7, "force"] = np.nan
    with pytest.raises(TensegrityError, match="the frame, row 7, column force: nan is not finite"):
        read_record(frame)


@pytest.mark.parametrize(
    ("text", "given", "words"),
    [
        ("s,V\n0,1\n1,nan\n", {}, ", line 3, column 1: 'nan' is no finite number"),
        ("s,V\n0,1\n1,20 mV\n", {}, ", line 3, column 1: '20 mV' is no finite number"),
        ("s,V\n0,1\n2,1\n1,1\n", {}, ", line 4, column 0: time 1 s follows 2 s, must increase"),
        ("V,s\n0,1\n1,1\n", {}, ", column 0: V is no unit of time"),
        ("t (s),F (mV)\ns,V\n0,1\n1,1\n", {}, ", line 2, column 1: unit 'V', but 'mV' in line 1"),
        ("Vertical Units,mV\nTIME (s),CH1 (V)\n0,1\n1,1\n", {}, "line 2, column 1: unit 'V', but"),
        ("s,V\n0,1\n1,2,3\n", {}, ", line 3: 3 columns, must be 2 as in line 2"),
        ("s,V\n0,1\n1,1\n", {"channel": "CH3"}, "no line of the header names columns (0, 'CH3')"),
        ("s,V\n0,1\n1,1\n", {"channel": 2}, "no line has numbers in columns (0, 2)"),
        ("s,V\n0,1\n", {}, "t must increase over 2 instants"),
        ("0;1,5\n1;1.5\n", {}, ", line 2, column 1: 1.5 has a decimal point, values before it a"),
        (
            "X,CH1,Start,Increment\nSequence,Volt,0,x\n0,1,,\n",
            {},
            ", line 2: 'x' of its clock is no number",
        ),
        ("", {}, "0 lines: no line has numbers"),
        ("s,V\n0,1\n1,1\n", {"time": -1.0}, "time -1 s must be above 0"),
        ("s,V\n0,1\n1,1\n", {"scale": np.nan}, "scale"),
    ],
)
def test_what_is_no_record_is_refused_by_file_line_and_column(tmp_path, text, given, words):
    path = tmp_path / "scope.csv"
    path.write_text(text)
    with pytest.raises(TensegrityError, match=re.escape(words)) as caught:
        read_record(path, **given)
    assert str(path) in str(caught.value) or "must be" in words or words == "scale"


def test_a_record_goes_wherever_a_force_of_time_does():
    force = TimeSeries(T, VOLTS, "N")
    assert peaks(force).instant == pytest.approx([1.5e-4], abs=1e-6)
    assert peaks(force).noise == force.noise
    for take in (first_peak, largest_peak):
        assert take(force) == take(T, VOLTS)
    late = TimeSeries(T + 4e-5, VOLTS, "N")
    assert arrival(late) - arrival(force) == pytest.approx(4e-5)
    assert speed((force, late), 0.024) == pytest.approx(600)
    with pytest.raises(TensegrityError, match=r"too few for a peak"):
        arrival(force, after=5e-4)
    smooth = TimeSeries(T, VOLTS - VOLTS + np.exp(-(((T - 1.5e-4) / 3e-5) ** 2)), noise=0.0)
    assert len(sampled(smooth, interval=1e-6)[0]) == 500


def test_a_driven_chain_feels_what_was_recorded():
    pushed = TimeSeries(T, np.exp(-(((T - 1.5e-4) / 3e-5) ** 2)), "N").since(T[0])
    both = [
        Chain(PowerLaw(1e6, 1.0), 3, mass=1e-3, drive={0: Drive(force=force)})
        for force in (pushed, (pushed.t, pushed.values))
    ]
    ends = [simulate(chain, chain.at_rest(), 4e-4, dt=1e-6).final.u for chain in both]
    assert np.abs(ends[0]).max() > 1e-9
    assert (ends[0] == ends[1]).all()


def test_fits_and_springs_take_records():
    prism = Prism(1.0, 0.7, 0.1, 1.0, k_base=20.0, k_bar=20.0)
    t, travel = np.arange(31.0), np.linspace(0.0, 0.3, 31)
    load = -prism.potential().tension(-travel)
    found = fit(TimeSeries(t, travel, "m"), TimeSeries(t, load, "N"), prism, noise=1e-3)
    assert found.values == fit(travel, load, prism, noise=1e-3).values
    with pytest.raises(TensegrityError, match="time series of different instants"):
        fit(TimeSeries(t, travel, "m"), TimeSeries(t + 1, load, "N"), prism)
    r = np.linspace(-1, 1, 31)
    spring = Potential.from_table(TimeSeries(t, r), TimeSeries(t, r + r**3))
    assert spring == Potential.from_table(r, r + r**3)


def test_a_spring_of_a_file_is_that_of_its_columns(tmp_path):
    r = np.linspace(-1, 1, 21)
    path = tmp_path / "spring.csv"
    points = rows(r, r + r**3, separator=";")
    path.write_text("\n".join(["Travel;Force", *(row.replace(".", ",") for row in points)]))
    assert Potential.from_table(path, None) == Potential.from_table(r, r + r**3)
    path.write_text("Travel;Force\n0;1\n1;x\n")
    with pytest.raises(TensegrityError, match=r"spring\.csv, line 3, column 1: 'x' is no finite"):
        Potential.from_table(path, None)


def test_filters_have_the_amplitude_and_phase_that_they_state():
    t = 1e-5 * np.arange(20000)
    wave = np.sin(2 * np.pi * 500 * t)
    series = TimeSeries(t, wave + np.sin(2 * np.pi * 20e3 * t), "V", noise=0.0)
    inside = slice(5000, 15000)
    smooth = series.filtered(below=2000.0)
    assert smooth.values[inside] == pytest.approx(wave[inside], abs=1e-4)  # (1/4)^8 in power
    assert (
        "lowpass 2000 Hz, Butterworth order 4, forward and backward: no phase" in smooth.history[0]
    )
    causal = series.filtered(below=2000.0, zero_phase=False)
    late = float(re.search(r"low frequencies are (\S+) s late", causal.history[0])[1])
    delayed = np.sin(2 * np.pi * 500 * (t - late))
    assert causal.values[inside] == pytest.approx(delayed[inside], abs=0.05)
    assert np.abs(causal.values - wave)[inside].max() > 0.5
    high = series.filtered(above=5000.0)
    assert high.values[inside] == pytest.approx((series.values - wave)[inside], abs=1e-3)
    half = TimeSeries(t, wave, noise=0.0).filtered(below=500.0)
    assert np.abs(half.values[inside]).max() == pytest.approx(0.5, rel=1e-3)
    band = series.filtered(above=100.0, below=2000.0)
    assert band.values[inside] == pytest.approx(wave[inside], abs=1e-3)
    for given in ({}, {"below": 6e4}, {"below": 100.0, "above": 200.0}):
        with pytest.raises(TensegrityError, match="must be one or two, in this order"):
            series.filtered(**given)
    with pytest.raises(TensegrityError, match=r"10 samples cannot be filtered: .* padlen"):
        TimeSeries(t[:10], wave[:10]).filtered(below=2000.0)
    with pytest.raises(TensegrityError, match="not evenly spaced"):
        TimeSeries(t**1.5, wave, noise=0.0).filtered(below=1.0)


def test_a_record_is_drawn_with_its_unit():
    ax = TimeSeries(T, VOLTS, "V").plot()
    assert (ax.get_xlabel(), ax.get_ylabel()) == ("t [s]", "value [V]")
    assert len(ax.lines[0].get_xdata()) == COUNT
