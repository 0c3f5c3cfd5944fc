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
// The nearest of some points that are seen, -1 where none is within so many pixels; far(i): its distance squared.
function nearestOf(count, far, within, seen = () => true) {
  let best = within * within, found = -1;
  for (let i = 0; i < count; i++) {
    const d = far(i);
    if (d < best && seen(i)) { best = d; found = i; }
  }
  return found;
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
    root.style.setProperty("--scale", ramp(coloursNow()));
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
// Colours of the classes of a scale: of stiffness on light and on dark (viridis, weakest first; its lightest yellow
// does not show on white, nor its darkest violet on black), of errors of a surface (RdYlBu, from cut too deep).
const colours = (text) => text.match(/.{6}/g).map((colour) => `#${colour}`);
const SCALES = {
  light: colours("440154460b5e481769482173472a7a463480433e854046883c4f8a38588c355f8d31678e2e6f8e2b758e287d8e25848e"
    + "228b8d20928c1f9a8a1fa18822a88429af7f32b67a3fbc734ec36b5ec9626ece5881d34d95d840a8db34bddf26d2e21b"),
  dark: colours("3e49893c508b38588c355e8d32658e2f6b8e2d718e2a778e287d8e25838e23898e21908d1f958b1e9c891fa18722a785"
    + "27ad812eb37c38b97742be7150c46a5cc8636ccd5a7ad15189d5489bd93caadc32bddf26cde11ddfe318efe51cfde725"),
  error: colours("3d5ba7426cb04b7db85a8ec1679ec974add183b9d894c7dfa3d3e6b2ddebc3e5f0d1ecf4e0f3f8e9f6e8f2fad6fbfdc7"
    + "fffbb9fff2acfee99dfee090fed283fdc576fdb567fca55df99355f67f4bf46d43ec5c3be44c34db382bd02927c21c27"),
};
const CLASSES = SCALES.light.length, coloursNow = () => SCALES[theme.dark ? "dark" : "light"];
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
    const save = { className: "save", textContent: "PNG", title: "Save this picture", onclick: () => this.save() };
    element.append(Object.assign(document.createElement("button"), save, { type: "button" }));
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
    const picture = this.base.cloneNode(), g = picture.getContext("2d");
    g.fillStyle = ink.panel;
    g.fillRect(0, 0, picture.width, picture.height);
    for (const canvas of [this.base, this.overlay]) g.drawImage(canvas, 0, 0);
    const link = { href: picture.toDataURL(), download: `${document.title.split(":")[0]}.png` };
    Object.assign(document.createElement("a"), link).click();
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
