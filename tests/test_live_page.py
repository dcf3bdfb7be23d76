"""The live page in a browser: every control at the width of a telephone and of a desk, and the loop
of networks against `simulate`."""

import io
import json

import numpy as np
import pytest
from browser import CHROMIUM, Browser

from docs.live import kernel, net
from tensegrity import Chain, Damping, Record, State, simulate

CLOSE = 1e-10  # of the largest displacement and velocity

pytestmark = [
    pytest.mark.slow,
    pytest.mark.skipif(bool(kernel.missing()), reason=kernel.missing() or "there"),
    pytest.mark.skipif(CHROMIUM is None, reason="no Chromium is installed"),
]


@pytest.fixture(scope="module")
def browser():
    with Browser() as found:
        yield found


def shown(browser, page, code="", address=""):
    """What code returns on the page, opened at an address and paused once it has started."""
    browser.open("about:blank")
    browser.open(f"file://{page}#{address}")
    ready = "while (!chain) await new Promise((done) => setTimeout(done, 20)); running(false);"
    return browser.evaluate(f"(async () => {{ {ready} {code} }})()")


MOVE = """const moved = (id, x) => {
  const one = document.getElementById(id);
  if (one.type === "checkbox") one.checked = x;
  else one.value = x;
  one.dispatchEvent(new Event("input", { bubbles: true }));
};
const settings = () => [...document.querySelectorAll("#sliders input:not(:disabled)")].map((one) =>
  [one.id, one.type === "checkbox" ? one.checked : Number(Number(one.value).toFixed(2))]);
"""
MOVED = {"pace": -1, "follow": True, "slow": False, "repeat": False, "height": 0.9, "units": 120,
         "prestrain": -1.5, "preload": 0.01, "blow": -1, "mass": 33, "pull": 0.02}  # fmt: skip


@pytest.mark.parametrize("width", [390, 1400])
def test_every_control_has_its_effect_and_the_address_restores_it(browser, page, width):
    browser.resize(width)
    assert width != 390 or shown(browser, page, """
        const top = (id) => document.getElementById(id).getBoundingClientRect().top;
        return top("prisms") < 250 && top("map") < top("scenes");""")  # fmt: skip
    found = shown(
        browser,
        page,
        f"""{MOVE}
        for (const button of document.querySelectorAll("#scenes button")) {{
          button.click();
          if (chain.name !== button.dataset.scene || !view.running) return button.textContent;
        }}
        document.querySelector('[data-scene="2-3"]').click();
        for (const [id, x] of Object.entries({json.dumps(MOVED)})) moved(id, x);
        running(false);
        const before = chain.time;
        document.getElementById("step").click();
        const one = chain.time;
        moved("time", 500);
        const half = chain.time / chain.last;
        document.getElementById("restart").click();
        running(false);
        return {{ own: chain.own, pluck: chain.pluck, units: chain.units, before, one, half,
                 settings: settings(), address: location.hash,
                 over: document.documentElement.scrollWidth - innerWidth }};""",
    )
    assert browser.complaints == []
    assert found["own"] == pytest.approx(
        {"height": 0.9, "prestrain": 10**-1.5, "preload": 0.01, "blow": 0.1}, rel=3e-3
    )
    assert found["pluck"] == {"site": 33, "pull": pytest.approx(0.02)}
    assert (found["units"], found["over"]) == (120, 0)
    assert found["one"] > found["before"]
    assert found["half"] == pytest.approx(0.5, abs=0.02)
    assert {name: x for name, x in found["settings"] if name != "time"} == MOVED
    again = shown(browser, page, f"{MOVE} return {{ settings: settings(), address: location.hash, "
                  "own: chain.own, pluck: chain.pluck };", found["address"][1:])  # fmt: skip
    assert again == {name: found[name] for name in again}


