// Data.
const data = JSON.parse(document.getElementById("data").textContent);
const bytes = (text) => Uint8Array.from(atob(text), (c) => c.charCodeAt(0)).buffer;
const NONE = 65535, RAPID = 0, OUT = 8, PLUNGE = 16;
const n = data.count;
const whole = new Uint16Array(bytes(data.position));
const xyz = [0, 1, 2].map((axis) => {
  const [low, high] = data.frame[axis], out = new Float32Array(n);
  for (let i = 0; i < n; i++) out[i] = low + whole[3 * i + axis] / 65535 * (high - low);
  return out;
});
const unpack = (text, [low, high]) => {
  const q = new Uint16Array(bytes(text)), out = new Float32Array(q.length);
  for (let i = 0; i < q.length; i++) out[i] = q[i] === NONE ? NaN : low + q[i] / 65534 * (high - low);
  return out;
};
const stiffness = unpack(data.stiffness, data.stiffness_range);
const margin = unpack(data.margin, data.margin_range);
const angles = data.angles && data.angles.map((text, axis) => unpack(text, data.angle_ranges[axis]));
const line = new Uint32Array(bytes(data.line)), s = new Float32Array(bytes(data.s));
const kind = new Uint8Array(bytes(data.kind));
const other = data.other && { s: new Float32Array(bytes(data.other.s)),
  k: new Float32Array(bytes(data.other.stiffness)), plunge: new Uint8Array(bytes(data.other.plunge)) };
const cutting = (i) => (kind[i] & 7) !== RAPID;
// Plunges along the tool axis: unless the switch is on they set neither the colours nor the axis of the profile.
const rapidsBox = document.getElementById("rapids"), plungesBox = document.getElementById("plunges");
document.getElementById("plunges-label").hidden = data.scale_with_plunges === null;
const setAside = (i) => !plungesBox.checked && (kind[i] & PLUNGE) !== 0;
const MOTIONS = data.motions;

// Operations: each is a stretch of samples, [first, end).
const operations = data.operations;
let chosenOperation = -1;
const operationRange = (k) => [operations[k][0], k + 1 < operations.length ? operations[k + 1][0] : n];
const operationName = (k) => `${k + 1} ${operations[k][1]}`;
const starts = operations.map(([start]) => start), operationOf = (i) => rowAt(starts, i + 1) - 1;
// Colours.
const CLASSES = data.colours.length;
const scaleNow = () => plungesBox.checked && data.scale_with_plunges || data.scale;
const coloursNow = () => (theme.dark ? data.colours_dark : data.colours);
const classOf = (k) => classAt(k, scaleNow().ends, CLASSES);
// Classes 0..CLASSES-1 of the scale, then rapids, plunges beside the scale, out of reach.
const RAPIDS = CLASSES, PLUNGES = CLASSES + 1, UNREACHED = CLASSES + 2;
const path = new Path(xyz);
function classify() {
  path.classify((i) => {
    const mean = (stiffness[i] + stiffness[i - 1]) / 2;
    return !cutting(i) ? RAPIDS : Number.isNaN(mean) ? UNREACHED : setAside(i) ? PLUNGES : classOf(mean);
  }, CLASSES + 3);
}
classify();

