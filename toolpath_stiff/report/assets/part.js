// The finished part: walls and floors coloured by the error of their surface; it turns with the path.
const errors = data.part, corners = new Uint16Array(bytes(errors.corners)), made = new Int32Array(bytes(errors.sample));
const errorOf = unpack(errors.error, errors.error_range), quadCount = made.length;
const whereOf = new Float32Array(2 * quadCount);
const errorColour = (e) => (Number.isNaN(e) ? ink.soft : errors.colours[Math.max(0, Math.min(CLASSES - 1,
  Math.floor((e / errors.limit + 1) / 2 * CLASSES)))]);
const cornerOf = (q, c) => [0, 1, 2].map((axis) => {
  const [low, high] = errors.frame[axis];
  return low + corners[12 * q + 3 * c + axis] / 65535 * (high - low);
});
const partScene = {
  heavy: quadCount > 8000,
  box: () => errors.frame,
  draw(g, viewer) {
    const order = new Array(quadCount), depth = new Float32Array(quadCount), seen = new Float32Array(8 * quadCount);
    for (let q = 0; q < quadCount; q++) {
      order[q] = q;
      for (let c = 0; c < 4; c++) {
        const [x, y, near] = viewer.project(cornerOf(q, c));
        seen[8 * q + 2 * c] = x;
        seen[8 * q + 2 * c + 1] = y;
        whereOf[2 * q] = (c ? whereOf[2 * q] : 0) + x / 4;
        whereOf[2 * q + 1] = (c ? whereOf[2 * q + 1] : 0) + y / 4;
        depth[q] += near;
      }
    }
    order.sort((a, b) => depth[a] - depth[b]);
    g.lineWidth = 0.8;
    for (const q of order) {
      g.beginPath();
      for (let c = 0; c < 4; c++) g[c ? "lineTo" : "moveTo"](seen[8 * q + 2 * c], seen[8 * q + 2 * c + 1]);
      g.closePath();
      g.fillStyle = g.strokeStyle = errorColour(errorOf[q]);
      g.fill();
      g.stroke();
    }
  },
  overlay(g) {
    if (here < 0) return;
    const [x, y] = part.project(xyz.map((axis) => axis[here]));
    ring(g, x, y, 5, ink.panel, 5);
    ring(g, x, y, 5, ink.accent, 2.5);
  },
  // The quadrangle whose middle is nearest; of its error the tip tells, of its sample path, profile and program.
  nearest(x, y) {
    let best = 20 * 20, found = -1;
    for (let q = 0; q < quadCount; q++) {
      const d = (whereOf[2 * q] - x) ** 2 + (whereOf[2 * q + 1] - y) ** 2;
      if (d < best && made[q] >= 0) { best = d; found = q; }
    }
    return found;
  },
};
function pointPart(q) {
  point(q < 0 ? -1 : made[q]);
  if (q < 0) return;
  const e = errorOf[q], text = Number.isNaN(e) ? "no error is known"
    : `${e > 0 ? "+" : ""}${e.toFixed(1)} um, ${e > 0 ? "material left" : "cut too deep"}`;
  part.tell([whereOf[2 * q], whereOf[2 * q + 1]], [`line ${line[made[q]]} \u00b7 ${text}`]);
}
part = new Viewer(document.getElementById("part"), partScene, {
  point: pointPart,
  pick: (q) => { chosenLine = q < 0 ? 0 : line[made[q]]; pointPart(q); },
  moved: (viewer) => turnAlike(viewer, view),
});
view.on.moved = (viewer) => turnAlike(viewer, part);
function turnAlike({ yaw, pitch }, other) {
  if (other.yaw === yaw && other.pitch === pitch) return;
  Object.assign(other, { yaw, pitch });
  other.settle();
}
document.getElementById("error-ramp").style.background = ramp(errors.colours);
document.getElementById("error-low").textContent = `\u2264 ${group(-errors.limit, 1)}`;
document.getElementById("error-high").textContent = `\u2265 +${group(errors.limit, 1)}`;
part.resize();
