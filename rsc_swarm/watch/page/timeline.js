// The time line: a lane for each kind of mark, the moment that is shown, and how far the recording goes.

import { colours, fitted } from "./field.js";
import { LANES } from "./marks.js";

const LEFT = 66, RIGHT = 14, TOP = 4, BOTTOM = 18;

export const GLYPHS = {
  swap: ["swap", "diamond"], kill: ["bad", "cross"], freeze: ["frozen", "square"], restart: ["good", "up"], part: ["fair", "bars"],
  heal: ["good", "bars"], detour: ["fair", "up"], success: ["good", "star"], failure: ["bad", "cross"], hand: ["accent", "square"],
};

/** Draw one mark; ``c`` is at its middle. */
export function glyph(c, kind, ink, size = 5) {
  const [colour, shape] = GLYPHS[kind] ?? ["ink", "square"];
  c.fillStyle = c.strokeStyle = ink[colour]; c.lineWidth = 2.4; c.setLineDash([]);
  c.beginPath();
  if (shape === "diamond") { c.moveTo(0, -size); c.lineTo(size, 0); c.lineTo(0, size); c.lineTo(-size, 0); c.fill(); }
  else if (shape === "cross") { c.moveTo(-size, -size); c.lineTo(size, size); c.moveTo(size, -size); c.lineTo(-size, size); c.stroke(); }
  else if (shape === "up") { c.moveTo(0, -size); c.lineTo(size, size); c.lineTo(-size, size); c.fill(); }
  else if (shape === "bars") { c.moveTo(-3, -size); c.lineTo(-3, size); c.moveTo(3, -size); c.lineTo(3, size); c.stroke(); }
  else if (shape === "star") {
    for (let point = 0; point < 10; point++) {
      const far = point % 2 ? size * 0.55 : size * 1.35, angle = (Math.PI * point) / 5 - Math.PI / 2;
      c.lineTo(far * Math.cos(angle), far * Math.sin(angle));
    }
    c.fill();
  } else c.fillRect(-size * 0.8, -size * 0.8, size * 1.6, size * 1.6);
}

export class Timeline {
  constructor(canvas, go, hover) {
    this.canvas = canvas;
    this.span = 1;
    let held = false;
    const time = (event) => this.time(event.offsetX);
    canvas.addEventListener("pointerdown", (event) => {
      held = true;
      canvas.setPointerCapture(event.pointerId);
      const mark = this.near(event.offsetX, event.offsetY);
      go(mark ? mark.time : time(event), mark);
    });
    canvas.addEventListener("pointermove", (event) => {
      if (held) go(time(event));
      else {
        const mark = this.near(event.offsetX, event.offsetY);
        canvas.title = mark ? `${mark.time.toFixed(2)} s: ${mark.text}` : "";
        hover?.(mark);
      }
    });
    canvas.addEventListener("pointerup", () => { held = false; });
  }

  x(time) { return LEFT + (time / this.span) * (this.canvas.clientWidth - LEFT - RIGHT); }
  time(x) { return Math.max(0, Math.min(this.span, ((x - LEFT) / (this.canvas.clientWidth - LEFT - RIGHT)) * this.span)); }
  y(lane) { return TOP + (LANES.findIndex((each) => each.lane === lane) + 0.5) * this.step; }

  near(x, y) {
    let best = null, near = 8;
    for (const mark of this.marks ?? []) {
      const far = Math.hypot(this.x(mark.time) - x, this.y(mark.lane) - y);
      if (far < near) { near = far; best = mark; }
    }
    return best;
  }

  draw(marks, now, end, span) {
    const { context: c, width, height } = fitted(this.canvas), ink = colours();
    this.marks = marks; this.span = span; this.step = (height - TOP - BOTTOM) / LANES.length;
    c.font = "12px system-ui, sans-serif"; c.textBaseline = "middle"; c.textAlign = "right";
    for (const { lane, title } of LANES) {
      const y = this.y(lane);
      c.fillStyle = ink.soft; c.fillText(title, LEFT - 10, y);
      c.strokeStyle = ink.line; c.lineWidth = 1; c.setLineDash([]);
      c.beginPath(); c.moveTo(LEFT, y); c.lineTo(width - RIGHT, y); c.stroke();
      c.strokeStyle = ink.soft;
      c.beginPath(); c.moveTo(LEFT, y); c.lineTo(this.x(Math.min(end, span)), y); c.stroke();
    }
    const step = [0.5, 1, 2, 5, 10, 20, 60, 120, 300, 600].find((seconds) => (seconds / span) * (width - LEFT) >= 46) ?? 1200;
    c.textAlign = "center"; c.fillStyle = ink.soft; c.textBaseline = "alphabetic";
    for (let time = 0; time <= span; time += step) c.fillText(`${time}${time ? "" : " s"}`, this.x(time), height - 4);
    for (const mark of marks) {
      c.save(); c.translate(this.x(mark.time), this.y(mark.lane)); glyph(c, mark.kind, ink); c.restore();
    }
    const at = this.x(now);
    c.strokeStyle = c.fillStyle = ink.ink; c.lineWidth = 1.5;
    c.beginPath(); c.moveTo(at, 0); c.lineTo(at, height - BOTTOM + 2); c.stroke();
    c.beginPath(); c.arc(at, height - BOTTOM + 1, 4.5, 0, 7); c.fill();
  }
}
