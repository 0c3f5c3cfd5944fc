const d = JSON.parse(document.getElementById("data").textContent), $ = (id) => document.getElementById(id);
const dark = matchMedia("(prefers-color-scheme: dark)");
const words = (v, digits = 0) => { const [whole, part] = v.toFixed(digits).split("."); return whole.replace(/\B(?=(\d{3})+$)/g, "\u202f") + (part ? "." + part : ""); };
function make(parent, name, attributes, text) {
  const node = document.createElementNS("http://www.w3.org/2000/svg", name);
  for (const k in attributes) node.setAttribute(k, attributes[k]);
  if (text !== undefined) node.textContent = text;
  return parent.appendChild(node);
}
// A round distance of ticks, about `count` of them.
function ticks(low, high, count) {
  const raw = (high - low) / count, power = 10 ** Math.floor(Math.log10(raw)), step = [1, 2, 5, 10].find((m) => m * power >= raw) * power, found = [];
  for (let v = Math.ceil(low / step) * step; v <= high + 1e-9 * step; v += step) found.push(Math.round(v / step) * step);
  return found;
}

// Drawings are as wide as their element, so that letters keep their size.
const widthOf = (svg) => Math.max(280, svg.clientWidth || 400);

// ---------------------------------------------------------------- placing: p' = o + Q p, Q = Rz(C) Ry(B) Rx(A)
function turnOf(row) {
  const [a, b, c] = [row.a_deg, row.b_deg, row.rotation_deg].map((v) => v * Math.PI / 180), [sa, ca, sb, cb, sc, cc] = [a, b, c].flatMap((v) => [Math.sin(v), Math.cos(v)]);
  return [[cc * cb, cc * sb * sa - sc * ca, cc * sb * ca + sc * sa], [sc * cb, sc * sb * sa + cc * ca, sc * sb * ca - cc * sa], [-sb, cb * sa, cb * ca]];
}
const times = (q, p) => q.map((r) => r[0] * p[0] + r[1] * p[1] + r[2] * p[2]);
function placed(row, stiffness) {
  const q = turnOf(row), zero = [row.x_mm, row.y_mm, row.z_mm], shift = (p) => times(q, p).map((v, i) => v + zero[i]);
  const leans = d.axis !== null || row.a_deg !== 0 || row.b_deg !== 0;
  const tools = leans ? d.position.map((_, i) => times(q, d.axis ? d.axis[i] : [0, 0, 1])) : null;
  return { row, zero, stiffness, points: d.position.map(shift), axes: [0, 1, 2].map((k) => q.map((r) => r[k])), tools };
}
let chosen = d.chosen;
const places = d.front.map((row, i) => placed(row, d.stiffness[i]));
const before = d.before ? placed(d.before, d.stiffness[d.stiffness.length - 1]) : null;

// ---------------------------------------------------------------- boxes that are shown
const join = (boxes) => [0, 1].map((end) => [0, 1, 2].map((k) => (end ? Math.max : Math.min)(...boxes.map((b) => b[end][k]))));
function around(place) {
  const low = [1e9, 1e9, 1e9], high = [-1e9, -1e9, -1e9];
  for (const p of place.points) for (let k = 0; k < 3; k++) { low[k] = Math.min(low[k], p[k]); high[k] = Math.max(high[k], p[k]); }
  return [low, high];
}
const everywhere = join([...places, ...(before ? [before] : [])].map(around).concat([[[0, 0, 1e9], [0, 0, -1e9]]]));
const workspace = d.workspace.map((corner, end) => corner.map((v, k) => (v === null ? everywhere[end][k] : v)));
const bounded = d.workspace.map((corner) => corner.map((v) => v !== null));
function frameOf(place, zoom, size) {
  const box = zoom === "path" ? around(place) : zoom === "all" ? everywhere : join([workspace, everywhere]);
  // As large as asked, about the middle, with room at the edges.
  return [0, 1].map((end) => box[end].map((v, k) => (box[0][k] + box[1][k]) / 2 + (end ? 0.5 : -0.5) * size[k]));
}
function sizeOf(zoom, shown) {
  const boxes = zoom === "path" ? shown.map(around) : [zoom === "all" ? everywhere : join([workspace, everywhere])];
  const size = [0, 1, 2].map((k) => Math.max(...boxes.map((b) => b[1][k] - b[0][k]))), largest = Math.max(...size, 1);
  return size.map((v) => Math.max(v, 0.3 * largest) + 0.12 * largest);
}

