"""The live chain: its numbers, computed by WebAssembly, are those of `simulate`."""

import ctypes
import html
import json
import re
import shutil
import subprocess
import threading
import time
from http.server import BaseHTTPRequestHandler, ThreadingHTTPServer

import numpy as np
import pytest
from test_native import COMPILER

from docs.live import kernel, tables
from docs.live.__main__ import LARGEST, main
from tensegrity import (
    Chain,
    Polynomial,
    Prism,
    Record,
    State,
    TensegrityError,
    equilibrium_path,
    floquet,
    phase_shift,
    simulate,
    solitary_wave,
)
from tensegrity.prisms.closed import rigid_programs

NODE = shutil.which("node")
BROWSER = next(
    filter(None, map(shutil.which, ("chromium", "chromium-browser", "google-chrome"))), None
)
STEPS = 2000
CLOSE = 1e-10  # of the largest displacement and velocity

needs_zig = pytest.mark.skipif(bool(kernel.missing()), reason=kernel.missing() or "there")
needs_node = pytest.mark.skipif(NODE is None, reason="node is not installed")
needs_browser = pytest.mark.skipif(BROWSER is None, reason="no Chromium is installed")

DRIVER = """
const fs = require("fs"), text = fs.readFileSync(process.argv[2], "utf8");
const model = text.split('<script id="model">')[1].split("</script>")[0];
const data = text.match(/const TABLES = (.*);/)[1], code = text.match(/const CODE = "(.*)";/)[1];
const made = { exports: {} };
new Function("module", model)(made);
made.exports.started(code, JSON.parse(data)).then((chain) => {
  const found = JSON.parse(process.argv[3]).map(([answers, steps, peaks]) => {
    const refused = chain.set(answers), parameters = Array.from(
      new Float64Array(chain.c.memory.buffer, chain.c.parameters(0), 19));
    const ended = chain.run(steps), finite = (x) => Array.from(x, (y) => (isFinite(y) ? y : "no"));
    const lead = chain.leader();
    return { refused, ended, parameters, dt: chain.dt, halved: chain.halved, time: chain.time,
             u: finite(chain.u), v: finite(chain.v), error: chain.energy_error, lead,
             exact: lead && chain.exact(lead.peak), shift: chain.shift, sent: chain.transmitted,
             shape: chain.shape(), last: chain.last, advice: chain.message,
             waves: (peaks || []).map((x) => chain.exact(x)) };
  });
  console.log(JSON.stringify(found));
});
"""


def largest_gap(found, run):
    """Largest difference over the largest number, of displacements and velocities."""
    pairs = ((found["u"], run.final.u), (found["v"], run.final.v))
    return max(float(np.abs(np.array(x) - y).max() / np.abs(y).max()) for x, y in pairs)


def in_python(chain, state, dt):
    """The same steps by `simulate`."""
    record = Record(every=STEPS)
    return simulate(chain, state, STEPS * dt, method=kernel.METHOD, dt=dt, record=record)


def test_programs_are_c_that_rounds_to_the_numbers_taken_elsewhere(tmp_path):
    """In the platform's long double, at least 64 bits here: at most one place off of a double."""
    if np.finfo(np.longdouble).nmant < 63:
        pytest.skip("long double is no wider than double")
    made = rigid_programs()
    source = "#include <math.h>\n" + kernel.program_text("numbers", made["parameters"])
    source += """
    void rounded(const double *x, double *y) {
        long double given[8], found[19];
        for (int i = 0; i < 8; i++) given[i] = x[i];
        numbers(given, found);
        for (int i = 0; i < 19; i++) y[i] = found[i];
    }"""
    (tmp_path / "it.c").write_text(source)
    command = [*COMPILER, "-shared", "-fPIC", str(tmp_path / "it.c"), "-o", str(tmp_path / "it.so")]
    subprocess.run([*command, "-lm"], check=True)
    call = ctypes.CDLL(str(tmp_path / "it.so")).rounded
    for height, prestrain in ((0.7, 0.01), (0.6, 1e-3), (1.3, 0.1)):
        given = np.array([1.0, height, prestrain, 2.0, np.inf, np.inf, height, 0.0])
        found = np.empty(19)
        call(*(ctypes.c_void_p(x.ctypes.data) for x in (given, found)))
        wanted = Prism(1.0, height, prestrain, 2.0).potential().values
        assert np.abs(found - wanted).max() <= 1e-15  # what is zero at the reference comes so close
        large = np.abs(wanted) > 1e-10
        assert np.all(np.abs(found - wanted)[large] <= np.spacing(np.abs(wanted[large])))


