// SPDX-FileCopyrightText: 2026 The viso authors
// SPDX-License-Identifier: GPL-3.0-or-later
// The list of verdicts: a row for each run of the same, newest first.

import { byId, clock, element, grouped, isRecording, recall, remember, setText, SIGNS, TONES } from "./format.js";

const KEPT = 300;
const LIVE_S = 1.5;
const OUTCOMES = ["accepted", "ignored", "dropped", "handled", "filter"];

const rows = new Map();
const held = new Map();
const hidden = new Set((recall("viso.hidden") ?? "handled,filter").split(",").filter((name) => OUTCOMES.includes(name)));
let isHeld = false;
let words = [];

const list = byId("verdict-list");

function groupOf(run) {
  return run.link === "filter" ? "filter" : run.outcome;
}

function isWanted(run, text) {
  return !hidden.has(groupOf(run)) && words.every((word) => text.includes(word));
}

function makeRow(run) {
  const item = element("li");
  const tone = TONES[run.outcome];
  const badge = element("span", { className: "badge", text: `${SIGNS[tone] || "·"} ${run.outcome}` });
  if (tone) badge.dataset.tone = tone;
  const what = element("span", { className: "what", text: run.link === "filter" ? `sample: ${run.name}` : run.name });
  const from = run.link === "filter" ? "in the filter" : `${run.sender ? `from ${run.sender} ` : ""}on ${run.link}`;
  what.append(" ", element("small", { text: from }));
  const count = element("span", { className: "count" });
  const why = element("span", { className: "why", text: `${run.reason} ` });
  why.append(element("code", { text: `${run.rule} · ${run.source}${run.model ? " · a model’s" : ""}` }));
  item.append(badge, what, count, why);
  item.dataset.rule = run.rule;
  item.dataset.outcome = run.outcome;
  const text = `${run.outcome} ${run.name} ${run.rule} ${run.reason} ${run.source} ${from}`.toLowerCase();
  return { item, count, text, run };
}

function put(run) {
  let row = rows.get(run.id);
  if (!row) {
    row = makeRow(run);
    rows.set(run.id, row);
    row.item.hidden = !isWanted(run, row.text);
    list.prepend(row.item);
    if (rows.size > KEPT && !isRecording()) {
      const [oldest, gone] = rows.entries().next().value;
      gone.item.remove();
      rows.delete(oldest);
    }
  }
  row.run = run;
  row.item.dataset.count = run.count;
  const span = run.last_s - run.first_s >= 0.1 ? `${clock(run.first_s, 1)}–${clock(run.last_s, 1)}` : clock(run.first_s, 1);
  setText(row.count, `${grouped(run.count)}× ${span}`);
}

/** Forget all rows. */
export function clearVerdicts() {
  rows.clear();
  held.clear();
  list.replaceChildren();
}

/** Take runs that have begun or grown, oldest first. */
export function takeRuns(runs) {
  for (const run of runs) isHeld ? held.set(run.id, run) : put(run);
}

/** Mark the rows that are still growing. */
export function markLive(nowS) {
  for (const { item, run } of rows.values()) {
    const isLive = !isHeld && nowS - run.last_s < LIVE_S && nowS >= run.first_s;
    if (item.classList.contains("live") !== isLive) item.classList.toggle("live", isLive);
    const isLater = nowS < run.first_s;
    if (item.classList.contains("later") !== isLater) item.classList.toggle("later", isLater);
  }
  tell();
}

function tell() {
  const shown = [...rows.values()].filter((row) => !row.item.hidden).length;
  let note = "";
  if (!rows.size && isRecording()) note = "The recording has no external navigation.";
  else if (!rows.size) note = "No message yet. Send some, or: viso play FILE";
  else if (shown < rows.size) note = `${shown} of ${rows.size} rows shown`;
  if (isHeld) note = `Held. ${held.size} rows have news. ${note}`;
  setText(byId("verdict-note"), note);
}

function filter() {
  for (const row of rows.values()) row.item.hidden = !isWanted(row.run, row.text);
  tell();
}

/** Show only what has these words. */
export function searchVerdicts(text) {
  byId("verdict-search").value = text;
  words = text.toLowerCase().split(/\s+/).filter(Boolean);
  filter();
}

/** Keep the list as it is, or bring it up to date again. */
export function toggleHold() {
  isHeld = !isHeld;
  byId("hold").setAttribute("aria-pressed", isHeld);
  if (!isHeld) {
    for (const run of held.values()) put(run);
    held.clear();
  }
  tell();
}

for (const outcome of OUTCOMES) {
  const chip = element("button", { text: outcome, type: "button", aria_pressed: String(!hidden.has(outcome)) });
  chip.dataset.outcome = outcome;
  chip.addEventListener("click", () => {
    hidden.has(outcome) ? hidden.delete(outcome) : hidden.add(outcome);
    chip.setAttribute("aria-pressed", String(!hidden.has(outcome)));
    remember("viso.hidden", [...hidden].join(","));
    filter();
  });
  byId("outcomes").append(chip);
}
byId("verdict-search").addEventListener("input", (event) => searchVerdicts(event.target.value));
byId("hold").addEventListener("click", toggleHold);
