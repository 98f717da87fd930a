// The treemap: units, and the loops of a unit once it is opened. A click on a loop opens its page.
// The chart library is a hundred times the page: it is fetched when the treemap comes near the screen.
"use strict";
const treemap = document.getElementById("treemap");
const WORDS = { stiction: "valve sticks", no_stiction: "no stiction", inconclusive: "cannot tell", not_auditable: "not auditable" };
// The chart library knows no colour of "not evaluated" beside a scale: it is one below its least value, -1.
const LEAST = -1, GREY = "#8794a3", place = (health) => (health - LEAST) / (100 - LEAST);
const LIMITS = treemap.dataset.limits.split(" ").map(Number), CLASSES = treemap.dataset.classes.split("|"), CLASS_NAMES = treemap.dataset.classNames.split("|");
const SCALE = [[0, GREY], [place(-0.6), GREY], [place(-0.5), "#b3261e"], [place(0), "#b3261e"], [place(LIMITS[0]), "#e0a030"], [place(LIMITS[1]), "#9bb84a"], [1, "#2f8f57"]];
const colour = (health) => health ?? LEAST;
const INK = (health) => (health < 20 ? "#ffffff" : "#000000"); // of the two the one that stands out against the scale there: at least 4.5 to 1
const LIGHT = 0.001; // so that a loop of no importance can be seen
const safe = (text) => text.replaceAll("&", "&amp;").replaceAll("<", "&lt;").replaceAll(">", "&gt;");
const WHOLE = new Intl.NumberFormat("en", { maximumFractionDigits: 0, roundingMode: "halfEven" }); // as the tables round: 38.5 is 38
const known = (health) => (health === null ? "not evaluated" : WHOLE.format(health));
const loopsOf = (count) => (count === 1 ? "1 loop" : `${WHOLE.format(count)} loops`);
const MOST_LETTERS = 18; // of a tag: the chart library writes a longer one too small to be read
const lettersOf = (text) => (Intl.Segmenter ? Array.from(new Intl.Segmenter().segment(text), ({ segment }) => segment) : [...text]); // an accent or a joined sign is no letter of its own
const short = (tag) => { const letters = tag.length > MOST_LETTERS ? lettersOf(tag) : []; return letters.length > MOST_LETTERS ? `${letters.slice(0, 8).join("")}…${letters.slice(-9).join("")}` : tag; };
const key = (unit) => `u:${unit ?? ""}`;

// Of a unit whose loops have no room to be named, its worst few stand for themselves, and all of them by their health.
const classWords = (place) => (place > LIMITS.length ? CLASSES[place] : `health ${CLASSES[place]}`);
const classOf = (health) => (health === null ? LIMITS.length + 1 : LIMITS.filter((limit) => health >= limit).length);
const TAG_PX2 = 2400; // in which a tag can be read
const FEW = 3, FEW_PX2 = 2800, ONE_PX2 = 1300, FEW_SHARE = 0.3; // the worst few of a unit, as many as this share of its area has room for
const WORDS_PX2 = 3600, NUMBER_PX2 = 500; // in which words, or a number alone, can be read
const NARROW_PX = 600; // of a chart that has no room for a scale beside it
const UNIT_PX2 = 16000, LOWEST = 480, HIGHEST = 1100; // so that a head and a name of each unit can be read where the screen is narrow

function viewOf(units, level = "") {
  const height = Math.min(Math.max(LOWEST, (units.length * UNIT_PX2) / treemap.clientWidth), HIGHEST);
  const area = treemap.clientWidth * height, count = units.reduce((sum, unit) => sum + unit[1], 0), most = Math.floor(area / TAG_PX2);
  const whole = count <= most;
  const px2 = (loops) => (0.7 * area * loops) / count; // about a third goes into frames and heads
  return { level, height, most, whole, count, px2, named: (name) => whole || level === key(name), few: (loops) => Math.max(Math.min(FEW, Math.floor((FEW_SHARE * px2(loops)) / FEW_PX2)), FEW_SHARE * px2(loops) > ONE_PX2 ? 1 : 0) };
}