// First sample of every program line, lowest stiffness of its cuts and of its plunges; the lines that leave the
// machine's reach.
const firstOf = new Map(), lowestOf = new Map(), lowestPlungeOf = new Map(), unreached = new Set();
for (let i = 0; i < n; i++) {
  if (!firstOf.has(line[i])) firstOf.set(line[i], i);
  const lowest = kind[i] & PLUNGE ? lowestPlungeOf : lowestOf;
  if (cutting(i) && !Number.isNaN(stiffness[i])) lowest.set(line[i], Math.min(stiffness[i], lowest.get(line[i])
    ?? Infinity));
  if (cutting(i) && kind[i] & OUT) unreached.add(line[i]);
}
// Colour of a line's bar; undefined where nothing is cut.
function lineColour(number) {
  if (unreached.has(number)) return ink.bad;
  if (lowestOf.has(number)) return coloursNow()[classOf(lowestOf.get(number))];
  if (!lowestPlungeOf.has(number)) return undefined;
  return plungesBox.checked ? coloursNow()[classOf(lowestPlungeOf.get(number))] : ink.plunge;
}
// What is pointed at.
let here = -1, chosenLine = 0, part;
const status = document.getElementById("status");
function describe(i) {
  const [x, y, z] = xyz.map((axis) => axis[i].toFixed(2));
  const turned = angles ? " " + angles.map((a, axis) => "ABC"[axis] + a[i].toFixed(2)).join(" ") : "";
  const tool = data.tools.reduce((found, [start, number]) => start <= i ? number : found, 0);
  const k = kind[i] & OUT ? "out of reach" : `${group(stiffness[i])} N/mm`;
  return [`line ${line[i]} \u00b7 ${k}`, `X${x} Y${y} Z${z}${turned} mm${angles ? ", deg" : ""}`,
    `margin ${margin[i].toFixed(3)} \u00b7 T${tool} \u00b7 ${MOTIONS[kind[i] & 7]}${kind[i] & PLUNGE ? ", plunge" : ""}`
      + ` \u00b7 ${group(s[i], 1)} mm along`,
    ...(operations.length > 1 ? [`operation ${operationName(operationOf(i))}`] : [])];
}
function point(i, stage) {
  here = i;
  for (const tip of document.querySelectorAll(".tip")) tip.hidden = true;
  if (i >= 0) {
    const text = describe(i);
    status.textContent = text.join(" \u00b7 ");
    if (stage) stage.tell(stage === view ? path.at(i) : stage.at(i), text);
    showLine(line[i]);
  }
  if (machineBox.checked) view.redraw(); else view.drawOverlay();
  profile.drawOverlay();
  part?.drawOverlay();
}
function choose(number) {
  chosenLine = number;
  const i = firstOf.get(number);
  if (i !== undefined) point(i); else {
    here = -1;
    status.textContent =
      `line ${number}: ${n < data.samples ? "no sample of it in this thinned drawing" : "no motion"}`;
    showLine(number);
    view.drawOverlay();
    profile.drawOverlay();
  }
}
function step(by) {
  let i = Math.max(0, Math.min(n - 1, here < 0 ? 0 : here + by));
  while (!rapidsBox.checked && !cutting(i) && i + by >= 0 && i + by < n) i += by;
  point(i, view);
}
// The path in 3-D.
const body = new MachineBody(data.scene), machineBox = document.getElementById("machine");
const scene = {
  beside: 90,
  paths: [path],
  heavy: n > 20000,
  // The box of the cuts: of all, or of the operation that is looked at.
  box() {
    if (chosenOperation < 0) return data.box;
    const [first, end] = operationRange(chosenOperation), box = [0, 1, 2].map(() => [Infinity, -Infinity]);
    for (let i = first; i < end; i++) if (cutting(i)) box.forEach((ends, axis) => {
      ends[0] = Math.min(ends[0], xyz[axis][i]);
      ends[1] = Math.max(ends[1], xyz[axis][i]);
    });
    return box[0][0] <= box[0][1] ? box : data.box;
  },
  draw(g, viewer) {
    const i = here < 0 ? kind.findIndex((v) => (v & 7) !== RAPID) : here;
    if (machineBox.checked) paint(g, viewer, body.items(viewer, [...xyz, ...(angles ?? [])].map((of) => of[i] ?? 0)
      .concat(0, 0, 0).slice(0, 6), { work: data.box, close: true }), true);
    if (chosenOperation >= 0) {
      g.globalAlpha = 0.13;
      this.drawPath(g, viewer, 0, n);
      g.globalAlpha = 1;
    }
    this.drawPath(g, viewer, ...(chosenOperation < 0 ? [0, n] : operationRange(chosenOperation)));
  },
  drawPath(g, { coarse }, first, end) {
    const stroke = (which, colour, width) => path.stroke(g, which, colour, width, coarse ? 2.5 : 0.5, first, end);
    if (rapidsBox.checked) {
      g.setLineDash([5, 4]);
      stroke(RAPIDS, ink.rapid, 1);
      g.setLineDash([]);
    }
    for (let c = CLASSES - 1; c >= 0; c--) stroke(c, coloursNow()[c], coarse ? 1 : 1.7);
    stroke(PLUNGES, ink.plunge, 1.7);
    stroke(UNREACHED, ink.bad, 2.4);
  },
  // The weakest places, ringed and named.
  label(g) {
    const taken = data.weakest.map((i) => { const [x, y] = path.at(i); return [x - 7, y, 14, 13]; });
    aligned(g, "left", "middle");
    for (const i of data.weakest) {
      const [x, y] = path.at(i), text = `line ${line[i]}`, wide = g.measureText(text).width;
      mark(g, x, y, 6, ink.ink, 1.6);
      let ty = y - 14;
      while (taken.some(([a, b, w, h]) => Math.abs(b - ty) < h && x + 11 < a + w + 6 && a < x + 11 + wide + 6)) ty +=
        17;
      taken.push([x + 11, ty, wide, 17]);
      g.globalAlpha = 0.85;
      g.fillStyle = ink.panel;
      g.fillRect(x + 9, ty - 8, wide + 5, 16);
      g.globalAlpha = 1;
      g.fillStyle = ink.ink;
      g.fillText(text, x + 11, ty);
    }
  },
  overlay(g) {
    if (chosenLine && firstOf.has(chosenLine)) {
      g.beginPath();
      for (let i = firstOf.get(chosenLine) + 1; i < n; i++) if (line[i] === chosenLine && path.of[i] >= 0) {
        g.moveTo(...path.at(i - 1));
        g.lineTo(...path.at(i));
      }
      g.globalAlpha = 0.75;
      stroke(g, ink.accent, 4);
      g.globalAlpha = 1;
    }
    if (here >= 0) mark(g, ...path.at(here), 5);
  },
  nearest: (x, y) => path.nearest(x, y, (i) => cutting(i) || rapidsBox.checked),
};
// Stiffness along the path.
const curve = new Float32Array(n), plungeCurve = new Float32Array(n);
// The curve, and beside it the plunges that neither belong to it nor set the axis.
function split() {
  for (let i = 0; i < n; i++) {
    curve[i] = cutting(i) && !setAside(i) ? stiffness[i] : NaN;
    plungeCurve[i] = setAside(i) ? stiffness[i] : NaN;
  }
  if (other) other.curve = other.k.map((k, i) => other.plunge[i] && !plungesBox.checked ? NaN : k);
}
split();
const model = {
  s,
  value: (i) => (setAside(i) ? plungeCurve[i] : curve[i]),
  curves: () => [...(other ? [{ s: other.s, k: other.curve, colour: ink.second }] : []),
    { s, k: curve, colour: ink.curve }],
  beside: () => ({ k: plungeCurve, colour: ink.plunge }),
  levels: () => [
    ...(data.mean !== null ? [{ value: data.mean, colour: ink.ink, dash: [6, 4] }] : []),
    ...(data.required !== null ? [{ value: data.required, colour: ink.bad, dash: [], held: true }] : []),
  ],
  ends: () => data.scale.ends,
  shades: () => [
    { holds: (i) => !cutting(i), colour: ink.soft },
    { holds: (i) => cutting(i) && kind[i] & OUT, colour: ink["bad-soft"] },
  ],
  rings: () => data.weakest,
  operations: { count: operations.length, range: operationRange, name: operationName, chosen: () => chosenOperation },
  marked() {
    if (!chosenLine || !firstOf.has(chosenLine)) return null;
    const start = firstOf.get(chosenLine);
    let end = start;
    while (end + 1 < n && line[end + 1] === chosenLine) end++;
    return [start, end];
  },
  here: () => here,
};
// The program; only the rows in sight exist.
const ROW = 19;
const listing = document.getElementById("listing"), space = document.getElementById("listing-space");
const source = data.source;
let lineHere = 0;
listing.style.setProperty("--digits", String(source.length).length);
space.style.height = `${source.length * ROW}px`;
document.getElementById("program-note").textContent =
  `${group(source.length)} lines; the bar is the line's lowest stiffness`;
