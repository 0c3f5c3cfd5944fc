// Below each picture a link that saves it under its name.
for (const { dataset, firstElementChild, nextElementSibling } of document.querySelectorAll(".picture")) {
  const link = { textContent: "PNG", title: "Save this picture", href: firstElementChild.src, download: dataset.file };
  nextElementSibling.append(" ", Object.assign(document.createElement("a"), link));
}
