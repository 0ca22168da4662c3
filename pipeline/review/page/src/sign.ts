/** Sign-off: assumptions, signature with its standard, history, and downloads. */
import type { Session } from "./session";
import { element, moment } from "./words";

const PAPERS: [string, string][] = [
  ["report.pdf", "Report, PDF"], ["report.html", "Report, HTML"], ["findings.csv", "Findings, CSV"],
  ["findings.json", "Findings, JSON"], ["pof.csv", "POF pipe tally, CSV"], ["pacp.csv", "PACP conditions, CSV"],
  ["en13508-2.txt", "EN 13508-2 file"], ["pictures.zip", "Pictures of findings, SVG"],
];

export function signPage(session: Session): HTMLElement {
  const root = element("main", { class: "page" });
  const form = session.source.readOnly ? null : signature(session);
  const assumed = session.source.readOnly ? null : element("div", {}, inspection(session), assumptions(session));
  // An input that is inserted again loses the focus, and further typing would be taken for shortcuts.
  const paint = () => {
    const writing = document.activeElement;
    root.replaceChildren(...parts(session, form, assumed));
    if (writing instanceof HTMLElement && root.contains(writing)) writing.focus({ preventScroll: true });
  };
  session.on(["state", "seal"], paint);
  session.on(["named"], () => {
    const name = root.querySelector<HTMLInputElement>("#sign-name");
    if (name && !name.value) name.value = session.who;
  });
  paint();
  return root;
}

// The forms are kept, so that typed text survives updates from the server.
function parts(session: Session, signing: HTMLElement | null, assumed: HTMLElement | null): HTMLElement[] {
  const { state, seal } = session;
  const open = session.standing.filter((f) => f.status === "open").length;
  const last = seal?.signature;
  const standing = !seal ? "Checking the run's files…" : !last ? "Not signed." : seal.signed
    ? `Signed by ${last.name} on ${moment(last.at)}${last.standard ? `, ${last.standard}` : ""}.`
    : `Not signed: changed since ${last.name} signed on ${moment(last.at)}.`;
  const made = [
    element("section", {}, element("h2", {}, "Signature"),
      element("p", { class: seal?.signed ? "signed" : "unsigned" }, standing),
      last?.remarks ? element("p", {}, `Remarks: ${last.remarks}`) : null,
      element("p", { class: "quiet" }, `SHA-256 of the run's files and decisions: ${seal?.sha256 ?? "…"}`),
      signing),
  ];
  signing?.dispatchEvent(new CustomEvent("undecided", { detail: open }));
  if (assumed) made.unshift(assumed); // placed before the signature, which a later change would invalidate
  const folder = session.source.readOnly ? "" : "/api/papers/";
  made.push(element("section", {}, element("h2", {}, "Downloads"), element("ul", { class: "papers" },
    ...PAPERS.map(([file, name]) => element("li", {}, element("a", { href: folder + file, target: "_blank", rel: "noopener" }, name))))));
  const lost = state.lost.map((e) => element("li", {}, `${e.who} ${told(session, e.action)}`));
  if (lost.length) made.push(element("section", {}, element("h2", {}, "Decisions without their finding"),
    element("p", {}, "The run has been computed again, and the findings that these decisions were about are no longer there."), element("ul", {}, ...lost)));
  if (state.history.length) made.push(element("section", {}, element("h2", {}, "History"), element("ol", { class: "history" },
    ...state.history.map((e) => element("li", {}, `${moment(e.at)} ${e.who}: ${told(session, e.action)}`)))));
  return made;
}

const DEEDS: Record<string, string> = {
  accept: "accepted", reject: "rejected", reopen: "reopened", reclassify: "changed the kind of", redraw: "drew the outline again of",
  merge: "merged", split: "split", add: "added", comment: "commented on", undo: "undid", redo: "redid",
  describe: "gave the facts of the inspection",
};

/** An entry of the ledger as a sentence. */
function told(session: Session, action: Record<string, unknown> & { do: string }): string {
  if (action.do === "assume") return `set the wall thickness to ${String(action["wall_thickness_mm"] ?? "–")} mm, the yield strength to ${String(action["yield_mpa"] ?? "–")} MPa`;
  const ids = Array.isArray(action["findings"]) ? (action["findings"] as string[]) : action["finding"] ? [String(action["finding"])] : [];
  const about = ids.length ? ` finding${ids.length > 1 ? "s" : ""} ${ids.map((id) => session.called(id)).join(" and ")}` : "";
  const more = String(action["text"] ?? action["reason"] ?? action["kind"] ?? "");
  const link = action.do === "reclassify" ? " to " : action.do === "add" ? " a " : ": ";
  return `${DEEDS[action.do] ?? action.do}${about}${more ? `${link}${more}` : ""}`;
}

