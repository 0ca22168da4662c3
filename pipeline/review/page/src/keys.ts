/** The keyboard, with which everything can be done. */
import type { FindingsPanel } from "./findings";
import type { Session } from "./session";
import type { ToolBar } from "./tools";
import { element } from "./words";

// In the model these keys fly and look around; all others have the same meaning everywhere.
const FLIGHT = new Set(["w", "a", "s", "d"]);
const KEYS: [string, string][] = [
  ["N, P", "next, previous finding"], ["A", "accept"], ["R", "reject, with a reason"], ["O", "reopen"], ["C", "comment"],
  ["E", "redraw the outline"], ["S", "split"], ["X, M", "tick for merging; merge the ticked"], ["D", "add a missed defect"],
  ["F", "go to the unrolled wall: arrows move the spot, + − zoom, Enter sets a point, Backspace takes it back"],
  [", and Ctrl+Enter", "next part of a split; done drawing"], ["G", "go to the model: W S fly, A D look around"],
  ["Ctrl+Z, Ctrl+Shift+Z", "undo, redo"], ["1, 2, 3, 4, 5", "the pages in order"], ["Esc", "leave a tool"], ["?", "this list"],
];

export interface Reach {
  findings: FindingsPanel; tools: ToolBar; help: HTMLDialogElement; open: (page: string) => void; pages: string[];
}

export function keysDialog(): HTMLDialogElement {
  const dialog: HTMLDialogElement = element("dialog", { "aria-label": "keys" }, element("h2", {}, "Keys"),
    element("table", {}, ...KEYS.map(([key, what]) => element("tr", {}, element("th", { scope: "row" }, key), element("td", {}, what)))),
    element("button", { class: "accept", click: () => dialog.close() }, "Close"));
  return dialog;
}

export function keys(session: Session, reach: Reach): void {
  document.addEventListener("keydown", (event) => {
    if (reach.help.open) return;
    const target = event.target as HTMLElement;
    const typing = target.matches("input:not([type=checkbox]):not([type=range]), textarea, select");
    if (event.key === "Escape" && !typing) { reach.tools.leave(); return; }
    if (event.ctrlKey || event.metaKey) { if (!typing) withControl(event, session, reach); return; }
    if (typing || event.altKey) return;
    const flying = target.closest(".model") !== null;
    const key = event.key.length === 1 ? event.key.toLowerCase() : event.key; // Caps Lock changes nothing
    const act = looking(reach)[key]
      ?? (session.source.readOnly || (flying && FLIGHT.has(key)) ? undefined : deciding(session, reach)[key]);
    if (!act) return;
    event.preventDefault();
    act();
  });
}

function withControl(event: KeyboardEvent, session: Session, reach: Reach): void {
  if (session.source.readOnly) return;
  const key = event.key.toLowerCase();
  if (key === "z") void session.act({ do: event.shiftKey ? "redo" : "undo" });
  else if (key === "enter" && ["redraw", "add", "split"].includes(session.tool)) void reach.tools.finish();
  else return;
  event.preventDefault();
}

function looking({ findings, help, open, pages }: Reach): Record<string, () => void> {
  const go = (place: string) => () => document.querySelector<HTMLElement>(place)?.focus();
  return {
    n: () => findings.next(1), p: () => findings.next(-1), f: go(".flat canvas"), g: go(".model canvas"),
    "?": () => help.showModal(), ...Object.fromEntries(pages.map((page, k) => [String(k + 1), () => open(page)])),
  };
}

function deciding(session: Session, { findings, tools }: Reach): Record<string, () => void> {
  const toFlat = () => document.querySelector<HTMLElement>(".flat canvas")?.focus();
  const chosen = session.finding;
  const add = () => { session.take("add"); toFlat(); };
  if (!chosen) return { d: add, m: () => void findings.merge() };
  const act = (what: string) => () => void session.act({ do: what, finding: chosen.id });
  const draw = (tool: "redraw" | "split") => () => { session.take(tool); toFlat(); };
  return {
    a: () => void findings.decide({ do: "accept" }), o: act("reopen"), r: () => session.askToReject(), e: draw("redraw"), s: draw("split"), d: add,
    m: () => void findings.merge(), x: () => findings.tick(chosen.id),
    c: () => document.querySelector<HTMLElement>(".comment input")?.focus(),
    ...(session.tool === "split" ? { ",": () => tools.nextPart() } : {}),
  };
}
