// The page: takes in what the server tells, keeps the moment that is shown, and hands both to those who draw.

import { about, legend } from "./about.js";
import { Camera, draw, droneAt } from "./field.js";
import { Hands, told as toldOf } from "./hands.js";
import { Marks } from "./marks.js";
import { Panel } from "./panel.js";
import { Recording } from "./recording.js";
import { Timeline } from "./timeline.js";

const $ = (id) => document.getElementById(id);
const SPEEDS = [0.1, 0.25, 0.5, 1, 2, 4, 8];
const LAYERS = ["trails", "edges", "places", "numbers", "links", "plans"];

const recording = new Recording(), camera = new Camera(), chosen = new Set();
const shown = { trails: true, edges: true, places: true, numbers: true, slots: true, links: true, plans: true };
const play = { time: 0, on: true, live: true, speed: 1, rate: 1 };
const arrivals = []; // when pictures came, and up to which time of the flight, over the last second
let marks = null, socket = null, connected = false, drawn = 0, noteUntil = 0;

const panel = new Panel($("panel"), go, choose);
const hands = new Hands($("hands"), (word) => socket.send(JSON.stringify(word)));
const timeline = new Timeline($("timeline"), go);
window.page = { recording, camera, chosen, play, frames: () => drawn, marks: () => marks?.all ?? [] }; // for tests, and the curious

function connect() {
  socket = new WebSocket(`${location.protocol === "https:" ? "wss" : "ws"}://${location.host}/live`);
  socket.binaryType = "arraybuffer";
  socket.onopen = () => { connected = true; if (location.hash.length > 1) socket.send(location.hash.slice(1)); };
  socket.onmessage = ({ data }) => (typeof data === "string" ? hear(JSON.parse(data)) : see(data));
  socket.onclose = () => { connected = false; recording.over = true; };
}

function hear(word) {
  if (word.kind === "scene") {
    recording.scene = word.scene;
    marks = new Marks(word.scene);
    const { name, agents, policy, map, seed } = word.scene;
    $("name").textContent = document.title = `${name}`;
    hands.did({ kind: "loss", loss: word.scene.loss });
    $("what").textContent = `${agents} drones, policy ${policy}, map ${map}, seed ${seed}`;
  } else if (word.kind === "gathered") {
    $("state").textContent = `waiting for drones: ${word.ready} of ${word.drones}`;
  } else if (word.kind === "you") {
    $("hands").hidden = !word.hands;
    if (!word.hands) note("this address has another token: you can look on");
  } else if (word.kind === "pace") hands.goes(word);
  else if (word.kind === "hand") {
    const text = `by hand: ${toldOf(word.fault)}`;
    marks.add(word.fault.at_s, "end", "hand", word.fault.agents, text);
    hands.did(word.fault);
    note(text);
  } else if (word.kind === "refused") note(word.text.replace(/^by hand: (faults\.\d+: )?/, ""));
  else if (word.kind === "replay") {
    recording.replay = recording.over = true;
    play.live = false;
    if (word.recorded) note(`as it was recorded, without radio and beliefs: ${word.recorded}`);
  } else if (word.kind === "report") {
    recording.report = word.report;
    marks?.add(word.report.time_s, "end", word.report.success ? "success" : "failure", [], word.report.detail);
  }
}

function note(text) {
  $("note").textContent = text;
  $("note").classList.add("shown");
  noteUntil = performance.now() + 4000;
}

function see(data) {
  const came = recording.take(data), now = performance.now();
  came.forEach((picture) => marks.see(picture));
  if (!came.length) return;
  arrivals.push([now / 1000, recording.end]);
  while (arrivals.length > 2 && now / 1000 - arrivals[1][0] > 1) arrivals.shift();
  const [wall, flown] = arrivals[0], seconds = now / 1000 - wall;
  if (seconds > 0.2) play.rate = (recording.end - flown) / seconds;
}

/** Show another moment; from then on it stands, or plays from there. */
function go(time, mark) {
  play.time = Math.max(0, Math.min(time, recording.end));
  play.live = false;
  if (mark?.drones.length) choose(mark.drones);
}

function choose(drones, more = false) {
  if (!more) chosen.clear();
  for (const drone of drones) chosen.has(drone) && more ? chosen.delete(drone) : chosen.add(drone);
}

function goLive() { play.live = true; play.on = true; }

function togglePlay() {
  play.on = !play.on;
  if (!play.on) play.live = false;
  else if (play.time >= recording.end - 1e-6 && recording.over) play.time = 0;
}

/** Let time pass: live, a little behind the newest picture, so that there is always one to move towards. */
function pass(seconds) {
  const { end } = recording;
  if (play.live && !recording.over) {
    const aim = end - Math.min(0.6, Math.max(0.02, play.rate * 0.12));
    play.time += play.rate * seconds + (aim - play.time) * Math.min(1, 3 * seconds);
    if (Math.abs(aim - play.time) > 2) play.time = aim;
  } else if (play.on) play.time += play.speed * seconds;
  play.time = Math.max(0, Math.min(play.time, end));
}

