// The finished part: walls and floors coloured by the error of their surface; it turns with the path.
const errors = data.part, corners = new Uint16Array(bytes(errors.corners)), made = new Int32Array(bytes(errors.sample));
const errorOf = unpack(errors.error, errors.error_range), quadCount = made.length;
const whereOf = new Float32Array(2 * quadCount);
const errorColour = (e) => (Number.isNaN(e) ? ink.soft
  : SCALES.error[classAt(e, [-errors.limit, errors.limit], CLASSES)]);
const cornerOf = (q, c) => [0, 1, 2].map((axis) => {
  const [low, high] = errors.frame[axis];
  return low + corners[12 * q + 3 * c + axis] / 65535 * (high - low);
});
const partScene = {
  heavy: quadCount > 8000,
  box: () => errors.frame,
  draw(g, viewer) {
    const quads = Array.from({ length: quadCount }, (_, q) => [0, 1, 2, 3].map((c) => viewer.project(cornerOf(q, c))));
    const middles = quads.map((seen) => [0, 1, 2].map((k) => seen.reduce((sum, p) => sum + p[k] / 4, 0)));
    middles.forEach(([x, y], q) => whereOf.set([x, y], 2 * q));
    g.lineWidth = 0.8;
    for (const q of [...quads.keys()].sort((a, b) => middles[a][2] - middles[b][2]))
      fill(g, quads[q], errorColour(errorOf[q]));
  },
  overlay(g) {
    if (here >= 0) mark(g, ...part.project(xyz.map((axis) => axis[here])).slice(0, 2), 5);
  },
  // The quadrangle whose middle is nearest; of its error the tip tells, of its sample path, profile and program.
  nearest(x, y) {
    const far = (q) => (whereOf[2 * q] - x) ** 2 + (whereOf[2 * q + 1] - y) ** 2;
    return nearestOf(quadCount, far, 20, (q) => made[q] >= 0);
  },
};
function pointPart(q) {
  point(q < 0 ? -1 : made[q]);
  if (q < 0) return;
  const e = errorOf[q], text = Number.isNaN(e) ? "no error is known"
    : `${e > 0 ? "+" : ""}${e.toFixed(1)} um, ${e > 0 ? "material left" : "cut too deep"}`;
  part.tell([whereOf[2 * q], whereOf[2 * q + 1]], [`line ${line[made[q]]} \u00b7 ${text}`]);
}
part = new Viewer($("part"), partScene, {
  point: pointPart,
  pick: (q) => { chosenLine = q < 0 ? 0 : line[made[q]]; pointPart(q); },
  moved: () => view.follow(part, view.zoom),
});
view.on.moved = () => part.follow(view, part.zoom);
$("error-ramp").style.background = ramp(SCALES.error);
part.resize();
