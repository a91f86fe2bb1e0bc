// The page: what the server says is put in its places, with an age on everything.

import { Arena } from "./arena.js";
import { Link } from "./link.js";
import { Strip } from "./strips.js";

const $ = id => document.getElementById(id);
const FRESH_S = 1, SILENT_S = 3, TOLD_MS = 300;

let config = null, frame = null, came = 0, reports = null, reported = 0;
let linked = false, place = 0, strips = [], ink = {}, stoppedAt = 0, heardOf = [], due = false;
const arena = new Arena($("arena"));

// --- time: how old what is shown is, on its way and since it came ------------------------------------------

const since = moment => (performance.now() - moment) / 1000;
const aged = age => age == null ? null : age + (frame?.link ?? 0) + since(came);
const old = (age, most = FRESH_S) => age === null || age > most;
const seconds = age => age === null ? "never" : age < 9.95 ? `${age.toFixed(1)} s` : age < 600 ? `${age.toFixed(0)} s` : `${(age / 60).toFixed(0)} min`;
const signed = (value, digits, unit = "") => value == null ? "–" : `${value < 0 ? "−" : "+"}${Math.abs(value).toFixed(digits)} ${unit}`.trim();

const number = (value, { digits, unit, plain }) => plain ? `${value.toFixed(digits)} ${unit}` : signed(value, digits, unit);

// --- elements -----------------------------------------------------------------------------------------------

function make(tag, text = "", name = "") {
  const made = document.createElement(tag);
  if (text) made.textContent = text;
  if (name) made.className = name;
  return made;
}

function put(parent, ...children) {
  parent.replaceChildren(...children);
}

function write(element, text, name) {
  if (element.textContent !== text) element.textContent = text;
  if (name !== undefined && element.className !== name) element.className = name;
}

// --- what comes ---------------------------------------------------------------------------------------------

const heard = {
  config(said) {
    const anew = !config || config.server !== said.server;
    config = said;
    if (anew) {
      arena.clear();
      frame = reports = null;
      place = Math.min(place, said.followers.length - 1);
      lay();
    }
    if (place) link.say({ say: "look", follower: place });
  },
  frame(said) {
    link.say({ say: "seen", frame: said.n });
    if (said.follower !== place) return;
    frame = said;
    came = performance.now();
    if (said.reports) [reports, reported] = [said.reports, came];
    arena.add(said.t, said.robots);
    sample(said);
    if (!due) requestAnimationFrame(draw);
    due = true;
  },
  stop(said) {
    stoppedAt ||= performance.now();
    const words = { told: "Told", done: "Done", failed: "NOT SURE" };
    tellStop(`${words[said.state]}: ${said.text}`, said.state === "failed");
  },
  answer(said) {
    if (said.order !== "stop") write($("answer"), said.text, said.given ? "" : "bad");
  },
  bye() {},
};

function changed(open, why) {
  linked = open;
  if (open) document.body.dataset.link = "live";
  $("alarm").hidden = open;
  if (!open) write($("alarm"), `Nothing is shown as it is now: ${why}. It is tried again.`);
  tick();
}

// --- values over time ---------------------------------------------------------------------------------------

const part = (values, k) => values ? values[k] : null;
const three = sd => sd == null ? null : 3 * sd;
const DEGREES = 180 / Math.PI;
const CURVES = [
  { name: "ρ", hue: "ink", unit: "m", plain: true, digits: 3, least: 0.05, get: f => ({ value: part(f.estimate?.shape, 0), wish: f.station[0], orbit: part(f.estimate?.orbit, 0) }) },
  { name: "α1", hue: "ink", unit: "deg", scale: DEGREES, digits: 1, least: 30, wraps: true, get: f => ({ ...believed(f.estimate?.alpha1), wish: f.station[1], orbit: part(f.estimate?.orbit, 1) }) },
  { name: "α2", hue: "ink", unit: "deg", scale: DEGREES, digits: 1, least: 30, wraps: true, get: f => ({ value: part(f.estimate?.shape, 2), wish: f.station[2], orbit: part(f.estimate?.orbit, 2) }) },
  { name: "v1", hue: "leader", unit: "m/s", digits: 3, least: 0.1, get: f => believed(f.estimate?.v1), limits: c => [c.leader.k_v] },
  { name: "u1", hue: "leader", unit: "deg/s", scale: DEGREES, digits: 0, least: 60, get: f => believed(f.estimate?.u1), limits: c => [-c.leader.k_u, c.leader.k_u] },
  { name: "v2 sent", hue: "follower", unit: "m/s", digits: 3, least: 0.1, get: f => ({ value: part(f.command?.sent, 0), wish: part(f.command?.wanted, 0) }), limits: c => [-c.limits.v, c.limits.v] },
  { name: "u2 sent", hue: "follower", unit: "deg/s", scale: DEGREES, digits: 0, least: 60, get: f => ({ value: part(f.command?.sent, 1), wish: part(f.command?.wanted, 1) }), limits: c => [-c.limits.u, c.limits.u] },
  { name: "age of what a command rests on", hue: "follower", unit: "s", plain: true, digits: 3, least: 0.1, get: f => ({ value: f.command?.measurement_age ?? null }), limits: c => [c.limits.age] },
];

