// The machine as the one viewer draws it: frame, struts, joints, platform, tool, reach; readings and the path in it.
// It draws what the state holds. Positions are in mm, a pose is x, y, z, A, B, C in mm and degrees.
function turnOf([, , , a, b, c]) {
  const [r, p, y] = [a, b, c].map((v) => v * Math.PI / 180), { sin, cos } = Math;
  return [
    [cos(y) * cos(p), cos(y) * sin(p) * sin(r) - sin(y) * cos(r), cos(y) * sin(p) * cos(r) + sin(y) * sin(r)],
    [sin(y) * cos(p), sin(y) * sin(p) * sin(r) + cos(y) * cos(r), sin(y) * sin(p) * cos(r) - cos(y) * sin(r)],
    [-sin(p), cos(p) * sin(r), cos(p) * cos(r)],
  ];
}
const moved = (pose, turn, [x, y, z]) => turn.map((row, i) => pose[i] + row[0] * x + row[1] * y + row[2] * z);
const coloursNow = () => (theme.dark ? COLOURS.dark : COLOURS.light);
// Blue is stiffer, orange softer than modelled; grey in between, and the size says how much: no colour is needed.
function errorColour(percent, scale) {
  const share = Math.min(1, Math.abs(percent) / scale), to = percent < 0 ? ink.second : ink.curve;
  return mix(ink.rapid, to, 0.15 + 0.85 * share);
}

