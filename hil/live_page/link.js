// The way to the server: one websocket that is made anew whenever it is gone, and a POST beside it for orders.

const AGAIN_MS = 700, QUIET_MS = 3000, ANSWER_MS = 150, POST_MS = 2000;
const OVER = "the run is over, or the page was ended";

export class Link {
  // heard: called with every message of the server; changed: with whether there is a link, and why not.
  constructor(heard, changed) {
    this.heard = heard;
    this.changed = changed;
    this.socket = null;
    this.token = "";
    this.last = 0;
    this.frame = 0;
    this.waiting = [];
    this.ended = false;
    addEventListener("hashchange", () => this.socket ? this.socket.close() : this.connect());
    addEventListener("online", () => this.connect());
    setInterval(() => {
      if (this.open && performance.now() - this.last > QUIET_MS) this.drop("the server is silent");
    }, 500);
    this.connect();
  }

  get open() {
    return this.socket !== null && this.socket.readyState === WebSocket.OPEN;
  }

  async connect() {
    if (this.socket || this.connecting) return;
    this.connecting = true;
    try {
      this.token = location.hash.slice(1) || await handed();
    } catch (error) {
      this.connecting = false;
      this.changed(false, this.ended ? OVER : error.message);
      setTimeout(() => this.connect(), AGAIN_MS);
      return;
    }
    this.connecting = false;
    const secure = location.protocol === "https:";
    const socket = this.socket = new WebSocket(`${secure ? "wss" : "ws"}://${location.host}/lab`);
    this.last = performance.now();
    socket.onopen = () => {
      this.last = performance.now();
      this.say({ say: "hello", token: this.token });
    };
    socket.onmessage = event => {
      if (socket !== this.socket) return;
      this.last = performance.now();
      const said = JSON.parse(event.data);
      if (said.kind === "bye") this.ended = true;
      if (said.kind === "config") {
        this.ended = false;
        this.frame = 0;
        this.changed(true, "");
      }
      if (said.kind === "frame") this.frame = said.n;
      if (said.kind === "answer") this.answered(said);
      this.heard(said);
    };
    socket.onclose = event => {
      if (socket === this.socket) this.drop(reason(event, this.ended));
    };
  }

  drop(why) {
    const socket = this.socket;
    this.socket = null;
    if (socket) socket.close();
    this.changed(false, why);
    setTimeout(() => this.connect(), AGAIN_MS);
  }

  say(word) {
    if (!this.open) return false;
    this.socket.send(JSON.stringify(word));
    return true;
  }

  // Gives an order, and what the server says to it. A stop that the websocket does not bring over at once is posted.
  // Any other says by which frame it was given: one that is stuck on its way is not to be heeded after a stop.
  async order(word) {
    if (word.say !== "stop") word = { ...word, frame: this.frame };
    const said = this.say(word), heard = said ? this.answer(word.say) : never;
    const lost = { given: false, lost: true, text: "the server is not reached" };
    const first = said && await Promise.race([heard, after(word.say === "stop" ? ANSWER_MS : POST_MS, null)]);
    if (first) return first;
    if (word.say !== "stop") return lost;
    return Promise.race([heard, posted(this.token, word).catch(() => after(said ? POST_MS : 0, lost))]);
  }

  answer(order) {
    return new Promise(done => this.waiting.push([order, done]));
  }

  answered(answer) {
    const [mine, rest] = [[], []];
    for (const each of this.waiting) (each[0] === answer.order ? mine : rest).push(each);
    this.waiting = rest;
    for (const [, done] of mine) done(answer);
  }
}

const never = new Promise(() => {});
const after = (ms, value) => new Promise(done => setTimeout(done, ms, value));

async function handed() {
  let found;
  try {
    found = await fetch("/token", { cache: "no-store" });
  } catch {
    throw new Error("the server is not reached");
  }
  if (!found.ok) throw new Error("open the whole address that abreast prints, with all that is behind #");
  return found.text();
}

async function posted(token, order) {
  const gone = new AbortController(), late = setTimeout(() => gone.abort(), POST_MS);
  try {
    const found = await fetch("/order", {
      method: "POST", signal: gone.signal, headers: { "Content-Type": "application/json" },
      body: JSON.stringify({ token, order }),
    });
    if (!found.ok) throw new Error(`it said ${found.status}`);
    return await found.json();
  } finally {
    clearTimeout(late);
  }
}

function reason(event, ended) {
  if (event.code === 4403) return "this address is of an earlier run: open the one that abreast prints now";
  if (event.code === 4400) return `the server hung up: ${event.reason}`;
  return ended ? OVER : "the server is not reached";
}
