// A flight as the server tells it: one scene and many pictures (their bytes: world/outlets/picture.py). No drawing here.

export const X = 0, Y = 1, VX = 2, VY = 3, SLOT = 4, STATE = 5, NEAREST = 6, EDGE = 7, HEARD = 8, REJECTED = 9, GROUP = 10;
export const COLUMNS = 11;
export const CARRIED = 1, MISSED = 2, DELAYED = 4; // bits of what became of frames on a link
export const LOST = 0, FROZEN = 1, FLYING = 2;

const text = new TextDecoder();

/** One picture out of its bytes. */
export function unpack(bytes, tick_s) {
  const view = new DataView(bytes.buffer, bytes.byteOffset, bytes.byteLength);
  const length = view.getUint32(0, true);
  const head = JSON.parse(text.decode(bytes.subarray(4, 4 + length)));
  let at = 4 + length;
  const block = (kind, count) => {
    const size = count * kind.BYTES_PER_ELEMENT;
    const copy = bytes.slice(at, at + size);
    at += size;
    return new kind(copy.buffer);
  };
  const drones = block(Float32Array, head.drones * COLUMNS), [planners, ahead] = head.plans;
  const plans = { ahead, points: block(Float32Array, 2 * planners * ahead) };
  const beliefs = block(Int16Array, 3 * head.beliefs), links = block(Int16Array, 3 * head.links);
  return { ...head, time: head.tick * tick_s, count: head.drones, drones, plans, beliefs, links };
}

/** All pictures of one flight that have come so far, by their times. */
export class Recording {
  constructor() {
    this.scene = null;
    this.pictures = [];
    this.report = null;
    this.over = false;
  }

  get newest() { return this.pictures[this.pictures.length - 1]; }
  get end() { return this.pictures.length ? this.newest.time : 0; }

  /** Take in pictures, each after its length; those that are new. */
  take(buffer) {
    const bytes = new Uint8Array(buffer), view = new DataView(buffer), came = [];
    for (let at = 0; at < bytes.length;) {
      const length = view.getUint32(at, true);
      const picture = unpack(bytes.subarray(at + 4, at + 4 + length), this.scene.tick_s);
      at += 4 + length;
      if (!this.pictures.length || picture.tick > this.newest.tick) {
        this.pictures.push(picture);
        came.push(picture);
      }
    }
    return came;
  }

  /** The place of the last picture at or before a time. */
  place(time) {
    let low = 0, high = this.pictures.length - 1;
    while (low < high) {
      const middle = (low + high + 1) >> 1;
      if (this.pictures[middle].time <= time + 1e-9) low = middle; else high = middle - 1;
    }
    return low;
  }

  /** The flight at a time: the picture before it, with positions in between, and with the plans of the one after it: those before it
   * have been flown by then where the flight is fast. Null before there is any. */
  at(time) {
    if (!this.pictures.length) return null;
    const place = this.place(time), before = this.pictures[place], after = this.pictures[place + 1];
    const moment = { ...before, place, time: Math.max(time, before.time) };
    if (!after || time <= before.time) return { ...moment, time: before.time };
    const share = Math.min(1, (time - before.time) / (after.time - before.time));
    const drones = before.drones.slice();
    for (let at = 0; at < drones.length; at += COLUMNS)
      for (let column = X; column <= VY; column++)
        drones[at + column] += share * (after.drones[at + column] - before.drones[at + column]);
    return { ...moment, drones, plans: after.plans };
  }
}

/** What follows from a moment and its scene: who holds which slot, and the tree's edges. */
export function tree(scene, moment) {
  const holder = new Int32Array(scene.agents).fill(-1);
  for (let drone = 0; drone < moment.count; drone++)
    if (moment.drones[drone * COLUMNS + STATE] !== LOST) holder[moment.drones[drone * COLUMNS + SLOT]] = drone;
  const edges = [];
  for (let drone = 0; drone < moment.count; drone++) {
    const row = drone * COLUMNS, parent = scene.parent[moment.drones[row + SLOT]];
    if (moment.drones[row + STATE] === LOST || parent < 0 || holder[parent] < 0) continue;
    edges.push({ drone, leader: holder[parent], error: moment.drones[row + EDGE] });
  }
  return { holder, edges };
}

/** How far a drone is from the place of its slot, m. */
export function placeError(scene, moment, drone) {
  const row = drone * COLUMNS, [x, y] = scene.offsets_m[moment.drones[row + SLOT]];
  return Math.hypot(moment.drones[row + X] - x - scene.target_mps * moment.time, moment.drones[row + Y] - y);
}
