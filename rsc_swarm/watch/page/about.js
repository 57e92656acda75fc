// What the page explains of itself: the legend, and the keys.

import { colours } from "./field.js";
import { make } from "./panel.js";
import { glyph } from "./timeline.js";

const line = (colour, more = "") => `<line x1="1" y1="8" x2="29" y2="8" stroke="var(--${colour})" ${more.includes("width") ? "" : 'stroke-width="3"'} ${more}/>`;
const LEGEND = [
  ['<path d="m9 2 13 6-13 6 3-6z" fill="var(--drone)"/>', "drone: number, slot, heading"],
  [line("good"), "edge: length right"],
  ['<circle cx="15" cy="8" r="6" fill="none" stroke="var(--frozen)" stroke-width="2"/>', "drone that hangs"],
  [line("fair"), "edge: off by half of what is allowed"],
  ['<path d="m10 3 10 10M20 3 10 13" stroke="var(--bad)" stroke-width="3"/>', "drone that was lost"],
  [line("bad"), "edge: off by more"],
  ['<path d="M9 8h12M15 2v12" stroke="var(--soft)" stroke-width="1.5"/>', "place of a slot now"],
  ['<circle cx="15" cy="8" r="6" fill="var(--obstacle)"/><circle cx="15" cy="8" r="7.5" fill="none" stroke="var(--bad)" stroke-dasharray="2 2"/>', "obstacle; in the ring is a collision"],
  [line("ink", 'stroke-width="1.5"') + '<circle cx="28" cy="8" r="2" fill="var(--ink)"/>', "where a drone plans to be"],
  [line("carried", 'opacity=".4" stroke-width="5"'), "radio, last 0.2 s: heard"],
  [line("missed", 'stroke-dasharray="4 4"'), "radio: a frame lost"],
  [line("delayed", 'stroke-dasharray="2 4"'), "radio: a frame late"],
];

const KEYS = [
  ["space", "pause, go on"], ["← →", "a little back, forth (Shift: 1 s)"], ["Home End", "the beginning, the newest moment"], ["+ −", "zoom; the wheel does it too"],
  ["f  c", "the whole field; stay with the swarm"], ["drag", "move the field"], ["click, Shift+click", "choose a drone, choose several"], ["Esc", "choose nobody"],
  ["k z t r", "kill, freeze, thaw, restart the chosen drones, if you may"], ["1 … 6", "trails, edges, places, numbers, links, plans on and off"], ["d  l", "dark, light; legend on and off"], ["?", "this"],
];

const MARKS = [
  ["swap", "drones trade slots, or take an empty one"], ["kill", "a drone is lost, or the flight failed"], ["freeze", "a drone hangs"], ["restart", "a drone is back"],
  ["part", "the radio is parted"], ["heal", "the radio is whole again"], ["detour", "a drone leaves its place"], ["success", "in formation beyond the goal line"],
  ["hand", "somebody's hand"],
];

export function legend(element) {
  element.replaceChildren(...LEGEND.map(([drawing, text]) => {
    const key = make("span", text, { class: "key" });
    key.insertAdjacentHTML("afterbegin", `<svg viewBox="0 0 30 16">${drawing}</svg>`);
    return key;
  }));
}

export function about(dialog) {
  const marks = MARKS.map(([kind, text]) => {
    const canvas = make("canvas", [], { width: 20, height: 20 }), c = canvas.getContext("2d");
    c.translate(10, 10);
    glyph(c, kind, colours());
    return make("tr", [make("td", canvas), make("td", text)]);
  });
  const keys = KEYS.map(([key, text]) => make("tr", [make("td", make("kbd", key)), make("td", text)]));
  dialog.replaceChildren(make("h2", "Keys"), make("table", keys), make("h2", "Marks on the time line"), make("table", marks),
    make("button", "Close", { onclick: () => dialog.close() }));
  dialog.showModal();
}
