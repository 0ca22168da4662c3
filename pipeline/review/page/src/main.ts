/** The page of the review. */
import { comparePage } from "./compare";
import { FindingsPanel } from "./findings";
import { FlatView } from "./flat";
import { FrameView } from "./frame";
import { keys, keysDialog } from "./keys";
import { ModelView } from "./model";
import { qualityPage } from "./quality";
import { SectionView } from "./section";
import { Session } from "./session";
import { signPage } from "./sign";
import { Export, Server, type Exported, type Source } from "./source";
import { ToolBar } from "./tools";
import { twinPage } from "./twin";
import * as words from "./words";
import { element } from "./words";

const REFRESH_MS = 4000;

declare global { interface Window { BORESIGHT?: Exported; boresight?: { session: Session; model: ModelView; flat: FlatView; words: typeof words } } }

async function start(): Promise<void> {
  const source: Source = window.BORESIGHT ? new Export(window.BORESIGHT) : new Server();
  const [run, state] = await Promise.all([source.run(), source.state()]);
  const session = new Session(source, run, state);
  document.title = `${run.name} · boresight review`;
  const tools = new ToolBar(session);
  const flat = new FlatView(session), model = new ModelView(session);
  const findings = new FindingsPanel(session), frame = new FrameView(session, () => model.size, model.first), section = new SectionView(session);
  const inspect = element("main", { class: "inspect", id: "inspect" },
    pane("Model", "view-model", model.bar(), model.root),
    pane("Unrolled wall", "view-flat", tools.bar(), tools.root, flat.root, tools.status),
    pane("Recorded frame", "view-frame", frame.bar(), frame.root), pane("Cross-section", "view-section", section.bar(), section.root),
    pane("Findings", "view-findings", null, findings.root));
  const pages: Record<string, HTMLElement> = {
    Inspect: inspect, Quality: qualityPage(session), "Sign-off": signPage(session), Compare: comparePage(session), Twin: twinPage(session),
  };
  const help = keysDialog();
  document.body.replaceChildren(header(session, pages, help), notice(session), ...Object.values(pages), help);
  const open = opener(pages);
  open("Inspect");
  keys(session, { findings, tools, help, open, pages: Object.keys(pages) });
  const look = () => void session.refresh().catch((e: Error) => session.lose(e));
  void model.first.then(look); // the server reads every file of the run for it
  if (!source.readOnly) window.setInterval(() => { if (!document.hidden) look(); }, REFRESH_MS);
  window.boresight = { session, model, flat, words };
  if (findings.order.length) session.select(findings.order[0]!.id);
}

function pane(title: string, id: string, bar: HTMLElement | null, ...content: HTMLElement[]): HTMLElement {
  return element("section", { class: "pane", id, "aria-label": title },
    element("div", { class: "head" }, element("h2", {}, title), bar), ...content);
}

/** Messages that must be visible on every page: a refused action, a lost server, a run that was computed again. */
function notice(session: Session): HTMLElement {
  const text = element("span", { role: "alert" });
  const load = element("button", { hidden: true, click: () => window.location.reload() }, "Load the new results");
  const root = element("div", { class: "notice", hidden: true }, text, load,
    element("button", { click: () => { load.hidden = true; session.say(""); } }, "Close"));
  session.on(["message"], () => { text.textContent = session.message; root.hidden = !session.message && load.hidden; });
  session.on(["recomputed"], () => {
    if (!load.hidden) return;
    load.hidden = false;
    session.say("The run has been computed again. Findings and decisions are those of the new results; pictures and model still those of the old.");
  });
  return root;
}

function header(session: Session, pages: Record<string, HTMLElement>, help: HTMLDialogElement): HTMLElement {
  const open = opener(pages);
  const tabs = element("nav", { "aria-label": "pages" }, ...Object.keys(pages).map((name) =>
    element("button", { class: "tab", "data-page": name, click: () => open(name) }, name)));
  const undo = element("button", { click: () => void session.act({ do: "undo" }) }, "Undo");
  const redo = element("button", { click: () => void session.act({ do: "redo" }), title: "Ctrl+Shift+Z" }, "Redo");
  const badge = element("span", { class: "badge" });
  const who = element("input", { type: "text", value: session.who, placeholder: "your name", id: "who", maxlength: "200", autocomplete: "name" });
  who.addEventListener("change", () => { session.who = who.value.trim(); session.say(""); });
  session.on(["nameless"], () => who.focus());
  const paint = () => {
    undo.disabled = !session.state.may_undo;
    redo.disabled = !session.state.may_redo;
    const last = session.state.history[session.state.history.length - 1];
    undo.title = `${last ? `${last.action.do} ${String(last.action["finding"] ?? "")} by ${last.who}; ` : ""}Ctrl+Z`;
    const { seal } = session;
    badge.textContent = !seal ? "checking…" : seal.signed ? "signed" : seal.signature ? "changed since signed" : "not signed";
    badge.className = `badge ${!seal ? "quiet" : seal.signed ? "signed" : "unsigned"}`;
  };
  session.on(["state", "seal"], paint);
  paint();
  return element("header", {}, element("h1", {}, element("span", { class: "brand" }, "boresight"), ` ${session.run.name}`), tabs,
    element("span", { class: "space" }), badge,
    ...(session.source.readOnly ? [element("span", { class: "quiet" }, "read-only copy")]
      : [undo, redo, element("label", { for: "who" }, "Inspector ", who)]),
    element("button", { click: () => help.showModal(), title: "?" }, "Keys"));
}

function opener(pages: Record<string, HTMLElement>): (name: string) => void {
  return (name) => {
    for (const [key, page] of Object.entries(pages)) page.hidden = key !== name;
    for (const tab of document.querySelectorAll<HTMLElement>("[data-page]")) tab.setAttribute("aria-current", String(tab.dataset["page"] === name));
  };
}

start().catch((error: Error) => {
  document.body.replaceChildren(element("p", { class: "fatal", role: "alert" }, error.message));
});