function nodes(units, loops, view) {
  const found = { ids: [], labels: [], names: [], parents: [], values: [], colours: [], inks: [], texts: [], told: [] };
  const add = (id, label, parent, value, health, told, text = told) => {
    found.ids.push(id); found.labels.push(safe(id.startsWith("l:") ? short(label) : label)); found.names.push(safe(label)); found.parents.push(parent); found.values.push(value); found.colours.push(colour(health)); found.inks.push(INK(health ?? 100)); found.texts.push(text); found.told.push(told);
  };
  const addLoop = ([tag, unit, , verdict, health], value, text) => add(`l:${tag}`, tag, key(unit), value, health, `${WORDS[verdict]}<br>health ${known(health)}`, text);
  // Sizes of loops by name: their importance. What there is no room for is told by its health.
  const addNamed = (name, count, importance, classes, mine) => {
    const left = classes.map(([loops]) => loops), weights = mine.map((row) => Math.max(row[2], LIGHT));
    mine.forEach((row, k) => { addLoop(row, weights[k]); left[classOf(row[4])] -= 1; });
    const others = count - mine.length, share = weights.reduce((sum, weight) => sum + weight, 0);
    const rest = Math.min(Math.max(importance - share, LIGHT * others), share); // half of the unit stays for names
    left.forEach((loops, place) => {
      if (loops > 0) add(`o:${place}${name ?? ""}`, loops === 1 ? "1 other" : `${WHOLE.format(loops)} others`, key(name), (rest * loops) / others, classes[place][1], classWords(place));
    });
  };
  // Sizes of classes: how many loops they have.
  const addClasses = (name, count, classes, mine) => {
    const worst = (FEW_SHARE * count) / mine.length, share = mine.length ? 1 - FEW_SHARE : 1;
    for (const row of mine) addLoop(row, worst, view.px2(worst) < WORDS_PX2 ? "" : undefined);
    classes.forEach(([loops, health], place) => {
      if (loops === 0) return;
      const px2 = view.px2(share * loops), words = px2 >= WORDS_PX2, number = words ? loopsOf(loops) : WHOLE.format(loops);
      add(`c:${place}${name ?? ""}`, px2 < NUMBER_PX2 ? " " : number, key(name), share * loops, health, `${loopsOf(loops)}<br>${classWords(place)}`, words ? CLASSES[place] : "");
    });
  };
  const listed = new Map(units.map(([name]) => [key(name), []]));
  for (const row of loops) listed.get(key(row[1]))?.push(row);
  let weighed = 0, judged = 0;
  for (const [name, count, importance, health, classes] of units) {
    const mine = listed.get(key(name));
    if (view.named(name)) addNamed(name, count, importance, classes, count > view.most ? mine.slice(0, view.most / 2) : mine);
    else addClasses(name, count, classes, mine.slice(0, view.few(count)));
    add(key(name), name ?? "no unit named", "plant", 0, health, `${loopsOf(count)}<br>health ${known(health)}`);
    const weight = Math.max(importance, LIGHT * count);
    if (health !== null) { judged += weight; weighed += weight * health; }
  }
  add("plant", "Plant", "", 0, judged ? weighed / judged : null, loopsOf(view.count));
  return found;
}

function traceOf(units, loops, view) {
  const found = nodes(units, loops, view), narrow = treemap.clientWidth < NARROW_PX;
  const scale = narrow ? { orientation: "h", y: 0, yanchor: "top", len: 1 } : {};
  return {
    type: "treemap", ids: found.ids, labels: found.labels, parents: found.parents, values: found.values, text: found.texts, hovertext: found.told, customdata: found.names, level: view.level,
    branchvalues: "remainder", maxdepth: 3, hovertemplate: "%{customdata}<br>%{hovertext}<extra></extra>", textinfo: "label+text", textfont: { color: found.inks },
    marker: { colors: found.colours, colorscale: SCALE, cmin: LEAST, cmax: 100, showscale: true, colorbar: { title: { text: "health" }, thickness: 12, ...scale }, line: { width: 1, color: paint("--paper") } },
    sort: view.whole || view.level !== "", tiling: { pad: 2 }, pathbar: { visible: true },
  };
}

const sizes = document.getElementById("treemap-sizes");
const opened = new Map();
async function show(told, level, unit) {
  const view = viewOf(told.units, level);
  if (level && !opened.has(unit)) opened.set(unit, (await load(`${treemap.dataset.url}?unit=${encodeURIComponent(unit)}`)).loops);
  const loops = level ? told.loops.filter((row) => (row[1] ?? "") !== unit).concat(opened.get(unit)) : told.loops;
  const all = view.whole || told.units.some(([name, count]) => key(name) === level && count <= view.most);
  sizes.textContent = all ? "importance" : level ? "importance, of all that are not named half of the unit at most" : "number of loops; of each unit the worst by name, enlarged, and all by health";
  const drawn = layout({ height: view.height, margin: { l: 4, r: 4, t: 26, b: 4 } });
  await Plotly.react(treemap, [traceOf(told.units, loops, view)], drawn, options);
  return view;
}

async function drawTreemap() {
  const [told] = await Promise.all([load(treemap.dataset.url), chartLibrary()]);
  let view = await show(told, "");
  const go = (level, unit) => show(told, level, unit).then((shown) => { view = shown; }).catch(failed);
  const complete = new Set(told.units.filter(([name, count]) => told.loops.filter((row) => row[1] === name).length === count).map(([name]) => name ?? ""));
  treemap.on("plotly_treemapclick", ({ points: [{ id }] }) => {
    const kind = id.slice(0, 2), name = id.slice("co".includes(id[0]) ? 3 : 2);
    if (kind === "l:") location.assign(`/loops/${encodeURIComponent(name)}`);
    else if (kind === "o:" || kind === "c:") location.assign(`/table?${name ? `unit=${encodeURIComponent(name)}` : "no_unit=true"}&health_class=${CLASS_NAMES[id[2]]}`);
    else if (view.whole && view.level === "" && (kind !== "u:" || complete.has(name))) return true;
    else if (id === "plant" || id === view.level) go("");
    else go(`u:${name}`, name);
    return false;
  });
  treemap.dataset.drawn = "yes";
}

const failed = (error) => tell(treemap, `The treemap could not be loaded: ${error.message}.`);
// What a fortnight said is read apart: on a large plant that takes longer than the page.
const course = document.getElementById("course");
if (course) {
  const without = (why) => tell(course, `The last nights could not be loaded: ${why}.`);
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