@pytest.mark.parametrize("width", [390, 1400])
def test_a_drag_plucks_and_so_do_the_arrow_keys(browser, page, width):
    browser.resize(width)
    at = shown(browser, page, """
        seek(20);
        const box = document.getElementById("prisms").getBoundingClientRect();
        const { scale } = view.drawn;
        return { x: box.left + box.width / 2, y: box.top + box.height / 2, scale };""",
        "scene=2-3")  # fmt: skip

    def mouse(kind, x):
        browser.call("Input.dispatchMouseEvent", type=kind, x=x, y=at["y"], button="left",
                     buttons=1, clickCount=1)  # fmt: skip

    pixels = 0.03 * at["scale"]
    mouse("mousePressed", at["x"])
    for part in (0.3, 0.6, 1.0):
        mouse("mouseMoved", at["x"] + part * pixels)
    held = browser.evaluate("[view.running, chain.time, chain.pluck.pull, chain.pluck.site]")
    mouse("mouseReleased", at["x"] + pixels)
    assert held[:2] == [False, 0]
    assert held[2] == pytest.approx(0.03, abs=0.6 / at["scale"])
    assert browser.evaluate("view.running && location.hash.includes(`pluck=${chain.pluck.site}`)")
    browser.evaluate("running(false), document.getElementById('pull').focus()")
    for kind in ("keyDown", "keyUp"):
        browser.call("Input.dispatchKeyEvent", type=kind, key="ArrowRight", code="ArrowRight",
                     windowsVirtualKeyCode=39)  # fmt: skip
    assert browser.evaluate("chain.pluck.pull") == pytest.approx(held[2], abs=0.004)
    assert browser.evaluate("chain.pluck.pull") != held[2]
    assert browser.complaints == []


def test_what_is_read_aloud_is_of_the_state_that_is_shown(browser, page):
    browser.resize(1400)
    found = shown(
        browser,
        page,
        """
        const said = [];
        for (const time of [20, 60, 10]) {
          seek(time);
          said.push([chain.time, document.getElementById("summary").textContent]);
        }
        seek(chain.last);
        document.getElementById("repeat").checked = false;
        running(true);
        await new Promise((done) => setTimeout(done, 600));
        said.push([chain.time, document.getElementById("summary").textContent]);
        const named = (one) => one.ariaLabel || one.labels?.length || one.textContent;
        const nameless = [...document.querySelectorAll("canvas, input, button")].filter((one) =>
          one.offsetParent && !named(one));
        return { said, nameless: nameless.map((one) => one.id) };""",
    )
    for time_, words in found["said"]:
        assert f" at {time_:.0f} s." in words
    assert "ended" in found["said"][-1][1]
    assert found["nameless"] == []


def test_going_back_and_on_gives_the_states_of_the_run(browser, page):
    browser.resize(1400)
    found = shown(
        browser,
        page,
        """
        const state = () => [chain.time, ...chain.u, ...chain.v];
        const leading = () => [chain.leader().bond, chain.leader().speed];
        seek(20);
        const first = leading();
        seek(50);
        const last = state(), lead = leading();
        seek(20);
        const early = state(), before = leading();
        seek(50);
        const back = state(), again = leading();
        seek(20);
        running(true);
        running(false);
        for (let k = 0; chain.time < back[0] - 1e-9 && k < 1e4; k++) chain.run(chain.steps);
        return { last, early, back, resumed: state(), lead, again, first, before };""",
        "scene=2-3",
    )
    assert found["back"] == found["last"]
    assert found["again"] == found["lead"]
    assert found["before"] == found["first"]
    assert found["early"][0] < 21
    assert np.abs(np.array(found["resumed"]) - found["last"]).max() < 1e-8


