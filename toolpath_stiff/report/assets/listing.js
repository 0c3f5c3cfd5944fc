// The text of a program beside its path; only the rows in sight exist. Of a line `on.colour(n)` gives the colour of its
// bar, if it has one, `on.title(n)` what the bar says; `on.choose(n)` hears which was chosen.
const ROW = 19;
class Listing {
  constructor(element, lines, on) {
    Object.assign(this, { element, lines, on, here: 0, space: document.createElement("div") });
    element.style.setProperty("--digits", String(lines.length).length);
    this.space.style.height = `${lines.length * ROW}px`;
    element.replaceChildren(this.space);
    element.addEventListener("scroll", () => this.draw());
    element.addEventListener("click", (e) => {
      const row = e.target.closest(".row");
      if (row) on.choose(Number(row.dataset.line));
    });
    element.addEventListener("keydown", (e) => {
      const by = { ArrowUp: -1, ArrowDown: 1, PageUp: -20, PageDown: 20 }[e.key];
      if (by === undefined) return;
      on.choose(Math.max(1, Math.min(lines.length, (this.here || 1) + by)));
      e.preventDefault();
    });
    new ResizeObserver(() => this.draw()).observe(element);
  }
  draw() {
    const { element, lines, on } = this, first = Math.max(0, Math.floor(element.scrollTop / ROW) - 5), rows = [];
    const last = Math.min(lines.length, Math.ceil((element.scrollTop + element.clientHeight) / ROW) + 5);
    for (let i = first; i < last; i++) {
      const row = document.createElement("div"), label = document.createElement("span");
      row.className = i + 1 === this.here ? "row here" : "row";
      row.style.top = `${i * ROW}px`;
      row.dataset.line = label.textContent = i + 1;
      row.title = on.title?.(i + 1) ?? "";
      label.style.borderLeftColor = on.colour(i + 1) ?? "transparent";
      row.append(label, document.createTextNode(lines[i]));
      rows.push(row);
    }
    this.space.replaceChildren(...rows);
  }
  show(number) {
    const { element } = this, top = (number - 1) * ROW;
    if (number !== this.here && (top < element.scrollTop || top + ROW > element.scrollTop + element.clientHeight))
      element.scrollTop = top - element.clientHeight / 2;
    this.here = number;
    this.draw();
  }
}
