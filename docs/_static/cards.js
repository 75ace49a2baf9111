// On a narrow screen a table that would be cut shows each row as a card, with the columns' names.
"use strict";

const NARROW = matchMedia("(max-width: 500px)");

function deal() {
  for (const table of document.querySelectorAll("table.docutils")) {
    table.classList.remove("cards");
    const isCut = table.scrollWidth > table.parentElement.clientWidth;
    table.classList.toggle("cards", NARROW.matches && table.tHead !== null && isCut);
  }
}

addEventListener("load", () => {
  for (const { tHead, tBodies } of document.querySelectorAll("table.docutils")) {
    if (!tHead) continue;
    const names = [...tHead.rows[0].cells].map((cell) => cell.textContent.trim());
    for (const { cells } of [...tBodies].flatMap((body) => [...body.rows]))
      [...cells].forEach((cell, i) => { cell.dataset.column = names[i] ?? ""; });
  }
  deal();
});
addEventListener("resize", deal);
