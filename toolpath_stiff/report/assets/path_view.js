// ---------------------------------------------------------------- the path in 3-D, orthographic
const rapidsBox = document.getElementById("rapids");
const VIEWS = { iso: [30, 32], top: [0, 90], front: [0, 0], side: [90, 0] };
class View extends Stage {
  constructor() {
    super("view");
    this.yaw = VIEWS.iso[0];
    this.pitch = VIEWS.iso[1];
    this.sx = new Float32Array(n);
    this.sy = new Float32Array(n);
    this.listen();
  }
  axes() {
    const a = this.yaw * Math.PI / 180, p = this.pitch * Math.PI / 180;
    return [[Math.cos(a), Math.sin(a), 0], [-Math.sin(a) * Math.sin(p), Math.cos(a) * Math.sin(p), Math.cos(p)]];
  }
  corners() {
    const out = [];
    for (let c = 0; c < 8; c++) out.push(this.box.map(([low, high], axis) => (c >> axis) & 1 ? high : low));
    return out;
  }
  project([x, y, z]) {
    const [r, u] = this.axes(), [mx, my, mz] = this.middle;
    return [this.cx + this.zoom * ((x - mx) * r[0] + (y - my) * r[1]),
      this.cy - this.zoom * ((x - mx) * u[0] + (y - my) * u[1] + (z - mz) * u[2])];
  }
  // The box of the cuts: of all, or of the operation that is looked at.
  boxShown() {
    if (chosenOperation < 0) return data.box;
    const [first, end] = operationRange(chosenOperation), box = [0, 1, 2].map(() => [Infinity, -Infinity]);
    for (let i = first; i < end; i++) if (cutting(i)) box.forEach((ends, axis) => {
      ends[0] = Math.min(ends[0], xyz[axis][i]);
      ends[1] = Math.max(ends[1], xyz[axis][i]);
    });
    return box[0][0] <= box[0][1] ? box : data.box;
  }
  fit() {
    this.box = this.boxShown();
    this.middle = this.box.map(([low, high]) => (low + high) / 2);
    this.zoom = 1;
    this.cx = this.cy = 0;
    const seen = this.corners().map((corner) => this.project(corner));
    const wide = Math.max(...seen.map((p) => Math.abs(p[0]))) * 2, tall = Math.max(...seen.map((p) => Math.abs(p[1]))) * 2;
    this.zoom = Math.min((this.width - 90) / Math.max(wide, 1e-3), (this.height - 70) / Math.max(tall, 1e-3));
    this.cx = this.width / 2;
    this.cy = this.height / 2;
  }
  resized() { this.fit(); }
  at(i) { return [this.sx[i], this.sy[i]]; }
  turnTo(name) {
    if (name in VIEWS) [this.yaw, this.pitch] = VIEWS[name];
    this.fit();
    this.redraw();
  }
  draw() {
    const g = this.clear(this.base), { sx, sy } = this;
    const [r, u] = this.axes(), [mx, my, mz] = this.middle, zoom = this.zoom;
    const [X, Y, Z] = xyz;
    for (let i = 0; i < n; i++) {
      const x = X[i] - mx, y = Y[i] - my;
      sx[i] = this.cx + zoom * (x * r[0] + y * r[1]);
      sy[i] = this.cy - zoom * (x * u[0] + y * u[1] + (Z[i] - mz) * u[2]);
    }
    this.drawBox(g);
    if (chosenOperation >= 0) {
      g.globalAlpha = 0.13;
      this.drawPath(g, 0, n);
      g.globalAlpha = 1;
    }
    this.drawPath(g, ...(chosenOperation < 0 ? [0, n] : operationRange(chosenOperation)));
    this.drawTriad(g);
    this.drawWeakest(g);
  }
  drawPath(g, first, end) {
    if (rapidsBox.checked) {
      g.setLineDash([5, 4]);
      this.stroke(g, RAPIDS, ink.rapid, 1, first, end);
      g.setLineDash([]);
    }
    for (let c = CLASSES - 1; c >= 0; c--) this.stroke(g, c, colours[c], this.coarse ? 1 : 1.7, first, end);
    this.stroke(g, PLUNGES, ink.plunge, 1.7, first, end);
    this.stroke(g, UNREACHED, ink.bad, 2.4, first, end);
  }
  stroke(g, which, colour, width, first, end) {
    const { sx, sy } = this, skip = this.coarse ? 2.5 : 0.5;
    let last = -2, x = 0, y = 0, pending = -1;
    g.beginPath();
    for (let j = starts[which]; j < starts[which + 1]; j++) {
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
    g.strokeStyle = colour;
    g.lineWidth = width;
    g.stroke();
  }
  drawBox(g) {
    const corners = this.corners().map((corner) => this.project(corner));
    g.beginPath();
    for (let c = 0; c < 8; c++) for (const bit of [1, 2, 4]) if (!(c & bit)) {
      g.moveTo(...corners[c]);
      g.lineTo(...corners[c | bit]);
    }
    g.strokeStyle = ink.line;
    g.lineWidth = 1;
    g.stroke();
    g.fillStyle = ink.muted;
    g.textAlign = "left";
    g.textBaseline = "top";
    const text = this.box.map(([low, high], axis) => `${"XYZ"[axis]} ${low.toFixed(1)} to ${high.toFixed(1)}`).join("    ");
    g.fillText(`${text}  mm`, 4, 4);
  }
  drawTriad(g) {
    const [r, u] = this.axes(), x0 = 46, y0 = this.height - 46;
    g.lineWidth = 1.5;
    g.textBaseline = "middle";
    g.textAlign = "center";
    ["X", "Y", "Z"].forEach((name, axis) => {
      const dx = r[axis] * 30, dy = -u[axis] * 30;
      if (Math.hypot(dx, dy) < 3) return;
      g.strokeStyle = g.fillStyle = ink.ink;
      g.beginPath();
      g.moveTo(x0, y0);
      g.lineTo(x0 + dx, y0 + dy);
      g.stroke();
      g.fillText(name, x0 + dx * 1.3, y0 + dy * 1.3);
    });
  }
  drawWeakest(g) {
    const taken = data.weakest.map((i) => { const [x, y] = this.at(i); return [x - 7, y, 14, 13]; });
    g.textAlign = "left";
    g.textBaseline = "middle";
    for (const i of data.weakest) {
      const [x, y] = this.at(i), text = `line ${line[i]}`, wide = g.measureText(text).width;
      ring(g, x, y, 6, ink.panel, 4);
      ring(g, x, y, 6, ink.ink, 1.6);
      let ty = y - 14;
      while (taken.some(([a, b, w, h]) => Math.abs(b - ty) < h && x + 11 < a + w + 6 && a < x + 11 + wide + 6)) ty += 17;
      taken.push([x + 11, ty, wide, 17]);
      g.globalAlpha = 0.85;
      g.fillStyle = ink.panel;
      g.fillRect(x + 9, ty - 8, wide + 5, 16);
      g.globalAlpha = 1;
      g.fillStyle = ink.ink;
      g.fillText(text, x + 11, ty);
    }
  }
  drawOverlay() {
    const g = this.clear(this.overlay);
    if (chosenLine && firstOf.has(chosenLine)) {
      g.beginPath();
      for (let i = firstOf.get(chosenLine) + 1; i < n; i++) if (line[i] === chosenLine && segmentClass[i] !== 255) {
        g.moveTo(this.sx[i - 1], this.sy[i - 1]);
        g.lineTo(this.sx[i], this.sy[i]);
      }
      g.strokeStyle = ink.accent;
      g.lineWidth = 4;
      g.globalAlpha = 0.75;
      g.stroke();
      g.globalAlpha = 1;
    }
    if (here < 0) return;
    ring(g, ...this.at(here), 5, ink.panel, 5);
    ring(g, ...this.at(here), 5, ink.accent, 2.5);
  }
  nearest(x, y) {
    let best = 15 * 15, found = -1;
    for (let i = 0; i < n; i++) {
      const dx = this.sx[i] - x, dy = this.sy[i] - y, d = dx * dx + dy * dy;
      if (d < best && (cutting(i) || rapidsBox.checked)) { best = d; found = i; }
    }
    return found;
  }
  zoomAt(factor, x, y) {
    this.cx = x + (this.cx - x) * factor;
    this.cy = y + (this.cy - y) * factor;
    this.zoom *= factor;
    this.settle();
  }
  settle() {
    this.redraw(n > 20000);
    clearTimeout(this.timer);
    this.timer = setTimeout(() => this.redraw(), 160);
  }
  listen() {
    const canvas = this.overlay, fingers = new Map();
    let moved = 0;
    canvas.addEventListener("pointerdown", (e) => {
      canvas.setPointerCapture(e.pointerId);
      fingers.set(e.pointerId, e);
      moved = 0;
    });
    canvas.addEventListener("pointermove", (e) => {
      const before = fingers.get(e.pointerId);
      if (!before) { const i = this.nearest(e.offsetX, e.offsetY); if (i !== here) point(i, i < 0 ? null : this); return; }
      const dx = e.clientX - before.clientX, dy = e.clientY - before.clientY;
      moved += Math.abs(dx) + Math.abs(dy);
      fingers.set(e.pointerId, e);
      if (fingers.size === 2) {
        const other = [...fingers.values()].find((f) => f.pointerId !== e.pointerId);
        const gap = (f) => Math.max(1, Math.hypot(f.clientX - other.clientX, f.clientY - other.clientY));
        this.zoomAt(gap(e) / gap(before), e.offsetX, e.offsetY);
      } else if (e.shiftKey || e.buttons & 6) { this.cx += dx; this.cy += dy; } else this.turn(dx, dy);
      this.tip.hidden = true;
      this.settle();
    });
    const up = (e) => {
      const down = fingers.delete(e.pointerId);
      if (down && e.type === "pointerup" && moved < 4) { chosenLine = here < 0 ? 0 : line[here]; point(here, here < 0 ? null : this); }
    };
    for (const type of ["pointerup", "pointercancel"]) canvas.addEventListener(type, up);
    canvas.addEventListener("pointerleave", () => { this.tip.hidden = true; });
    canvas.addEventListener("contextmenu", (e) => e.preventDefault());
    canvas.addEventListener("dblclick", () => this.turnTo("fit"));
    canvas.addEventListener("wheel", (e) => {
      e.preventDefault();
      this.zoomAt(Math.exp(-Math.max(-120, Math.min(120, e.deltaY)) * 0.002), e.offsetX, e.offsetY);
    }, { passive: false });
    canvas.addEventListener("keydown", (e) => {
      const arrows = { ArrowLeft: [-1, 0], ArrowRight: [1, 0], ArrowUp: [0, -1], ArrowDown: [0, 1] }[e.key];
      const named = { 1: "iso", 2: "top", 3: "front", 4: "side", 0: "fit" }[e.key];
      if (arrows && e.shiftKey) { this.cx += arrows[0] * 30; this.cy += arrows[1] * 30; this.settle(); }
      else if (arrows) { this.turn(arrows[0] * 14, arrows[1] * 14); this.settle(); }
      else if (named) this.turnTo(named);
      else if (e.key === "+" || e.key === "=") this.zoomAt(1.2, this.width / 2, this.height / 2);
      else if (e.key === "-") this.zoomAt(1 / 1.2, this.width / 2, this.height / 2);
      else if (e.key === ",") step(-1);
      else if (e.key === ".") step(1);
      else return;
      e.preventDefault();
    });
  }
  turn(dx, dy) {
    this.yaw = (this.yaw - dx * 0.4) % 360;
    this.pitch = Math.max(-90, Math.min(90, this.pitch + dy * 0.4));
  }
}
