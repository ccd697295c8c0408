// What the daemon answers and is asked, as /openapi.yaml describes it. Members that only some
// versions have are optional: the page shows what is there.

export type Vec3 = [number, number, number];

export interface Preset {
  name: string;
  iso: number;
}

export interface Volume {
  id: string;
  format: string;
  dims: Vec3;
  type: string;
  spacing: Vec3;
  origin: Vec3;
  direction: number[];
  range: [number, number];
  suggested_iso: number;
  bytes: number;
  created: string;
  modality?: string | null;
  presets?: Preset[];
  // What of an upload is no part of the volume.
  ignored?: { name: string; reason: string }[];
  dicom?: Partial<Record<DicomText, string>>;
}

export type DicomText =
  'patient_name' | 'patient_id' | 'study_date' | 'study_description' | 'series_description';

export interface Histogram {
  range: [number, number];
  counts: number[];
}

export interface Estimate {
  triangles: number;
  vertices: number;
  bytes: Partial<Record<MeshFormat, number>>;
  memory_bytes?: number;
  fits?: boolean;
  milliseconds?: number;
  queue?: { queued: number; running: number };
}

export const meshFormats = ['glb', 'drc', 'stl', 'ply', 'obj'] as const;
export type MeshFormat = (typeof meshFormats)[number];

export const priorities = ['stat', 'routine', 'bulk'] as const;
export type Priority = (typeof priorities)[number];

export interface JobParameters {
  volume: string;
  iso: number | 'otsu';
  scheme: 5 | 6;
  interpolation: 'linear' | 'midpoint';
  passes: number;
  smoothing: 'laplacian' | 'taubin';
  // Null: the method's own.
  lambda: number | null;
  close: boolean;
  formats: MeshFormat[];
  draco: { position_bits: number; speed: number };
  priority: Priority;
  components?: ComponentFilter;
  pass_band?: number;
  max_displacement_mm?: number | null;
}

// Which parts of a surface are kept; null: all.
export interface ComponentFilter {
  keep: number | null;
  min_triangles: number | null;
}

export type JobState = 'queued' | 'running' | 'succeeded' | 'failed' | 'cancelled';

export interface FieldFault {
  field: string;
  message: string;
}

export interface Problem {
  type: string;
  title: string;
  status: number;
  detail: string;
  instance?: string;
  errors?: FieldFault[];
}

export type Timing = Record<string, number>;

export interface MeshFile {
  bytes: number;
  sha256: string;
  href: string;
}

// How a quantity is spread over the triangles: counts in equal bins from zero on.
export interface Distribution {
  mean: number;
  min: number;
  histogram: number[];
}

export interface Stages<T> {
  extracted: T;
  smoothed: T;
}

export interface MeshQuality {
  closed?: boolean;
  manifold?: boolean;
  oriented?: boolean;
  components?: number;
  genus?: number | null;
  aspect_ratio?: Stages<Distribution>;
  smallest_angle_deg?: Stages<Distribution>;
}

export interface MeshSummary {
  triangles: number;
  vertices: number;
  boundary_edges: number;
  components: number;
  euler: number;
  area_mm2: number;
  area_extracted_mm2?: number;
  volume_mm3: Stages<number>;
  bounds: [Vec3, Vec3];
  files: Partial<Record<MeshFormat, MeshFile>>;
  quality?: MeshQuality;
  displacement_mm?: { mean: number; max: number };
  dropped?: { components: number; triangles: number };
}

export interface Job {
  id: string;
  state: JobState;
  stage: string;
  progress: number;
  parameters: JobParameters;
  volume: string;
  priority: Priority;
  created: string;
  started: string | null;
  finished: string | null;
  timing: Timing;
  mesh: MeshSummary | null;
  error: Problem | null;
  reused?: boolean;
}

export function isFinal(state: JobState): boolean {
  return state === 'succeeded' || state === 'failed' || state === 'cancelled';
}
