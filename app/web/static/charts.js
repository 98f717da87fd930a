// What all charts share: the colours of the page (light or dark), axes, and how a failure is told.
"use strict";
const paint = (name) => getComputedStyle(document.documentElement).getPropertyValue(name).trim();
const axis = (title, more) => ({ title: { text: title, standoff: 8 }, automargin: true, gridcolor: paint("--line"), zeroline: false, ...more });
const layout = (more) => ({
  margin: { l: 58, r: 16, t: 10, b: 44 }, paper_bgcolor: paint("--paper"), plot_bgcolor: paint("--paper"),
  font: { family: "system-ui, sans-serif", size: 13, color: paint("--ink") }, legend: { orientation: "h", y: 1.02, yanchor: "bottom" },
  hoverlabel: { namelength: -1 }, ...more,
});
// The chart library knows no zones: instants are moved by what the plant's clock is ahead of UTC at `newest`, all by the
// same, so that no hour is drawn twice where the clock is put back. What stands before 1971 counts from a start that
// nobody told, and is in no zone.
const clockAt = (newest, oldest = newest) => {
  const zone = document.documentElement.dataset.zone || "UTC", two = (value) => String(value).padStart(2, "0");
  const instant = (at) => (typeof at === "string" ? Date.parse(at) : at);
  const aheadAt = (at) => {
    const second = 1000 * Math.floor(instant(at) / 1000);
    try {
      const form = new Intl.DateTimeFormat("sv-SE", { timeZone: zone, dateStyle: "short", timeStyle: "medium" });
      return Date.parse(`${form.format(second).replace(" ", "T")}Z`) - second;
    } catch { return null; } // a zone that this browser does not know
  };
  const dated = instant(newest) >= Date.UTC(1971, 0, 1);
  const told = dated ? aheadAt(newest) : 0, ahead = told ?? 0, minutes = Math.abs(ahead) / 60000;
  const offset = `UTC${ahead < 0 ? "-" : "+"}${two(Math.floor(minutes / 60))}:${two(minutes % 60)}`;
  const changed = aheadAt(oldest) === told ? "" : ", as after the clock was changed";
  return {
    shown: (at) => new Date(instant(at) + ahead).toISOString().slice(0, -1),
    instant: (text) => new Date(Date.parse(`${text.replace(" ", "T").slice(0, 23)}Z`) - ahead).toISOString(), // of what an axis of the library says
    title: !dated ? "time since a start without a date" : zone === "UTC" || told === null ? "time, UTC" : `time in ${zone}, ${offset}${changed}`,
  };
};
// What a plant recorded is not offered to the cloud of those who make the library.
const options = { responsive: true, displaylogo: false, displayModeBar: "hover", showSendToCloud: false, plotlyServerURL: "" };
// A title of an axis goes on in a second line where the chart is too narrow for it, instead of being cut off.
const folded = (text, chart) => {
  const most = Math.max(16, Math.floor((chart.clientWidth - 80) / 8)), lines = [""];
  for (const word of text.split(" ")) {
    if (lines.at(-1) && lines.at(-1).length + word.length >= most) lines.push(word);
    else lines.push(`${lines.pop()} ${word}`.trim());
  }
  return lines.join("<br>");
};
// What is folded is drawn without a width and gets its own when it opens; a print shows all of it.
const fitted = (part) => { for (const chart of part.querySelectorAll(".js-plotly-plot")) Plotly.Plots.resize(chart); };
document.addEventListener("toggle", ({ target }) => { if (target.open) fitted(target); }, true);
addEventListener("beforeprint", () => { for (const part of document.querySelectorAll("details:not([open])")) { part.open = true; part.dataset.printed = ""; fitted(part); } });
addEventListener("afterprint", () => { for (const part of document.querySelectorAll("details[data-printed]")) { part.open = false; delete part.dataset.printed; } });
// Paper is white, and whoever prints from a dark screen would get black boxes.
const inked = (paper, ink, line) => {
  for (const chart of document.querySelectorAll(".js-plotly-plot")) {
    const axes = Object.keys(chart._fullLayout).filter((name) => /^[xy]axis\d*$/.test(name));
    const grid = Object.fromEntries(axes.map((name) => [`${name}.gridcolor`, line]));
    Plotly.relayout(chart, { paper_bgcolor: paper, plot_bgcolor: paper, "font.color": ink, ...grid });
  }
};
addEventListener("beforeprint", () => inked("#ffffff", "#000000", "#dde3ea"));
addEventListener("afterprint", () => inked(paint("--paper"), paint("--ink"), paint("--line")));
const tell = (chart, text) => { chart.textContent = text; chart.classList.add("empty"); };
const draw = (id, traces, more, without) => {
  const chart = document.getElementById(id);
  if (!chart) return;
  if (!traces) tell(chart, without);
  else Plotly.newPlot(chart, traces, layout(more), options);
};
const load = async (url, more) => {
  const answer = await fetch(url, { headers: { Accept: "application/json" }, ...more });
  if (!answer.ok) throw new Error(`the service answered ${answer.status}`);
  return answer.json();
};
const chartLibrary = () => new Promise((done, failed) => {
  const script = document.createElement("script");
  script.src = "/static/plotly.min.js";
  script.onload = done;
  script.onerror = () => failed(new Error("the chart library did not load"));
  document.head.append(script);
});