@pytest.mark.parametrize("width", [390, 1400])
def test_the_loop_of_networks_moves_beads_and_discs_as_simulate_does(browser, page, width):
    browser.resize(width)
    for name, given in net.scenes().items():
        found = shown(
            browser,
            page,
            f"""
            await net.open(true, {json.dumps(name)});
            net.run(false);
            net.load(net.name, 0);
            net.advance(400);
            net.draw();
            net.say();
            return {{ u: [...net.row("u")], v: [...net.row("v")], dt: net.given.dt,
                     over: document.documentElement.scrollWidth - innerWidth,
                     words: document.getElementById("net-summary").textContent,
                     clock: net.clock() }};""",
        )
        time_ = 400 * found["dt"]
        if "drag" in given:  # halves of the dashpots around a step: an error of second order
            ground = Chain(given["scene"].springs[0], net.DISCS, ground=net.unit(),
                           damping=Damping(ground=net.DASHPOT))  # fmt: skip
            start = State(given["start"].u[: net.DISCS, 0], given["start"].v[: net.DISCS, 0])
            run = simulate(ground, start, time_, tol=1e-7)
            u = np.array(found["u"]).reshape(-1, 2)[: net.DISCS, 0]
            assert np.abs(u - run.final.u).max() < 2e-3 * np.abs(u).max()
        else:
            run = simulate(given["scene"], given["start"], time_, method=kernel.METHOD,
                           dt=found["dt"], record=Record(every=400))  # fmt: skip
            shape = run.final.u.shape
            both = {k: np.array(found[k]).reshape(shape) for k in "uv"}
            for one, wanted in ((both["u"], run.final.u), (both["v"], run.final.v)):
                assert np.abs(one - wanted).max() <= CLOSE * np.abs(wanted).max(), name
        assert f"{name}, paused at {found['clock']}" in found["words"]
        assert found["over"] == 0
    assert browser.complaints == []


def test_controls_of_the_second_tab_and_its_address(browser, page):
    browser.resize(1400)
    found = shown(
        browser,
        page,
        f"""{MOVE}
        document.getElementById("tab-net").click();
        await new Promise((done) => setTimeout(done, 400));
        for (const button of document.querySelectorAll("#net-scenes button")) {{
          button.click();
          if (net.name !== button.dataset.scene || !net.running) return button.textContent;
        }}
        moved("hit", -0.8);
        const running_ = net.running;
        document.getElementById("net-run").click();
        document.getElementById("net-restart").click();
        net.run(false);
        return {{ hit: net.hit, address: location.hash, running_, paused: net.running }};""",
    )
    assert found["hit"] == pytest.approx(10**-0.8, rel=5e-3)
    assert found["running_"] is True
    assert found["paused"] is False
    again = shown(browser, page, """await new Promise((done) => setTimeout(done, 400));
        return [net.name, net.hit, document.getElementById("chain").hidden];""",
        found["address"][1:])  # fmt: skip
    assert again == ["Switching front", pytest.approx(found["hit"], rel=3e-3), True]


def test_files_hold_the_state_and_the_pictures(browser, page):
    browser.resize(1400)
    text, size = shown(
        browser,
        page,
        """
        const saved = {};
        save = (blob, name) => { saved[name] = blob; };
        seek(30);
        document.getElementById("csv").click();
        document.getElementById("png").click();
        for (let k = 0; k < 50 && !saved["chain.png"]; k++)
          await new Promise((done) => setTimeout(done, 100));
        const bitmap = await createImageBitmap(saved["chain.png"]);
        return [await saved["chain.csv"].text(), [bitmap.width, bitmap.height]];""",
    )
    rows = np.loadtxt(io.StringIO(text), delimiter=",", skiprows=2)
    assert rows.shape == (201, 3)
    assert np.abs(rows[:, 1]).max() > 0.01
    assert min(size) > 400


def test_a_blow_over_the_barrier_switches_all_discs_and_a_weaker_one_none(browser, page):
    found = shown(browser, page, """
        await net.open(true, "Switching front");
        net.run(false);
        return [0.1, 0.15].map((hit) => {
          net.load(net.name, hit);
          net.advance(Math.ceil(net.given.last / net.given.dt));
          return net.switched();
        });""")  # fmt: skip
    assert found == [0, net.DISCS]
