import { describe, expect, it } from 'vitest';
import { Mesh, MeshPhongMaterial, Plane, Ray, Scene, Vector3, type BufferGeometry, type Side } from 'three';
import { prepare, type Block } from '@/mesh/blocks';
import { merged, type Coarse } from '@/mesh/coarse';
import { Parts } from '@/scene/parts';
import { defaultStyle } from '@/scene/style';
import { wholeRay } from '@/scene/pick';
import type { Waiting } from '@/scene/uploading';

// A square across z at that height; its distances are x + y.
function square(z: number, hasDistances = false): Block {
  const positions = Float32Array.from([0, 0, z, 4, 0, z, 4, 4, z, 0, 4, z]);
  const index = Uint32Array.from([0, 1, 2, 0, 2, 3]);
  return prepare(hasDistances ? { positions, index, distances: Float32Array.from([0, 4, 8, 4]) } : { positions, index });
}

type Drawn = Mesh<BufferGeometry, MeshPhongMaterial>;

function drawn(scene: Scene): Drawn[] {
  return scene.children.filter((child): child is Drawn => child instanceof Mesh && child.visible);
}

function colours(scene: Scene): string[] {
  return drawn(scene).map(({ material }) => material.color.getHexString());
}

function sides(scene: Scene): Side[] {
  return [...new Set(drawn(scene).map(({ material }) => material.side))];
}

const up = new Ray(new Vector3(1, 2, -1), new Vector3(0, 0, 1));

// Blocks are at the graphics processor as soon as they come.
const atOnce = { add: ({ onThere }: Waiting): void => onThere() };

function none(uploading = atOnce): { parts: Parts; scene: Scene } {
  const scene = new Scene();
  return { parts: new Parts(scene, uploading, () => undefined), scene };
}

function labelled(): { parts: Parts; scene: Scene } {
  const { parts, scene } = none();
  parts.add([square(0)], { label: 1, colour: '#d02020' });
  parts.add([square(2), square(5)], { label: 2, colour: '#2040d0' });
  return { parts, scene };
}

