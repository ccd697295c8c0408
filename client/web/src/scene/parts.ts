// The blocks of triangles in a scene: of one surface, or of one for each label with a colour of its own.
import type { Label } from '../api/types';
import {
  BackSide,
  Box3,
  BufferAttribute,
  type BufferGeometry,
  Mesh,
  type MeshPhongMaterial,
  type Object3D,
  type Plane,
  Sphere,
  Vector3,
  type Ray,
} from 'three';
import type { Block } from '../mesh/blocks';
import type { Part } from '../mesh/glb';
import type { Coarse } from '../mesh/coarse';
import { PartFinder } from '../mesh/part_finder';
import { Seams } from '../mesh/seams';
import { DistanceShader, reachOf, valueWithin, type Reach } from './distances';
import { geometryOf, labelMaterials, material, neutral } from './materials';
import { firstMet, type Interval } from './pick';
import { placeholder } from './placeholder';
import { defaultStyle, type SurfaceStyle } from './style';
import type { Uploading } from './uploading';
import { Wires, type Wire } from './wires';

export interface Hit {
  at: number; // along the ray
  label: Label | null;
  distance?: number; // where the surface has distances
  // One of the finest blocks, and a vertex of it; -1 for a coarse level.
  block: number;
  vertex: number;
}

interface Look {
  materials: MeshPhongMaterial[];
  isShown: boolean;
  seams: Seams;
  blocks: number;
  // Blocks of the file's coarsest level of detail, which stand for the others while these are still to come.
  level: { seams: Seams; blocks: number };
  // A coarse copy of all its blocks, drawn while it moves. Its meshes are as those of a block.
  copy: Drawn[];
  copyWire: Wire;
  showsDistance: boolean;
  opacity: number;
}

type Drawn = Mesh<BufferGeometry, MeshPhongMaterial>;

export interface DrawnBlock {
  // One mesh; of a label two, for its front and for its back.
  meshes: Drawn[];
  geometry: BufferGeometry;
  // Its edges, once they are seen.
  wire: Wire | null;
  look: Look;
  label: Label | null;
  isLevel: boolean;
  member: number; // of its look's blocks, or of their level's
  made: Block;
  distances: Float32Array | undefined;
  isThere: boolean; // at the graphics processor
}

const wiresPerFrame = 4;

export class Parts {
  private readonly blocks: DrawnBlock[] = [];
  private readonly looks = new Map<Label | null, Look>();
  private readonly colours = new Map<Label, string>();
  private readonly opacities = new Map<Label, number>();
  private hidden: ReadonlySet<Label> = new Set();
  private style = defaultStyle;
  private planes: Plane[] | null = null;
  // Coarse copies of all looks, for each level; and the level that is drawn.
  private copies: { geometry: BufferGeometry; triangles: number }[][] = [];
  private level = 0;
  private known: PartFinder | null = null;
  private isCoarse = false;
  private isWhole = false;
  private readonly shader = new DistanceShader();
  private readonly wires = new Wires();
  // What a surface without labels is drawn with, so that its shader is there before its first block.
  private readonly usual = material(neutral);
  private readonly probe = new Mesh(placeholder(), this.usual);

  constructor(
    private readonly scene: Object3D,
    private readonly uploading: Pick<Uploading, 'add'>,
    private readonly draw: () => void,
  ) {
    this.probe.visible = false;
    scene.add(this.probe, this.wires.probe);
  }

  // Whether they are drawn with shaders that may not be there.
  add(blocks: Block[], part: Part | null, isLevel = false): boolean {
    const label = part?.label ?? null;
    const areFirst = part !== null && this.looks.size === 0;
    const look = this.looks.get(label) ?? this.newLook(part);
    for (const block of blocks) {
      const geometry = geometryOf(block, block.index);
      const [low, high] = block.bounds;
      geometry.boundingBox = new Box3(new Vector3(...low), new Vector3(...high));
      geometry.boundingSphere = geometry.boundingBox.getBoundingSphere(new Sphere());
      const meshes = look.materials.map((made) => new Mesh(geometry, made));
      const owner = isLevel ? look.level : look;
      const member = owner.blocks;
      const drawn: DrawnBlock = { meshes, geometry, wire: null, look, label, isLevel, member, made: block, distances: block.distances, isThere: false };
      this.uploading.add({
        geometries: [geometry],
        onThere: () => {
          drawn.isThere = true;
          this.show(drawn);
        },
      });
      owner.blocks += 1;
      this.place(meshes);
      this.show(drawn);
      this.blocks.push(drawn);
    }
    if (isLevel) this.showAll();
    return areFirst;
  }

