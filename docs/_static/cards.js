// A table that would be cut shows each row as a card, with the columns' names.
"use strict";

function deal() {
  for (const table of document.querySelectorAll("table.docutils")) {
    table.classList.remove("cards");
    const isCut = table.scrollWidth > table.parentElement.clientWidth;
    table.classList.toggle("cards", table.tHead !== null && isCut);
  }
}

addEventListener("load", () => {
  for (const table of document.querySelectorAll("table.docutils")) {
    if (!table.tHead) continue;
    // A screen reader forgets what these are once they are shown as blocks.
    table.setAttribute("role", "table");
    const names = [...table.tHead.rows[0].cells].map((cell) => cell.textContent.trim());
    table.tHead.rows[0].setAttribute("role", "row");
    for (const cell of table.tHead.rows[0].cells) cell.setAttribute("role", "columnheader");
    for (const row of [...table.tBodies].flatMap((body) => [...body.rows])) {
      row.setAttribute("role", "row");
      [...row.cells].forEach((cell, i) => {
        cell.setAttribute("role", "cell");
        cell.dataset.column = names[i] ?? "";
      });
    }
  }
  deal();
});
addEventListener("resize", deal);
