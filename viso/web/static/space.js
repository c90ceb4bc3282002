// SPDX-FileCopyrightText: 2026 The viso authors
// SPDX-License-Identifier: GPL-3.0-or-later
// The path in space: from above with north up, or from wherever it is turned to.

import { begin, colour, describe, stepOf, tick } from "./charts.js";
import { byId, short } from "./format.js";
import { pointHere, time } from "./time.js";

const SMALLEST_SPAN_M = 2;
const ABOVE = Math.PI / 2;
const MARGIN = 28;

const canvas = byId("plan");
const view = { azimuth: 0, elevation: ABOVE };
let redraw = () => {};

/** Say how to draw again. */
export function connectSpace(how) {
  redraw = how;
}

const isAbove = () => view.elevation === ABOVE && view.azimuth === 0;

function turn(azimuth, elevation) {
  view.azimuth = azimuth;
  view.elevation = Math.min(Math.max(elevation, 0), ABOVE);
  byId("view-above").setAttribute("aria-pressed", String(isAbove()));
  byId("view-space").setAttribute("aria-pressed", String(!isAbove()));
  canvas.dataset.view = isAbove() ? "above" : "space";
  redraw();
}

/** Return a function from metres NED to pixels, in which all of a box fits. */
function projection(bounds, width, height) {
  const [sinA, cosA] = [Math.sin(view.azimuth), Math.cos(view.azimuth)];
  const [sinE, cosE] = [Math.sin(view.elevation), Math.cos(view.elevation)];
  const flat = ([n, e, d]) => [e * cosA - n * sinA, (n * cosA + e * sinA) * sinE - d * cosE];
  const corners = bounds[0].flatMap((n) => bounds[1].flatMap((e) => bounds[2].map((d) => flat([n, e, d]))));
  const [[left, right], [low, high]] = [0, 1].map((axis) => extent(corners.map((corner) => corner[axis])));
  const scale = Math.min(
    (width - 2 * MARGIN) / Math.max(right - left, SMALLEST_SPAN_M),
    (height - 2 * MARGIN) / Math.max(high - low, SMALLEST_SPAN_M),
  );
  const toXY = (pos) => {
    const [x, y] = flat(pos);
    return [width / 2 + (x - (left + right) / 2) * scale, height / 2 - (y - (low + high) / 2) * scale];
  };
  return { toXY, flat, scale };
}

function extent(values) {
  let [low, high] = [Infinity, -Infinity];
  for (const value of values) {
    low = Math.min(low, value);
    high = Math.max(high, value);
  }
  return low > high ? [0, 0] : [low, high];
}

function strokePath(context, places, toXY) {
  context.beginPath();
  places.forEach((pos, index) => {
    if (!pos) return;
    places[index - 1] ? context.lineTo(...toXY(pos)) : context.moveTo(...toXY(pos));
  });
  context.stroke();
}

/** Draw the path of the time that is shown. */
export function drawSpace(points) {
  const begun = begin(canvas);
  if (!begun) return;
  const { context, width, height } = begun;
  const shown = points.filter((point) => point.t >= time.startS && point.t <= time.endS);
  const vision = shown.filter((point) => point.vision?.pos);
  const places = shown.map((point) => point.ekf);
  const all = [...vision.map((point) => point.vision.pos), ...places.filter(Boolean)];
  const bounds = [0, 1, 2].map((axis) => extent(all.map((pos) => pos[axis])));
  const { toXY, flat, scale } = projection(bounds, width, height);
  const ground = Math.max(bounds[2][1], 0);

  drawGround(context, { bounds, ground, toXY, scale, width, height });
  if (!isAbove()) {
    context.strokeStyle = colour("edge");
    context.lineWidth = 1;
    strokePath(context, places.map((pos) => pos && [pos[0], pos[1], ground]), toXY);
    drawPoles(context, places, ground, toXY);
  }
  for (const { vision: seen } of vision) {
    const [x, y] = toXY(seen.pos);
    if (seen.ignored) {
      context.beginPath();
      context.strokeStyle = colour("warn");
      context.lineWidth = 1.5;
      context.arc(x, y, 3, 0, 7);
      context.stroke();
    } else {
      context.fillStyle = colour("vision");
      context.fillRect(x - 1.75, y - 1.75, 3.5, 3.5);
    }
  }
  context.strokeStyle = colour("ekf");
  context.lineWidth = 2;
  strokePath(context, places, toXY);
  const here = pointHere(points);
  if (here?.ekf) drawHere(context, here, toXY, scale);
  if (here?.vision?.pos && time.cursorS !== null) drawCross(context, toXY(here.vision.pos));
  drawNorth(context, flat, width);
  const words = (name, pos) =>
    pos ? `${name} at ${short(pos[0])} m north, ${short(pos[1])} m east, ${short(-pos[2])} m up` : `no ${name}`;
  const from = isAbove() ? "from above" : "in space";
  const seen = time.cursorS === null ? vision.at(-1)?.vision.pos : here?.vision?.pos;
  describe(canvas, `Path ${from}: ${words("vision", seen)}; ${words("EKF", here?.ekf)}`);
}

