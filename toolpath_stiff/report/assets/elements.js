const SVG = new Set(["svg", "path", "circle", "line", "text", "g", "polyline", "polygon", "title", "rect"]);
// An element with attributes, listeners (on...) and children; text is never taken for HTML.
function h(tag, attributes = {}, ...children) {
  const element = SVG.has(tag) ? document.createElementNS("http://www.w3.org/2000/svg", tag)
    : document.createElement(tag);
  for (const [name, value] of Object.entries(attributes)) {
    if (value === null || value === undefined || value === false) continue;
    if (name.startsWith("on")) element.addEventListener(name.slice(2), value);
    else if (name === "value" || name === "checked" || name === "disabled") element[name] = value;
    else element.setAttribute(name, value === true ? "" : value);
  }
  element.append(...children.flat(9).filter((c) => c !== null && c !== undefined && c !== false));
  return element;
}
// Lines across a drawing at some values, from a to b on the other axis, with their figures.
function grid({ values, digits }, vertical, at, a, b) {
  return values.map(at).map((x, k) => [h("line", vertical ? { x1: x, x2: x, y1: a, y2: b, class: "grid" }
    : { x1: a, x2: b, y1: x, y2: x, class: "grid" }), h("text", vertical ? { x, y: b + 16, "text-anchor": "middle" }
    : { x: a - 6, y: x + 4, "text-anchor": "end" }, group(values[k], digits))]);
}