// ---------------------------------------------------------------- three views, as on a drawing: above, front, right
const classOf = (v) => Math.min(d.colours.length - 1, Math.max(0, Math.floor((v - d.scale[0]) / (d.scale[1] - d.scale[0]) * d.colours.length)));
function drawPlace(svg, place, zoom, size) {
  svg.replaceChildren();
  const W = widthOf(svg), frame = frameOf(place, zoom, size), gap = 40, left = 42, top = 20, below = top + 22;
  // One scale for all three where they fit below each other; high ones stand side by side, smaller.
  const large = Math.min((W - left - 6) / Math.max(size[0], size[1]), 1.05 * W / size[1]), flat = size[2] * large < 0.7 * W;
  const small = flat ? large : Math.min((W - left - gap - 6) / (size[0] + size[1]), 0.8 * W / size[2]);
  const second = top + size[1] * large + below, third = flat ? second + size[2] * large + below : second, H = third + size[2] * small + 22;
  svg.setAttribute("viewBox", `0 0 ${W} ${H.toFixed(1)}`); svg.setAttribute("height", H.toFixed(0));
  const views = [
    { name: "above: X \u2192, Y \u2191", u: 0, v: 1, x: left, y: top, scale: large }, { name: "front: X \u2192, Z \u2191", u: 0, v: 2, x: left, y: second, scale: small },
    { name: "right: Y \u2192, Z \u2191", u: 1, v: 2, x: flat ? left : left + size[0] * small + gap, y: third, scale: small }];
  views.forEach((view, n) => drawView(svg, view, n, frame, size.map((v) => v * view.scale), place));
}
function drawView(svg, view, n, frame, w, place) {
  const { u, v, x, y, scale } = view, wide = w[u], high = w[v];
  const X = (p) => x + (p[u] - frame[0][u]) * scale, Y = (p) => y + high - (p[v] - frame[0][v]) * scale, at = (p) => X(p).toFixed(1) + " " + Y(p).toFixed(1);
  const clip = make(make(svg, "clipPath", { id: svg.id + n }), "rect", { x, y, width: wide, height: high });
  make(svg, "rect", { x, y, width: wide, height: high, class: "frame" });
  make(svg, "text", { x, y: y - 5 }, view.name);
  for (const t of ticks(frame[0][u], frame[1][u], Math.max(3, wide / 60))) { const p = [0, 0, 0]; p[u] = t; make(svg, "text", { x: X(p), y: y + high + 14, "text-anchor": "middle" }, +t.toFixed(3)); make(svg, "path", { d: `M${X(p)} ${y + high}v3`, class: "axis" }); }
  for (const t of ticks(frame[0][v], frame[1][v], Math.max(3, high / 40))) { const p = [0, 0, 0]; p[v] = t; make(svg, "text", { x: x - 5, y: Y(p) + 4, "text-anchor": "end" }, +t.toFixed(3)); make(svg, "path", { d: `M${x} ${Y(p)}h-3`, class: "axis" }); }
  const g = make(svg, "g", { "clip-path": `url(#${svg.id + n})` });
  for (const box of d.keepouts) {
    make(make(g, "rect", { x: X(box.box[0]), y: Y(box.box[1]), width: X(box.box[1]) - X(box.box[0]), height: Y(box.box[0]) - Y(box.box[1]), class: "keepout" }), "title", {}, "keep out: " + box.name);
    if (n === 0) make(g, "text", { x: Math.max(X(box.box[0]), x) + 4, y: Math.max(Y(box.box[1]), y) + 14 }, box.name);
  }
  for (const [axis, other] of [[u, v], [v, u]]) for (const end of [0, 1]) if (bounded[end][axis]) {
    const p = workspace[end].slice(), q = p.slice(); p[other] = workspace[0][other]; q[other] = workspace[1][other]; make(g, "path", { d: `M${at(p)}L${at(q)}`, class: "bound" });
  }
  const far = (k) => [frame[0][k], frame[1][k]];
  for (const [axis, other] of [[u, v], [v, u]]) if (axis < 2) { const [a, b] = far(other).map((t) => { const p = [0, 0, 0]; p[other] = t; return p; }); make(g, "path", { d: `M${at(a)}L${at(b)}`, class: "axis", "stroke-dasharray": "12 3 2 3", opacity: 0.6 }); }
  if (place.tools) {
    const every = Math.max(1, Math.ceil(place.points.length / 40)), length = 0.1 * Math.max(wide, high) / scale;
    const lines = place.points.map((p, i) => (i % every ? "" : `M${at(p)}L${at(p.map((c, k) => c + length * place.tools[i][k]))}`)).join("");
    make(g, "path", { d: lines, class: "tool", fill: "none" });
  }
  const parts = new Map();
  place.points.forEach((p, i) => {
    if (i === 0 || d.cut[i] !== d.cut[i - 1]) return;
    const pair = [place.stiffness[i - 1], place.stiffness[i]]; if (pair.includes(null)) return;
    const c = classOf((pair[0] + pair[1]) / 2); parts.set(c, (parts.get(c) || "") + `M${at(place.points[i - 1])}L${at(p)}`);
  });
  const colours = dark.matches ? d.colours_dark : d.colours;
  for (const [c, text] of parts) make(g, "path", { d: text, stroke: colours[c], "stroke-width": n ? 2 : 2.6, "stroke-linecap": "round", fill: "none" });
  const arrow = 0.09 * Math.max(...w) / scale;
  place.axes.forEach((axis, k) => {
    const tip = place.zero.map((z, m) => z + arrow * axis[m]), along = Math.hypot(X(tip) - X(place.zero), Y(tip) - Y(place.zero));
    if (along < 2) return;
    make(g, "path", { d: `M${at(place.zero)}L${at(tip)}`, class: "zero" });
    make(g, "text", { x: X(tip) + 3, y: Y(tip) - 3, style: "fill:var(--orange);font-size:10px" }, "XYZ"[k]);
  });
}

