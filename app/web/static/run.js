// A run while it goes on: progress from server-sent events; when it has ended, the page with what it came to.
"use strict";
const many = (count) => count.toLocaleString("en-US"); // as the page has them
const AGAIN_MS = 5000;
const run = document.getElementById("run");
if (run && run.dataset.ended === "no") {
  const events = new EventSource(run.dataset.events);
  const progress = document.getElementById("progress");
  const count = document.getElementById("count");
  const state = document.getElementById("state");
  const show = (event) => {
    const told = JSON.parse(event.data);
    progress.max = told.total || 1;
    progress.value = told.done + told.failed;
    count.textContent = `${many(told.done)} of ${many(told.total)} done` + (told.failed - told.cancelled ? `, ${many(told.failed - told.cancelled)} failed` : "");
    state.textContent = told.state;
  };
  events.addEventListener("progress", show);
  // A browser asks again by itself, but not after an answer that is no stream: the session has ended, or all places are taken.
  events.addEventListener("error", () => { if (events.readyState === EventSource.CLOSED) setTimeout(() => location.reload(), AGAIN_MS); });
  events.addEventListener("end", () => { events.close(); location.reload(); });
}
