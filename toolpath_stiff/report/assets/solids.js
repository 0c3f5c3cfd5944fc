// Solids with light and shade on a 2-D canvas: cylinders, balls, prisms, beams. Each is { depth, paint(g) }, sorted by
// whoever draws them; lengths in mm, true to scale. The light comes from above the left shoulder of whoever looks.
const LIGHT = [-0.45, 0.6, 0.66];  // to the right, up, towards the eye
const minus = (a, b) => a.map((v, i) => v - b[i]), dot3 = (a, b) => a[0] * b[0] + a[1] * b[1] + a[2] * b[2];
const cross3 = (a, b) => [a[1] * b[2] - a[2] * b[1], a[2] * b[0] - a[0] * b[2], a[0] * b[1] - a[1] * b[0]];
const unit = (a) => { const size = Math.hypot(...a) || 1; return a.map((v) => v / size); };
const between = (a, b, t) => a.map((v, i) => v + (b[i] - v) * t);
const rgb = (c) => (c[0] === "#" ? [1, 3, 5].map((i) => parseInt((c.length === 4 ? c.replace(/[\da-f]/gi, "$&$&") : c)
  .slice(i, i + 2), 16)) : c.match(/\d+/g).map(Number));
function mix(a, b, t) {
  const [p, q] = [rgb(a), rgb(b)];
  return `rgb(${p.map((v, i) => Math.round(v + (q[i] - v) * t)).join(",")})`;
}
// A colour in the light: 0 is in the dark, 1 as it is, above that it shines.
const shade = (colour, light) => (light > 1 ? mix(colour, "#fff", Math.min(1, light - 1)) : mix("#10161d", colour,
  0.35 + 0.65 * Math.max(0, light)));

// A cylinder: a quadrangle shaded across, and the cap that can be seen.
function cylinder(view, a, b, radius, colour, alpha = 1) {
  const [p, q] = [view.project(a), view.project(b)], [right, up, eye] = view.axes(), axis = unit(minus(b, a));
  const [dx, dy] = [dot3(axis, right), -dot3(axis, up)], flat = Math.hypot(dx, dy);
  const wide = Math.max(1, radius * view.zoom);
  const [nx, ny] = flat > 1e-6 ? [-dy / flat * wide, dx / flat * wide] : [wide, 0], facing = dot3(axis, eye);
  const towards = (nx * LIGHT[0] - ny * LIGHT[1]) / wide, near = facing > 0 ? q : p;
  return { depth: (p[2] + q[2]) / 2, paint: (g) => {
    const across = g.createLinearGradient(p[0] - nx, p[1] - ny, p[0] + nx, p[1] + ny);
    for (const t of [-1, -0.5, 0, 0.5, 1]) across.addColorStop((t + 1) / 2, shade(colour, 0.12 + 0.85 * Math.max(0,
      t * towards + Math.sqrt(1 - t * t) * LIGHT[2]) + (Math.abs(t - towards) < 0.3 ? 0.16 : 0)));
    g.globalAlpha = alpha;
    g.fillStyle = across;
    trace(g, [[p, -1], [q, -1], [q, 1], [p, 1]].map(([end, side]) => [end[0] + side * nx, end[1] + side * ny]));
    g.fill();
    if (Math.abs(facing) > 0.05) for (const end of [near === p ? q : p, near]) {
      g.beginPath();
      g.ellipse(end[0], end[1], wide, wide * Math.abs(facing), Math.atan2(ny, nx), 0, 7);
      g.fillStyle = end === near ? shade(colour, 0.35 + 0.65 * Math.abs(facing)) : across;
      g.fill();
    }
    g.globalAlpha = 1;
  } };
}
function ball(view, centre, radius, colour, alpha = 1) {
  const [x, y, depth] = view.project(centre), r = Math.max(2, radius * view.zoom);
  return { depth: depth + radius, paint: (g) => {
    const lit = g.createRadialGradient(x + 0.4 * LIGHT[0] * r, y - 0.5 * LIGHT[1] * r, 0.05 * r, x, y, r);
    for (const [at, light] of [[0, 1.45], [0.35, 1], [0.8, 0.5], [1, 0.25]]) lit.addColorStop(at, shade(colour, light));
    Object.assign(g, { globalAlpha: alpha, fillStyle: lit });
    g.beginPath(); g.arc(x, y, r, 0, 7); g.fill();
    g.globalAlpha = 1;
  } };
}
// The faces that can be seen of a prism between two polygons, lower and upper, each counterclockwise from above.
function prism(view, lower, upper, colour, alpha = 1) {
  const sides = lower.map((p, i) => { const k = (i + 1) % lower.length; return [p, lower[k], upper[k], upper[i]]; });
  const [right, up, eye] = view.axes(), faces = [];
  for (const face of [...sides, upper, [...lower].reverse()]) {
    const normal = unit(cross3(minus(face[1], face[0]), minus(face[2], face[0])));
    if (dot3(normal, eye) <= 0) continue;
    const light = LIGHT[0] * dot3(normal, right) + LIGHT[1] * dot3(normal, up) + LIGHT[2] * dot3(normal, eye);
    faces.push([face.map((p) => view.project(p)), shade(colour, 0.2 + 0.8 * Math.max(0, light))]);
  }
  const middle = [...lower, ...upper].reduce((sum, p) => sum.map((v, i) => v + p[i]), [0, 0, 0]);
  return { depth: view.project(middle.map((v) => v / (2 * lower.length)))[2], paint: (g) => {
    Object.assign(g, { globalAlpha: alpha, lineWidth: 0.7 });  // edges are drawn too: no seams between faces
    for (const [points, colour] of faces) fill(g, points, colour);
    g.globalAlpha = 1;
  } };
}
function block(view, box, colour, alpha = 1) {
  const ring = (z) => [[0, 0], [1, 0], [1, 1], [0, 1]].map(([i, j]) => [box[0][i], box[1][j], z]);
  return prism(view, ring(box[2][0]), ring(box[2][1]), colour, alpha);
}
function beam(view, a, b, half, colour, alpha = 1) {
  const along = unit(minus(b, a)), aside = Math.abs(along[2]) > 0.7 ? [0, 1, 0] : [0, 0, 1];
  const u = unit(cross3(along, aside)).map((v) => half * v), v = cross3(along, u);
  const ring = (p) => [[1, 1], [-1, 1], [-1, -1], [1, -1]].map(([i, j]) => p.map((c, k) => c + i * u[k] + j * v[k]));
  return prism(view, ring(a), ring(b), colour, alpha);
}