function drawGround(context, { bounds, ground, toXY, scale, width, height }) {
  const step = stepOf(width / scale, 7);
  const reach = isAbove() ? Math.hypot(width, height) / scale / 2 : step;
  const [north, east] = [0, 1].map((axis) => {
    const [low, high] = bounds[axis];
    return [Math.floor((low - reach) / step) * step, Math.ceil((high + reach) / step) * step];
  });
  context.strokeStyle = colour("grid");
  context.lineWidth = 1;
  context.beginPath();
  for (let n = north[0]; n <= north[1] + step / 2; n += step) {
    context.moveTo(...toXY([n, east[0], ground]));
    context.lineTo(...toXY([n, east[1], ground]));
  }
  for (let e = east[0]; e <= east[1] + step / 2; e += step) {
    context.moveTo(...toXY([north[0], e, ground]));
    context.lineTo(...toXY([north[1], e, ground]));
  }
  context.stroke();
  // The origin and the scale.
  const arm = 5 / scale;
  context.strokeStyle = context.fillStyle = colour("muted");
  context.beginPath();
  context.moveTo(...toXY([0, -arm, 0]));
  context.lineTo(...toXY([0, arm, 0]));
  context.moveTo(...toXY([-arm, 0, 0]));
  context.lineTo(...toXY([arm, 0, 0]));
  context.moveTo(10, height - 10);
  context.lineTo(10 + step * scale, height - 10);
  context.stroke();
  context.textAlign = "left";
  context.textBaseline = "bottom";
  context.fillText(`${tick(step, step)} m`, 10, height - 13);
}

/** Draw how high the path is above the ground, here and there. */
function drawPoles(context, places, ground, toXY) {
  const every = Math.max(1, Math.floor(places.length / 40));
  context.strokeStyle = colour("grid");
  context.beginPath();
  places.forEach((pos, index) => {
    if (!pos || index % every) return;
    context.moveTo(...toXY(pos));
    context.lineTo(...toXY([pos[0], pos[1], ground]));
  });
  context.stroke();
}

function drawHere(context, { ekf: [n, e, d], yaw_deg: yawDeg }, toXY, scale) {
  const yaw = ((yawDeg || 0) * Math.PI) / 180;
  const [sin, cos] = [Math.sin(yaw), Math.cos(yaw)];
  const corner = (ahead, right) =>
    toXY([n + (ahead * cos - right * sin) / scale, e + (ahead * sin + right * cos) / scale, d]);
  context.fillStyle = colour("ekf");
  context.strokeStyle = colour("sunk");
  context.lineWidth = 1;
  context.beginPath();
  context.moveTo(...corner(10, 0));
  for (const [ahead, right] of [[-7, 6], [-3, 0], [-7, -6]]) context.lineTo(...corner(ahead, right));
  context.closePath();
  context.fill();
  context.stroke();
}

function drawCross(context, [x, y]) {
  context.strokeStyle = colour("vision");
  context.lineWidth = 2;
  context.beginPath();
  context.moveTo(x - 7, y);
  context.lineTo(x + 7, y);
  context.moveTo(x, y - 7);
  context.lineTo(x, y + 7);
  context.stroke();
}

function drawNorth(context, flat, width) {
  const [x, y] = flat([1, 0, 0]);
  const [centreX, centreY] = [width - 24, 26];
  context.strokeStyle = context.fillStyle = colour("muted");
  context.lineWidth = 1.5;
  context.beginPath();
  context.moveTo(centreX - 10 * x, centreY + 10 * y);
  context.lineTo(centreX + 10 * x, centreY - 10 * y);
  context.stroke();
  context.textAlign = "center";
  context.textBaseline = "middle";
  context.fillText("N", centreX + 17 * x, centreY - 17 * y);
}

canvas.addEventListener("pointermove", ({ buttons, movementX, movementY }) => {
  if (buttons) turn(view.azimuth - movementX * 0.01, view.elevation + movementY * 0.01);
});
canvas.addEventListener("pointerdown", (event) => canvas.setPointerCapture(event.pointerId));
canvas.addEventListener("keydown", (event) => {
  const by = { ArrowLeft: [0.15, 0], ArrowRight: [-0.15, 0], ArrowUp: [0, -0.1], ArrowDown: [0, 0.1] }[event.key];
  if (!by) return;
  event.preventDefault();
  turn(view.azimuth + by[0], view.elevation + by[1]);
});
byId("view-above").addEventListener("click", () => turn(0, ABOVE));
byId("view-space").addEventListener("click", () => turn(0.6, 0.5));
