"use strict";
// Clicks on an image, as the words of a command; pixels are counted from the middle of the first one.

const still = document.getElementById("still");
const marks = document.getElementById("marks");
const glass = document.getElementById("glass");
const command = document.getElementById("command");
const ZOOM = 8;
const LEAST = Number(command.dataset.least), MOST = Number(command.dataset.most);
let ends = [];
let last = 0;

function pixel(event) {
  const box = still.getBoundingClientRect();
  const scale = still.naturalWidth / box.width;
  return [(event.clientX - box.left) * scale - 0.5, (event.clientY - box.top) * scale - 0.5];
}

function distance(one, other) { return Math.hypot(one[0] - other[0], one[1] - other[1]); }

function cross(context, [u, v], size) {
  context.beginPath();
  context.moveTo(u - size, v); context.lineTo(u + size, v);
  context.moveTo(u, v - size); context.lineTo(u, v + size);
  context.stroke();
}

function magnify([u, v]) {
  const context = glass.getContext("2d");
  const side = glass.width / ZOOM;
  context.imageSmoothingEnabled = false;
  context.clearRect(0, 0, glass.width, glass.height);
  context.drawImage(still, u + 0.5 - side / 2, v + 0.5 - side / 2, side, side, 0, 0, glass.width, glass.height);
  context.strokeStyle = "#ff2d95";
  cross(context, [glass.width / 2, glass.height / 2], 40);
}

function draw() {
  marks.width = still.naturalWidth;
  marks.height = still.naturalHeight;
  const context = marks.getContext("2d");
  const thick = Math.max(still.naturalWidth / still.clientWidth, 1);
  context.strokeStyle = "#ff2d95";
  context.lineWidth = 1.5 * thick;
  const shown = ends.map(([u, v]) => [u + 0.5, v + 0.5]);
  for (const end of shown) cross(context, end, 12 * thick);
  if (shown.length > 1) {
    context.beginPath();
    shown.forEach((at, k) => context[k ? "lineTo" : "moveTo"](...at));
    context.stroke();
  }
  if (ends.length) magnify(ends[last]);
  command.textContent = ends.length < LEAST ? `${LEAST - ends.length} more to click` : words();
}

function words() {
  const [left, right] = ends.slice(0, 2).sort((one, other) => one[0] - other[0]);
  const numbers = [left, right, ...ends.slice(2)].flat().map((value) => value.toFixed(1)).join(" ");
  return `${command.dataset.before} ${numbers} ${command.dataset.after}`;
}

still.addEventListener("click", (event) => {
  const at = pixel(event);
  if (ends.length < MOST) { ends.push(at); last = ends.length - 1; }
  else { last = distance(ends[0], at) < distance(ends[1], at) ? 0 : 1; ends[last] = at; }
  draw();
});
still.addEventListener("mousemove", (event) => magnify(pixel(event)));
addEventListener("keydown", (event) => {
  if (event.key === "Backspace" && ends.length) { ends.pop(); last = Math.max(ends.length - 1, 0); draw(); }
  const step = { ArrowLeft: [-0.1, 0], ArrowRight: [0.1, 0], ArrowUp: [0, -0.1], ArrowDown: [0, 0.1] }[event.key];
  if (!step || !ends.length) return;
  event.preventDefault();
  ends[last] = [ends[last][0] + step[0], ends[last][1] + step[1]];
  draw();
});
