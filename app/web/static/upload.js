// Dropping a file, waiting until it is read, and the mapping of its tags.
"use strict";
const drop = document.getElementById("drop");
const token = document.querySelector('meta[name="csrf-token"]').content;

function send(file) {
  const told = document.getElementById("sending");
  const request = new XMLHttpRequest();
  request.open("POST", `/v1/uploads?filename=${encodeURIComponent(file.name)}`);
  request.setRequestHeader("Content-Type", "application/octet-stream");
  if (token) request.setRequestHeader("X-CSRF-Token", token);
  request.upload.addEventListener("progress", (event) => { told.textContent = `${file.name}: ${Math.floor((100 * event.loaded) / Math.max(event.total, 1))} % sent`; });
  request.addEventListener("error", () => { told.textContent = "The file could not be sent: the service does not answer."; });
  request.addEventListener("load", () => {
    let answer = {};
    try { answer = JSON.parse(request.responseText); } catch { /* told below */ }
    if (request.status === 202) location.assign(`/uploads/${answer.id}`);
    else told.textContent = `${request.status === 503 || request.status === 504 ? "" : "Not taken: "}${answer.detail ?? request.status}`;
  });
  request.send(file);
}

if (drop) {
  const chosen = document.getElementById("file");
  drop.addEventListener("submit", (event) => { event.preventDefault(); if (chosen.files[0]) send(chosen.files[0]); });
  for (const name of ["dragover", "dragenter"]) drop.addEventListener(name, (event) => { event.preventDefault(); drop.classList.add("over"); });
  drop.addEventListener("dragleave", () => drop.classList.remove("over"));
  drop.addEventListener("drop", (event) => { event.preventDefault(); drop.classList.remove("over"); if (event.dataTransfer.files[0]) send(event.dataTransfer.files[0]); });
}

const upload = document.getElementById("upload");
if (upload && ["received", "reading"].includes(upload.dataset.state)) {
  const look = async () => {
    const answer = await fetch(upload.dataset.url, { headers: { Accept: "application/json" } });
    const found = answer.ok ? await answer.json() : null;
    const waits = found?.waits_for_room_since ?? "";
    if (found && (!["received", "reading"].includes(found.state) || waits !== upload.dataset.waits)) location.reload();
    else setTimeout(look, 1000);
  };
  setTimeout(look, 500);
}

const mapping = document.getElementById("mapping");
if (mapping) {
  const text = document.getElementById("mapping-text");
  const quoted = (value) => (/[",\n;\t]/.test(value) ? `"${value.replaceAll('"', '""')}"` : value);
  const write = () => {
    const lines = ["tag,loop,signal"];
    for (const row of mapping.querySelectorAll("tbody tr")) {
      const loop = row.querySelector("input").value.trim();
      const signal = row.querySelector("select").value;
      if (loop && (loop !== row.dataset.loop || signal !== row.dataset.signal)) lines.push([row.dataset.tag, loop, signal].map(quoted).join(","));
    }
    text.value = lines.join("\n") + "\n";
  };
  mapping.querySelector("table").addEventListener("input", write);
}
