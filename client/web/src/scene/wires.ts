// The edges of triangles as lines over them.
import { BufferAttribute, BufferGeometry, LineBasicMaterial, LineSegments, type Plane } from 'three';
import { placeholder } from './placeholder';

export type Wire = LineSegments<BufferGeometry, LineBasicMaterial>;

// Each edge once, as the two triangles that share it name its ends in different orders. An edge of the border may be there twice.
export function edgesOf(index: ArrayLike<number>, border: ArrayLike<number>): Uint32Array<ArrayBuffer> {
  const isBorder = new Set(Array.from(border));
  const edges = new Uint32Array(2 * index.length);
  let used = 0;
  for (let i = 0; i < index.length; i += 1) {
    const a = index[i] as number;
    const b = index[i % 3 === 2 ? i - 2 : i + 1] as number;
    if (a > b && !(isBorder.has(a) && isBorder.has(b))) continue;
    edges[used++] = a;
    edges[used++] = b;
  }
  return edges.slice(0, used);
}

export class Wires {
  private readonly material = new LineBasicMaterial({ color: '#1d1b16', transparent: true, opacity: 0.45, depthWrite: false });
  // Its shader is there before the first of them.
  readonly probe: Wire = new LineSegments(placeholder(), this.material);
  private readonly made = new Map<BufferGeometry, BufferGeometry>();

  constructor() {
    this.probe.visible = false;
  }

  add(): Wire {
    const wire: Wire = new LineSegments(placeholder(), this.material);
    wire.matrixAutoUpdate = false;
    return wire;
  }

  // The lines of that geometry, which has these vertices on its border.
  of(geometry: BufferGeometry, border: ArrayLike<number>): BufferGeometry {
    const known = this.made.get(geometry);
    if (known) return known;
    const lines = new BufferGeometry();
    lines.setAttribute('position', geometry.getAttribute('position'));
    const index = geometry.getIndex()?.array ?? [];
    const edges = edgesOf(index, border);
    lines.setIndex(new BufferAttribute(index instanceof Uint16Array ? Uint16Array.from(edges) : edges, 1));
    Object.assign(lines, { boundingSphere: geometry.boundingSphere, boundingBox: geometry.boundingBox });
    this.made.set(geometry, lines);
    return lines;
  }

  // The geometry is gone, or has other triangles.
  forget(geometry: BufferGeometry): void {
    this.made.get(geometry)?.dispose();
    this.made.delete(geometry);
  }

  setCut(planes: Plane[] | null): void {
    this.material.clippingPlanes = planes;
    this.material.needsUpdate = true;
  }

  dispose(): void {
    for (const lines of this.made.values()) lines.dispose();
    this.material.dispose();
  }
}
