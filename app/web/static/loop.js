// The charts of one loop: its trend, and how well each stiction band explains it.
"use strict";
const INK = "#1c2530", PV = "#0b5394", SP = "#8a5a00", OP = "#b3261e", GRID = "#dde3ea";
const axis = (title) => ({ title: { text: title }, gridcolor: GRID, zeroline: false });
const layout = (extra) => ({
  margin: { l: 60, r: 20, t: 10, b: 45 }, paper_bgcolor: "#fff", plot_bgcolor: "#fff",
  font: { family: "system-ui, sans-serif", size: 13, color: INK }, legend: { orientation: "h", y: 1.08 }, ...extra,
});
const options = { responsive: true, displaylogo: false };

const tell = (chart, text) => { chart.textContent = text; };

async function load(chart) {
  const answer = await fetch(chart.dataset.url, { headers: { Accept: "application/json" } });
  if (!answer.ok) throw new Error(`the service answered ${answer.status}`);
  return answer.json();
}

async function drawTrend(chart) {
  const trend = await load(chart);
  const x = trend.time;
  if (!x.length) return tell(chart, "No samples are kept for this loop.");
  const traces = [
    { x, y: trend.pv, name: "PV", line: { color: PV, width: 1.3 }, yaxis: "y2" },
    { x, y: trend.op, name: "OP", line: { color: OP, width: 1.3 }, yaxis: "y" },
  ];
  if (trend.sp) traces.splice(1, 0, { x, y: trend.sp, name: "SP", line: { color: SP, width: 1.3, dash: "dash" }, yaxis: "y2" });
  for (const trace of traces) Object.assign(trace, { type: "scatter", mode: "lines" });
  Plotly.newPlot(chart, traces, layout({
    height: 480, xaxis: axis("time, UTC"), hovermode: "x",
    yaxis: { ...axis("OP"), domain: [0, 0.46] }, yaxis2: { ...axis("PV and SP"), domain: [0.54, 1] },
  }), options);
}

function drawRmse(chart) {
  const { d, rmse, best } = JSON.parse(document.getElementById("rmse-data").textContent);
  const marker = { x: [d[best]], y: [rmse[best]], name: "chosen", mode: "markers", marker: { size: 11, color: OP } };
  const curve = { x: d, y: rmse, name: "RMSE", mode: "lines+markers", line: { color: PV }, marker: { size: 5 } };
  Plotly.newPlot(chart, [curve, marker], layout({
    height: 320, xaxis: axis("stiction band d, units of OP"), yaxis: axis("RMSE, units of PV"),
  }), options);
}

const trendChart = document.getElementById("trend");
if (trendChart) drawTrend(trendChart).catch((error) => tell(trendChart, `The trend could not be loaded: ${error.message}.`));
const rmseChart = document.getElementById("rmse");
if (rmseChart) drawRmse(rmseChart);
