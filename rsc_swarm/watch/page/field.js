// The field from above. Metres: x forward is to the right, y left is up.

import { CARRIED, COLUMNS, DELAYED, EDGE, FLYING, FROZEN, LOST, MISSED, SLOT, STATE, VX, VY, X, Y, tree } from "./recording.js";

const TRAIL_S = 3, TRAIL_POINTS = 24;
const NEAR = 9; // pixels to a metre, from which on there is room for outlines and dashes

/** The colours of the theme, by the names in page.css. */
export function colours() {
  const style = getComputedStyle(document.documentElement);
  return new Proxy({}, { get: (kept, name) => (kept[name] ??= style.getPropertyValue(`--${name}`).trim()) });
}

/** Fit a canvas to its size on the screen; its context, in CSS pixels. */
export function fitted(canvas) {
  const ratio = Math.min(2, devicePixelRatio || 1), { clientWidth: width, clientHeight: height } = canvas;
  if (canvas.width !== Math.round(width * ratio) || canvas.height !== Math.round(height * ratio)) {
    canvas.width = Math.round(width * ratio);
    canvas.height = Math.round(height * ratio);
  }
  const context = canvas.getContext("2d");
  context.setTransform(ratio, 0, 0, ratio, 0, 0);
  context.clearRect(0, 0, width, height);
  return { context, width, height };
}

/** How relative errors of an edge are told: fine, near the tolerance, beyond it. */
export const rating = (error, tolerance) => (error < tolerance / 2 ? "good" : error < tolerance ? "fair" : "bad");

export class Camera {
  constructor() { this.x = 10; this.y = 0; this.scale = 12; this.mode = "field"; }
  sx(x) { return this.width / 2 + (x - this.x) * this.scale; }
  sy(y) { return this.height / 2 - (y - this.y) * this.scale; }
  mx(sx) { return this.x + (sx - this.width / 2) / this.scale; }
  my(sy) { return this.y - (sy - this.height / 2) / this.scale; }

  zoom(factor, sx = this.width / 2, sy = this.height / 2) {
    const x = this.mx(sx), y = this.my(sy);
    this.scale = Math.min(200, Math.max(1, this.scale * factor));
    this.x += x - this.mx(sx);
    this.y += y - this.my(sy);
    this.mode = "free";
  }

  /** Keep to its mode: the whole field, or the swarm. ``right``, ``bottom``: pixels that are covered. */
  steer(scene, moment, right, bottom) {
    if (this.mode === "free" || !moment) return;
    const box = new Box();
    for (let row = 0; row < moment.drones.length; row += COLUMNS)
      if (moment.drones[row + STATE] !== LOST || this.mode === "field") box.add(moment.drones[row + X], moment.drones[row + Y], 2);
    if (this.mode === "field") {
      box.add(scene.goal_x_m + 4, 0, 0);
      for (const [x, y, radius] of scene.obstacles_m) box.add(x, y, radius + 1);
      const rear = Math.min(...scene.offsets_m.map((offset) => offset[0]));
      box.add(rear - 4, 0, 0);
    }
    if (!box.some) return;
    const wide = Math.max(200, this.width - right), high = Math.max(200, this.height - bottom);
    const scale = Math.min((wide - 60) / box.width, (high - 50) / box.height, 60);
    const x = box.x + right / 2 / scale, y = box.y - bottom / 2 / scale, ease = this.eased ? 0.12 : 1;
    this.scale += (scale - this.scale) * ease;
    this.x += (x - this.x) * ease;
    this.y += (y - this.y) * ease;
    this.eased = true;
  }
}

class Box {
  constructor() { this.left = this.low = Infinity; this.right = this.high = -Infinity; }
  add(x, y, margin) {
    this.left = Math.min(this.left, x - margin); this.right = Math.max(this.right, x + margin);
    this.low = Math.min(this.low, y - margin); this.high = Math.max(this.high, y + margin);
  }
  get some() { return this.right >= this.left; }
  get width() { return this.right - this.left; }
  get height() { return this.high - this.low; }
  get x() { return (this.left + this.right) / 2; }
  get y() { return (this.low + this.high) / 2; }
}

