// SPDX-FileCopyrightText: 2026 The viso authors
// SPDX-License-Identifier: GPL-3.0-or-later
// The path from above and the height; lag; innovations.

import { begin, colour, describe, drawStrip, stepOf, tick } from "./charts.js";
import { byId, element, setText, short } from "./format.js";

const KINDS = ["pose", "height", "yaw", "velocity", "odometry"];
const SMALLEST_SPAN_M = 2;

const strips = new Map();

/** Draw the path from above: north is up. */
export function drawPlan(points) {
  const canvas = byId("plan");
  const begun = begin(canvas);
  if (!begun) return;
  const { context, width, height } = begun;
  const vision = points.filter((point) => point.vision?.pos);
  const ekf = points.filter((point) => point.ekf);
  const all = [...vision.map((point) => point.vision.pos), ...ekf.map((point) => point.ekf)];
  const bounds = [0, 1].map((axis) => extent(all.map((pos) => pos[axis])));
  const spans = bounds.map(([low, high]) => Math.max(high - low, SMALLEST_SPAN_M) * 1.15);
  const scale = Math.min((height - 24) / spans[0], (width - 24) / spans[1]);
  const middle = bounds.map(([low, high]) => (low + high) / 2);
  const toXY = (pos) => [width / 2 + (pos[1] - middle[1]) * scale, height / 2 - (pos[0] - middle[0]) * scale];

  drawSquares(context, { width, height, scale, middle, toXY });
  for (const { vision: seen } of vision) {
    const [x, y] = toXY(seen.pos);
    context.beginPath();
    if (seen.ignored) {
      context.strokeStyle = colour("warn");
      context.lineWidth = 1.5;
      context.arc(x, y, 3, 0, 7);
      context.stroke();
    } else {
      context.fillStyle = colour("vision");
      context.arc(x, y, 2, 0, 7);
      context.fill();
    }
  }
  context.strokeStyle = colour("ekf");
  context.lineWidth = 2;
  context.beginPath();
  points.forEach((point, index) => {
    if (!point.ekf) return;
    const at = toXY(point.ekf);
    points[index - 1]?.ekf ? context.lineTo(...at) : context.moveTo(...at);
  });
  context.stroke();
  const now = points.at(-1);
  if (now?.ekf) drawHere(context, toXY(now.ekf), now.yaw_deg);
  const words = (name, pos) => (pos ? `${name} at ${short(pos[0])} m north, ${short(pos[1])} m east` : `no ${name}`);
  describe(canvas, `Path from above: ${words("vision", vision.at(-1)?.vision.pos)}; ${words("EKF", now?.ekf)}`);
}

function extent(values) {
  let [low, high] = [Infinity, -Infinity];
  for (const value of values) {
    low = Math.min(low, value);
    high = Math.max(high, value);
  }
  return low > high ? [0, 0] : [low, high];
}

function drawSquares(context, { width, height, scale, middle, toXY }) {
  const step = stepOf(width / scale, 7);
  context.strokeStyle = colour("grid");
  context.lineWidth = 1;
  context.beginPath();
  for (let e = Math.ceil((middle[1] - width / 2 / scale) / step) * step; e < middle[1] + width / 2 / scale; e += step) {
    const [x] = toXY([0, e]);
    context.moveTo(x, 0);
    context.lineTo(x, height);
  }
  for (let n = Math.ceil((middle[0] - height / 2 / scale) / step) * step; n < middle[0] + height / 2 / scale; n += step) {
    const [, y] = toXY([n, 0]);
    context.moveTo(0, y);
    context.lineTo(width, y);
  }
  context.stroke();
  // The origin, the scale, and where north is.
  const [x, y] = toXY([0, 0]);
  context.strokeStyle = context.fillStyle = colour("muted");
  context.beginPath();
  context.moveTo(x - 5, y);
  context.lineTo(x + 5, y);
  context.moveTo(x, y - 5);
  context.lineTo(x, y + 5);
  context.moveTo(10, height - 10);
  context.lineTo(10 + step * scale, height - 10);
  context.stroke();
  context.textAlign = "left";
  context.textBaseline = "bottom";
  context.fillText(`${tick(step, step)} m`, 10, height - 13);
  context.textAlign = "center";
  context.textBaseline = "top";
  context.fillText("N", width - 14, 6);
  context.beginPath();
  context.moveTo(width - 14, 19);
  context.lineTo(width - 18, 28);
  context.lineTo(width - 10, 28);
  context.fill();
}

