"use strict";
// What is drawn: heights over time, the wall from above, the camera's image.

const SPAN = 30;

function colour(name) {
  return getComputedStyle(document.documentElement).getPropertyValue(`--${name}`).trim();
}

// What limits a height: the limit that was set, or the rim of the container where it is lower.
function limitWords(limit) {
  return limit ? `${limit.name} ${(1e3 * limit.height).toFixed(1)} mm` : "";
}

// Times; measured, estimated and fused heights; bounds of the last.
function emptyRows() {
  return [[], [], [], [], [], []];
}

class Heights {
  constructor(place) {
    this.place = place;
    this.drawing = null;
    this.limits = {};
    this.rows = emptyRows();
    this.plot = null;
    new ResizeObserver(() => this.fit()).observe(place);
    matchMedia("(prefers-color-scheme: light)").addEventListener("change", () => this.renew());
    this.renew();
  }

  renew() {
    if (this.plot) this.plot.destroy();
    const axis = { stroke: colour("soft"), grid: { stroke: colour("rule") }, ticks: { stroke: colour("rule") } };
    const line = (label, name) => ({
      label, stroke: colour(name), width: 2, spanGaps: false, points: { show: false },
      value: (_, v) => (v === null || v === undefined ? "–" : v.toFixed(2)),
    });
    this.plot = new uPlot({
      ...this.size(),
      scales: { x: { time: false, range: () => [this.end() - SPAN, this.end()] }, y: { range: (_, lo, hi) => this.range(lo, hi) } },
      axes: [{ ...axis, values: (_, ticks) => ticks.map((t) => `${t} s`) }, axis],
      series: [{ label: "time", value: (_, v) => (v === null ? "–" : `${v.toFixed(2)} s`) },
        line("measured", "measured"), line("estimated", "estimated"), line("fused", "fused"),
        { ...line("− 2σ", "fused"), width: 0 }, { ...line("+ 2σ", "fused"), width: 0 }],
      bands: [{ series: [5, 4], fill: colour("band") }],
      hooks: { draw: [(plot) => this.drawLimits(plot)] },
      cursor: { drag: { x: false, y: false } },
    }, this.rows, this.place);
  }

  size() { return { width: Math.max(this.place.clientWidth, 200), height: 280 }; }
  fit() { if (this.plot) this.plot.setSize(this.size()); }
  end() { const t = this.rows[0]; return Math.max(t.length ? t[t.length - 1] : SPAN, SPAN); }

  range(low, high) {
    const limit = Math.max(0, ...this.heightLimits().map((one) => 1e3 * one.height));
    return [Math.min(low ?? 0, 0), 1.12 * Math.max(high ?? 1, limit, 1)];
  }

  // Those of the heights, each once.
  heightLimits() {
    const all = [this.limits.measured, this.limits.estimated].filter(Boolean);
    return all.filter((one, place) => all.findIndex((other) => other.height === one.height) === place);
  }

  drawLimits(plot) {
    const context = plot.ctx;
    context.save();
    context.strokeStyle = colour("limit");
    context.setLineDash([8, 6]);
    context.lineWidth = 2;
    context.fillStyle = colour("limit");
    context.font = `${12 * devicePixelRatio}px system-ui, sans-serif`;
    context.textAlign = "right";
    for (const limit of this.heightLimits()) {
      const y = plot.valToPos(1e3 * limit.height, "y", true);
      context.fillText(limitWords(limit), plot.bbox.left + plot.bbox.width - 6, y - 6);
      context.beginPath();
      context.moveTo(plot.bbox.left, y);
      context.lineTo(plot.bbox.left + plot.bbox.width, y);
      context.stroke();
    }
    context.restore();
  }

  clear() { this.rows = emptyRows(); this.drawing = null; }

  add(frame) {
    if (frame.drawing !== this.drawing) { this.clear(); this.drawing = frame.drawing; }
    for (const [t, ...shown] of frame.rows) {
      this.rows[0].push(t);
      shown.forEach((height, k) => this.rows[k + 1].push(height === null ? null : 1e3 * height));
    }
    const first = this.rows[0].findIndex((t) => t >= this.end() - SPAN);
    if (first > 0) this.rows = this.rows.map((row) => row.slice(first));
    if (frame.limits) this.limits = frame.limits;
  }

  draw() { this.plot.setData(this.rows); }
}

