// Placements: where the work sits, and what that brings.
const d = JSON.parse($("data").textContent);
// Where the path and program zero are (p' = o + Q p), the program's axes there, the tool's direction where it leans.
function placed(row, stiffness) {
  const zero = [row.x_mm, row.y_mm, row.z_mm], q = turnOf([...zero, row.a_deg, row.b_deg, row.rotation_deg]);
  const points = d.position.map((p) => moved(zero, q, p)), leans = d.axis !== null || row.a_deg || row.b_deg;
  const tools = leans ? d.position.map((_, i) => moved([0, 0, 0], q, d.axis ? d.axis[i] : [0, 0, 1])) : null;
  const xyz = [0, 1, 2].map((k) => Float32Array.from(points, (p) => p[k]));
  return { row, zero, stiffness, points, xyz, axes: [0, 1, 2].map((k) => q.map((r) => r[k])), tools };
}
// The machine with its tip at a point of the path.
const body = new MachineBody(d.machine);
function poseOf({ points, tools }, i) {
  const [x, y, z] = tools?.[i] ?? [0, 0, 1];
  return [...points[i], ...[-Math.asin(y), Math.atan2(x, z), 0].map((v) => v * 180 / Math.PI)];
}
let chosen = d.recommended;
const places = d.front.map((row, i) => placed(row, d.stiffness[i]));
const before = d.before ? placed(d.before, d.stiffness[d.stiffness.length - 1]) : null;
const n = d.position.length;
const around = ({ xyz }) => extentOf(xyz);
const workspace = d.workspace[0].map((low, k) => [low, d.workspace[1][k]]);
const bounded = d.workspace.flat().every((v) => v !== null);
const whole = () => document.querySelector("input[name=zoom]:checked").value !== "path";
// Of the path about its middle: both placements get boxes of one size, so that they are drawn to one scale.
function boxOf(place) {
  if (whole()) return endsOf(outlineOf(place));
  const sizes = [place, ...(before ? [before] : [])].map(around), own = around(place);
  return own.map(([low, high], k) => {
    const half = Math.max(...sizes.map((box) => box[k][1] - box[k][0])) / 2;
    return [(low + high) / 2 - half, (low + high) / 2 + half];
  });
}
const outlineOf = (place) => (whole() ? [...body.outline(poseOf(place, 0)), ...(bounded ? cornersOf(workspace) : [])]
  : place.points);
// A placement in the viewer.
const classOf = (v) => classAt(v, d.scale, CLASSES);
let here = -1;  // the point of the path that is pointed at, in both placements
const known = (i, place) => place.stiffness[i] !== null && place.stiffness[i - 1] !== null && d.cut[i] === d.cut[i - 1];
function sceneOf(placeNow) {
  const path = new Path([new Float32Array(n), new Float32Array(n), new Float32Array(n)]);
  return {
    paths: [path],
    path,
    beside: 40,
    get frame() { return !whole(); },
    get iso() { return whole() ? body.iso : VIEWS.iso; },
    box: () => boxOf(placeNow()),
    outline: () => outlineOf(placeNow()),
    take() {
      const place = placeNow();
      path.move(place.xyz);
      path.classify((i) => (known(i, place) ? classOf((place.stiffness[i] + place.stiffness[i - 1]) / 2) : -1));
    },
    draw(g, viewer) {
      const place = placeNow(), reach = Math.max(...viewer.box.map(([low, high]) => high - low)), close = !whole();
      paint(g, viewer, body.items(viewer, poseOf(place, Math.max(here, 0)), { work: around(place), close,
        floor: viewer.box[2][0] }), close);
      if (bounded && whole()) viewer.edges(g, workspace, ink.muted, 1, [6, 4]);
      for (const { name, box } of d.keepouts) this.keepOut(g, viewer, name, [0, 1, 2]
        .map((k) => [box[0][k], box[1][k]]));
      path.paint(g);
      place.axes.forEach((axis, k) => {
        const tip = place.zero.map((z, m) => z + 0.09 * reach * axis[m]), [x, y] = viewer.project(tip),
          [x0, y0] = viewer.project(place.zero);
        if (Math.hypot(x - x0, y - y0) < 3) return;
        trace(g, [[x0, y0], [x, y]], false);
        stroke(g, ink.second, 2);
        g.fillStyle = ink.second;
        aligned(g, "center", "middle");
        g.fillText("XYZ"[k], x + 6, y - 6);
      });
    },
    keepOut(g, viewer, name, box) {
      viewer.edges(g, box, ink.bad, 1.5);
      const [x, y] = cornersOf(box).map((corner) => viewer.project(corner)).sort((a, b) => a[1] - b[1])[0];
      if (viewer.holds([x, y])) viewer.write(g, name, x, y - 9, "middle");
    },
    overlay(g) {
      if (here >= 0) mark(g, ...path.at(here), 5);
    },
    nearest: (x, y) => path.nearest(x, y),
  };
}
// The front.
const front = $("front"), rowsShown = d.front.concat(d.before ? [d.before] : []);
const span = (values) => { const a = Math.min(...values), b = Math.max(...values), e = 0.06 * (b - a) || 1e-3 * b || 1;
  return [a - e, b + e]; };
