"use strict";
// Where frames come from: a running cell over a WebSocket, or a recording by asking for parts of it.

const TOKEN = new URLSearchParams(location.search).get("token");

function address(path, values) {
  const query = new URLSearchParams({ ...values, ...(TOKEN ? { token: TOKEN } : {}) });
  return `${path}?${query}`;
}

class LiveSource {
  // `give` gets frames, `show` a picture; both are dead after a second without a frame.
  constructor(give, show) {
    this.give = give;
    this.show = show;
    this.connect();
  }

  connect() {
    const protocol = location.protocol === "https:" ? "wss" : "ws";
    const socket = new WebSocket(`${protocol}://${location.host}${address("/frames", {})}`);
    socket.binaryType = "arraybuffer";
    let fresh = true;
    socket.onmessage = (message) => {
      if (typeof message.data !== "string") { this.show(message.data); return; }
      this.give(JSON.parse(message.data), fresh);
      fresh = false;
    };
    socket.onclose = () => setTimeout(() => this.connect(), 500);
  }
}

class RecordedSource {
  constructor(give, show, ready) {
    this.give = give;
    this.show = show;
    this.parts = new Map();
    this.at = 0;
    this.asked = 0;
    fetch(address("/about", {})).then((answer) => answer.json()).then((about) => {
      this.about = about;
      ready(about);
      this.seek(about.start);
    });
  }

  async part(number) {
    if (!this.parts.has(number)) {
      const from = 300 * number;
      this.parts.set(number, fetch(address("/part", { from, to: from + 300 })).then((answer) => answer.json()));
    }
    return this.parts.get(number);
  }

  async frames(from, to) {
    const found = [];
    for (let number = Math.floor(from / 300); number <= Math.floor((to - 1) / 300); number += 1) {
      const part = await this.part(number);
      found.push(...part.slice(Math.max(from - 300 * number, 0), to - 300 * number));
    }
    return found;
  }

  // To a frame: those of the 30 s before it are drawn anew.
  async seek(frame) {
    const order = ++this.asked;
    this.at = Math.min(Math.max(frame, 0), Math.max(this.about.frames - 1, 0));
    const frames = await this.frames(Math.max(this.at - 300, 0), this.at + 1);
    if (order === this.asked) { this.give(frames, true); this.picture(); }
  }

  async step() {
    if (this.at + 1 >= this.about.frames) return false;
    const order = this.asked;
    this.at += 1;
    const frames = await this.frames(this.at, this.at + 1);
    if (order === this.asked) this.give(frames, false);
    if (this.at % 3 === 0) this.picture();
    return true;
  }

  async picture() {
    if (this.busy) return;
    this.busy = true;
    try {
      const answer = await fetch(address("/picture", { frame: this.at }));
      if (answer.status === 200) this.show(await answer.arrayBuffer());
    } finally { this.busy = false; }
  }
}
