// Dropping a file, waiting until it is read, and the mapping of its tags.
"use strict";
const drop = document.getElementById("drop");
const token = document.querySelector('meta[name="csrf-token"]').content;

const told = document.getElementById("sending");
const UNANSWERED = "the service does not answer";

// What became of a file: its upload, or why there is none.
const sent = (file, place) => new Promise((done) => {
  const request = new XMLHttpRequest();
  request.open("POST", `/v1/uploads?filename=${encodeURIComponent(file.name)}`);
  request.setRequestHeader("Content-Type", "application/octet-stream");
  if (token) request.setRequestHeader("X-CSRF-Token", token);
  request.upload.addEventListener("progress", (event) => { told.textContent = `${file.name}${place}: ${Math.floor((100 * event.loaded) / Math.max(event.total, 1))} % sent`; });
  request.addEventListener("error", () => done({ why: `could not be sent: ${UNANSWERED}` }));
  request.addEventListener("load", () => {
    let answer = {};
    try { answer = JSON.parse(request.responseText); } catch { /* told below */ }
    const doubtful = request.status === 503 || request.status === 504;
    done(request.status === 202 ? { id: answer.id } : { why: `${doubtful ? "" : "not taken: "}${answer.detail ?? request.status}` });
  });
  request.send(file);
});

async function sendAll(files) {
  const refused = [];
  let newest = null;
  for (const [k, file] of files.entries()) {
    const { id, why } = await sent(file, files.length > 1 ? ` (${k + 1} of ${files.length})` : "");
    if (why) refused.push(`${file.name}: ${why}`);
    newest = id ?? newest;
  }
  if (!refused.length) location.assign(files.length > 1 ? "/uploads" : `/uploads/${newest}`);
  else told.textContent = `${files.length > 1 ? `${files.length - refused.length} of ${files.length} files were taken. ` : ""}${refused.join("; ")}`;
}

if (drop) {
  const chosen = document.getElementById("file");
  let sending = false;
  const send = async (files) => {
    if (sending || !files.length) return;
    sending = true;
    try { await sendAll([...files]); } finally { sending = false; }
  };
  chosen.multiple = true; // without this script a form takes one
  drop.addEventListener("submit", (event) => { event.preventDefault(); send(chosen.files); });
  for (const name of ["dragover", "dragenter"]) drop.addEventListener(name, (event) => { event.preventDefault(); drop.classList.add("over"); });
  drop.addEventListener("dragleave", () => drop.classList.remove("over"));
  drop.addEventListener("drop", (event) => { event.preventDefault(); drop.classList.remove("over"); send(event.dataTransfer.files); });
}

const upload = document.getElementById("upload");
if (upload && ["received", "reading"].includes(upload.dataset.state)) {
  const changed = async () => {
    const answer = await fetch(upload.dataset.url, { headers: { Accept: "application/json" } });
    if (answer.status === 401) return true; // the page leads to the login
    const found = answer.ok ? await answer.json() : null;
    return found !== null && (!["received", "reading"].includes(found.state) || (found.waits_for_room_since ?? found.waits_for_file_since ?? "") !== upload.dataset.waits);
  };
  const look = async () => {
    let news = false;
    try { news = await changed(); } catch { /* the service may be away for a moment; it is asked again */ }
    if (news) location.reload();
    else setTimeout(look, 1000);
  };
  setTimeout(look, 500);
}

const list = document.getElementById("uploads");
if (list) {
  const open = () => list.querySelector("[data-open]") !== null;
  const read = async () => {
    const answer = await fetch(location.href);
    if (answer.redirected && !told?.textContent) location.reload(); // the page leads to the login, unless a file is on its way
    const found = answer.ok && !answer.redirected ? new DOMParser().parseFromString(await answer.text(), "text/html").getElementById("uploads") : null;
    // Who is on a link there stays on it, and what is marked there stays marked.
    if (found && !found.isEqualNode(list) && !list.contains(document.activeElement)) list.replaceChildren(...found.children);
  };
  // Less and less often while nothing changes: reading may take hours, or wait for room. Anything new begins anew.
  const FIRST_MS = 2000, LONGEST_MS = 30000;
  let pause = FIRST_MS, next = null;
  const later = () => { next = open() ? setTimeout(look, pause) : null; };
  const look = async () => {
    next = null;
    const before = list.innerHTML;
    try { if (!document.hidden) await read(); } catch { /* the service may be away for a moment; it is asked again */ }
    pause = list.innerHTML === before ? Math.min(1.5 * pause, LONGEST_MS) : FIRST_MS;
    later();
  };
  later();
  document.addEventListener("visibilitychange", () => {
    if (document.hidden || next === null) return;
    clearTimeout(next);
    pause = FIRST_MS;
    look();
  });
}

const mapping = document.getElementById("mapping");
if (mapping) {
  const text = document.getElementById("mapping-text");
  const quoted = (value) => (/[",\n;\t]/.test(value) ? `"${value.replaceAll('"', '""')}"` : value);
  const written = new Map(); // the line that stands for a row
  const write = ({ target }) => {
    const row = target.closest("tr"), { tag } = row.dataset;
    const loop = row.querySelector("input").value.trim(), signal = row.querySelector("select").value;
    const head = text.value.split("\n", 1)[0], mark = /[;\t]/.exec(head)?.[0] ?? ",";
    const differs = loop && (loop !== row.dataset.loop || signal !== row.dataset.signal);
    const line = differs ? `${[tag, loop, signal].map(quoted).join(mark)}\n` : "";
    const whole = text.value && !text.value.endsWith("\n") ? `${text.value}\n` : text.value || "tag,loop,signal\n";
    const before = written.get(tag) ?? whole.split(/(?<=\n)/).find((one, k) => k && one.startsWith(`${quoted(tag)}${mark}`));
    text.value = before && whole.includes(before) ? whole.replace(before, () => line) : whole + line; // what was typed by hand stays
    written.set(tag, line || null);
  };
  mapping.querySelector("table").addEventListener("input", write);
}
