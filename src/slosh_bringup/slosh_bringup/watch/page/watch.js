"use strict";
// Puts frames on the page. Whatever comes is shown as text, never as markup.

const LOST = 1000; // ms without a frame
const CLASSES = { "safe": "safe", "near limit": "near", "sides disagree": "near", "limit exceeded": "exceeded", "blind": "blind" };
const part = (id) => document.getElementById(id);
const recorded = document.documentElement.dataset.mode === "recording";
const heights = new Heights(part("plot"));
const state = { limits: {}, heard: -Infinity, held: false, playing: false, pending: false };

function millimetres(value, digits = 1) {
  return value === null || value === undefined ? "–" : (1e3 * value).toFixed(digits);
}

function put(id, text) {
  const node = part(id);
  if (node.textContent !== text) node.textContent = text;
}

function banner(verdict, reason) {
  part("banner").className = CLASSES[verdict] || "lost";
  put("verdict", verdict);
  put("reason", reason);
  document.title = `${verdict} – slosh monitor`;
}

function showNow(now) {
  put("measured", millimetres(now.measured));
  put("estimated", millimetres(now.estimated));
  put("residual", millimetres(now.residual));
  put("sigma", millimetres(now.sigma, 2));
  put("epsilon", now.epsilon === null || now.epsilon === undefined ? "–" : (100 * now.epsilon).toFixed(1));
  const left = now.to_rim || {};
  put("measured-limit", words(limitWords(state.limits.measured), rimWords(left.measured)));
  put("estimated-limit", words(limitWords(state.limits.estimated), rimWords(left.estimated)));
  put("residual-limit", limitWords(state.limits.disagreement));
}

function rimWords(left) {
  if (left === null || left === undefined) return "";
  return `${millimetres(Math.abs(left))} mm ${left < 0 ? "above" : "to"} the rim`;
}

function words(...parts) {
  return parts.filter(Boolean).join(" · ");
}

const WHY = ["", "the container moves", "the wave is settling", "the height is uncertain", "no input"];

function showCalm(calm) {
  const known = calm.calm !== undefined;
  const waits = known && !calm.calm && calm.wait;
  put("calm", !known ? "–" : calm.calm ? "yes" : waits ? `in ${calm.wait.toFixed(0)} s` : "no");
  put("calm-words", known ? [WHY[calm.reason], `calm: up to ${millimetres(calm.tolerance)} mm`].filter(Boolean).join("; ") : "");
}

function showFigures(figures) {
  const shown = [...document.querySelectorAll(".further")];
  shown.slice(figures.length).forEach((node) => node.remove());
  figures.forEach((figure, number) => {
    const node = shown[number] || part("further").content.firstChild.cloneNode(true);
    const texts = [figure.title, figure.value === null ? "–" : figure.value.toFixed(0), figure.unit, figure.words];
    node.querySelectorAll("h2, b, span, .small").forEach((one, at) => { one.textContent = texts[at]; });
    if (!shown[number]) part("further").before(node);
  });
}

function row(cells) {
  const line = document.createElement("tr");
  for (const [text, name] of cells) {
    const cell = document.createElement("td");
    cell.textContent = text;
    if (name) cell.className = name;
    line.append(cell);
  }
  return line;
}

function showNodes(nodes) {
  part("nodes").replaceChildren(...nodes.flatMap((node) => {
    const facts = Object.entries(node.facts);
    const rates = facts.filter(([key]) => key.endsWith(" [Hz]")).map(([key, value]) => `${key.slice(0, -5)} ${value}`);
    const lost = facts.filter(([key]) => /dropped|lost/.test(key) && !/Hz|while/.test(key)).map(([, value]) => Number(value));
    const dropped = lost.reduce((sum, value) => sum + (value || 0), 0);
    const tray = facts.filter(([key]) => key.startsWith("container "));
    return [
      row([[node.name], [node.level, node.level], [rates.join(", ") || "–"], [lost.length ? String(dropped) : "–"], [node.age.toFixed(1)], [node.sentence]]),
      ...tray.map(([key, value]) => row([[key], [""], [""], [""], [""], [value]])),
    ];
  }));
}

