// What the studio draws in the machine's space: the machine, its reach, the readings, the path, what a plan asks.
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
    this.room = [52, 50];
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
    const path = this.paths[0];
    return path ? extentOf(path.xyz, (i) => path.of[i] !== RAPIDS) : null;
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
    const { body } = this, r = this.state.readings, work = this.work();
    const near = [...(r ? r.x_mm.map((x, i) => [x, r.y_mm[i], r.z_mm[i]]) : []), ...(work ? cornersOf(work) : [])];
    return this.close ? [...near, ...body.at(this.pose).at(-2).points] : [...body.outline(this.pose),
      ...(work ? cornersOf(work) : [])];
  }
  // Whether the work is looked at, or all that there is.
  get close() {
    const part = this.paths[0], there = this.body.hangs && (this.state.readings || part);
    return Boolean(this.focus === "part" ? part : this.focus === "work" && there);
  }
  draw(g, view) {
    if (!this.state) return;
    this.spots = [];
    if (this.focus !== "part") this.body.drawReach(g, view);
    const { close } = this, machine = this.body.items(view, this.pose, { work: this.work(), close,
      floor: this.body.floor });
    const dots = this.state.readings ? this.dots(view) : null;
    paint(g, view, [...machine, dots, ...this.plan(view), this.pathItem(view)].filter(Boolean), close);
  }
  pathItem(view) {
    const path = this.paths[0];
    if (!path) return null;
    return { depth: view.project(this.pose.slice(0, 3))[2], paint: (g) => {
      path.paint(g, { width: 2.4 });
      for (const run of this.shifted?.runs ?? []) {
        trace(g, run.map((p) => view.project(p)), false);
        stroke(g, ink.second, 1.6);
      }
    } };
  }
  // A dot a reading before all else, larger where the error is, the largest last; unless they are many a bar along the
  // load leads to it, so that readings of one pose stand apart. Those of a shade are one path; the last are set aside.
  dots(view) {
    const r = this.state.readings, size = BESIDE / view.zoom, many = r.line.length > MANY, aside = 2 * SHADES + 1;
    const shades = Array.from({ length: aside + 1 }, () => []);
    this.spots = r.line.map((_, i) => {
      const at = [r.x_mm[i], r.y_mm[i], r.z_mm[i]], along = [r.dx[i], r.dy[i], r.dz[i]];
      const [x, y] = view.project(at.map((v, k) => v + along[k] * size));
      const share = Math.max(-1, Math.min(1, (this.deviation[i] ?? 0) / this.scale));
      shades[r.aside[i] ? aside : SHADES + Math.round(SHADES * share)].push([x, y, many ? null : view.project(at)]);
      return [x, y, i];
    });
    const radius = (share) => 2.2 + 4 * Math.abs(share), chosen = this.spots[this.selected];
    const drawn = shades.map((spots, k) => ({ spots, gone: k === aside, share: k === aside ? 0 : k / SHADES - 1 }))
      .sort((a, b) => Math.abs(a.share) - Math.abs(b.share));
    return { depth: 1e5, paint: (g) => {
      for (const { spots, gone, share } of drawn) {
        const colour = gone ? ink.muted : errorColour(share * this.scale, this.scale), big = radius(share);
        g.beginPath();
        for (const [x, y, foot] of spots) if (foot) { g.moveTo(foot[0], foot[1]); g.lineTo(x, y); }
        stroke(g, colour, 1.3);
        g.beginPath();
        for (const [x, y] of spots) { g.moveTo(x + big, y); g.arc(x, y, big, 0, 7); }
        if (!gone) { g.fillStyle = colour; g.fill(); }
        if (gone || !many) stroke(g, gone ? colour : ink.panel, gone ? 1.4 : 0.8);
      }
      if (chosen) ring(g, chosen[0], chosen[1], 9, ink.ink, 2);
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
    const spots = this.spots ?? [], far = (i) => (spots[i][0] - x) ** 2 + (spots[i][1] - y) ** 2;
    const found = nearestOf(spots.length, far, 11);
    const k = found < 0 && this.paths[0] ? this.paths[0].nearest(x, y) : -1;
    if (k >= 0) return k + PATH_FROM;
    return found;
  }
}
const PATH_FROM = 1e7;  // numbers of samples come after those of the readings
