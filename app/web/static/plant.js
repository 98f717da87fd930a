// The treemap: units, and the loops of a unit once it is opened. A click on a loop opens its page.
// The chart library is a hundred times the page: it is fetched when the treemap comes near the screen.
"use strict";
const treemap = document.getElementById("treemap");
const WORDS = { stiction: "valve sticks", no_stiction: "no stiction", inconclusive: "cannot tell", not_auditable: "not auditable" };
// The chart library knows no colour of "not evaluated" beside a scale: it is one below its least value, -1.
const LEAST = -1, GREY = "#8794a3", place = (health) => (health - LEAST) / (100 - LEAST);
const SCALE = [[0, GREY], [place(-0.6), GREY], [place(-0.5), "#b3261e"], [place(0), "#b3261e"], [place(60), "#e0a030"], [place(80), "#9bb84a"], [1, "#2f8f57"]];
const colour = (health) => health ?? LEAST;
const INK = (health) => (health < 20 ? "#ffffff" : "#000000"); // of the two the one that stands out against the scale there: at least 4.5 to 1
const LIGHT = 0.001; // so that a loop of no importance can be seen
const safe = (text) => text.replaceAll("&", "&amp;").replaceAll("<", "&lt;").replaceAll(">", "&gt;");
const WHOLE = new Intl.NumberFormat("en", { maximumFractionDigits: 0, roundingMode: "halfEven" }); // as the tables round: 38.5 is 38
const known = (health) => (health === null ? "not evaluated" : WHOLE.format(health));
const loopsOf = (count) => (count === 1 ? "1 loop" : `${count} loops`);
const MOST_LETTERS = 18; // of a tag: the chart library writes a longer one too small to be read
const lettersOf = (text) => (Intl.Segmenter ? Array.from(new Intl.Segmenter().segment(text), ({ segment }) => segment) : [...text]); // an accent or a joined sign is no letter of its own
const short = (tag) => { const letters = tag.length > MOST_LETTERS ? lettersOf(tag) : []; return letters.length > MOST_LETTERS ? `${letters.slice(0, 8).join("")}…${letters.slice(-9).join("")}` : tag; };
const key = (unit) => `u:${unit ?? ""}`;

function nodes(units, loops) {
  const found = { ids: [], labels: [], names: [], parents: [], values: [], colours: [], inks: [], texts: [] };
  const add = (id, label, parent, value, health, text) => {
    found.ids.push(id); found.labels.push(safe(id.startsWith("l:") ? short(label) : label)); found.names.push(safe(label)); found.parents.push(parent); found.values.push(value); found.colours.push(colour(health)); found.inks.push(INK(health ?? 100)); found.texts.push(text);
  };
  const rest = new Map(units.map(([name, count, importance]) => [key(name), { count, weight: Math.max(importance, LIGHT * count), share: 0, shown: 0 }]));
  for (const [tag, unit, importance, verdict, health] of loops) {
    const mine = rest.get(key(unit));
    if (!mine) continue;
    const weight = Math.max(importance, LIGHT);
    mine.share += weight; mine.shown += 1;
    add(`l:${tag}`, tag, key(unit), weight, health, `${WORDS[verdict]}<br>health ${known(health)}`);
  }
  let total = 0, weighed = 0, judged = 0;
  for (const [name, count, , health] of units) {
    const { weight, share, shown } = rest.get(key(name));
    const others = count - shown;
    if (others > 0) add(`o:${name ?? ""}`, others === 1 ? "1 other" : `${others} others`, key(name), Math.max(weight - share, LIGHT), health, "less urgent, or not evaluated");
    const sum = others > 0 ? share + Math.max(weight - share, LIGHT) : share;
    add(key(name), name ?? "no unit named", "plant", sum, health, `${loopsOf(count)}<br>health ${known(health)}`);
    total += sum;
    if (health !== null) { judged += sum; weighed += sum * health; }
  }
  add("plant", "Plant", "", total, judged ? weighed / judged : null, loopsOf(units.reduce((sum, unit) => sum + unit[1], 0)));
  return found;
}

function traceOf(units, loops, level) {
  const found = nodes(units, loops);
  return {
    type: "treemap", ids: found.ids, labels: found.labels, parents: found.parents, values: found.values, text: found.texts, customdata: found.names, level,
    branchvalues: "total", maxdepth: units.length > 12 ? 2 : 3, hovertemplate: "%{customdata}<br>%{text}<extra></extra>", textinfo: "label+text", textfont: { color: found.inks },
    marker: { colors: found.colours, colorscale: SCALE, cmin: LEAST, cmax: 100, showscale: true, colorbar: { title: { text: "health" }, thickness: 12 }, line: { width: 1, color: paint("--paper") } },
    tiling: { pad: 2 }, pathbar: { visible: true },
  };
}

const opened = new Map();
async function open(unit, told) {
  if (!opened.has(unit)) {
    opened.set(unit, (await load(`${treemap.dataset.url}?unit=${encodeURIComponent(unit)}`)).loops);
  }
  const loops = told.loops.filter((row) => (row[1] ?? "") !== unit).concat(opened.get(unit));
  await Plotly.react(treemap, [traceOf(told.units, loops, `u:${unit}`)], treemap.layout, options);
}

async function drawTreemap() {
  const [told] = await Promise.all([load(treemap.dataset.url), chartLibrary()]);
  await Plotly.newPlot(treemap, [traceOf(told.units, told.loops)], layout({ height: 480, margin: { l: 4, r: 4, t: 26, b: 4 } }), options);
  const whole = new Set(told.units.filter(([name, count]) => told.loops.filter((row) => row[1] === name).length === count).map(([name]) => name ?? ""));
  treemap.on("plotly_treemapclick", ({ points: [point] }) => {
    const [kind, name] = [point.id.slice(0, 2), point.id.slice(2)];
    if (kind === "l:") location.assign(`/loops/${encodeURIComponent(name)}`);
    else if (kind === "o:") location.assign(name ? `/table?unit=${encodeURIComponent(name)}` : "/table?no_unit=true");
    else if (kind === "u:" && !whole.has(name)) open(name, told).catch(failed);
    else return true;
    return false;
  });
  treemap.dataset.drawn = "yes";
}

const failed = (error) => tell(treemap, `The treemap could not be loaded: ${error.message}.`);
// What a fortnight said is read apart: on a large plant that takes longer than the page.
const course = document.getElementById("course");
if (course) {
  const without = (why) => tell(course, `The last nights could not be read: ${why}.`);
  fetch(course.dataset.url).then(async (answer) => {
    if (!answer.ok || answer.redirected) return without(answer.redirected ? "the login has ended" : `the service answered ${answer.status}`);
    const found = new DOMParser().parseFromString(await answer.text(), "text/html");
    course.replaceChildren(...found.body.children);
    return undefined;
  }).catch((error) => without(error.message));
}

if (treemap) {
  const near = new IntersectionObserver((seen) => {
    if (!seen.some((one) => one.isIntersecting)) return;
    near.disconnect();
    drawTreemap().catch(failed);
  }, { rootMargin: "300px" });
  near.observe(treemap);
}