// ---------------------------------------------------------------- the front
const front = $("front"), rowsShown = d.front.concat(d.before ? [d.before] : []);
const span = (values) => { const a = Math.min(...values), b = Math.max(...values), e = 0.06 * (b - a) || 1e-3 * b || 1; return [a - e, b + e]; };
const meanSpan = span(rowsShown.map((r) => r.mean_N_per_mm)), rangeSpan = span(rowsShown.map((r) => r.range_N_per_mm));
const digitsOf = (values) => (values.length < 2 ? 0 : Math.max(0, -Math.floor(Math.log10(values[1] - values[0]) + 1e-9)));
function grid(svg, list, digits, vertical, map, a, b) {
  for (const v of list) {
    make(svg, "line", vertical ? { x1: map(v), x2: map(v), y1: a, y2: b, class: "grid" } : { x1: a, x2: b, y1: map(v), y2: map(v), class: "grid" });
    make(svg, "text", vertical ? { x: map(v), y: b + 16, "text-anchor": "middle" } : { x: a - 6, y: map(v) + 4, "text-anchor": "end" }, words(v, digits));
  }
}
const title = (node, text) => make(node, "title", {}, text);
const weakest = rowsShown.map((r) => r.min_N_per_mm), weakEnds = [Math.min(...weakest), Math.max(...weakest)];
const coloursNow = () => (dark.matches ? d.colours_dark : d.colours);
const weakColour = (v) => coloursNow()[Math.min(d.colours.length - 1, Math.floor((v - weakEnds[0]) / (weakEnds[1] - weakEnds[0] || 1) * d.colours.length))];
const nameOf = (row, i) => `number ${row.number}: mean ${words(row.mean_N_per_mm)}, range ${words(row.range_N_per_mm)}, weakest ${words(row.min_N_per_mm)} N/mm` + (i === d.recommended ? ", recommended" : "") + (i === d.chosen && i !== d.recommended ? ", picked" : "");
let dots = [];
function drawFront() {
  const W = widthOf(front), H = Math.round(Math.min(340, 0.85 * W)), [L, R, T, B] = [66, 14, 24, 44], focused = document.activeElement && front.contains(document.activeElement);
  const X = (v) => L + (W - L - R) * (v - meanSpan[0]) / (meanSpan[1] - meanSpan[0]), Y = (v) => H - B - (H - B - T) * (v - rangeSpan[0]) / (rangeSpan[1] - rangeSpan[0]);
  front.replaceChildren(); front.setAttribute("viewBox", `0 0 ${W} ${H}`); front.setAttribute("height", H);
  const tx = ticks(...meanSpan, W > 340 ? 5 : 3), ty = ticks(...rangeSpan, 4);
  grid(front, tx, digitsOf(tx), true, X, T, H - B); grid(front, ty, digitsOf(ty), false, Y, L, W - R);
  make(front, "text", { x: (L + W - R) / 2, y: H - 8, "text-anchor": "middle" }, "mean stiffness, N/mm (more is better)");
  make(front, "text", { x: 4, y: 14 }, "range, N/mm (less is better)");
  if (d.before) title(make(front, "rect", { x: X(d.before.mean_N_per_mm) - 6, y: Y(d.before.range_N_per_mm) - 6, width: 12, height: 12, fill: weakColour(d.before.min_N_per_mm), stroke: "currentColor", "stroke-width": 2 }), "present placement, weakest " + words(d.before.min_N_per_mm) + " N/mm");
  dots = d.front.map((row, i) => {
    const dot = make(front, "circle", { cx: X(row.mean_N_per_mm), cy: Y(row.range_N_per_mm), r: 5, class: "dot", fill: weakColour(row.min_N_per_mm), role: "radio", "aria-label": nameOf(row, i) });
    title(dot, nameOf(row, i)); dot.addEventListener("click", () => choose(i, true)); return dot;
  });
  const best = d.front[d.recommended];
  make(front, "text", { x: X(best.mean_N_per_mm), y: Y(best.range_N_per_mm) - 8, "text-anchor": "middle", class: "star" }, "\u2605");
  mark(); if (focused) dots[chosen].focus();
}
function mark() {
  dots.forEach((dot, k) => { dot.classList.toggle("on", k === chosen); dot.setAttribute("aria-checked", k === chosen); dot.setAttribute("tabindex", k === chosen ? 0 : -1); });
}
$("front-key").textContent = "\u2605 recommended" + (d.before ? "  \u25a1 present" : ". No present placement to compare with: " + d.before_reason) + ". No placement is better in mean, range and weakest place at once. Arrow keys step along the front.";
front.addEventListener("keydown", (event) => {
  const step = { ArrowRight: 1, ArrowUp: 1, ArrowLeft: -1, ArrowDown: -1 }[event.key], jump = { Home: 0, End: dots.length - 1 }[event.key];
  if (step === undefined && jump === undefined) return;
  event.preventDefault(); choose(jump !== undefined ? jump : (chosen + step + dots.length) % dots.length, true); dots[chosen].focus();
});