/** Draw a moment. ``shown``: which layers; ``chosen``: a set of drones. */
export function draw(canvas, camera, recording, moment, shown, chosen) {
  const { context: c, width, height } = fitted(canvas), ink = colours(), { scene } = recording;
  camera.width = width; camera.height = height;
  c.lineJoin = c.lineCap = "round";
  grid(c, camera, ink, scene);
  obstacles(c, camera, ink, scene);
  if (!moment) return;
  if (shown.places) places(c, camera, ink, scene, moment);
  if (shown.trails) trails(c, camera, ink, recording, moment);
  if (shown.links) links(c, camera, ink, moment, chosen);
  if (shown.edges) edges(c, camera, ink, scene, moment);
  drones(c, camera, ink, moment, shown, chosen);
  if (shown.plans) plans(c, camera, ink, moment);
}

function grid(c, camera, ink, scene) {
  const step = [1, 2, 5, 10, 20, 50].find((metres) => metres * camera.scale >= 46) ?? 100;
  c.lineWidth = 1; c.strokeStyle = ink.grid; c.fillStyle = ink.soft; c.font = "12px system-ui, sans-serif";
  c.beginPath();
  const labels = [];
  for (let x = Math.ceil(camera.mx(0) / step) * step; x <= camera.mx(camera.width); x += step) {
    const at = Math.round(camera.sx(x)) + 0.5;
    c.moveTo(at, 0); c.lineTo(at, camera.height);
    labels.push([`${x}`, at + 3, 13]);
  }
  for (let y = Math.ceil(camera.my(camera.height) / step) * step; y <= camera.my(0); y += step) {
    const at = Math.round(camera.sy(y)) + 0.5;
    c.moveTo(0, at); c.lineTo(camera.width, at);
    if (at > 24) labels.push([`${y}`, 4, at - 3]);
  }
  c.stroke();
  c.textAlign = "left";
  for (const [text, x, y] of labels) c.fillText(text, x, y);
  c.fillText(`m, squares of ${step} m`, camera.sx(0) > 60 && camera.sx(0) < 200 ? 240 : 60, 28);
  const goal = camera.sx(scene.goal_x_m);
  c.strokeStyle = c.fillStyle = ink.goal; c.lineWidth = 2; c.setLineDash([9, 7]);
  c.beginPath(); c.moveTo(goal, 0); c.lineTo(goal, camera.height); c.stroke(); c.setLineDash([]);
  c.save(); c.translate(goal + 15, camera.height / 2); c.rotate(Math.PI / 2); c.textAlign = "center"; c.font = "600 13px system-ui, sans-serif";
  c.fillText(`goal line, ${scene.goal_x_m.toFixed(1)} m`, 0, 4); c.restore();
}

function obstacles(c, camera, ink, scene) {
  scene.obstacles_m.forEach(([x, y, radius], number) => {
    const sx = camera.sx(x), sy = camera.sy(y);
    c.fillStyle = ink.obstacle; c.strokeStyle = ink["obstacle-line"]; c.lineWidth = 1.5;
    c.beginPath(); c.arc(sx, sy, radius * camera.scale, 0, 7); c.fill(); c.stroke();
    c.setLineDash([3, 4]); c.strokeStyle = ink.bad; c.lineWidth = 1;
    c.beginPath(); c.arc(sx, sy, (radius + scene.collision_m) * camera.scale, 0, 7); c.stroke(); c.setLineDash([]);
    if (radius * camera.scale < 9) return;
    c.fillStyle = ink.ink; c.textAlign = "center"; c.font = "12px system-ui, sans-serif";
    c.fillText(`${number}`, sx, sy + 4);
  });
}

/** Where the slots are to be now. */
function places(c, camera, ink, scene, moment) {
  const target = scene.target_mps * moment.time, size = Math.max(2, Math.min(6, camera.scale * 0.22));
  c.strokeStyle = ink.soft; c.globalAlpha = 0.55; c.lineWidth = 1;
  c.beginPath();
  for (const [x, y] of scene.offsets_m) {
    const sx = camera.sx(target + x), sy = camera.sy(y);
    c.moveTo(sx - size, sy); c.lineTo(sx + size, sy); c.moveTo(sx, sy - size); c.lineTo(sx, sy + size);
  }
  c.stroke(); c.globalAlpha = 1;
}

