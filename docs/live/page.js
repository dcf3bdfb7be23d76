"use strict";
/* The page: sliders, pictures and words around a chain of `Chain`. */

const $ = (id) => document.getElementById(id);
const OWN = ["height", "prestrain", "preload", "blow"];
const PLUCK = ["mass", "pull"];
const CHECKS = ["follow", "slow", "repeat"];
const POWERS = { prestrain: true, blow: true, hit: true };  // sliders of the decimal logarithm
const UNITS = { height: " m", prestrain: "", preload: " N", blow: " m/s", pull: " m", hit: " m/s" };
const SPOKEN = 4000;      // ms between summaries, so that they can be listened to
const USED = 0.5;         // of a range: less, and it shrinks
const TRAIL = 24;         // frames that stay visible around a pulse
const WRITTEN = 120;      // ms between changes of the numbers
const BUDGET = 9;         // ms of a frame that the chain may take
const DRAWN = 12;         // prisms that are drawn
const WINDOW = 60;        // units in the window that follows the peak
const SLOWER = 1 / 6;     // of the speed of display, while waves meet
const WAIT = 2000;        // ms from the end of a run to its next start
const COLOURS = ["ground", "panel", "ink", "soft", "line", "chain", "exact", "sech", "tent"];

const view = { running: false, tops: {}, sizes: {}, written: -Infinity, spoken: -Infinity, own: null, shown: "" };
let chain = null;

/* ---- numbers in words ---- */

const digits = (x, n = 3) => (x === 0 ? "0" : Math.abs(x) < 1e-3 || Math.abs(x) >= 1e4
  ? x.toExponential(n - 1).replace(/e([+-])(\d)$/, "e$10$2") : String(Number(x.toPrecision(n))));
const minus = (text) => text.replace(/-/g, "−");

function value(name) {
  const x = Number($(name).value);
  return POWERS[name] ? Number((10 ** x).toPrecision(3)) : x;
}

function put(name, x) {
  $(name).value = POWERS[name] ? Math.log10(x) : x;
  label(name, x);
}

function label(name, x) {
  const text = digits(x) + (UNITS[name] || "");
  $(`${name}-value`).textContent = text;
  $(name).setAttribute("aria-valuetext", text);
}

/* ---- scenes ---- */

function load(scene, units, own, pluck) {
  clearTimeout(view.again);
  view.own = own || null;
  chain.set({ scene, units, own: view.own, pluck });
  view.tops = {};
  view.trail = [];
  view.over = false;
  view.focus = null;
  const c = chain.c, most = chain.waves.length
    ? 1.4 * Math.max(...chain.waves.map(({ wave }) => Math.abs(TABLES.waves[wave].peak)))
    : 0.8 * Math.max(c.reached(0, chain.energy, 1), -c.reached(0, chain.energy, 0));
  view.top = most / chain.lengths[0] || 1;
  remap();
  const given = chain.scene, spring = chain.springs[0];
  for (const button of $("scenes").children)
    button.setAttribute("aria-pressed", String(!own && button.dataset.scene === scene));
  $("note").textContent = chain.pluck ? "One mass was pulled aside and let go; all else was at rest." : own
    ? "Your own chain: equal rigid prisms, one mass of which is struck or plucked." : given.note;
  for (const name of OWN.slice(0, 3)) {
    put(name, spring[name]);
    $(name).disabled = !own && (spring.elastic || Boolean(given.far));
  }
  put("blow", chain.blow);
  $("blow").disabled = $("height").disabled;
  $("units").value = chain.units;
  label("units", chain.units);
  $("mass").max = chain.units;
  if (chain.pluck) put("mass", chain.pluck.site);
  put("mass", value("mass"));
  put("pull", chain.pluck ? chain.pluck.pull : 0);
  $("fixed").textContent = $("height").disabled ? (spring.elastic
    ? "This prism has elastic members and was computed in advance, so its sliders are disabled."
    : "This chain consists of two kinds of prism, so its sliders are disabled.")
    : !own && chain.waves.length ? "Moving a slider replaces the exact wave by an impact." : "";
  address();
  say();
  draw();
}

