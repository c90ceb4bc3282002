// SPDX-FileCopyrightText: 2026 The viso authors
// SPDX-License-Identifier: GPL-3.0-or-later
// The doctor on the last minute: its findings, and files of them.

import { byId, element, setText } from "./format.js";

const PATIENCE_MS = 300_000;
const TONES = { error: "bad", warning: "warn" };

let report = null;

function show() {
  const list = byId("findings");
  list.hidden = !report.json.findings.length;
  list.replaceChildren(
    ...report.json.findings.map((finding) => {
      const item = element("li");
      const badge = element("span", { className: "badge", text: finding.severity });
      if (TONES[finding.severity]) badge.dataset.tone = TONES[finding.severity];
      const what = element("span", { className: "what", text: finding.title });
      what.append(" ", element("small", { text: `${finding.code} · ${finding.witness}` }));
      item.append(
        badge,
        what,
        element("span", { className: "why", text: finding.evidence }),
        element("span", { className: "why", text: `Fix: ${finding.fix}` }),
      );
      return item;
    }),
  );
  byId("save-text").hidden = byId("save-json").hidden = false;
}

function save(name, type, text) {
  const url = URL.createObjectURL(new Blob([text], { type }));
  const link = element("a", { href: url, download: name });
  link.click();
  setTimeout(() => URL.revokeObjectURL(url), 1000);
}

/** Say how to ask for a diagnosis. */
export function connectDoctor(ask) {
  byId("diagnose").addEventListener("click", async () => {
    byId("diagnose").disabled = true;
    setText(byId("doctor-note"), "Examining the last minute; it takes some seconds.");
    const answer = await ask({ do: "diagnose" }, PATIENCE_MS);
    byId("diagnose").disabled = false;
    setText(byId("doctor-note"), `${answer.text}.`);
    if (!answer.report) return;
    report = answer.report;
    show();
  });
}

byId("save-text").addEventListener("click", () => save("findings.txt", "text/plain", report.text));
byId("save-json").addEventListener("click", () =>
  save("findings.json", "application/json", `${JSON.stringify(report.json, null, 1)}\n`),
);