const meanSpan = span(rowsShown.map((r) => r.mean_N_per_mm)), rangeSpan = span(rowsShown.map((r) => r.range_N_per_mm));
const weakest = rowsShown.map((r) => r.min_N_per_mm), weakEnds = [Math.min(...weakest), Math.max(...weakest)];
const weakColour = (v) => coloursNow()[classAt(v, weakEnds, CLASSES)];
const nameOf = (row, i) =>
  `number ${row.number}: mean ${group(row.mean_N_per_mm)}, range ${group(row.range_N_per_mm)}, `
    + `weakest ${group(row.min_N_per_mm)} N/mm` + (i === d.recommended ? ", recommended" : "");
let dots = [];
function drawFront() {
  const [W, H, L, R, T, B] = [400, 340, 66, 14, 24, 44];
  const X = (v) => L + (W - L - R) * (v - meanSpan[0]) / (meanSpan[1] - meanSpan[0]), Y = (v) => H - B
    - (H - B - T) * (v - rangeSpan[0]) / (rangeSpan[1] - rangeSpan[0]);
  front.append(...grid(ticks(...meanSpan, 4), true, X, T, H - B).flat(), ...grid(ticks(...rangeSpan, 4), false, Y, L,
    W - R).flat());
  dots = d.front.map((row, i) => h("circle", { cx: X(row.mean_N_per_mm), cy: Y(row.range_N_per_mm), r: 5, class: "dot",
    role: "radio", "aria-label": nameOf(row, i), onclick: () => choose(i) },
    h("title", {}, nameOf(row, i))));
  const best = d.front[d.recommended], now = d.before;
  front.append(h("text", { x: (L + W - R) / 2, y: H - 8, "text-anchor": "middle" },
    "mean stiffness, N/mm (more is better)"), h("text", { x: 4, y: 14 }, "range, N/mm (less is better)"),
    now ? h("rect", { x: X(now.mean_N_per_mm) - 6, y: Y(now.range_N_per_mm) - 6, width: 12, height: 12,
      class: "now", stroke: "currentColor", "stroke-width": 2 },
      h("title", {}, `present placement, weakest ${group(now.min_N_per_mm)} N/mm`)) : "", ...dots,
    h("text", { x: X(best.mean_N_per_mm), y: Y(best.range_N_per_mm) - 8, "text-anchor": "middle", class: "star" },
      "\u2605"));
}
function markChosen() {
  dots.forEach((dot, k) => { dot.classList.toggle("on", k === chosen); dot.setAttribute("aria-checked", k === chosen);
    dot.setAttribute("tabindex", k === chosen ? 0 : -1); dot.style.fill = weakColour(d.front[k].min_N_per_mm); });
  for (const now of front.querySelectorAll(".now")) now.style.fill = weakColour(d.before.min_N_per_mm);
}
front.addEventListener("keydown", (event) => {
  const step = { ArrowRight: 1, ArrowUp: 1, ArrowLeft: -1, ArrowDown: -1 }[event.key];
  if (!step) return;
  event.preventDefault();
  choose((chosen + step + dots.length) % dots.length);
  dots[chosen].focus();
});
// The profile.
// Plunges along the tool axis are stiffer by far and would take all of the axis: they stand beside it. Between two cuts
// stands a row without a value, so that the curve breaks there.
const rows = [], isPlunge = (i) => d.plunge !== null && d.plunge[i];
for (let i = 0; i < n; i++) {
  if (i && d.cut[i] !== d.cut[i - 1]) rows.push(-1);
  rows.push(i);
}
const rowOf = new Map(rows.map((i, row) => [i, row])), s = Float32Array.from(rows, (i, row) => d.s[i < 0 ? rows[row - 1]
  : i]);
const valuesOf = (place, holds) => Float32Array.from(rows, (i) => (i < 0 || place.stiffness[i] === null || !holds(i)
  ? NaN : place.stiffness[i]));
