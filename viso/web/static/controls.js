// SPDX-FileCopyrightText: 2026 The viso authors
// SPDX-License-Identifier: GPL-3.0-or-later
// Buttons, faults, keys, the tiles at the top, the texts.

import { byId, clock, element, recall, remember, isRecording, setText, SEVERITIES } from "./format.js";
import { toggleHoldPlots, zoom } from "./time.js";
import { searchVerdicts, toggleHold } from "./verdicts.js";

const TEXTS_KEPT = 200;
const NOT_LOGGED = "not logged";
const THEMES = ["auto", "light", "dark"];
const keys = new Map();
const keyNames = [];
let ask = async () => ({ ok: false, text: "not connected" });
let onTheme = () => {};

function addKey(key, about, run) {
  keys.set(key, run);
  keyNames.push([key, about]);
}

/** Say how to ask for something, and what to do when the theme changes. */
export function connectControls(how, themed) {
  ask = how;
  onTheme = themed;
  applyTheme();
}

/** Tell the outcome of something that was asked for. */
export function tell(answer) {
  const line = byId("answer");
  line.dataset.tone = answer.ok ? "good" : "bad";
  setText(line, `${answer.ok ? "✓" : "✕"} ${answer.text}`);
}

/** Make the buttons of commands and faults. */
export function makeButtons(actions, faults) {
  const group = byId("actions");
  group.replaceChildren();
  for (const action of actions) {
    const button = element("button", { text: action.label, type: "button", title: action.about, id: `action-${action.name}` });
    const run = () => ask({ do: "action", name: action.name });
    button.addEventListener("click", run);
    if (action.key) {
      button.append(element("kbd", { text: action.key, aria_hidden: "true" }));
      button.setAttribute("aria-keyshortcuts", action.key);
      if (!keys.has(action.key)) addKey(action.key, action.label, run);
    }
    group.append(button);
  }
  const switches = byId("faults");
  switches.replaceChildren();
  for (const fault of faults) {
    const button = element("button", { text: fault.label, type: "button", title: fault.about, aria_pressed: "false", id: `fault-${fault.name}` });
    button.addEventListener("click", () =>
      ask({ do: "fault", name: fault.name, on: button.getAttribute("aria-pressed") !== "true" }),
    );
    switches.append(button);
  }
}

/** Show how the vehicle is. */
export function showState(state, lost) {
  if (state.time_s === undefined) return;
  const tiles = [
    ["time", clock(state.time_s), ""],
    ["mode", state.mode, ""],
    ["motors", state.armed, (armed) => (armed ? ["ARMED", "warn"] : ["disarmed", ""])],
    ["pre-arm", state.prearm, (passed) => (passed ? ["✓ passed", "good"] : ["✕ failed", "bad"])],
    ["camera", state.camera, { healthy: "good", off: "" }[state.camera] ?? "bad"],
    ["EKF aiding", state.aiding, (aiding) => [aiding ?? "not started", aiding && aiding !== "none" ? "good" : "warn"]],
    ["source set", state.source_set, (set) => [String(set + 1), ""]],
    ["yaw", state.yaw_deg, (yaw) => [yaw === null ? "–" : `${Math.round(yaw)}°`, ""]],
  ];
  if (state.faults.length) tiles.push(["faults", `▲ ${state.faults.length} on`, "bad"]);
  if (lost) tiles.push(["not shown", `${lost} events`, "warn"]);
  showTiles(tiles);
  for (const button of byId("faults").children) {
    const isOn = String(state.faults.includes(button.id.slice("fault-".length)));
    if (button.getAttribute("aria-pressed") !== isOn) button.setAttribute("aria-pressed", isOn);
  }
  for (let set = 1; set <= 3; set += 1) {
    byId(`action-source${set}`)?.setAttribute("aria-pressed", String(state.source_set === set - 1));
  }
  showClients(state.clients);
  showPreArm(state);
}

function showClients(clients) {
  const list = byId("clients");
  while (list.children.length > clients.length) list.lastChild.remove();
  while (list.children.length < clients.length) list.append(element("li"));
  clients.forEach(([link, peer], index) => setText(list.children[index], `${peer} on ${link}`));
  byId("clients-empty").hidden = clients.length > 0;
}

