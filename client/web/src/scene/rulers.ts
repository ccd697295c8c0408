// Distances between points of the surface, and marks on it.
import {
  BufferAttribute,
  BufferGeometry,
  LineBasicMaterial,
  LineSegments,
  Points,
  PointsMaterial,
  Vector3,
  type Camera,
  type Object3D,
} from 'three';
import { overLayer } from './cross';
import { h } from '../ui/dom';
import { formatSize } from '../ui/format';
import type { Vec3 } from '../api/types';
import { Marks } from './marks';
import { lengthOf, type Ruler } from './style';

function labelOf(ruler: Ruler): string {
  return `${formatSize(lengthOf(ruler))} mm`;
}

const mostRulers = 32;

export class Rulers {
  readonly marks: Marks;
  onChange: (() => void) | null = null;
  private rulers: Ruler[] = [];
  private pending: Vec3 | null = null;
  private readonly geometry = new BufferGeometry();
  private readonly lineMaterial: LineBasicMaterial;
  private readonly pointMaterial: PointsMaterial;
  private readonly labels = h('div.ruler-labels', { 'aria-hidden': 'true' });
  private readonly middle = new Vector3();

  constructor(
    parent: Object3D,
    host: HTMLElement,
    private readonly colour: string,
  ) {
    const options = { color: colour, depthTest: false, transparent: true };
    this.lineMaterial = new LineBasicMaterial(options);
    this.pointMaterial = new PointsMaterial({ ...options, size: 7, sizeAttenuation: false });
    const lines = new LineSegments(this.geometry, this.lineMaterial);
    const points = new Points(this.geometry, this.pointMaterial);
    lines.frustumCulled = false;
    points.frustumCulled = false;
    for (const over of [lines, points]) over.layers.set(overLayer);
    lines.renderOrder = 10;
    points.renderOrder = 11;
    parent.add(lines, points);
    host.append(this.labels);
    this.marks = new Marks(parent);
    this.rebuild();
  }

  get all(): readonly Ruler[] {
    return this.rulers;
  }

  // Every second point ends a ruler, which is returned.
  add(point: Vec3): Ruler | null {
    if (this.pending === null) {
      this.pending = point;
      this.rebuild();
      return null;
    }
    const ruler = { from: this.pending, to: point };
    this.pending = null;
    this.rulers = [...this.rulers, ruler].slice(-mostRulers);
    this.rebuild();
    return ruler;
  }

  // Takes back a point that has no partner, else the last ruler.
  takeBack(): void {
    if (this.pending === null) this.rulers = this.rulers.slice(0, -1);
    this.pending = null;
    this.rebuild();
  }

  clear(): void {
    this.pending = null;
    this.rulers = [];
    this.rebuild();
  }

  // Those of a link.
  restore(rulers: readonly Ruler[]): void {
    this.rulers = rulers.slice(-mostRulers);
    this.rebuild();
  }

  placeLabels(camera: Camera, width: number, height: number): void {
    this.rulers.forEach((ruler, index) => {
      const label = this.labels.children[index] as HTMLElement;
      this.middleOf(ruler).project(camera);
      const x = ((this.middle.x + 1) / 2) * width;
      const y = ((1 - this.middle.y) / 2) * height;
      label.style.transform = `translate(${x.toFixed(1)}px, ${y.toFixed(1)}px) translate(-50%, -130%)`;
      label.hidden = this.middle.z > 1;
    });
  }

  // The same labels in a picture of that size, whose element of the page is `scale` pixels wide.
  paintLabels(context: CanvasRenderingContext2D, camera: Camera, scale: number): void {
    const { width, height } = context.canvas;
    const size = 12 * scale;
    context.save();
    context.font = `600 ${size}px system-ui, sans-serif`;
    context.textAlign = 'center';
    context.textBaseline = 'middle';
    for (const ruler of this.rulers) {
      const { x, y, z } = this.middleOf(ruler).project(camera);
      if (z > 1) continue;
      const text = labelOf(ruler);
      const place = { x: ((x + 1) / 2) * width, y: ((1 - y) / 2) * height - 1.3 * size };
      const wide = context.measureText(text).width + size;
      context.fillStyle = this.colour;
      context.fillRect(place.x - wide / 2, place.y - 0.75 * size, wide, 1.5 * size);
      context.fillStyle = '#fff';
      context.fillText(text, place.x, place.y);
    }
    context.restore();
  }

  private middleOf({ from, to }: Ruler): Vector3 {
    return this.middle.set((from[0] + to[0]) / 2, (from[1] + to[1]) / 2, (from[2] + to[2]) / 2);
  }

  dispose(): void {
    this.geometry.dispose();
    this.lineMaterial.dispose();
    this.pointMaterial.dispose();
    this.labels.remove();
    this.marks.dispose();
  }

  private rebuild(): void {
    const places = this.rulers.flatMap(({ from, to }) => [...from, ...to]);
    // A lone point, as a line without length.
    if (this.pending) places.push(...this.pending, ...this.pending);
    this.geometry.setAttribute('position', new BufferAttribute(new Float32Array(places), 3));
    this.geometry.setDrawRange(0, places.length / 3);
    this.labels.replaceChildren(
      ...this.rulers.map((ruler) => h('span', labelOf(ruler))),
    );
    this.onChange?.();
  }
}