function moved(name) {
  const own = { height: value("height"), prestrain: value("prestrain"),
                preload: value("preload"), blow: value("blow") };
  const units = Number($("units").value), given = value("pull");
  const pluck = given && name !== "blow" ? { site: value("mass"), pull: given } : null;
  load(chain.name, units, ["units", ...PLUCK].includes(name) ? view.own : own, pluck);
}

function again() { load(chain.name, chain.units, view.own, chain.pluck); }

/* ---- running ---- */

function running(on) {
  clearTimeout(view.again);
  if (on && view.over) again();
  view.running = on && !chain.ended;
  $("run").textContent = view.running ? "Pause" : "Run";
  if (view.running) requestAnimationFrame(frame);
  say();
}

function frame() {
  if (!view.running) return;
  advance();
  if (chain.ended || chain.time >= chain.last) {
    running(false);
    view.over = true;
    say();
    if ($("repeat").checked) view.again = setTimeout(() => running(true), WAIT);
  } else requestAnimationFrame(frame);
}

function advance() {
  const slowed = $("slow").checked && chain.meeting;
  const pace = 2 ** Number($("pace").value) * (slowed ? SLOWER : 1);
  view.left = (view.left || 0) + chain.steps * pace;
  const whole = Math.floor(view.left);
  view.left -= whole;
  chain.run(whole, performance.now() + BUDGET, () => performance.now());
  view.map.add(chain.time, strains(), view.colour);
  draw();
  if (performance.now() - view.spoken > SPOKEN) say();
}

function seek(time) {
  running(false);
  chain.seek(time);
  view.over = false;
  if (!chain.past) remap();
  say();
  draw();
}

/* ---- words ---- */

const sounds = (speed) => (chain.sound > QUIET ? `${digits(speed / chain.sound, 4)} × the sound speed`
  : `${digits(speed, 4)} units/s`);

/* Text of an element, which is laid out anew only where that changes. */
function put_text(id, words) {
  if ($(id).textContent !== words) $(id).textContent = words;
}

function facts(overlays) {
  const lead = chain.leader();
  const single = overlays.length === 1 ? overlays[0] : null;
  put_text("time-value", `${chain.time.toFixed(1)} s`);
  $("time").value = 1000 * chain.time / chain.last;
  $("time").setAttribute("aria-valuetext", `${chain.time.toFixed(1)} of ${chain.last.toFixed(0)} s`);
  put_text("fact-energy", digits(chain.energy_error, 2));
  put_text("fact-sound", chain.sound > QUIET
    ? `${digits(chain.sound, 4)} units/s` : chain.dt ? "0: a sonic vacuum" : "–");
  put_text("fact-speed", lead ? sounds(lead.speed) : "–");
  const exact = overlays.length && overlays[0].wave;
  put_text("fact-exact", exact ? sounds(exact.speed) : "–");
  put_text("fact-stable", exact ? stability(exact) : "–");
  const shift = chain.shift, sent = chain.transmitted;
  put_text("fact-shift", shift === null ? "–" : `${digits(shift, 3)} units ahead`);
  put_text("fact-sent", sent === null ? "–" : `${(100 * sent).toFixed(1)} %`);
  const size = lead ? lead.peak : single ? single.peak : 0;
  const end = chain.c.end(0, size > 0 ? 1 : 0);
  put_text("fact-peak", size
    ? `${(100 * size / end).toFixed(1)} % of ${size > 0 ? "domain" : "stroke"}` : "–");
  put_text("fact-step", chain.dt ? `${digits(chain.dt / 2 ** chain.halved, 3)} s` : "–");
}

/* The multipliers of a wave in the tables decide; of another one the sign of dH/dc, which is
   positive of stable waves. */
const stability = ({ stable, slope }) => (stable !== undefined
  ? `${stable ? "stable" : "unstable"}: Floquet multipliers` : slope > 0
    ? "stable: energy rises with speed" : slope < 0 ? "unstable: energy falls with speed" : "–");

