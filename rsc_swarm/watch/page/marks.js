// What happened when: marks for the time line, found by comparing each picture with the one before it.

import { COLUMNS, FLYING, FROZEN, GROUP, LOST, SLOT, STATE, placeError } from "./recording.js";

export const LANES = [
  { lane: "swaps", title: "slots", tells: "a drone took another slot" },
  { lane: "losses", title: "drones", tells: "died, froze, came back" },
  { lane: "radio", title: "radio", tells: "parted, healed" },
  { lane: "detours", title: "detours", tells: "far from its place" },
  { lane: "end", title: "flight", tells: "hands, and how it ended" },
];

const AWAY = 0.6, BACK = 0.3; // of the spacing: farther than that from its place is a detour, until nearer than this again
const TOGETHER_S = 1;

export class Marks {
  constructor(scene) {
    this.scene = scene;
    this.all = [];
    this.before = null;
    this.wasThere = new Uint8Array(scene.agents); // it has been in its place, and is no longer just arriving
    this.away = new Uint8Array(scene.agents);
  }

  add(time, lane, kind, drones, text) {
    this.all.push({ time, lane, kind, drones, text });
  }

  /** Take in the next picture. */
  see(now) {
    const { scene, before } = this;
    let parted = 0, wasParted = 0;
    const swapped = [];
    for (let drone = 0; drone < now.count; drone++) {
      const row = drone * COLUMNS, state = now.drones[row + STATE], slot = now.drones[row + SLOT];
      if (now.drones[row + GROUP]) parted = 1;
      if (before) {
        const was = before.drones[row + STATE], held = before.drones[row + SLOT];
        if (before.drones[row + GROUP]) wasParted = 1;
        if (state !== was) this.changed(now.time, drone, was, state);
        else if (slot !== held && state !== LOST) {
          swapped.push({ drone, held, slot });
          this.wasThere[drone] = this.away[drone] = 0; // on its way to another place
        }
      }
      if (state === FLYING) this.detour(now, drone);
    }
    if (swapped.length) this.swaps(now.time, swapped);
    if (before && parted !== wasParted)
      this.add(now.time, "radio", parted ? "part" : "heal", [], parted ? "the radio is parted" : "the radio is whole again");
    this.before = now;
  }

  changed(time, drone, was, state) {
    if (state === LOST) this.add(time, "losses", "kill", [drone], `drone ${drone} is out of the air`);
    else if (state === FROZEN) this.add(time, "losses", "freeze", [drone], `drone ${drone} hangs`);
    else this.add(time, "losses", "restart", [drone], `drone ${drone} is back${was === LOST ? " from the dead" : ""}`);
  }

  /** Who trades slots does not do so in the same tick: the two halves are one mark. */
  swaps(time, swapped) {
    for (const { drone, held, slot } of swapped) {
      const half = this.all.findLast((mark) => mark.moved && mark.moved.held === slot && mark.moved.slot === held && time - mark.time < TOGETHER_S);
      if (half) {
        half.text = `drones ${half.drones[0]} and ${drone} trade slots ${slot} and ${held}`;
        half.drones.push(drone);
        half.moved = null;
      } else {
        this.add(time, "swaps", "swap", [drone], `drone ${drone} goes from slot ${held} to ${slot}`);
        this.all.at(-1).moved = { held, slot };
      }
    }
  }

  detour(now, drone) {
    const error = placeError(this.scene, now, drone) / this.scene.spacing_m;
    if (!this.wasThere[drone]) this.wasThere[drone] = error < BACK ? 1 : 0;
    else if (!this.away[drone] && error > AWAY) {
      this.away[drone] = 1;
      this.add(now.time, "detours", "detour", [drone], `drone ${drone} leaves its place by more than ${(AWAY * this.scene.spacing_m).toFixed(0)} m`);
    } else if (this.away[drone] && error < BACK) this.away[drone] = 0;
  }
}
