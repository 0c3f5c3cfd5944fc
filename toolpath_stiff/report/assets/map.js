const d = JSON.parse(document.getElementById("data").textContent);
const $ = (id) => document.getElementById(id);
const all = d.values.flat().filter((v) => v !== null);
const low = Math.min.apply(null, all), high = all.reduce((a, b) => Math.max(a, b), -Infinity);
const stops = [[68, 1, 84], [59, 82, 139], [33, 145, 140], [94, 201, 98], [253, 231, 37]];
const colour = (v) => {
  const t = Math.min(1, Math.max(0, (v - low) / (high - low || 1))) * 4, i = Math.min(3, Math.floor(t)), f = t - i;
  return "rgb(" + stops[i].map((c, k) => Math.round(c + f * (stops[i + 1][k] - c))).join(",") + ")";
};
const words = (v) => Math.round(v).toLocaleString("en").replace(/,/g, "\u202f");
$("low").textContent = words(low); $("high").textContent = words(high);
const bar = $("bar").getContext("2d"); $("bar").width = 240; $("bar").height = 12;
for (let i = 0; i < 240; i++) { bar.fillStyle = colour(low + (high - low) * i / 239); bar.fillRect(i, 0, 1, 12); }
const canvas = $("view"), g = canvas.getContext("2d");
const nx = d.x.length, ny = d.y.length;
const cx = (d.x[0] + d.x[nx - 1]) / 2, cy = (d.y[0] + d.y[ny - 1]) / 2;
const zs = d.z, span = Math.max(d.x[nx - 1] - d.x[0], d.y[ny - 1] - d.y[0]);
const lift = zs.length > 1 ? 0.7 * Math.min(...zs.slice(1).map((z, i) => Math.abs(z - zs[i]))) : 0.45 * span;
const across = Math.hypot(d.x[nx - 1] - d.x[0], d.y[ny - 1] - d.y[0]);
const cz = (Math.min(...zs) + Math.max(...zs)) / 2 + lift / 2;
const tall = Math.max(...zs) - Math.min(...zs) + lift, squeeze = Math.min(1, 1.1 * span / tall);
let yaw = -0.7, pitch = 0.5, zoom = 1, points = [];
function place(x, y, z) {
  const c = Math.cos(yaw), s = Math.sin(yaw), u = c * (x - cx) - s * (y - cy), v = s * (x - cx) + c * (y - cy);
  const w = (z - cz) * squeeze;
  return [u, -w * Math.cos(pitch) - v * Math.sin(pitch), v * Math.cos(pitch) - w * Math.sin(pitch)];
}
function draw() {
  const ratio = window.devicePixelRatio || 1, W = canvas.clientWidth, H = canvas.clientHeight;
  canvas.width = W * ratio; canvas.height = H * ratio; g.setTransform(ratio, 0, 0, ratio, 0, 0);
  g.clearRect(0, 0, W, H);
  // As large as fits however it is turned about the vertical, with room for the labels.
  const beside = Math.min(105, 0.24 * W), high = tall * squeeze * Math.cos(pitch) + across * Math.abs(Math.sin(pitch));
  const k = zoom * Math.min((W - 2 * beside) / across, (H - 56) / high);
  const quads = []; points = [];
  zs.forEach((z, n) => {
    const at = d.values[n].map((v, i) => {
      if (v === null) return null;
      const x = d.x[i % nx], y = d.y[Math.floor(i / nx)], p = place(x, y, z + lift * (v - low) / (high - low || 1));
      const q = [W / 2 + k * p[0], H / 2 + k * p[1], p[2], v]; points.push([q[0], q[1], x, y, z, v, p[2]]); return q;
    });
    for (let j = 0; j + 1 < ny; j++) for (let i = 0; i + 1 < nx; i++) {
      const a = at[j * nx + i], b = at[j * nx + i + 1], c = at[j * nx + nx + i + 1], e = at[j * nx + nx + i];
      if (a && b && c && e) quads.push([a, b, c, e, (a[2] + c[2]) / 2, (a[3] + b[3] + c[3] + e[3]) / 4]);
    }
  });
  quads.sort((m, n) => n[4] - m[4]);
  for (const q of quads) {
    g.beginPath(); g.moveTo(q[0][0], q[0][1]); for (let i = 1; i < 4; i++) g.lineTo(q[i][0], q[i][1]); g.closePath();
    g.fillStyle = g.strokeStyle = colour(q[5]); g.fill(); g.stroke();
  }
  label(W, H, k);
}
// Planes, their heights at the right, X and Y at the corners of the lowest; the hindmost corner is behind the surfaces.
function label(W, H, k) {
  const style = getComputedStyle(document.documentElement), ink = style.getPropertyValue("--ink"), card = style.getPropertyValue("--card");
  g.font = "12px system-ui, sans-serif"; g.lineJoin = "round"; g.textBaseline = "middle";
  const write = (text, x, y, side) => {
    const wide = g.measureText(text).width;
    x -= side === "left" ? 0 : side === "right" ? wide : wide / 2;
    x = Math.max(3, Math.min(W - wide - 3, x)); y = Math.max(9, Math.min(H - 9, y));
    g.lineWidth = 4; g.strokeStyle = card; g.strokeText(text, x, y); g.fillStyle = ink; g.fillText(text, x, y);
  };
  const corners = [[0, 0], [nx - 1, 0], [nx - 1, ny - 1], [0, ny - 1]];
  zs.forEach((z, n) => {
    const c = corners.map(([i, j]) => place(d.x[i], d.y[j], z)), at = c.map((p) => [W / 2 + k * p[0], H / 2 + k * p[1], p[2]]);
    g.strokeStyle = ink; g.globalAlpha = 0.45; g.lineWidth = 1; g.beginPath();
    at.forEach((p, i) => g[i ? "lineTo" : "moveTo"](p[0], p[1])); g.closePath(); g.stroke(); g.globalAlpha = 1;
    const right = at.reduce((a, b) => (b[0] > a[0] ? b : a)), left = at.reduce((a, b) => (b[0] < a[0] ? b : a));
    const behind = at.reduce((a, b) => (b[2] > a[2] ? b : a));
    write("z " + z + " mm", right[0] + 6, right[1] - 2, "left");
    if (n) return;
    at.forEach((p, i) => {
      if (p === behind) return;
      const side = p === left ? "right" : p === right ? "left" : "middle";
      write("X " + d.x[corners[i][0]] + " Y " + d.y[corners[i][1]], p[0] + (p === left ? -6 : p === right ? 6 : 0), p[1] + 14, side);
    });
  });
}
let held = null;
canvas.addEventListener("pointerdown", (e) => { held = [e.clientX, e.clientY]; canvas.setPointerCapture(e.pointerId); });
canvas.addEventListener("pointerup", () => { held = null; });
canvas.addEventListener("pointermove", (e) => {
  if (held) {
    yaw += (e.clientX - held[0]) / 200; pitch = Math.min(1.57, Math.max(-0.2, pitch + (e.clientY - held[1]) / 200));
    held = [e.clientX, e.clientY]; draw(); return;
  }
  const box = canvas.getBoundingClientRect(), x = e.clientX - box.left, y = e.clientY - box.top;
  let best = null, near = 144;
  for (const p of points) { const r = (p[0] - x) ** 2 + (p[1] - y) ** 2 + 0.001 * p[6]; if (r < near) { near = r; best = p; } }
  if (best) $("said").textContent = "X " + best[2] + " Y " + best[3] + " Z " + best[4] + " mm: " + words(best[5]) + " N/mm";
});
canvas.addEventListener("wheel", (e) => { e.preventDefault(); zoom *= Math.exp(-e.deltaY / 600); draw(); }, { passive: false });
canvas.addEventListener("keydown", (e) => {
  const zooms = { "+": 1.2, "=": 1.2, "-": 1 / 1.2 }[e.key];
  if (zooms) { e.preventDefault(); zoom *= zooms; draw(); return; }
  const turns = { ArrowLeft: [-0.1, 0], ArrowRight: [0.1, 0], ArrowUp: [0, 0.1], ArrowDown: [0, -0.1] }[e.key];
  if (!turns) return; e.preventDefault(); yaw += turns[0]; pitch = Math.min(1.57, Math.max(-0.2, pitch + turns[1])); draw();
});
window.addEventListener("resize", draw); matchMedia("(prefers-color-scheme: dark)").addEventListener("change", draw); draw();
