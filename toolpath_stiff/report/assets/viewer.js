// The one viewer of what lies in the machine's space: an orthographic camera that turns, shifts and zooms, and a scene
// that says what there is. Lengths are in mm; depth needs no graphics driver, all is drawn on a 2-D canvas.
//
// A scene has
//   box()                [low, high] of X, Y and Z that the view is fitted to
//   outline()            points that it is fitted to instead (where there are any)
//   paths                `Path`s, which the viewer projects before anything is drawn
//   iso                  yaw and pitch of its slanting view (VIEWS.iso where it is absent)
//   room                 pixels above and below what it is fitted to; beside: at both sides together
//   squeeze              factor on heights (1 where it is absent)
//   draw(g, viewer)      whatever it draws, below the axes
//   overlay(g, viewer)   what changes with the pointer
//   nearest(x, y, viewer) what is at a place of the screen, -1 where there is nothing
//   heavy                whether it is drawn coarsely while it is turned
//   frame                false: neither box nor the figures of its ends
// and the viewer calls on.point(i), on.pick(i), on.step(by), on.enter() and on.moved(viewer) where they are given.

const VIEWS = { iso: [30, 32], top: [0, 90], front: [0, 0], side: [90, 0] };  // yaw and pitch, degrees
class Viewer extends Stage {
  constructor(element, scene, on = {}) {
    super(element);
    this.scene = scene;
    this.on = on;
    [this.yaw, this.pitch] = scene.iso ?? VIEWS.iso;
    for (const button of document.querySelectorAll("[data-view]")) button.addEventListener("click",
      () => this.turnTo(button.dataset.view));
    this.listen();
  }
  // Unit vectors to the right and up on the screen, and towards whoever looks.
  axes() {
    if (this.turned?.yaw === this.yaw && this.turned.pitch === this.pitch) return this.turned.axes;
    const a = this.yaw * Math.PI / 180, p = this.pitch * Math.PI / 180;
    const [sa, ca, sp, cp] = [Math.sin(a), Math.cos(a), Math.sin(p), Math.cos(p)];
    const axes = [[ca, sa, 0], [-sa * sp, ca * sp, cp], [sa * cp, -ca * cp, sp]];
    this.turned = { yaw: this.yaw, pitch: this.pitch, axes };
    return axes;
  }
  // x and y on the screen, and how near it is.
  project([x, y, z]) {
    const [r, u, d] = this.axes(), [mx, my, mz] = this.middle, h = (z - mz) * (this.scene.squeeze ?? 1);
    return [this.cx + this.zoom * ((x - mx) * r[0] + (y - my) * r[1]),
      this.cy - this.zoom * ((x - mx) * u[0] + (y - my) * u[1] + h * u[2]),
      (x - mx) * d[0] + (y - my) * d[1] + h * d[2]];
  }
  holds([x, y]) { return x > 0 && x < this.width && y > 0 && y < this.height; }
  fit() {
    this.box = this.scene.box();
    this.middle = this.box.map(([low, high]) => (low + high) / 2);
    this.zoom = 1;
    this.cx = this.cy = 0;
    const seen = (this.scene.outline?.() ?? cornersOf(this.box)).map((corner) => this.project(corner));
    const [[left, right], [top, bottom]] = [0, 1].map((k) => [Math.min(...seen.map((p) => p[k])),
      Math.max(...seen.map((p) => p[k]))]), wide = right - left, tall = bottom - top;
    const beside = Math.min(this.scene.beside ?? 90, 0.45 * this.width), [above, below] = this.scene.room
      ?? (this.scene.frame === false ? [12, 12] : [35, 35]);
    this.zoom = Math.max(1e-6, Math.min((this.width - beside) / Math.max(wide, 1e-3),
      (this.height - above - below) / Math.max(tall, 1e-3)));
    this.cx = this.width / 2 - this.zoom * (left + right) / 2;
    this.cy = (this.height + above - below) / 2 - this.zoom * (top + bottom) / 2;
  }
  resized() { this.fit(); }
  turnTo(name) {
    if (name in VIEWS) [this.yaw, this.pitch] = name === "iso" && this.scene.iso || VIEWS[name];
    this.fit();
    this.redraw();
    this.on.moved?.(this);
  }
  // Look from where another viewer looks, as near unless it is said how near.
  follow(other, zoom = other.zoom) {
    if (this.yaw === other.yaw && this.pitch === other.pitch && this.zoom === zoom) return;
    [this.yaw, this.pitch, this.zoom] = [other.yaw, other.pitch, zoom];
    this.settle();
  }
  draw() {
    if (!this.middle) return;
    const g = this.clear(this.base);
    for (const path of this.scene.paths ?? []) path.project(this);
    if (this.scene.frame !== false) this.edges(g, this.box, ink.line, 1);
    this.scene.draw(g, this);
    if (this.scene.frame !== false) this.drawBox(g);
    this.drawTriad(g);
    this.scene.label?.(g, this);
  }
  drawOverlay() {
    const g = this.clear(this.overlay);
    if (this.middle) this.scene.overlay?.(g, this);
  }
  drawBox(g) {
    g.fillStyle = ink.muted;
    aligned(g, "left", "top");
    const text = this.box.map(([low, high], axis) => `${"XYZ"[axis]} ${low.toFixed(1)} to ${high.toFixed(1)}`)
      .join("    ");
    g.fillText(`${text}  mm`, 4, 4, this.width - 8);
  }
  // The twelve edges of a box.
  edges(g, box, colour, width, dash = []) {
    const corners = cornersOf(box).map((corner) => this.project(corner));
    g.beginPath();
    for (let c = 0; c < 8; c++) for (const bit of [1, 2, 4]) if (!(c & bit)) {
      g.moveTo(corners[c][0], corners[c][1]);
      g.lineTo(corners[c | bit][0], corners[c | bit][1]);
    }
    stroke(g, colour, width, dash);
  }
  drawTriad(g) {
    const [r, u] = this.axes(), x0 = 46, y0 = this.height - 46;
    aligned(g, "center", "middle");
    g.fillStyle = ink.ink;
    ["X", "Y", "Z"].forEach((name, axis) => {
      const dx = r[axis] * 30, dy = -u[axis] * 30;
      if (Math.hypot(dx, dy) < 3) return;
      trace(g, [[x0, y0], [x0 + dx, y0 + dy]], false);
      stroke(g, ink.ink, 1.5);
      g.fillText(name, x0 + dx * 1.3, y0 + dy * 1.3);
    });
  }
  // A label over whatever is there, kept on the canvas.
  write(g, text, x, y, side = "left") {
    const wide = g.measureText(text).width;
    x -= side === "left" ? 0 : side === "right" ? wide : wide / 2;
    x = Math.max(3, Math.min(this.width - wide - 3, x));
    y = Math.max(9, Math.min(this.height - 9, y));
    aligned(g, "left", "middle");
    g.lineWidth = 4;
    g.strokeStyle = ink.panel;
    g.strokeText(text, x, y);
    g.fillStyle = ink.ink;
    g.fillText(text, x, y);
  }
  zoomAt(factor, x, y) {
    this.cx = x + (this.cx - x) * factor;
    this.cy = y + (this.cy - y) * factor;
    this.zoom *= factor;
    this.moved();
  }
  moved() {
    this.settle();
    this.on.moved?.(this);
  }
  settle() {
    this.redraw(this.scene.heavy);
    clearTimeout(this.timer);
    this.timer = setTimeout(() => this.redraw(), 160);
  }
  turn(dx, dy) {
    this.yaw = (this.yaw - dx * 0.4) % 360;
    this.pitch = Math.max(-90, Math.min(90, this.pitch + dy * 0.4));
  }
  listen() {
    const canvas = this.overlay, fingers = new Map();
    let moved = 0, seen = -1;
    canvas.addEventListener("pointerdown", (e) => {
      canvas.setPointerCapture(e.pointerId);
      fingers.set(e.pointerId, e);
      moved = 0;
    });
    canvas.addEventListener("pointermove", (e) => {
      const before = fingers.get(e.pointerId);
      if (!before) {
        const i = this.scene.nearest?.(e.offsetX, e.offsetY, this) ?? -1;
        if (i !== seen) this.on.point?.(i);
        seen = i;
        return;
      }
      const dx = e.clientX - before.clientX, dy = e.clientY - before.clientY;
      moved += Math.abs(dx) + Math.abs(dy);
      fingers.set(e.pointerId, e);
      this.tip.hidden = true;
      if (fingers.size === 2) {
        const other = [...fingers.values()].find((f) => f.pointerId !== e.pointerId);
        const gap = (f) => Math.max(1, Math.hypot(f.clientX - other.clientX, f.clientY - other.clientY));
        this.zoomAt(gap(e) / gap(before), e.offsetX, e.offsetY);
        return;
      }
      if (e.shiftKey || e.buttons & 6) { this.cx += dx; this.cy += dy; } else this.turn(dx, dy);
      this.moved();
    });
    const up = (e) => {
      const down = fingers.delete(e.pointerId);
      if (down && e.type === "pointerup" && moved < 4) this.on.pick?.(this.scene.nearest?.(e.offsetX, e.offsetY, this)
        ?? -1);
    };
    for (const type of ["pointerup", "pointercancel"]) canvas.addEventListener(type, up);
    canvas.addEventListener("pointerleave", () => { this.tip.hidden = true; });
    canvas.addEventListener("contextmenu", (e) => e.preventDefault());
    canvas.addEventListener("dblclick", () => this.turnTo("fit"));
    canvas.addEventListener("wheel", (e) => {
      e.preventDefault();
      this.zoomAt(Math.exp(-Math.max(-120, Math.min(120, e.deltaY)) * 0.002), e.offsetX, e.offsetY);
    }, { passive: false });
    canvas.addEventListener("keydown", (e) => this.key(e));
  }
  key(e) {
    const arrows = { ArrowLeft: [-1, 0], ArrowRight: [1, 0], ArrowUp: [0, -1], ArrowDown: [0, 1] }[e.key];
    const named = { 1: "iso", 2: "top", 3: "front", 4: "side", 0: "fit" }[e.key];
    const zoom = { "+": 1.2, "=": 1.2, "-": 1 / 1.2 }[e.key], along = { ",": -1, ".": 1 }[e.key];
    if (arrows && e.shiftKey) { this.cx += arrows[0] * 30; this.cy += arrows[1] * 30; this.moved(); }
    else if (arrows) { this.turn(arrows[0] * 14, arrows[1] * 14); this.moved(); }
    else if (named) this.turnTo(named);
    else if (zoom) this.zoomAt(zoom, this.width / 2, this.height / 2);
    else if (along && this.on.step) this.on.step(along);
    else if (e.key === "Enter" && this.on.enter) this.on.enter();
    else return;
    e.preventDefault();
  }
}
// The eight corners of [low, high] of X, Y, Z; bit k of a corner's number says which end of axis k.
function cornersOf(box) {
  return [0, 1, 2, 3, 4, 5, 6, 7].map((c) => box.map(([low, high], axis) => ((c >> axis) & 1 ? high : low)));
}
// [low, high] of X, Y and Z of those points that count.
const extentOf = (xyz, counts = () => true) => xyz.map((axis) => axis.reduce((ends, v, i) => (counts(i)
  ? [Math.min(ends[0], v), Math.max(ends[1], v)] : ends), [Infinity, -Infinity]));