function status(moment) {
  const { report, over } = recording;
  $("time").textContent = (moment?.time ?? 0).toFixed(2);
  $("factor").textContent = moment?.factor && !over ? `${moment.factor.toFixed(1)} × real time` : "";
  const looking = !play.live || over;
  const [text, kind] = report && play.time >= recording.end - 0.01 ? (report.success ? ["success", "live"] : [report.failure ?? "failed", "failed"])
    : hands.pace?.paused && !over ? ["flight paused", "paused"] : over && !report && !recording.replay ? ["the flight is over", ""] : looking ? (play.on ? [recording.replay ? "replay" : "looking back", ""] : ["paused", "paused"]) : ["live", "live"];
  if (!recording.pictures.length) $("state").textContent = connected ? (/^waiting/.test($("state").textContent) ? $("state").textContent : recording.scene ? "taking in the flight" : "waiting for the drones") : "not connected";
  else { $("state").textContent = text; $("state").className = `pill ${kind}`; }
  $("play").textContent = play.on ? "❚❚" : "▶";
  $("live").setAttribute("aria-pressed", String(play.live && !over));
  $("live").disabled = over;
}

let before = performance.now(), told = 0;
function frame(now) {
  pass(Math.min(0.25, (now - before) / 1000));
  before = now;
  if (recording.scene) {
    const moment = recording.at(play.time);
    camera.width = $("field").clientWidth; camera.height = $("field").clientHeight;
    camera.steer(recording.scene, moment, $("panel").offsetWidth + 24, $("legend").offsetHeight + 12);
    draw($("field"), camera, recording, moment, shown, chosen);
    if (now - told > 120 && moment) {
      told = now;
      const span = recording.over ? recording.end : Math.max(recording.scene.ticks * recording.scene.tick_s, recording.end);
      timeline.draw(marks.all, play.time, recording.end, Math.max(span, 0.5));
      panel.show(recording, moment, marks.all, chosen);
      status(moment);
      hands.fit(recording.newest ?? moment, chosen, recording.over);
      if (now > noteUntil) $("note").classList.remove("shown");
    }
    drawn++;
  } else if (now - told > 250) { told = now; status(null); }
  requestAnimationFrame(frame);
}

function theme(name) {
  document.documentElement.dataset.theme = name;
  $("theme").textContent = name === "dark" ? "Light" : "Dark";
}

const keys = {
  " ": togglePlay, Home: () => go(0), End: goLive, Escape: () => choose([]), f: () => { camera.mode = "field"; }, c: () => { camera.mode = "swarm"; },
  "+": () => camera.zoom(1.25), "=": () => camera.zoom(1.25), "-": () => camera.zoom(0.8), d: toggleTheme, l: () => { $("legend").hidden = !$("legend").hidden; }, "?": () => about($("about")),
  ArrowLeft: (event) => go(play.time - (event.shiftKey ? 1 : 0.1)), ArrowRight: (event) => go(play.time + (event.shiftKey ? 1 : 0.1)),
  k: () => hands.act("kill"), z: () => hands.act("freeze"), t: () => hands.act("thaw"), r: () => hands.act("restart"),
  ...Object.fromEntries(LAYERS.map((layer, index) => [`${index + 1}`, () => { shown[layer] = !shown[layer]; }])),
};

function toggleTheme() { theme(document.documentElement.dataset.theme === "dark" ? "light" : "dark"); }

function listen() {
  const canvas = $("field");
  let held = null;
  canvas.addEventListener("wheel", (event) => { event.preventDefault(); camera.zoom(Math.exp(-event.deltaY / 500), event.offsetX, event.offsetY); }, { passive: false });
  canvas.addEventListener("pointerdown", (event) => { held = { x: event.offsetX, y: event.offsetY, moved: false }; canvas.setPointerCapture(event.pointerId); });
  canvas.addEventListener("pointermove", (event) => {
    if (!held) return;
    const [dx, dy] = [event.offsetX - held.x, event.offsetY - held.y];
    if (!held.moved && Math.hypot(dx, dy) < 4) return;
    Object.assign(held, { x: event.offsetX, y: event.offsetY, moved: true });
    canvas.classList.add("dragging");
    camera.mode = "free"; camera.x -= dx / camera.scale; camera.y += dy / camera.scale;
  });
  canvas.addEventListener("pointerup", (event) => {
    canvas.classList.remove("dragging");
    const moment = recording.at(play.time);
    if (held && !held.moved && moment) {
      const drone = droneAt(camera, moment, event.offsetX, event.offsetY);
      if (drone >= 0 || !event.shiftKey) choose(drone >= 0 ? [drone] : [], event.shiftKey);
    }
    held = null;
  });
  addEventListener("keydown", (event) => {
    if (event.ctrlKey || event.altKey || event.metaKey || /^(INPUT|SELECT)$/.test(event.target.tagName)) return;
    const act = keys[event.key];
    if (!act || (event.key === " " && event.target.tagName === "BUTTON")) return;
    event.preventDefault();
    act(event);
  });
  for (const [id, act] of Object.entries({ fit: keys.f, follow: keys.c, theme: toggleTheme, help: keys["?"], play: togglePlay, live: goLive })) $(id).onclick = act;
  $("speed").append(...SPEEDS.map((speed) => new Option(`${speed} ×`, speed, speed === 1, speed === 1)));
  $("speed").onchange = () => { play.speed = Number($("speed").value); play.live = false; };
}

theme(matchMedia("(prefers-color-scheme: dark)").matches ? "dark" : "light");
legend($("legend"));
listen();
connect();
requestAnimationFrame(frame);