def test_page_says_what_is_missing(monkeypatch, capsys, tmp_path):
    monkeypatch.setattr(kernel, "missing", lambda: "there is no compiler")
    assert main([str(tmp_path / "page.html")]) == 1
    assert "no page: there is no compiler" in capsys.readouterr().err
    for words, code in ((["--help"], 0), (["a", "b"], 2), (["--no"], 2)):
        with pytest.raises(SystemExit) as left:
            main(words)
        assert left.value.code == code
    assert list(tmp_path.iterdir()) == []


@pytest.fixture(scope="module")
def ask(page):
    """What the page's own model, run by node, says of scenes after so many steps."""
    driver = page.with_name("driver.js")
    driver.write_text(DRIVER)

    def answers(*questions):
        command = [NODE, str(driver), str(page), json.dumps(questions)]
        answer = subprocess.run(command, capture_output=True, text=True, check=True, timeout=300)
        return json.loads(answer.stdout)

    return answers


@pytest.mark.slow
@needs_zig
def test_page_is_one_file_without_a_network(page):
    text = page.read_text()
    assert len(text.encode()) < LARGEST
    others = r'(src|href)="(?!data:|guide/index.html")|https?://|@import|/\*[A-Z]+\*/'
    assert not re.search(others, text)


@pytest.mark.slow
@needs_zig
@needs_node
def test_state_after_2000_steps_is_that_of_simulate(ask):
    found = ask(*([{"scene": name}, STEPS] for name in tables.SCENES))
    for name, one in zip(tables.SCENES, found, strict=True):
        assert (one["refused"], one["ended"], one["halved"]) == ("", "", 0)
        run = in_python(*tables.scene(name), one["dt"])
        assert one["time"] == pytest.approx(run.t[-1], rel=1e-12)
        assert largest_gap(one, run) <= CLOSE, name
        assert one["error"] == pytest.approx(run.energy_error, abs=1e-5)


OWN = (
    {"height": 0.25, "prestrain": 0.1, "preload": 0.001, "blow": 0.01},
    {"height": 0.9, "prestrain": 0.003, "preload": 0.0, "blow": 0.08},
    {"height": 0.7, "prestrain": 0.02, "preload": 0.01, "blow": 0.05},
    {"height": 0.35, "prestrain": 0.1, "preload": 0.0, "blow": 0.01},
    {"height": 1.6, "prestrain": 0.3, "preload": 0.1, "blow": 0.2},
)


@pytest.mark.slow
@needs_zig
@needs_node
def test_slider_values_make_the_same_chain_as_python(ask):
    found = ask(*([{"scene": "2-3", "units": 120, "own": own}, STEPS] for own in OWN))
    for own, one in zip(OWN, found, strict=True):
        assert (one["refused"], one["ended"]) == ("", "")
        spring = Prism(1.0, own["height"], own["prestrain"], 1.0).potential(own["preload"])
        assert one["parameters"] == pytest.approx(spring.values.tolist(), rel=2e-15, abs=1e-15)
        chain = Chain(spring, 121)
        run = in_python(chain, chain.at_rest({0: own["blow"]}), one["dt"] / 2 ** one["halved"])
        if one["halved"] == 0:
            assert largest_gap(one, run) <= CLOSE, own


@pytest.mark.slow
@needs_zig
@needs_node
def test_blows_too_hard_and_preloads_too_large_are_said_not_nan(ask):
    hard = {"height": 0.7, "prestrain": 0.01, "preload": 0.0, "blow": 1.0}
    flat = {"height": 0.25, "prestrain": 0.01, "preload": 0.0, "blow": 1.0}
    heavy = {"height": 0.25, "prestrain": 0.01, "preload": 0.09, "blow": 0.1}
    locked, gone, refused = ask(
        *([{"scene": "2-3", "own": own}, 3000] for own in (hard, flat, heavy))
    )
    assert re.match(r"Unit 1 is at the end of its domain: the bars meet", locked["ended"])
    assert "Lower the impact velocity" in locked["ended"]
    assert "Lower the preload" in refused["refused"]
    assert "the prism is flat" in gone["ended"]
    assert "No state of this prism carries a preload of 0.09 N" in refused["refused"]
    for one in (locked, gone, refused):
        assert "no" not in one["u"] + one["v"]


