/** Numbers and places in words, the same as in `pipeline/pages/notation.py`. */
export const TURN = 2 * Math.PI;
// Colour of the chosen finding and place: no colour map and no wall contains it.
export const CHOSEN_COLOUR = "#ff4fd8";

export function clock(azimuth: number): string {
  const hours = ((((azimuth * 180) / Math.PI / 30 + 3) % 12) + 12) % 12;
  // Clock positions at half minutes are rounded up, as in pipeline/pages/notation.py.
  const minutes = Math.floor(Math.round(hours * 600) / 10 + 0.5) % 720;
  return `${Math.floor(minutes / 60) || 12}:${String(minutes % 60).padStart(2, "0")}`;
}

export function clockOfHours(hours: number): string { return clock(azimuthOf(hours)); }

export function azimuthOf(hours: number): number { return ((hours - 3) * 30 * Math.PI) / 180; }

/** The same words as `pipeline/pages/notation.py`: an extent on the clock, clockwise. */
export function clockExtent(from: number, to: number): string {
  return to - from >= 12 ? "all round" : `${clockOfHours(from)}–${clockOfHours(to)}`;
}

/** A distance along the pipe: that of the peak, with the extent in brackets; without a peak the extent only. */
export function distanceExtent(peak: number | null | undefined, from: number, to: number): string {
  const extent = `${number(from, 1)}–${number(to, 1)} mm`;
  return peak === null || peak === undefined ? extent : `${number(peak, 1)} mm (${extent})`;
}

export function number(value: number | null | undefined, digits = 2): string {
  return value === null || value === undefined || !Number.isFinite(value) ? "–" : fixed(value, digits);
}

/** A number with so many digits; halves are rounded to the even digit, as in Python, so that page and papers agree. */
function fixed(value: number, digits: number): string {
  const halves = value * 2 ** (digits + 1); // exact; a half of the last digit is an odd number of these
  if (!Number.isInteger(halves) || halves % 2 === 0) return value.toFixed(digits);
  const below = Math.floor(Math.abs(value) * 10 ** digits);
  return (Math.sign(value) * (below + (below % 2)) / 10 ** digits).toFixed(digits);
}

const MOST_DIGITS = 3;

/** A value and its 1 σ, with as many digits as the σ justifies, but not more than are useful. */
export function measured(value: number | null, sigma: number | null, unit = "mm"): string {
  if (value === null || !Number.isFinite(value)) return "not seen";
  if (sigma === null || !(sigma > 0)) return `${String(Number(value.toPrecision(4)))} ${unit}`.trim();
  const digits = Math.max(0, Math.min(MOST_DIGITS, 1 - Math.floor(Math.log10(sigma))));
  const least = 10 ** -digits;
  const spread = sigma < least / 2 ? `< ${least.toFixed(digits)}` : fixed(sigma, digits);
  return `${fixed(value, digits)} ± ${spread} ${unit}`.trim();
}

/** A depth in words: missing metal is "deep", what protrudes into the bore is "inward". */
export function depth(value: number | null, sigma: number | null): string {
  if (value === null || !Number.isFinite(value)) return "depth not seen";
  return `${measured(Math.abs(value), sigma)} ${value < 0 ? "inward" : "deep"}`;
}

export function moment(at: string): string { return `${at.slice(0, 16).replace("T", " ")} UTC`; }

export function wrapped(azimuth: number): number {
  return ((((azimuth + Math.PI) % TURN) + TURN) % TURN) - Math.PI;
}

type Child = Node | string | null | undefined | false;

/** Make an element; text is inserted as text, never as markup. */
export function element<K extends keyof HTMLElementTagNameMap>(
  tag: K, attributes: Record<string, string | boolean | ((event: Event) => void)> = {}, ...children: Child[]
): HTMLElementTagNameMap[K] {
  const made = document.createElement(tag);
  for (const [name, value] of Object.entries(attributes)) {
    if (typeof value === "function") made.addEventListener(name, value);
    else if (value === true) made.setAttribute(name, "");
    else if (value !== false) made.setAttribute(name, value);
  }
  for (const child of children) if (child) made.append(child);
  return made;
}

const SVG = "http://www.w3.org/2000/svg";

export function drawn(tag: string, attributes: Record<string, string | number>, text = ""): SVGElement {
  const made = document.createElementNS(SVG, tag);
  for (const [name, value] of Object.entries(attributes)) made.setAttribute(name, String(value));
  if (text) made.textContent = text;
  return made;
}