function believed(values) {
  return values ? { value: values[0], sd: three(values[1]), bound: values[2] } : { value: null };
}

function shown(values, scale) {
  return Object.fromEntries(Object.entries(values).map(([name, value]) => [name, value == null ? value : scale * value]));
}

// What an old message says is no value of now.
function sample(f) {
  const now = { ...f, estimate: f.estimate?.age < FRESH_S ? f.estimate : null, command: f.command?.age < FRESH_S ? f.command : null };
  CURVES.forEach((curve, k) => strips[k].strip.add({ t: f.t, wraps: curve.wraps, ...shown(curve.get(now), curve.scale ?? 1) }));
}

function lay() {
  write($("scenario"), config.scenario);
  document.title = `${config.scenario} · abreast live`;
  strips = CURVES.map(curve => {
    const figure = make("figure"), caption = make("figcaption"), value = make("output"), canvas = make("canvas");
    caption.append(make("span", `${curve.name} [${curve.unit}]`), value);
    canvas.setAttribute("role", "img");
    canvas.setAttribute("aria-label", `${curve.name} in ${curve.unit} over the last 30 seconds`);
    figure.append(caption, canvas);
    return { figure, value, curve, strip: new Strip(canvas, curve.hue, curve.least, (curve.limits?.(config) ?? []).map(limit => (curve.scale ?? 1) * limit)) };
  });
  put($("strips"), ...strips.map(each => each.figure));
  $("which").hidden = config.followers.length < 2;
  put($("follower"), ...config.followers.map((name, k) => new Option(name, k, false, k === place)));
  const orders = [["Arm all", { say: "arm" }], ...config.robots.map(name => [`Arm ${name}`, { say: "arm", robot: name }])];
  if (config.side_changes) for (const side of ["left", "right"]) orders.push([`Go to the ${side}`, { say: "side", side }]);
  put($("orders"), ...orders.map(([text, word]) => {
    const button = make("button", text);
    button.type = "button";
    button.onclick = () => give(word);
    button.dataset.robot = word.robot ?? "";
    button.dataset.order = word.say;
    return button;
  }));
}

// --- drawing ------------------------------------------------------------------------------------------------

function inks() {
  const style = getComputedStyle(document.documentElement);
  const names = ["paper", "ink", "soft", "grid", "leader", "follower", "bound", "wish", "orbit", "limit"];
  ink = Object.fromEntries(names.map(name => [name, style.getPropertyValue(`--${name}`).trim()]));
}

function draw() {
  due = false;
  if (!frame || !config) return;
  arena.draw(frame, place, config.fence, k => old(aged(frame.robots[k].pose_age)), !old(aged(frame.estimate?.age)), ink);
  for (const each of strips) {
    each.strip.draw(frame.t, ink);
    const { samples } = each.strip, newest = samples[samples.length - 1];
    write(each.value, newest?.value == null ? "–" : number(newest.value, each.curve));
  }
  tick();
}

// What is said in words, also while nothing comes: ages go on.
function tick() {
  const age = frame ? since(came) : null;
  const fresh = linked && age !== null && age < FRESH_S;
  document.body.dataset.link = fresh ? "live" : "none";
  write($("link"), fresh ? `live, ${Math.round(1000 * frame.link)} ms away` : !linked ? `not connected${age === null ? "" : `, all of this is ${seconds(age)} old`}`
    : age === null ? "waiting for the lab" : `stale: all of this is ${seconds(age)} old`);
  reach();
  if (!frame || !config) return;
  verdict();
  robots();
  if (reports) told();
  standing();
}

