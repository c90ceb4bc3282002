// SPDX-FileCopyrightText: 2026 The viso authors
// SPDX-License-Identifier: GPL-3.0-or-later
// The table of messages per second: offered, and their outcomes.

import { byId, element, grouped, isRecording, setText } from "./format.js";

const COLUMNS = ["offered", "accepted", "fused", "ignored", "dropped"];
const body = byId("rates").tBodies[0];
const rows = new Map();

function isNavigation(row) {
  return row.total.accepted + row.total.ignored + row.total.dropped > 0;
}

function makeRow(name) {
  const line = element("tr");
  const head = element("th", { scope: "row" });
  for (const part of name.split(/(?<=_)/)) head.append(part, element("wbr"));
  line.append(head);
  const cells = Object.fromEntries(COLUMNS.map((column) => [column, element("td")]));
  line.append(...Object.values(cells));
  const bar = element("span", { className: "bar", role: "img" });
  const parts = Object.fromEntries(
    ["fused", "accepted", "ignored", "dropped"].map((part) => [part, element("i", { className: part })]),
  );
  bar.append(...Object.values(parts));
  const share = element("td", { className: "share" });
  share.append(bar);
  line.append(share);
  return { line, cells, bar, parts };
}

/** Show the rates of the moment. */
export function showRates(rates) {
  byId("rates-empty").hidden = rates.length > 0;
  if (isRecording()) setText(byId("rates-empty"), "None is recorded.");
  byId("rates").hidden = rates.length === 0;
  const sorted = [...rates].sort((a, b) => isNavigation(b) - isNavigation(a) || a.name.localeCompare(b.name));
  sorted.forEach((rate, index) => {
    let row = rows.get(rate.name);
    if (!row) rows.set(rate.name, (row = makeRow(rate.name)));
    if (body.children[index] !== row.line) body.insertBefore(row.line, body.children[index] || null);
    for (const column of COLUMNS) {
      const cell = row.cells[column];
      const isTold = rate.per_s[column] !== null;
      setText(cell, isTold ? rate.per_s[column] ? rate.per_s[column].toFixed(1) : "0" : "–");
      cell.className = rate.per_s[column] ? "" : "zero";
      cell.title = isTold ? `${grouped(rate.total[column])} in all` : "not logged";
    }
    const offered = offeredOf(rate.per_s) || 1;
    const fused = Math.min(rate.per_s.fused, rate.per_s.accepted);
    const widths = { ...rate.per_s, fused, accepted: rate.per_s.accepted - fused };
    for (const [part, strip] of Object.entries(row.parts)) {
      strip.style.width = `${((100 * widths[part]) / offered).toFixed(1)}%`;
    }
    row.bar.setAttribute("aria-label", describe(rate));
  });
}

/** Return how many were offered; of a log, in which those that were dropped leave no trace, how many it has. */
const offeredOf = (now) => now.offered ?? now.accepted + now.ignored;

function describe({ per_s: now, name }) {
  if (!offeredOf(now)) return `${name}: nothing at the moment`;
  const told = ["accepted", "fused", "ignored", "dropped"].filter((part) => now[part] !== null);
  return `${name}: ${told.map((part) => `${Math.round((100 * now[part]) / offeredOf(now))} % ${part}`).join(", ")}`;
}
