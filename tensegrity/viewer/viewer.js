"use strict";
/* Pictures of runs on a canvas: a row of prisms, sites with their bonds, a space-time map.  The live
   page and `Run.show` draw with them; they know nothing of either. */

const HANDS = 3;          // corners of a triangle
const ROWS = 480;         // instants of a map
const FLOOR = 0.02;       // least strength of what is drawn of a force

/* The pen of a canvas as large as its element, and that size in CSS pixels. */
function fitted(canvas, size = [canvas.clientWidth, canvas.clientHeight]) {
  const ratio = window.devicePixelRatio || 1, [width, height] = size.map((x) => Math.round(x * ratio));
  if (canvas.width !== width || canvas.height !== height) [canvas.width, canvas.height] = [width, height];
  const pen = canvas.getContext("2d");
  pen.setTransform(ratio, 0, 0, ratio, 0, 0);
  pen.clearRect(0, 0, ...size);
  pen.font = "12px system-ui, -apple-system, 'Segoe UI', Roboto, sans-serif";
  pen.setLineDash([]);
  return { pen, width: size[0], height: size[1] };
}

function line(pen, places) {
  pen.beginPath();
  places.forEach(([x, y], k) => (k ? pen.lineTo(x, y) : pen.moveTo(x, y)));
  pen.stroke();
}

/* Prisms joined at their triangles, along a horizontal axis and seen a little from the side.
   `row` has place [m] of every triangle, twist [rad], base [m] and strain of every prism, the
   middle and the span [m] of what is shown, and the strain that is drawn strongest.  Neighbours have
   opposite hands, so that turns of one are undone by the next. */
function prismRow({ pen, width, height }, row, colour) {
  const widest = row.base.reduce((x, y) => Math.max(x, y), 0), skew = 0.22;
  const scale = Math.min(width / row.span, height / (1.3 * widest)), corners = [];
  let turn = Math.PI / 7;
  const count = row.twist.length, half = width / 2 / scale + 1;
  for (let j = 0; j <= count; j++) {
    if (Math.abs(row.place[j] - row.middle) < half + widest) {
      const radius = row.base[Math.min(j, count - 1)] / Math.sqrt(3);
      corners[j] = [0, 1, 2].map((k) => {
        const angle = turn + 2 * Math.PI * k / HANDS, side = radius * Math.cos(angle);
        return [width / 2 + scale * (row.place[j] - row.middle + skew * side),
                height / 2 - scale * (radius * Math.sin(angle) + 0.12 * side)];
      });
    }
    if (j < count) turn += (j % 2 ? -1 : 1) * row.twist[j];
  }
  for (let j = 0; j < count; j++) {
    const [here, next] = [corners[j], corners[j + 1]], hand = j % 2 ? -1 : 1;
    if (!here || !next) continue;
    const part = Math.min(1, Math.abs(row.strain[j]) / row.top);
    pen.strokeStyle = row.strain[j] < 0 ? colour.chain : colour.exact;
    pen.globalAlpha = 0.35 + 0.65 * part;
    pen.lineWidth = 1 + 2.2 * part;
    for (let k = 0; k < HANDS; k++) line(pen, [here[k], next[(k - hand + HANDS) % HANDS]]);
    pen.globalAlpha = 1;
    pen.strokeStyle = colour.ink;
    pen.lineWidth = Math.max(1.5, scale / 30);
    for (let k = 0; k < HANDS; k++) line(pen, [here[k], next[k]]);
  }
  for (const triangle of corners) {
    if (!triangle) continue;
    pen.beginPath();
    triangle.forEach(([x, y], k) => (k ? pen.lineTo(x, y) : pen.moveTo(x, y)));
    pen.closePath();
    [pen.fillStyle, pen.strokeStyle] = [colour.soft, colour.soft];
    pen.globalAlpha = 0.28;
    pen.fill();
    pen.globalAlpha = 1;
    pen.lineWidth = 1.2;
    pen.stroke();
  }
  return scale;
}

/* Places (flat, `dim` each) as they are seen of a body that is turned about the vertical and then
   tilted towards the reader: right, up, and away. */
function turned(places, dim, frame, turn, tilt) {
  const count = places.length / dim, x = new Float64Array(count), y = new Float64Array(count);
  const away = new Float64Array(count), [low, high] = frame;
  const [mx, my, md] = [0, 1, 2].map((a) => (low[a] + high[a]) / 2);
  const [cos, sin, up, over] = [Math.cos(turn), Math.sin(turn), Math.cos(tilt), Math.sin(tilt)];
  for (let i = 0; i < count; i++) {
    const p = places[i * dim] - mx, q = dim > 1 ? places[i * dim + 1] : my;
    if (dim < 3) [x[i], y[i]] = [p, q - my];
    else {
      const depth = cos * (q - md) - sin * p, z = places[i * dim + 2] - my;
      [x[i], y[i], away[i]] = [cos * p + sin * (q - md), up * z + over * depth, up * depth - over * z];
    }
  }
  return { x, y, away };
}

/* Sites at `places` with a radius, or joined by `bonds`; `shade` from 0 to 1 for each, and where
   given the angle of a `needle`.  Of a bond, `thick` is its force and `pull` its tension, each as a
   part of the largest; `pull` of a slack one is NaN.  The frame is [[left, bottom], [right, top]] [m],
   in space with the depth; `turn`, `tilt` [rad] and `zoom` are the reader's. */
