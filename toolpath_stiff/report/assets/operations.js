
// ---------------------------------------------------------------- one operation alone: in the path, in the profile
const operationRows = [...document.querySelectorAll("[data-operation]")], operationShown = document.getElementById("operation-shown");
function chooseOperation(k) {
  chosenOperation = k === chosenOperation ? -1 : k;
  for (const row of operationRows) row.closest("tr").classList.toggle("chosen", Number(row.dataset.operation) === chosenOperation);
  operationShown.hidden = chosenOperation < 0;
  if (chosenOperation < 0) profile.all();
  else {
    const [first, end] = operationRange(chosenOperation);
    operationShown.textContent = `\u2715 only ${operationName(chosenOperation)}`;
    if (end > first) {
      profile.show(s[first], s[end - 1]);
      showLine(operations[chosenOperation][2]);
    }
  }
  view.fit();
  view.redraw();
  profile.redraw();
}
for (const row of operationRows) row.addEventListener("click", () => {
  chooseOperation(Number(row.dataset.operation));
  if (chosenOperation >= 0) document.getElementById("view-panel").scrollIntoView({ block: "nearest" });
});
operationShown.addEventListener("click", () => chooseOperation(chosenOperation));
