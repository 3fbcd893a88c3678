"use strict";
// A column's heading sorts the rows by it; a second press turns the order round.

const table = document.querySelector("table[data-sorts]");
const heads = [...table.tHead.rows[0].cells];

function value(row, column) {
  const cell = row.cells[column];
  const number = cell.querySelector("data");
  if (!number) return cell.textContent.trim();
  return number.value === "null" ? NaN : Number(number.value);
}

// What is unknown stands last, whichever way round.
function compare(a, b, sign) {
  if (typeof a === "string") return sign * a.localeCompare(b, "en", { numeric: true });
  if (Number.isNaN(a) || Number.isNaN(b)) return Number.isNaN(a) - Number.isNaN(b);
  return sign * (a - b);
}

function sort(column) {
  const down = heads[column].getAttribute("aria-sort") === "ascending";
  heads.forEach((head) => head.removeAttribute("aria-sort"));
  heads[column].setAttribute("aria-sort", down ? "descending" : "ascending");
  const rows = [...table.tBodies[0].rows];
  rows.sort((a, b) => compare(value(a, column), value(b, column), down ? -1 : 1));
  table.tBodies[0].append(...rows);
}

heads.forEach((head, column) => {
  const button = document.createElement("button");
  button.type = "button";
  button.append(...head.childNodes);
  button.addEventListener("click", () => sort(column));
  head.append(button);
});