function trails(c, camera, ink, recording, moment) {
  const first = recording.place(moment.time - TRAIL_S), step = Math.max(1, Math.ceil((moment.place - first) / TRAIL_POINTS));
  const places = [];
  for (let place = moment.place; place >= first; place -= step) places.push(recording.pictures[place].drones);
  c.strokeStyle = ink.drone; c.lineWidth = Math.max(1, Math.min(2.5, camera.scale / 8));
  const parts = 3, each = Math.ceil(places.length / parts);
  for (let part = 0; part < parts; part++) {
    const piece = places.slice(part * each, (part + 1) * each + 1);
    if (piece.length < 1) break;
    c.globalAlpha = 0.42 - 0.13 * part;
    c.beginPath();
    for (let row = 0; row < moment.drones.length; row += COLUMNS) {
      if (moment.drones[row + STATE] === LOST) continue;
      const start = part ? piece[0] : moment.drones;
      c.moveTo(camera.sx(start[row + X]), camera.sy(start[row + Y]));
      for (const drones of piece) c.lineTo(camera.sx(drones[row + X]), camera.sy(drones[row + Y]));
    }
    c.stroke();
  }
  c.globalAlpha = 1;
}

/** What became of frames in the last 0.2 s: of each link the half at its sender. Of chosen drones only what they hear. */
function links(c, camera, ink, moment, chosen) {
  const halves = { carried: [], delayed: [], missed: [] }, { links, drones } = moment;
  for (let at = 0; at < links.length; at += 3) {
    const a = links[at] * COLUMNS, b = links[at + 1] * COLUMNS, fates = links[at + 2];
    if (chosen.size && !chosen.has(links[at + 1])) continue;
    const half = [camera.sx(drones[a + X]), camera.sy(drones[a + Y]),
      camera.sx((drones[a + X] + drones[b + X]) / 2), camera.sy((drones[a + Y] + drones[b + Y]) / 2)];
    if (fates & CARRIED) halves.carried.push(half);
    if (fates & DELAYED) halves.delayed.push(half);
    if (fates & MISSED) halves.missed.push(half);
  }
  for (const [kind, width, alpha, dash] of [["carried", 5, 0.22, []], ["delayed", 2, 0.8, [2, 5]], ["missed", 2, 0.85, [5, 5]]]) {
    c.strokeStyle = ink[kind]; c.lineWidth = Math.max(1, Math.min(width, camera.scale * 0.3)); c.globalAlpha = alpha; c.setLineDash(camera.scale > NEAR ? dash : []);
    c.beginPath();
    for (const [x, y, mx, my] of halves[kind]) { c.moveTo(x, y); c.lineTo(mx, my); }
    c.stroke();
  }
  c.globalAlpha = 1; c.setLineDash([]);
}

/** Where drones plan to be next, as far as they tell: over the drones, since a fifth of a second is no longer than they are. */
function plans(c, camera, ink, moment) {
  const { ahead, points } = moment.plans, dot = Math.max(1, Math.min(2.5, camera.scale / 8)), ends = [];
  c.strokeStyle = c.fillStyle = ink.ink; c.lineWidth = Math.max(1, Math.min(2, camera.scale / 10));
  c.beginPath();
  for (let drone = 0; 2 * drone * ahead < points.length; drone++) {
    const row = drone * COLUMNS;
    if (moment.drones[row + STATE] !== FLYING) continue;
    c.moveTo(camera.sx(moment.drones[row + X]), camera.sy(moment.drones[row + Y]));
    let end = null;
    for (let at = 2 * drone * ahead; at < 2 * (drone + 1) * ahead; at += 2)
      if (!Number.isNaN(points[at])) c.lineTo(...(end = [camera.sx(points[at]), camera.sy(points[at + 1])]));
    if (end) ends.push(end);
  }
  c.stroke();
  c.beginPath();
  for (const [x, y] of ends) { c.moveTo(x + dot, y); c.arc(x, y, dot, 0, 7); }
  c.fill();
}

function edges(c, camera, ink, scene, moment) {
  const classes = { good: [], fair: [], bad: [] };
  for (const edge of tree(scene, moment).edges) classes[rating(edge.error, scene.edge_tolerance)].push(edge);
  for (const [kind, list] of Object.entries(classes)) {
    c.strokeStyle = ink[kind]; c.lineWidth = kind === "good" ? 2 : 2.6;
    c.beginPath();
    for (const { drone, leader } of list) {
      const a = drone * COLUMNS, b = leader * COLUMNS;
      c.moveTo(camera.sx(moment.drones[a + X]), camera.sy(moment.drones[a + Y]));
      c.lineTo(camera.sx(moment.drones[b + X]), camera.sy(moment.drones[b + Y]));
    }
    c.stroke();
  }
}