function about(overlays) {
  if (chain.ended) return "";
  if (!overlays.length)
    return chain.leader() ? "The leading pulse has reached the end of the chain; no exact wave "
      + "is drawn." : chain.springs.length > 1 ? "Beyond the interface no exact wave is drawn."
      : chain.waves.length ? "" : "The leading pulse has not yet separated from the tail.";
  const parts = [];
  if (overlays.some(({ wave }) => wave)) parts.push(chain.waves.length
    ? "The exact wave is drawn at its undisturbed position."
    : "The exact wave has the amplitude of the leading pulse.");
  else parts.push("No exact wave is drawn: none has the amplitude of the leading pulse.");
  if (!chain.sech2(overlays[0].speed))
    parts.push("No sech²: the pulse is not supersonic, or the sound speed is zero.");
  if (!chain.tent()) parts.push("No tent: this prism softens and has no locking stroke.");
  return parts.join(" ");
}

function say() {
  view.spoken = performance.now();
  const lead = chain.leader();
  const title = view.own ? "Your own chain" : chain.scene.label;
  const words = [`${title}, ${chain.units} units, ${view.running ? "running" : view.over ? "ended"
    : "paused"} at ${chain.time.toFixed(0)} s.`];
  if (chain.pluck)
    words.push(`Mass ${chain.pluck.site} was pulled by ${digits(chain.pluck.pull)} m and let go.`);
  if (lead && !lead.over)
    words.push(`Leading ${lead.peak < 0 ? "compression" : "extension"} pulse at unit `
      + `${lead.bond + 1}, ${sounds(lead.speed)}.`);
  const shift = chain.shift, sent = chain.transmitted;
  if (shift !== null) words.push(`The wave emerges ${digits(shift, 3)} units ahead.`);
  if (sent !== null) words.push(`Transmitted: ${(100 * sent).toFixed(1)} % of the energy.`);
  words.push(`Energy error ${digits(chain.energy_error, 2)}.`);
  $("summary").textContent = words.join(" ");
  $("message").hidden = !chain.message;
  $("message").textContent = chain.message;
  if ($("state").open) $("numbers").textContent = numbers();
  describe(chain.overlays());
}

function numbers() {
  const u = chain.u, v = chain.v, rows = [`# time ${chain.time} s, step ${chain.dt / 2 ** chain.halved} s,`
    + ` energy error ${chain.energy_error}`, "site,displacement [m],velocity [m/s]"];
  for (let j = 0; j < chain.sites; j++) rows.push(`${j},${u[j]},${v[j]}`);
  return rows.join("\n");
}

/* ---- address, files ---- */

/* The address keeps every setting. */
function address() {
  const given = new URLSearchParams({ scene: chain.name, units: chain.units });
  if (view.own) for (const name of OWN) given.set(name, view.own[name]);
  if (chain.pluck) given.set("pluck", `${chain.pluck.site}:${Number(chain.pluck.pull.toPrecision(6))}`);
  given.set("pace", $("pace").value);
  for (const name of CHECKS) given.set(name, Number($(name).checked));
  if (net.shown) for (const [name, x] of net.settings()) given.set(name, x);
  history.replaceState(null, "", `#${given}`);
}

function save(blob, name) {
  const link = Object.assign(document.createElement("a"), { href: URL.createObjectURL(blob), download: name });
  link.click();
  setTimeout(() => URL.revokeObjectURL(link.href), 1000);
}

/* What is seen, one picture below the other. */
function picture() {
  const parts = ["prisms", "strain", "map", "velocity"].map($), all = document.createElement("canvas");
  all.width = Math.max(...parts.map((one) => one.width));
  all.height = parts.reduce((sum, one) => sum + one.height, 0);
  const pen = all.getContext("2d");
  pen.fillStyle = view.colour.panel;
  pen.fillRect(0, 0, all.width, all.height);
  let top = 0;
  for (const one of parts) {
    pen.drawImage(one, 0, top);
    top += one.height;
  }
  return all;
}

/* ---- pictures ---- */

function colours() {
  const style = getComputedStyle(document.documentElement);
  view.colour = Object.fromEntries(COLOURS.map((name) =>
    [name, style.getPropertyValue(`--${name}`).trim()]));
}

/* Round numbers that divide a range into about `count` parts. */
function ticks(low, high, count) {
  const rough = (high - low) / count, power = 10 ** Math.floor(Math.log10(rough));
  const step = [1, 2, 5, 10].find((x) => x * power >= rough) * power, found = [];
  for (let k = Math.ceil(low / step - 1e-9); k * step <= high + 1e-9 * step; k++) found.push(k * step);
  return { found, places: Math.max(0, -Math.floor(Math.log10(step) + 1e-9)) };
}

