// What the viewer and the profile stand on: figures as text, colours of the page, a pair of stacked canvases.
// Nothing here knows a page: elements, data and what to do when something is pointed at are handed in.

const $ = (id) => document.getElementById(id);
// "45 123": groups of thousands by thin spaces, as in the tables.
function group(v, digits = 0) {
  if (!Number.isFinite(v)) return "-";
  const [integer, fraction] = v.toFixed(digits).split(".");
  return integer.replace(/\B(?=(\d{3})+$)/g, "\u202f") + (fraction ? "." + fraction : "");
}
// Round values from low to high, at most so many steps, and the digits that they need.
function ticks(low, high, most) {
  const rough = (high - low) / Math.max(1, most), power = 10 ** Math.floor(Math.log10(rough));
  const pitch = power * [1, 2, 2.5, 5, 10].find((m) => m * power >= rough), out = [];
  for (let k = Math.ceil(low / pitch); k * pitch <= high; k++) out.push(k * pitch);
  return { values: out, digits: Math.max(0, Math.min(4, Math.ceil(-Math.log10(pitch) + (pitch / power === 2.5 ? 1
    : 0)))) };
}
// First row of an ascending array that is not below `value`.
function rowAt(array, value) {
  let low = 0, high = array.length;
  while (low < high) { const middle = (low + high) >> 1; if (array[middle] < value) low = middle + 1;
    else high = middle; }
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
function ring(g, x, y, radius, colour, width) {
  g.beginPath();
  g.arc(x, y, radius, 0, 2 * Math.PI);
  stroke(g, colour, width);
}
const aligned = (g, textAlign, textBaseline) => Object.assign(g, { textAlign, textBaseline });
// The outline through points [x, y, ...] on the screen, to stroke or fill.
function trace(g, points, close = true) {
  g.beginPath();
  points.forEach(([x, y], i) => g[i ? "lineTo" : "moveTo"](x, y));
  if (close) g.closePath();
}
function fill(g, points, colour) {
  trace(g, points);
  g.fillStyle = g.strokeStyle = colour;
  g.fill();
  g.stroke();
}
// A ring that is seen on any ground.
function mark(g, x, y, radius, colour = ink.accent, width = 2.5) {
  ring(g, x, y, radius, ink.panel, 2 + width);
  ring(g, x, y, radius, colour, width);
}
function stroke(g, colour, width, dash = []) {
  g.setLineDash(dash);
  Object.assign(g, { strokeStyle: colour, lineWidth: width });
  g.stroke();
  g.setLineDash([]);
}
// The colours of the page, light, dark or on paper.
const INKS = { panel: "card", ink: "ink", muted: "muted", line: "line", soft: "soft", accent: "pink", curve: "blue",
  second: "orange", bad: "red", "bad-soft": "pale-red", rapid: "grey", plunge: "slate" };
const ink = {};
const theme = { dark: false };
function watchTheme(changed) {
  const root = document.documentElement, query = matchMedia("(prefers-color-scheme: dark)");
  const read = () => {
    theme.dark = query.matches && !root.classList.contains("printing");
    const style = getComputedStyle(root);
    for (const [name, variable] of Object.entries(INKS)) ink[name] = style.getPropertyValue("--" + variable).trim();
  };
  const again = (printing) => () => {
    if (printing !== undefined) root.classList.toggle("printing", printing);
    read();
    changed();
  };
  read();
  query.addEventListener("change", again());
  // Paper is white, whatever the screen is.
  addEventListener("beforeprint", again(true));
  addEventListener("afterprint", again(false));
}
// The class of a value on a scale of so many colours.
const classAt = (v, [low, high], count) =>
  Math.max(0, Math.min(count - 1, Math.floor((v - low) / (high - low || 1) * count)));
const ramp = (colours) => `linear-gradient(to right, ${colours.join(",")})`;
// A pair of stacked canvases, and a tip over them.
class Stage {
  constructor(element) {
    this.element = element;
    [this.base, this.overlay] = element.querySelectorAll("canvas");
    this.tip = element.querySelector(".tip");
    this.waiting = false;
    const save = document.createElement("button");
    Object.assign(save, { type: "button", className: "save", textContent: "PNG", title: "Save this picture" });
    save.addEventListener("click", () => this.save());
    element.append(save);
    new ResizeObserver(() => this.resize()).observe(element);
  }
  resize() {
    this.width = this.element.clientWidth;
    this.height = this.element.clientHeight;
    const scale = devicePixelRatio || 1;
    for (const canvas of [this.base, this.overlay]) {
      canvas.width = Math.max(1, Math.round(this.width * scale));
      canvas.height = Math.max(1, Math.round(this.height * scale));
      canvas.getContext("2d").setTransform(scale, 0, 0, scale, 0, 0);
    }
    this.resized();
    this.draw();
    this.drawOverlay();
  }
  resized() {}
  redraw(coarse = false) {
    this.coarse = coarse;
    if (this.waiting) return;
    this.waiting = true;
    requestAnimationFrame(() => { this.waiting = false; this.draw(); this.drawOverlay(); });
  }
  clear(canvas) {
    const g = canvas.getContext("2d");
    g.clearRect(0, 0, this.width, this.height);
    g.lineJoin = g.lineCap = "round";
    g.font = "12px system-ui, 'DejaVu Sans', sans-serif";
    return g;
  }
  // The picture as it stands, as a file.
  save() {
    const picture = document.createElement("canvas"), link = document.createElement("a");
    [picture.width, picture.height] = [this.base.width, this.base.height];
    const g = picture.getContext("2d");
    g.fillStyle = ink.panel;
    g.fillRect(0, 0, picture.width, picture.height);
    for (const canvas of [this.base, this.overlay]) g.drawImage(canvas, 0, 0);
    Object.assign(link, { href: picture.toDataURL(), download: `${document.title.split(":")[0]}.png` });
    link.click();
  }
  // A tip beside a place; without lines there is none.
  tell([x, y], lines) {
    const tip = this.tip;
    tip.hidden = !lines;
    if (!lines) return;
    tip.textContent = lines.join("\n");
    const left = x + 18 + tip.offsetWidth > this.width ? x - 18 - tip.offsetWidth : x + 18;
    tip.style.left = Math.max(0, left) + "px";
    tip.style.top = Math.max(0, Math.min(this.height - tip.offsetHeight, y + 14)) + "px";
  }
}
