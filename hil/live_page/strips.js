// Values over the last half minute, each on a small canvas of its own.

export const SPAN_S = 30;
const GAP_S = 0.6, LEFT = 44, RIGHT = 6, TOP = 6, BOTTOM = 14;

// Samples of one strip: t, value, 3 sd, bound, wish, orbit; null where there is none.
export class Strip {
  constructor(canvas, hue, least, limits = []) {
    this.canvas = canvas;
    this.hue = hue; // name of its colour
    this.least = least; // the smallest height of the scale
    this.limits = limits;
    this.samples = [];
  }

  add(sample) {
    const { samples } = this;
    samples.push(sample);
    while (samples.length && samples[0].t < sample.t - SPAN_S) samples.shift();
  }

  clear() {
    this.samples = [];
  }

  draw(now, ink) {
    const { canvas, samples } = this;
    const brush = sized(canvas), width = canvas.clientWidth, height = canvas.clientHeight;
    brush.clearRect(0, 0, width, height);
    const [low, high] = this.scale();
    const x = t => LEFT + (t - now + SPAN_S) / SPAN_S * (width - LEFT - RIGHT);
    const y = value => TOP + (high - value) / (high - low) * (height - TOP - BOTTOM);
    brush.font = "11px system-ui, sans-serif";
    brush.textBaseline = "middle";
    this.axes(brush, ink, { low, high, x, y, width, height, now });
    brush.save();
    brush.beginPath();
    brush.rect(LEFT, 0, width - LEFT - RIGHT, height);
    brush.clip();
    for (const limit of this.limits) {
      if (limit >= low && limit <= high) stroke(brush, ink.limit, 1.5, [], [[LEFT, y(limit)], [width - RIGHT, y(limit)]]);
    }
    for (const run of runs(samples, each => each.value !== null && each.sd != null)) band(brush, run, x, y, ink[this.hue]);
    const lines = [
      [each => each.wish, ink.wish, 1.6, [6, 4]],
      [each => of(each.value, each.bound, 1), ink.bound, 1, []], [each => of(each.value, each.bound, -1), ink.bound, 1, []],
      [each => each.value, ink[this.hue], 2, []], [each => each.orbit, ink.orbit, 2, [2, 4]],
    ];
    for (const [get, colour, thick, dash] of lines) {
      for (const run of runs(samples, each => get(each) != null)) {
        stroke(brush, colour, thick, dash, broken(run, get, x, y, height));
      }
    }
    brush.restore();
  }

  scale() {
    let low = Infinity, high = -Infinity;
    const take = value => {
      if (value == null) return;
      low = Math.min(low, value);
      high = Math.max(high, value);
    };
    for (const each of this.samples) {
      [each.value, each.wish, each.orbit].forEach(take);
      // What is not known at all would hide all that is.
      if (each.sd != null && each.sd < 3 * this.least) [of(each.value, each.sd, 1), of(each.value, each.sd, -1)].forEach(take);
      if (each.bound != null && each.bound < 3 * this.least) [of(each.value, each.bound, 1), of(each.value, each.bound, -1)].forEach(take);
    }
    if (!(low <= high)) return [-this.least / 2, this.least / 2];
    const lacks = Math.max(0, this.least - (high - low)) / 2, margin = 0.06 * Math.max(high - low, this.least);
    return [low - lacks - margin, high + lacks + margin];
  }

  axes(brush, ink, { low, high, x, y, width, height, now }) {
    const step = round((high - low) / 3);
    brush.textAlign = "right";
    for (let tick = Math.ceil(low / step) * step; tick <= high; tick += step) {
      stroke(brush, ink.grid, 1, [], [[LEFT, y(tick)], [width - RIGHT, y(tick)]]);
      brush.fillStyle = ink.soft;
      brush.fillText(short(tick, step), LEFT - 5, y(tick));
    }
    brush.textAlign = "center";
    for (let back = 0; back < SPAN_S; back += 10) {
      brush.fillStyle = ink.soft;
      brush.textAlign = back ? "center" : "right";
      brush.fillText(back ? `-${back} s` : "now", x(now - back), height - 5);
    }
  }
}

// A canvas in the pixels of its screen.
export function sized(canvas) {
  const dense = Math.min(devicePixelRatio || 1, 2);
  const width = Math.round(canvas.clientWidth * dense), height = Math.round(canvas.clientHeight * dense);
  if (canvas.width !== width || canvas.height !== height) [canvas.width, canvas.height] = [width, height];
  const brush = canvas.getContext("2d");
  brush.setTransform(dense, 0, 0, dense, 0, 0);
  return brush;
}

export function stroke(brush, colour, width, dash, points) {
  brush.strokeStyle = colour;
  brush.lineWidth = width;
  brush.setLineDash(dash);
  brush.beginPath();
  let down = false;
  for (const point of points) {
    if (point === null) down = false;
    else if (down) brush.lineTo(point[0], point[1]);
    else brush.moveTo(point[0], point[1]), down = true;
  }
  brush.stroke();
  brush.setLineDash([]);
}

// The nearest of 1, 2, 5 times a power of ten above a size.
export function round(size) {
  const power = 10 ** Math.floor(Math.log10(size));
  return [1, 2, 5, 10].map(base => base * power).find(step => step >= size * 0.999);
}

function of(value, about, sign) {
  return value == null || about == null ? null : value + sign * about;
}

function* runs(samples, known) {
  let run = [];
  for (const each of samples) {
    const breaks = !known(each) || (run.length && each.t - run[run.length - 1].t > GAP_S);
    if (breaks && run.length) {
      yield run;
      run = [];
    }
    if (known(each)) run.push(each);
  }
  if (run.length) yield run;
}

// Points of a line that is lifted where an angle goes round.
function* broken(run, get, x, y, height) {
  let last = null;
  for (const each of run) {
    const place = [x(each.t), y(get(each))];
    if (last !== null && each.wraps && Math.abs(get(each) - last) > 180) yield null;
    last = get(each);
    yield [place[0], Math.max(-height, Math.min(2 * height, place[1]))];
  }
}

function band(brush, run, x, y, colour) {
  brush.beginPath();
  for (const each of run) brush.lineTo(x(each.t), y(each.value + each.sd));
  for (const each of [...run].reverse()) brush.lineTo(x(each.t), y(each.value - each.sd));
  brush.closePath();
  brush.globalAlpha = 0.25;
  brush.fillStyle = colour;
  brush.fill();
  brush.globalAlpha = 1;
}

function short(value, step) {
  return value.toFixed(Math.max(0, -Math.floor(Math.log10(step) + 1e-9))).replace(/^-(0\.?0*)$/, "$1");
}
