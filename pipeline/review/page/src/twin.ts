/** Recorded frames beside the same frames, re-rendered: the twin's own page, in a frame that may not query the server. */
import type { Session } from "./session";
import { element } from "./words";

export function twinPage(session: Session): HTMLElement {
  if (!session.run.twin) {
    return element("main", { class: "page", id: "twin" }, element("section", {}, element("h2", {}, "Recorded frames beside re-rendered ones"),
      element("p", {}, "Make a twin of the run, ", element("code", {}, "boresight twin RUN -o DIR"), ", and start the review with it: ", element("code", {}, "boresight review RUN --twin DIR"))));
  }
  const frame = element("iframe", { title: "twin", sandbox: "allow-scripts", loading: "lazy", src: session.source.readOnly ? "twin.html" : "/twin" });
  return element("main", { class: "twin", id: "twin" }, frame);
}