function showTiles(tiles) {
  const list = byId("tiles");
  while (list.children.length > tiles.length) list.lastChild.remove();
  tiles.forEach(([name, known, look], index) => {
    // What a log does not tell is left out of the state.
    const [value, tone] = known === undefined ? [NOT_LOGGED, ""] : typeof look === "function" ? look(known) : [known, look];
    let tile = list.children[index];
    if (!tile) {
      tile = element("div");
      tile.append(element("dt"), element("dd"));
      list.append(tile);
    }
    setText(tile.firstChild, name);
    setText(tile.lastChild, value);
    if ((tile.dataset.tone || "") !== tone) tone ? (tile.dataset.tone = tone) : delete tile.dataset.tone;
  });
}

function showPreArm(state) {
  if (state.prearm === undefined) return;
  const box = byId("prearm");
  const key = JSON.stringify([state.prearm, state.failures, state.failures_s]);
  if (box.dataset.key === key) return;
  box.dataset.key = key;
  box.dataset.tone = state.prearm ? "good" : "";
  box.replaceChildren();
  if (state.prearm) {
    box.append("Pre-arm checks pass.");
  } else if (!state.failures.length) {
    box.append("Pre-arm checks fail; the autopilot has not said why yet. Press Check.");
  } else {
    box.append(`Pre-arm checks fail; told at ${clock(state.failures_s)}:`);
    const reasons = element("ul");
    reasons.append(...state.failures.map((text) => element("li", { text })));
    box.append(reasons);
  }
}

/** Forget all texts. */
export function clearTexts() {
  byId("texts").replaceChildren();
}

/** Take texts of the autopilot, oldest first. */
export function takeTexts(texts) {
  const list = byId("texts");
  for (const [timeS, severity, text] of texts) {
    const item = element("li");
    item.dataset.t = timeS;
    const badge = element("span", { text: SEVERITIES[severity] || String(severity) });
    badge.dataset.tone = severity <= 3 ? "bad" : severity === 4 ? "warn" : "";
    item.append(element("span", { text: clock(timeS, 1) }), badge, element("span", { text }));
    list.prepend(item);
  }
  while (list.children.length > TEXTS_KEPT && !isRecording()) list.lastChild.remove();
}

/** Mark the texts that are still to come at a time of a recording. */
export function markTexts(nowS) {
  for (const item of byId("texts").children) item.classList.toggle("later", Number(item.dataset.t) > nowS);
}

function applyTheme() {
  const theme = THEMES.includes(recall("viso.theme")) ? recall("viso.theme") : "auto";
  theme === "auto" ? delete document.documentElement.dataset.theme : (document.documentElement.dataset.theme = theme);
  setText(byId("theme"), `Theme: ${theme}`);
  onTheme();
}

function nextTheme() {
  const now = document.documentElement.dataset.theme || "auto";
  remember("viso.theme", THEMES[(THEMES.indexOf(now) + 1) % THEMES.length]);
  applyTheme();
}

function focusOn(id) {
  byId(id).focus();
  byId(id).select();
}

function showKeys() {
  const list = byId("key-list");
  list.replaceChildren();
  for (const [key, about] of keyNames) {
    const name = element("dt");
    name.append(element("kbd", { text: key }));
    list.append(name, element("dd", { text: about }));
  }
  byId("keys").showModal();
}

function onKey(event) {
  const { target, key } = event;
  if (target.matches("input[type=search]") && key === "Escape") {
    target.value = "";
    target.dispatchEvent(new Event("input"));
    target.blur();
    return;
  }
  const isTyping = target.matches("input:not([type=checkbox]), select, textarea");
  const hasModifier = event.ctrlKey || event.altKey || event.metaKey;
  if (isTyping || hasModifier || event.repeat || byId("keys").open || !byId("keys-on").checked) return;
  const run = keys.get(key);
  if (run) {
    event.preventDefault();
    run();
  }
}

addKey("?", "This list", showKeys);
addKey("/", "Search the verdicts", () => focusOn("verdict-search"));
addKey("x", "Forget that search", () => searchVerdicts(""));
addKey("p", "Search the parameters", () => focusOn("param-search"));
addKey("h", "Hold the verdicts", toggleHold);
addKey("f", "Hold the plots", toggleHoldPlots);
addKey("+", "Show less time", () => zoom(0.5));
addKey("-", "Show more time", () => zoom(2));
addKey("t", "Theme: auto, light, dark", nextTheme);

byId("theme").addEventListener("click", nextTheme);
byId("help").addEventListener("click", showKeys);
byId("keys-on").checked = recall("viso.keys") !== "off";
byId("keys-on").addEventListener("change", (event) => remember("viso.keys", event.target.checked ? "on" : "off"));
document.addEventListener("keydown", onKey);
matchMedia("(prefers-color-scheme: dark)").addEventListener("change", () => onTheme());
