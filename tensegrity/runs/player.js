/* A recorded run, played on the page of `viewer.html`: see `viewer.py` for the data. */

const AROUND = 12;        // prisms that are drawn
const SECONDS = 8;        // that a run takes

function play(data) {
  const $ = (id) => document.getElementById(id), style = getComputedStyle(document.documentElement);
  const colour = Object.fromEntries(["panel", "ink", "soft", "line", "chain", "exact"].map((name) =>
    [name, style.getPropertyValue(`--${name}`).trim()]));
  const table = (text) => new Float32Array(Uint8Array.from(atob(text), (c) => c.charCodeAt(0)).buffer);
  const last = data.t.length - 1, prisms = Boolean(data.twist), all = {};
  for (const name of ["height", "twist", "base", "strain", "places", "shade"])
    if (data[name]) all[name] = table(data[name]);
  const rows = (name, k) => {
    const count = all[name].length / (last + 1);
    return all[name].subarray(k * count, (k + 1) * count);
  };
  const overlap = (k) => {
    const [i, j] = data.bonds[k], x = rows("places", Number($("row").value)), d = data.dim;
    let square = 0;
    for (let a = 0; a < d; a++) square += (x[i * d + a] - x[j * d + a]) ** 2;
    return Math.max(0, data.radius[i] + data.radius[j] - Math.sqrt(square));
  };
  let running = !matchMedia("(prefers-reduced-motion: reduce)").matches && last > 0;
  let place = 0, before = null, turn = 0.5, largest = 1e-300, map = null;
  const top = prisms ? all.strain.reduce((most, x) => Math.max(most, Math.abs(x)), 1e-12) : 1;

  function draw() {
    const k = Number($("row").value), paper = fitted($("picture"));
    $("now").textContent = `${Number(data.t[k].toPrecision(4))} s`;
    $("row").setAttribute("aria-valuetext", $("now").textContent);
    if (!prisms) {
      if (data.radius && data.bonds.length)
        for (let b = 0; b < data.bonds.length; b++) largest = Math.max(largest, overlap(b));
      sites(paper, { ...data, places: rows("places", k), shade: rows("shade", k), turn,
        thick: data.radius && data.bonds.length ? (b) => overlap(b) / largest : null }, colour);
      return;
    }
    const strain = rows("strain", k), height = rows("height", k), at = [0];
    height.forEach((h) => at.push(at[at.length - 1] + h));
    let peak = strain.reduce((best, x, b) => (Math.abs(x) > Math.abs(strain[best]) ? b : best), 0);
    peak = Math.max(AROUND / 2, Math.min(height.length - AROUND / 2, peak + 0.5));
    const low = Math.max(0, Math.min(height.length - 1, Math.floor(peak)));
    prismRow(paper, { place: at, twist: rows("twist", k), base: rows("base", k), strain, top,
      span: Math.min(AROUND, height.length) * data.first,
      middle: at[low] + (peak - low) * height[low] }, colour);
    const { pen, width, height: high } = fitted($("map"));
    map.draw(pen, { l: 0, r: width, t: 0, b: high }, 0, height.length);
    pen.strokeStyle = colour.ink;
    line(pen, [[0, high * k / Math.max(1, last)], [width, high * k / Math.max(1, last)]]);
  }

  if (prisms) {
    $("map").hidden = false;
    map = new SpaceTime(all.strain.length / (last + 1), data.t[last] || 1, top);
    for (let k = 0; k <= last; k++) map.add(data.t[k], rows("strain", k).map((x) => -x), colour);
  }
  $("row").max = last;
  $("row").addEventListener("input", () => { place = Number($("row").value); draw(); });
  const words = () => { $("play").textContent = running ? "Pause" : "Run"; };
  $("play").addEventListener("click", () => { running = !running; before = null; words(); if (running) requestAnimationFrame(step); });
  $("picture").addEventListener("pointermove", (event) => {
    if (event.buttons) { turn += event.movementX / 150; draw(); }
  });
  function step(now) {
    if (!running) return;
    place = (place + (before === null ? 0 : (now - before) / 1000 * last / SECONDS)) % (last + 1);
    before = now;
    $("row").value = Math.floor(place);
    draw();
    requestAnimationFrame(step);
  }
  new ResizeObserver(draw).observe($("picture"));
  words();
  draw();
  if (running) requestAnimationFrame(step);
}
