// What the studio draws in the machine's space: the machine, its reach, the readings, the path, what a plan asks.
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
    this.room = [56, 16];
    this.showReach = true;
    this.selected = -1;   // reading
    this.paths = [];
    this.scale = 10;      // per cent at full colour
    this.pose = [0, 0, 0, 0, 0, 0];
  }
  get iso() { return this.body?.iso; }
  take(state, lit) {
    this.state = state;
    this.body = Object.assign(new MachineBody(state.machine.scene), { lit });
  }
  // [low, high] of X, Y and Z of the cuts; null without a program.
  work() {
    const path = this.paths[0], RAPIDS = COLOURS.light.length;
    return path ? path.xyz.map((of) => of.reduce(([low, high], v, i) => (path.of[i] === RAPIDS ? [low, high]
      : [Math.min(low, v), Math.max(high, v)]), [Infinity, -Infinity])) : null;
  }
  box() {
    if (!this.state) return [[-1, 1], [-1, 1], [-1, 1]];
    const points = this.outline(), work = this.work();
    if (points) return endsOf(points);
    const room = 0.35 * Math.max(...work.map(([low, high]) => high - low));
    return work.map(([low, high]) => [low - room, high + room]);
  }
  outline() {
    if (!this.state || this.focus === "part" && this.paths[0]) return null;
    const { body } = this;
    return this.focus === "work" && body.hangs ? body.data.reach.flat() : body.outline(this.pose);
  }
  draw(g, view) {
    if (!this.state) return;
    this.spots = [];
    if (this.focus !== "part" && this.showReach) this.body.drawReach(g, view);
    const close = this.focus === "part" || this.focus === "work" && this.body.hangs;
    const machine = this.body.items(view, this.pose, { work: this.work(), close, floor: this.body.floor });
    paint(g, view, [...machine, ...this.dots(view), this.pathItem(view)].filter(Boolean), close);
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
      for (const run of this.shifted?.runs ?? []) {
        trace(g, run.map((p) => view.project(p)), false);
        stroke(g, ink.second, 1.6);
      }
    } };
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
