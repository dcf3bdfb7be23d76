"use strict";
/* The chain of the page: what is asked of the compiled C, and what is looked up in the tables.
   Knows nothing of the document. */

const FINE = 0, LOCKED = 1;
const LONGEST = 400;       // units
const PER_FRAME = 0.4;     // sites that the first pulse goes in a frame
const HALVINGS = 10;       // of the step, where a spring stiffens beyond what was expected
const TIMED = 12;          // bonds over which the leading pulse is timed
const ALIKE = 1e-3;        // relative difference of two peaks that have one wave
const QUIET = 1e-7;        // speeds of sound below it are none: a sonic vacuum
const WORDS = {
  low: "the bars meet (twist π)", flat: "the prism is flat (height 0)",
  high: "the bars stand upright (twist 0)",
};

class Chain {
  constructor(exports, tables) {
    if (exports._initialize) exports._initialize();
    this.c = exports;
    this.tables = tables;
  }

  numbers(address, count) {
    return new Float64Array(this.c.memory.buffer, address, count);
  }

  /* Lay the chain of a scene, or of a prism of one's own: {scene, units, own}, where `own` has
     height, prestrain, preload and blow. Returns what is wrong, or "". */
  set({ scene, units, own }) {
    const c = this.c, given = this.tables.scenes[scene];
    this.name = scene;
    this.scene = given;
    this.own = own || null;
    this.units = Math.max(2, Math.min(LONGEST, Math.round(units || given.units)));
    this.message = "";
    this.halved = 0;
    this.found = null;
    this.ended = false;
    const spring = own ? { ...own, k_cross: 1 } : given.near;
    this.springs = own || !given.far ? [spring] : [spring, given.far];
    this.lengths = this.springs.map((s, k) => s.elastic ? c.elastic(k)
      : c.rigid(k, s.height, s.prestrain, s.k_cross, s.preload));
    this.preloads = this.springs.map((s, k) => (this.lengths[k] ? s.preload : 0));
    this.held = !own && given.held ? 1 : 0;
    const near = this.springs.length > 1 ? Math.floor(this.units / 2) : this.units;
    this.near = near;
    this.blow = own ? own.blow : given.blow;
    this.waves = own ? [] : given.waves || [];
    this.steps = this.sound = 0;
    if (this.lengths.includes(0)) {
      this.lengths = this.lengths.map((x) => x || spring.height);
      this.springs.forEach((s, k) => c.rigid(k, s.height, s.prestrain, s.k_cross, 0));
      c.lay(near, this.units - near, this.held);
      this.energy = this.dt = 0;
      this.ended = true;
      return this.fail(`No state of this prism carries a preload of ${spring.preload} N: it is `
        + "beyond its largest axial load.");
    }
    c.lay(near, this.units - near, this.held);
    this.sound = Math.sqrt(Math.max(0, c.value(0, 2, 0)));
    if (this.waves.length) this.launch();
    else this.numbers(c.velocity(), this.sites)[this.held] = this.blow;
    this.energy = c.energy();
    const dt = c.expected_step(), frame = PER_FRAME / this.expected_speed();
    this.steps = Math.max(1, Math.ceil(frame / dt)) * Math.max(1, this.waves.length); // they meet
    this.dt = frame / this.steps;
    return "";
  }

  get sites() { return this.units + 1; }
  get time() { return this.c.instant(); }
  get u() { return this.numbers(this.c.displacement(), this.sites); }
  get v() { return this.numbers(this.c.velocity(), this.sites); }
  get energy_error() {
    return this.energy > 0 ? Math.abs(this.c.energy() / this.energy - 1) : 0;
  }

  fail(words) {
    this.message = words;
    return words;
  }

  /* Where a site counted from the end stands. */
  place(at) { return at < 0 ? this.sites + at : at; }

  launch() {
    const u = this.u, v = this.v;
    for (const { wave, at, way } of this.waves) {
      const table = this.tables.waves[wave], middle = this.place(at), reach = table.reach;
      for (let j = 0; j < this.sites; j++) {
        const x = j - middle;
        const within = Math.abs(x) <= reach;
        u[j] += (within ? table.u[x + reach] : x > 0 ? 0 : table.shift)
          - (way < 0 ? table.shift : 0);
        if (within) v[j] += way * table.v[x + reach];
      }
    }
  }

  /* Sites per second that the first pulse will go, roughly: for the pace of the picture. */
  expected_speed() {
    if (this.waves.length) return this.tables.waves[this.waves[0].wave].speed;
    const r = this.c.reached(0, 0.9 * this.energy, 0), stored = this.c.value(0, 0, r);
    const fast = r < 0 && stored > 0 ? Math.sqrt(2 * stored) / -r : 0;
    return Math.max(this.sound, fast) || 1;
  }

  segment(bond) { return bond >= this.near ? this.springs.length - 1 : 0; }

  elongation(bond) { return this.u[bond + 1] - this.u[bond]; }