function signature(session: Session): HTMLElement {
  const name = element("input", { type: "text", required: true, maxlength: "200", value: session.who, id: "sign-name" });
  const standard = element("input", { type: "text", maxlength: "200", id: "sign-standard", placeholder: "such as POF 100, EN 13508-2" });
  const remarks = element("textarea", { maxlength: "4000", rows: "3", id: "sign-remarks" });
  // Whoever signs with undecided findings has to confirm it, again whenever their number changes.
  const agreed = element("input", { type: "checkbox", id: "sign-undecided" });
  const count = element("label", { for: "sign-undecided" });
  const undecided = element("p", { class: "wide caution" }, agreed, " ", count);
  const ask = (e: Event) => {
    const open = (e as CustomEvent<number>).detail;
    const text = `${open === 1 ? "1 finding is" : `${open} findings are`} undecided. Sign nevertheless, leaving ${open === 1 ? "it" : "them"} undecided.`;
    if (count.textContent !== text) agreed.checked = false;
    count.textContent = text;
    agreed.required = !(undecided.hidden = open === 0);
  };
  return element("form", { class: "sign", undecided: ask, submit: (e) => { e.preventDefault(); void session.sign(name.value.trim(), standard.value.trim(), remarks.value.trim()); } },
    element("p", { class: "quiet wide" }, "A signature holds for the run's files and decisions as they are now. After any later change the review counts as unsigned."),
    element("label", { for: "sign-name" }, "Name"), name,
    element("label", { for: "sign-standard" }, "Standard applied"), standard,
    element("label", { for: "sign-remarks" }, "Remarks"), remarks,
    undecided, element("button", { class: "accept" }, "Sign"));
}

/** Set a field to the stored value, unless another text is being typed in it. */
function fill(input: HTMLInputElement, value: string): void {
  if (input.value === input.defaultValue || input.value === value) input.value = input.defaultValue = value;
}

function assumptions(session: Session): HTMLElement {
  const { assumed } = session.state;
  const wall = element("input", { type: "number", min: "0.1", max: "1000", step: "any", id: "wall", value: String(assumed.wall_thickness_mm ?? session.run.wall_thickness_mm ?? "") });
  const strength = element("input", { type: "number", min: "1", max: "5000", step: "any", id: "yield", value: String(assumed.yield_mpa ?? "") });
  const value = (input: HTMLInputElement) => (input.value ? Number(input.value) : null);
  session.on(["state"], () => {
    fill(wall, String(session.state.assumed.wall_thickness_mm ?? session.run.wall_thickness_mm ?? ""));
    fill(strength, String(session.state.assumed.yield_mpa ?? ""));
  });
  return element("section", {}, element("h2", {}, "Pipe data"),
    element("p", { class: "quiet" }, "Give these before signing. The wall thickness gives wall loss and POF class; with the yield strength, also the failure pressure by B31G. Leave empty what is not known."),
    element("form", { class: "sign", submit: (e) => { e.preventDefault(); void session.act({ do: "assume", wall_thickness_mm: value(wall), yield_mpa: value(strength) }); } },
      element("label", { for: "wall" }, "Wall thickness, mm"), wall,
      element("label", { for: "yield" }, "Yield strength, MPa"), strength,
      element("button", {}, "Use for wall loss and B31G")));
}

const FACTS: [string, string][] = [
  ["client", "Client"], ["site", "Site"], ["asset", "Asset"], ["line", "Line"], ["operator", "Operator"], ["date", "Date of inspection"],
  ["procedure", "Procedure"], ["equipment", "Equipment"], ["calibration", "Calibration certificate"],
];

/** The facts of the inspection: read from recording.yaml, completed here, printed in every report. */
function inspection(session: Session): HTMLElement {
  const { described } = session.state;
  const inputs = FACTS.map(([name]) => element("input", { type: name === "date" ? "date" : "text", maxlength: "200", id: `fact-${name}`, value: described[name] ?? "" }));
  session.on(["state"], () => FACTS.forEach(([name], k) => fill(inputs[k] as HTMLInputElement, session.state.described[name] ?? "")));
  const facts = () => Object.fromEntries(FACTS.map(([name], k) => [name, (inputs[k] as HTMLInputElement).value.trim()]));
  return element("section", {}, element("h2", {}, "The inspection"),
    element("p", { class: "quiet" }, "Give these before signing. They are printed at the head of every report; what is left empty is listed there as “not stated”."),
    element("form", { class: "sign facts", submit: (e) => { e.preventDefault(); void session.act({ do: "describe", ...facts() }); } },
      ...FACTS.flatMap(([name, label], k) => [element("label", { for: `fact-${name}` }, label), inputs[k] as HTMLInputElement]),
      element("button", {}, "Use in the reports")));
}