/* A canvas with axes; gives the functions from numbers to places. */
function axes(id, { x: [left, right], y: [bottom, top], across, up }) {
  const { pen, width, height } = fitted($(id), view.sizes[id] ||= [$(id).clientWidth, $(id).clientHeight]);
  const box = { l: 70, r: width - 14, t: 12, b: height - 40 };
  const px = (x) => box.l + (box.r - box.l) * (x - left) / (right - left);
  const py = (y) => box.b - (box.b - box.t) * (y - bottom) / (top - bottom);
  pen.lineWidth = 1;
  pen.fillStyle = view.colour.soft;
  const rows = ticks(Math.min(bottom, top), Math.max(bottom, top), (box.b - box.t) / 34);
  pen.textAlign = "right";
  pen.textBaseline = "middle";
  for (const y of rows.found) {
    pen.strokeStyle = view.colour.line;
    pen.globalAlpha = Math.abs(y) < 1e-12 ? 1 : 0.5;
    line(pen, [[box.l, py(y)], [box.r, py(y)]]);
    pen.globalAlpha = 1;
    pen.fillText(minus(y.toFixed(rows.places)), box.l - 7, py(y));
  }
  const columns = ticks(left, right, (box.r - box.l) / 70);
  pen.textAlign = "center";
  pen.textBaseline = "top";
  for (const x of columns.found) {
    pen.strokeStyle = view.colour.line;
    line(pen, [[px(x), box.b], [px(x), box.b + 4]]);
    pen.fillText(minus(x.toFixed(columns.places)), px(x), box.b + 7);
  }
  pen.fillText(across, (box.l + box.r) / 2, height - 15);
  pen.save();
  pen.translate(6, (box.t + box.b) / 2);
  pen.rotate(-Math.PI / 2);
  pen.fillText(up, 0, 0);
  pen.restore();
  return { pen, px, py, box };
}

/* A curve in a frame, in a colour, dashed or not. */
function curve({ pen, px, py, box }, points, colour, dash = [], width = 1.8) {
  pen.save();
  pen.beginPath();
  pen.rect(box.l, box.t - 2, box.r - box.l, box.b - box.t + 4);
  pen.clip();
  pen.strokeStyle = view.colour[colour];
  pen.lineWidth = width;
  pen.lineJoin = "round";
  pen.setLineDash(dash);
  line(pen, points.map(([x, y]) => [px(x), Math.max(-1e4, Math.min(1e4, py(y)))]));
  pen.restore();
}

/* A range that holds what is there: it grows in steps, and slowly gives back what is not used. */
function range(name, low, high) {
  const [least, most] = view.tops[name] || [0, 0], ease = view.running ? 0.985 : 1;
  const grown = [low < least ? 1.25 * low : low > USED * least ? ease * least : least,
                 high > most ? 1.25 * high : high < USED * most ? ease * most : most];
  view.tops[name] = grown;
  const size = grown[1] - grown[0];
  return size > 0 ? [Math.min(grown[0], -0.12 * size), Math.max(grown[1], 0.12 * size)] : [-1, 1];
}

function bounds(points) {
  let low = 0, high = 0;
  for (const [, y] of points) [low, high] = [Math.min(low, y), Math.max(high, y)];
  return [low, high];
}

/* A symmetric profile given for x >= 0, around a place. */
function around(values, step, place, scale) {
  const right = values.map((y, k) => [place + k * step, scale * y]);
  return right.slice(1).map(([x, y]) => [2 * place - x, y]).reverse().concat(right);
}

function sampled(form, place, reach, scale) {
  const points = [];
  for (let k = -240; k <= 240; k++) {
    const x = reach * k / 240;
    points.push([place + x, scale * form(x)]);
  }
  return points;
}

/* Compressive strain of all prisms. */
function strains() {
  const u = chain.u, lengths = chain.lengths;
  return Array.from({ length: chain.units }, (_, b) => (u[b] - u[b + 1]) / lengths[chain.segment(b)]);
}

