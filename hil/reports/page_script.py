"""What a page does once it is there: draw the plots in its scheme, follow the time slider, choose tools."""

from __future__ import annotations

import json

from hil.reports.colours import DARKENED

NOW, ROBOT, JOINED, TRACK = "now", "robot ", "joined", "track "
"""Names of what the time slider moves or reads: the cursor, robots, the line through them, their tracks.

Those of robots and tracks end in the robot's number. The data of a robot carry its outline, ahead to the
right, in their tags.
"""

_HIGHEST_ON_A_PHONE = 350

THEME = """
const dark = () => {
  const chosen = document.documentElement.dataset.theme;
  return chosen ? chosen === "dark" : matchMedia("(prefers-color-scheme: dark)").matches;
};
try { const kept = localStorage.getItem("abreast-theme");
  if (kept) document.documentElement.dataset.theme = kept; } catch { /* a file may not keep anything */ }
const swapped = [];
document.getElementById("theme").addEventListener("click", () => {
  const theme = dark() ? "light" : "dark";
  document.documentElement.dataset.theme = theme;
  try { localStorage.setItem("abreast-theme", theme); } catch { /* then until it is closed */ }
  for (const each of swapped) each();
});
matchMedia("(prefers-color-scheme: dark)").addEventListener("change", () => {
  for (const each of swapped) each();
});
const frames = () => {
  for (const each of document.querySelectorAll(".wide, pre")) {
    const cut = each.scrollWidth > each.clientWidth + 1;
    each.classList.toggle("cut", cut);
    if (cut) each.tabIndex = 0;
  }
};
frames(); addEventListener("resize", frames);
"""

_DRAW = """
const inDark = new Map(Object.entries(%(colours)s));
const inLight = new Map([...inDark].map(([light, shown]) => [shown, light]));
let drawnDark = dark();
const recoloured = (colour, by) => typeof colour === "string" ? by.get(colour)
  : colour && typeof colour.value === "string" && by.has(colour.value)
  ? {...colour, value: by.get(colour.value)} : undefined;
const plots = JSON.parse(document.getElementById("plots").textContent, (key, value) =>
  drawnDark && key.endsWith("_color") ? recoloured(value, inDark) ?? value : value);
if (innerWidth < 600) for (const [number, plot] of Object.entries(plots.plots.roots))
  if (plot.attributes.height > %(narrow)d) {
    plot.attributes.height = %(narrow)d;
    document.getElementById("plot" + number).style.minHeight = "%(narrow)dpx";
  }
const inked = () => {
  if (dark() === drawnDark) return;
  drawnDark = !drawnDark;
  const by = drawnDark ? inDark : inLight;
  for (const model of Bokeh.documents[0].all_models) {
    const changes = {};
    for (const name of Object.keys(model.properties)) if (name.endsWith("_color")) {
      const colour = recoloured(model[name], by);
      if (colour !== undefined) changes[name] = colour;
    }
    if (Object.keys(changes).length) model.setv(changes);
  }
};
const drawn = Bokeh.embed.embed_items(plots, %(items)s).then(() => {
  swapped.push(inked); inked();
  // Who goes through the page by keyboard is not held up by every plot.
  for (const view of Bokeh.index.roots) if (view.canvas_view) view.canvas_view.events_el.tabIndex = -1;
});
const toolsOf = kind => Bokeh.documents[0].roots().flatMap(plot => plot.toolbar.tools)
  .filter(tool => tool.type === kind);
"""

