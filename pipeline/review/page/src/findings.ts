/** The list of findings, and the actions on the chosen one. */
import { chart } from "./chart";
import { unconfirmed, warnings } from "./notices";
import { bySeverity, peakOf, type Session } from "./session";
import type { Finding } from "./types";
import { clockExtent, clockOfHours, depth, distanceExtent, element, measured, moment, number } from "./words";

const STANDING: Record<string, string> = { open: "undecided", accepted: "accepted", rejected: "rejected" };
const REASONS = ["reflection", "loose deposit", "shadow or stain, no relief", "part of the pipe (joint, branch, fitting)", "below the reporting limit"];

export class FindingsPanel {
  readonly root = element("div", { class: "findings" });
  private readonly list = element("ol", { class: "list", "aria-label": "Findings, most severe first" });
  private readonly detail = element("div", { class: "detail" });
  private readonly rows = new Map<string, { key: string; row: HTMLElement }>();
  private wanted = 0;

  constructor(private readonly session: Session) {
    this.root.append(warnings(session.run.warnings), this.progress, this.list, this.detail, unconfirmed(session));
    session.on(["state", "selection"], () => this.paint());
    session.on(["reject"], () => this.askReason());
    this.paint();
  }

  private readonly progress = element("p", { class: "progress", "aria-live": "polite" });

  get order(): Finding[] { return bySeverity(this.session.standing); }

  next(step: number): void {
    const order = this.order;
    if (!order.length) return;
    const at = order.findIndex((f) => f.id === this.session.selected);
    this.go(order[(at + step + order.length) % order.length]!.id);
  }

  private paint(): void {
    const order = this.order;
    const open = order.filter((f) => f.status === "open").length;
    this.progress.textContent = !order.length ? "Nothing was found on this wall."
      : open ? `${order.length - open} of ${order.length} decided, ${open} to go.` : `All ${order.length} decided. Next: Sign-off.`;
    const held = this.list.contains(document.activeElement);
    this.put(order.map((f) => this.kept(f)));
    if (held) this.list.querySelector<HTMLElement>("[aria-current=true]")?.focus();
    if (this.isWriting) return;
    const isAtComment = document.activeElement?.matches(".comment input") && this.detail.dataset["finding"] === this.session.selected;
    this.describe();
    if (isAtComment) this.detail.querySelector<HTMLElement>(".comment input")?.focus();
  }

  /** Whether a remark or a reason is being typed, which updates from the server must not erase. */
  private get isWriting(): boolean {
    const at = document.activeElement;
    return at instanceof HTMLInputElement && at.type === "text" && (at.value !== "" || at.id === "reason") && this.detail.contains(at)
      && this.detail.dataset["finding"] === this.session.selected;
  }

  tick(id: string): void {
    const { marked } = this.session;
    if (!marked.delete(id)) marked.add(id);
    this.paint();
  }

  /** The finding's row; rebuilt only when it has changed, since a long pipe has thousands. */
  private kept(finding: Finding): HTMLElement {
    const { selected, marked } = this.session;
    const key = JSON.stringify([finding.label, finding.status, finding.kind, finding.size, finding.id === selected, marked.has(finding.id)]);
    const known = this.rows.get(finding.id);
    if (known?.key === key) return known.row;
    const row = this.row(finding);
    this.rows.set(finding.id, { key, row });
    return row;
  }

  private put(rows: HTMLElement[]): void {
    const staying = new Set<Element>(rows);
    rows.forEach((row, k) => {
      const there = this.list.children[k];
      if (there === row) return;
      if (there && !staying.has(there)) there.replaceWith(row);
      else this.list.insertBefore(row, there ?? null);
    });
    while (this.list.children.length > rows.length) this.list.lastElementChild!.remove();
  }

  private row(finding: Finding): HTMLElement {
    const { session } = this;
    const mark = element("input", {
      type: "checkbox", checked: session.marked.has(finding.id), title: "tick two or more to merge them", "aria-label": `mark ${finding.label} for merging`,
      change: () => this.tick(finding.id),
    });
    const size = finding.size;
    const face = element("button", {
      class: "row", "aria-current": String(finding.id === session.selected), click: () => session.select(finding.id),
    },
      element("span", { class: `dot ${finding.status}` , title: finding.status }),
      element("strong", {}, `${finding.label} ${finding.kind}`),
      element("span", {}, STANDING[finding.status] ?? finding.status),
      element("span", { class: "quiet" }, `${depth(size.depth_mm, size.depth_sigma_mm)}; ${number(peakOf(finding)[0], 0)} mm, ${size.peak_clock === null ? clockExtent(size.clock_from, size.clock_to) : clockOfHours(size.peak_clock)}`));
    return element("li", {}, session.source.readOnly ? null : mark, face);
  }

