// A machine at a pose as solids: struts or links with their joints, platform, spindle and tool, what it hangs from or
// stands on, the table with the work. It draws what `machine_scene` (report/scene.py) gives: of a hexapod its joints,
// of other kinds bodies at some poses, of which the nearest is drawn. Positions are in mm, a pose is x, y, z, A, B, C.
function turnOf([, , , a, b, c]) {
  const [r, p, y] = [a, b, c].map((v) => v * Math.PI / 180), { sin, cos } = Math;
  return [
    [cos(y) * cos(p), cos(y) * sin(p) * sin(r) - sin(y) * cos(r), cos(y) * sin(p) * cos(r) + sin(y) * sin(r)],
    [sin(y) * cos(p), sin(y) * sin(p) * sin(r) + cos(y) * cos(r), sin(y) * sin(p) * cos(r) - cos(y) * sin(r)],
    [-sin(p), cos(p) * sin(r), cos(p) * cos(r)],
  ];
}
const moved = (pose, turn, point) => turn.map((row, i) => pose[i] + dot3(row, point));
const centreOf = (points) => points[0].map((_, i) => points.reduce((sum, p) => sum + p[i], 0) / points.length);
// [low, high] of X, Y and Z.
const endsOf = (points) => [0, 1, 2].map((k) => [Math.min(...points.map((p) => p[k])),
  Math.max(...points.map((p) => p[k]))]);
const lit = (all, link, name) => all.some((one) => one.link === link && (!one.name || !name || one.name === name));
// Points in their order about their middle, counterclockwise seen along the third column of a turn.
function byAngle(points, turn = [[1, 0, 0], [0, 1, 0], [0, 0, 1]]) {
  const middle = centreOf(points), angle = (p) => { const d = minus(p, middle);
    const along = (k) => dot3(d, turn.map((row) => row[k])); return Math.atan2(along(1), along(0)); };
  return [...points].sort((a, b) => angle(a) - angle(b));
}