// The container's contour, +x to the right (share: cosine) or +y (sine), and the level of each side as a line across it.
function drawSide(canvas, outline, share, surface, limit) {
  const wide = canvas.clientWidth || 300;
  const dense = devicePixelRatio || 1;
  const reach = Math.max(...outline.map(([r]) => r));
  const [low, high] = [Math.min(...outline.map(([, z]) => z)), Math.max(...outline.map(([, z]) => z))];
  const scale = 0.9 * Math.min(wide / (2 * reach), wide / (high - low));
  const tall = scale * (high - low) + 24;
  canvas.width = Math.round(wide * dense);
  canvas.height = Math.round(tall * dense);
  const context = canvas.getContext("2d");
  context.scale(dense, dense);
  const place = (x, z) => [wide / 2 + scale * x, tall - 12 - scale * (z - low)];
  const path = (points) => {
    context.beginPath();
    points.forEach(([x, z], k) => context[k ? "lineTo" : "moveTo"](...place(x, z)));
  };
  const wall = [...outline.slice().reverse().map(([r, z]) => [-r, z]), ...outline];
  context.save();
  path(wall);
  context.clip();
  const level = (left, right, name, dashes) => {
    context.setLineDash(dashes);
    context.strokeStyle = colour(name);
    path([[-reach, left], [reach, right]]);
    context.stroke();
  };
  context.lineWidth = 1.5;
  level(0, 0, "soft", [2, 4]);
  if (limit) level(limit.height, limit.height, "limit", [6, 5]);
  context.lineWidth = 3;
  for (const name of ["estimated", "measured"]) {
    const [azimuth, height] = surface[name] || [null, null];
    if (azimuth === null || height === null) continue;
    const right = height * share(azimuth);
    level(-right, right, name, []);
  }
  context.restore();
  context.setLineDash([]);
  context.lineWidth = 2;
  context.strokeStyle = colour("soft");
  path(wall);
  context.stroke();
}

// Distance of the wall from the centre by azimuth, 1 where it is largest; plan: corners [x, y], none: a circle.
function wallDistance(plan) {
  if (!plan || !plan.length) return () => 1;
  const most = Math.max(...plan.map(([x, y]) => Math.hypot(x, y)));
  return (azimuth) => {
    const [c, s] = [Math.cos(azimuth), Math.sin(azimuth)];
    let far = 0;
    plan.forEach(([x, y], k) => {
      const [u, v] = plan[(k + 1) % plan.length];
      const across = c * (v - y) - s * (u - x);
      const share = across ? (s * x - c * y) / across : -1;
      if (share >= 0 && share <= 1) far = Math.max(far, (x * (v - y) - y * (u - x)) / across);
    });
    return far / most;
  };
}

// The wall from above, +x to the right and counter-clockwise as in the container's frame; outwards is higher.
function drawAbove(canvas, surface, limit, plan) {
  const size = canvas.clientWidth || 300;
  const dense = devicePixelRatio || 1;
  canvas.width = canvas.height = Math.round(size * dense);
  const context = canvas.getContext("2d");
  context.scale(dense, dense);
  const middle = size / 2, still = 0.27 * size;
  const scale = 0.15 * size / (limit ? limit.height : 0.02);
  const wall = wallDistance(plan);
  const place = (azimuth, height) => {
    const radius = Math.max(still * wall(azimuth) + scale * height, 2);
    return [middle + radius * Math.cos(azimuth), middle - radius * Math.sin(azimuth)];
  };
  const ring = (height, name, dashes) => {
    context.setLineDash(dashes);
    context.strokeStyle = colour(name);
    context.beginPath();
    for (let k = 0; k < 360; k += 1) context.lineTo(...place((k * Math.PI) / 180, height));
    context.closePath();
    context.stroke();
  };
  context.lineWidth = 1.5;
  ring(0, "soft", []);
  if (limit) ring(limit.height, "limit", [6, 5]);
  context.setLineDash([]);
  context.fillStyle = colour("soft");
  context.font = "12px system-ui, sans-serif";
  context.fillText("+x", size - 20, middle + 4);
  context.fillText("+y", middle - 7, 13);
  if (limit) context.fillText(limitWords(limit), 4, size - 6);
  const arrow = (end, name) => {
    if (!end || end[0] === null || end[1] === null) return;
    context.strokeStyle = context.fillStyle = colour(name);
    context.lineWidth = 3;
    const [x, y] = place(end[0], end[1]);
    context.beginPath();
    context.moveTo(middle, middle);
    context.lineTo(x, y);
    context.stroke();
    context.beginPath();
    context.arc(x, y, 5, 0, 2 * Math.PI);
    context.fill();
  };
  if (surface.line && surface.line.length) {
    context.fillStyle = colour("measured");
    for (const [azimuth, height] of surface.line) {
      const [x, y] = place(azimuth, height);
      context.fillRect(x - 1.5, y - 1.5, 3, 3);
    }
  }
  arrow(surface.estimated, "estimated");
  arrow(surface.measured, "measured");
}

async function drawCamera(canvas, buffer) {
  const length = new DataView(buffer).getUint32(0, true);
  const heading = JSON.parse(new TextDecoder().decode(new Uint8Array(buffer, 4, length)));
  const image = await createImageBitmap(new Blob([new Uint8Array(buffer, 4 + length)], { type: "image/jpeg" }));
  canvas.width = image.width;
  canvas.height = image.height;
  const context = canvas.getContext("2d");
  context.drawImage(image, 0, 0);
  image.close();
  context.fillStyle = "#35ff8a";
  for (const [u, v] of heading.line) {
    context.beginPath();
    context.arc(u, v, 2, 0, 2 * Math.PI);
    context.fill();
  }
}
