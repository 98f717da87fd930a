// The treemap: units, and the loops of a unit once it is opened. A click on a loop opens its page.
"use strict";
const treemap = document.getElementById("treemap");
const WORDS = { stiction: "valve sticks", no_stiction: "no stiction", inconclusive: "cannot tell", not_auditable: "not auditable" };
const SCALE = [[0, "#b3261e"], [0.6, "#e0a030"], [0.8, "#9bb84a"], [1, "#2f8f57"]];

function leaves(rows) {
  const units = new Map();
  const found = { ids: [], labels: [], parents: [], values: [], colours: [], texts: [] };
  const add = (id, label, parent, value, colour, text) => {
    found.ids.push(id); found.labels.push(label); found.parents.push(parent); found.values.push(value); found.colours.push(colour); found.texts.push(text);
  };
  const safe = (text) => text.replaceAll("&", "&amp;").replaceAll("<", "&lt;").replaceAll(">", "&gt;");
  for (const [tag, unit, importance, verdict, , health] of rows) {
    const key = `u:${unit ?? ""}`;
    const known = units.get(key) ?? { name: unit ?? "no unit named", weight: 0, health: 0, loops: 0 };
    const weight = importance || 0.001;
    known.weight += weight; known.health += weight * (health ?? 50); known.loops += 1;
    units.set(key, known);
    add(`l:${tag}`, safe(tag), key, weight, health ?? 50, `${WORDS[verdict]}<br>health ${health ?? "not known"}`);
  }
  for (const [key, unit] of units) add(key, safe(unit.name), "plant", unit.weight, unit.health / unit.weight, `${unit.loops} loops<br>health ${(unit.health / unit.weight).toFixed(0)}`);
  const total = found.values.slice(rows.length).reduce((a, b) => a + b, 0);
  add("plant", "Plant", "", total, null, `${rows.length} loops`);
  return found;
}

async function drawTreemap() {
  const { rows } = await load(treemap.dataset.url);
  const found = leaves(rows);
  await Plotly.newPlot(treemap, [{
    type: "treemap", ids: found.ids, labels: found.labels, parents: found.parents, values: found.values, text: found.texts,
    branchvalues: "total", maxdepth: rows.length > 400 ? 2 : 3, hovertemplate: "%{label}<br>%{text}<extra></extra>", textinfo: "label+text",
    marker: { colors: found.colours, colorscale: SCALE, cmin: 0, cmax: 100, showscale: true, colorbar: { title: { text: "health" }, thickness: 12 }, line: { width: 1, color: paint("--paper") } },
    tiling: { pad: 2 }, pathbar: { visible: true },
  }], layout({ height: 480, margin: { l: 4, r: 4, t: 26, b: 4 } }), options);
  treemap.on("plotly_treemapclick", ({ points: [point] }) => {
    if (!point.id.startsWith("l:")) return true;
    location.assign(`/loops/${encodeURIComponent(point.id.slice(2))}`);
    return false;
  });
  treemap.dataset.drawn = "yes";
}

if (treemap) drawTreemap().catch((error) => tell(treemap, `The treemap could not be loaded: ${error.message}.`));
