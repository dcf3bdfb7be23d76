/* A recorded run, played on the page of `viewer.html`: see `page.py` for the data. */

const AROUND = 12;        // prisms that are drawn
const SECONDS = 8;        // that a run takes
const LEVELS = 127;       // of a tension of either sign, and one more below for what is slack

function play(data) {
  const $ = (id) => document.getElementById(id), style = getComputedStyle(document.documentElement);
  const colour = Object.fromEntries(["panel", "ink", "soft", "line", "chain", "exact"].map((name) =>
    [name, style.getPropertyValue(`--${name}`).trim()]));
  const bytes = (text) => Uint8Array.from(atob(text), (c) => c.charCodeAt(0)).buffer;
  const small = 1e-9 * Math.max(...data.t.map(Math.abs)), last = data.t.length - 1, prisms = Boolean(data.twist), all = {};
  const kinds = { shade: Uint8Array, tension: Int8Array };
  for (const name of ["height", "twist", "base", "strain", "places", "shade", "tension"])
    if (data[name]) all[name] = new (kinds[name] || Float32Array)(bytes(data[name]));
  const rows = (name, k) => {
    const count = all[name].length / (last + 1);
    return all[name].subarray(k * count, (k + 1) * count);
  };
  let running = !matchMedia("(prefers-reduced-motion: reduce)").matches && last > 0;
  let place = 0, before = null, turn = 0.5, tilt = 0.3, zoom = 1, map = null;
  const top = prisms ? all.strain.reduce((most, x) => Math.max(most, Math.abs(x)), 1e-12) : 1;

  /* What colours and widths stand for, in a corner. */
  function key({ pen, height }) {
    const [left, top, wide] = [12, height - 34, 180], most = measured(data.most, data.force, data.si);
    pen.fillStyle = colour.ink;
    if (data.radius) return pen.fillText(`widest line: ${most}; blue: speed`, left, height - 10);
    pen.fillText("tension; dashed: slack", left, top - 6);
    [`−${most}`, "0", most].forEach((text, k) => {
      pen.textAlign = ["left", "center", "right"][k];
      pen.fillText(text, left + k * wide / 2, top + 22);
    });
    pen.textAlign = "left";
    for (let k = 0; k < wide; k++) {
      pen.fillStyle = shaded(2 * k / (wide - 1) - 1, colour);
      pen.fillRect(left + k, top, 1.5, 8);
    }
  }

  function draw() {
    const k = Number($("row").value), paper = fitted($("picture"));
    $("now").textContent = `${data.name} ${measured(Math.abs(data.t[k]) < small ? 0 : data.t[k], data.unit, data.si)}`;
    $("row").setAttribute("aria-valuetext", $("now").textContent);
    if (!prisms) {
      const levels = all.tension && rows("tension", k), shades = all.shade && rows("shade", k);
      const part = levels && ((b) => (levels[b] < -LEVELS ? NaN : levels[b] / LEVELS));
      sites(paper, { ...data, places: rows("places", k), turn, tilt, zoom,
        shade: Array.from(shades || [], (x) => x / 255),
        thick: data.radius && levels ? part : null, pull: part }, colour);
      if (levels && data.most) key(paper);
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
  document.querySelector("h1").textContent = data.title;
  $("controls").hidden = last === 0;
  const fingers = new Map(), apart = () => {
    const [[x, y], [p, q]] = fingers.values();
    return Math.hypot(x - p, y - q);
  };
  const moved = (right, down, factor) => {
    turn += right / 150;
    tilt = Math.max(-Math.PI / 2, Math.min(Math.PI / 2, tilt + down / 150));
    zoom = Math.max(0.2, Math.min(20, zoom * factor));
    draw();
  };
  const picture = $("picture");
  picture.style.touchAction = data.dim === 3 ? "none" : "pan-y";
  picture.addEventListener("pointerdown", (event) => {
    fingers.set(event.pointerId, [event.offsetX, event.offsetY]);
    picture.setPointerCapture(event.pointerId);
  });
  for (const name of ["pointerup", "pointercancel"])
    picture.addEventListener(name, (event) => fingers.delete(event.pointerId));
  picture.addEventListener("pointermove", (event) => {
    if (!fingers.has(event.pointerId)) return;
    const before = fingers.size > 1 && apart(), [x, y] = fingers.get(event.pointerId);
    fingers.set(event.pointerId, [event.offsetX, event.offsetY]);
    if (before) moved(0, 0, apart() / before);
    else moved(event.offsetX - x, event.offsetY - y, 1);
  });
  picture.addEventListener("wheel", (event) => {
    event.preventDefault();
    moved(0, 0, Math.exp(-event.deltaY / 500));
  }, { passive: false });
  const keys = { ArrowLeft: [-15, 0, 1], ArrowRight: [15, 0, 1], ArrowUp: [0, -15, 1],
                 ArrowDown: [0, 15, 1], "+": [0, 0, 1.2], "-": [0, 0, 1 / 1.2] };
  picture.addEventListener("keydown", (event) => {
    if (!keys[event.key]) return;
    event.preventDefault();
    moved(...keys[event.key]);
  });
  function step(now) {
    if (!running) return;
    place = (place + (before === null ? 0 : (now - before) / 1000 * (last + 1) / (data.loop ? SECONDS / 4 : SECONDS))) % (last + 1);
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
