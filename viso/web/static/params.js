// SPDX-FileCopyrightText: 2026 The viso authors
// SPDX-License-Identifier: GPL-3.0-or-later
// Parameters: searched by name or words, changed in place.

import { byId, element, isRecording, setText } from "./format.js";

const FIRST = ["VISO_", "EK3_SRC"];

const list = byId("params");
let rows = new Map();
let words = [];
let onlyChanged = false;
let ask = async () => ({ ok: false, text: "not connected" });

function about(row) {
  const parts = [row.about];
  if (row.values.length) parts.push(row.values.map(([number, text]) => `${number} ${text}`).join(", "));
  if (row.range) parts.push(`${row.range[0]} to ${row.range[1]}${row.unit ? ` ${row.unit}` : ""}`);
  else if (row.unit) parts.push(row.unit);
  if (row.default !== null) parts.push(`default ${row.default}`);
  if (row.reboot) parts.push("takes effect at the next start");
  if (row.read_only) parts.push("read-only");
  return parts.filter(Boolean).join(" · ");
}

function makeRow(param) {
  const box = element("div", { className: "param" });
  const id = `param-${param.name}`;
  const input = element("input", { id, inputmode: "decimal", autocomplete: "off", spellcheck: "false" });
  const note = element("p", { id: `${id}-about`, text: about(param) });
  input.setAttribute("aria-describedby", note.id);
  input.readOnly = param.read_only || isRecording();
  box.append(element("label", { text: param.name, for: id }), input, note);
  const row = { box, input, param, text: `${param.name} ${about(param)}`.toLowerCase() };
  input.addEventListener("keydown", (event) => onKey(event, row));
  input.addEventListener("change", () => set(row));
  input.addEventListener("blur", () => show(row));
  return row;
}

function onKey(event, row) {
  if (event.key === "Escape") {
    row.input.value = String(row.param.value);
    row.input.blur();
  }
}

async function set(row) {
  const text = row.input.value.trim().replace(",", ".");
  const value = Number(text);
  if (text === "" || !Number.isFinite(value)) {
    row.input.setAttribute("aria-invalid", "true");
    return;
  }
  row.input.dataset.state = "sent";
  const answer = await ask({ do: "param", name: row.param.name, value });
  delete row.input.dataset.state;
  row.input.setAttribute("aria-invalid", String(!answer.ok));
}

function show(row) {
  const { input, param, box } = row;
  if (document.activeElement !== input && input.dataset.state !== "sent") {
    if (input.value !== String(param.value)) input.value = String(param.value);
    input.removeAttribute("aria-invalid");
  }
  box.classList.toggle("changed", param.default !== null && param.value !== param.default);
}

function filter() {
  let shown = 0;
  for (const { box, text, param, input } of rows.values()) {
    const isWanted =
      words.every((word) => text.includes(word)) && (!onlyChanged || param.value !== param.default || input === document.activeElement);
    box.hidden = !isWanted;
    shown += isWanted;
  }
  setText(byId("param-note"), rows.size ? `${shown} of ${rows.size}` : "");
}

/** Return how far down the list a parameter is: those of external navigation come first. */
function rankOf({ name }) {
  const rank = FIRST.findIndex((start) => name.startsWith(start));
  return rank < 0 ? FIRST.length : rank;
}

/** Show all parameters again. */
export function takeTable(table) {
  const focused = document.activeElement?.id;
  const sorted = [...table].sort((a, b) => rankOf(a) - rankOf(b));
  rows = new Map(sorted.map((param) => [param.name, makeRow(param)]));
  list.replaceChildren(...[...rows.values()].map((row) => row.box));
  for (const row of rows.values()) show(row);
  filter();
  if (focused?.startsWith("param-")) byId(focused)?.focus();
}

/** Take values that have changed, by name. */
export function takeParams(values) {
  for (const [name, value] of Object.entries(values)) {
    const row = rows.get(name);
    if (!row) continue;
    row.param.value = value;
    if (document.activeElement === row.input) row.input.value = String(value);
    show(row);
  }
  if (onlyChanged && Object.keys(values).length) filter();
}

/** Return a parameter's value; undefined of one that is not there. */
export const valueOf = (name) => rows.get(name)?.param.value;

/** Say how to ask for a change. */
export function connectParams(how) {
  ask = how;
}

byId("param-search").addEventListener("input", (event) => {
  words = event.target.value.toLowerCase().split(/\s+/).filter(Boolean);
  filter();
});
byId("only-changed").addEventListener("click", (event) => {
  onlyChanged = !onlyChanged;
  event.target.setAttribute("aria-pressed", String(onlyChanged));
  filter();
});