// More readings than this are drawn without bars; dots stand so many pixels beside their pose; shades of each colour.
const MANY = 900, BESIDE = 19.5, SHADES = 8;
class MachineScene {
  constructor() {
    this.focus = "work";
    this.frame = false;
    this.beside = 30;
    this.showReach = true;
    this.lit = [];        // [{ link, strut, vertex }] of the effects that are on
    this.selected = -1;   // reading
    this.paths = [];
    this.scale = 10;      // per cent at full colour
    this.pose = [0, 0, 0, 0, 0, 0];
  }
  get joints() { return this.state.machine.joints; }
  box() {
    const box = [0, 1, 2].map(() => [Infinity, -Infinity]);
    const see = (p) => p.forEach((v, i) => { if (i < 3 && v !== null) { box[i][0] = Math.min(box[i][0], v);
      box[i][1] = Math.max(box[i][1], v); } });
    if (!this.state) return box.map(() => [-1, 1]);
    const path = this.paths[0];
    if (this.focus === "part" && path) {
      for (let i = 0; i < path.n; i++) if (path.of[i] !== PATH_RAPID()) see(path.xyz.map((of) => of[i]));
      const room = 0.35 * Math.max(...box.map(([low, high]) => high - low));
      return box.map(([low, high]) => [low - room, high + room]);
    }
    if (this.focus === "machine") {
      this.joints.frame.forEach(see);
      see([...this.joints.frame[0].slice(0, 2), this.floor()]);
      return box;
    }
    for (const row of this.state.machine.reach) row.forEach(see);
    return box;
  }
  // What the view is fitted to where the box would leave too much room: a ring and a ball do not reach its corners.
  outline() {
    if (!this.state || this.focus === "part") return null;
    const reach = this.state.machine.reach.flat(), floor = this.floor();
    return this.focus === "work" ? reach
      : [...reach, ...this.joints.frame, ...this.joints.frame.map(([x, y]) => [x, y, floor])];
  }
  // mm, the height that legs and table stand on: as far below the reach as the reach is high at its middle.
  floor() { return Math.min(...this.state.machine.reach.flat().map((p) => p[2])); }
  // mm, the size of the machine, by which what the file does not say is drawn: struts, joints, platform, spindle.
  size() {
    const joints = this.joints.frame, middle = centreOf(joints);
    return joints.reduce((sum, p) => sum + Math.hypot(...minus(p, middle)), 0) / joints.length;
  }
  platform() {
    const turn = turnOf(this.pose), joints = this.joints.platform.map((p) => moved(this.pose, turn, p));
    return { turn, joints, middle: centreOf(joints), nose: moved(this.pose, turn, [0, 0, this.joints.tool]) };
  }
  islit(link, number) {
    return this.lit.some((one) => one.link === link && (one.number === undefined || number === undefined
      || one.number === number));
  }
  draw(g, view) {
    if (!this.state) return;
    this.spots = [];
    if (this.focus !== "part") this.drawReach(g, view);
    const items = [...this.solids(view), ...this.dots(view), this.pathItem(view)].filter(Boolean);
    for (const item of items.sort((a, b) => a.depth - b.depth)) item.paint(g);
    if (this.focus !== "machine") fadeOut(g, view);
  }
  polyline(g, view, points, colour, width, close = false) {
    trace(g, points.map((p) => view.project(p)), close);
    stroke(g, colour, width);
  }
  drawReach(g, view) {
    if (!this.showReach) return;
    const rows = this.state.machine.reach, lit = ink.line;
    g.globalAlpha = 0.9;
    rows.slice(1, -1).forEach((row) => this.polyline(g, view, row, lit, 1, true));
    for (let k = 0; k < rows[0].length; k += 3) this.polyline(g, view, rows.map((row) => row[k]), lit, 1);
    g.globalAlpha = 1;
  }
  pathItem(view) {
    const path = this.paths[0];
    if (!path) return null;
    const colours = coloursNow();
    return { depth: view.project(this.pose.slice(0, 3))[2], paint: (g) => {
      path.stroke(g, colours.length, ink.rapid, 1);
      colours.forEach((colour, i) => path.stroke(g, i, colour, 2.4));
      path.stroke(g, colours.length + 1, ink.plunge, 1.6);
      path.stroke(g, colours.length + 2, ink.bad, 3);
      for (const run of this.shifted?.runs ?? []) this.polyline(g, view, run, ink.second, 1.6);
    } };
  }
  // Frame, table, struts, joints, platform, spindle and tool; what the suspects are is lit, what stands before the work
  // lets it show through.
  solids(view) {
    const { joints, middle, nose, turn } = this.platform(), items = [], tip = this.pose.slice(0, 3), size = this.size();
    const work = view.project(tip)[2], close = this.focus !== "machine", metal = mix(ink.rapid, ink.panel, 0.25);
    const through = (item, at) => (close && view.project(at)[2] > work + 0.02 * size ? 0.3 : 1);
    const tube = (a, b, radius, colour) => items.push(cylinder(view, a, b, radius * size, colour, through(null,
      between(a, b, 0.5))));
    const colour = (on, plain) => (on ? ink.accent : plain);
    this.base(view, size, tube, items, colour(this.islit("table"), mix(metal, ink.panel, 0.4)));
    this.joints.frame.forEach((top, i) => {
      const lit = this.islit("struts", i + 1), cut = between(top, joints[i], 0.58), on = this.islit("joints", i + 1);
      tube(top, cut, 0.03, colour(lit, metal));
      tube(cut, joints[i], 0.019, colour(lit, mix(ink.plunge, ink.panel, 0.45)));
      for (const [at, radius] of [[top, 0.045], [joints[i], 0.032]]) items.push(ball(view, at, radius * size,
        colour(on || lit, ink.plunge), through(null, at)));
      const place = between(top, joints[i], close ? 0.82 : 0.6), [nx, ny, depth] = view.project(place);
      if (nx > 0 && nx < view.width && ny > 0) items.push({ depth: depth + size,
        paint: (g) => view.write(g, String(i + 1), nx, ny, "middle") });
    });
    const thick = [0, 0, 0.035 * size].map((_, k) => 0.035 * size * turn[k][2]), around = byAngle(joints, middle, turn);
    items.push(prism(view, around.map((p) => minus(p, thick)), around.map((p) => p.map((v, k) => v + thick[k])),
      colour(this.islit("platform") || this.islit("geometry"), mix(metal, ink.plunge, 0.35)), close ? 0.8 : 1));
    tube(between(middle, nose, -0.45), nose, 0.05, colour(this.islit("tool"), mix(metal, ink.plunge, 0.25)));
    tube(nose, between(nose, tip, 0.45), 0.025, colour(this.islit("tool"), metal));
    tube(between(nose, tip, 0.45), tip, 0.005, colour(this.islit("tool") || this.islit("instrument"), ink.plunge));
    return items;
  }
  // The ring that the struts hang from with its legs, and the table with the work on it: as far as the path goes.
  base(view, size, tube, items, table) {
    const around = byAngle(this.joints.frame, centreOf(this.joints.frame)), floor = this.floor(), path = this.paths[0];
    const frame = this.islit("frame") ? ink.accent : mix(ink.rapid, ink.panel, 0.45);
    around.forEach((p, i) => tube(p, around[(i + 1) % around.length], 0.022, frame));
    if (this.focus === "machine") for (const p of around) tube(p, [p[0], p[1], floor], 0.016, frame);
    const ends = path ? path.xyz.map((of) => [Math.min(...of.filter((_, i) => path.of[i] !== PATH_RAPID())),
      Math.max(...of.filter((_, i) => path.of[i] !== PATH_RAPID()))]) : null;
    const [x, y] = ends ? ends.slice(0, 2).map(([low, high]) => (low + high) / 2) : this.state.machine.origin;
    const low = ends ? ends[2][0] - 0.012 * size : floor, half = ends ? 1.1 * Math.max(...ends.slice(0, 2)
      .map(([a, b]) => b - a)) : 0.22 * size;
    const far = (v) => [v - half, v + half], below = this.focus === "machine" ? Math.min(floor, low - 0.05 * size) : low
      - 0.04 * size;
    const slab = block(view, [far(x), far(y), [below, low]], table);
    items.push({ ...slab, depth: -1e9 });  // all else stands on it
    if (ends) items.push({ ...block(view, [...ends.slice(0, 2).map(([a, b]) => [a - 0.01 * size, b + 0.01 * size]),
      [low, Math.max(ends[2][0], low) + 1e-3]], mix(ink.curve, ink.panel, 0.75)), depth: -9e8 });
  }
  // A dot a reading, larger where the error is; its bar lies along the load.
  dots(view) {
    const r = this.state.readings, items = [];
    if (!r) return this.plan(view);
    if (r.line.length > MANY) return [this.cloud(r, view), ...this.plan(view)];
    for (let i = 0; i < r.line.length; i++) {
      const at = [r.x_mm[i], r.y_mm[i], r.z_mm[i]], [x, y, depth] = view.project(at), gone = r.aside[i],
        chosen = i === this.selected;
      const along = [r.dx[i], r.dy[i], r.dz[i]], size = BESIDE / view.zoom, [px, py] = view.project(at.map((v, k) => v
        + along[k] * size));
      // Readings of one pose stand apart along their directions, so that each can be pointed at.
      const percent = this.deviation[i] ?? 0, big = this.radius(gone, percent);
      this.spots.push([px, py, i]);
      items.push({ depth: depth + 60 + (chosen ? 1e5 : 0), paint: (g) => {
        const colour = gone ? ink.line : errorColour(percent, this.scale);
        g.beginPath(); g.moveTo(x, y); g.lineTo(px, py); stroke(g, colour, 1.3);
        g.beginPath(); g.arc(px, py, big, 0, 7);
        if (gone) stroke(g, ink.muted, 1.4); else { g.fillStyle = colour; g.fill(); stroke(g, ink.panel, 0.8); }
        if (chosen) ring(g, px, py, big + 4, ink.ink, 2);
      } });
    }
    return [...items, ...this.plan(view)];
  }
  radius(gone, percent) { return gone ? 3 : 2.2 + 4 * Math.min(1, Math.abs(percent) / this.scale); }
  // Thousands of readings: dots above the rest without bars, those of a shade as one path; the largest errors last.
  cloud(r, view) {
    const [right, up] = view.axes(), [mx, my, mz] = view.middle, size = BESIDE / view.zoom, gone = [],
      shades = Array.from({ length: 2 * SHADES + 1 }, () => []);
    for (let i = 0; i < r.line.length; i++) {
      const x = r.x_mm[i] + r.dx[i] * size - mx, y = r.y_mm[i] + r.dy[i] * size - my, z = r.z_mm[i] + r.dz[i] * size
        - mz;
      const spot = [view.cx + view.zoom * (x * right[0] + y * right[1]), view.cy - view.zoom * (x * up[0] + y * up[1]
        + z * up[2]), i];
      const share = Math.max(-1, Math.min(1, (this.deviation[i] ?? 0) / this.scale));
      this.spots.push(spot);
      (r.aside[i] ? gone : shades[SHADES + Math.round(SHADES * share)]).push(spot);
    }
    const paths = shades.map((spots, k) => ({ spots, percent: (k / SHADES - 1) * this.scale }))
      .sort((a, b) => Math.abs(a.percent) - Math.abs(b.percent));
    const dots = (g, spots, radius) => { g.beginPath(); for (const [x, y] of spots) { g.moveTo(x + radius, y);
      g.arc(x, y, radius, 0, 7); } };
    return { depth: 1e5, paint: (g) => {
      for (const { spots, percent } of paths) { dots(g, spots, this.radius(false, percent));
        g.fillStyle = errorColour(percent, this.scale); g.fill(); }
      dots(g, gone, this.radius(true, 0)); stroke(g, ink.muted, 1.4);
      const chosen = this.spots[this.selected];
      if (chosen) ring(g, chosen[0], chosen[1], this.radius(r.aside[this.selected], this.deviation[this.selected] ?? 0)
        + 4, ink.ink, 2);
    } };
  }
  plan(view) {
    return (this.state.plan?.visits ?? []).map((v) => {
      const [x, y, depth] = view.project([v.x_mm, v.y_mm, v.z_mm]);
      return { depth: depth + 80, paint: (g) => {
        trace(g, [[x, y - 8], [x + 8, y], [x, y + 8], [x - 8, y]]);
        stroke(g, ink.accent, 2.2);
      } };
    });
  }
  overlay(g, view) {
    if (this.sample >= 0 && this.paths[0]) mark(g, ...this.paths[0].at(this.sample), 7, ink.ink, 2);
  }
  nearest(x, y) {
    let best = 11 * 11, found = -1;
    for (const [px, py, i] of this.spots ?? []) { const d = (px - x) ** 2 + (py - y) ** 2; if (d < best) { best = d;
      found = i; } }
    if (found < 0 && this.paths[0]) { const k = this.paths[0].nearest(x, y); if (k >= 0) found = k + PATH_FROM; }
    return found;
  }
}
// What reaches beyond the picture fades at its upper edge.
function fadeOut(g, view) {
  const fade = g.createLinearGradient(0, 0, 0, 70);
  fade.addColorStop(0, "rgba(0,0,0,1)");
  fade.addColorStop(1, "rgba(0,0,0,0)");
  Object.assign(g, { globalCompositeOperation: "destination-out", fillStyle: fade });
  g.fillRect(0, 0, view.width, 70);
  g.globalCompositeOperation = "source-over";
}
const centreOf = (points) => points[0].map((_, i) => points.reduce((sum, p) => sum + p[i], 0) / points.length);
// Points in their order about a middle, counterclockwise seen along the third column of a turn.
function byAngle(points, middle, turn = [[1, 0, 0], [0, 1, 0], [0, 0, 1]]) {
  const angle = (p) => { const d = minus(p, middle), along = (k) => dot3(d, turn.map((row) => row[k]));
    return Math.atan2(along(1), along(0)); };
  return [...points].sort((a, b) => angle(a) - angle(b));
}
const PATH_RAPID = () => COLOURS.light.length;  // the class of rapids, after those of the colours
const PATH_FROM = 1e7;  // numbers of samples come after those of the readings
