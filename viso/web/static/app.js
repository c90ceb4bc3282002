// SPDX-FileCopyrightText: 2026 The viso authors
// SPDX-License-Identifier: GPL-3.0-or-later
// The page: talks to the server, keeps what it says, draws once a frame at most.

import { readPalette } from "./charts.js";
import { clearTexts, connectControls, makeButtons, markTexts, showState, takeTexts, tell } from "./controls.js";
import { connectDoctor } from "./doctor.js";
import { byId, element, setText } from "./format.js";
import { connectParams, takeParams, takeTable, valueOf } from "./params.js";
import { drawHeight, drawInnovations, drawLag, drawQuality, nameSources } from "./plots.js";
import { showRates } from "./rates.js";
import { connectSpace, drawSpace } from "./space.js";
import { connectTime, pointHere, showWhole, takeTimes, time } from "./time.js";
import { clearVerdicts, markLive, takeRuns } from "./verdicts.js";

const POINTS_KEPT = 3000;
const RETRY_MS = 1000;
const ANSWER_MS = 5000;

const shown = { boots: 0, state: {}, lost: 0, rates: [], points: [], units: {}, moments: null };
const waiting = new Map();
let socket = null;
let requests = 0;
let isDue = false;
let heldPoints = null;

function connect() {
  socket = new WebSocket(`ws://${location.host}/live`);
  socket.addEventListener("open", () => tellConnection(true));
  socket.addEventListener("message", (event) => take(JSON.parse(event.data)));
  socket.addEventListener("close", () => {
    tellConnection(false);
    for (const answer of waiting.values()) answer({ ok: false, text: "the connection has ended" });
    waiting.clear();
    setTimeout(connect, RETRY_MS);
  });
}

function tellConnection(isOpen) {
  const line = byId("connection");
  line.dataset.tone = isOpen ? "good" : "bad";
  setText(line, isOpen ? "connected" : "not connected, trying again");
}

/** Ask the server for something; the answer is told, and returned. */
function ask(request, patienceMs = ANSWER_MS) {
  const id = (requests += 1);
  return new Promise((resolve) => {
    const finish = (answer) => {
      waiting.delete(id);
      tell(answer);
      resolve(answer);
    };
    if (socket?.readyState !== WebSocket.OPEN) {
      finish({ ok: false, text: "not connected" });
      return;
    }
    waiting.set(id, finish);
    setTimeout(() => waiting.has(id) && finish({ ok: false, text: "no answer" }), patienceMs);
    socket.send(JSON.stringify({ ...request, id }));
  });
}

function take(message) {
  if (message.type === "answer") waiting.get(message.id)?.(message);
  else if (message.type === "all") takeAll(message);
  else if (message.type === "recording") takeRecording(message);
  else takeBatch(message);
}

function takeAll(message) {
  setText(byId("banner"), message.banner);
  makeButtons(message.actions, message.faults);
  clearVerdicts();
  clearTexts();
  shown.points = message.points;
  shown.units = message.units;
  takeRuns(message.runs);
  takeTexts(message.texts);
  takeTable(message.table);
  takeCommon(message);
}

function takeRecording(message) {
  document.body.dataset.recording = "";
  document.title = `${message.banner} - viso`;
  setText(byId("connection"), "recording");
  setText(byId("newest"), "End");
  shown.moments = message.moments;
  if (message.summary) showSummary(message.summary);
  if (message.sources) nameSources(message.sources);
  showWhole();
  takeAll(message);
}

/** Show what a report says of a flight, and what its log does not tell. */
function showSummary({ badge, tone, sentence, remarks, absent }) {
  byId("flight").hidden = false;
  setText(byId("flight-badge"), badge);
  byId("flight-badge").dataset.tone = tone;
  setText(byId("flight-sentence"), sentence);
  byId("remarks").replaceChildren(
    ...remarks.map(([toneOf, text]) => {
      const item = element("li", { text });
      item.dataset.tone = toneOf;
      return item;
    }),
  );
  byId("absent").replaceChildren(...absent.map((text) => element("li", { text })));
}

function takeBatch(message) {
  if (message.boots !== shown.boots) shown.points = [];
  shown.points.push(message.point);
  if (shown.points.length > POINTS_KEPT) shown.points.splice(0, shown.points.length - POINTS_KEPT);
  takeRuns(message.runs);
  takeTexts(message.texts);
  if (message.table) takeTable(message.table);
  takeParams(message.params);
  takeCommon(message);
}

function takeCommon({ boots, state, lost, rates }) {
  Object.assign(shown, { boots, state, lost, rates });
  draw();
}

function draw() {
  if (isDue) return;
  isDue = true;
  requestAnimationFrame(() => {
    isDue = false;
    heldPoints = time.isHeld ? (heldPoints ?? [...shown.points]) : null;
    const points = heldPoints ?? shown.points;
    takeTimes(points[0]?.t ?? 0, points.at(-1)?.t ?? 0);
    const moment = (shown.moments && pointHere(shown.moments)) ?? shown;
    const nowS = shown.moments ? (time.cursorS ?? time.endS) : (shown.points.at(-1)?.t ?? 0);
    showState(shown.moments ? { ...moment.state, time_s: nowS } : moment.state, shown.lost);
    showRates(moment.rates);
    markLive(nowS);
    if (shown.moments) markTexts(nowS);
    drawSpace(points);
    drawHeight(points);
    drawInnovations(points, shown.units);
    drawLag(points);
    drawQuality(points, valueOf("VISO_QUAL_MIN"));
  });
}

connectParams(ask);
connectDoctor(ask);
connectTime(draw);
connectSpace(draw);
connectControls(ask, () => {
  readPalette();
  draw();
});
addEventListener("resize", draw);
connect();