  // All of it has come.
  finish(): void {
    this.isWhole = true;
    this.showAll();
  }

  // Null where the file has no distances.
  reach(): Reach | null {
    return reachOf(this.finest.flatMap(({ distances }) => distances ?? []));
  }

  setDistanceTop(millimetres: number): void {
    this.shader.setTop(millimetres);
  }

  get finest(): readonly DrawnBlock[] {
    return this.blocks.filter(({ isLevel }) => !isLevel);
  }

  // Finds which of its triangles belong together. To be asked for once all is there.
  get finder(): PartFinder {
    this.known ??= new PartFinder(this.finest.map(({ made }) => made));
    return this.known;
  }

  // The triangles that are drawn of each of the finest blocks; null: all.
  setIndex(indexOf: ((block: number) => Uint16Array<ArrayBuffer>) | null): void {
    this.finest.forEach(({ geometry, made }, at) => {
      geometry.setIndex(new BufferAttribute(indexOf?.(at) ?? made.index, 1));
      this.wires.forget(geometry);
    });
    this.takeCopies([]);
    this.showAll();
  }

  // Takes all blocks away.
  clear(): void {
    for (const { meshes, geometry, wire } of this.blocks.splice(0)) {
      this.scene.remove(...meshes, ...(wire ? [wire] : []));
      this.wires.forget(geometry);
      geometry.dispose();
    }
    this.takeCopies([]);
    for (const { copy, copyWire } of this.looks.values()) this.scene.remove(...copy, copyWire);
    this.looks.clear();
    this.known = null;
    this.isWhole = false;
  }

  // Those of the finest blocks that can be drawn.
  get trianglesThere(): number {
    return this.finest.reduce((sum, { made, isThere }) => sum + (isThere ? made.index.length / 3 : 0), 0);
  }

  // Whether it takes other shaders.
  setStyle(style: SurfaceStyle): boolean {
    const becameWire = style.wireframe && !this.style.wireframe;
    this.style = style;
    const isOther = this.applyAll();
    if (becameWire) this.showBySteps();
    else this.showAll();
    return isOther;
  }

  // What is on the other side of these planes is not seen.
  setCut(planes: Plane[] | null): boolean {
    this.planes = planes;
    this.wires.setCut(planes);
    const isOther = this.applyAll();
    this.showAll();
    return isOther;
  }

  get cut(): Plane | null {
    return this.planes?.[0] ?? null;
  }

  setHidden(labels: ReadonlySet<Label>): void {
    this.hidden = labels;
    for (const [label, look] of this.looks) look.isShown = label === null || !labels.has(label);
    this.showAll();
  }

  setColour(label: Label, colour: string): void {
    this.colours.set(label, colour);
    for (const made of this.looks.get(label)?.materials ?? []) made.color.set(colour);
  }

  // Whether it takes another shader.
  setOpacity(label: Label, opacity: number): boolean {
    this.opacities.set(label, opacity);
    const look = this.looks.get(label);
    if (!look) return false;
    look.opacity = opacity;
    const isOther = this.apply(look);
    this.showAll();
    return isOther;
  }

  // The number of that label's surface, of which there is a block.
  numberOf(label: Label | null): number {
    return [...this.looks.keys()].indexOf(label);
  }

