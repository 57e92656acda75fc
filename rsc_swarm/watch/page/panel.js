// The panel: the swarm in figures, or one drone by click: what it knows, hears and believes.

import { colours, fitted, rating } from "./field.js";
import { CARRIED, COLUMNS, DELAYED, EDGE, FLYING, FROZEN, HEARD, LOST, MISSED, NEAREST, REJECTED, SLOT, STATE, VX, VY, X, Y, placeError, tree } from "./recording.js";

/** An element with a text or children. */
export function make(name, content = [], attributes = {}) {
  const element = document.createElement(name);
  for (const [key, value] of Object.entries(attributes)) key.startsWith("on") ? (element[key] = value) : element.setAttribute(key, value);
  element.append(...(Array.isArray(content) ? content : [content]));
  return element;
}

const figures = (rows) => make("dl", rows.flatMap(([name, value, kind = ""]) => [make("dt", name), make("dd", value, { class: kind })]));
const metres = (value) => (value > 1e5 ? "nothing near" : `${value.toFixed(2)} m`);
const percent = (share) => `${(100 * share).toFixed(1)} %`;
const safe = (value, limit) => (value < limit ? "bad" : value < 2 * limit ? "fair" : "");

/** From whom frames reached a drone lately, late or not at all. */
function hears(moment, drone) {
  const from = { [CARRIED]: [], [DELAYED]: [], [MISSED]: [] };
  for (let at = 0; at < moment.links.length; at += 3)
    if (moment.links[at + 1] === drone) for (const fate of [CARRIED, DELAYED, MISSED]) if (moment.links[at + 2] & fate) from[fate].push(moment.links[at]);
  const list = (fate) => from[fate].slice(0, 10).join(", ") + (from[fate].length > 10 ? " ..." : "");
  const told = [["frames from", list(CARRIED) || "nobody"]];
  if (from[DELAYED].length) told.push(["late ones from", list(DELAYED), "fair"]);
  if (from[MISSED].length) told.push(["lost ones from", list(MISSED), "bad"]);
  const row = drone * COLUMNS;
  return [...told, ["believes fresh frames of", `${moment.drones[row + HEARD]}`], ["frames it refused", `${moment.drones[row + REJECTED]}`]];
}

export class Panel {
  constructor(aside, go, choose) {
    Object.assign(this, { aside, go, choose, held: false });
    // What is under a finger stays there until it is lifted: else no click would be one.
    aside.addEventListener("pointerdown", () => { this.held = true; });
    for (const end of ["pointerup", "pointercancel"]) addEventListener(end, () => { this.held = false; });
  }

  show(recording, moment, marks, chosen) {
    if (!recording.scene || !moment || this.held) return;
    const one = chosen.size === 1 ? [...chosen][0] : -1;
    const content = one >= 0 ? this.drone(recording.scene, moment, one) : this.swarm(recording, moment, marks, chosen);
    const scroll = this.aside.scrollTop;
    this.aside.replaceChildren(...content);
    this.aside.scrollTop = scroll;
    if (one >= 0) this.beliefs(recording.scene, moment, one);
  }

  swarm({ scene, report }, moment, marks, chosen) {
    const states = [0, 0, 0];
    let nearest = Infinity, error = 0, away = 0;
    for (let drone = 0; drone < moment.count; drone++) {
      const row = drone * COLUMNS, state = moment.drones[row + STATE];
      states[state]++;
      if (state === LOST) continue;
      nearest = Math.min(nearest, moment.drones[row + NEAREST]);
      error = Math.max(error, moment.drones[row + EDGE]);
      away = Math.max(away, placeError(scene, moment, drone));
    }
    const { sent, delivered, partition, burst, loss } = moment.frames, lost = partition + burst + loss;
    const rows = [
      ["flying", `${states[FLYING]} of ${scene.agents}`],
      ...(states[FROZEN] ? [["hanging", `${states[FROZEN]}`, "fair"]] : []),
      ...(states[LOST] ? [["lost", `${states[LOST]}`, "bad"]] : []),
      ["worst edge error", percent(error), rating(error, scene.edge_tolerance)],
      ["farthest from its slot", `${away.toFixed(2)} m`],
      ["nearest to anything", metres(nearest), safe(nearest, scene.collision_m)],
    ];
    if (sent !== undefined) rows.push(
      ["frames sent", sent.toLocaleString("en")],
      ["frames lost", percent(lost / Math.max(1, lost + delivered))],
      ["swaps made", `${moment.swaps.committed + moment.swaps.vacated}`],
    );
    const events = marks.filter((mark) => mark.time <= moment.time + 1e-6).slice(-9).reverse();
    const list = events.map((mark) => make("li", [make("b", `${mark.time.toFixed(2)} s`), mark.text],
      { onclick: () => { this.go(mark.time); if (mark.drones.length) this.choose(mark.drones); } }));
    const head = chosen.size > 1 ? `${chosen.size} drones chosen` : "Swarm";
    return [
      make("h2", head), figures(rows),
      make("h3", "What happened"), list.length ? make("ul", list) : make("p", "nothing yet"),
      ...(report ? [make("h3", "How it ended"), make("p", report.detail, { class: report.success ? "good" : "bad" })] : []),
      make("p", chosen.size ? "Esc: choose nobody" : "Click a drone to look into it."),
    ];
  }

