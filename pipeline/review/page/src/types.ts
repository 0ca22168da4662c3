/** The data of the server; lengths mm, angles rad, clock positions hours. */
export type Point = [number, number]; // distance, azimuth

/** ``low_mm`` and ``high_mm`` are the range of the run's own pictures; ``full_mm`` includes every measured value. */
export interface Overlay { name: string; title: string; low_mm: number; high_mm: number; colours: string[]; full_mm?: [number, number] }
export interface Quantity { name: string; value: number | string | null; unit: string }

export interface Axis { distance_mm: number[]; origin_p: number[][]; x_p: number[][]; y_p: number[][] }

/** Data of a finding besides its size. */
export interface MeasuredDefect { id: number; statement: string; pof_class: string; pacp_suggestion: string; en13508_suggestion: string }

/** A place shown by one ring only: to be examined, but not counted. */
export interface Unconfirmed {
  kind: string; depth_mm: number | null; depth_sigma_mm: number | null; length_mm: number; width_mm: number; statement: string;
  clock_from: number; clock_to: number; distance_from_mm: number; distance_to_mm: number; outline: Point[]; peak_distance_mm?: number; peak_clock?: number;
}

export interface Run {
  name: string; metrics: Quantity[]; numbers: { stage: string; numbers: Quantity[] }[]; warnings: string[];
  program: { name: string; version: string }; inputs: Record<string, string>; has_recording: boolean;
  nominal_diameter_mm: number; wall_thickness_mm: number | null; distance_mm: [number, number]; radius_mm: number;
  overlays: Overlay[]; kinds: string[]; defects: MeasuredDefect[]; unconfirmed: Unconfirmed[]; axis: Axis; diagnosis: Diagnosis | null;
  version: string; twin?: boolean;
}

export interface Diagnosis { verdict: string; statement: string; effects: string[] }

/** Curves over one axis; gaps are null. */
export interface Plot { title: string; x_label: string; unit: string; x: number[]; curves: { name: string; y: (number | null)[] }[] }
export interface Count { reason: string; count: number; share_percent: number }
export interface Quality { plots: Plot[]; samples: Count[]; facts: Quantity[]; pictures: { title: string; source: string }[] }

export interface Size {
  distance_from_mm: number; distance_to_mm: number; clock_from: number; clock_to: number; length_mm: number;
  width_mm: number; depth_mm: number | null; depth_sigma_mm: number | null; peak_distance_mm: number | null; peak_clock: number | null;
}

export interface Strength { b31g_mpa: number; modified_mpa: number; assumptions: string }

export type Status = "open" | "accepted" | "rejected" | "gone";

export interface Finding {
  id: string; label: string; kind: string; outline: Point[]; size: Size; cautions: string[]; status: Status; original: number | null; edited: boolean;
  decided_by: string; decided_at: string; reason: string; remarks: { who: string; at: string; text: string }[];
  made_of: string[]; covers: string[]; wall_loss_percent: number | null; wall_loss_sigma_percent: number | null; strength: Strength | null;
}

export interface Entry { id: number; who: string; at: string; action: Record<string, unknown> & { do: string } }
export interface Signature { id: number; name: string; standard: string; remarks: string; at: string; revision: number; sha256: string }

export interface ReviewState {
  revision: number; findings: Finding[]; may_undo: boolean; may_redo: boolean; lost: Entry[];
  assumed: { wall_thickness_mm: number | null; yield_mpa: number | null }; described: Record<string, string>; history: Entry[];
}

/** The state that a signature would cover, and the last signature; changes whenever anything does. */
export interface Seal { revision: number; sha256: string; signed: boolean; signature: Signature | null; run_version: string }

export interface Section {
  distance_mm: number; azimuth_rad: number[]; radius_mm: (number | null)[]; sigma_mm: (number | null)[];
  fitted_mm: number[]; nominal_mm: number;
}

/** The alignment of the earlier run to this one, linear between stations of the earlier run's distance. */
export interface Registration {
  at_mm: number[]; shift_mm: number[]; shift_sigma_mm: number[]; roll_rad: number[]; roll_sigma_rad: number[]; scale: number; scale_sigma: number;
  blocks: number; agreeing: number; correlation: number; chance: number; welds: { earlier_mm: number; now_mm: number }[]; overlap_mm: [number, number];
  shift_range_mm: [number, number]; roll_range_rad: [number, number];
}

/** A finding of either run; outlines at their place in this run, this run's own first. */
export interface Change {
  id: string | null; earlier_id: string | null; kind: string; fate: string; changed: boolean; distance_mm: number; azimuth_rad: number; half_mm: number;
  outlines: Point[][]; depth_mm: number | null; earlier_depth_mm: number | null; depth_growth_mm: number | null; depth_growth_sigma_mm: number | null;
  length_growth_mm: number | null; length_growth_sigma_mm: number | null; width_growth_mm: number | null; width_growth_sigma_mm: number | null;
  area_growth_mm2: number | null; area_growth_sigma_mm2: number | null; p_adjusted: number | null;
  depth_rate_mm_per_year: number | null; depth_rate_sigma_mm_per_year: number | null;
  wall_loss_rate_percent_per_year: number | null; wall_loss_rate_sigma_percent_per_year: number | null;
}

export interface Comparison {
  earlier: string; years: number | null; statement: string; registration: Registration; diameter: { value: number; sigma: number };
  one_calibration: boolean; overlays: Overlay[]; changes: Change[];
}

export interface Curve { mm: number[]; depth_mm: (number | null)[]; sigma_mm: (number | null)[] }
export interface Profile { along: Curve; around: Curve }

export interface Sight { frame: number; time_s: number; illumination: string; spot_px: Point; ring_px: Point[] }
/** The camera of a frame, turned to the chosen place; and recorded over uniformly lit brightness, by polar angle and azimuth in the camera. */
export interface Stand {
  frame: number; eye_p: [number, number, number]; target_p: [number, number, number]; up_p: [number, number, number]; R_pc: number[][];
  polar_rad: Point; light: number[][];
}
export interface Layer { levels: number; width: number; height: number; distance_mm: [number, number]; azimuth_rad: number }
/** A part of the model between two distances. */
export interface Stretch { from_mm: number; to_mm: number; triangles: number }
export interface Reading { name: string; value: number; sigma: number; unit: string }
/** A stored measurement, with its place and its object. */
export interface SavedReading { tool: Tool; at: string; points: Point[]; readings: Reading[] }
export type Tool = "none" | "point" | "distance" | "area" | "depth" | "diameter" | "redraw" | "add" | "split";