function verdict() {
  const e = frame.estimate, c = frame.command, line = $("verdict");
  const seen = e ? [`estimate ${e.status}${e.reason ? ` (${e.reason})` : ""}, ${seconds(aged(e.age))} old`] : ["no estimate"];
  if (c) {
    seen.push(c.stop ? `follower told to stand: ${c.stop}` : `driving${c.saturated ? ", at a limit" : ""}`);
    seen.push(`command ${seconds(aged(c.age))} old`);
    if (c.measurement_age !== null) seen.push(`rests on a measurement of ${Math.round(1000 * c.measurement_age)} ms before`);
  } else seen.push("no command");
  const bad = !e || e.status !== "tracking" || old(aged(e.age)) || !c || c.stop || old(aged(c.age));
  write(line, seen.join(" · "), bad ? "bad" : "");
}

function robots() {
  const rows = config.robots.map((name, k) => {
    const robot = frame.robots[k], row = make("tr"), head = make("th", name);
    head.scope = "row";
    const pose = aged(robot.pose_age), told = aged(robot.told_age), own = aged(robot.own_age);
    const guard = reports?.guards[name];
    row.append(head, make("td", seconds(pose), old(pose) ? "bad" : ""), motion(robot.told, told, false, "nothing"),
      motion(robot.own, own, robot.stands, "none"), make("td", guard === undefined ? "not heard" : guard || "lets it drive", guard === undefined ? "soft" : guard ? "bad" : ""));
    return row;
  });
  const key = rows.map(row => row.outerHTML).join();
  if (robots.key !== key) put($("robots"), ...rows);
  robots.key = key;
}

// A cell with speed and turn rate, how old they are, and whether that is a robot that stands. What has an age
// and no values came, and cannot be read.
function motion(values, age, stands, otherwise) {
  const turned = values?.[1] == null ? null : DEGREES * values[1];
  const text = values ? stands ? "stands" : `${signed(values[0], 3)}, ${signed(turned, 0)}` : age === null ? otherwise : "cannot be read";
  const cell = make("td", text, old(age) ? "soft" : values ? "" : "bad");
  if (age !== null) cell.append(make("small", `${seconds(age)} ago`, old(age) ? "bad" : ""));
  return cell;
}

function told() {
  const later = since(reported) + (frame.link ?? 0);
  const items = [];
  if (!reports.link) items.push(["bad", "The lab's router is not reached: nothing comes, and no order goes out."]);
  if (reports.stop) items.push(["bad", `Stopped by ${reports.stop.by} ${seconds(reports.stop.age + later)} ago: ${reports.stop.reason}`]);
  for (const body of reports.missing_bodies) items.push(["bad", `The motion capture does not see ${body}.`]);
  for (const node of reports.nodes) {
    for (const each of node.findings) items.push([`bad${node.age_s + later > SILENT_S ? " stale" : ""}`, `${node.name}: ${each.name}: ${each.text}`, each.advice]);
    if (node.age_s + later > SILENT_S) items.push(["bad", `${node.name} has said nothing for ${seconds(node.age_s + later)}.`]);
  }
  if (reports.malformed) items.push(["", `${reports.malformed} message${reports.malformed === 1 ? "" : "s"} could not be read.`]);
  const refused = Object.entries(reports.refused).map(([cause, count]) => `${count} by ${cause}`).join(", ");
  if (refused) items.push(["", `This page refused requests: ${refused}.`]);
  list($("against"), items.length ? items : [["good", "Nothing."]], ([name, text, advice]) => {
    const item = make("li", text, name);
    if (advice) item.append(make("div", advice, "soft"));
    return item;
  });
  list($("nodes"), reports.nodes, node => {
    const item = make("li"), age = node.age_s + later, name = make("strong", node.name);
    item.className = age > SILENT_S ? "stale" : "";
    item.append(make("span", seconds(age), "age"), name, ` ${[node.status, node.says].filter(Boolean).join(" · ") || "well"}`);
    if (!node.ok) name.className = "bad";
    const causes = Object.entries(node.refused).filter(([, count]) => count);
    if (causes.length) item.append(make("div"));
    for (const [cause, count] of causes) item.lastChild.append(make("span", `${count} ${cause}`, "cause"));
    return item;
  });
  write($("more"), reports.more_nodes ? `and ${reports.more_nodes} more` : "");
  write($("rates"), reports.rates.map(each => `${each.name} ${each.rate === null ? "" : `${each.rate.toFixed(0)} Hz, `}${seconds(each.age === null ? null : each.age + later)}`).join(" · "),
    reports.rates.some(each => old(each.age === null ? null : each.age + later, SILENT_S)) ? "bad" : "");
  const side = reports.side;
  write($("side"), side.side ? `, the follower on the ${side.side}${side.change === "none" ? "" : `, side change ${side.change}`}` : "");
}

