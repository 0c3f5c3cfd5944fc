// ---------------------------------------------------------------- data
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
const other = data.other && { s: new Float32Array(bytes(data.other.s)), k: new Float32Array(bytes(data.other.stiffness)), plunge: new Uint8Array(bytes(data.other.plunge)) };
const cutting = (i) => (kind[i] & 7) !== RAPID;
// Plunges along the tool axis: unless the switch is on they set neither the colours nor the axis of the profile.
const plungesBox = document.getElementById("plunges");
document.getElementById("plunges-label").hidden = data.scale_with_plunges === null;
const setAside = (i) => !plungesBox.checked && (kind[i] & PLUNGE) !== 0;
const MOTIONS = data.motions;

// Operations: each is a stretch of samples, [first, end).
const operations = data.operations;
let chosenOperation = -1;
const operationRange = (k) => [operations[k][0], k + 1 < operations.length ? operations[k + 1][0] : n];
const operationName = (k) => `${k + 1} ${operations[k][1]}`;
function operationOf(i) {
  let low = 0, high = operations.length;
  while (low < high) { const middle = (low + high) >> 1; if (operations[middle][0] <= i) low = middle + 1; else high = middle; }
  return low - 1;
}

// "45 123": groups of thousands by thin spaces, as in the tables.
function group(v, digits = 0) {
  if (!Number.isFinite(v)) return "-";
  const [integer, fraction] = v.toFixed(digits).split(".");
  return integer.replace(/\B(?=(\d{3})+$)/g, "\u202f") + (fraction ? "." + fraction : "");
}

// ---------------------------------------------------------------- colours
const CLASSES = data.colours.length;
const scaleNow = () => plungesBox.checked && data.scale_with_plunges || data.scale;
const darkQuery = matchMedia("(prefers-color-scheme: dark)");
const root = document.documentElement;
let colours, ink = {};
function readTheme() {
  const dark = darkQuery.matches && !root.classList.contains("printing");
  colours = dark ? data.colours_dark : data.colours;
  const style = getComputedStyle(root);
  for (const name of ["panel", "ink", "muted", "line", "soft", "accent", "curve", "second", "bad", "bad-soft", "rapid", "plunge"])
    ink[name] = style.getPropertyValue("--" + name).trim();
  document.getElementById("legend-ramp").style.background = `linear-gradient(to right, ${colours.join(",")})`;
}
function classOf(k) {
  const [low, high] = scaleNow().ends;
  return Math.max(0, Math.min(CLASSES - 1, Math.floor((k - low) / (high - low) * CLASSES)));
}

// Segments (i - 1, i) sorted by class: each class is one path to stroke. 0..CLASSES-1, then rapids, plunges beside the
// scale, out of reach.
const RAPIDS = CLASSES, PLUNGES = CLASSES + 1, UNREACHED = CLASSES + 2;
const segmentClass = new Uint8Array(n), starts = new Int32Array(CLASSES + 4);
let segments;
function classify() {
  segmentClass.fill(255);
  starts.fill(0);
  for (let i = 1; i < n; i++) {
    if (xyz[0][i] === xyz[0][i - 1] && xyz[1][i] === xyz[1][i - 1] && xyz[2][i] === xyz[2][i - 1]) continue;
    const mean = (stiffness[i] + stiffness[i - 1]) / 2;
    segmentClass[i] = !cutting(i) ? RAPIDS : Number.isNaN(mean) ? UNREACHED : setAside(i) ? PLUNGES : classOf(mean);
    starts[segmentClass[i] + 1]++;
  }
  for (let c = 0; c < CLASSES + 3; c++) starts[c + 1] += starts[c];
  segments = new Int32Array(starts[CLASSES + 3]);
  const next = starts.slice();
  for (let i = 1; i < n; i++) if (segmentClass[i] !== 255) segments[next[segmentClass[i]]++] = i;
}
classify();