function drones(c, camera, ink, moment, shown, chosen) {
  const size = Math.max(5, Math.min(13, camera.scale * 0.62)), near = camera.scale > NEAR;
  const far = camera.scale * 5, bodies = { drone: [], frozen: [], lost: [] };
  for (let drone = 0; drone < moment.count; drone++) {
    const row = drone * COLUMNS, state = moment.drones[row + STATE];
    const x = camera.sx(moment.drones[row + X]), y = camera.sy(moment.drones[row + Y]);
    if (x < -30 || y < -30 || x > camera.width + 30 || y > camera.height + 30) continue;
    const [vx, vy] = [moment.drones[row + VX], moment.drones[row + VY]];
    bodies[state === LOST ? "lost" : state === FROZEN ? "frozen" : "drone"].push({ drone, x, y, vx, vy, slot: moment.drones[row + SLOT] });
  }
  c.strokeStyle = ink.ground; c.lineWidth = 1.5;
  for (const kind of ["drone", "frozen"]) {
    c.fillStyle = ink[kind];
    c.beginPath();
    for (const { x, y, vx, vy } of bodies[kind]) arrow(c, x, y, Math.hypot(vx, vy) < 0.05 ? 0 : Math.atan2(-vy, vx), size);
    c.fill();
    if (near) c.stroke();
  }
  c.strokeStyle = ink.frozen; c.lineWidth = 2; c.beginPath();
  for (const { x, y } of bodies.frozen) { c.moveTo(x + size + 4, y); c.arc(x, y, size + 4, 0, 7); }
  c.stroke();
  c.strokeStyle = ink.bad; c.lineWidth = 2.5; c.beginPath();
  for (const { x, y } of bodies.lost) {
    c.moveTo(x - size * 0.6, y - size * 0.6); c.lineTo(x + size * 0.6, y + size * 0.6);
    c.moveTo(x + size * 0.6, y - size * 0.6); c.lineTo(x - size * 0.6, y + size * 0.6);
  }
  c.stroke();
  c.strokeStyle = ink.ink; c.lineWidth = 2; c.beginPath();
  for (const { drone, x, y } of [...bodies.drone, ...bodies.frozen, ...bodies.lost])
    if (chosen.has(drone)) { c.moveTo(x + size + 6, y); c.arc(x, y, size + 6, 0, 7); }
  c.stroke();
  if (!shown.numbers || far < 30) return;
  const big = Math.max(10, Math.min(14, far / 5.5));
  c.textAlign = "left"; c.lineWidth = 3; c.strokeStyle = ink.ground;
  for (const [kind, list] of Object.entries(bodies)) {
    c.font = `650 ${big}px system-ui, sans-serif`; c.fillStyle = kind === "lost" ? ink.bad : ink.ink;
    for (const { drone, x, y } of list) { if (near) c.strokeText(`${drone}`, x + size * 0.7, y - size * 0.7); c.fillText(`${drone}`, x + size * 0.7, y - size * 0.7); }
  }
  if (!shown.slots || far < 60) return;
  c.font = `${big - 2}px system-ui, sans-serif`; c.fillStyle = ink.soft;
  for (const { x, y, slot } of [...bodies.drone, ...bodies.frozen]) c.fillText(`slot ${slot}`, x + size * 0.7, y + size * 0.7 + big * 0.7);
}

function arrow(c, x, y, angle, size) {
  const cos = Math.cos(angle) * size, sin = Math.sin(angle) * size;
  c.moveTo(x + cos, y + sin);
  c.lineTo(x - 0.8 * cos + 0.65 * sin, y - 0.8 * sin - 0.65 * cos);
  c.lineTo(x - 0.4 * cos, y - 0.4 * sin);
  c.lineTo(x - 0.8 * cos - 0.65 * sin, y - 0.8 * sin + 0.65 * cos);
  c.closePath();
}

/** The drone under a place on the screen, or -1. */
export function droneAt(camera, moment, sx, sy) {
  let best = -1, near = 18;
  for (let drone = 0; drone < moment.count; drone++) {
    const row = drone * COLUMNS;
    const far = Math.hypot(camera.sx(moment.drones[row + X]) - sx, camera.sy(moment.drones[row + Y]) - sy);
    if (far < near) { near = far; best = drone; }
  }
  return best;
}
