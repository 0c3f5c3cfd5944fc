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
const between = (a, b, t) => a.map((v, i) => v + (b[i] - v) * t);
// Blue is stiffer, orange softer than modelled; grey in between, and the size says how much: no colour is needed.
function errorColour(percent, scale) {
  const share = Math.min(1, Math.abs(percent) / scale), to = percent < 0 ? ink.second : ink.curve;
  return mix(ink.rapid, to, 0.15 + 0.85 * share);
}
function mix(a, b, t) {
  const parse = (c) => { const h = c.length === 4 ? c.replace(/[\da-f]/gi, "$&$&") : c;
    return [1, 3, 5].map((i) => parseInt(h.slice(i, i + 2), 16)); };
  const [p, q] = [parse(a), parse(b)];
  return `rgb(${p.map((v, i) => Math.round(v + (q[i] - v) * t)).join(",")})`;
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
    if (this.focus === "machine") this.joints.frame.forEach(see);
    for (const row of this.state.machine.reach) row.forEach(see);
    // The boundary is round: a view that holds three quarters of its box holds all of it.
    if (this.focus === "work") return box.map(([low, high]) => [low + 0.13 * (high - low), high - 0.13 * (high - low)]);
    return box;
  }
  platform() {
    const turn = turnOf(this.pose), joints = this.joints.platform.map((p) => moved(this.pose, turn, p));
    const middle = joints[0].map((_, i) => joints.reduce((sum, p) => sum + p[i], 0) / joints.length);
    return { turn, joints, middle, nose: moved(this.pose, turn, [0, 0, this.joints.tool]) };
  }
  islit(link, number) {
    return this.lit.some((one) => one.link === link && (one.number === undefined || number === undefined
      || one.number === number));
  }
  draw(g, view) {
    if (!this.state) return;
    this.spots = [];
    this.drawReach(g, view);
    this.drawFrame(g, view);
    this.drawPath(g, view);
    const items = [...this.solids(view), ...this.dots(view)].sort((a, b) => a.depth - b.depth);
    for (const item of items) item.paint(g);
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
  // Joints of one vertex stand above each other: the frame is a ring through the vertices, with legs to the floor.
  drawFrame(g, view) {
    const joints = this.joints.frame, floor = Math.min(...this.state.machine.reach.flat().map((p) => p[2]));
    const order = joints.map((p, i) => i).sort((i, k) => Math.atan2(joints[i][1], joints[i][0])
      - Math.atan2(joints[k][1], joints[k][0]) || i - k);
    const colour = this.islit("frame") ? ink.accent : ink.rapid, width = Math.max(2, Math.min(9, 160 * view.zoom));
    g.globalAlpha = 0.55;
    this.polyline(g, view, order.map((i) => joints[i]), colour, width, true);
    if (this.focus === "machine") for (const i of order) this.polyline(g, view, [joints[i], [joints[i][0], joints[i][1],
      floor]], colour, width * 0.6);
    g.globalAlpha = 1;
    if (this.islit("table")) {
      const [x, y] = this.state.machine.origin, z = floor;
      this.polyline(g, view, [[x - 400, y - 400, z], [x + 400, y - 400, z], [x + 400, y + 400, z],
        [x - 400, y + 400, z]], ink.accent, 3, true);
    }
  }
  drawPath(g, view) {
    const path = this.paths[0];
    if (!path) return;
    const colours = coloursNow();
    path.stroke(g, colours.length, ink.rapid, 1);
    colours.forEach((colour, i) => path.stroke(g, i, colour, 2.4));
    path.stroke(g, colours.length + 1, ink.plunge, 1.6);
    path.stroke(g, colours.length + 2, ink.bad, 3);
    for (const run of this.shifted?.runs ?? []) this.polyline(g, view, run, ink.second, 1.6);
  }
  solids(view) {
    const { joints, middle, nose } = this.platform(), items = [], tip = this.pose.slice(0, 3);
    const width = (mm, low, high) => Math.max(low, Math.min(high, mm * view.zoom));
    const bar = (a, b, mm, colour, core, low = 2, high = 15) => {
      const [p, q] = [view.project(a), view.project(b)];
      items.push({ depth: (p[2] + q[2]) / 2, paint: (g) => {
        const wide = width(mm, low, high);
        for (const [c, w] of [[ink.panel, wide + 2], [colour, wide], [core, wide * 0.35]]) {
          g.lineCap = "butt"; g.beginPath(); g.moveTo(p[0], p[1]); g.lineTo(q[0], q[1]); stroke(g, c, w);
        }
      } });
    };
    this.joints.frame.forEach((top, i) => {
      const lit = this.islit("struts", i + 1), colour = lit ? ink.accent : mix(ink.plunge, ink.panel, 0.15), core = lit
        ? ink.panel : mix(ink.rapid, ink.panel, 0.55);
      const cut = between(top, joints[i], 0.58);
      bar(top, cut, 150, colour, core, 4, 16);
      bar(cut, joints[i], 85, lit ? ink.accent : ink.rapid, core, 2.5, 9);
      for (const [at, frame] of [[top, true], [joints[i], false]]) {
        const [x, y, depth] = view.project(at), on = this.islit("joints", i + 1);
        items.push({ depth: depth + 20, paint: (g) => {
          g.beginPath(); g.arc(x, y, width(frame ? 130 : 75, 3, 10), 0, 7); g.fillStyle = on ? ink.accent : ink.plunge;
            g.fill();
          g.strokeStyle = ink.panel; g.lineWidth = 1; g.stroke();
        } });
      }
      const [nx, ny, depth] = view.project(between(top, joints[i], 0.72));
      items.push({ depth: depth + 40, paint: (g) => view.write(g, String(i + 1), nx, ny, "middle") });
    });
    const outline = joints.map((p) => view.project(p)), centre = view.project(middle);
    items.push({ depth: centre[2], paint: (g) => {
      trace(g, outline);
      g.globalAlpha = 0.82; g.fillStyle = this.islit("platform") || this.islit("geometry") ? ink.accent
        : mix(ink.plunge, ink.panel, 0.35); g.fill(); g.globalAlpha = 1;
      stroke(g, ink.ink, 1.2);
    } });
    const tool = this.islit("tool") ? ink.accent : ink.plunge;
    bar(middle, nose, 130, tool, mix(ink.rapid, ink.panel, 0.5), 4, 16);
    bar(nose, tip, 40, this.islit("tool") || this.islit("instrument") ? ink.accent : ink.ink, ink.rapid, 2, 6);
    return items;
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
const PATH_FROM = 1e7;  // numbers of samples come after those of the readings
