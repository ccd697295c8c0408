// Connected components of a surface: found, left out of what is drawn, and painted over all others.
import { BufferAttribute, BufferGeometry, DoubleSide, Mesh, MeshBasicMaterial, type Object3D } from 'three';
import type { PartFinder } from '../mesh/part_finder';
import type { CoarseMaker } from './coarse_maker';
import { overLayer } from './cross';
import type { Parts } from './parts';

export class Components {
  private readonly material = new MeshBasicMaterial({ color: '#e07a1f', transparent: true, opacity: 0.5, depthTest: false, side: DoubleSide });
  private marks: Mesh<BufferGeometry, MeshBasicMaterial>[] = [];

  constructor(
    private readonly scene: Object3D,
    private readonly parts: Parts,
    private readonly copies: CoarseMaker,
  ) {}

  // To be asked for once all blocks are there.
  get finder(): PartFinder {
    return this.parts.finder;
  }

  // Leaves those out, by their numbers. All have to be found.
  setHidden(hidden: ReadonlySet<number>): void {
    const { parts, copies } = this;
    const { finder } = parts;
    parts.setIndex(hidden.size === 0 ? null : (block) => finder.indexOf(block, (number) => !hidden.has(number)));
    copies.restart(
      parts.finest.map(({ made, geometry, label }) => ({
        surface: parts.numberOf(label),
        block: { ...made, index: (geometry.getIndex()?.array ?? made.index) as Uint16Array<ArrayBuffer> },
      })),
    );
  }

  // Paints that one over all others, so that it is seen also inside of them; null: none.
  mark(number: number | null): void {
    const { finder, finest } = this.parts;
    this.scene.remove(...this.marks);
    for (const { geometry } of this.marks) geometry.dispose();
    this.marks = [];
    if (number === null) return;
    finest.forEach(({ geometry }, block) => {
      const index = finder.indexOf(block, (one) => one === number);
      if (index.length === 0) return;
      const marked = new BufferGeometry();
      marked.setAttribute('position', geometry.getAttribute('position'));
      marked.setIndex(new BufferAttribute(index, 1));
      const mesh = new Mesh(marked, this.material);
      mesh.renderOrder = 8;
      mesh.layers.set(overLayer);
      this.marks.push(mesh);
    });
    this.scene.add(...this.marks);
  }

  dispose(): void {
    this.mark(null);
    this.material.dispose();
  }
}