function list(parent, items, made) {
  const built = items.map(made), key = built.map(each => each.outerHTML).join();
  if (parent.dataset.key === String(hash(key))) return;
  parent.dataset.key = hash(key);
  put(parent, ...built);
}

function hash(text) {
  let sum = 7;
  for (let k = 0; k < text.length; k += 1) sum = (31 * sum + text.charCodeAt(k)) | 0;
  return sum;
}

// --- orders -------------------------------------------------------------------------------------------------

async function give(word) {
  write($("answer"), "…", "");
  const answer = await link.order(word);
  write($("answer"), answer.text, answer.given ? "" : "bad");
}

let pressed = -TOLD_MS;
async function stop() {
  if (performance.now() - pressed < TOLD_MS) return; // a press and its click are one
  pressed = performance.now();
  stoppedAt = pressed;
  heardOf = [];
  tellStop("Stopping …", false);
  const answer = await link.order({ say: "stop" });
  if (!answer.given) tellStop(answer.lost ? "NOT TOLD: the server is not reached. Use the robot's switch, or abreast stop." : `NOT TOLD: ${answer.text}`, true);
  else if ($("stopped").textContent.startsWith("Stopping")) tellStop(`Told: ${answer.text}`, false);
}

function tellStop(text, bad) {
  $("stopped").dataset.text = text;
  $("stopped").className = bad ? "bad" : "";
  standing();
}

// Whether robots were heard to stand since they were told to.
function standing() {
  const text = $("stopped").dataset.text;
  if (!text) return;
  if (frame && config && came > stoppedAt && linked) heardOf = config.robots.map((name, k) => {
    const robot = frame.robots[k];
    return `${name} ${robot.stands === null ? "is not heard of" : old(aged(robot.own_age)) ? "was not heard of since" : robot.stands ? "stands" : "MOVES"}`;
  });
  write($("stopped"), [text, ...heardOf, ...(heardOf.length && !linked ? ["by what was heard last"] : [])].join(" · "));
}

function reach() {
  const may = linked && (!reports || reports.link) && (!config || config.may_stop);
  const bar = $("bar"), why = !linked ? "the server is not reached: use the robot's switch"
    : reports && !reports.link ? "the lab's router is not reached: use the robot's switch"
    : config && !config.may_stop ? "these keys may not stop anybody" : "all robots · space bar";
  if (bar.dataset.reach !== (may ? "yes" : "no")) bar.dataset.reach = may ? "yes" : "no";
  write($("how"), why);
  for (const button of $("orders").children) {
    const { order, robot } = button.dataset, guards = reports?.guards ?? {};
    button.disabled = !may || order === "arm" && !(robot ? robot in guards : Object.keys(guards).length);
  }
}

$("stop").addEventListener("pointerdown", stop);
$("stop").addEventListener("click", stop);
for (const kind of ["keydown", "keyup"]) {
  // Wherever the focus is: else the space bar would press another button.
  addEventListener(kind, event => {
    if (event.code !== "Space" && event.key !== " ") return;
    event.preventDefault();
    event.stopImmediatePropagation();
    if (kind === "keydown" && !event.repeat) stop();
  }, { capture: true });
}
$("follower").addEventListener("change", event => {
  place = Number(event.target.value);
  for (const each of strips) each.strip.clear();
  link.say({ say: "look", follower: place });
});
matchMedia("(prefers-color-scheme: dark)").addEventListener("change", () => { inks(); draw(); });
addEventListener("resize", draw);
inks();
setInterval(tick, 250);
const link = new Link(said => heard[said.kind]?.(said), changed);
