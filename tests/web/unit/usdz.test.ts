import { describe, expect, it } from 'vitest';
import { Box3, Mesh } from 'three';
import type { Job } from '@/api/types';
import { certificateFile } from '@/job/printing';
import { prepare } from '@/mesh/blocks';
import { sceneOf } from '@/mesh/usdz';

describe('a surface for a phone', () => {
  it('is in metres with the head up, and keeps which side is out', () => {
    // A triangle that is seen from the front, where y is smaller.
    const positions = Float32Array.from([0, 0, 0, 100, 0, 0, 0, 0, 300]);
    const block = prepare({ positions, index: Uint32Array.from([0, 1, 2]) });
    const scene = sceneOf([{ block, colour: '#ff0000' }, { block, colour: '#ff0000' }]);
    const box = new Box3().setFromObject(scene);
    expect(box.max.toArray().map((value) => Number(value.toFixed(6)) + 0)).toEqual([0.1, 0.3, 0]);
    const [first, second] = scene.children as [Mesh, Mesh];
    expect(first.material).toBe(second.material);
    const normal = [...first.geometry.getAttribute('normal').array.subarray(0, 3)].map(Math.round);
    expect(normal.map((value) => value + 0)).toEqual([0, 0, 1]);
  });
});

describe('a surface for a printer', () => {
  it('has a certificate that names its files by their digests, and no address', () => {
    const job = {
      id: 'j',
      finished: 't',
      parameters: { iso: 3 },
      mesh: { certificate: { found_mm: 0.1 }, triangles: 5, files: { stl: { bytes: 9, sha256: 'ab', href: '/v1/x' } } },
    } as unknown as Job;
    const told = JSON.parse(certificateFile(job)) as Record<string, unknown>;
    expect(told).toMatchObject({ job: 'j', certificate: { found_mm: 0.1 }, files: { stl: { bytes: 9, sha256: 'ab' } } });
    expect(certificateFile(job)).not.toContain('/v1/');
  });
});