// ---------------------------------------------------------------- the profile
// Plunges along the tool axis are stiffer by far and would take all of the axis; a switch shows them.
const plunges = $("plunges"), isPlunge = (i) => d.plunge !== null && d.plunge[i], hidden = (i) => isPlunge(i) && !plunges.checked;
const profileSpan = () => span(d.stiffness.flatMap((row) => row.filter((v, i) => v !== null && !hidden(i))).concat(rowsShown.flatMap((r) => [r.min_N_per_mm, r.min_N_per_mm + r.range_N_per_mm])));
$("plunge-switch").hidden = d.plunge === null; plunges.addEventListener("change", () => drawProfile(places[chosen]));
function drawProfile(place) {
  const svg = $("profile"), w = widthOf(svg), narrow = w < 700, h = 240, [l, r, t, b] = [66, 10, 8, 38], ends = profileSpan();
  svg.replaceChildren(); svg.setAttribute("viewBox", `0 0 ${w} ${h}`); svg.setAttribute("height", h);
  const s0 = d.s[0], s1 = d.s[d.s.length - 1] || 1, sx = (s) => l + (w - l - r) * (s - s0) / (s1 - s0 || 1), sy = (v) => h - b - (h - b - t) * (v - ends[0]) / (ends[1] - ends[0]);
  const list = ticks(...ends, 4), along = ticks(s0, s1, narrow ? 4 : 8);
  grid(svg, along, digitsOf(along), true, sx, t, h - b); grid(svg, list, digitsOf(list), false, sy, l, w - r);
  make(svg, "text", { x: (l + w - r) / 2, y: h - 6, "text-anchor": "middle" }, "path length, mm (rapids included)");
  for (const [curve, colour] of [[before, "var(--muted)"], [place, "var(--blue)"]]) {
    if (!curve) continue;
    const text = curve.stiffness.map((v, i) => (v === null || hidden(i) ? "" : (i && d.cut[i] === d.cut[i - 1] && curve.stiffness[i - 1] !== null && !hidden(i - 1) ? "L" : "M") + sx(d.s[i]).toFixed(1) + " " + sy(v).toFixed(1))).join("");
    make(svg, "path", { d: text, fill: "none", stroke: colour, "stroke-width": 1.6, "stroke-linejoin": "round" });
    make(svg, "path", { d: `M${l} ${sy(curve.row.mean_N_per_mm)}H${w - r}`, stroke: colour, "stroke-dasharray": "7 5" });
  }
}