describe('the parts of a surface', () => {
  it('are of one colour, and of no label, without labels', () => {
    const { parts, scene } = none();
    parts.add([square(0), square(3)], null);
    expect(new Set(colours(scene)).size).toBe(1);
    expect(parts.trianglesThere).toBe(4);
    expect(parts.hit(up, wholeRay)).toMatchObject({ at: 1, label: null });
    parts.setHidden(new Set([1]));
    expect(drawn(scene).length).toBe(2);
  });

  it('have the colours of their labels, also where these are told before the surface comes', () => {
    const { parts, scene } = labelled();
    expect(colours(scene)).toEqual(['d02020', '2040d0', '2040d0']);
    parts.setColour(2, '#00ff00');
    parts.setColour(3, '#123456');
    parts.add([square(7)], { label: 3, colour: '#ffffff' });
    expect(colours(scene)).toEqual(['d02020', '00ff00', '00ff00', '123456']);
  });

  it('are not drawn and not hit while their label is hidden', () => {
    const { parts, scene } = labelled();
    expect(parts.hit(up, wholeRay)).toMatchObject({ at: 1, label: 1 });
    parts.setHidden(new Set([1, 4]));
    expect(colours(scene)).toEqual(['2040d0', '2040d0']);
    expect(parts.hit(up, wholeRay)).toMatchObject({ at: 3, label: 2 });
    expect(parts.hit(up, { from: 0, to: 2.5 })).toBe(null);
    parts.add([square(8)], { label: 4, colour: '#ffffff' });
    expect(drawn(scene).length).toBe(2);
    parts.setHidden(new Set());
    expect(drawn(scene).length).toBe(4);
  });

  it('show their backs only where these can be seen', () => {
    const { parts, scene } = labelled();
    expect(sides(scene).length).toBe(1);
    parts.setCut([new Plane(new Vector3(0, 0, 1), 0)]);
    expect([sides(scene).length, drawn(scene).length]).toEqual([2, 6]);
    parts.setHidden(new Set([2]));
    expect(drawn(scene).length).toBe(2);
    parts.setHidden(new Set());
    parts.setCut(null);
    expect(drawn(scene).length).toBe(3);
    parts.setStyle({ ...defaultStyle, opacity: 0.5 });
    expect(drawn(scene).length).toBe(6);
    parts.setStyle(defaultStyle);
    expect(drawn(scene).length).toBe(3);
  });

  it('are not drawn before they are at the graphics processor', () => {
    const waiting: Waiting[] = [];
    const { parts, scene } = none({ add: (one) => void waiting.push(one) });
    parts.add([square(0), square(3)], null);
    parts.setStyle({ ...defaultStyle, opacity: 0.5 });
    expect(drawn(scene)).toEqual([]);
    waiting[0]?.onThere();
    expect(drawn(scene)).toHaveLength(1);
    expect(waiting[0]?.geometries).toHaveLength(1);
  });

  it('are seen by their coarse level until all is there', () => {
    const { parts, scene } = none();
    const heights = (): number[] => drawn(scene).map(({ geometry }) => geometry.getAttribute('position').array[2] ?? NaN);
    parts.add([square(9)], null, true);
    parts.add([square(1)], null);
    expect([heights(), parts.trianglesThere]).toEqual([[9], 2]);
    expect(parts.hit(up, wholeRay)?.at).toBe(10);
    parts.add([square(2)], null);
    parts.finish();
    expect([heights(), parts.trianglesThere]).toEqual([[1, 2], 4]);
    expect(parts.hit(up, wholeRay)?.at).toBe(2);
    expect(Array.from({ length: 7 }, (_, step) => parts.joinSeams(step)).filter(Boolean)).toHaveLength(6);
  });

  it('stay as they are while another label has a coarse level', () => {
    const { parts, scene } = labelled();
    parts.add([square(9)], { label: 1, colour: '#d02020' }, true);
    expect(colours(scene).sort()).toEqual(['2040d0', '2040d0', 'd02020']);
    parts.setHidden(new Set([1]));
    expect(colours(scene)).toEqual(['2040d0', '2040d0']);
  });

  it('are seen by a copy of each label while they move, where there are copies', () => {
    const { parts, scene } = labelled();
    const triangles = (): number[] => drawn(scene).map(({ geometry }) => (geometry.index?.count ?? 0) / 3);
    expect([parts.numberOf(1), parts.numberOf(2)]).toEqual([0, 1]);
    parts.setCoarse(true);
    expect(drawn(scene)).toHaveLength(3);
    const one = (): Coarse => ({ ...square(0), index: Uint32Array.from(square(0).index) });
    parts.takeCopies([[merged([one(), one()]), merged([one(), one(), one()])], [one(), one()]]);
    expect([triangles(), parts.trianglesMoving]).toEqual([[4, 6], 10]);
    expect(colours(scene)).toEqual(['d02020', '2040d0']);
    parts.setLevel(1);
    expect([triangles(), parts.trianglesMoving]).toEqual([[2, 2], 4]);
    parts.setLevel(7);
    expect(triangles()).toEqual([2, 2]);
    parts.setHidden(new Set([2]));
    expect(colours(scene)).toEqual(['d02020']);
    parts.setCut([new Plane(new Vector3(0, 0, 1), 0)]);
    expect(sides(scene)).toHaveLength(2);
    parts.setCoarse(false);
    expect(parts.hit(up, wholeRay)).toMatchObject({ at: 1, label: 1 });
  });

  it('tell the distance where they are hit, and how far all reach', () => {
    const { parts } = none();
    parts.add([square(0)], null);
    expect([parts.hit(up, wholeRay), parts.reach()]).toMatchObject([{ at: 1, label: null }, null]);
    parts.add([square(-0.5, true)], null);
    parts.add([square(9, true)], null, true);
    parts.finish();
    expect(parts.hit(up, wholeRay)).toMatchObject({ at: 0.5, label: null });
    expect(parts.hit(up, wholeRay)?.distance).toBeCloseTo(3, 5);
    expect(parts.reach()?.most).toBe(8);
  });

  it('join their normals within a label and not across a wall that two share', () => {
    const { parts } = none();
    const front = square(0);
    const back = prepare({ positions: front.positions.slice(), index: Uint32Array.from([0, 2, 1, 0, 3, 2]) });
    parts.add([front], { label: 1, colour: '#d02020' });
    parts.add([back], { label: 2, colour: '#2040d0' });
    expect([0, 1, 2, 3, 4].map((step) => parts.joinSeams(step))).toEqual([true, true, true, true, false]);
    expect([front.normals[2], back.normals[2]]).toEqual([32_767, -32_767]);
  });
});
