// A click on a heading sorts by it, a second one the other way round, a third gives the order of the command line back.
const table = document.getElementById("programs");
const body = table.tBodies[0], given = [...body.rows], words = new Intl.Collator("en", { numeric: true });
const value = (row, column) => row.cells[column].dataset.v ?? "";
function compare(one, other, column, numeric) {
  const [a, b] = [value(one, column), value(other, column)];
  return numeric ? Number(a) - Number(b) : words.compare(a, b);
}
for (const button of table.querySelectorAll("thead button")) button.addEventListener("click", () => {
  const heading = button.closest("th"), column = heading.cellIndex, numeric = heading.classList.contains("num");
  const next = { ascending: "descending", descending: null }[heading.getAttribute("aria-sort")];
  for (const other of table.querySelectorAll("[aria-sort]")) other.removeAttribute("aria-sort");
  if (next === null) return body.replaceChildren(...given);
  heading.setAttribute("aria-sort", next ?? "ascending");
  const sign = next ? -1 : 1, known = given.filter((row) => value(row, column) !== "");
  known.sort((one, other) => sign * compare(one, other, column, numeric));
  body.replaceChildren(...known, ...given.filter((row) => value(row, column) === ""));
});
