// The text of a program beside its path; only the rows in sight exist. Of a line `on.colour(n)` gives the colour of its
// bar, if it has one, `on.title(n)` what the bar says; `on.choose(n)` hears which was chosen.
const ROW = 19;
class Listing {
  constructor(element, lines, on) {
    Object.assign(this, { element, lines, on, here: 0, space: h("div", { style: `height:${lines.length * ROW}px` }) });
    element.style.setProperty("--digits", String(lines.length).length);
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
    for (let n = first + 1; n <= last; n++) rows.push(h("div", { class: n === this.here ? "row here" : "row",
      style: `top:${(n - 1) * ROW}px`, "data-line": n, title: on.title?.(n) },
      h("span", { style: `border-left-color:${on.colour(n) ?? "transparent"}` }, n), lines[n - 1]));
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
