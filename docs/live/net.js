/* The second tab: beads and discs joined in any pattern, by the loop of networks. */

const SPEED_SHOWN = 0.25; // of the impact velocity: beads as fast are drawn in full colour
const PAGE = 65536;       // bytes of memory that grow at once
const SIZES = { f: 8, l: 8, i: 4, b: 1 };

const net = {
  shown: false, running: false, name: "", hit: 0, done: 0, spoken: -Infinity,

  settings() { return [["tab", "net"], ["net", this.name], ["hit", Number(this.hit.toPrecision(3))]]; },

  /* The arrays of a scene and the structure that the loop takes, in memory of the compiled code. */
  place(given) {
    const { memory } = this.c, bytes = given.fields.reduce((sum, one) =>
      sum + 16 + (Array.isArray(one) ? 8 * Math.ceil(one[1] * SIZES[one[0]] / 8) : 0), 0);
    this.base ??= memory.buffer.byteLength;
    const missing = this.base + bytes - memory.buffer.byteLength;
    if (missing > 0) memory.grow(Math.ceil(missing / PAGE));
    const view = new DataView(memory.buffer), all = new Uint8Array(memory.buffer);
    all.fill(0, this.base);
    let at = this.base, free = this.base + 16 * given.fields.length;
    this.address = {};
    given.fields.forEach((one, k) => {
      const pointer = given.pointers[k];
      if (!pointer) at = 8 * Math.ceil(at / 8);
      if (Array.isArray(one)) {
        all.set(Uint8Array.from(atob(one[2]), (c) => c.charCodeAt(0)), free);
        this.address[given.names[k]] = free;
        view.setUint32(at, free, true);
        free += 8 * Math.ceil(one[1] * SIZES[one[0]] / 8);
      } else if (pointer) view.setUint32(at, 0, true);
      else view.setBigInt64(at, BigInt(one), true);
      at += pointer ? 4 : 8;
    });
  },

  row(name) {
    const { dim, mass } = this.given;
    return new Float64Array(this.c.memory.buffer, this.address[name], dim * mass.length);
  },

  load(name, hit) {
    [this.name, this.given, this.done, this.largest] = [name, TABLES.net[name], 0, 1e-300];
    const { given } = this;
    this.hit = Math.min(given.most, Math.max(given.hit / 10, hit || given.hit));
    this.place(given);
    this.row("v").forEach((v, k, all) => (all[k] = v * this.hit / given.hit));
    [$("hit").min, $("hit").max] = [given.hit / 10, given.most].map(Math.log10);
    $("hit").value = Math.log10(this.hit);
    const words = `${digits(this.hit)} ${given.unit}`;
    $("hit-value").textContent = words;
    $("hit").setAttribute("aria-valuetext", words);
    for (const button of $("net-scenes").children)
      button.setAttribute("aria-pressed", String(button.dataset.scene === name));
    $("net-note").textContent = given.note;
    $("front").hidden = !given.discs;
    $("beads").style.height = given.discs ? "110px" : "";
    if (given.discs) this.map = new SpaceTime(given.discs, given.last, -given.least);
    this.places = Float64Array.from(given.places);
    address();
    this.say();
    this.draw();
  },

  get time() { return this.done * this.given.dt; },

  run(on) {
    if (on && this.time >= this.given.last) this.load(this.name, this.hit);
    this.running = on;
    $("net-run").textContent = on ? "Pause" : "Run";
    if (on) requestAnimationFrame(() => this.frame());
    this.say();
  },

  frame() {
    if (!this.running) return;
    this.advance(this.given.steps);
    this.draw();
    if (this.time >= this.given.last) this.run(false);
    else requestAnimationFrame(() => this.frame());
    if (performance.now() - this.spoken > SPOKEN) this.say();
  },

  advance(steps) {
    this.c.go(this.base, steps, this.given.decay);
    this.done += steps;
  },

  /* Kinetic energy of each part over that of the impact. */
  fractions() {
    const { mass, parts, dim, hit } = this.given, v = this.row("v"), found = {};
    const energy = (i) => mass[i] / 2 * v.subarray(i * dim, i * dim + dim).reduce((sum, x) => sum + x * x, 0);
    const whole = mass[parts.striker ? parts.striker[0] : 0] / 2 * this.hit ** 2;
    for (const [name, [first, last]] of Object.entries(parts)) {
      let sum = 0;
      for (let i = first; i <= last; i++) sum += energy(i);
      found[name] = sum / whole;
    }
    return found;
  },

  /* Discs that have switched. */
  switched() {
    const u = this.row("u");
    return Array.from({ length: this.given.discs }, (_, j) => u[2 * j] > 0).filter(Boolean).length;
  },

  clock() {
    const t = this.time;
    return t < 1e-2 && !this.given.discs ? `${(1e6 * t).toFixed(0)} µs` : `${t.toFixed(0)} s`;
  },

  facts() {
    const { given } = this;
    if (given.discs) return { "Discs switched": `${this.switched()} of ${given.discs}` };
    return Object.fromEntries(Object.entries(this.fractions()).map(([name, x]) =>
      [name[0].toUpperCase() + name.slice(1), `${(100 * x).toFixed(1)} %`]));
  },

  say() {
    this.spoken = performance.now();
    const facts = Object.entries(this.facts()).filter(([name]) => !name.startsWith("Row"));
    const words = `${this.name}, ${this.running ? "running" : this.time >= this.given.last ? "ended" : "paused"}`
      + ` at ${this.clock()}. ${this.given.discs ? "" : "Kinetic energy over that of the impact: "}`
      + `${facts.map(([name, x]) => `${name} ${x}`).join(", ")}.`;
    $("net-summary").textContent = words;
    $("beads").setAttribute("aria-label", words);
    $("front").setAttribute("aria-label", "Twist of the discs against time.");
  },

  draw() {
    if (!this.shown) return;
    const { given } = this, u = this.row("u"), v = this.row("v"), { dim, mass } = given;
    const scale = SPEED_SHOWN * this.hit, count = given.discs || mass.length;
    const shade = Array.from({ length: count }, (_, i) => (given.discs ? (u[dim * i] > 0 ? 1 : 0)
      : Math.hypot(...v.subarray(dim * i, dim * i + dim)) / scale));
    const paper = fitted($("beads"));
    if (given.discs) {
      const frame = [[-1, -2], [count, 2]], turned = (i) => 2.5 * u[dim * i];
      sites(paper, { ...given, places: this.places, radius: Array(count).fill(0.42), shade, frame,
        bonds: null, walls: null, needle: turned }, view.colour);
      this.map.add(this.time, Array.from({ length: count }, (_, j) => u[dim * j]), view.colour);
      const box = axes("front", { x: [0, count], y: [given.last, 0], across: "disc", up: "time [s]" });
      this.map.draw(box.pen, box.box, 0, count);
    } else {
      const places = this.places.map((x, k) => x + u[k]);
      const overlap = given.bonds.map(([i, j]) => Math.max(0, given.radius[i] + given.radius[j]
        - Math.hypot(places[dim * i] - places[dim * j], places[dim * i + 1] - places[dim * j + 1])));
      this.largest = Math.max(this.largest, ...overlap);
      sites(paper, { ...given, places, shade, thick: (k) => overlap[k] / this.largest }, view.colour);
    }
    put_text("net-time", this.clock());
    const facts = Object.entries(this.facts()), names = facts.map(([name]) => name).join();
    if (names !== this.listed)
      $("net-facts").replaceChildren(...facts.map(([name]) => {
        const row = document.createElement("div");
        row.append(document.createElement("dt"), document.createElement("dd"));
        row.firstChild.textContent = name;
        return row;
      }));
    this.listed = names;
    facts.forEach(([, x], k) => ($("net-facts").children[k].lastChild.textContent = x));
  },

  /* Show this tab, or the chain. */
  async open(on, name, hit) {
    this.shown = on;
    for (const [tab, chosen] of [["net", on], ["chain", !on]]) {
      $(tab).hidden = !chosen;
      $(`tab-${tab}`).setAttribute("aria-selected", String(chosen));
      $(`tab-${tab}`).tabIndex = chosen ? 0 : -1;
    }
    view.sizes = {};
    if (!on) {
      this.running = false;
      address();
      return;
    }
    running(false);
    if (!this.c) {
      const bytes = Uint8Array.from(atob(NET_CODE), (c) => c.charCodeAt(0));
      const missing = new Proxy({}, { get: () => new Proxy({}, { get: () => () => 0 }) });
      const { instance } = await WebAssembly.instantiate(bytes, missing);
      this.c = instance.exports;
      if (this.c._initialize) this.c._initialize();
    }
    const known = Object.hasOwn(TABLES.net, name || "") ? name : this.name || Object.keys(TABLES.net)[0];
    this.load(known, hit || (known === this.name ? this.hit : 0));
    this.run(!matchMedia("(prefers-reduced-motion: reduce)").matches);
  },

  listen() {
    for (const name of Object.keys(TABLES.net)) {
      const button = document.createElement("button");
      [button.type, button.dataset.scene, button.textContent] = ["button", name, name];
      button.addEventListener("click", () => { this.load(name); this.run(true); });
      $("net-scenes").append(button);
    }
    for (const tab of ["chain", "net"]) {
      $(`tab-${tab}`).addEventListener("click", () => this.open(tab === "net"));
      $(`tab-${tab}`).addEventListener("keydown", (event) => {
        if (!["ArrowLeft", "ArrowRight"].includes(event.key)) return;
        const other = $(tab === "net" ? "tab-chain" : "tab-net");
        other.focus();
        other.click();
      });
    }
    $("net-run").addEventListener("click", () => this.run(!this.running));
    $("net-restart").addEventListener("click", () => { this.load(this.name, this.hit); this.run(true); });
    $("hit").addEventListener("input", () => { this.load(this.name, value("hit")); this.run(true); });
  },
};

started(CODE, TABLES).then((found) => {
  chain = found;
  $("method").textContent = TABLES.method;
  $("back").hidden = !location.pathname.endsWith("/live.html");
  listen();
  readAddress();
}).catch((error) => {
  $("message").hidden = false;
  $("message").textContent = `This browser cannot run the chain: ${error.message}`;
});