  // Coarse copies of its surfaces, by their numbers; in place of those before.
  takeCopies(levels: readonly (readonly Coarse[])[]): void {
    for (const { geometry } of this.copies.flat()) {
      this.wires.forget(geometry);
      geometry.dispose();
    }
    this.copies = levels.map((surfaces) =>
      surfaces.map((made) => ({ geometry: geometryOf(made, made.index), triangles: made.index.length / 3 })),
    );
    for (const look of this.looks.values()) {
      if (look.copy.length > 0) continue;
      look.copy = look.materials.map((made) => new Mesh(placeholder(), made));
      this.place(look.copy);
      this.scene.add(look.copyWire);
    }
    this.setLevel(this.level);
  }

  // Which of the coarse copies is drawn while it moves.
  setLevel(level: number): void {
    this.level = level;
    const surfaces = this.copies[Math.min(level, this.copies.length - 1)];
    [...this.looks.values()].forEach(({ copy }, number) => {
      for (const mesh of copy) mesh.geometry = surfaces?.[number]?.geometry ?? mesh.geometry;
    });
    this.showAll();
  }

  // Of the copy that is drawn while it moves; 0 without one.
  get trianglesMoving(): number {
    return (this.copies[Math.min(this.level, this.copies.length - 1)] ?? []).reduce((sum, { triangles }) => sum + triangles, 0);
  }

  // Draws the coarse copy, where there is one, or the blocks.
  setCoarse(isCoarse: boolean): void {
    this.isCoarse = isCoarse;
    this.showAll();
  }

  // Draws one of so many steps; null: all at once. Transparent blocks must be drawn in order, from the back.
  setStep(step: number | null, steps: number): void {
    const share = this.blocks.length / steps;
    this.blocks.forEach((block, at) => {
      if (step === null || Math.floor(at / share) === step) this.show(block);
      else this.hide(block);
    });
  }

  get isSeenThrough(): boolean {
    return [...this.looks.values()].some(({ opacity }) => opacity * this.style.opacity < 1);
  }

  // The first triangle of what is shown that the ray meets within the interval.
  hit(ray: Ray, { from, to }: Interval): Hit | null {
    let end = to;
    let nearest: { block: DrawnBlock; corner: number } | null = null;
    for (const block of this.blocks) {
      const { geometry, made } = block;
      if (!this.isSeen(block) || !geometry.boundingBox || !ray.intersectsBox(geometry.boundingBox)) continue;
      const met = firstMet(made.positions, geometry.getIndex()?.array ?? [], ray, { from, to: end });
      if (met.corner < 0) continue;
      end = met.at;
      nearest = { block, corner: met.corner };
    }
    if (!nearest) return null;
    const { block, corner } = nearest;
    const { label, distances, made, geometry } = block;
    const index = geometry.getIndex()?.array ?? [];
    const place = { block: this.finest.indexOf(block), vertex: index[corner] ?? 0 };
    if (!distances) return { at: end, label, ...place };
    const point = ray.at(end, new Vector3()).toArray();
    const corners = [0, 1, 2].map((i) => index[corner + i] ?? 0) as [number, number, number];
    const distance = valueWithin(distances, made.positions, corners, point);
    return { at: end, label, distance, ...place };
  }

  // Makes the shading go on across the seams, a block at each step: first all of them are learned, then joined. False
  // when there is no such step.
  joinSeams(step: number): boolean {
    const count = this.blocks.length;
    const block = this.blocks[step % Math.max(1, count)];
    if (!block || step >= 2 * count) return false;
    const { look, isLevel, member, made } = block;
    const { seams } = isLevel ? look.level : look;
    if (step < count) {
      seams.add(made);
      return true;
    }
    seams.join(member);
    block.geometry.getAttribute('normal').needsUpdate = true;
    return true;
  }

  dispose(): void {
    for (const { geometry } of [...this.blocks, ...this.copies.flat()]) geometry.dispose();
    for (const { materials } of this.looks.values()) for (const made of materials) made.dispose();
    this.usual.dispose();
    this.shader.dispose();
    this.wires.dispose();
  }