/* The space-time map anew, from the states that are stored. */
function remap() {
  if (!view.colour) colours();
  view.map = new SpaceTime(chain.units, chain.last, view.top);
  for (const { time, u } of chain.states)
    view.map.add(time, Array.from({ length: chain.units }, (_, b) =>
      (u[b] - u[b + 1]) / chain.lengths[chain.segment(b)]), view.colour);
}

/* The unit that the drawing follows: the first wave, or the largest strain. */
function focus(overlays, strain) {
  const wanted = overlays.length ? overlays[0].place - 0.5
    : strain.reduce((best, x, b) => (Math.abs(x) > Math.abs(strain[best]) ? b : best), 0);
  const now = view.held ?? wanted;
  const near = view.focus === null || !view.running || Math.abs(now - view.focus) < 3;
  view.focus = near ? now : view.focus + 0.15 * (now - view.focus);
  return view.focus;
}

function prisms(strain) {
  const shape = chain.shape(), middle = Math.max(DRAWN / 2, Math.min(chain.units - DRAWN / 2, view.focus + 0.5));
  const low = Math.max(0, Math.min(chain.units - 1, Math.floor(middle))), part = middle - low;
  const scene = { ...shape, top: view.top, span: DRAWN * chain.lengths[chain.segment(low)],
    middle: shape.place[low] + part * (shape.place[Math.min(low + 1, chain.units)] - shape.place[low]) };
  const paper = fitted($("prisms"), view.sizes.prisms ||= [$("prisms").clientWidth, $("prisms").clientHeight]);
  view.drawn = { ...scene, width: paper.width, scale: prismRow(paper, scene, view.colour) };
}

function draw() {
  if (!view.colour) colours();
  const units = chain.units, v = chain.v, strain = strains(), speeds = [];
  const dotted = strain.map((y, b) => [b + 0.5, y]);
  for (let j = 0; j <= units; j++) speeds.push([j, v[j]]);
  const overlays = chain.overlays(), length = chain.lengths[0];
  const at = focus(overlays, strain), half = Math.min(WINDOW, units) / 2;
  const from = $("follow").checked ? Math.max(0, Math.min(units - 2 * half, at - half)) : 0;
  const shown = [from, $("follow").checked ? from + 2 * half : units];
  prisms(strain);

  const tops = overlays.map(({ peak }) => [0, -peak / length]);
  let shape = { x: shown, y: range("strain", ...bounds(dotted.concat(tops))),
                across: "", up: "compressive strain" };
  let paper = axes("strain", shape);
  interface_(paper);
  const tent = chain.tent();
  for (const { place, wave, speed, peak } of overlays) {
    const sech = chain.sech2(speed), reach = Math.max(6, Math.min(60, units / 8));
    if (tent) curve(paper, sampled(tent, place, 1.5, -1 / length), "tent", [2, 3]);
    if (sech) curve(paper, sampled(sech, place, reach, -1 / length), "sech", [7, 4]);
    if (wave)
      curve(paper, around(wave.elongation, wave.step, place, -peak / length), "exact", [5, 3], 2.2);
  }
  dots(paper, dotted);
  paper = axes("map", { x: shown, y: [chain.last, 0], across: "unit", up: "time [s]" });
  view.map.draw(paper.pen, paper.box, ...shown);
  paper.pen.strokeStyle = view.colour.ink;
  line(paper.pen, [paper.box.l, paper.box.r].map((x) => [x, paper.py(chain.time)]));
  shape = { ...shape, y: range("velocity", ...bounds(speeds)), across: "unit", up: "velocity [m/s]" };
  paper = axes("velocity", shape);
  interface_(paper);
  for (const { place, way, wave, peak } of overlays)
    if (wave)
      curve(paper, around(wave.velocity, wave.step, place, way * peak), "exact", [5, 3], 2.2);
  dots(paper, speeds);
  closer(overlays);
  law();
  if (view.running && performance.now() - view.written < WRITTEN) return;
  view.written = performance.now();
  facts(overlays);
  put_text("overlay", about(overlays));
}

