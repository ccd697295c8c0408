// The labels of a job's mesh as a person looks at them: which are shown, and in which colours.
import { client } from '../client';
import type { Estimate, Job, Label, LabelSummary, Vec3, Volume, VolumeLabel } from '../api/types';
import { Signal } from '../ui/signal';
import { LabelMap, seriesColour, type LabelLook } from '../volume/label_map';

export interface Named {
  label: Label;
  name?: string | null;
}

// As files call it.
export function labelTitle({ label, name }: Named): string {
  return name ?? `label ${label}`;
}

// The labels whose title contains all words, or whose value is the text.
export function matching<T extends Named>(labels: readonly T[], text: string): T[] {
  const words = text.toLowerCase().split(/\s+/).filter(Boolean);
  return labels.filter((one) => {
    const title = labelTitle(one).toLowerCase();
    return words.every((word) => title.includes(word) || String(one.label) === word);
  });
}

export const labelOrders = {
  value: ['by value', () => 0],
  name: ['by name', (a, b) => labelTitle(a).localeCompare(labelTitle(b), undefined, { numeric: true })],
  volume: ['largest volume first', (a, b) => b.voxels_mm3 - a.voxels_mm3],
  area: ['largest area first', (a, b) => b.area_mm2 - a.area_mm2],
  components: ['most components first', (a, b) => b.components - a.components],
} as const satisfies Record<string, readonly [string, (a: LabelSummary, b: LabelSummary) => number]>;

export type LabelOrder = keyof typeof labelOrders;

// Unless a label is closed and oriented, the sum over its triangles is no volume. One around a cavity alone is inside out.
export function enclosesVolume({ closed, oriented, volume_mm3: volume }: LabelSummary): boolean {
  return closed && oriented && volume >= 0;
}

// A table of the labels for a spreadsheet. The volume of a mesh that encloses none is empty.
export function labelsCsv(labels: readonly LabelSummary[], colours: ReadonlyMap<Label, string>): string {
  const quoted = (text: string): string => (/[",\r\n]/.test(text) ? `"${text.replaceAll('"', '""')}"` : text);
  // A spreadsheet runs what begins with one of these.
  const safe = (text: string): string => quoted(/^[=+\-@\t\r]/.test(text) ? `'${text}` : text);
  const rows = labels.map((label) => [
    String(label.label),
    safe(labelTitle(label)),
    colours.get(label.label) ?? label.color ?? '',
    label.voxels,
    label.voxels_mm3,
    enclosesVolume(label) ? label.volume_mm3 : '',
    label.area_mm2,
    label.components,
    label.triangles,
  ]);
  const head = ['label', 'name', 'color', 'voxels', 'voxels_mm3', 'mesh_mm3', 'area_mm2', 'components', 'triangles'];
  return [head, ...rows].map((row) => `${row.join(',')}\r\n`).join('');
}

// The job itself lists its labels only if they are few.
export async function labelsOfMesh({ id, mesh }: Job): Promise<readonly LabelSummary[]> {
  return mesh?.labels_count === undefined ? (mesh?.labels ?? []) : client.labelsOfJob(id);
}

export function labelCount({ mesh }: Job): number {
  return mesh?.labels_count ?? mesh?.labels?.length ?? 0;
}

export function isRenumbered({ notes }: Volume): boolean {
  return notes.some(({ code }) => code === 'labels-renumbered');
}

// The sample in the middle of the box around a label.
export function middleOf({ low, high }: Pick<VolumeLabel, 'low' | 'high'>): Vec3 {
  return [0, 1, 2].map((axis) => Math.round(((low[axis] ?? 0) + (high[axis] ?? 0)) / 2)) as Vec3;
}

// The triangles of each label's surface.
export function trianglesOf(estimate: Estimate): ReadonlyMap<Label, number> {
  return new Map((estimate.labels ?? []).map(({ label, triangles }) => [label, triangles]));
}

export class LabelState {
  readonly hidden = new Signal<ReadonlySet<Label>>(new Set());
  // The colours that a person chose or the file has; the others' are known once their surfaces come.
  readonly colours = new Signal<ReadonlyMap<Label, string>>(new Map());
  readonly picked = new Signal<LabelSummary | null>(null);
  // The last one of the list that was chosen, to which slices move.
  readonly chosen = new Signal<Label | null>(null);
  private map: LabelMap | null = null;
  private readonly byLabel: ReadonlyMap<Label, LabelSummary>;

  // `isRenumbered`: the samples of the volume have other numbers than its labels.
  constructor(readonly labels: readonly LabelSummary[], private readonly isRenumbered = false) {
    this.byLabel = new Map(labels.map((one) => [one.label, one]));
    this.colours.value = new Map(labels.flatMap(({ label, color }) => (color ? [[label, color]] : [])));
  }

  // How slices show them; null for a surface without labels, and if samples do not tell them.
  look(): LabelLook | null {
    if (this.labels.length === 0 || this.isRenumbered) return null;
    this.map ??= new LabelMap(this.labels);
    const colours = this.colours.value;
    return { map: this.map, colourOf: (label) => colours.get(label) ?? seriesColour(label), isShown: (label) => this.isShown(label) };
  }

  isShown(label: Label): boolean {
    return !this.hidden.value.has(label);
  }

  show(label: Label, isShown: boolean): void {
    const hidden = new Set(this.hidden.value);
    if (isShown) hidden.delete(label);
    else hidden.add(label);
    this.hidden.value = hidden;
  }

  isAlone(label: Label): boolean {
    return this.isShown(label) && this.hidden.value.size === this.labels.length - 1;
  }

  // Hides all others; all are shown again when they are hidden already.
  isolate(label: Label): void {
    if (this.isAlone(label) && this.labels.length > 1) this.showAll();
    else this.hidden.value = new Set(this.labels.map((one) => one.label).filter((other) => other !== label));
  }

  showAll(): void {
    this.hidden.value = new Set();
  }

  hideAll(): void {
    this.hidden.value = new Set(this.labels.map(({ label }) => label));
  }

  setColour(label: Label, colour: string): void {
    this.colours.value = new Map(this.colours.value).set(label, colour);
  }

  // The colour of a surface that has come, where nothing else says one.
  learnColour(label: Label, colour: string): void {
    if (!this.colours.value.has(label)) this.setColour(label, colour);
  }

  pick(label: Label | null): void {
    this.picked.value = label === null ? null : (this.byLabel.get(label) ?? null);
  }
}
