// The charts of an explanation: recording and simulations with the located windows, residuals against their trigger.
"use strict";
(() => {
  const MARK = "#f2b233";
  const COLOURS = { recording: paint("--ink"), given: "#8a97a5", refitted: paint("--op"), explained: paint("--pv") };
  const POLL_MS = 2000;

  const band = (from, to, look) => ({ type: "rect", xref: "x", yref: "paper", x0: from, x1: to, y0: 0, y1: 1, layer: "below", ...look });

  function drawTraces(chart, told) {
    const start = Date.parse(told.start);
    const clock = clockAt(start + 1000 * told.time_s.at(-1), start);
    const at = (seconds) => clock.shown(start + 1000 * seconds);
    const x = told.time_s.map(at);
    const line = (name, y, width) => ({ x, y, name, type: "scatter", mode: "lines", line: { color: COLOURS[name], width } });
    const traces = [line("recording", told.recording, 1.6)];
    if (told.given) traces.push(line("given", told.given, 1.2));
    traces.push(line("refitted", told.refitted, 1.2), line("explained", told.explained, 1.4));
    const shapes = told.windows.map(([from, to]) => band(at(from), at(to), { fillcolor: MARK, opacity: 0.14, line: { width: 0 } }));
    for (const [from, to] of told.held_out) shapes.push(band(at(from), at(to), { fillcolor: "rgba(0,0,0,0)", line: { dash: "dot", width: 1, color: COLOURS.given } }));
    Plotly.newPlot(chart, traces, layout({
      height: 480, hovermode: "x", shapes, xaxis: axis(folded(clock.title, chart)), yaxis: axis("PV, unit of PV"),
    }), options);
  }

  function drawResiduals(chart, told) {
    const dots = (name, y, colour) => ({ x: told.trigger, y, name, type: "scatter", mode: "markers", marker: { color: colour, size: 4, opacity: 0.5 } });
    const traces = [dots("before", told.residual_before, COLOURS.refitted), dots("after", told.residual_after, COLOURS.explained)];
    Plotly.newPlot(chart, traces, layout({ height: 340, xaxis: axis(folded(told.trigger_label, chart)), yaxis: axis("recording − simulation, unit of PV") }), options);
  }

  async function draw() {
    const chart = document.getElementById("explanation-trace");
    if (!chart) return;
    try {
      const answer = await fetch(chart.dataset.url, { headers: { Accept: "application/json" } });
      if (!answer.ok) throw new Error(`the service answered ${answer.status}`);
      const told = await answer.json();
      drawTraces(chart, told);
      drawResiduals(document.getElementById("explanation-residual"), told);
    } catch (error) {
      chart.textContent = `The traces could not be loaded: ${error.message}.`;
    }
  }

  function loggedOut(part) {
    const told = document.createElement("p");
    told.className = "error";
    told.setAttribute("role", "alert");
    told.textContent = "Your login has ended: log in and reload the page to see the result.";
    part.querySelector(".card").prepend(told);
  }

  async function watch() {
    const part = document.getElementById("explanation");
    if (!part || part.dataset.state !== "open") return draw();
    await new Promise((wake) => setTimeout(wake, POLL_MS));
    try {
      const answer = await fetch(part.dataset.part);
      if (answer.redirected) return loggedOut(part);
      const fresh = answer.ok ? new DOMParser().parseFromString(await answer.text(), "text/html").getElementById("explanation") : null;
      if (fresh && !fresh.isEqualNode(part)) part.replaceWith(document.adoptNode(fresh)); // else whoever reads it would lose the place
    } catch { /* the service may be away for a moment; it is asked again */ }
    return watch();
  }

  window.addEventListener("DOMContentLoaded", watch);
})();
