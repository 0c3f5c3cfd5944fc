// A stiffness map: surfaces above their planes.
const data = JSON.parse($("data").textContent);
const { x: xs, y: ys, z: planes, values } = data, across = xs.length, deep = ys.length;
const known = values.flat().filter((v) => v !== null);
const least = known.reduce((a, b) => Math.min(a, b), Infinity), most = known.reduce((a, b) => Math.max(a, b),
  -Infinity);
const share = (v) => (v - least) / (most - least || 1);
const colourOf = (v) => coloursNow()[classAt(v, [least, most], CLASSES)];

const span = Math.max(xs[across - 1] - xs[0], ys[deep - 1] - ys[0]);
const bottom = Math.min(...planes), top = Math.max(...planes);
const apart = planes.length > 1 ? Math.min(...planes.slice(1).map((z, i) => Math.abs(z - planes[i]))) : 0;
const lift = planes.length > 1 ? 0.7 * apart : 0.45 * span;  // of the highest value above its plane
let points = [], here = null;
const scene = {
  beside: 210,  // room for the labels
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
  // Planes, and their heights at the right.
  label(g, viewer) {
    const corners = [[0, 0], [across - 1, 0], [across - 1, deep - 1], [0, deep - 1]];
    for (const z of planes) {
      const at = corners.map(([i, j]) => viewer.project([xs[i], ys[j], z]));
      trace(g, at);
      g.globalAlpha = 0.45;
      stroke(g, ink.ink, 1);
      g.globalAlpha = 1;
      const right = at.reduce((a, b) => (b[0] > a[0] ? b : a));
      viewer.write(g, `z ${z} mm`, right[0] + 6, right[1] - 2);
    }
  },
  overlay(g) {
    if (here) mark(g, here.seen[0], here.seen[1], 4);
  },
  // Of the points within 12 pixels the nearest, and of those that lie over each other the foremost.
  nearest(x, y) {
    const far = ({ seen: [px, py, near] }) => (px - x) ** 2 + (py - y) ** 2 - 0.001 * near;
    return nearestOf(points.length, (i) => far(points[i]), 12);
  },
};
const view = new Viewer($("view"), scene, {
  point(i) {
    here = points[i] ?? null;
    if (here) $("status").textContent = `X ${here.x} Y ${here.y} Z ${here.z} mm: ${group(here.v)} N/mm`;
    view.drawOverlay();
  },
});
watchTheme(() => view.redraw());
view.resize();