function sites({ pen, width, height }, scene, colour) {
  const { places, dim, radius, shade, bonds, bars, thick, pull, walls, frame, needle } = scene;
  const { turn = 0, tilt = 0, zoom = 1 } = scene, [low, high] = frame, room = 14, flat = dim < 3;
  const wide = (high[0] - low[0]) || 1, deep = flat ? 0 : wide * Math.abs(Math.sin(tilt));
  const tall = ((high[1] - low[1]) * (flat ? 1 : Math.abs(Math.cos(tilt))) + deep) || wide / 40;
  const scale = zoom * Math.min((width - 2 * room) / wide, (height - 2 * room) / tall);
  const seen = turned(places, dim, frame, turn, tilt);
  const to = (x, y) => [width / 2 + scale * (x - (low[0] + high[0]) / 2),
                        height / 2 - scale * (y - (low[1] + high[1]) / 2)];
  const at = (i) => [width / 2 + scale * seen.x[i], height / 2 - scale * seen.y[i]];
  const farthest = (list, away) => (flat ? list : list.sort((a, b) => away(b) - away(a)));
  pen.lineCap = "round";
  pen.strokeStyle = colour.soft;
  pen.lineWidth = 1.4;
  for (const [a, b] of walls || []) line(pen, [to(...a), to(...b)]);
  const disc = (i) => {
    pen.beginPath();
    pen.arc(...at(i), Math.max(1.5, scale * radius[i]), 0, 7);
    return pen;
  };
  if (radius)
    for (const i of farthest([...radius.keys()], (i) => seen.away[i])) {
      pen.globalAlpha = 1;
      [pen.fillStyle, pen.strokeStyle, pen.lineWidth] = [colour.panel, colour.soft, 0.7];
      disc(i).fill();
      [pen.globalAlpha, pen.fillStyle] = [FLOOR + (1 - FLOOR) * Math.sqrt(Math.min(1, shade[i])), colour.chain];
      pen.fill();
      pen.globalAlpha = 1;
      pen.stroke();
      if (!needle) continue;
      const [x, y] = at(i), end = [0.8, -0.8].map((part) => part * scale * radius[i]);
      [pen.strokeStyle, pen.lineWidth] = [colour.ink, 1.5];
      line(pen, end.map((d) => [x + d * Math.sin(needle(i)), y - d * Math.cos(needle(i))]));
    }
  const depth = (k) => seen.away[bonds[k][0]] + seen.away[bonds[k][1]];
  for (const k of farthest([...(bonds || []).keys()], depth)) {
    const part = thick ? thick(k) : 0, slack = pull && Number.isNaN(pull(k));
    if (thick && !(Math.abs(part) > FLOOR)) continue;
    pen.strokeStyle = part < 0 ? colour.exact : colour.ink;
    pen.lineWidth = thick ? Math.max(0.6, 5 * Math.min(1, Math.abs(part))) : bars[k] ? 3.5 : 1;
    if (!thick) pen.strokeStyle = bars[k] ? colour.ink : colour.chain;
    if (pull && !thick) {
      pen.strokeStyle = slack ? colour.soft : shaded(pull(k), colour);
      pen.lineWidth = bars[k] ? 4.5 : slack ? 1 : 2;
      pen.setLineDash(slack ? [4, 4] : []);
    }
    line(pen, bonds[k].map(at));
  }
  pen.setLineDash([]);
  return scale;
}

/* The colour of a part of the largest tension, from -1 to 1: grey at 0. */
function shaded(part, colour) {
  const ends = [colour.soft, part < 0 ? colour.exact : colour.chain].map((c) =>
    [1, 3, 5].map((k) => parseInt(c.slice(k, k + 2), 16)));
  const mix = 0.15 + 0.85 * Math.sqrt(Math.min(1, Math.abs(part)));
  return `rgb(${ends[0].map((x, k) => Math.round(x + mix * (ends[1][k] - x)))})`;
}

/* A number with its unit and the prefix that keeps it between 1 and 1000. */
function measured(value, unit, si) {
  const power = si && value && unit && unit !== "rad" && unit !== "kg"
    ? Math.max(-3, Math.min(3, Math.floor(Math.log10(Math.abs(value)) / 3 + 1e-9))) : 0;
  const text = Number((value / 1000 ** power).toPrecision(3));
  return `${text} ${["n", "µ", "m", "", "k", "M", "G"][power + 3]}${unit}`.trimEnd();
}

/* What moves along a chain against time: columns are bonds, rows instants, time runs downwards. */
class SpaceTime {
  constructor(columns, last, top) {
    Object.assign(this, { columns, last, top, filled: 0 });
    this.image = document.createElement("canvas");
    [this.image.width, this.image.height] = [columns, ROWS];
  }

  row(time) { return Math.min(ROWS, Math.ceil(ROWS * time / this.last)); }

  /* The values (compression > 0) at a time, for all rows since the last one. */
  add(time, values, colour) {
    const to = this.row(time), from = Math.min(this.filled, to);
    this.filled = to;
    if (to <= from) return;
    const rgb = [colour.exact, colour.chain].map((c) => [1, 3, 5].map((k) => parseInt(c.slice(k, k + 2), 16)));
    const pen = this.image.getContext("2d"), data = pen.createImageData(this.columns, to - from);
    for (let b = 0; b < this.columns; b++) {
      const part = Math.sqrt(Math.min(1, Math.abs(values[b]) / this.top));
      for (let k = b; k < this.columns * (to - from); k += this.columns)
        data.data.set([...rgb[values[b] > 0 ? 1 : 0], 255 * part], 4 * k);
    }
    pen.putImageData(data, 0, from);
  }

  /* Columns from one to another, until now, in a box of a pen. */
  draw(pen, box, from, to) {
    const high = (box.b - box.t) * this.filled / ROWS;
    pen.imageSmoothingEnabled = true;
    if (this.filled)
      pen.drawImage(this.image, from, 0, to - from, this.filled, box.l, box.t, box.r - box.l, high);
  }
}