  drone(scene, moment, drone) {
    const row = drone * COLUMNS, at = (column) => moment.drones[row + column], state = at(STATE);
    const leader = tree(scene, moment).edges.find((edge) => edge.drone === drone);
    const head = make("h2", [`Drone ${drone}`, make("button", "×", { title: "Back to the swarm (Esc)", onclick: () => this.choose([]) })]);
    const told = state === LOST ? "lost" : state === FROZEN ? "hangs" : "flies";
    const off = placeError(scene, moment, drone);
    const rows = [
      ["state", told, state === LOST ? "bad" : state === FROZEN ? "fair" : "good"],
      ["place (x, y)", `${at(X).toFixed(2)}, ${at(Y).toFixed(2)} m`], ["speed", `${Math.hypot(at(VX), at(VY)).toFixed(2)} m/s`],
    ];
    if (state === LOST) return [head, figures(rows)];
    rows.push(
      ["slot", `${at(SLOT)}`], ["off its slot's place", `${off.toFixed(2)} m`],
      ["nearest to anything", metres(at(NEAREST)), safe(at(NEAREST), scene.collision_m)],
      leader ? [`edge to drone ${leader.leader}`, `off by ${percent(leader.error)}`, rating(leader.error, scene.edge_tolerance)]
        : ["edge", scene.parent[at(SLOT)] < 0 ? "none: the root" : "its leader's slot is empty"],
    );
    const wrong = [];
    for (let entry = 0; entry < moment.beliefs.length; entry += 3)
      if (moment.beliefs[entry] === drone) wrong.push(moment.beliefs.subarray(entry + 1, entry + 3));
    return [
      head, make("h3", "Knows"), figures(rows),
      make("h3", "Hears, in the last 0.2 s"), figures(hears(moment, drone)),
      make("h3", "Believes: who is in which slot"),
      make("div", [make("figure", [make("canvas", [], { id: "believed" }), make("figcaption", "its view")]),
        make("figure", [make("canvas", [], { id: "true" }), make("figcaption", "the truth")])], { class: "maps" }),
      make("p", wrong.length ? `wrong about ${wrong.map(([about, slot]) => `drone ${about} (slot ${slot})`).slice(0, 6).join(", ")}${wrong.length > 6 ? ` and ${wrong.length - 6} more` : ""}`
        : "its view is right", { class: wrong.length ? "bad" : "good" }),
    ];
  }

  /** Two small maps of the formation, with the drones in its slots: as believed, and as it is. */
  beliefs(scene, moment, drone) {
    if (!document.getElementById("believed")) return;
    const so = new Map(), believed = new Map(), wrong = new Set();
    for (let other = 0; other < moment.count; other++)
      if (moment.drones[other * COLUMNS + STATE] !== LOST) so.set(other, moment.drones[other * COLUMNS + SLOT]);
    for (const [other, slot] of so) believed.set(other, slot);
    for (let entry = 0; entry < moment.beliefs.length; entry += 3) {
      if (moment.beliefs[entry] !== drone) continue;
      believed.set(moment.beliefs[entry + 1], moment.beliefs[entry + 2]);
      wrong.add(moment.beliefs[entry + 1]);
    }
    const ink = colours(), xs = scene.offsets_m.map(([x]) => x), ys = scene.offsets_m.map(([, y]) => y);
    const left = Math.min(...xs), low = Math.min(...ys), wide = Math.max(...xs) - left, high = Math.max(...ys) - low;
    for (const [id, view] of [["believed", believed], ["true", so]]) {
      const { context: c, width, height } = fitted(document.getElementById(id));
      const scale = Math.min((width - 24) / (wide || 1), (height - 22) / (high || 1));
      const size = scale * scene.spacing_m * 0.6; // too small for numbers: dots, and larger ones where it matters
      c.font = `${Math.min(12, size)}px system-ui, sans-serif`; c.textAlign = "center"; c.textBaseline = "middle";
      for (const [other, slot] of view) {
        const [x, y] = scene.offsets_m[slot];
        c.fillStyle = wrong.has(other) ? ink.bad : other === drone ? ink.accent : ink.ink;
        const at = [width / 2 + (x - left - wide / 2) * scale, height / 2 - (y - low - high / 2) * scale];
        if (size >= 6) c.fillText(`${other}`, ...at);
        else { c.beginPath(); c.arc(...at, wrong.has(other) || other === drone ? 3 : Math.max(0.7, size / 3), 0, 7); c.fill(); }
      }
    }
  }
}
