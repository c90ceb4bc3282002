// SPDX-FileCopyrightText: 2026 The viso authors
// SPDX-License-Identifier: GPL-3.0-or-later
// Words, numbers and elements that several parts of the page share.

export const byId = (id) => document.getElementById(id);

/** Return whether the page shows a recording, which nothing changes. */
export const isRecording = () => "recording" in document.body.dataset;

/** Return an element with a class and a text. */
export function element(tag, { className = "", text = "", ...attributes } = {}) {
  const made = document.createElement(tag);
  if (className) made.className = className;
  if (text !== "") made.textContent = text;
  for (const [name, value] of Object.entries(attributes)) made.setAttribute(name.replaceAll("_", "-"), value);
  return made;
}

/** Set a text where it differs, so that nothing is laid out or read aloud again without need. */
export function setText(target, text) {
  if (target.textContent !== text) target.textContent = text;
}

/** Return seconds since boot as minutes and seconds. */
export function clock(seconds, digits = 0) {
  const rounded = Number(seconds.toFixed(digits));
  const minutes = Math.floor(rounded / 60);
  const rest = (rounded - 60 * minutes).toFixed(digits).padStart(digits ? digits + 3 : 2, "0");
  return `${minutes}:${rest}`;
}

/** Return a number with three significant digits or so; a dash for none. */
export function short(number) {
  if (number === null || number === undefined) return "–";
  const size = Math.abs(number);
  return number.toFixed(size >= 100 ? 0 : size >= 10 ? 1 : 2);
}

/** Return a count with spaces between thousands. */
export const grouped = (count) => String(count).replace(/\B(?=(\d{3})+$)/g, "\u202f");

export const SEVERITIES = ["emergency", "alert", "critical", "error", "warning", "notice", "info", "debug"];

export const TONES = {
  accepted: "good", fused: "good", reset: "good",
  ignored: "warn", unused: "warn", lost: "warn", refused: "warn",
  dropped: "bad", rejected: "bad",
};
export const SIGNS = { good: "✓", warn: "◐", bad: "✕" };

/** Return what localStorage remembers; browsers may forbid it. */
export function recall(name) {
  try { return localStorage.getItem(name); } catch { return null; }
}

export function remember(name, value) {
  try { localStorage.setItem(name, value); } catch { /* it is for this visit alone, then */ }
}