function drawHere(context, [x, y], yawDeg) {
  context.save();
  context.translate(x, y);
  context.rotate(((yawDeg || 0) * Math.PI) / 180);
  context.fillStyle = colour("ekf");
  context.strokeStyle = colour("sunk");
  context.beginPath();
  context.moveTo(0, -10);
  context.lineTo(6, 7);
  context.lineTo(0, 3);
  context.lineTo(-6, 7);
  context.closePath();
  context.fill();
  context.stroke();
  context.restore();
}

/** Draw height over time. */
export function drawHeight(points, nowS) {
  const canvas = byId("height");
  drawStrip(canvas, nowS, [
    { values: points.filter((p) => p.vision?.pos).map((p) => [p.t, -p.vision.pos[2]]), colour: "vision", dots: true },
    { values: points.map((p) => [p.t, p.ekf ? -p.ekf[2] : null]), colour: "ekf" },
  ]);
  const now = points.at(-1);
  const words = (name, pos) => (pos ? `${name} ${short(-pos[2])} m` : `no ${name}`);
  describe(canvas, `Height: ${words("vision", now?.vision?.pos)}, ${words("EKF", now?.ekf)}`);
}

/** Draw lag over time. */
export function drawLag(points, nowS) {
  const canvas = byId("lag");
  const of = (index) => points.map((point) => [point.t, point.lag ? point.lag[index] : null]);
  drawStrip(canvas, nowS, [
    { values: of(1), colour: "bad", dash: [4, 3] },
    { values: of(0), colour: "vision" },
  ]);
  const now = points.at(-1)?.lag;
  describe(canvas, now ? `Lag: median ${short(now[0])} ms, worst ${short(now[1])} ms` : "Lag: nothing at the moment");
}

function stripOf(kind) {
  if (!strips.has(kind)) {
    const row = element("div", { className: "innovation" });
    const canvas = element("canvas", { role: "img", aria_label: `Innovation of ${kind} over its gate` });
    const numbers = element("span", { className: "numbers" });
    const value = element("span");
    const ratio = element("small");
    numbers.append(value, ratio);
    row.append(element("b", { text: kind }), canvas, numbers);
    strips.set(kind, { row, canvas, value, ratio });
    const before = KINDS.slice(KINDS.indexOf(kind) + 1).map((next) => strips.get(next)?.row).find(Boolean);
    byId("innovations").insertBefore(row, before || null);
  }
  return strips.get(kind);
}

/** Draw innovations over their gates, a strip for each kind of sample that was tested. */
export function drawInnovations(points, nowS, units) {
  const known = new Set(points.flatMap((point) => Object.keys(point.innovations)));
  byId("innovations-empty").hidden = known.size > 0 || strips.size > 0;
  for (const kind of KINDS.filter((name) => known.has(name) || strips.has(name))) {
    const strip = stripOf(kind);
    const tested = points.filter((point) => point.innovations[kind]);
    const values = tested.map((point) => [point.t, point.innovations[kind].ratio]);
    const rejected = tested.filter((point) => point.innovations[kind].rejected);
    drawStrip(
      strip.canvas,
      nowS,
      [
        { values, colour: "vision" },
        { values: rejected.map((point) => [point.t, point.innovations[kind].ratio]), colour: "bad", dots: true },
      ],
      { limits: [0, 1.5], mark: 1, labels: false },
    );
    const last = tested.at(-1);
    const isNow = last && nowS - last.t < 1.5;
    const now = isNow ? last.innovations[kind] : null;
    setText(strip.value, now ? `${short(now.value)} of ${short(now.gate)} ${units[kind] || ""}` : "not tested now");
    setText(strip.ratio, now ? `${now.ratio > 1 ? "✕ over, ratio" : "ratio"} ${short(now.ratio)}` : "");
    strip.ratio.dataset.tone = now && now.ratio > 1 ? "bad" : "";
    describe(strip.canvas, `Innovation of ${kind}: ${strip.value.textContent} ${strip.ratio.textContent}`);
  }
}
