// ---------------------------------------------------------------- stiffness along the path
const STRIP = operations.length > 1 ? 18 : 0;  // operations above the frame
const PAD = { left: 66, right: 12, top: 20 + STRIP, bottom: 34 };
function ticks(low, high, most) {
  const rough = (high - low) / Math.max(1, most), power = 10 ** Math.floor(Math.log10(rough));
  const pitch = power * [1, 2, 2.5, 5, 10].find((m) => m * power >= rough), out = [];
  for (let k = Math.ceil(low / pitch); k * pitch <= high; k++) out.push(k * pitch);
  return { values: out, digits: Math.max(0, Math.min(4, Math.ceil(-Math.log10(pitch) + (pitch / power === 2.5 ? 1 : 0)))) };
}
// First row of an ascending array that is not below `value`.
function rowAt(array, value) {
  let low = 0, high = array.length;
  while (low < high) { const middle = (low + high) >> 1; if (array[middle] < value) low = middle + 1; else high = middle; }
  return low;
}
// The text, cut to so many pixels; if next to nothing of it is left, `least`, or nothing at all.
function fitting(g, text, least, room) {
  if (g.measureText(text).width <= room) return text;
  let length = Math.floor(text.length * room / g.measureText(text).width);
  while (length > least.length + 3 && g.measureText(`${text.slice(0, length)}\u2026`).width > room) length--;
  if (length > least.length + 3) return `${text.slice(0, length).trimEnd()}\u2026`;
  return g.measureText(least).width <= room ? least : "";
}
class Profile extends Stage {
  constructor() {
    super("profile");
    this.k = new Float32Array(n);
    this.plunges = new Float32Array(n);
    if (other) other.curve = new Float32Array(other.k.length);
    this.split();
    this.all();
    this.listen();
  }
  // The curve, and beside it the plunges that neither belong to it nor set the axis.
  split() {
    for (let i = 0; i < n; i++) {
      this.k[i] = cutting(i) && !setAside(i) ? stiffness[i] : NaN;
      this.plunges[i] = setAside(i) ? stiffness[i] : NaN;
    }
    if (other) other.curve.set(other.k.map((k, i) => other.plunge[i] && !plungesBox.checked ? NaN : k));
  }
  all() { this.show(s[0], s[n - 1]); }
  show(from, to) { this.from = from; this.to = to > from ? to : from + 1; }
  x(value) { return PAD.left + (value - this.from) / (this.to - this.from) * (this.width - PAD.left - PAD.right); }
  y(value) { return this.height - PAD.bottom - (value - this.low) / (this.high - this.low) * (this.height - PAD.top - PAD.bottom); }
  at(i) {
    const k = setAside(i) ? this.plunges[i] : this.k[i], bottom = this.height - PAD.bottom;
    return [this.x(s[i]), Number.isNaN(k) ? bottom : Math.max(PAD.top, Math.min(bottom, this.y(k)))];
  }
  draw() {
    const g = this.clear(this.base);
    this.setHeights();
    const left = PAD.left, right = this.width - PAD.right, top = PAD.top, bottom = this.height - PAD.bottom;
    g.save();
    g.beginPath();
    g.rect(left, top, right - left, bottom - top);
    g.clip();
    this.shade(g, (i) => !cutting(i), ink.soft, top, bottom);
    this.shade(g, (i) => cutting(i) && kind[i] & OUT, ink["bad-soft"], top, bottom);
    g.restore();
    this.drawScales(g, left, right, top, bottom);
    g.save();
    g.beginPath();
    g.rect(left, top, right - left, bottom - top);
    g.clip();
    if (data.mean !== null) this.level(g, data.mean, ink.ink, [6, 4]);
    if (data.required !== null) this.level(g, data.required, ink.bad, []);
    if (other) this.curve(g, other.s, other.curve, ink.second);
    g.setLineDash([2, 2]);
    this.curve(g, s, this.plunges, ink.plunge);
    g.setLineDash([]);
    this.drawBeyond(g, top, bottom);
    this.curve(g, s, this.k, ink.curve);
    for (const i of data.weakest) { ring(g, ...this.at(i), 5, ink.panel, 4); ring(g, ...this.at(i), 5, ink.ink, 1.6); }
    g.restore();
    this.drawTools(g, left, right, top);
    if (STRIP) this.drawOperations(g, left, right, top);
  }
  setHeights() {
    let low = Infinity, high = -Infinity;
    const see = (at, k) => {
      for (let i = rowAt(at, this.from); i < at.length && at[i] <= this.to; i++) {
        if (k[i] < low) low = k[i];
        if (k[i] > high) high = k[i];
      }
    };
    see(s, this.k);
    if (other) see(other.s, other.curve);
    if (low > high) see(s, this.plunges);  // nothing else is in sight
    if (low > high) [low, high] = data.scale.ends;
    if (data.required !== null) { low = Math.min(low, data.required); high = Math.max(high, data.required); }
    const pad = Math.max((high - low) * 0.1, high * 0.002);
    this.low = low - pad;
    this.high = high + pad;
  }
  // An arrow wherever plunges leave the axis.
  drawBeyond(g, top, bottom) {
    g.fillStyle = ink.plunge;
    const side = (i) => i < n && s[i] <= this.to ? (this.plunges[i] > this.high) - (this.plunges[i] < this.low) : 0;
    for (let i = rowAt(s, this.from); i < n && s[i] <= this.to; i++) {
      const which = side(i), start = i;
      if (which === 0) continue;
      while (side(i + 1) === which) i++;
      const x = (this.x(s[start]) + this.x(s[i])) / 2;
      const [tip, tail] = which > 0 ? [top + 1, top + 9] : [bottom - 1, bottom - 9];
      g.beginPath();
      g.moveTo(x, tip);
      g.lineTo(x - 4, tail);
      g.lineTo(x + 4, tail);
      g.fill();
    }
  }
  shade(g, holds, colour, top, bottom) {
    g.fillStyle = colour;
    for (let i = 0; i < n; i++) if (holds(i)) {
      const start = i;
      while (i + 1 < n && holds(i + 1)) i++;
      g.fillRect(this.x(s[start]), top, Math.max(0.5, this.x(s[i]) - this.x(s[start])), bottom - top);
    }
  }
  drawScales(g, left, right, top, bottom) {
    g.lineWidth = 1;
    g.strokeStyle = ink.line;
    g.fillStyle = ink.muted;
    g.textBaseline = "middle";
    g.textAlign = "right";
    const up = ticks(this.low, this.high, 5), across = ticks(this.from, this.to, (right - left) / 110);
    for (const value of up.values) {
      g.beginPath();
      g.moveTo(left, this.y(value));
      g.lineTo(right, this.y(value));
      g.stroke();
      if (this.y(value) > top + 9) g.fillText(group(value, up.digits), left - 6, this.y(value));  // clear of the unit
    }
    g.textBaseline = "top";
    g.textAlign = "center";
    for (const value of across.values) g.fillText(group(value, across.digits), this.x(value), bottom + 5);
    g.strokeRect(left, top, right - left, bottom - top);
    g.textAlign = "left";
    g.textBaseline = "bottom";
    g.fillText("N/mm", 4, top - 2);
    g.textAlign = "right";
    g.fillText("path length, mm (rapids included)", right, this.height - 2);
  }
  drawTools(g, left, right, top) {
    g.setLineDash([2, 3]);
    g.lineWidth = 1;
    g.strokeStyle = g.fillStyle = ink.muted;
    g.textAlign = "left";
    g.textBaseline = "bottom";
    let last = -Infinity;
    for (const [start, number] of data.tools) {
      const x = this.x(s[start]);
      if (x < left || x > right) continue;
      g.beginPath();
      g.moveTo(x, top);
      g.lineTo(x, this.height - PAD.bottom);
      if (start > 0) g.stroke();
      if (number && x - last > 28 && x > left + 40 && x < right - 20) { g.fillText(`T${number}`, x, top - 2 - STRIP); last = x; }
    }
    g.setLineDash([]);
  }
  drawOperations(g, left, right, top) {
    g.textAlign = "left";
    g.textBaseline = "middle";
    g.lineWidth = 1;
    g.strokeStyle = ink.line;
    let last = -Infinity;
    operations.forEach((_, k) => {
      const [first, end] = operationRange(k);
      if (end === first) return;
      const a = Math.max(left, this.x(s[first])), b = Math.min(right, end < n ? this.x(s[end]) : this.x(s[n - 1]));
      if (b < left || a > right || b - last < 1) return;  // more than the pixels can tell apart
      last = b;
      g.fillStyle = k === chosenOperation ? ink.accent : k % 2 ? ink.line : ink.soft;
      g.globalAlpha = k === chosenOperation ? 0.35 : 1;
      g.fillRect(a, top - STRIP, b - a, STRIP - 1);
      g.globalAlpha = 1;
      const text = fitting(g, operationName(k), String(k + 1), b - a - 8);
      g.fillStyle = ink.ink;
      if (text) g.fillText(text, a + 4, top - STRIP / 2);
    });
  }
  level(g, value, colour, dash) {
    g.beginPath();
    g.setLineDash(dash);
    g.moveTo(PAD.left, this.y(value));
    g.lineTo(this.width - PAD.right, this.y(value));
    g.strokeStyle = colour;
    g.lineWidth = 1.1;
    g.stroke();
    g.setLineDash([]);
  }
  // Of the samples in one column of pixels the first, lowest, highest and last are drawn: no extreme is lost.
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
    g.strokeStyle = colour;
    g.lineWidth = 1.5;
    g.stroke();
  }
  drawOverlay() {
    const g = this.clear(this.overlay), bottom = this.height - PAD.bottom;
    g.fillStyle = ink.accent;
    if (chosenLine && firstOf.has(chosenLine)) {
      g.globalAlpha = 0.3;
      const start = firstOf.get(chosenLine);
      let end = start;
      while (end + 1 < n && line[end + 1] === chosenLine) end++;
      const a = Math.max(PAD.left, this.x(s[start])), b = Math.min(this.width - PAD.right, this.x(s[end]));
      if (b >= a) g.fillRect(a - 1, PAD.top, b - a + 2, bottom - PAD.top);
      g.globalAlpha = 1;
    }
    if (here < 0) return;
    const [x, y] = this.at(here);
    if (x < PAD.left - 1 || x > this.width - PAD.right + 1) return;
    g.fillRect(x - 0.5, PAD.top, 1, bottom - PAD.top);
    ring(g, x, y, 4, ink.panel, 4);
    ring(g, x, y, 4, ink.accent, 2.5);
  }
  sampleAt(x) {
    const value = this.from + (x - PAD.left) / (this.width - PAD.left - PAD.right) * (this.to - this.from);
    const i = Math.min(n - 1, rowAt(s, value));
    return i > 0 && value - s[i - 1] < s[i] - value ? i - 1 : i;
  }
  zoomAt(factor, x) {
    const [first, last] = [s[0], s[n - 1] > s[0] ? s[n - 1] : s[0] + 1];
    const fixed = this.from + (x - PAD.left) / (this.width - PAD.left - PAD.right) * (this.to - this.from);
    const span = Math.max((last - first) * 1e-5, Math.min(last - first, (this.to - this.from) / factor));
    this.from = Math.max(first, Math.min(last - span, fixed - (fixed - this.from) * span / (this.to - this.from)));
    this.to = this.from + span;
    this.redraw();
  }
  move(by) {
    const span = this.to - this.from, last = Math.max(s[n - 1], s[0] + span);
    this.from = Math.max(s[0], Math.min(last - span, this.from + by));
    this.to = this.from + span;
    this.redraw();
  }
  listen() {
    const canvas = this.overlay;
    canvas.addEventListener("pointerdown", (e) => canvas.setPointerCapture(e.pointerId));
    canvas.addEventListener("click", (e) => {
      if (STRIP && e.offsetY < PAD.top && e.offsetY >= PAD.top - STRIP) chooseOperation(operationOf(this.sampleAt(e.offsetX)));
    });
    canvas.addEventListener("pointermove", (e) => {
      if (e.buttons) this.move(-e.movementX / (this.width - PAD.left - PAD.right) * (this.to - this.from));
      else point(this.sampleAt(e.offsetX), this);
    });
    canvas.addEventListener("pointerleave", () => { this.tip.hidden = true; });
    canvas.addEventListener("dblclick", (e) => { if (e.offsetY >= PAD.top) { this.all(); this.redraw(); } });
    canvas.addEventListener("wheel", (e) => {
      e.preventDefault();
      this.zoomAt(Math.exp(-Math.max(-120, Math.min(120, e.deltaY)) * 0.003), e.offsetX);
    }, { passive: false });
    canvas.addEventListener("keydown", (e) => {
      if (e.key === "ArrowLeft") step(e.shiftKey ? -20 : -1);
      else if (e.key === "ArrowRight") step(e.shiftKey ? 20 : 1);
      else if (e.key === "Home") point(0, this);
      else if (e.key === "End") point(n - 1, this);
      else if (e.key === "+" || e.key === "=") this.zoomAt(1.3, here < 0 ? this.width / 2 : this.at(here)[0]);
      else if (e.key === "-") this.zoomAt(1 / 1.3, here < 0 ? this.width / 2 : this.at(here)[0]);
      else return;
      e.preventDefault();
    });
  }
}
