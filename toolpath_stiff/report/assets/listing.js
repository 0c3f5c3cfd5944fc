// ---------------------------------------------------------------- the program; only the rows in sight exist
const ROW = 19;
const listing = document.getElementById("listing"), space = document.getElementById("listing-space");
const source = data.source;
let lineHere = 0;
listing.style.setProperty("--digits", String(source.length).length);
space.style.height = `${source.length * ROW}px`;
document.getElementById("program-note").textContent = `${group(source.length)} lines; the bar is the line's lowest stiffness`;
function drawListing() {
  const first = Math.max(0, Math.floor(listing.scrollTop / ROW) - 5);
  const last = Math.min(source.length, Math.ceil((listing.scrollTop + listing.clientHeight) / ROW) + 5), rows = [];
  for (let i = first; i < last; i++) {
    const row = document.createElement("div"), label = document.createElement("span");
    row.className = i + 1 === lineHere ? "row here" : "row";
    row.style.top = `${i * ROW}px`;
    row.dataset.line = i + 1;
    label.className = "n";
    label.textContent = i + 1;
    const colour = lineColour(i + 1);
    if (colour) label.style.borderLeftColor = colour;
    row.append(label, document.createTextNode(source[i]));
    rows.push(row);
  }
  space.replaceChildren(...rows);
}
function showLine(number) {
  if (number === lineHere) return;
  lineHere = number;
  const top = (number - 1) * ROW;
  if (top < listing.scrollTop || top + ROW > listing.scrollTop + listing.clientHeight)
    listing.scrollTop = top - listing.clientHeight / 2;
  drawListing();
}
listing.addEventListener("scroll", drawListing);
listing.addEventListener("click", (e) => {
  const row = e.target.closest(".row");
  if (row) choose(Number(row.dataset.line));
});
listing.addEventListener("keydown", (e) => {
  const by = { ArrowUp: -1, ArrowDown: 1, PageUp: -20, PageDown: 20 }[e.key];
  if (by === undefined) return;
  choose(Math.max(1, Math.min(source.length, (lineHere || 1) + by)));
  e.preventDefault();
});
new ResizeObserver(drawListing).observe(listing);

// ---------------------------------------------------------------- everything together
readTheme();
const view = new View(), profile = new Profile();
view.resize();
profile.resize();
drawListing();
function retheme() {
  readTheme();
  view.draw();
  profile.draw();
  drawListing();
}
darkQuery.addEventListener("change", retheme);
// Paper is white, whatever the screen is.
addEventListener("beforeprint", () => { root.classList.add("printing"); retheme(); });
addEventListener("afterprint", () => { root.classList.remove("printing"); retheme(); });
rapidsBox.addEventListener("change", () => view.redraw());
for (const button of document.querySelectorAll("[data-view]"))
  button.addEventListener("click", () => view.turnTo(button.dataset.view));
for (const button of document.querySelectorAll("button.place")) button.addEventListener("click", () => {
  chosenLine = Number(button.dataset.line);
  point(Number(button.dataset.sample), view);
  document.getElementById("view-panel").scrollIntoView({ block: "nearest" });
});
function showLegend() {
  const { ends: [low, high], beyond_low, beyond_high } = scaleNow();
  document.getElementById("legend-low").textContent = (beyond_low ? "\u2264 " : "") + group(low);
  document.getElementById("legend-high").textContent = (beyond_high ? "\u2265 " : "") + group(high);
  document.querySelector(".rapid-key").hidden = starts[RAPIDS] === starts[RAPIDS + 1];
  document.getElementById("plunge-key").hidden = starts[PLUNGES] === starts[PLUNGES + 1];
  document.getElementById("out-key").hidden = starts[UNREACHED] === starts[UNREACHED + 1];
  for (const entry of document.querySelectorAll("#profile-key .plunge-key")) entry.hidden = plungesBox.checked;
}
plungesBox.addEventListener("change", () => {
  classify();
  profile.split();
  view.redraw();
  profile.redraw();
  drawListing();
  showLegend();
});
const key = document.getElementById("profile-key");
function addKey(kindOfLine, text) {
  const entry = document.createElement("span");
  entry.className = `key ${kindOfLine}`;
  entry.textContent = text;
  key.append(entry);
}
addKey("", data.machine);
if (other) addKey("second-key", data.other.machine);
if (data.mean !== null) addKey("mean-key", `mean ${group(data.mean)} N/mm`);
if (data.required !== null) addKey("required-key", `required ${group(data.required)} N/mm`);
if (data.scale_with_plunges) addKey("plunge-key", `plunges ${group(data.plunges[0])} to ${group(data.plunges[1])} N/mm`);
showLegend();