  private describe(): void {
    const finding = this.session.finding;
    this.detail.dataset["finding"] = finding?.id ?? "";
    if (!finding) {
      this.detail.replaceChildren(element("p", { class: "quiet" }, "Choose a finding, or press N for the next."));
      return;
    }
    const wrong = this.session.run.defects.find((d) => d.id === finding.original);
    this.detail.replaceChildren(
      element("h3", {}, `Finding ${finding.label}: ${finding.kind}, ${STANDING[finding.status]}`),
      this.session.source.readOnly ? "" : this.buttons(finding),
      finding.covers.length ? element("p", { class: "caution" }, `Its outline also covers finding ${finding.covers.map((id) => this.session.called(id)).join(", ")}, so that its depth and extent may be theirs. Redraw it, or merge them too.`) : "",
      ...finding.cautions.map((text) => element("p", { class: "caution" }, text)),
      this.table(finding),
      wrong && finding.edited ? element("p", { class: "original" }, `As measured: ${wrong.statement}`)
        : element("p", {}, wrong?.statement ?? "Drawn manually."),
      element("p", { class: "quiet" }, wrong ? [wrong.pof_class && `POF ${wrong.pof_class}`, wrong.pacp_suggestion && `PACP ${wrong.pacp_suggestion}`,
        wrong.en13508_suggestion && `EN 13508-2 ${wrong.en13508_suggestion}`].filter(Boolean).join(" · ") : ""),
      this.lacking(finding), this.remarks(finding), this.curves(finding));
  }

  /** Where to enter what wall loss and strength still need. */
  private lacking(finding: Finding): HTMLElement | string {
    const { assumed } = this.session.state;
    const isLoss = ["pit", "corrosion", "gouge", "crack"].includes(finding.kind);
    const need = [assumed.wall_thickness_mm === null && "wall thickness", assumed.yield_mpa === null && "yield strength"].filter(Boolean);
    if (!isLoss || !need.length || this.session.source.readOnly) return "";
    return element("p", { class: "quiet" }, `For wall loss and failure pressure give ${need.join(" and ")} on page Sign-off.`);
  }

  private table(finding: Finding): HTMLElement {
    const s = finding.size;
    const rows: [string, string][] = [
      ["depth", depth(s.depth_mm, s.depth_sigma_mm)],
      ["along × around", `${number(s.length_mm, 1)} × ${number(s.width_mm, 1)} mm`],
      ["distance of the peak (extent)", distanceExtent(s.peak_distance_mm, s.distance_from_mm, s.distance_to_mm)],
      ["clock of the peak (extent)", s.peak_clock === null ? clockExtent(s.clock_from, s.clock_to) : `${clockOfHours(s.peak_clock)} (${clockExtent(s.clock_from, s.clock_to)})`],
    ];
    if (finding.wall_loss_percent !== null) rows.push(["wall loss", measured(finding.wall_loss_percent, finding.wall_loss_sigma_percent, "%")]);
    if (finding.strength) {
      rows.push(["estimated failure pressure, B31G", `${number(finding.strength.b31g_mpa, 1)} MPa`]);
      rows.push(["estimated failure pressure, modified B31G", `${number(finding.strength.modified_mpa, 1)} MPa`]);
      rows.push(["these assume", finding.strength.assumptions]);
    }
    if (finding.decided_by) rows.push(["decided", `${finding.decided_by}, ${moment(finding.decided_at)}`]);
    if (finding.reason) rows.push(["reason", finding.reason]);
    if (finding.made_of.length) rows.push(["made of", finding.made_of.map((id) => this.session.called(id)).join(", ")]);
    return element("table", {}, ...rows.map(([k, v]) => element("tr", {}, element("th", { scope: "row" }, k), element("td", {}, v))));
  }