/* The first pulse by itself, in a frame that goes with it: masses come and go within it. */
function closer(overlays) {
  const one = overlays[0], length = chain.lengths[0];
  if (!one) {
    const { pen, box } = axes("near", { x: [-5, 5], y: [0, 1], across: "distance from the peak [units]",
      up: "compressive strain / peak strain" });
    pen.textBaseline = "middle";
    pen.fillText("no leading pulse", (box.l + box.r) / 2, (box.t + box.b) / 2);
    view.trail = [];
    return;
  }
  const { place, wave, speed, peak } = one, sech = chain.sech2(speed), tent = chain.tent();
  const wide = wave ? wave.elongation.findIndex((y) => y < 0.02) * wave.step : 4;
  const reach = Math.max(3, Math.ceil(1.2 * (wide > 0 ? wide : 4)));
  if (view.reach !== reach) [view.reach, view.trail] = [reach, []];
  const size = peak / -length, here = [];
  for (let b = 0; b < chain.units; b++) {
    const x = b + 0.5 - place;
    if (Math.abs(x) <= reach) here.push([x, -chain.elongation(b) / length]);
  }
  if (view.running) view.trail = view.trail.concat([here]).slice(-TRAIL);
  const top = 1.3 * size, bottom = -0.12 * size;
  const paper = axes("near", { x: [-reach, reach], y: [Math.min(top, bottom), Math.max(top, bottom)],
    across: "distance from the peak [units]", up: "compressive strain" });
  if (tent) curve(paper, sampled(tent, 0, 1.6, -1 / length), "tent", [2, 3]);
  if (sech) curve(paper, sampled(sech, 0, reach, -1 / length), "sech", [7, 4]);
  if (wave) curve(paper, around(wave.elongation, wave.step, 0, size), "exact", [5, 3], 2.2);
  const { pen, px, py, box } = paper;
  pen.fillStyle = view.colour.chain;
  const mark = (points, radius) => {
    for (const [x, y] of points) {
      if (py(y) < box.t || py(y) > box.b) continue;
      pen.beginPath();
      pen.arc(px(x), py(y), radius, 0, 7);
      pen.fill();
    }
  };
  pen.globalAlpha = 0.35;
  (view.trail || []).forEach((points) => mark(points, 1.7));
  pen.globalAlpha = 1;
  mark(here, 3.4);
}

function dots(paper, points) {
  curve(paper, points, "chain", [], 1.5);
  const spacing = paper.px(1) - paper.px(0);
  if (spacing < 3.5) return;
  paper.pen.fillStyle = view.colour.chain;
  for (const [x, y] of points) {
    if (paper.px(x) < paper.box.l - 1 || paper.px(x) > paper.box.r + 1) continue;
    paper.pen.beginPath();
    paper.pen.arc(paper.px(x), paper.py(y), Math.min(2.6, spacing / 2.4), 0, 7);
    paper.pen.fill();
  }
}

function interface_({ pen, px, box }) {
  if (chain.springs.length < 2 || px(chain.near) < box.l || px(chain.near) > box.r) return;
  pen.strokeStyle = view.colour.soft;
  pen.setLineDash([3, 4]);
  line(pen, [[px(chain.near), box.t], [px(chain.near), box.b]]);
  pen.setLineDash([]);
  pen.fillStyle = view.colour.soft;
  pen.textBaseline = "top";
  pen.textAlign = "right";
  pen.fillText("hard", px(chain.near) - 8, box.t);
  pen.textAlign = "left";
  pen.fillText("soft", px(chain.near) + 8, box.t);
}

