/** The page of the review. */
import { FindingsPanel } from "./findings";
import { FlatView } from "./flat";
import { FrameView } from "./frame";
import { ModelView } from "./model";
import { qualityPage } from "./quality";
import { SectionView } from "./section";
import { Session } from "./session";
import { signPage } from "./sign";
import { Export, Server, type Exported, type Source } from "./source";
import { ToolBar } from "./tools";
import { element } from "./words";

const REFRESH_MS = 4000;

declare global { interface Window { BORESIGHT?: Exported; boresight?: { session: Session; model: ModelView } } }

async function start(): Promise<void> {
  const source: Source = window.BORESIGHT ? new Export(window.BORESIGHT) : new Server();
  const [run, state] = await Promise.all([source.run(), source.state()]);
  const session = new Session(source, run, state);
  document.title = `${run.name} · boresight review`;
  const tools = new ToolBar(session);
  const flat = new FlatView(session), model = new ModelView(session);
  const findings = new FindingsPanel(session);
  const inspect = element("main", { class: "inspect", id: "inspect" },
    pane("Model", "view-model", model.root), pane("Unrolled wall", "view-flat", tools.root, flat.root, tools.status),
    pane("Recorded frame", "view-frame", new FrameView(session).root), pane("Cross-section", "view-section", new SectionView(session).root),
    pane("Findings", "view-findings", findings.root));
  const pages: Record<string, HTMLElement> = { Inspect: inspect, Quality: qualityPage(session), "Sign-off": signPage(session) };
  document.body.replaceChildren(header(session, pages), ...Object.values(pages));
  open(pages, "Inspect");
  keys(session, findings, tools);
  if (!source.readOnly) window.setInterval(() => { if (!document.hidden) void session.refresh().catch((e: Error) => session.say(e.message)); }, REFRESH_MS);
  window.boresight = { session, model };
  if (findings.order.length) session.select(findings.order[0]!.id);
}

function pane(title: string, id: string, ...content: HTMLElement[]): HTMLElement {
  return element("section", { class: "pane", id, "aria-label": title }, element("h2", {}, title), ...content);
}

function header(session: Session, pages: Record<string, HTMLElement>): HTMLElement {
  const tabs = element("nav", {}, ...Object.keys(pages).map((name) =>
    element("button", { class: "tab", "data-page": name, click: () => open(pages, name) }, name)));
  const undo = element("button", { click: () => void session.act({ do: "undo" }), title: "Ctrl+Z" }, "Undo");
  const redo = element("button", { click: () => void session.act({ do: "redo" }), title: "Ctrl+Shift+Z" }, "Redo");
  const badge = element("span", { class: "badge" });
  const who = element("input", { type: "text", value: session.who, placeholder: "Your name", "aria-label": "your name", maxlength: "200" });
  who.addEventListener("change", () => { session.who = who.value.trim(); session.say(""); });
  const paint = () => {
    undo.disabled = !session.state.may_undo;
    redo.disabled = !session.state.may_redo;
    badge.textContent = session.state.signed ? "signed" : session.state.signature ? "changed since signed" : "not signed";
    badge.className = `badge ${session.state.signed ? "signed" : "unsigned"}`;
  };
  session.on(["state"], paint);
  paint();
  return element("header", {}, element("h1", {}, element("span", { class: "brand" }, "boresight"), ` ${session.run.name}`), tabs,
    element("span", { class: "space" }), badge,
    ...(session.source.readOnly ? [element("span", { class: "quiet" }, "read-only copy")] : [undo, redo, who]));
}

function open(pages: Record<string, HTMLElement>, name: string): void {
  for (const [key, page] of Object.entries(pages)) page.hidden = key !== name;
  for (const tab of document.querySelectorAll<HTMLElement>("[data-page]")) tab.setAttribute("aria-current", String(tab.dataset["page"] === name));
}

function keys(session: Session, findings: FindingsPanel, tools: ToolBar): void {
  document.addEventListener("keydown", (event) => {
    const target = event.target as HTMLElement;
    const typing = ["INPUT", "TEXTAREA", "SELECT"].includes(target.tagName);
    const flying = target.closest(".model") !== null;
    if (event.key === "Escape") { tools.leave(); return; }
    if ((event.ctrlKey || event.metaKey) && event.key.toLowerCase() === "z" && !typing) {
      event.preventDefault();
      void session.act({ do: event.shiftKey ? "redo" : "undo" });
      return;
    }
    if (typing || flying || event.ctrlKey || event.metaKey || event.altKey) return;
    const chosen = session.finding;
    const acts: Record<string, () => void> = {
      n: () => findings.next(1), p: () => findings.next(-1),
      a: () => { if (chosen) void session.act({ do: "accept", finding: chosen.id }); },
      r: () => { if (chosen) findings.reject(chosen); },
    };
    const act = acts[event.key];
    if (act && !session.source.readOnly) act();
    else if (act && "np".includes(event.key)) act();
  });
}

start().catch((error: Error) => {
  document.body.replaceChildren(element("p", { class: "fatal", role: "alert" }, error.message));
});
