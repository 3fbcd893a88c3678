"use strict";
// Charts over time that answer: the values under the pointer, and a closer look at what is marked.
//
// The charts themselves are drawn already, and are all that paper and a browser without scripts have.

const given = JSON.parse(document.getElementById("series").textContent);
const style = (name) => getComputedStyle(document.documentElement).getPropertyValue(`--${name}`).trim();
const text = (value, digits) => (value === null ? "–" : value.toFixed(digits).replace("-", "−"));

// Where a chart's axes lie in it, as shares of its width, and the time at its ends.
function timeAt(chart, x) {
  const box = chart.getBoundingClientRect();
  const [left, right, start, end] = chart.dataset.axis.split(" ").map(Number);
  const share = ((x - box.left) / box.width - left) / (right - left);
  return start + Math.min(Math.max(share, 0), 1) * (end - start);
}

function placeOf(chart, t) {
  const [left, right, start, end] = chart.dataset.axis.split(" ").map(Number);
  return 100 * (left + ((t - start) / (end - start)) * (right - left));
}

function nearest(t) {
  const times = given.t;
  let low = 0, high = times.length - 1;
  while (high - low > 1) {
    const middle = (low + high) >> 1;
    if (times[middle] < t) low = middle; else high = middle;
  }
  return t - times[low] < times[high] - t ? low : high;
}

function made(name, place, tag = "div") {
  const element = document.createElement(tag);
  element.className = name;
  place.append(element);
  return element;
}

class Overview {
  constructor(chart, rows, values, look) {
    this.chart = chart;
    this.rows = rows;
    this.line = made("pointer", chart);
    this.mark = made("marked", chart);
    this.values = values;
    this.start = null;
    chart.addEventListener("pointermove", (event) => this.point(timeAt(chart, event.clientX)));
    chart.addEventListener("pointerleave", () => this.leave());
    chart.addEventListener("pointerdown", (event) => {
      if (event.pointerType === "touch" || event.button) return; // a finger scrolls the page
      this.start = timeAt(chart, event.clientX);
      chart.setPointerCapture(event.pointerId);
      event.preventDefault();
    });
    chart.addEventListener("pointerup", (event) => {
      const ends = [this.start, timeAt(chart, event.clientX)].sort((a, b) => a - b);
      const wanted = this.start !== null && nearest(ends[1]) - nearest(ends[0]) > 2;
      this.start = null;
      this.mark.hidden = true;
      if (wanted) look(ends);
    });
    this.leave();
  }

  point(t) {
    const index = nearest(t);
    const at = given.t[index];
    this.line.hidden = false;
    this.line.style.left = `${placeOf(this.chart, at)}%`;
    const parts = this.rows.map((row) => `${row.name} ${text(row.values[index], 2)}`);
    this.values.textContent = `${text(at, 3)} s: ${parts.join(", ")} mm`;
    if (this.start === null) return;
    const [from, to] = [this.start, t].sort((a, b) => a - b);
    this.mark.hidden = false;
    this.mark.style.left = `${placeOf(this.chart, from)}%`;
    this.mark.style.width = `${placeOf(this.chart, to) - placeOf(this.chart, from)}%`;
  }

  leave() {
    this.line.hidden = this.mark.hidden = true;
    this.values.textContent = "Point at a time to see its values; drag over a range to zoom in.";
  }
}

class CloserLook {
  constructor(figure, rows) {
    this.rows = rows;
    this.place = made("closer", figure);
    this.place.hidden = true;
    this.close = made("", this.place, "button");
    this.close.type = "button";
    this.close.textContent = "close";
    this.close.addEventListener("click", () => { this.place.hidden = true; });
    this.plot = null;
    new ResizeObserver(() => { if (this.plot && !this.place.hidden) this.plot.setSize(this.size()); }).observe(this.place);
    matchMedia("(prefers-color-scheme: dark)").addEventListener("change", () => { if (this.plot) this.show(this.ends); });
  }

  size() { return { width: Math.max(this.place.clientWidth, 240), height: 320 }; }

  show(ends) {
    this.ends = ends;
    this.place.hidden = false;
    if (this.plot) this.plot.destroy();
    const first = Math.max(nearest(ends[0]) - 1, 0);
    const part = (values) => values.slice(first, nearest(ends[1]) + 2);
    const axis = { stroke: style("ink-soft"), grid: { stroke: style("grid") }, ticks: { stroke: style("grid") } };
    const line = (row) => ({
      label: `${row.name} [mm]`, stroke: style(row.colour), width: 2, dash: row.dash ? [8, 5] : undefined,
      value: (_, value) => text(value ?? null, 2),
    });
    this.plot = new uPlot({
      ...this.size(),
      scales: { x: { time: false } },
      axes: [{ ...axis, label: "time [s]", labelSize: 22 }, axis],
      series: [{ label: "time [s]", value: (_, value) => text(value ?? null, 3) }, ...this.rows.map(line)],
      hooks: { draw: [(plot) => this.drawLimit(plot)] },
    }, [part(given.t), ...this.rows.map((row) => part(row.values))], this.place);
    this.place.scrollIntoView({ block: "nearest" });
  }

  drawLimit(plot) {
    if (given.limit === null || !this.rows.some((row) => row.height)) return;
    const y = plot.valToPos(given.limit, "y", true);
    if (y < plot.bbox.top || y > plot.bbox.top + plot.bbox.height) return;
    plot.ctx.save();
    plot.ctx.strokeStyle = style("limit");
    plot.ctx.setLineDash([3, 5]);
    plot.ctx.beginPath();
    plot.ctx.moveTo(plot.bbox.left, y);
    plot.ctx.lineTo(plot.bbox.left + plot.bbox.width, y);
    plot.ctx.stroke();
    plot.ctx.restore();
  }
}

for (const figure of document.querySelectorAll("figure[data-rows]")) {
  const rows = given.charts[figure.dataset.rows];
  const values = made("values", figure);
  const closer = new CloserLook(figure, rows);
  for (const chart of figure.querySelectorAll("[data-axis]"))
    new Overview(chart, rows, values, (ends) => closer.show(ends));
}