// A path: points, and the lines between them by class: of the scale, then rapids, plunges beside it, out of reach.
const RAPIDS = CLASSES, PLUNGES = CLASSES + 1, UNREACHED = CLASSES + 2;
class Path {
  // xyz: three arrays of n coordinates, mm
  constructor(xyz) { this.move(xyz); }
  move(xyz) {
    this.xyz = xyz;
    this.n = xyz[0].length;
    this.sx = new Float32Array(this.n);
    this.sy = new Float32Array(this.n);
  }
  at(i) { return [this.sx[i], this.sy[i]]; }
  // Sort the lines (i - 1, i) by classOf(i), so that each class is one path to stroke; -1 is not drawn at all.
  classify(classOf) {
    const { n, xyz: [X, Y, Z] } = this, count = UNREACHED + 1, starts = new Int32Array(count + 1);
    const of = this.of = new Int16Array(n).fill(-1);
    for (let i = 1; i < n; i++) {
      if (X[i] === X[i - 1] && Y[i] === Y[i - 1] && Z[i] === Z[i - 1]) continue;
      of[i] = classOf(i);
      if (of[i] >= 0) starts[of[i] + 1]++;
    }
    for (let c = 0; c < count; c++) starts[c + 1] += starts[c];
    const segments = new Int32Array(starts[count]), next = starts.slice();
    for (let i = 1; i < n; i++) if (of[i] >= 0) segments[next[of[i]]++] = i;
    Object.assign(this, { starts, segments });
  }
  has(which) { return this.starts[which] < this.starts[which + 1]; }
  project(camera) {
    const { n, sx, sy, xyz: [X, Y, Z] } = this, [r, u] = camera.axes(), [mx, my, mz] = camera.middle, { cx, cy, zoom } =
      camera;
    for (let i = 0; i < n; i++) {
      const x = X[i] - mx, y = Y[i] - my;
      sx[i] = cx + zoom * (x * r[0] + y * r[1]);
      sy[i] = cy - zoom * (x * u[0] + y * u[1] + (Z[i] - mz) * u[2]);
    }
  }
  // All classes: rapids dashed where they are shown, the weakest of the scale last but for what has no colour of it.
  paint(g, { width = 2, skip = 0.5, rapids = true, first = 0, end = this.n } = {}) {
    const some = (which, colour, wide, dash) => this.stroke(g, which, colour, wide, skip, first, end, dash);
    if (rapids) some(RAPIDS, ink.rapid, 1, [5, 4]);
    for (let c = CLASSES - 1; c >= 0; c--) some(c, coloursNow()[c], width);
    some(PLUNGES, ink.plunge, width);
    some(UNREACHED, ink.bad, width + 0.7);
  }
  // Lines of a class between two rows; those shorter than `skip` pixels are joined.
  stroke(g, which, colour, width, skip, first, end, dash) {
    const { sx, sy, segments } = this;
    let last = -2, x = 0, y = 0, pending = -1;
    g.beginPath();
    for (let j = this.starts[which]; j < this.starts[which + 1]; j++) {
      const i = segments[j];
      if (i < first) continue;
      if (i >= end) break;
      if (i - 1 !== last) {
        if (pending >= 0) g.lineTo(sx[pending], sy[pending]);
        x = sx[i - 1];
        y = sy[i - 1];
        g.moveTo(x, y);
      }
      last = i;
      if (Math.abs(sx[i] - x) + Math.abs(sy[i] - y) >= skip) {
        x = sx[i];
        y = sy[i];
        g.lineTo(x, y);
        pending = -1;
      } else pending = i;
    }
    if (pending >= 0) g.lineTo(sx[pending], sy[pending]);
    stroke(g, colour, width, dash);
  }
  nearest(x, y, seen) {
    return nearestOf(this.n, (i) => (this.sx[i] - x) ** 2 + (this.sy[i] - y) ** 2, 15, seen);
  }
}