@pytest.mark.slow
@needs_zig
@needs_node
def test_leading_pulse_is_as_fast_as_the_exact_wave_of_its_crest(ask):
    (one,) = ask([{"scene": "12.16"}, 900])
    spring = tables.FAST
    sound = float(spring.potential().stiffness(0.0)) ** 0.5
    assert one["lead"]["speed"] == pytest.approx(one["exact"]["speed"], rel=3e-3)
    assert one["lead"]["speed"] / sound == pytest.approx(12.16, abs=0.1)


@pytest.mark.slow
@needs_zig
@needs_node
def test_a_plucked_mass_moves_as_in_simulate_and_is_not_pulled_beyond_the_domain(ask):
    questions = ({"scene": name, "pluck": {"site": 40, "pull": 0.01}} for name in tables.SCENES)
    names = list(tables.SCENES)
    for name, one in zip(names, ask(*([x, STEPS] for x in questions)), strict=True):
        chain, state = tables.scene(name)
        u = np.zeros(chain.sites)
        u[40] = 0.01
        run = in_python(chain, State(u, 0 * state.v), one["dt"])
        if one["halved"] == 0:
            assert largest_gap(one, run) <= CLOSE, name
    far = {"scene": "2-3", "pluck": {"site": 40, "pull": 5.0}}
    (far,) = ask([far, 0])
    assert max(far["u"]) == pytest.approx(-0.9 * tables.SLOW.potential().domain[0])


@pytest.mark.slow
@needs_zig
@needs_node
def test_phase_shift_and_transmitted_energy_are_those_of_the_package(ask):
    chain, state = tables.scene("collision")
    (first,) = ask([{"scene": "collision"}, 0])
    steps = round(85.0 / first["dt"])
    found, sent = ask([{"scene": "collision"}, steps], [{"scene": "hard-soft"}, STEPS])
    run = simulate(chain, state, steps * first["dt"], method=kernel.METHOD, dt=first["dt"],
                   record=Record(every=steps))  # fmt: skip
    spring, ratio = tables.WAVES["medium 1.6"]
    wave = solitary_wave(spring.potential(), speed_ratio=ratio)
    assert found["shift"] == pytest.approx(phase_shift(run, wave, wave)[0], abs=2e-3)
    chain, state = tables.scene("hard-soft")
    final = in_python(chain, state, sent["dt"]).final
    bonds = chain.bond_energy(final.u)
    middle = (chain.sites - 1) // 2
    wanted = (bonds[middle:].sum() + (final.v[middle:] ** 2).sum() / 2) / chain.energy(state)
    assert sent["sent"] == pytest.approx(wanted, rel=1e-8)


@pytest.mark.slow
@needs_zig
@needs_node
def test_drawn_twists_and_bases_are_those_of_the_equilibrium_path(ask):
    preloaded = {"height": 0.7, "prestrain": 0.02, "preload": 0.01, "blow": 0.05}
    flat = {"height": 0.25, "prestrain": 0.1, "preload": 0.001, "blow": 0.01}
    springs = [Prism(1.0, x["height"], x["prestrain"], 1.0) for x in (preloaded, flat)]
    one, two, three = ask([{"scene": "2-3", "own": preloaded}, 300],
                          [{"scene": "2-3", "own": flat}, 300],
                          [{"scene": "softening"}, 300])  # fmt: skip
    for found, prism in zip((one, two, three), [*springs, kernel.ELASTIC_PRISM], strict=True):
        height = np.diff(found["shape"]["place"])
        path = equilibrium_path(prism, max_height=1.001 * max(prism.height, height.max()))
        order = np.argsort(path.height)
        for name in ("twist", "base"):
            wanted = np.interp(height, path.height[order], getattr(path, name)[order])
            assert np.abs(np.array(found["shape"][name]) - wanted).max() < 2e-4, name
        assert np.ptp(found["shape"]["twist"]) > 0.005