function showCells(cells) {
  part("cells-part").hidden = cells.length === 0;
  part("cells").replaceChildren(...cells.map((cell) => {
    const worst = cell.worst ? `worst container ${cell.worst}` : "";
    const line = row([[""], [cell.verdict, CLASSES[cell.verdict]], [millimetres(cell.height)], [millimetres(cell.limit)], [words(cell.own ? "this page" : "", worst, cell.reason)]]);
    const link = document.createElement(cell.port && !cell.own ? "a" : "span");
    link.textContent = cell.name;
    if (link.tagName === "A") link.href = `${location.protocol}//${location.hostname}:${Number(cell.port)}/`;
    line.firstChild.append(link);
    if (cell.own) line.className = "own";
    return line;
  }));
}

function showEvents(events) {
  part("events").replaceChildren(...events.map((event) => {
    const line = document.createElement("li");
    line.className = event.start ? "start" : "end";
    line.textContent = `${event.time.toFixed(2)} s  ${event.start ? "began" : "ended"}: ${event.text}`;
    return line;
  }));
}

function show(frame) {
  banner(frame.verdict, frame.reason);
  showNow(frame.now);
  const container = state.container && state.container.outline ? state.container : null;
  part("side-part").hidden = !container;
  if (container) drawSide(part("side"), container.outline, Math.cos, frame.surface, state.limits.measured);
  part("end-part").hidden = !(container && container.across);
  if (container && container.across) drawSide(part("end"), container.across, Math.sin, frame.surface, state.limits.measured);
  showCalm(frame.calm || {});
  showFigures(frame.figures || []);
  drawAbove(part("above"), frame.surface, state.limits.measured, container && container.plan);
  heights.draw();
}

function take(frames, fresh) {
  state.heard = performance.now();
  if (fresh) heights.clear();
  for (const frame of frames) {
    heights.add(frame);
    if (frame.limits) state.limits = frame.limits;
    if (frame.container) state.container = frame.container;
    if (frame.nodes) state.slow = frame;
  }
  state.frame = frames[frames.length - 1] || state.frame;
  if (!state.pending && !state.held) {
    state.pending = true;
    // A page in the background draws nothing, and loses nothing.
    requestAnimationFrame(() => { state.pending = false; draw(); });
  }
}

function draw() {
  if (!state.frame) return;
  show(state.frame);
  if (state.slow) {
    showNodes(state.slow.nodes);
    showEvents(state.slow.events);
    showCells(state.slow.cells || []);
    part("advice").hidden = !state.slow.command;
    put("command", state.slow.command);
    state.slow = null;
  }
  if (recorded) {
    part("at").value = source.at;
    put("time", `${(source.at * source.about.period).toFixed(1)} s`);
  }
}

function picture(buffer) {
  if (!state.held) drawCamera(part("camera"), buffer).catch(() => {});
}

function hold() {
  if (recorded) {
    state.playing = !state.playing;
    put("play", state.playing ? "hold" : "play");
  } else {
    state.held = !state.held;
    if (state.held) put("reason", "held: the page shows a past moment (press Space to continue)");
    else draw();
  }
}

const source = recorded
  ? new RecordedSource(take, picture, (about) => {
    part("slider").hidden = false;
    part("at").max = Math.max(about.frames - 1, 0);
    put("name", about.name);
    hold(); // it plays from where something happens
  })
  : new LiveSource(take, picture);

if (recorded) {
  setInterval(async () => { if (state.playing && !(await source.step())) hold(); }, 100);
  part("at").addEventListener("input", () => source.seek(Number(part("at").value)));
  part("play").addEventListener("click", hold);
} else {
  setInterval(() => {
    if (performance.now() - state.heard > LOST) banner("no connection", "no data from the page's server; trying again");
  }, 100);
}

addEventListener("keydown", (event) => {
  if (event.target instanceof HTMLInputElement && event.key !== " ") return;
  if (event.key === " ") { event.preventDefault(); hold(); }
  if (event.key.toLowerCase() === "f") {
    if (document.fullscreenElement) document.exitFullscreen();
    else document.documentElement.requestFullscreen().catch(() => {});
  }
  if (recorded && event.key === "ArrowLeft") source.seek(source.at - 10);
  if (recorded && event.key === "ArrowRight") source.seek(source.at + 10);
});
