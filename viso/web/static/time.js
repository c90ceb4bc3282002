// SPDX-FileCopyrightText: 2026 The viso authors
// SPDX-License-Identifier: GPL-3.0-or-later
// The time that all plots show: one window, one cursor, held or following.

import { byId, clock, setText } from "./format.js";

const USUAL_SPAN_S = 60;
const SHORTEST_SPAN_S = 2;

/** What is shown, in seconds since boot; without a cursor, what is newest counts. */
export const time = { startS: 0, endS: USUAL_SPAN_S, spanS: USUAL_SPAN_S, cursorS: null, isHeld: false };

let firstS = 0;
let lastS = 0;
let pinnedS = null;
let hoverS = null;
let wantedSpanS = USUAL_SPAN_S;
let endS = null;
let onChange = () => {};

/** Say what is to be done when something else is to be shown. */
export function connectTime(changed) {
  onChange = changed;
}

/** Show all there is, as of a recording. */
export function showWhole() {
  wantedSpanS = Infinity;
  endS = null;
}

/** Take from when to when there is something to show. */
export function takeTimes(first, last) {
  firstS = first;
  lastS = last;
  if (pinnedS !== null && (pinnedS < firstS || pinnedS > lastS)) pinnedS = null;
  const wholeS = Math.max(lastS - firstS, SHORTEST_SPAN_S);
  time.spanS = wantedSpanS === Infinity ? wholeS : wantedSpanS;
  if (pinnedS === null) endS = null;
  else if (endS === null || pinnedS > endS || pinnedS < endS - time.spanS) endS = pinnedS + time.spanS / 2;
  time.endS = endS === null ? lastS : Math.max(Math.min(endS, lastS), Math.min(firstS + time.spanS, lastS));
  time.startS = time.endS - time.spanS;
  time.cursorS = hoverS ?? pinnedS;
  const slider = byId("scrubber");
  slider.min = firstS.toFixed(1);
  slider.max = lastS.toFixed(1);
  if (document.activeElement !== slider || pinnedS === null) slider.value = pinnedS ?? lastS;
  slider.setAttribute("aria-valuetext", pinnedS === null ? "the newest" : clock(pinnedS, 1));
  setText(byId("shown-time"), `${clock(time.cursorS ?? lastS, 1)} of ${clock(lastS, 1)}`);
}

/** Return the point at the cursor, or the newest; null where there is none. */
export function pointHere(points) {
  if (time.cursorS === null) return points.at(-1) ?? null;
  let [low, high] = [0, points.length];
  while (low < high) {
    const middle = (low + high) >> 1;
    points[middle].t <= time.cursorS ? (low = middle + 1) : (high = middle);
  }
  return points[low - 1] ?? points[0] ?? null;
}

function pin(seconds) {
  pinnedS = seconds >= lastS - 0.05 ? null : Math.max(seconds, firstS);
  onChange();
}

/** Show more or less time around the cursor. */
export function zoom(factor) {
  const middle = time.cursorS ?? time.endS;
  const wholeS = Math.max(lastS - firstS, SHORTEST_SPAN_S);
  const spanS = Math.max(SHORTEST_SPAN_S, time.spanS * factor);
  if (endS !== null) endS = middle + (time.endS - middle) * (spanS / time.spanS);
  wantedSpanS = spanS >= wholeS && factor > 1 ? Infinity : spanS;
  onChange();
}

/** Let a canvas show the cursor where the pointer is, and keep it there at a click; the wheel zooms with Ctrl. */
export function followPointer(canvas) {
  const secondsAt = (event) => {
    const { left, width } = canvas.getBoundingClientRect();
    const begin = Number(canvas.dataset.left ?? 4);
    const share = (event.clientX - left - begin) / (width - begin - 4);
    return time.startS + Math.min(Math.max(share, 0), 1) * time.spanS;
  };
  canvas.addEventListener("pointermove", (event) => {
    hoverS = Math.max(secondsAt(event), firstS);
    if (event.buttons) pin(hoverS);
    else onChange();
  });
  canvas.addEventListener("pointerdown", (event) => pin(secondsAt(event)));
  for (const name of ["pointerleave", "pointercancel"]) {
    canvas.addEventListener(name, () => {
      hoverS = null;
      onChange();
    });
  }
  canvas.addEventListener(
    "wheel",
    (event) => {
      if (!event.ctrlKey) return;
      event.preventDefault();
      zoom(event.deltaY > 0 ? 1.25 : 0.8);
    },
    { passive: false },
  );
}

/** Keep the plots as they are while data goes on, or bring them up to date. */
export function toggleHoldPlots() {
  time.isHeld = !time.isHeld;
  byId("hold-plots").setAttribute("aria-pressed", time.isHeld);
  onChange();
}

byId("scrubber").addEventListener("input", (event) => pin(Number(event.target.value)));
byId("newest").addEventListener("click", () => pin(Infinity));
byId("zoom-in").addEventListener("click", () => zoom(0.5));
byId("zoom-out").addEventListener("click", () => zoom(2));
byId("hold-plots").addEventListener("click", toggleHoldPlots);
for (const canvas of document.querySelectorAll("canvas.strip")) followPointer(canvas);
