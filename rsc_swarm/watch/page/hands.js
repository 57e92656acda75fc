// Hands on the flight: for whoever came with the token. What they do happens now, whatever moment is shown.

import { make } from "./panel.js";
import { COLUMNS, FLYING, FROZEN, GROUP, LOST, STATE } from "./recording.js";

const SPEEDS = [0.1, 0.25, 0.5, 1, 2];
const LOSSES = [0, 0.1, 0.3, 0.5, 0.8, 1];

/** What a fault does, in words. */
export function told({ kind, agents, groups, loss }) {
  const who = agents?.length ? `drone${agents.length > 1 ? "s" : ""} ${agents.join(", ")}` : "";
  if (kind === "part") return `part ${groups[0].join(", ")} from the others`;
  if (kind === "loss") return `lose ${Math.round(100 * loss)} % of all frames`;
  return kind === "heal" ? "heal the radio" : `${kind} ${who}`;
}

export class Hands {
  constructor(element, say) {
    Object.assign(this, { element, say, pace: null, buttons: [], loss: 0 });
    this.pause = make("button", "Pause the flight", { onclick: () => this.setPace({ ...this.pace, paused: !this.pace.paused }) });
    this.speed = make("select", [...SPEEDS.map((speed) => make("option", `${speed} ×`, { value: speed })), make("option", "as fast as it goes", { value: "" })],
      { title: "How fast the flight goes", onchange: () => this.setPace({ speed: this.speed.value ? Number(this.speed.value) : null, paused: false }) });
    this.who = make("span", "", { class: "label" });
    const some = (states) => (rows) => rows.length > 0 && rows.every((state) => states.includes(state));
    const act = (name, kind, fits, title, danger = "") => {
      const button = make("button", name, { title, class: danger, id: `hand-${kind}`, onclick: () => this.act(kind) });
      this.buttons.push({ button, fits, kind });
      return button;
    };
    this.heal = make("button", "Heal", { title: "All hear each other again", onclick: () => this.say({ fault: { kind: "heal" } }) });
    this.lose = make("select", LOSSES.map((loss) => make("option", `lose ${Math.round(100 * loss)} %`, { value: loss })),
      { title: "Share of frames that the radio loses", onchange: () => this.say({ fault: { kind: "loss", loss: Number(this.lose.value) } }) });
    const group = (...content) => make("div", content, { class: "group" });
    this.paceGroup = group(this.pause, this.speed);
    element.append(this.paceGroup, group(this.who, act("Kill", "kill", some([FLYING, FROZEN]), "The drone dies (k)", "danger"),
      act("Freeze", "freeze", some([FLYING]), "It hangs: senses, hears and says nothing (z)"), act("Thaw", "thaw", some([FROZEN]), "It goes on (t)"),
      act("Restart", "restart", some([FLYING, FROZEN, LOST]), "It begins anew, knowing nothing (r)"),
      act("Part", "part", (rows, all) => rows.length > 0 && rows.length < all, "The radio parts these drones from the others")),
    group(make("span", "radio", { class: "label" }), this.heal, this.lose));
  }

  setPace(pace) { this.say({ pace: { speed: pace.speed, paused: pace.paused } }); }

  /** The flight's pace, as the flight tells it. */
  goes(pace) {
    this.pace = pace;
    this.pause.textContent = pace.paused ? "Let the flight go on" : "Pause the flight";
    this.pause.setAttribute("aria-pressed", String(pace.paused));
    this.speed.value = pace.speed === null ? "" : String(pace.speed);
  }

  /** A fault that somebody's hand has brought about. */
  did({ kind, loss }) {
    if (kind !== "loss") return;
    if (![...this.lose.options].some((option) => Number(option.value) === loss)) this.lose.add(new Option(`lose ${Math.round(100 * loss)} %`, loss));
    this.lose.value = String(loss);
  }

  /** Fit what can be done to who is chosen, and to the flight as it is now. */
  fit(newest, chosen, over) {
    this.chosen = [...chosen].sort((a, b) => a - b);
    const states = this.chosen.map((drone) => newest.drones[drone * COLUMNS + STATE]);
    const names = this.chosen.length > 4 ? `${this.chosen.length} drones` : `drone${this.chosen.length > 1 ? "s" : ""} ${this.chosen.join(", ")}`;
    this.who.textContent = this.chosen.length ? names : "click a drone to lay hands on it";
    for (const entry of this.buttons) entry.button.disabled = over || !entry.fits(states, newest.count);
    let parted = false;
    for (let row = GROUP; row < newest.drones.length; row += COLUMNS) parted ||= newest.drones[row] > 0;
    this.heal.disabled = over || !parted;
    for (const each of [this.pause, this.speed, this.lose]) each.disabled = over;
    this.paceGroup.hidden = !this.pace;
    this.count = newest.count;
  }

  act(kind) {
    const entry = this.buttons.find((each) => each.kind === kind);
    if (this.element.hidden || entry.button.disabled) return;
    if (kind !== "part") { this.say({ fault: { kind, agents: this.chosen } }); return; }
    const others = Array.from({ length: this.count }, (_, drone) => drone).filter((drone) => !this.chosen.includes(drone));
    this.say({ fault: { kind, groups: [this.chosen, others] } });
  }
}
