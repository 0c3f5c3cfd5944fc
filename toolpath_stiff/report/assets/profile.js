// The one profile: stiffness along the path. A model says what there is:
//   s              ascending path lengths, mm; rows are counted along it
//   value(i)       what a row is marked at, nan: at the bottom
//   curves()       [{ s, k, colour }], drawn in this order; the axis holds them all
//   beside()       { k, colour } of rows that do not set the axis, or null
//   levels()       [{ value, colour, dash, held }]; those held are on the axis always
//   ends()         of the axis where nothing is in sight
// and, where there is such a thing: shades() [{ holds(i), colour }], rings() rows, marked()
// [first, last] row, here() row, operations { count, range(k), name(k), chosen() }.
// It calls on.point(i), on.step(by) and on.operation(i).

class Profile extends Stage {
  constructor(element, model, on = {}) {
    super(element);
    this.model = model;
    this.on = on;
    this.strip = model.operations?.count > 1 ? 18 : 0;  // operations above the frame
    this.pad = { left: 66, right: 24, top: 20 + this.strip, bottom: 34 };
    this.all();
    this.listen();
  }
  get last() { return this.model.s[this.model.s.length - 1]; }
  all() { this.show(this.model.s[0], this.last); }
  show(from, to) { this.from = from; this.to = to > from ? to : from + 1; }
  get right() { return this.width - this.pad.right; }
  get bottom() { return this.height - this.pad.bottom; }
  get wide() { return this.right - this.pad.left; }
  x(value) { return this.pad.left + (value - this.from) / (this.to - this.from) * this.wide; }
  y(value) { return this.bottom - (value - this.low) / (this.high - this.low) * (this.bottom - this.pad.top); }
  at(i) {
    const k = this.model.value(i), y = Number.isNaN(k) ? this.bottom : this.y(k);
    return [this.x(this.model.s[i]), Math.max(this.pad.top, Math.min(this.bottom, y))];
  }
  draw() {
    const g = this.clear(this.base), { model } = this;
    this.setHeights();
    const { left, top } = this.pad, { right, bottom } = this;
    const within = (paint) => {
      g.save();
      g.beginPath();
      g.rect(left, top, right - left, bottom - top);
      g.clip();
      paint();
      g.restore();
    };
    within(() => model.shades?.().forEach(({ holds, colour }) => this.shade(g, holds, colour, top, bottom)));
    this.drawScales(g, left, right, top, bottom);
    within(() => {
      for (const { value, colour, dash } of model.levels()) this.level(g, value, colour, dash);
      const beside = model.beside();
      if (beside) {
        g.setLineDash([2, 2]);
        this.curve(g, model.s, beside.k, beside.colour);
        g.setLineDash([]);
      }
      for (const { s, k, colour } of model.curves()) this.curve(g, s, k, colour);
      for (const i of model.rings?.() ?? []) mark(g, ...this.at(i), 5, ink.ink, 1.6);
    });
    if (this.strip) this.drawOperations(g, left, right, top);
  }
  setHeights() {
    let low = Infinity, high = -Infinity;
    const see = (at, k) => {
      for (let i = rowAt(at, this.from); i < at.length && at[i] <= this.to; i++) {
        if (k[i] < low) low = k[i];
        if (k[i] > high) high = k[i];
      }
    };
    const beside = this.model.beside();
    for (const { s, k } of this.model.curves()) see(s, k);
    if (low > high && beside) see(this.model.s, beside.k);  // nothing else is in sight
    if (low > high) [low, high] = this.model.ends();
    const held = this.model.levels().filter((level) => level.held).map(({ value }) => value);
    [low, high] = [Math.min(low, ...held), Math.max(high, ...held)];
    const pad = Math.max((high - low) * 0.1, high * 0.002);
    this.low = low - pad;
    this.high = high + pad;
  }
  shade(g, holds, colour, top, bottom) {
    const { s } = this.model;
    g.fillStyle = colour;
    for (let i = 0; i < s.length; i++) if (holds(i)) {
      const start = i;
      while (i + 1 < s.length && holds(i + 1)) i++;
      g.fillRect(this.x(s[start]), top, Math.max(0.5, this.x(s[i]) - this.x(s[start])), bottom - top);
    }
  }
  drawScales(g, left, right, top, bottom) {
    Object.assign(g, { lineWidth: 1, strokeStyle: ink.line, fillStyle: ink.muted });
    aligned(g, "right", "middle");
    const up = ticks(this.low, this.high, 5), across = ticks(this.from, this.to, (right - left) / 110);
    for (const value of up.values) {
      trace(g, [[left, this.y(value)], [right, this.y(value)]], false);
      g.stroke();
      if (this.y(value) > top + 9) g.fillText(group(value, up.digits), left - 6, this.y(value));  // clear of the unit
    }
    aligned(g, "center", "top");
    for (const value of across.values) g.fillText(group(value, across.digits), this.x(value), bottom + 5);
    g.strokeRect(left, top, right - left, bottom - top);
    aligned(g, "left", "bottom");
    g.fillText(this.model.unit?.() ?? "N/mm", 4, top - 2);
    g.textAlign = "right";
    g.fillText("path length, mm (rapids included)", right, this.height - 2);
  }
  drawOperations(g, left, right, top) {
    const { s, operations } = this.model;
    aligned(g, "left", "middle");
    g.lineWidth = 1;
    g.strokeStyle = ink.line;
    let last = -Infinity;
    for (let k = 0; k < operations.count; k++) {
      const [first, end] = operations.range(k);
      if (end === first) continue;
      const a = Math.max(left, this.x(s[first])), b = Math.min(right, this.x(s[Math.min(end, s.length - 1)]));
      if (b < left || a > right || b - last < 1) continue;  // more than the pixels can tell apart
      last = b;
      const chosen = k === operations.chosen();
      g.fillStyle = chosen ? ink.accent : k % 2 ? ink.line : ink.soft;
      g.globalAlpha = chosen ? 0.35 : 1;
      g.fillRect(a, top - this.strip, b - a, this.strip - 1);
      Object.assign(g, { globalAlpha: 1, fillStyle: ink.ink });
      const name = operations.name(k), letters = name.length * (b - a - 8) / g.measureText(name).width;
      if (letters >= 2) g.fillText(name.slice(0, letters), a + 4, top - this.strip / 2);
    }
  }
  level(g, value, colour, dash) {
    trace(g, [[this.pad.left, this.y(value)], [this.right, this.y(value)]], false);
    stroke(g, colour, 1.1, dash);
  }
  // Of the rows in one column of pixels the first, lowest, highest and last are drawn: no extreme is lost.
  curve(g, at, k, colour) {
    const first = Math.max(0, rowAt(at, this.from) - 1), end = Math.min(at.length, rowAt(at, this.to) + 1);
    g.beginPath();
    let open = false;
    for (let i = first; i < end;) {
      if (Number.isNaN(k[i])) { open = false; i++; continue; }
      const column = Math.floor(this.x(at[i]));
      let j = i, low = i, high = i;
      while (j + 1 < end && !Number.isNaN(k[j + 1]) && Math.floor(this.x(at[j + 1])) === column) {
        j++;
        if (k[j] < k[low]) low = j;
        if (k[j] > k[high]) high = j;
      }
      for (const row of low < high ? [i, low, high, j] : [i, high, low, j]) {
        if (open) g.lineTo(this.x(at[row]), this.y(k[row])); else g.moveTo(this.x(at[row]), this.y(k[row]));
        open = true;
      }
      i = j + 1;
    }
    stroke(g, colour, 1.5);
  }
  drawOverlay() {
    const g = this.clear(this.overlay), marked = this.model.marked?.(), here = this.model.here?.() ?? -1;
    const { left, top } = this.pad, { right, bottom } = this;
    g.fillStyle = ink.accent;
    if (marked) {
      g.globalAlpha = 0.3;
      const [from, to] = marked.map((row) => Math.max(left, Math.min(right, this.x(this.model.s[row]))));
      g.fillRect(from - 1, top, to - from + 2, bottom - top);
      g.globalAlpha = 1;
    }
    if (here < 0) return;
    const [x, y] = this.at(here);
    if (x < left - 1 || x > right + 1) return;
    g.fillRect(x - 0.5, top, 1, bottom - top);
    mark(g, x, y, 4);
  }
  under(x) { return this.from + (x - this.pad.left) / this.wide * (this.to - this.from); }
  rowUnder(x) {
    const { s } = this.model, value = this.under(x), i = Math.min(s.length - 1, rowAt(s, value));
    return i > 0 && value - s[i - 1] < s[i] - value ? i - 1 : i;
  }
  zoomAt(factor, x) {
    const whole = Math.max(this.last - this.model.s[0], 1), fixed = this.under(x), before = this.to - this.from;
    const span = Math.max(whole * 1e-5, Math.min(whole, before / factor));
    this.slide(fixed - (fixed - this.from) * span / before, span);
  }
  slide(from, span = this.to - this.from) {
    const first = this.model.s[0], last = Math.max(this.last, first + span);
    this.from = Math.max(first, Math.min(last - span, from));
    this.to = this.from + span;
    this.redraw();
  }
  listen() {
    const canvas = this.overlay;
    canvas.addEventListener("pointerdown", (e) => canvas.setPointerCapture(e.pointerId));
    canvas.addEventListener("click", (e) => {
      if (this.strip && e.offsetY < this.pad.top && e.offsetY >= this.pad.top - this.strip) this.on.operation?.(
        this.rowUnder(e.offsetX));
    });
    canvas.addEventListener("pointermove", (e) => {
      if (e.buttons) this.slide(this.from - e.movementX / this.wide * (this.to - this.from));
      else this.on.point?.(this.rowUnder(e.offsetX));
    });
    canvas.addEventListener("pointerleave", () => { this.tip.hidden = true; });
    canvas.addEventListener("dblclick", (e) => { if (e.offsetY >= this.pad.top) { this.all(); this.redraw(); } });
    canvas.addEventListener("wheel", (e) => {
      e.preventDefault();
      this.zoomAt(Math.exp(-Math.max(-120, Math.min(120, e.deltaY)) * 0.003), e.offsetX);
    }, { passive: false });
    canvas.addEventListener("keydown", (e) => {
      const here = this.model.here?.() ?? -1, middle = here < 0 ? this.width / 2 : this.at(here)[0];
      if (e.key === "ArrowLeft") this.on.step?.(e.shiftKey ? -20 : -1);
      else if (e.key === "ArrowRight") this.on.step?.(e.shiftKey ? 20 : 1);
      else if (e.key === "Home") this.on.point?.(0);
      else if (e.key === "End") this.on.point?.(this.model.s.length - 1);
      else if (e.key === "+" || e.key === "=") this.zoomAt(1.3, middle);
      else if (e.key === "-") this.zoomAt(1 / 1.3, middle);
      else return;
      e.preventDefault();
    });
  }
}
