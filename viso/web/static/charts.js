// SPDX-FileCopyrightText: 2026 The viso authors
// SPDX-License-Identifier: GPL-3.0-or-later
// Drawing on canvases: colours of the theme, sharp lines, curves over the time that is shown.

import { clock } from "./format.js";
import { time } from "./time.js";

const NAMES = ["vision", "ekf", "warn", "bad", "good", "muted", "text", "grid", "edge", "sunk"];
const SECONDS = [0.2, 0.5, 1, 2, 5, 10, 15, 30, 60, 120, 300, 600, 1800, 3600];
const probe = document.createElement("span");
let palette = {};

/** Read the colours of the theme again. */
export function readPalette() {
  document.body.append(probe);
  palette = Object.fromEntries(
    NAMES.map((name) => {
      probe.style.color = `var(--${name})`;
      return [name, getComputedStyle(probe).color];
    }),
  );
  probe.remove();
}

export const colour = (name) => palette[name];

/** Return a drawing context whose units are CSS pixels, with its size; null while the canvas is not shown. */
export function begin(canvas) {
  const width = canvas.clientWidth;
  const height = canvas.clientHeight;
  if (!width || !height) return null;
  const ratio = devicePixelRatio || 1;
  if (canvas.width !== Math.round(width * ratio) || canvas.height !== Math.round(height * ratio)) {
    canvas.width = Math.round(width * ratio);
    canvas.height = Math.round(height * ratio);
  }
  const context = canvas.getContext("2d");
  context.setTransform(ratio, 0, 0, ratio, 0, 0);
  context.clearRect(0, 0, width, height);
  context.font = "11px system-ui, sans-serif";
  return { context, width, height };
}

/** Return a step of 1, 2 or 5 times a power of ten, so that about so many fit. */
export function stepOf(span, count) {
  const rough = span / count;
  const power = 10 ** Math.floor(Math.log10(rough));
  return power * ([1, 2, 5].find((factor) => factor * power >= rough) || 10);
}

/** Return a number as precise as its step asks for. */
export function tick(value, step) {
  return value.toFixed(Math.max(0, -Math.floor(Math.log10(step) + 1e-9)));
}

/** Draw a line through points that are no farther apart than ``reach``; one alone is a dot. */
function line(context, points, { stroke, dash = [], width = 1.5, reach = Infinity }) {
  context.strokeStyle = stroke;
  context.setLineDash(dash);
  context.lineWidth = width;
  context.lineCap = dash.length ? "butt" : "round";
  context.beginPath();
  let before = -Infinity;
  for (const [x, y] of points) {
    if (!(x - before <= reach)) context.moveTo(x, y);
    context.lineTo(x, y);
    before = x;
  }
  context.stroke();
  context.setLineDash([]);
}

/** Return over how much time without a value a line goes on: some messages come less often than points. */
const reachS = () => Math.max(1, time.spanS / 300);

/**
 * Draw curves over the time that is shown, with the cursor.
 *
 * curves: [{ values: [[t, y or null], ...], colour, dash, dots }]; limits: [low, high] or null for what is there;
 * mark: a level to be drawn as a line.
 */
export function drawStrip(canvas, curves, { limits = null, mark = null, labels = true } = {}) {
  const begun = begin(canvas);
  if (!begun) return;
  const { context, width, height } = begun;
  const left = labels ? 40 : 4;
  const bottom = labels ? height - 16 : height - 3;
  const top = 5;
  const { startS, endS, spanS } = time;
  canvas.dataset.left = left;
  const shown = curves.map((curve) => curve.values.filter(([t, y]) => y !== null && t >= startS && t <= endS));
  let [low, high] = limits || [Infinity, -Infinity];
  if (!limits) {
    for (const values of shown) {
      for (const [, y] of values) {
        low = Math.min(low, y);
        high = Math.max(high, y);
      }
    }
    const margin = Math.max((high - low) * 0.1, 1e-3, Math.abs(high) * 1e-3);
    low -= margin;
    high += margin;
  }
  const toX = (t) => left + ((t - startS) / spanS) * (width - left - 4);
  const toY = (y) => bottom - ((Math.min(Math.max(y, low), high) - low) / (high - low)) * (bottom - top);
  if (labels) drawTimes(context, { toX, left, width, bottom });
  if (labels && low < high) drawLevels(context, { low, high, toY, left, width });
  if (mark !== null) {
    line(context, [[left, toY(mark)], [width - 4, toY(mark)]], { stroke: colour("bad"), dash: [5, 3], width: 1 });
  }
  curves.forEach((curve, index) => {
    const points = shown[index].map(([t, y]) => [toX(t), toY(y)]);
    if (curve.dots) {
      context.fillStyle = colour(curve.colour);
      for (const [x, y] of points) context.fillRect(x - 1.5, y - 1.5, 3, 3);
    } else line(context, points, { stroke: colour(curve.colour), dash: curve.dash, reach: toX(startS + reachS()) - left });
  });
  if (time.cursorS !== null && time.cursorS >= startS && time.cursorS <= endS) {
    const x = toX(time.cursorS);
    line(context, [[x, 0], [x, height]], { stroke: colour("text"), width: 1 });
  }
}

function drawLevels(context, { low, high, toY, left, width }) {
  context.textBaseline = "middle";
  context.textAlign = "right";
  const step = stepOf(high - low, 4);
  for (let y = Math.ceil(low / step) * step; y <= high; y += step) {
    line(context, [[left, toY(y)], [width - 4, toY(y)]], { stroke: colour("grid"), width: 1 });
    context.fillStyle = colour("muted");
    context.fillText(tick(y, step), left - 5, toY(y));
  }
}

function drawTimes(context, { toX, left, width, bottom }) {
  context.textBaseline = "middle";
  context.textAlign = "center";
  const every = SECONDS.find((seconds) => seconds >= (time.spanS * 70) / (width - left)) ?? time.spanS;
  for (let t = Math.ceil(Math.max(time.startS, 0) / every) * every; t <= time.endS; t += every) {
    if (toX(t) > width - 16) continue;
    line(context, [[toX(t), bottom], [toX(t), bottom + 3]], { stroke: colour("edge"), width: 1 });
    context.fillStyle = colour("muted");
    context.fillText(clock(t, every < 1 ? 1 : 0), toX(t), bottom + 10);
  }
}

/** Tell in words what a canvas shows. */
export function describe(canvas, text) {
  if (canvas.getAttribute("aria-label") !== text) canvas.setAttribute("aria-label", text);
}
