// The robots from above: where they were, are, and are believed to be.

import { SPAN_S, round, sized, stroke } from "./strips.js";

const BODY = 0.069; // [m] a TurtleBot3 Burger
const AHEAD_S = 2; // as the server carries the belief on
const BELIEVED = ["tracking", "coasting", "rejecting"];

export class Arena {
  constructor(canvas) {
    this.canvas = canvas;
    this.clear();
  }

  clear() {
    this.trails = [];
    this.view = null;
  }

  add(t, robots) {
    robots.forEach((robot, k) => {
      const trail = this.trails[k] ??= [];
      if (robot.pose && robot.pose_age < 0.2 && robot.pose[0] !== null && robot.pose[1] !== null) trail.push([t, robot.pose[0], robot.pose[1]]);
      while (trail.length && trail[0][0] < t - SPAN_S) trail.shift();
    });
  }

  // frame: the newest one; place: of the follower that is looked at; fence: or null; stale: robots not seen of late.
  // believes: whether what the follower believes is of now.
  draw(frame, place, fence, stale, believes, ink) {
    const brush = sized(this.canvas), width = this.canvas.clientWidth, height = this.canvas.clientHeight;
    brush.clearRect(0, 0, width, height);
    const view = this.seen(frame, fence, width / height);
    if (!view) return;
    const scale = width / view.width;
    const at = (x, y) => [(x - view.x) * scale + width / 2, height / 2 - (y - view.y) * scale];
    this.grid(brush, ink, view, at, width, height);
    if (fence) {
      const [left, bottom, right, top] = fence;
      stroke(brush, ink.limit, 2, [], [at(left, bottom), at(right, bottom), at(right, top), at(left, top), at(left, bottom)]);
    }
    this.trails.forEach((trail, k) => {
      brush.globalAlpha = 0.6;
      stroke(brush, k ? ink.follower : ink.leader, 1.8, [], whole(trail, at));
      brush.globalAlpha = 1;
    });
    const leader = frame.robots[place], follower = frame.robots[place + 1];
    if (leader?.pose && follower?.pose) stroke(brush, ink.soft, 1, [3, 3], [at(...leader.pose), at(...follower.pose)]);
    frame.robots.forEach((robot, k) => {
      if (robot.pose) body(brush, at, scale, robot.pose, stale(k) ? ink.soft : k ? ink.follower : ink.leader, ink.paper);
    });
    if (believes && frame.estimate?.leader && BELIEVED.includes(frame.estimate.status)) belief(brush, at, scale, frame, ink);
  }

  // What is to be in the picture: all tracks, in a frame that grows at once and shrinks slowly.
  seen(frame, fence, aspect) {
    let box = [Infinity, Infinity, -Infinity, -Infinity];
    const take = (x, y) => {
      if (Number.isFinite(x + y)) box = [Math.min(box[0], x), Math.min(box[1], y), Math.max(box[2], x), Math.max(box[3], y)];
    };
    for (const trail of this.trails) for (const [, x, y] of trail) take(x, y);
    for (const robot of frame.robots) if (robot.pose) take(robot.pose[0], robot.pose[1]);
    if (fence) take(fence[0], fence[1]), take(fence[2], fence[3]);
    if (!(box[0] <= box[2])) return this.view;
    const wide = Math.max(box[2] - box[0], 0.3) + 0.35, tall = Math.max(box[3] - box[1], 0.3) + 0.35;
    const wanted = { x: (box[0] + box[2]) / 2, y: (box[1] + box[3]) / 2, width: Math.max(wide, tall * aspect) };
    const view = this.view;
    if (!view || wanted.width > view.width) this.view = wanted;
    else {
      const share = 0.03;
      for (const key of ["x", "y", "width"]) view[key] += share * (wanted[key] - view[key]);
    }
    return this.view;
  }

  grid(brush, ink, view, at, width, height) {
    const step = round(view.width / 8), tall = view.width * height / width;
    const first = (middle, size) => Math.ceil((middle - size / 2) / step) * step;
    for (let x = first(view.x, view.width); x < view.x + view.width / 2; x += step) {
      stroke(brush, ink.grid, 1, [], [[at(x, 0)[0], 0], [at(x, 0)[0], height]]);
    }
    for (let y = first(view.y, tall); y < view.y + tall / 2; y += step) {
      stroke(brush, ink.grid, 1, [], [[0, at(0, y)[1]], [width, at(0, y)[1]]]);
    }
    const length = step * width / view.width;
    stroke(brush, ink.ink, 2, [], [[10, height - 10], [10 + length, height - 10]]);
    brush.fillStyle = ink.ink;
    brush.font = "12px system-ui, sans-serif";
    brush.textAlign = "left";
    brush.textBaseline = "bottom";
    brush.fillText(`${Number(step.toPrecision(1))} m`, 12, height - 13);
  }
}

function* whole(trail, at) {
  let last = null;
  for (const [t, x, y] of trail) {
    if (last !== null && t - last > 0.6) yield null;
    last = t;
    yield at(x, y);
  }
}

function body(brush, at, scale, [x, y, theta], colour, paper) {
  const [px, py] = at(x, y), size = Math.max(BODY * scale, 7);
  brush.fillStyle = colour;
  brush.beginPath();
  brush.arc(px, py, size, 0, 2 * Math.PI);
  brush.fill();
  if (theta === null) return;
  const corner = (ahead, left) => [
    px + size * (ahead * Math.cos(theta) - left * Math.sin(theta)), py - size * (ahead * Math.sin(theta) + left * Math.cos(theta)),
  ];
  brush.fillStyle = paper;
  brush.beginPath();
  for (const place of [[0.78, 0], [-0.5, 0.52], [-0.22, 0], [-0.5, -0.52]]) brush.lineTo(...corner(...place));
  brush.fill();
}

// The leader as its follower believes it to be, where that is two seconds later (AHEAD_S), and the station that follows from it.
function belief(brush, at, scale, frame, ink) {
  const { pose: [x, y, theta], ellipse } = frame.estimate.leader, v1 = frame.estimate.v1[0];
  if ([x, y, theta, v1].includes(null)) return;
  ring(brush, at(x, y), Math.max(BODY * scale, 7) + 3, ink.leader);
  const tip = [x + v1 * AHEAD_S * Math.cos(theta), y + v1 * AHEAD_S * Math.sin(theta)];
  stroke(brush, ink.paper, 5, [], [at(x, y), at(...tip)]);
  stroke(brush, ink.leader, 2.5, [], [at(x, y), at(...tip)]);
  if (ellipse && !ellipse.includes(null)) {
    const [major, minor, angle] = ellipse;
    brush.strokeStyle = ink.leader;
    brush.lineWidth = 1.5;
    brush.beginPath();
    brush.ellipse(...at(...tip), Math.min(major * scale, 5000), Math.min(minor * scale, 5000), -angle, 0, 2 * Math.PI);
    brush.globalAlpha = 0.18;
    brush.fillStyle = ink.leader;
    brush.fill();
    brush.globalAlpha = 1;
    brush.stroke();
  }
  const [rho, alpha1] = frame.station;
  ring(brush, at(x + rho * Math.cos(theta + alpha1), y + rho * Math.sin(theta + alpha1)), Math.max(BODY * scale, 7) + 3, ink.wish);
}

function ring(brush, [x, y], radius, colour) {
  brush.strokeStyle = colour;
  brush.lineWidth = 2;
  brush.setLineDash([5, 4]);
  brush.beginPath();
  brush.arc(x, y, radius, 0, 2 * Math.PI);
  brush.stroke();
  brush.setLineDash([]);
}