  private newLook(part: Part | null): Look {
    const colour = part ? (this.colours.get(part.label) ?? part.colour) : neutral;
    const look = {
      materials: part ? labelMaterials(colour) : [this.usual],
      isShown: !part || !this.hidden.has(part.label),
      seams: new Seams(),
      blocks: 0,
      level: { seams: new Seams(), blocks: 0 },
      copy: [],
      copyWire: this.wires.add(),
      showsDistance: false,
      opacity: part ? (this.opacities.get(part.label) ?? 1) : 1,
    };
    this.apply(look);
    this.looks.set(part?.label ?? null, look);
    return look;
  }

  private applyAll(): boolean {
    return [...this.looks.values()].map((look) => this.apply(look)).some(Boolean);
  }

  // Whether its shader is another one now.
  private apply(look: Look): boolean {
    const { materials } = look;
    const { shading, wireframe, distance } = this.style;
    const opacity = this.style.opacity * look.opacity;
    let hasChanged = distance !== look.showsDistance;
    if (distance !== look.showsDistance) {
      look.showsDistance = distance;
      for (const made of materials) this.shader.apply(made, distance);
    }
    for (const made of materials) {
      // What of it is a part of the shader.
      const isOther =
        made.flatShading !== (shading === 'flat') ||
        made.transparent !== opacity < 1 ||
        made.clippingPlanes !== this.planes;
      if (isOther) made.needsUpdate = true;
      hasChanged ||= isOther;
      made.flatShading = shading === 'flat';
      // Edges lie on the surface.
      made.polygonOffset = wireframe || made.side === BackSide;
      made.opacity = opacity;
      made.transparent = opacity < 1;
      made.depthWrite = opacity === 1;
      made.clippingPlanes = this.planes;
    }
    return hasChanged;
  }

  private place(meshes: readonly Drawn[]): void {
    for (const mesh of meshes) {
      mesh.matrixAutoUpdate = false;
      this.scene.add(mesh);
    }
  }

  private show(block: DrawnBlock): void {
    const isSeen = this.isSeen(block);
    this.showMeshes(block.meshes, block.look, isSeen);
    if (isSeen && this.style.wireframe && !block.wire) {
      block.wire = this.wires.add();
      this.scene.add(block.wire);
    }
    if (block.wire) this.showWire(block.wire, block.geometry, block.made.border, isSeen);
  }

  private showWire(wire: Wire, geometry: BufferGeometry, border: ArrayLike<number>, isSeen: boolean): void {
    wire.visible = isSeen && this.style.wireframe;
    if (wire.visible) wire.geometry = this.wires.of(geometry, border);
  }

  private hide({ meshes, wire }: DrawnBlock): void {
    for (const mesh of meshes) mesh.visible = false;
    if (wire) wire.visible = false;
  }

  // The back of a closed surface is only seen where it is cut or looked through.
  private showMeshes([front, back]: readonly Drawn[], { opacity }: Look, isSeen: boolean): void {
    if (front) front.visible = isSeen;
    const isThrough = this.style.opacity * opacity < 1;
    if (back) back.visible = isSeen && (this.planes !== null || isThrough);
  }

  private get isCopySeen(): boolean {
    return this.isCoarse && this.copies.length > 0;
  }

  // Of a look with a coarse level either that one is seen or the finest.
  private isSeen({ look, isLevel, isThere }: DrawnBlock): boolean {
    const isByLevel = look.level.blocks > 0 && !this.isWhole;
    return look.isShown && isThere && isLevel === isByLevel && !this.isCopySeen;
  }

  private showAll(): void {
    for (const block of this.blocks) this.show(block);
    for (const look of this.looks.values()) {
      const isSeen = look.isShown && this.isCopySeen;
      this.showMeshes(look.copy, look, isSeen);
      const geometry = look.copy[0]?.geometry;
      if (geometry) this.showWire(look.copyWire, geometry, { length: 0 }, isSeen);
    }
  }

  // Wires are made of a block when it is first drawn with them, so that some blocks at a time get them.
  private showBySteps(): void {
    for (const { wire } of this.blocks) if (wire) wire.visible = false;
    const step = (from: number): void => {
      for (const block of this.blocks.slice(from, from + wiresPerFrame)) this.show(block);
      this.draw();
      if (from < this.blocks.length) requestAnimationFrame(() => step(from + wiresPerFrame));
    };
    step(0);
  }
}
