// Data.
const data = JSON.parse($("data").textContent);
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
  k: new Float32Array(bytes(data.other.stiffness)) };
const cutting = (i) => (kind[i] & 7) !== RAPID;
// Plunges along the tool axis set neither the colours nor the axis of the profile.
const rapidsBox = $("rapids"), plunges = (i) => (kind[i] & PLUNGE) !== 0;
const MOTIONS = data.motions;

// Operations: each is a stretch of samples, [first, end).
const operations = data.operations;
let chosenOperation = -1;
const operationRange = (k) => [operations[k][0], k + 1 < operations.length ? operations[k + 1][0] : n];
const operationName = (k) => `${k + 1} ${operations[k][1]}`;
const starts = operations.map(([start]) => start), operationOf = (i) => rowAt(starts, i + 1) - 1;
// Colours.
const classOf = (k) => classAt(k, data.scale.ends, CLASSES);
const path = new Path(xyz);
path.classify((i) => {
  const mean = (stiffness[i] + stiffness[i - 1]) / 2;
  return !cutting(i) ? RAPIDS : Number.isNaN(mean) ? UNREACHED : plunges(i) ? PLUNGES : classOf(mean);
});

// First sample of every program line, lowest stiffness of its cuts; lines that plunge, that leave the machine's reach.
const firstOf = new Map(), lowestOf = new Map(), plunging = new Set(), unreached = new Set();
for (let i = 0; i < n; i++) {
  if (!firstOf.has(line[i])) firstOf.set(line[i], i);
  if (plunges(i)) plunging.add(line[i]);
  else if (cutting(i) && stiffness[i]) lowestOf.set(line[i], Math.min(stiffness[i], lowestOf.get(line[i]) ?? Infinity));
  if (cutting(i) && kind[i] & OUT) unreached.add(line[i]);
}
// Colour of a line's bar; undefined where nothing is cut.
function lineColour(number) {
  if (unreached.has(number)) return ink.bad;
  if (lowestOf.has(number)) return coloursNow()[classOf(lowestOf.get(number))];
  return plunging.has(number) ? ink.plunge : undefined;
}
// What is pointed at.
let here = -1, chosenLine = 0, part;
const status = $("status");
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
    listing.show(line[i]);
  }
  if (machineBox.checked && !scene.heavy) view.redraw(); else view.drawOverlay();
  profile.drawOverlay();
  part?.drawOverlay();
}
function choose(number) {
  chosenLine = number;
  const i = firstOf.get(number) ?? -1;
  point(i);
  if (i >= 0) return;
  status.textContent =
    `line ${number}: ${n < data.samples ? "no sample of it in this thinned drawing" : "no motion"}`;
  listing.show(number);
}
function step(by) {
  let i = Math.max(0, Math.min(n - 1, here < 0 ? 0 : here + by));
  while (!rapidsBox.checked && !cutting(i) && i + by >= 0 && i + by < n) i += by;
  point(i, view);
}
// The path in 3-D.
const body = new MachineBody(data.scene), machineBox = $("machine");
const scene = {
  beside: 90,
  paths: [path],
  heavy: n > 20000,
  // The box of the cuts: of all, or of the operation that is looked at.
  box() {
    if (chosenOperation < 0) return data.box;
    const [first, end] = operationRange(chosenOperation);
    const box = extentOf(xyz, (i) => i >= first && i < end && cutting(i));
    return box[0][0] <= box[0][1] ? box : data.box;
  },
  draw(g, viewer) {
    const i = here < 0 ? kind.findIndex((v) => (v & 7) !== RAPID) : here;
    if (machineBox.checked) paint(g, viewer, body.items(viewer, [...xyz, ...(angles ?? [])].map((of) => of[i] ?? 0)
      .concat(0, 0, 0).slice(0, 6), { work: data.box, close: true }), true);
    const look = { width: viewer.coarse ? 1 : 1.7, skip: viewer.coarse ? 2.5 : 0.5, rapids: rapidsBox.checked };
    if (chosenOperation >= 0) {
      g.globalAlpha = 0.13;
      path.paint(g, look);
      g.globalAlpha = 1;
    }
    const [first, end] = chosenOperation < 0 ? [0, n] : operationRange(chosenOperation);
    path.paint(g, { ...look, first, end });
  },
  // The weakest places, ringed and named, from the top down; the names of near ones stand below each other.
  label(g, viewer) {
    let last = [-Infinity, -Infinity];
    for (const [x, y, i] of data.weakest.map((i) => [...path.at(i), i]).sort((a, b) => a[1] - b[1])) {
      mark(g, x, y, 6, ink.ink, 1.6);
      last = [x, Math.abs(x - last[0]) < 80 ? Math.max(y - 14, last[1] + 17) : y - 14];
      viewer.write(g, `line ${line[i]}`, x + 11, last[1]);
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
const curve = stiffness.map((k, i) => (cutting(i) && !plunges(i) ? k : NaN));
const plungeCurve = stiffness.map((k, i) => (plunges(i) ? k : NaN));
const model = {
  s,
  value: (i) => (cutting(i) ? stiffness[i] : NaN),
  curves: () => [...(other ? [{ ...other, colour: ink.second }] : []),
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
const listing = new Listing($("listing"), data.source, { colour: lineColour, choose });
// Everything together.
const view = new Viewer($("view"), scene, {
  point: (i) => point(i, i < 0 ? null : view),
  pick: (i) => { chosenLine = i < 0 ? 0 : line[i]; point(i, i < 0 ? null : view); },
  step,
});
const profile = new Profile($("profile"), model, {
  point: (i) => point(i, profile),
  step,
  operation: (i) => chooseOperation(operationOf(i)),
});
watchTheme(() => {
  for (const stage of [view, profile, part]) stage?.redraw();
  listing.draw();
});
view.resize();
profile.resize();
listing.draw();
for (const box of [rapidsBox, machineBox]) box.addEventListener("change", () => view.redraw());
for (const button of document.querySelectorAll("button.place")) button.addEventListener("click", () => {
  chosenLine = Number(button.dataset.line);
  point(Number(button.dataset.sample), view);
  $("view-panel").scrollIntoView({ block: "nearest" });
});
// One operation alone: in the path, in the profile.
const operationRows = [...document.querySelectorAll("[data-operation]")], operationShown = $("operation-shown");
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
      listing.show(operations[chosenOperation][2]);
    }
  }
  view.fit();
  view.redraw();
  profile.redraw();
}
for (const row of operationRows) row.addEventListener("click", () => {
  chooseOperation(Number(row.dataset.operation));
  if (chosenOperation >= 0) $("view-panel").scrollIntoView({ block: "nearest" });
});
operationShown.addEventListener("click", () => chooseOperation(chosenOperation));