@pytest.mark.slow
@needs_zig
@needs_node
def test_verdicts_are_those_of_the_package(ask):
    for spring, ratio in tables.WAVES.values():
        assert floquet(solitary_wave(spring.potential(), speed_ratio=ratio)).stable
    spring = tables.SLOW.potential()
    peaks = [part * spring.domain[0] for part in (0.2, 0.6, 0.95)]
    (one,) = ask([{"scene": "2-3"}, 0, peaks])
    for peak, found in zip(peaks, one["waves"], strict=True):
        assert found["slope"] == pytest.approx(
            solitary_wave(spring, amplitude=peak).energy_slope, rel=0.01
        )


SLIDERS = (  # height, prestrain, preload
    (0.7, 0.01, 0.0), (0.35, 0.1, 0.0), (1.6, 0.3, 0.1), (2.0, 1e-4, 0.0), (1.2, 1e-4, 0.1),
    (0.2, 1e-4, 0.0), (0.25, 0.1, 0.001),
)  # fmt: skip
PARTS = (0.02, 0.3, 0.6, 0.97)  # of the way to an end of the domain
NEAR = 5e-5  # of the peak: what is drawn, and of the speed


def close_to_the_wave(found, spring, peak):
    """Whether the page's wave of a peak is that of `solitary_wave`, or neither has one."""
    try:
        wave = solitary_wave(spring, amplitude=peak)
    except TensegrityError:
        return found is None
    x = np.arange(len(found["elongation"])) * found["step"]
    off = np.abs(np.array(found["elongation"]) - wave.elongation(x) / peak)
    slower = np.abs(np.array(found["velocity"]) / wave.speed + wave.rate(x) / peak)
    return (
        found["speed"] == pytest.approx(wave.speed, rel=NEAR)
        and max(off.max(), slower.max()) <= NEAR
        and abs(found["elongation"][-1]) < 2 * NEAR
    )


@pytest.mark.slow
@needs_zig
@needs_node
def test_exact_wave_is_that_of_solitary_wave_wherever_the_sliders_stand(ask):
    springs = [Prism(1.0, h, p, 1.0).potential(load) for h, p, load in SLIDERS]
    peaks = [[part * spring.domain[0] for part in PARTS] for spring in springs]
    names = ("height", "prestrain", "preload", "blow")
    questions = [
        [{"scene": "2-3", "own": dict(zip(names, (*own, 0.1), strict=True))}, 0, mine]
        for own, mine in zip(SLIDERS, peaks, strict=True)
    ]
    for spring, mine, one in zip(springs, peaks, ask(*questions), strict=True):
        for peak, found in zip(mine, one["waves"], strict=True):
            assert close_to_the_wave(found, spring, peak), (spring, peak)
    none, some = (
        [wave is None for wave in one["waves"]] for one in ask(questions[-1], questions[0])
    )
    assert all(none)  # it softens under compression
    assert not any(some)


@pytest.mark.slow
@needs_zig
@needs_node
def test_exact_rarefaction_of_the_softening_scene(ask):
    low, high = kernel.ELASTIC.domain
    spring = Polynomial(kernel.ELASTIC, 0.6 * low, 0.9 * high)
    peaks = [0.02 * high, 0.09 * high]
    (one,) = ask([{"scene": "softening"}, 0, peaks])
    for peak, found in zip(peaks, one["waves"], strict=True):
        assert close_to_the_wave(found, spring, peak)


def opened(path, *flags):
    """The document that Chromium makes of a page, and what it complains of."""
    command = [BROWSER, "--headless", "--no-sandbox", "--disable-gpu", "--enable-logging=stderr",
               "--virtual-time-budget=8000", *flags, "--dump-dom", path]  # fmt: skip
    answer = subprocess.run(command, capture_output=True, text=True, timeout=180)
    return answer.stdout, [x for x in answer.stderr.splitlines() if "CONSOLE" in x]