/* Load against shortening of the prisms, and the part of it where the chain now is. */
function law() {
  const c = chain.c, low = [], high = [];
  for (let s = 0; s < chain.springs.length; s++) {
    const start = s ? chain.near : 0, stop = s || chain.springs.length < 2 ? chain.units : chain.near;
    let least = 0, most = 0;
    for (let b = start; b < stop; b++) {
      const r = chain.elongation(b);
      [least, most] = [Math.min(least, r), Math.max(most, r)];
    }
    low.push(least);
    high.push(most);
  }
  const load = (s, r) => chain.preloads[s] - c.value(s, 1, r);
  const stroke = Math.min(...chain.springs.map((_, s) => -c.end(s, 0)));
  const left = -0.6 * stroke, right = 1.04 * stroke, curves = chain.springs.map((_, s) => {
    const points = [];
    for (let k = 0; k <= 300; k++) {
      const r = Math.min(0.6 * stroke, 0.999 * c.end(s, 1));
      const place = r + (0.9995 * -stroke - r) * k / 300;
      points.push([-place, load(s, place)]);
    }
    return points;
  });
  const seen = curves.map((_, s) => load(s, Math.max(low[s], 0.97 * c.end(s, 0))));
  const usual = curves.map((points) => Math.max(...points.map(([x, y]) => (x < 0.85 * stroke ? y : 0))));
  const least = Math.min(0, ...curves.flat().map(([, y]) => y));
  const most = Math.max(...usual, 1.15 * Math.max(...seen));
  if (!(view.tops.law >= most)) view.tops.law = 1.1 * most;
  const top = view.tops.law || 1;
  const paper = axes("curve", { x: [left, right], y: [Math.max(least, -1.2 * top), top],
    across: "shortening of a prism [m]", up: "load [N]" });
  curves.forEach((points, s) => curve(paper, points, "soft", s ? [6, 3] : [], 1.5));
  curves.forEach((points, s) => {
    const here = points.filter(([x]) => -x >= low[s] && -x <= high[s]);
    const ends = [[-high[s], load(s, high[s])], ...here, [-low[s], load(s, low[s])]];
    curve(paper, ends, "chain", [], 4);
  });
  const { pen, px, py, box } = paper;
  if (chain.springs.length === 1 && !chain.springs[0].elastic) {
    pen.strokeStyle = view.colour.soft;
    pen.setLineDash([2, 4]);
    line(pen, [[px(stroke), box.t], [px(stroke), box.b]]);
    pen.setLineDash([]);
  }
  if (chain.springs.length > 1) {
    pen.textAlign = "right";
    pen.textBaseline = "middle";
    curves.forEach((points, s) => {
      const height = (s ? 0.5 : 0.75) * top, at = points.find(([, y]) => y > height);
      if (at) pen.fillText(s ? "soft" : "hard", px(at[0]) - 8, py(height));
    });
  }
  pen.fillStyle = view.colour.ink;
  pen.beginPath();
  pen.arc(px(0), py(load(0, 0)), 3.5, 0, 7);
  pen.fill();
}

function describe(overlays) {
  const lead = overlays.map(({ place }) => `a wave near unit ${Math.round(place)}`).join(", ");
  $("strain").setAttribute("aria-label", `Compressive strain along the chain; ${lead || "no wave identified"}.`);
  $("prisms").setAttribute("aria-label", `Twelve prisms, around unit ${Math.round(view.focus || 0) + 1}, `
    + `shortening and twisting as a wave passes.${chain.meeting && $("slow").checked ? " Slow motion." : ""}`);
  $("map").setAttribute("aria-label", "Compressive strain against unit and time, until now.");
  $("near").setAttribute("aria-label",
    "Compressive strain around the first pulse, with the exact wave, sech squared and the tent.");
  $("velocity").setAttribute("aria-label", "Velocity of the masses along the chain.");
  $("curve").setAttribute("aria-label",
    "Load against shortening of a prism, with the range currently occupied by the units.");
}

/* ---- plucking ---- */

/* Pull the mass that is nearest to the pointer; it is let go with it. */
function plucking(canvas) {
  const metres = (event) => (event.offsetX - view.drawn.width / 2) / view.drawn.scale + view.drawn.middle;
  canvas.addEventListener("pointerdown", (event) => {
    const x = metres(event), places = view.drawn.place;
    const site = places.reduce((best, y, j) => (Math.abs(y - x) < Math.abs(places[best] - x) ? j : best), 0);
    canvas.setPointerCapture(event.pointerId);
    view.pulled = { site, from: event.offsetX };
    view.held = Math.max(DRAWN / 2, Math.min(chain.units - DRAWN / 2, view.focus));
  });
  canvas.addEventListener("pointermove", (event) => {
    if (!view.pulled) return;
    const { site, from } = view.pulled, pull = (event.offsetX - from) / view.drawn.scale;
    running(false);
    if (pull || chain.pluck) load(chain.name, chain.units, view.own, { site, pull });
  });
  const loose = () => {
    if (!view.pulled) return;
    view.pulled = view.held = null;
    if (chain.pluck) running(true);
  };
  canvas.addEventListener("pointerup", loose);
  canvas.addEventListener("pointercancel", loose);
}

