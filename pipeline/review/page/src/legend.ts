/** What the wall shows, with its colours and their range of values: the same in every pane that shows it. */
import type { Session } from "./session";
import type { Overlay, Point } from "./types";
import { element, number } from "./words";

const PHOTO = "photo", LOSS = "wall_loss";

/** The choice of what the wall shows. */
export function layerChoice(session: Session, label: string): HTMLElement {
  const select = element("select", { "aria-label": label });
  const offer = () => {
    const overlays = session.run.overlays.filter((o) => o.name !== LOSS || !session.source.readOnly);
    select.replaceChildren(element("option", { value: PHOTO }, "Photo"), ...overlays.map((o) => {
      const isOpen = o.name !== LOSS || wallOf(session) !== null;
      return element("option", { value: o.name, disabled: !isOpen }, isOpen ? o.title : `${o.title} (give the wall thickness first)`);
    }));
    select.value = session.layer;
  };
  select.addEventListener("change", () => session.show(select.value));
  session.on(["layer", "state"], offer);
  offer();
  return select;
}

/** The colours and their values; a click on "set" fixes the values for all compared runs. */
export function legend(session: Session): HTMLElement {
  const root = element("div", { class: "legend" });
  const paint = () => {
    const overlay = session.overlay(), limits = session.limits();
    root.hidden = !overlay || !limits;
    root.replaceChildren(...(overlay && limits ? scale(session, overlay, limits) : []), ...(session.source.readOnly || !overlay ? [] : [button(session, root, paint)]));
  };
  session.on(["layer", "limits", "state"], paint);
  paint();
  return root;
}

function scale(session: Session, overlay: Overlay, limits: Point): (HTMLElement | string)[] {
  const ends = overlay.low_mm < 0 ? [" inward", " deep"] : ["", ""];
  const told = limits.map((mm, k) => `${number(overlay.low_mm < 0 ? Math.abs(shown(session, overlay, mm)) : shown(session, overlay, mm))}${ends[k]}`);
  return [element("span", {}, told[0]!), colourBar(overlay.colours), element("span", {}, `${told[1]} ${unit(overlay)}`), element("span", { class: "swatch-grey" }), "not seen"];
}

export function colourBar(colours: string[]): HTMLElement {
  return element("span", { class: "colours" }, ...colours.map((colour) => {
    const part = element("i", {});
    part.style.background = colour;
    return part;
  }));
}

/** Wall loss is shown in % of the wall, but stored in mm like every layer. */
function shown(session: Session, { name }: Overlay, mm: number): number { return name === LOSS ? (100 * mm) / (wallOf(session) ?? 1) : mm; }
function unit({ name }: Overlay): string { return name === LOSS ? "% of the wall" : "mm"; }
function wallOf(session: Session): number | null { return session.state.assumed.wall_thickness_mm ?? session.run.wall_thickness_mm; }

function button(session: Session, root: HTMLElement, back: () => void): HTMLElement {
  if (session.isFixed()) return element("button", { title: "let the colours span every measured value", click: () => session.fix(null) }, "Full range");
  return element("button", { title: "fix the values of the first and last colour, also for the runs compared", click: () => ask(session, root, back) }, "Set limits");
}

function ask(session: Session, root: HTMLElement, back: () => void): void {
  const overlay = session.overlay()!, limits = session.limits()!, per = shown(session, overlay, 1);
  const [low, high] = limits.map((mm, k) => element("input", {
    type: "number", step: "any", required: true, value: (mm * per).toFixed(2), "aria-label": k ? "value of the last colour" : "value of the first colour",
  })) as [HTMLInputElement, HTMLInputElement];
  const form = element("form", { class: "bar", submit: (e) => {
    e.preventDefault();
    const [from, to] = [Number(low.value) / per, Number(high.value) / per];
    high.setCustomValidity(from < to ? "" : "must be more than the first");
    if (from < to) session.fix([from, to]); else high.reportValidity();
  }, keydown: (e) => { if ((e as KeyboardEvent).key === "Escape") back(); } },
    low, " to ", high, ` ${unit(overlay)}; into the wall is positive `, element("button", { class: "accept" }, "Set"), element("button", { type: "button", click: back }, "Cancel"));
  root.replaceChildren(form);
  low.focus();
}