// ---------------------------------------------------------------- figures
function drawFacts(row) {
  const columns = d.before ? [row, d.before] : [row], table = $("facts"), figure = (key, digits) => columns.map((r) => (r[key] === undefined || r[key] === null ? "\u2013" : words(r[key], digits)));
  const rows = [["mean, N/mm", figure("mean_N_per_mm")], ["range, N/mm", figure("range_N_per_mm")], ["weakest, N/mm", figure("min_N_per_mm")],
    [`mean deflection at ${d.force} N, \u00b5m`, figure("mean_deflection_um", 2)], ["program zero X, mm", figure("x_mm", 3)], ["Y, mm", figure("y_mm", 3)], ["Z, mm", figure("z_mm", 3)], ["turned by, degrees", figure("rotation_deg", 3)]];
  if (columns.some((r) => r.plunge_mean_N_per_mm !== null)) rows.splice(3, 0, ["plunges along the tool axis: mean, N/mm", figure("plunge_mean_N_per_mm")]);
  if (columns.some((r) => r.a_deg || r.b_deg)) rows.push(["tilt A, degrees", figure("a_deg", 3)], ["tilt B, degrees", figure("b_deg", 3)]);
  if (row.extrapolated_share !== undefined) rows.push(["strut law extrapolated, % of samples", columns.map((r) => words(100 * r.extrapolated_share, 1))]);
  table.replaceChildren();
  const line = (parent, name, cells, tag) => { const tr = parent.appendChild(document.createElement("tr")); const th = tr.appendChild(document.createElement("th")); th.textContent = name; th.scope = "row"; for (const c of cells) tr.appendChild(document.createElement(tag)).textContent = c; return tr; };
  line(table.createTHead(), "", d.before ? ["shown", "present"] : ["shown"], "th");
  const body = table.createTBody(); for (const [name, cells] of rows) line(body, name, cells, "td");
  const origin = document.createElement("code"), last = body.appendChild(document.createElement("tr")).appendChild(document.createElement("th"));
  last.colSpan = columns.length + 1; origin.textContent = "--origin " + [row.x_mm, row.y_mm, row.z_mm, row.a_deg, row.b_deg, row.rotation_deg].map((v) => +v.toFixed(6)).join(",") + ` or --pick ${row.number}`; last.appendChild(origin);
}

// ---------------------------------------------------------------- choosing
const zoomed = () => document.querySelector("input[name=zoom]:checked").value;
function draw() {
  const place = places[chosen], zoom = zoomed(), size = sizeOf(zoom, before ? [place, before] : [place]);
  drawPlace($("chosen"), place, zoom, size); if (before) drawPlace($("before"), before, zoom, size);
  drawProfile(place); drawFacts(place.row); mark();
  $("chosen-title").textContent = (chosen === d.recommended ? "Recommended placement, " : chosen === d.chosen ? "Picked placement, " : "Placement ") + `${chosen + 1} of ${places.length}`;
  $("chosen").setAttribute("aria-label", "Path from above, from the front and from the right, coloured by stiffness; " + nameOf(place.row, chosen));
  $("weak-ramp").style.background = $("ramp").style.background = `linear-gradient(to right, ${(dark.matches ? d.colours_dark : d.colours).join(",")})`;
}
function drawAll() { drawFront(); draw(); }
function choose(i, remember) { chosen = i; if (remember) history.replaceState(null, "", i === d.recommended ? "#recommended" : "#" + (i + 1)); draw(); }
$("weak-low").textContent = words(weakEnds[0]); $("weak-high").textContent = words(weakEnds[1]);
// #recommended or #7, the seventh of the front; a zoom may follow: #7,workspace
function fromAddress() {
  const [name, zoom] = location.hash.slice(1).split(","), i = name === "recommended" ? d.recommended : Number(name) - 1;
  for (const radio of document.querySelectorAll("input[name=zoom]")) if (radio.value === zoom) radio.checked = true;
  choose(Number.isInteger(i) && i >= 0 && i < places.length ? i : d.chosen, false);
}
const scaleDigits = digitsOf([0, (d.scale[1] - d.scale[0]) / 30]);
$("low").textContent = (d.beyond[0] ? "\u2264 " : "") + words(d.scale[0], scaleDigits); $("high").textContent = (d.beyond[1] ? "\u2265 " : "") + words(d.scale[1], scaleDigits);
if (!before) { $("before-panel").remove(); $("old-key").remove(); $("main").classList.add("alone"); }
document.querySelectorAll("input[name=zoom]").forEach((radio) => radio.addEventListener("change", draw));
addEventListener("hashchange", fromAddress); addEventListener("resize", drawAll); dark.addEventListener("change", drawAll);
drawFront(); fromAddress();