@pytest.mark.slow
@needs_zig
@needs_browser
def test_browser_shows_the_state_of_simulate_and_complains_of_nothing(page):
    text, complaints = opened(f"file://{page}#scene=collision&steps={STEPS}")
    assert complaints == []
    shown = html.unescape(re.search(r'<pre id="numbers"[^>]*>(.*?)</pre>', text, re.S)[1])
    head, _, *rows = shown.splitlines()
    table = np.array([row.split(",") for row in rows], dtype=float)
    dt = float(re.search(r"step (\S+) s", head)[1])
    run = in_python(*tables.scene("collision"), dt)
    assert largest_gap({"u": table[:, 1], "v": table[:, 2]}, run) <= CLOSE
    assert 'aria-pressed="true">Collision' in text
    assert "Energy error" in text


@pytest.mark.slow
@needs_zig
@needs_browser
@pytest.mark.parametrize("width", [400, 1400])
def test_page_needs_no_horizontal_scrolling_and_its_sliders_work(page, width):
    """A copy that moves a slider and says how wide it is."""
    check = """<script>addEventListener("load", () => setTimeout(() => {
      document.querySelector('[data-scene="softening"]').click();
      document.querySelector('[data-scene="2-3"]').click();
      const slider = document.getElementById("height");
      slider.value = 0.9;
      slider.dispatchEvent(new Event("input"));
      const root = document.documentElement;
      document.title = [root.scrollWidth <= innerWidth, innerWidth, chain.own.height].join(" ");
    }, 500))</script>"""
    copy = page.with_name(f"copy{width}.html")
    copy.write_text(page.read_text().replace("</body>", check + "</body>"))
    text, complaints = opened(f"file://{copy}", f"--window-size={width},1000")
    assert complaints == []
    fits, wide, height = re.search("<title>(.*?)</title>", text)[1].split()
    assert (fits, float(height)) == ("true", 0.9)
    assert int(wide) <= max(width, 500)  # some browsers have a least width
    assert "Your own chain" in text


FRAMES = """<script>document.addEventListener("DOMContentLoaded", () => setTimeout(() => {
  document.querySelector('[data-scene="2-3"]').click();
  const units = document.getElementById("units"), height = document.getElementById("height");
  units.value = 400;
  units.dispatchEvent(new Event("input"));
  height.value = 0.72;
  height.dispatchEvent(new Event("input"));
  const spent = [], plain = advance, begun = performance.now();
  let frames = 0;
  advance = () => { const t = performance.now(); plain(); spent.push(performance.now() - t); };
  const tick = (now) => {
    frames++;
    if (now - begun < SECONDS * 1000) return requestAnimationFrame(tick);
    spent.sort((a, b) => a - b);
    document.title = [chain.units, frames / (now - begun) * 1000, spent.length,
                      spent[Math.floor(spent.length / 2)],
                      chain.exact(0.3 * chain.c.end(0, 0)) ? 1 : 0, chain.time].join(" ");
  };
  requestAnimationFrame(tick);
}, 300))</script><img src="http://127.0.0.1:PORT/" alt="">"""


class Late(BaseHTTPRequestHandler):
    """Answers late: until then a page is not loaded, and runs in its own time."""

    def do_GET(self):
        time.sleep(9)
        self.send_response(204)
        self.end_headers()

    def log_message(self, *given):
        pass


@pytest.mark.slow
@needs_zig
@needs_browser
def test_400_units_are_computed_and_drawn_in_less_than_a_frame(page):
    """The work of a frame can be promised; how many frames come is the machine's."""
    with ThreadingHTTPServer(("127.0.0.1", 0), Late) as server:
        threading.Thread(target=server.serve_forever, daemon=True).start()
        more = FRAMES.replace("PORT", str(server.server_port)).replace("SECONDS", "5")
        copy = page.with_name("frames.html")
        copy.write_text(page.read_text().replace("</body>", more + "</body>"))
        command = [BROWSER, "--headless", "--no-sandbox", "--disable-gpu", "--dump-dom",
                   "--window-size=1400,1000", f"file://{copy}"]  # fmt: skip
        text = subprocess.run(command, capture_output=True, text=True, timeout=180).stdout
        server.shutdown()
    units, rate, worked, spent, has_wave, reached = map(
        float, re.search("<title>(.*?)</title>", text)[1].split()
    )
    print(f"\n400 units: {rate:.1f} frames a second, {spent:.2f} ms of work in a frame")
    assert (units, has_wave) == (400, 1)
    assert worked > 20
    assert reached > 0
    assert spent < 1000 / 60
