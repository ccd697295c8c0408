// A surface as USDZ, which phones show in the room (AR): in metres, with Y up.
import { BufferAttribute, BufferGeometry, Matrix4, Mesh, MeshStandardMaterial, Scene } from 'three';
import { USDZExporter } from 'three/examples/jsm/exporters/USDZExporter.js';
import type { Job } from '../api/types';
import type { Block } from './blocks';
import { loadMesh } from './load';

const neutral = '#dcd6c8';
const fromPatient = new Matrix4().set(1e-3, 0, 0, 0, 0, 0, 1e-3, 0, 0, -1e-3, 0, 0, 0, 0, 0, 1);

function geometryOf({ positions, normals, index }: Block): BufferGeometry {
  const geometry = new BufferGeometry();
  geometry.setAttribute('position', new BufferAttribute(positions.slice(), 3));
  const unpacked = Float32Array.from(positions, (_, i) => (normals[4 * Math.floor(i / 3) + (i % 3)] as number) / 32_767);
  geometry.setAttribute('normal', new BufferAttribute(unpacked, 3));
  geometry.setIndex(new BufferAttribute(index, 1));
  return geometry.applyMatrix4(fromPatient);
}

export function sceneOf(parts: readonly { block: Block; colour: string }[]): Scene {
  const scene = new Scene();
  const materials = new Map<string, MeshStandardMaterial>();
  parts.forEach(({ block, colour }, number) => {
    const material = materials.get(colour) ?? new MeshStandardMaterial({ color: colour, roughness: 0.7, metalness: 0 });
    materials.set(colour, material);
    const mesh = new Mesh(geometryOf(block), material);
    mesh.name = `part${number}`;
    scene.add(mesh);
  });
  scene.updateMatrixWorld(true);
  return scene;
}

// Of a job that made GLB or Draco.
export async function usdzOf(job: Job, signal: AbortSignal): Promise<Blob> {
  const parts: { block: Block; colour: string }[] = [];
  await loadMesh(job, signal, {
    onBlocks: (blocks, part, isCoarse) => {
      if (!isCoarse) parts.push(...blocks.map((block) => ({ block, colour: part?.colour ?? neutral })));
    },
    onProgress: () => undefined,
  });
  const bytes = await new USDZExporter().parseAsync(sceneOf(parts));
  return new Blob([new Uint8Array(bytes)], { type: 'model/vnd.usdz+zip' });
}
