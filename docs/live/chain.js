"use strict";
/* The chain of the page: calls of the compiled C, and values from the tables.
   Knows nothing of the document. */

const FINE = 0, LOCKED = 1;
const LONGEST = 400;       // units
const PER_FRAME = 0.4;     // sites that the first pulse goes in a frame
const HALVINGS = 10;       // of the step, where a spring stiffens beyond what was expected
const TIMED = 12;          // bonds over which the leading pulse is timed
const ALIKE = 1e-3;        // relative difference of two peaks that have one wave
const QUIET = 1e-7;        // speeds of sound below it are none: a sonic vacuum
const MOST_STATES = 1200;         // stored states of a run, to return to
const LASTS = 1.25;        // times that the first pulse takes to the end: how long a run is
const FARTHEST = 0.9;      // of the way to an end of a domain, to which a mass is pulled
const NEARBY = 1e-3;       // relative difference of two peaks, for the slope of the energy
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

  /* Lay the chain of a scene, or of a prism of one's own: {scene, units, own, pluck}, where `own` has
     height, prestrain, preload and blow, and `pluck` = {site, pull} begins with one mass pulled
     aside [m] instead. Returns what is wrong, or "". */
  set({ scene, units, own, pluck }) {
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
    this.waves = own || pluck ? [] : given.waves || [];
    this.states = [];
    this.every = 1;
    this.past = false;
    this.steps = this.sound = 0;
    if (this.lengths.includes(0)) {
      this.lengths = this.lengths.map((x) => x || spring.height);
      this.springs.forEach((s, k) => c.rigid(k, s.height, s.prestrain, s.k_cross, 0));
      c.lay(near, this.units - near, this.held);
      this.energy = this.dt = 0;
      this.last = 1;
      this.pluck = null;
      this.store();
      this.ended = true;
      return this.fail(`No state of this prism carries a preload of ${spring.preload} N: it is `
        + "beyond its largest axial load. Lower the preload.");
    }
    c.lay(near, this.units - near, this.held);
    this.sound = Math.sqrt(Math.max(0, c.value(0, 2, 0)));
    this.pluck = pluck ? this.pulled(pluck) : null;
    if (this.pluck) this.u[this.pluck.site] = this.pluck.pull;
    else if (this.waves.length) this.launch();
    else this.v[this.held] = this.blow;
    this.energy = c.energy(0);
    const dt = c.expected_step(), frame = PER_FRAME / this.expected_speed();
    this.steps = Math.max(1, Math.ceil(frame / dt)) * Math.max(1, this.waves.length); // they meet
    this.dt = frame / this.steps;
    const way = this.waves.length ? this.waves[0].at : this.pluck
      ? Math.min(this.pluck.site, this.units - this.pluck.site) : 0;
    this.last = LASTS * (this.units - way) / this.expected_speed();
    this.store();
    return "";
  }

  /* A mass pulled no farther than both springs beside it allow. */
  pulled({ site, pull }) {
    const at = Math.max(this.held, Math.min(this.units, Math.round(site))), c = this.c;
    const least = [], most = [];
    if (at > 0) {
      least.push(c.end(this.segment(at - 1), 0));
      most.push(c.end(this.segment(at - 1), 1));
    }
    if (at < this.units) {
      least.push(-c.end(this.segment(at), 1));
      most.push(-c.end(this.segment(at), 0));
    }
    return { site: at, pull: Math.max(FARTHEST * Math.max(...least),
                                      Math.min(FARTHEST * Math.min(...most), pull)) };
  }

  /* Store this state, to return to; where there are many, every second one is dropped. */
  store() {
    this.frames = (this.frames || 0) + 1;
    if (this.states.length && this.frames % this.every) return;
    this.states.push({ time: this.time, u: this.u.slice(), v: this.v.slice() });
    if (this.states.length < MOST_STATES) return;
    this.states = this.states.filter((_, k) => k % 2 === 0);
    this.every *= 2;
  }

  /* Go to a time of the run: back to the nearest stored state, or on by steps. */
  seek(time) {
    const known = this.states[this.states.length - 1].time;
    const one = this.states.reduce((best, x) =>
      (Math.abs(x.time - time) < Math.abs(best.time - time) ? x : best));
    this.u.set(one.u);
    this.v.set(one.v);
    this.c.show(one.time);
    this.past = one.time < known;
    if (this.past) this.ended = false;
    const frame = this.steps * this.dt;
    while (time > known && this.time < Math.min(time, this.last) - frame && !this.run(this.steps));
  }

  get sites() { return this.units + 1; }
  get time() { return this.c.instant(); }
  get u() { return this.numbers(this.c.displacement(), this.sites); }
  get v() { return this.numbers(this.c.velocity(), this.sites); }
  get energy_error() {
    return this.energy > 0 ? Math.abs(this.c.energy(0) / this.energy - 1) : 0;
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
    if (this.past) {
      this.c.resume(this.time);
      this.states = this.states.filter((one) => one.time <= this.time);
      [this.past, this.message] = [false, ""];
    }
    let left = steps * 2 ** this.halved;
    while (left > 0) {
      const part = Math.min(left, 8), before = this.time;
      const found = this.c.run(part, this.dt / 2 ** this.halved);
      if (found !== FINE) {
        const done = Math.round((this.time - before) / (this.dt / 2 ** this.halved));
        left -= done;
        if (this.halved === HALVINGS) {
          this.ended = true;
          this.store();
          return this.fail(`${found === LOCKED ? this.locked()
            : "A unit became too stiff to be followed."} The run ends here. ${this.advice()}`);
        }
        this.halved += 1;
        left *= 2;
      } else left -= part;
      if (clock && clock() > deadline) break;
    }
    this.store();
    return "";
  }

  /* Which unit is closest to an end of its domain, in words. */
  locked() {
    let worst = 0, unit = 0, side = 0;
    for (let b = 0; b < this.units; b++) {
      const r = this.elongation(b), s = r > 0 ? 1 : 0, fraction = r / this.c.end(this.segment(b), s);
      if (fraction > worst) [worst, unit, side] = [fraction, b, s];
    }
    const spring = this.springs[this.segment(unit)];
    const flat = !spring.elastic && this.c.end(this.segment(unit), 0) <= -this.lengths[0];
    const words = spring.elastic ? this.tables.elastic[side ? "high" : "low"]
      : side ? WORDS.high : flat ? WORDS.flat : WORDS.low;
    return `Unit ${unit + 1} is at the end of its domain: ${words}.`;
  }

  /* Which slider to move, so that a run goes on. */
  advice() {
    if (this.pluck) return "Pull the mass less far.";
    return this.own ? "Lower the impact velocity, or raise the prestrain." : "Lower the impact velocity.";
  }

  /* Heights, twists [rad], bases [m] of all prisms, and places of the masses [m]. */
  shape() {
    const place = [0], twist = [], base = [], strain = [], tables = this.tables.elastic;
    for (let b = 0; b < this.units; b++) {
      const k = this.segment(b), r = this.elongation(b);
      place.push(place[b] + this.lengths[k] + r);
      strain.push(r / this.lengths[k]);
      if (this.springs[k].elastic) {
        const last = tables.twist.length - 1, x = last * (r - tables.from) / (tables.to - tables.from);
        const at = Math.max(0, Math.min(last - 1, Math.floor(x))), part = Math.max(0, Math.min(1, x - at));
        for (const [to, of] of [[twist, tables.twist], [base, tables.base]])
          to.push(of[at] + part * (of[at + 1] - of[at]));
      } else {
        twist.push(this.c.twist(k, r));
        base.push(1);
      }
    }
    return { place, twist, base, strain };
  }

  /* Share of the energy beyond the interface, null where there is none. */
  get transmitted() {
    return this.springs.length > 1 ? this.c.energy(this.near) / this.energy : null;
  }

  /* How far the first of two launched waves is ahead of its undisturbed position [units], both
     extrapolated to the instant of meeting, as by `phase_shift`; null before they have parted. */
  get shift() {
    if (this.waves.length < 2) return null;
    const { wave, at } = this.waves[0], speed = this.tables.waves[wave].speed;
    const meeting = (this.place(this.waves[1].at) - at) / 2 / speed, undisturbed = at + speed * meeting;
    const latest = this.numbers(this.c.last_passage(), this.units);
    const parted = (b) => latest[b] > meeting && latest[b] <= this.time
      && Math.abs(b + 0.5 - at - speed * latest[b]) < 2;
    let front = this.units - 1;
    while (front > 0 && !parted(front)) front--;
    const back = front - TIMED;
    if (back < undisturbed + TIMED) return null;
    const left = TIMED / (latest[front] - latest[back]);
    return front + 0.5 + left * (meeting - latest[front]) - undisturbed;
  }

  /* Whether waves are about to meet, or one to meet an interface: then all goes slower. */
  get meeting() {
    if (this.waves.length === 0) return false;
    const places = this.waves.map(({ wave, at, way }) =>
      this.place(at) + way * this.tables.waves[wave].speed * this.time);
    return Math.abs(places[0] - (places.length > 1 ? places[1] : this.near)) < (places.length > 1 ? 14 : 7)
      && places.length + this.springs.length > 2;
  }

  /* The pulse that leads, from the left: {bond, speed, peak, place}, or null. */
  leader() {
    if (this.springs.length > 1 || this.waves.length > 1) return null;
    const passed = this.numbers(this.c.passage(), this.units).map((t) => (t <= this.time ? t : 0));
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
      const speed = c.wave(0, peak), count = c.wave_points() + 1, chain = this;
      const copied = (address) => Array.from(this.numbers(address, count));
      this.found = { peak, speed, step: c.wave_reach() / (count - 1),
                     elongation: copied(c.wave_elongation()), velocity: copied(c.wave_velocity()),
                     get slope() { return (this.known ??= chain.slope(peak)); } };
    }
    return this.found.speed ? this.found : null;
  }

  /* dH/dc of the exact waves at a peak [J s/site], 0 where it is not found: positive of stable ones. */
  slope(peak) {
    const [near, here] = [1 + NEARBY, 1].map((part) => {
      const speed = this.c.wave(0, part * peak);
      return { speed, energy: this.c.wave_energy(0, part * peak) };
    });
    return near.speed && here.speed ? (near.energy - here.energy) / (near.speed - here.speed) : 0;
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