const model = {
  s,
  value: (row) => (rows[row] < 0 ? NaN : places[chosen].stiffness[rows[row]] ?? NaN),
  curves: () => [...(before ? [{ s, k: valuesOf(before, (i) => !isPlunge(i)), colour: ink.muted }] : []),
    { s, k: valuesOf(places[chosen], (i) => !isPlunge(i)), colour: ink.curve }],
  beside: () => (d.plunge === null ? null : { k: valuesOf(places[chosen], isPlunge), colour: ink.plunge }),
  levels: () => [...(before ? [[before, ink.muted]] : []), [places[chosen], ink.curve]].map(([{ row }, colour]) =>
    ({ value: row.mean_N_per_mm, colour, dash: [7, 5] })),
  ends: () => d.scale,
  here: () => (here < 0 ? -1 : rowOf.get(here)),
};
// Figures.
// Label, key, digits; whether it is left out where there is none.
const FACTS = [["mean, N/mm", "mean_N_per_mm", 0], ["range, N/mm", "range_N_per_mm", 0],
  ["weakest, N/mm", "min_N_per_mm", 0], ["plunges along the tool axis: mean, N/mm", "plunge_mean_N_per_mm", 0, true],
  [`mean deflection at ${d.force} N, \u00b5m`, "mean_deflection_um", 2], ["program zero X, mm", "x_mm", 3],
  ["Y, mm", "y_mm", 3], ["Z, mm", "z_mm", 3], ["turned by, degrees", "rotation_deg", 3],
  ["tilt A, degrees", "a_deg", 3, true], ["tilt B, degrees", "b_deg", 3, true],
  ["strut law extrapolated, share of samples", "extrapolated_share", 3, true]];
function drawFacts(row) {
  const columns = d.before ? [row, d.before] : [row];
  const shown = FACTS.filter(([, key, , omitted]) => !omitted || columns.some((r) => r[key]));
  const line = (name, cells, tag) => h("tr", {}, h("th", { scope: "row" }, name), cells.map((v) => h(tag, {}, v)));
  const origin = ["x_mm", "y_mm", "z_mm", "a_deg", "b_deg", "rotation_deg"].map((key) => +row[key].toFixed(6));
  $("facts").replaceChildren(h("thead", {}, line("", d.before ? ["shown", "present"] : ["shown"], "th")),
    h("tbody", {}, shown.map(([name, key, digits]) => line(name, columns.map((r) => group(r[key] ?? NaN, digits)),
      "td")), h("tr", {}, h("th", { colspan: columns.length + 1 }, h("code", {}, `--origin ${origin.join(",")}`)))));
}
// What is pointed at, in both drawings and the profile.
function point(i, stage) {
  here = i;
  for (const tip of document.querySelectorAll(".tip")) tip.hidden = true;
  if (i >= 0 && stage) {
    const told = (place) => (place.stiffness[i] === null ? "out of reach" : `${group(place.stiffness[i])} N/mm`);
    const place = stage === beforeView ? before : places[chosen];
    const lines = [`${told(places[chosen])}${before ? `, present ${told(before)}` : ""}`,
      `${group(d.s[i], 1)} mm along${isPlunge(i) ? ", plunge" : ""}`];
    if (stage !== profile) lines.push(place.xyz.map((axis, k) => `${"XYZ"[k]}${axis[i].toFixed(2)}`).join(" "));
    stage.tell(stage === profile ? profile.at(rowOf.get(i)) : stage.scene.path.at(i), lines);
  }
  for (const view of views) view.redraw();
  profile.drawOverlay();
}
const step = (by) => point(Math.max(0, Math.min(n - 1, here + by)), profile);
// Choosing.
function draw() {
  const place = places[chosen];
  for (const view of views) { view.scene.take(); view.fit(); view.redraw(); }
  profile.redraw();
  drawFacts(place.row);
  markChosen();
  $("chosen-title").textContent = (chosen === d.recommended ? "Recommended placement, "
    : "Placement ") + `${chosen + 1} of ${places.length}`;
  chosenView.overlay.setAttribute("aria-label", "Path, coloured by stiffness; " + nameOf(place.row, chosen));
}
function choose(i) { chosen = i; draw(); }
// Everything together.
// Turned or brought nearer, one placement takes the other along.
const together = (moved) => { for (const view of views) if (view !== moved) view.follow(moved); };
const viewerOf = (id, placeNow) => {
  const view = new Viewer($(id), sceneOf(placeNow), { point: (i) => point(i, i < 0 ? null : view), step,
    moved: together });
  view.scene.take();
  return view;
};
const chosenView = viewerOf("chosen", () => places[chosen]), beforeView = before ? viewerOf("before", () => before)
  : null;
const views = [chosenView, ...(beforeView ? [beforeView] : [])];
const profile = new Profile($("profile"), model, { point: (row) => point(rows[row], profile), step });
watchTheme(draw);
for (const stage of [...views, profile]) stage.resize();
for (const radio of document.querySelectorAll("input[name=zoom]")) radio.addEventListener("change",
  () => { for (const view of views) view.turnTo("iso"); });
drawFront();
draw();