function drawListing() {
  const first = Math.max(0, Math.floor(listing.scrollTop / ROW) - 5);
  const last = Math.min(source.length, Math.ceil((listing.scrollTop + listing.clientHeight) / ROW) + 5), rows = [];
  for (let i = first; i < last; i++) {
    const row = document.createElement("div"), label = document.createElement("span");
    row.className = i + 1 === lineHere ? "row here" : "row";
    row.style.top = `${i * ROW}px`;
    row.dataset.line = i + 1;
    label.className = "n";
    label.textContent = i + 1;
    const colour = lineColour(i + 1);
    if (colour) label.style.borderLeftColor = colour;
    row.append(label, document.createTextNode(source[i]));
    rows.push(row);
  }
  space.replaceChildren(...rows);
}
function showLine(number) {
  if (number === lineHere) return;
  lineHere = number;
  const top = (number - 1) * ROW;
  if (top < listing.scrollTop || top + ROW > listing.scrollTop + listing.clientHeight)
    listing.scrollTop = top - listing.clientHeight / 2;
  drawListing();
}
listing.addEventListener("scroll", drawListing);
listing.addEventListener("click", (e) => {
  const row = e.target.closest(".row");
  if (row) choose(Number(row.dataset.line));
});
listing.addEventListener("keydown", (e) => {
  const by = { ArrowUp: -1, ArrowDown: 1, PageUp: -20, PageDown: 20 }[e.key];
  if (by === undefined) return;
  choose(Math.max(1, Math.min(source.length, (lineHere || 1) + by)));
  e.preventDefault();
});
new ResizeObserver(drawListing).observe(listing);
// Everything together.
const legendRamp = document.getElementById("legend-ramp");
function retheme() {
  legendRamp.style.background = ramp(coloursNow());
  view.redraw();
  part?.redraw();
  profile.redraw();
  drawListing();
}
let view, profile;
watchTheme(() => retheme());
view = new Viewer(document.getElementById("view"), scene, {
  point: (i) => point(i, i < 0 ? null : view),
  pick: (i) => { chosenLine = i < 0 ? 0 : line[i]; point(i, i < 0 ? null : view); },
  step,
});
profile = new Profile(document.getElementById("profile"), model, {
  point: (i) => point(i, profile),
  step,
  operation: (i) => chooseOperation(operationOf(i)),
});
view.resize();
profile.resize();
retheme();
for (const box of [rapidsBox, machineBox]) box.addEventListener("change", () => view.redraw());
for (const button of document.querySelectorAll("button.place")) button.addEventListener("click", () => {
  chosenLine = Number(button.dataset.line);
  point(Number(button.dataset.sample), view);
  document.getElementById("view-panel").scrollIntoView({ block: "nearest" });
});
function showLegend() {
  const { ends: [low, high], beyond_low, beyond_high } = scaleNow();
  document.getElementById("legend-low").textContent = (beyond_low ? "\u2264 " : "") + group(low);
  document.getElementById("legend-high").textContent = (beyond_high ? "\u2265 " : "") + group(high);
  document.querySelector(".rapid-key").hidden = !path.has(RAPIDS);
  document.getElementById("plunge-key").hidden = !path.has(PLUNGES);
  document.getElementById("out-key").hidden = !path.has(UNREACHED);
  for (const entry of document.querySelectorAll("#profile-key .plunge-key")) entry.hidden = plungesBox.checked;
}
plungesBox.addEventListener("change", () => {
  classify();
  split();
  retheme();
  showLegend();
});
const key = document.getElementById("profile-key");
function addKey(kindOfLine, text) {
  const entry = document.createElement("span");
  entry.className = `key ${kindOfLine}`;
  entry.textContent = text;
  key.append(entry);
}
addKey("", data.machine);
if (other) addKey("second-key", data.other.machine);
if (data.mean !== null) addKey("mean-key", `mean ${group(data.mean)} N/mm`);
if (data.required !== null) addKey("required-key", `required ${group(data.required)} N/mm`);
if (data.scale_with_plunges) addKey("plunge-key",
  `plunges ${group(data.plunges[0])} to ${group(data.plunges[1])} N/mm`);
showLegend();
// One operation alone: in the path, in the profile.
const operationRows = [...document.querySelectorAll("[data-operation]")], operationShown = document.getElementById(
  "operation-shown");
function chooseOperation(k) {
  chosenOperation = k === chosenOperation ? -1 : k;
  for (const row of operationRows) row.closest("tr").classList.toggle("chosen",
    Number(row.dataset.operation) === chosenOperation);
  operationShown.hidden = chosenOperation < 0;
  if (chosenOperation < 0) profile.all();
  else {
    const [first, end] = operationRange(chosenOperation);
    operationShown.textContent = `\u2715 only ${operationName(chosenOperation)}`;
    if (end > first) {
      profile.show(s[first], s[end - 1]);
      showLine(operations[chosenOperation][2]);
    }
  }
  view.fit();
  view.redraw();
  profile.redraw();
}
for (const row of operationRows) row.addEventListener("click", () => {
  chooseOperation(Number(row.dataset.operation));
  if (chosenOperation >= 0) document.getElementById("view-panel").scrollIntoView({ block: "nearest" });
});
operationShown.addEventListener("click", () => chooseOperation(chosenOperation));
