// Distances of a surface's vertices as colour: how far they reach, and the shader that shows them.
import { ClampToEdgeWrapping, DataTexture, LinearFilter, SRGBColorSpace, Triangle, Vector3, type MeshPhongMaterial } from 'three';
import type { Vec3 } from '../api/types';
import { colourTable } from './colour_map';

const bins = 4096;
const colours = 256;

export interface Reach {
  most: number;
  p99: number; // 99 of 100 vertices are this near, to a bin
}

// Of all vertices; null without any.
export function reachOf(parts: readonly Float32Array[]): Reach | null {
  let most = -1;
  let count = 0;
  for (const part of parts) {
    count += part.length;
    for (const distance of part) if (distance > most) most = distance;
  }
  if (count === 0) return null;
  if (most <= 0) return { most: 0, p99: 0 };
  const counts = new Uint32Array(bins);
  for (const part of parts) {
    for (const distance of part) {
      const bin = Math.min(bins - 1, Math.floor((distance / most) * bins));
      counts[bin] = (counts[bin] as number) + 1;
    }
  }
  let below = 0;
  let bin = 0;
  while (bin < bins && below < 0.99 * count) below += counts[bin++] as number;
  return { most, p99: Math.min(most, (most * bin) / bins) };
}

// The value within a triangle at that point of its plane, of its corners' three.
export function valueWithin(values: ArrayLike<number>, positions: ArrayLike<number>, corners: readonly [number, number, number], point: Vec3): number {
  const [a, b, c] = corners.map((vertex) => new Vector3().fromArray(positions, 3 * vertex)) as [Vector3, Vector3, Vector3];
  // Null where the triangle is a line.
  const weights = Triangle.getBarycoord(new Vector3(...point), a, b, c, new Vector3())?.toArray() ?? [1, 0, 0];
  return corners.reduce((sum, vertex, i) => sum + (weights[i] ?? 0) * (values[vertex] as number), 0);
}

// What every material that shows distances shares; one change of the scale is seen in all.
export class DistanceShader {
  private readonly map = new DataTexture(colourTable(colours), colours, 1);
  private readonly top = { value: 1 };

  constructor() {
    this.map.colorSpace = SRGBColorSpace;
    this.map.minFilter = LinearFilter;
    this.map.magFilter = LinearFilter;
    this.map.wrapS = ClampToEdgeWrapping;
    this.map.needsUpdate = true;
  }

  // The distance of the last colour, in millimetres.
  setTop(millimetres: number): void {
    this.top.value = Math.max(millimetres, 1e-9);
  }

  // Needs the attribute `distanceMm` of what is drawn.
  apply(material: MeshPhongMaterial, isOn: boolean): void {
    material.customProgramCacheKey = () => (isOn ? 'distance' : '');
    material.onBeforeCompile = (shader) => {
      if (!isOn) return;
      shader.uniforms.distanceColours = { value: this.map };
      shader.uniforms.distanceTop = this.top;
      shader.vertexShader = `attribute float distanceMm;\nvarying float vDistanceMm;\n${shader.vertexShader.replace(
        '#include <begin_vertex>',
        '#include <begin_vertex>\nvDistanceMm = distanceMm;',
      )}`;
      shader.fragmentShader = `uniform sampler2D distanceColours;\nuniform float distanceTop;\nvarying float vDistanceMm;\n${shader.fragmentShader.replace(
        '#include <color_fragment>',
        'float distanceShare = clamp(vDistanceMm / distanceTop, 0.0, 1.0);\ndiffuseColor.rgb = texture2D(distanceColours, vec2(distanceShare, 0.5)).rgb;',
      )}`;
    };
    material.needsUpdate = true;
  }

  dispose(): void {
    this.map.dispose();
  }
}
