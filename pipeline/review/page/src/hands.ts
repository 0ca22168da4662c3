/** Mouse, fingers, pen and keys on the model. */
import { Pinch } from "./graphics";

const FLIGHT_MM = 6;
const CLICK_PX = 4;

/** The actions of hands; angles in rad, `pick` is at a point of the picture from -1 to 1, x to the right and y up. */
export interface Held {
  isInside(): boolean;
  enter(): void;
  fly(mm: number): void;
  glance(yaw: number, pitch: number): void;
  pick(x: number, y: number): void;
}

/** Connect mouse, touch, pen and keys to what a canvas shows. */
export function hold(canvas: HTMLCanvasElement, held: Held): void {
  const pinch = new Pinch();
  let pressed: { x: number; y: number } | null = null;
  canvas.addEventListener("pointerdown", (e) => { pinch.down(e); pressed = { x: e.clientX, y: e.clientY }; });
  canvas.addEventListener("pointermove", (e) => {
    if (!held.isInside()) return;
    const { spread, dx, dy } = pinch.move(e);
    if (spread) { pressed = null; held.fly(spread * 0.4); }
    else if (e.buttons === 1) held.glance(dx * 0.004, dy * 0.004);
  });
  canvas.addEventListener("pointerup", (e) => {
    pinch.up(e);
    if (pressed && Math.hypot(e.clientX - pressed.x, e.clientY - pressed.y) <= CLICK_PX) {
      const box = canvas.getBoundingClientRect();
      held.pick(((e.clientX - box.left) / box.width) * 2 - 1, 1 - ((e.clientY - box.top) / box.height) * 2);
    }
    pressed = null;
  });
  canvas.addEventListener("pointercancel", (e) => { pinch.up(e); pressed = null; });
  canvas.addEventListener("wheel", (e) => { if (held.isInside()) { e.preventDefault(); held.fly(-e.deltaY / 20); } }, { passive: false });
  canvas.addEventListener("keydown", (e) => key(e, held));
}

function key(event: KeyboardEvent, held: Held): void {
  if (event.ctrlKey || event.metaKey || event.altKey) return;
  const step = event.shiftKey ? 5 * FLIGHT_MM : FLIGHT_MM;
  const keys: Record<string, () => void> = {
    w: () => held.fly(step), s: () => held.fly(-step), ArrowUp: () => held.fly(step), ArrowDown: () => held.fly(-step),
    a: () => held.glance(0.08, 0), d: () => held.glance(-0.08, 0), ArrowLeft: () => held.glance(0.08, 0), ArrowRight: () => held.glance(-0.08, 0),
  };
  const act = keys[event.key.length === 1 ? event.key.toLowerCase() : event.key];
  if (!act) return;
  if (!held.isInside()) held.enter();
  act();
  event.preventDefault();
}
