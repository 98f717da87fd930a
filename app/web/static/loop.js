// The charts of one loop.
"use strict";
const line = (x, y, name, colour, more) => ({ x, y, name, type: "scatter", mode: "lines", line: { color: paint(colour), width: 1.4 }, ...more });

const WAIT_MS = 200; // a wheel or a drag asks once, when it has come to rest
const valvesNote = ({ valve, size }) => (size
  ? "The valve's position is an estimate, drawn with the size S above."
  : `The valve's position is not drawn, as no size is stated. A click on its name draws an estimate with S ${valve.S.toPrecision(3)} and J ${valve.J.toPrecision(3)} (units of OP), which are assumed, not measured.`);
const LONG_MS = 86400000, AROUND = 0.25; // a record of days is a solid block: it opens at what speaks for it, and some of what is beside it
const parted = (count) => count.toLocaleString("en");
const countNote = ({ samples, shown }, back = "") => (shown < samples
  ? `${parted(shown)} of ${parted(samples)} samples shown, the minimum and maximum of each stretch: the lines between them were not recorded. Drag over a part to see all of its samples.${back}`
  : `All ${parted(samples)} samples shown.${back}`);
const BACK = " Double-click to show the whole record again.";

// Where OP travels and PV stands still: under the lines, as with a marker pen.
const marked = (values, standing) => values.map((value, k) => (standing[k] ? value : null));
const pen = (x, y, standing, more) => line(x, marked(y, standing), "OP travels, PV stands", "--stands", { line: { color: paint("--stands"), width: 7 }, hoverinfo: "skip", legendgroup: "stands", ...more });

function trendLines(trend, clock, more) {
  const x = trend.time.map(clock.shown);
  const traces = [line(x, trend.pv, "PV", "--pv", { yaxis: "y2" }), line(x, trend.op, "OP", "--op")];
  if (trend.sp) traces.splice(1, 0, line(x, trend.sp, "SP", "--sp", { yaxis: "y2" }));
  if (trend.valve) traces.push(line(x, trend.valve, "valve, estimated", "--valve", more));
  return [pen(x, trend.op, trend.standing, { showlegend: trend.standing.includes(1), legendrank: 2000 }), pen(x, trend.pv, trend.standing, { yaxis: "y2", showlegend: false }), ...traces];
}

function drawTrend({ trend, window: shown, judged, valve, size, damage }) {
  document.getElementById("damage-note").textContent = damage ?? "";
  if (!trend) return draw("trend", null, {}, "No samples of the audited stretch are kept.");
  const clock = clockAt(trend.time.at(-1), trend.time[0]);
  if (valve) document.getElementById("valve-note").textContent = valvesNote({ valve, size });
  const stretch = ([from, to], look) => ({ type: "rect", xref: "x", yref: "paper", x0: clock.shown(from), x1: clock.shown(to), y0: 0, y1: 1, layer: "below", ...look });
  const shapes = shown ? [stretch(shown, { fillcolor: paint("--link"), opacity: 0.06, line: { width: 0 } })] : [];
  if (judged) {
    shapes.push(stretch(judged, { line: { width: 2, color: paint("--ink"), dash: "dot" } }));
    document.getElementById("judged-note").textContent = `The stretch that speaks for the record, ${judged.map((at) => clock.shown(at).slice(0, 16).replace("T", " ")).join(" to ")}, is framed with dots; the size, the shapes and PV against OP are of it.`;
  }
  draw("trend", trendLines(trend, clock, size ? {} : { visible: "legendonly" }), {
    height: 480, xaxis: axis(folded(clock.title, document.getElementById("trend"))), hovermode: "x", shapes,
    yaxis: axis("OP", { domain: [0, 0.46] }), yaxis2: axis("PV and SP", { domain: [0.54, 1] }),
  });
  comeCloser(document.getElementById("trend"), trend, clock);
  if (judged && Date.parse(trend.time.at(-1)) - Date.parse(trend.time[0]) > LONG_MS) openAt(judged.map(Date.parse), clock);
}

function openAt([from, to], clock) {
  const chart = document.getElementById("trend"), all = document.getElementById("trend-all"), margin = AROUND * (to - from);
  const near = { "xaxis.range[0]": clock.shown(from - margin), "xaxis.range[1]": clock.shown(to + margin) };
  let whole = false;
  const go = () => {
    all.textContent = whole ? "Show the stretch that speaks for the record" : "Show the whole record";
    return Plotly.relayout(chart, whole ? { "xaxis.autorange": true, "yaxis.autorange": true, "yaxis2.autorange": true } : { ...near, "yaxis.autorange": true, "yaxis2.autorange": true });
  };
  all.addEventListener("click", () => { whole = !whole; go(); });
  document.getElementById("trend-tools").hidden = false;
  go();
}

