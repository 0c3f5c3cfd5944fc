// A stiffness map: surfaces above their planes.
const data = JSON.parse(document.getElementById("data").textContent), $ = (id) => document.getElementById(id);
const { x: xs, y: ys, z: planes, values } = data, across = xs.length, deep = ys.length, CLASSES = data.colours.length;
const known = values.flat().filter((v) => v !== null);
const least = known.reduce((a, b) => Math.min(a, b), Infinity), most = known.reduce((a, b) => Math.max(a, b),
  -Infinity);
const share = (v) => (v - least) / (most - least || 1);
const coloursNow = () => (theme.dark ? data.colours_dark : data.colours);
const colourOf = (v) => coloursNow()[Math.min(CLASSES - 1, Math.floor(share(v) * CLASSES))];
$("low").textContent = group(least);
$("high").textContent = group(most);

const span = Math.max(xs[across - 1] - xs[0], ys[deep - 1] - ys[0]);
const bottom = Math.min(...planes), top = Math.max(...planes);
const apart = planes.length > 1 ? Math.min(...planes.slice(1).map((z, i) => Math.abs(z - planes[i]))) : 0;
const lift = planes.length > 1 ? 0.7 * apart : 0.45 * span;  // of the highest value above its plane
let points = [], here = null;
const scene = {
  frame: false,
  beside: 210,  // room for the labels
  heavy: false,
  squeeze: Math.min(1, 1.1 * span / (top - bottom + lift)),
  box: () => [[xs[0], xs[across - 1]], [ys[0], ys[deep - 1]], [bottom, top + lift]],
  draw(g, viewer) {
    const quads = [];
    points = [];
    planes.forEach((z, layer) => {
      const at = values[layer].map((v, i) => {
        if (v === null) return null;
        const [x, y] = [xs[i % across], ys[Math.floor(i / across)]], seen = viewer.project([x, y, z + lift * share(v)]);
        points.push({ seen, x, y, z, v });
        return [...seen, v];
      });
      for (let j = 0; j + 1 < deep; j++) for (let i = 0; i + 1 < across; i++) {
        const corners = [at[j * across + i], at[j * across + i + 1], at[(j + 1) * across + i + 1],
          at[(j + 1) * across + i]];
        if (corners.every(Boolean)) quads.push({ corners, near: corners[0][2] + corners[2][2], v: corners
          .reduce((sum, c) => sum + c[3], 0) / 4 });
      }
    });
    quads.sort((one, other) => one.near - other.near);
    g.lineWidth = 1;
    for (const { corners, v } of quads) fill(g, corners, colourOf(v));
  },
  // Planes, their heights at the right, X and Y at the corners of the lowest; the hindmost corner is behind the
  // surfaces.
  label(g, viewer) {
    const corners = [[0, 0], [across - 1, 0], [across - 1, deep - 1], [0, deep - 1]];
    planes.forEach((z, layer) => {
      const at = corners.map(([i, j]) => viewer.project([xs[i], ys[j], z]));
      trace(g, at);
      g.globalAlpha = 0.45;
      stroke(g, ink.ink, 1);
      g.globalAlpha = 1;
      const right = at.reduce((a, b) => (b[0] > a[0] ? b : a)), left = at.reduce((a, b) => (b[0] < a[0] ? b : a));
      const behind = at.reduce((a, b) => (b[2] < a[2] ? b : a));
      viewer.write(g, `z ${z} mm`, right[0] + 6, right[1] - 2);
      if (z !== bottom) return;
      at.forEach((p, i) => {
        if (p === behind) return;
        const side = p === left ? "right" : p === right ? "left" : "middle";
        viewer.write(g, `X ${xs[corners[i][0]]} Y ${ys[corners[i][1]]}`, p[0] + (p === left ? -6 : p === right ? 6 : 0),
          p[1] + 14, side);
      });
    });
  },
  overlay(g) {
    if (here) mark(g, here.seen[0], here.seen[1], 4);
  },
  // Of the points within 12 pixels the nearest, and of those that lie over each other the foremost.
  nearest(x, y) {
    let best = 144, found = -1;
    points.forEach(({ seen }, i) => {
      const d = (seen[0] - x) ** 2 + (seen[1] - y) ** 2 - 0.001 * seen[2];
      if (d < best) { best = d; found = i; }
    });
    return found;
  },
};
const retheme = () => { $("ramp").style.background = ramp(coloursNow()); view.redraw(); };
let view;
watchTheme(() => retheme());
view = new Viewer($("view"), scene, {
  point(i) {
    here = points[i] ?? null;
    if (here) $("status").textContent = `X ${here.x} Y ${here.y} Z ${here.z} mm: ${group(here.v)} N/mm`;
    view.drawOverlay();
  },
});
view.resize();
retheme();