class MachineBody {
  constructor(data) {
    this.data = data;
    this.lit = [];  // [{ link, name }] of the effects that are on
    const bodies = this.at(data.poses?.[0] ?? [0, 0, 0, 0, 0, 0]);
    this.hangs = bodies.some(({ name }) => name === "platform");
    this.slides = bodies.some(({ name }) => name === "bed");
    this.feet = this.hangs ? bodies.slice(0, -2).map(({ points }) => points[0]) : [bodies[0].points[0]];
    const points = this.hangs ? this.feet : bodies.flatMap((body) => body.points), middle = centreOf(points);
    // mm, by which what no file says is drawn: how thick struts, joints, platform and spindle are.
    this.size = points.reduce((sum, p) => sum + Math.hypot(...minus(p, middle)), 0) / points.length;
    this.iso = this.hangs ? [-22, 26] : VIEWS.iso;  // a leg does not stand before the work
    this.floor = Math.min(...(this.hangs ? data.reach?.flat() ?? [points[0]] : this.feet).map((p) => p[2]));
  }
  // What a view of the whole machine is fitted to: a ring and a ball do not reach the corners of their box.
  outline(pose) {
    const { size, floor } = this, thick = this.hangs ? 0 : 0.14 * size;
    const feet = this.feet.map(([x, y]) => [x, y, floor - 0.1 * size]);
    return [...feet, ...this.at(pose).flatMap(({ points }) => points)].flatMap((p) => cornersOf(p.map((v) =>
      [v - thick, v + thick]))).concat(this.hangs && this.data.reach?.flat() || []);
  }
  drawReach(g, view) {
    const rows = this.data.reach, line = (points, close) => { trace(g, points.map((p) => view.project(p)), close);
      stroke(g, ink.line, 1); };
    if (!this.hangs) return;  // in a hollow space rays from its middle say little
    g.globalAlpha = 0.9;
    rows.slice(1, -1).forEach((row) => line(row, true));
    for (let k = 0; k < rows[0].length; k += 3) line(rows.map((row) => row[k]), false);
    g.globalAlpha = 1;
  }
  // The bodies at a pose: name, link, points.
  at(pose) {
    const { joints, poses, frames, bodies } = this.data;
    if (!joints) {
      const far = poses.map((p) => p.reduce((sum, v, k) => sum + (v - pose[k]) ** 2, 0));
      const nearest = frames[far.indexOf(Math.min(...far))];
      return bodies.map((body, k) => ({ ...body, points: nearest[k] }));
    }
    const turn = turnOf(pose), ends = joints.platform.map((p) => moved(pose, turn, p));
    return [
      ...ends.map((end, i) => ({ name: `strut ${i + 1}`, link: "struts", points: [joints.frame[i], end] })),
      { name: "platform", link: "platform", points: byAngle(ends, turn) },
      { name: "tool", link: "tool", points: [moved(pose, turn, [0, 0, joints.tool]), pose.slice(0, 3)] },
    ];
  }
  // The floor in the light of a lamp above, with the shadows of struts, links and platform.
  ground(g, view, bodies, height) {
    const on = ([x, y]) => view.project([x, y, height]), [x, y] = on(centreOf(this.feet));
    const far = 2.1 * this.size * view.zoom, lamp = g.createRadialGradient(0, 0, 0, 0, 0, far);
    ["3c", "00"].forEach((alpha, at) => lamp.addColorStop(at, ink.rapid + alpha));
    g.save();
    g.transform(1, 0, 0, view.axes()[2][2], x, y);
    g.fillStyle = lamp;
    g.fillRect(-far, -far, 2 * far, 2 * far);
    g.restore();
    Object.assign(g, { globalAlpha: 0.17, lineCap: "round", lineJoin: "round" });
    g.beginPath();
    for (const { name, points } of bodies) if (name !== "bed") points.map(on).forEach(([px, py], k) =>
      (k ? g.lineTo(px, py) : g.moveTo(px, py)));
    stroke(g, "#0a0e12", (this.hangs ? 0.05 : 0.12) * this.size * view.zoom);
    Object.assign(g, { globalAlpha: 1, lineCap: "butt" });
  }
  // What is drawn at a pose, to be sorted by depth. Of `work`, [low, high] of X, Y and Z of the cuts, the part is drawn
  // on its table; `close`: the work is looked at, what stands before it lets it show through; `floor`: mm, of the legs.
  items(view, pose, { work, close, floor }) {
    const { size, hangs } = this, items = [], front = view.project(pose.slice(0, 3))[2] + 0.02 * size;
    const clear = close && hangs ? Math.max(0.1, Math.min(0.8, 1.2 - 0.5 * size * view.zoom / view.width)) : 1;
    const bright = mix(ink.panel, "#fff", 0.5), metal = mix(ink.rapid, bright, 0.25), pale = mix(metal, bright, 0.4);
    const dark = mix(metal, ink.plunge, 0.25), stand = mix(ink.rapid, bright, 0.45);
    const through = (place) => Math.min(clear + 0.2, close && view.project(place)[2] > front ? 0.3 : 1);
    const colour = (link, name, plain) => (lit(this.lit, link, name) ? ink.accent : plain);
    const add = (shape, a, b, radius, paint, alpha = through(between(a, b, 0.5))) =>
      items.push(shape(view, a, b, radius * size, paint, alpha));
    const joint = (place, radius, paint) => items.push(ball(view, place, radius * size, paint,
      paint === ink.accent ? 1 : through(place)));
    const bodies = this.at(pose).filter(({ points: [a, b] }) => Math.hypot(...minus(a, b)) > 1e-3);
    bodies.forEach(({ name, link, points }, k) => {
      const [a, b] = points, plain = colour(link, name, k % 2 || hangs ? metal : pale);
      if (name === "bed") items.push(prism(view, points.map(([x, y, z]) => [x, y, z - 0.13 * size]), points, pale));
      else if (name === "platform") {
        const [nose, tip] = bodies[k + 1].points, thick = unit(minus(nose, tip)).map((v) => 0.035 * size * v);
        const body = lit(this.lit, "geometry") ? ink.accent : colour(link, "", mix(metal, ink.plunge, 0.35));
        const [lower, upper] = [-1, 1].map((side) => points.map((p) => p.map((v, i) => v + side * thick[i])));
        // Joints and struts stand on it: seen from above they are painted after it.
        const beneath = dot3(thick, view.axes()[2]) > 0 ? size : 0, solid = prism(view, lower, upper, body, clear);
        items.push({ ...solid, depth: solid.depth - beneath });
      } else if (name === "tool") {
        const neck = between(a, b, 0.45), held = hangs && between(centreOf(bodies[k - 1].points), a, -0.45);
        if (hangs) add(cylinder, held, a, 0.05, colour(link, "", dark));
        add(cylinder, a, neck, 0.025, plain, close ? 0.75 : 1);
        add(cylinder, neck, b, 0.005, lit(this.lit, "instrument") ? ink.accent : colour(link, "", ink.plunge), 1);
      } else if (hangs) {
        const cut = between(a, b, 0.58), ends = colour("joints", name, colour(link, name, ink.plunge));
        add(cylinder, a, cut, 0.03, plain);
        add(cylinder, cut, b, 0.019, colour(link, name, mix(ink.plunge, bright, 0.45)));
        joint(a, 0.045, ends);
        joint(b, 0.032, ends);
      } else if (this.slides) add(beam, a, b, 0.13, plain);
      else {
        add(cylinder, a, b, 0.11 - 0.008 * k, plain);
        joint(a, 0.13 - 0.009 * k, colour("joints", name, dark));
      }
      const [x, y, depth] = view.project(between(a, b, hangs && close ? 0.82 : 0.6));
      const named = !["platform", "tool", "bed", "work"].includes(name) && view.holds([x, y]) && (hangs || !close);
      if (named) items.push({ depth: depth + size,
        paint: (g) => view.write(g, name.replace("strut ", ""), x, y, "middle") });
    });
    const frame = colour("frame", "", stand), ring = hangs ? byAngle(this.feet) : [];
    ring.forEach((p, i) => add(cylinder, p, ring[(i + 1) % ring.length], 0.022, frame));
    if (hangs && !close) for (const p of ring) add(cylinder, p, [p[0], p[1], floor], 0.016, frame);
    const [[fx, fy, fz]] = this.feet, ground = hangs ? floor : fz - 0.1 * size;
    if (!hangs && !this.slides) add(cylinder, [fx, fy, ground], [fx, fy, fz], 0.2, frame);
    if (!close) items.push({ depth: -2e9, paint: (g) => this.ground(g, view, bodies, ground) });
    if (this.slides || !work && !hangs) return items;
    // The table, which all else stands on, and the part.
    const [x, y, z] = work ?? [...(this.data.reach?.[0][0] ?? pose).slice(0, 2), floor].map((v) => [v, v]);
    const half = work ? 0.8 * Math.max(x[1] - x[0], y[1] - y[0]) : 0.22 * size, low = z[0] - (work ? 0.012 * size : 0);
    const about = (ends) => [-half, half].map((v) => (ends[0] + ends[1]) / 2 + v);
    const below = close ? low - 0.04 * size : Math.min(ground, low - 0.05 * size);
    items.push({ ...block(view, [about(x), about(y), [below, low]], colour("table", "", pale)), depth: -1e9 });
    if (work) items.push({ ...block(view, [...[x, y].map(([a, b]) => [a - 0.01 * size, b + 0.01 * size]),
      [low, Math.max(z[0], low) + 1e-3]], mix(ink.curve, ink.panel, 0.88)), depth: -9e8 });
    return items;
  }
}
// Painted from the back to the front; where the work is looked at, what reaches beyond the picture fades at its edge.
function paint(g, view, items, close) {
  for (const item of items.sort((a, b) => a.depth - b.depth)) item.paint(g);
  if (!close) return;
  const fade = g.createLinearGradient(0, 0, 0, 70);
  fade.addColorStop(0, "rgba(0,0,0,1)");
  fade.addColorStop(1, "rgba(0,0,0,0)");
  Object.assign(g, { globalCompositeOperation: "destination-out", fillStyle: fade });
  g.fillRect(0, 0, view.width, 70);
  g.globalCompositeOperation = "source-over";
}