// Of a long record the trend draws extremes, and lines between them are shapes that were never recorded: of the part
// that is looked at more closely the samples themselves are fetched, and the whole comes back with a double click.
function comeCloser(chart, whole, clock) {
  const note = document.getElementById("trend-note");
  let waiting, asking;
  const show = (trend) => {
    const lines = trendLines(trend, clock);
    note.textContent = countNote(trend, trend === whole ? "" : BACK);
    return Plotly.restyle(chart, { x: lines.map((one) => one.x), y: lines.map((one) => one.y) });
  };
  const fetchPart = async (from, to) => {
    asking = new AbortController();
    const { signal } = asking;
    chart.dataset.zoom = "asked";
    try {
      const { trend } = await load(`${charts.dataset.url}?${new URLSearchParams({ from: clock.instant(from), to: clock.instant(to) })}`, { signal });
      if (signal.aborted || !trend) return;
      await show(trend);
      chart.dataset.zoom = "part";
    } catch (error) { if (!signal.aborted) note.textContent = `The samples of this part could not be loaded: ${error.message}. ${countNote(whole)}`; }
  };
  chart.on("plotly_relayout", (changed) => {
    const [from, to] = changed["xaxis.range"] ?? [changed["xaxis.range[0]"], changed["xaxis.range[1]"]];
    const back = changed["xaxis.autorange"];
    if (!back && !(from && to)) return;
    clearTimeout(waiting);
    asking?.abort();
    if (back) show(whole).then(() => { chart.dataset.zoom = "whole"; });
    else if (whole.shown < whole.samples) waiting = setTimeout(fetchPart, WAIT_MS, String(from), String(to));
  });
  note.textContent = countNote(whole);
}

function drawRmse({ rmse_d: curve, rmse_sj: surface }) {
  const notIdentified = charts.dataset.verdict === "not_auditable"
    ? "The published identification could not be made: the record could not be audited." : "The published identification was not made for this verdict, which rests on other evidence.";
  draw("rmse-d", curve && [
    line(curve.d, curve.rmse, "RMSE", "--pv", { mode: "lines+markers", marker: { size: 5 } }),
    { x: [curve.d[curve.best]], y: [curve.rmse[curve.best]], name: "chosen", mode: "markers", marker: { size: 11, color: paint("--op") } },
  ], { height: 320, xaxis: axis("d, units of OP"), yaxis: axis("RMSE, units of PV") }, notIdentified);
  // One hopeless pair of S and J would make all others one colour: the worst tenth has the colour of its best.
  const ranked = surface ? surface.rmse.filter(Number.isFinite).sort((one, other) => one - other) : [];
  draw("rmse-sj", surface && [
    { x: surface.S, y: surface.J, mode: "markers", name: "RMSE", text: surface.rmse.map((v) => `RMSE ${v}`), marker: { size: 12, symbol: "square", color: surface.rmse, cmin: ranked[0], cmax: ranked[Math.floor(0.9 * (ranked.length - 1))], colorscale: "Viridis", showscale: true, colorbar: { title: { text: "RMSE", side: "right" } } } },
    { x: [surface.S[surface.best]], y: [surface.J[surface.best]], name: "chosen", mode: "markers", marker: { size: 16, symbol: "circle-open", color: paint("--op"), line: { width: 3 } } },
  ], { height: 320, showlegend: false, xaxis: axis("S, units of OP"), yaxis: axis("J, units of OP") }, notIdentified);
}

function drawSpectra({ spectra }) {
  if (!spectra) return draw("spectra", null, {}, "There is no spectrum of this record.");
  const x = spectra.frequency_hz;
  const marked = spectra.pv_amplitude.map((value, i) => (spectra.significant[i] ? value : null));
  draw("spectra", [
    line(x, spectra.op_amplitude, "OP", "--op"), line(x, spectra.pv_amplitude, "PV", "--pv"),
    line(x, spectra.threshold_amplitude, "threshold", "--muted", { line: { color: paint("--muted"), width: 1, dash: "dot" } }),
    { x, y: marked, name: "Ysig", mode: "markers", marker: { size: 8, color: paint("--sp") } },
  ], { height: 340, xaxis: axis("frequency, Hz", { type: "log", exponentformat: "power" }), yaxis: axis("amplitude, scaled") });
}