  /* So many of the first steps; halves the step where one is not valid. Returns "" or why not. */
  run(steps, deadline = Infinity, clock = null) {
    if (this.ended) return this.message;
    let left = steps * 2 ** this.halved;
    while (left > 0) {
      const part = Math.min(left, 8), before = this.time;
      const found = this.c.run(part, this.dt / 2 ** this.halved);
      if (found !== FINE) {
        const done = Math.round((this.time - before) / (this.dt / 2 ** this.halved));
        left -= done;
        if (this.halved === HALVINGS) {
          this.ended = true;
          return this.fail(found === LOCKED ? this.locked()
            : "A unit became too stiff to be followed. The run ends here.");
        }
        this.halved += 1;
        left *= 2;
      } else left -= part;
      if (clock && clock() > deadline) break;
    }
    return "";
  }

  /* Which unit is closest to an end of its domain, in words. */
  locked() {
    let worst = 0, unit = 0, side = 0;
    for (let b = 0; b < this.units; b++) {
      const r = this.elongation(b), s = r > 0 ? 1 : 0, share = r / this.c.end(this.segment(b), s);
      if (share > worst) [worst, unit, side] = [share, b, s];
    }
    const spring = this.springs[this.segment(unit)];
    const flat = !spring.elastic && this.c.end(this.segment(unit), 0) <= -this.lengths[0];
    const words = spring.elastic ? this.tables.elastic[side ? "high" : "low"]
      : side ? WORDS.high : flat ? WORDS.flat : WORDS.low;
    return `Unit ${unit + 1} is at the end of its domain: ${words}. The run ends here.`;
  }

  /* The pulse that leads, from the left: {bond, speed, peak, place}, or null. */
  leader() {
    if (this.springs.length > 1 || this.waves.length > 1) return null;
    const passed = this.numbers(this.c.passage(), this.units);
    const peak = this.numbers(this.c.passing(), this.units);
    let front = this.units - 1;
    while (front > 0 && !passed[front]) front--;
    if (front >= this.units - 3) this.arrived = this.units;
    const back = front - TIMED;
    if (back < 2) return null;
    for (let b = back; b < front; b++)
      if (!(passed[b] > 0 && passed[b] < passed[b + 1] && peak[b] * peak[front] > 0)) return null;
    const speed = TIMED / (passed[front] - passed[back]);
    let size = 0;
    for (let b = back; b <= front; b++) size += peak[b] / (TIMED + 1);
    const place = front + 0.5 + speed * (this.time - passed[front]);
    return { bond: front, speed, peak: size, place, over: place > this.units - 1 };
  }

  /* The exact wave of a peak in the chain's springs; null where there is none. One that is nearly
     as high is taken for it. */
  exact(peak) {
    const c = this.c;
    if (!this.found || !(Math.abs(peak / this.found.peak - 1) < ALIKE)) {
      const speed = c.wave(0, peak), count = c.wave_points() + 1;
      const copied = (address) => Array.from(this.numbers(address, count));
      this.found = { peak, speed, step: c.wave_reach() / (count - 1),
                     elongation: copied(c.wave_elongation()), velocity: copied(c.wave_velocity()) };
    }
    return this.found.speed ? this.found : null;
  }

  /* What is to be drawn over the chain: [{place, way, wave, speed}], wave null where unknown. */
  overlays() {
    if (this.waves.length && this.springs.length === 1)
      return this.waves.map(({ wave, at, way }) => {
        const table = this.tables.waves[wave];
        const place = this.place(at) + way * table.speed * this.time;
        return { place, way, wave: table, speed: table.speed, peak: table.peak };
      }).filter(({ place }) => place > 1 && place < this.units - 1);
    if (this.waves.length) {
      const { wave, at } = this.waves[0], table = this.tables.waves[wave];
      const place = this.place(at) + table.speed * this.time;
      return place < this.near - 4
        ? [{ place, way: 1, wave: table, speed: table.speed, peak: table.peak }] : [];
    }
    const found = this.leader();
    if (!found || found.over) return [];
    return [{ ...found, way: 1, wave: this.exact(found.peak) }];
  }

  /* The sech^2 wave of a speed, as a function of the distance; null where there is none. */
  sech2(speed) {
    if (!(this.sound > QUIET && speed > this.sound)) return null;
    const slope = this.springs[0].elastic ? this.tables.elastic.slope : this.c.value(0, 3, 0);
    const stiffness = this.c.value(0, 2, 0), ratio = speed / this.sound;
    return (x) => this.c.sech2(stiffness, slope, ratio, x);
  }

  /* The tent that uses up the stroke; null where a softening spring has none to use. */
  tent() {
    if (this.springs[0].elastic) return null;
    const stroke = -this.c.end(0, 0);
    return (x) => (Math.abs(x) < 1 ? this.c.tent(stroke, x) : 0);
  }
}

async function started(code, tables) {
  const bytes = typeof code === "string" ? Uint8Array.from(atob(code), (c) => c.charCodeAt(0)) : code;
  const { instance } = await WebAssembly.instantiate(bytes, {});
  return new Chain(instance.exports, tables);
}

if (typeof module !== "undefined") module.exports = { Chain, started };