TIME = """
drawn.then(() => {
  const slider = document.getElementById("time"), play = document.getElementById("play");
  const shown = document.getElementById("shown"), first = +slider.min, last = +slider.max;
  const named = new Map([...Bokeh.documents[0].all_models].filter(each => each.name)
    .map(each => [each.name, each]));
  const now = named.get("now"), joined = named.get("joined");
  const robots = [...named.keys()].filter(name => name.startsWith("track "))
    .sort((one, other) => one.slice(6) - other.slice(6))
    .map(name => [named.get(name).data, named.get(name.replace("track", "robot"))]);
  const after = (t, at) => { // the first place that is not before a time; holes have none
    let low = 0, high = t.length;
    while (low < high) {
      const middle = low + high >> 1;
      let here = middle;
      while (here < high && isNaN(t[here])) here++;
      if (here === high) high = middle; else if (t[here] < at) low = here + 1; else high = middle;
    }
    return low;
  };
  const at = (data, name, moment) => {
    const k = after(data.t, moment), t = data.t, values = data[name];
    if (k >= t.length || k === 0) return values[Math.min(k, t.length - 1)];
    const share = (moment - t[k - 1]) / (t[k] - t[k - 1]);
    if (isNaN(share)) return values[k];
    let step = values[k] - values[k - 1];
    if (name === "heading") step = ((step + 180) % 360 + 360) % 360 - 180;
    return values[k - 1] + share * step;
  };
  const show = moment => {
    shown.textContent = moment.toFixed(2) + " s";
    slider.setAttribute("aria-valuetext", moment.toFixed(2) + " seconds");
    if (now) now.location = moment;
    const lineX = [], lineY = [];
    for (const [track, robot] of robots) {
      const [x, y, heading] = ["x", "y", "heading"].map(name => at(track, name, moment));
      const cos = Math.cos(heading * Math.PI / 180), sin = Math.sin(heading * Math.PI / 180);
      robot.data = {xs: [robot.tags.map(([a, b]) => x + a * cos - b * sin)],
        ys: [robot.tags.map(([a, b]) => y + a * sin + b * cos)]};
      lineX.push(x); lineY.push(y);
    }
    if (joined) joined.data = {x: lineX, y: lineY};
    for (const place of document.querySelectorAll("[data-course]")) {
      const value = at(named.get(place.dataset.course).data, "y", moment);
      place.textContent = isNaN(value) ? "\\u2013" : value.toFixed(+place.dataset.digits);
    }
  };
  let playing = 0, before = 0;
  const stop = () => { cancelAnimationFrame(playing); playing = 0; play.textContent = "\\u25b6\\ufe0e";
    play.setAttribute("aria-label", "Play"); };
  const step = stamp => {
    const speed = Math.max(1, (last - first) / 30);
    const moment = Math.min(last, +slider.value + speed * Math.min(stamp - before, 200) / 1000);
    before = stamp;
    slider.value = moment; show(moment);
    if (moment >= last) stop(); else playing = requestAnimationFrame(step);
  };
  play.addEventListener("click", () => {
    if (playing) { stop(); return; }
    if (+slider.value >= last) slider.value = first;
    play.textContent = "\\u275a\\u275a"; play.setAttribute("aria-label", "Pause");
    before = performance.now(); playing = requestAnimationFrame(step);
  });
  slider.addEventListener("input", () => { stop(); show(+slider.value); });
  show(+slider.value);
});
"""


TOOLS = """
drawn.then(() => {
  const drags = {zoom: ["BoxZoomTool"], move: ["PanTool"], wheel: ["WheelZoomTool"]};
  const choose = name => {
    for (const [each, kinds] of Object.entries(drags)) {
      document.getElementById(each).setAttribute("aria-pressed", each === name);
      for (const tool of kinds.flatMap(toolsOf)) tool.active = each === name;
    }
  };
  for (const name of Object.keys(drags)) document.getElementById(name).addEventListener("click", event =>
    choose(event.currentTarget.getAttribute("aria-pressed") === "true" ? "" : name));
  document.getElementById("whole").addEventListener("click", () => {
    for (const plot of Bokeh.documents[0].roots()) plot.reset.emit();
  });
  const more = document.getElementById("more");
  more.addEventListener("click", () => {
    const open = document.querySelector(".tools").classList.toggle("open");
    more.setAttribute("aria-expanded", open);
  });
  if (matchMedia("(pointer: fine)").matches) choose("zoom"); // a finger that drags scrolls the page
  document.getElementById("bar").hidden = false;
});
"""


def drawing(items: str) -> str:
    """Script that draws the plots; ``items``: which goes where, in Bokeh's JSON."""
    return _DRAW % {"colours": json.dumps(DARKENED), "items": items, "narrow": _HIGHEST_ON_A_PHONE}