const pathNote = ({ samples, shown, standing }, judged, window) => {
  const of = judged ? "the stretch that speaks for the record" : window ? "the audited window" : "what was given to the audit";
  return `${shown < samples ? `The newest ${parted(shown)} of the ${parted(samples)}` : `All ${parted(samples)}`} samples of ${of}${standing.includes(1) ? "; where OP travels and PV stands is marked" : ""}.`;
};

function drawRest({ pv_op: path, errors, judged, size, window }) {
  if (path) document.getElementById("pv-op-note").textContent = pathNote(path, judged, window);
  const stood = path && !path.pv.some((value) => value !== path.pv[0]);
  const middle = path && path.op.length ? (Math.min(...path.op) + Math.max(...path.op)) / 2 : 0;
  const wide = size && path ? [{ type: "rect", xref: "x", yref: "paper", x0: middle - size.S / 2, x1: middle + size.S / 2, y0: 0, y1: 1, layer: "below", fillcolor: paint("--valve"), opacity: 0.12, line: { width: 0 } }] : [];
  const [wideAs, low, high] = size ? [size.S, size.low, size.high].map((value) => value.toFixed(Math.max(0, 2 - Math.floor(Math.log10(size.S))))) : [];
  const sign = wide.map(() => ({ x: middle, y: 1, yref: "paper", yanchor: "bottom", showarrow: false, text: `as wide as S = ${wideAs} (${low} to ${high})`, font: { color: paint("--valve"), size: 12 } }));
  draw("pv-op", path && !stood && [pen(path.op, path.pv, path.standing), line(path.op, path.pv, "PV over OP", "--pv", { line: { color: paint("--pv"), width: 0.8 } })],
    { height: 320, showlegend: false, shapes: wide, annotations: sign, margin: { l: 58, r: 16, t: wide.length ? 54 : 24, b: 44 }, xaxis: axis("OP"), yaxis: axis("PV") }, path && path.pv.length ? `PV stood at ${path.pv[0]} all the time: there is no path to draw.` : path ? "No stretch was judged: there is no path to draw." : "No samples of the audited stretch are kept.");
  draw("errors", errors && [{ x: errors.middle, y: errors.share_pct, type: "bar", name: "share", marker: { color: paint("--pv") } }],
    { height: 320, showlegend: false, bargap: 0.05, xaxis: axis("SP - PV, units of PV"), yaxis: axis("% of the samples") }, "No spread to show: no set point was recorded, or the control error is one value.");
}

function drawHistory() {
  const rows = [...document.querySelectorAll("#history-rows tr")].reverse();
  const x = rows.map((row) => clockAt(row.dataset.at).shown(row.dataset.at));
  const values = (name, factor) => rows.map((row) => (row.dataset[name] ? factor * Number(row.dataset[name]) : null));
  draw("history", rows.length > 1 && [
    line(x, values("probability", 100), "probability of stiction, %", "--op", { mode: "lines+markers" }),
    line(x, values("health", 1), "health", "--good", { mode: "lines+markers" }),
  ], { height: 220, xaxis: axis(""), yaxis: axis("", { range: [-3, 103] }) }, "One verdict so far: there is no course yet.");
}

async function drawRepair(chart) {
  const sides = await Promise.all([chart.dataset.before, chart.dataset.after].map((audit) => load(`${charts.dataset.url}?audit=${audit}`)));
  const about = (values) => { const mean = values.reduce((sum, value) => sum + value, 0) / values.length; return values.map((value) => value - mean); };
  const lines = [["before", "--op"], ["after", "--good"]].map(([name, colour], k) => sides[k].pv_op && line(about(sides[k].pv_op.op), about(sides[k].pv_op.pv), name, colour, { line: { color: paint(colour), width: 0.8 } }));
  draw("repair-path", lines.every(Boolean) && lines, { height: 320, xaxis: axis("OP less its mean"), yaxis: axis("PV less its mean") }, "The samples from before or after the repair are no longer kept.");
}

const charts = document.getElementById("charts"), repaired = document.getElementById("repair-path");
drawHistory();
if (repaired) drawRepair(repaired).catch((error) => tell(repaired, `PV against OP could not be loaded: ${error.message}.`));
if (charts) {
  load(charts.dataset.url).then((told) => {
    drawTrend(told); drawRmse(told); drawSpectra(told); drawRest(told);
    charts.dataset.drawn = "yes";
  }).catch((error) => { for (const chart of charts.querySelectorAll(".chart")) tell(chart, `The charts could not be loaded: ${error.message}.`); });
}