// First sample of every program line, lowest stiffness of its cuts and of its plunges; the lines that leave the
// machine's reach.
const firstOf = new Map(), lowestOf = new Map(), lowestPlungeOf = new Map(), unreached = new Set();
for (let i = 0; i < n; i++) {
  if (!firstOf.has(line[i])) firstOf.set(line[i], i);
  const lowest = kind[i] & PLUNGE ? lowestPlungeOf : lowestOf;
  if (cutting(i) && !Number.isNaN(stiffness[i])) lowest.set(line[i], Math.min(stiffness[i], lowest.get(line[i]) ?? Infinity));
  if (cutting(i) && kind[i] & OUT) unreached.add(line[i]);
}
// Colour of a line's bar; undefined where nothing is cut.
function lineColour(number) {
  if (unreached.has(number)) return ink.bad;
  if (lowestOf.has(number)) return colours[classOf(lowestOf.get(number))];
  if (!lowestPlungeOf.has(number)) return undefined;
  return plungesBox.checked ? colours[classOf(lowestPlungeOf.get(number))] : ink.plunge;
}

// ---------------------------------------------------------------- what is pointed at
let here = -1, chosenLine = 0;
const status = document.getElementById("status");
function describe(i) {
  const [x, y, z] = xyz.map((axis) => axis[i].toFixed(2));
  const turned = angles ? " " + angles.map((a, axis) => "ABC"[axis] + a[i].toFixed(2)).join(" ") : "";
  const tool = data.tools.reduce((found, [start, number]) => start <= i ? number : found, 0);
  const k = kind[i] & OUT ? "out of reach" : `${group(stiffness[i])} N/mm`;
  return [`line ${line[i]} · ${k}`, `X${x} Y${y} Z${z}${turned} mm${angles ? ", deg" : ""}`,
    `margin ${margin[i].toFixed(3)} · T${tool} · ${MOTIONS[kind[i] & 7]}${kind[i] & PLUNGE ? ", plunge" : ""} · ${group(s[i], 1)} mm along`,
    ...(operations.length > 1 ? [`operation ${operationName(operationOf(i))}`] : [])];
}
function point(i, stage) {
  here = i;
  for (const tip of document.querySelectorAll(".tip")) tip.hidden = true;
  if (i >= 0) {
    const text = describe(i);
    status.textContent = text.join(" · ");
    if (stage) showTip(stage, i, text);
    showLine(line[i]);
  }
  view.drawOverlay();
  profile.drawOverlay();
}
function choose(number) {
  chosenLine = number;
  const i = firstOf.get(number);
  if (i !== undefined) point(i); else {
    here = -1;
    status.textContent = `line ${number}: ${n < data.samples ? "no sample of it in this thinned drawing" : "no motion"}`;
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
function showTip(stage, i, text) {
  const [x, y] = stage.at(i), tip = stage.tip;
  tip.textContent = text.join("\n");
  tip.hidden = false;
  const left = x + 18 + tip.offsetWidth > stage.width ? x - 18 - tip.offsetWidth : x + 18;
  tip.style.left = Math.max(0, left) + "px";
  tip.style.top = Math.max(0, Math.min(stage.height - tip.offsetHeight, y + 14)) + "px";
}

// ---------------------------------------------------------------- a pair of stacked canvases
class Stage {
  constructor(id) {
    this.element = document.getElementById(id);
    [this.base, this.overlay] = this.element.querySelectorAll("canvas");
    this.tip = this.element.querySelector(".tip");
    this.waiting = false;
    new ResizeObserver(() => this.resize()).observe(this.element);
  }
  resize() {
    this.width = this.element.clientWidth;
    this.height = this.element.clientHeight;
    const scale = devicePixelRatio || 1;
    for (const canvas of [this.base, this.overlay]) {
      canvas.width = Math.max(1, Math.round(this.width * scale));
      canvas.height = Math.max(1, Math.round(this.height * scale));
      canvas.getContext("2d").setTransform(scale, 0, 0, scale, 0, 0);
    }
    this.resized();
    this.draw();
    this.drawOverlay();
  }
  resized() {}
  redraw(coarse = false) {
    this.coarse = coarse;
    if (this.waiting) return;
    this.waiting = true;
    requestAnimationFrame(() => { this.waiting = false; this.draw(); this.drawOverlay(); });
  }
  clear(canvas) {
    const g = canvas.getContext("2d");
    g.clearRect(0, 0, this.width, this.height);
    g.lineJoin = g.lineCap = "round";
    g.font = "12px system-ui, 'DejaVu Sans', sans-serif";
    return g;
  }
}
function ring(g, x, y, radius, colour, width) {
  g.beginPath();
  g.arc(x, y, radius, 0, 2 * Math.PI);
  g.strokeStyle = colour;
  g.lineWidth = width;
  g.stroke();
}
