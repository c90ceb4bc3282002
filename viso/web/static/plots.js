// SPDX-FileCopyrightText: 2026 The viso authors
// SPDX-License-Identifier: GPL-3.0-or-later
// What goes over time: height, lag, quality, innovations; each tells its numbers at the cursor.

import { describe, drawStrip } from "./charts.js";
import { byId, element, isRecording, setText, short } from "./format.js";
import { followPointer, pointHere, time } from "./time.js";

const KINDS = ["pose", "height", "yaw", "velocity", "odometry"];
const RECENT_S = 1.5;

const strips = new Map();
let sources = {};

/** Say by what the vehicle's own filter was fed, by kind: innovations are then its own. */
export function nameSources(names) {
  sources = names;
  setText(byId("innovations-of"), "the vehicle’s own, whatever fed them");
  setText(byId("innovations-empty"), "The log tells of nothing that the filter has tested.");
}

/** Draw height over time. */
export function drawHeight(points) {
  const canvas = byId("height");
  drawStrip(canvas, [
    { values: points.filter((p) => p.vision?.pos).map((p) => [p.t, -p.vision.pos[2]]), colour: "vision", dots: true },
    { values: points.map((p) => [p.t, p.ekf ? -p.ekf[2] : null]), colour: "ekf" },
  ]);
  const here = pointHere(points);
  const words = (name, pos) => (pos ? `${name} ${short(-pos[2])} m` : `no ${name}`);
  const told = `${words("vision", here?.vision?.pos)}, ${words("EKF", here?.ekf)}`;
  setText(byId("height-now"), told);
  describe(canvas, `Height: ${told}`);
}

function drawPair(name, title, unit, points, options) {
  const canvas = byId(name);
  const of = (index) => points.map((point) => [point.t, point[name] ? point[name][index] : null]);
  const curves = [
    { values: of(1), colour: "bad", dash: [4, 3] },
    { values: of(0), colour: "vision" },
  ];
  drawStrip(canvas, curves, options);
  const here = pointHere(points)?.[name];
  const none = points.some((point) => point[name]) ? "nothing at that moment" : isRecording() ? "not recorded" : "nothing yet";
  const told = here ? `median ${short(here[0])} ${unit}, worst ${short(here[1])} ${unit}` : none;
  setText(byId(`${name}-now`), told);
  describe(canvas, `${title}: ${told}`);
}

/** Draw lag over time. */
export const drawLag = (points) => drawPair("lag", "Lag", "ms", points);

/** Draw quality over time, with the least that is taken. */
export const drawQuality = (points, least) =>
  drawPair("quality", "Quality", "%", points, { limits: [-4, 104], mark: least > 0 ? least : null });

function stripOf(kind) {
  if (!strips.has(kind)) {
    const row = element("div", { className: "innovation" });
    const canvas = element("canvas", { role: "img", aria_label: `Innovation of ${kind} over its gate` });
    const numbers = element("span", { className: "numbers" });
    const value = element("span");
    const ratio = element("small");
    numbers.append(value, ratio);
    const name = element("b", { text: kind });
    if (sources[kind]) name.append(element("small", { text: sources[kind] }));
    row.append(name, canvas, numbers);
    followPointer(canvas);
    strips.set(kind, { row, canvas, value, ratio });
    const before = KINDS.slice(KINDS.indexOf(kind) + 1).map((next) => strips.get(next)?.row).find(Boolean);
    byId("innovations").insertBefore(row, before || null);
  }
  return strips.get(kind);
}

/** Draw innovations over their gates, a strip for each kind of sample that was tested. */
export function drawInnovations(points, units) {
  const known = new Set(points.flatMap((point) => Object.keys(point.innovations)));
  byId("innovations-empty").hidden = known.size > 0 || strips.size > 0;
  const nowS = time.cursorS ?? time.endS;
  for (const kind of KINDS.filter((name) => known.has(name) || strips.has(name))) {
    const strip = stripOf(kind);
    const tested = points.filter((point) => point.innovations[kind]);
    const rejected = tested.filter((point) => point.innovations[kind].rejected);
    const ratioOf = (point) => [point.t, point.innovations[kind].ratio];
    const curves = [
      { values: tested.map(ratioOf), colour: "vision" },
      { values: rejected.map(ratioOf), colour: "bad", dots: true },
    ];
    drawStrip(strip.canvas, curves, { limits: [0, 1.5], mark: 1, labels: false });
    const last = tested.length ? pointHere(tested) : null;
    const now = last && Math.abs(nowS - last.t) < RECENT_S ? last.innovations[kind] : null;
    const gate = now?.gate == null ? "" : ` of ${short(now.gate)}`;
    setText(strip.value, now ? `${short(now.value)}${gate} ${units[kind] || ""}` : "not tested");
    setText(strip.ratio, now ? `${now.ratio > 1 ? "✕ over, ratio" : "ratio"} ${short(now.ratio)}` : "");
    strip.ratio.dataset.tone = now && now.ratio > 1 ? "bad" : "";
    describe(strip.canvas, `Innovation of ${kind}: ${strip.value.textContent} ${strip.ratio.textContent}`);
  }
}