  private buttons(finding: Finding): HTMLElement {
    const { session } = this;
    const act = (action: object) => void session.act({ ...action, finding: finding.id });
    const kind = element("select", {
      "aria-label": "kind", change: () => act({ do: "reclassify", kind: kind.value }),
    }, ...session.run.kinds.map((k) => element("option", { value: k, selected: k === finding.kind }, k)));
    const marked = [...session.marked];
    return element("div", { class: "buttons" },
      finding.status !== "accepted" ? element("button", { class: "accept", click: () => void this.decide({ do: "accept" }), title: "key A" }, "Accept") : null,
      finding.status !== "rejected" ? element("button", { class: "reject", click: () => this.askReason(), title: "key R" }, "Reject…") : null,
      finding.status !== "open" ? element("button", { click: () => act({ do: "reopen" }) }, "Reopen") : null,
      element("label", {}, "kind ", kind),
      element("button", { click: () => session.take("redraw") }, "Redraw"),
      element("button", { click: () => session.take("split") }, "Split"),
      marked.length > 1 ? element("button", { title: "key M", click: () => void this.merge() }, `Merge ${marked.map((id) => session.called(id)).join(" + ")}`) : null);
  }

  /** Accept or reject the chosen finding and go to the next that is undecided. */
  async decide(action: object): Promise<void> {
    const { session } = this, order = this.order, at = order.findIndex((f) => f.id === session.selected);
    if (at < 0 || !(await session.act({ ...action, finding: order[at]!.id }))) return;
    const left = [...order.slice(at + 1), ...order.slice(0, at)].find((f) => session.standing.some((now) => now.id === f.id && now.status === "open"));
    if (left) this.go(left.id);
  }

  private go(id: string): void {
    this.session.select(id);
    this.list.querySelector<HTMLElement>("[aria-current=true]")?.focus();
  }

  /** Merge the ticked findings and go to the result. */
  async merge(): Promise<void> {
    const { session } = this;
    if (session.marked.size < 2) { session.say("Tick two or more findings to merge them."); return; }
    if (await session.act({ do: "merge", findings: [...session.marked] })) session.select(`m${session.state.revision}`);
  }

  /** Ask, beside the finding, why it is not a defect. */
  private askReason(): void {
    const finding = this.session.finding;
    if (!finding || this.detail.querySelector(".reason")) return;
    const text = element("input", { type: "text", required: true, pattern: ".*\\S.*", title: "a reason, in words", maxlength: "4000", id: "reason", list: "reasons", autocomplete: "off" });
    const usual = element("datalist", { id: "reasons" }, ...REASONS.map((value) => element("option", { value })));
    const leave = () => { form.remove(); this.list.querySelector<HTMLElement>("[aria-current=true]")?.focus(); };
    const form = element("form", {
      class: "reason", submit: (e) => {
        e.preventDefault();
        form.remove();
        void this.decide({ do: "reject", reason: text.value.trim() });
      },
      keydown: (e) => { if ((e as KeyboardEvent).key === "Escape") leave(); },
    }, element("label", { for: "reason" }, `Why reject finding ${finding.label}?`), text, usual,
      element("button", { class: "accept" }, "Reject"), element("button", { type: "button", click: leave }, "Cancel"));
    this.detail.querySelector(".buttons")?.after(form);
    text.focus();
  }

  private remarks(finding: Finding): HTMLElement {
    const said = finding.remarks.map((r) => element("p", { class: "remark" }, `${r.who}, ${moment(r.at)}: ${r.text}`));
    if (this.session.source.readOnly) return element("div", {}, ...said);
    const text = element("input", { type: "text", maxlength: "4000", "aria-label": "comment", placeholder: "Comment" });
    const form = element("form", { class: "comment", submit: (e) => {
      e.preventDefault();
      const said = text.value.trim();
      if (!said) return;
      text.blur();
      void this.session.act({ do: "comment", finding: finding.id, text: said }).then((done) => { if (!done) text.value = said; });
    } }, text, element("button", {}, "Add"));
    return element("div", {}, ...said, form);
  }

  private curves(finding: Finding): HTMLElement {
    const place = element("div", { class: "curves" });
    const turn = ++this.wanted;
    const half = Math.max(finding.size.length_mm, finding.size.width_mm) / 2 + 8;
    const [distance, azimuth] = this.session.cursor;
    void this.session.source.profile(distance, azimuth, Math.min(half, 40)).then((profile) => {
      if (turn === this.wanted) place.replaceChildren(chart(profile.along, "Along the pipe"), chart(profile.around, "Around it"));
    }).catch((error: Error) => place.replaceChildren(element("p", { class: "quiet" }, error.message)));
    return place;
  }
}