/* ---- start ---- */

function listen() {
  for (const [name, given] of Object.entries(TABLES.scenes)) {
    const button = document.createElement("button");
    button.type = "button";
    button.dataset.scene = name;
    button.textContent = given.label;
    button.addEventListener("click", () => { load(name); running(true); });
    $("scenes").append(button);
  }
  for (const name of [...OWN, ...PLUCK, "units"])
    $(name).addEventListener("input", () => { moved(name); running(true); });
  const paced = () => {
    const text = `${2 ** Number($("pace").value)} ×`;
    $("pace-value").textContent = text;
    $("pace").setAttribute("aria-valuetext", text);
  };
  $("pace").addEventListener("input", () => { paced(); address(); });
  paced();
  for (const name of CHECKS) $(name).addEventListener("input", () => { address(); draw(); });
  $("time").addEventListener("input", () => seek(chain.last * Number($("time").value) / 1000));
  $("run").addEventListener("click", () => running(!view.running));
  $("step").addEventListener("click", () => { running(false); advance(); say(); });
  $("restart").addEventListener("click", () => { again(); running(true); });
  $("state").addEventListener("toggle", say);
  $("csv").addEventListener("click", () => save(new Blob([numbers()], { type: "text/csv" }), "chain.csv"));
  $("png").addEventListener("click", () => picture().toBlob((blob) => save(blob, "chain.png")));
  $("link").addEventListener("click", async () => {
    address();
    const copied = await navigator.clipboard?.writeText(location.href).then(() => true, () => false);
    $("link").textContent = copied ? "Copied" : "Copy the address of this page";
    setTimeout(() => ($("link").textContent = "Copy link"), WAIT);
  });
  plucking($("prisms"));
  net.listen();
  document.addEventListener("keydown", (event) => {
    if (event.target.matches("input, button, summary, pre") && event.key === " ") return;
    if (event.ctrlKey || event.metaKey || event.altKey) return;
    const keys = net.shown ? { " ": "net-run", r: "net-restart" } : { " ": "run", s: "step", r: "restart" };
    const key = keys[event.key];
    if (!key) return;
    event.preventDefault();
    $(key).click();
  });
  new ResizeObserver(() => { view.sizes = {}; draw(); }).observe($("strain"));
  matchMedia("(prefers-color-scheme: dark)").addEventListener("change", () => { colours(); remap(); draw(); });
}

/* Settings from the address: #scene=collision&units=200&steps=2000, or numbers of one's own,
   #height=0.7&prestrain=0.01&preload=0&blow=0.1, with the other settings of `address`.  With `steps`
   the chain is left there, paused. */
function readAddress() {
  const given = new URLSearchParams(location.hash.slice(1));
  const known = given.has("scene") && Object.hasOwn(TABLES.scenes, given.get("scene"));
  const scene = known ? given.get("scene") : Object.keys(TABLES.scenes)[0];
  const within = (name, low, high, usual) => Math.min(high, Math.max(low,
    Number.isFinite(parseFloat(given.get(name))) ? parseFloat(given.get(name)) : usual));
  const own = given.has("height") && given.has("blow") ? {
    height: within("height", 0.2, 2, 0.7), prestrain: within("prestrain", 1e-4, 0.32, 0.01),
    preload: within("preload", 0, 0.1, 0), blow: within("blow", 1e-3, 1, 0.1) } : null;
  const [site, pull] = (given.get("pluck") || "").split(":").map(Number);
  put("pace", Math.round(within("pace", -3, 2, 0)));
  $("pace").dispatchEvent(new Event("input"));
  for (const name of CHECKS) if (given.has(name)) $(name).checked = given.get(name) === "1";
  load(scene, within("units", 2, 400, NaN) || undefined, own, pull && site >= 0 ? { site, pull } : null);
  if (given.get("tab") === "net") {
    net.open(true, given.get("net"), Number(given.get("hit")) || 0);
    return;
  }
  const steps = Math.floor(within("steps", 0, 1e6, 0));
  if (steps) {
    chain.run(steps);
    view.tops = {};
    $("state").open = true;
    running(false);
    remap();
    draw();
  } else running(!matchMedia("(prefers-reduced-motion: reduce)").matches);
}
