import { describe, expect, it } from 'vitest';
import { MeshPhongMaterial } from 'three';
import { split } from '@/mesh/blocks';
import { colourAt, colourTable } from '@/scene/colour_map';
import { DistanceShader, reachOf, valueWithin } from '@/scene/distances';

// CIE's lightness of a screen's colour.
function lightness([red, green, blue]: readonly number[]): number {
  const linear = (value = 0): number => (value <= 10.3 ? value / 3294.6 : ((value / 255 + 0.055) / 1.055) ** 2.4);
  const y = 0.2126 * linear(red) + 0.7152 * linear(green) + 0.0722 * linear(blue);
  return 116 * Math.cbrt(y) - 16;
}

describe('the colours of distances', () => {
  it('get lighter in equal steps', () => {
    const steps = 16;
    const all = Array.from({ length: steps + 1 }, (_, i) => lightness(colourAt(i / steps)));
    const mean = ((all.at(-1) ?? 0) - (all[0] ?? 0)) / steps;
    expect(mean).toBeGreaterThan(3.5);
    for (let i = 0; i < steps; i += 1) {
      const step = (all[i + 1] ?? 0) - (all[i] ?? 0);
      expect(step).toBeGreaterThan(0.6 * mean);
      expect(step).toBeLessThan(1.4 * mean);
    }
  });

  it('go from a blue by way of a green to a yellow, and no farther', () => {
    const [red, green, blue] = colourAt(0);
    expect(blue).toBeGreaterThan(Math.max(red, green));
    const [middleRed, middleGreen, middleBlue] = colourAt(0.6);
    expect(middleGreen).toBeGreaterThan(Math.max(middleRed, middleBlue));
    const end = colourAt(1);
    expect(Math.min(end[0], end[1])).toBeGreaterThan(end[2]);
    expect([colourAt(-1), colourAt(2)]).toEqual([colourAt(0), end]);
    const table = colourTable(3);
    expect([...table]).toEqual([...colourAt(0), 255, ...colourAt(0.5), 255, ...end, 255]);
  });
});

describe('the distances of a surface', () => {
  it('reach as far as the largest, and 99 of 100 of them less', () => {
    expect(reachOf([])).toBe(null);
    expect(reachOf([new Float32Array(5)])).toEqual({ most: 0, p99: 0 });
    const near = Float32Array.from({ length: 990 }, (_, i) => i / 1000);
    const far = new Float32Array(10).fill(5);
    const reach = reachOf([near, far]);
    expect(reach?.most).toBe(5);
    expect(reach?.p99).toBeGreaterThanOrEqual(0.989);
    expect(reach?.p99).toBeLessThan(0.989 + (2 * 5) / 4096);
    expect(reachOf([Float32Array.from([1])])).toEqual({ most: 1, p99: 1 });
  });

  it('are interpolated within a triangle', () => {
    const positions = [0, 0, 1, 4, 0, 1, 0, 4, 1];
    const value = (x: number, y: number): number => valueWithin([1, 2, 3], positions, [0, 1, 2], [x, y, 1]);
    expect(value(0, 0)).toBeCloseTo(1, 6);
    expect(value(4, 0)).toBeCloseTo(2, 6);
    expect(value(2, 2)).toBeCloseTo(2.5, 6);
    expect(value(1, 1)).toBeCloseTo(1.75, 6);
    expect(valueWithin([7, 7, 7], new Float32Array(9), [0, 1, 2], [0, 0, 0])).toBe(7);
  });

  it('stay with their vertices when a surface is split', () => {
    const triangles = 70_000;
    const positions = Float32Array.from({ length: 9 * triangles }, (_, i) => i);
    const index = Uint32Array.from({ length: 3 * triangles }, (_, i) => i);
    const distances = Float32Array.from({ length: 3 * triangles }, (_, vertex) => 3 * vertex);
    const parts = split({ positions, index, distances });
    expect(parts.length).toBeGreaterThan(1);
    for (const part of parts) {
      expect(part.distances?.length).toBe(part.positions.length / 3);
      part.distances?.forEach((distance, vertex) => {
        if (distance !== part.positions[3 * vertex]) throw new Error(`vertex ${vertex} has another's distance`);
      });
    }
  });

  it('are in the shader only while they are shown', () => {
    const source = { uniforms: {}, vertexShader: '#include <begin_vertex>', fragmentShader: '#include <color_fragment>' };
    const shader = new DistanceShader();
    const material = new MeshPhongMaterial();
    const compiled = (isOn: boolean): typeof source => {
      shader.apply(material, isOn);
      const made = { ...source, uniforms: {} };
      material.onBeforeCompile(made as never, null as never);
      return made;
    };
    const plain = compiled(false);
    const plainKey = material.customProgramCacheKey();
    expect(plain).toEqual(source);
    const coloured = compiled(true);
    expect(coloured.vertexShader).toContain('distanceMm');
    expect(coloured.fragmentShader).toContain('texture2D(distanceColours');
    expect(Object.keys(coloured.uniforms)).toEqual(['distanceColours', 'distanceTop']);
    expect(material.customProgramCacheKey()).not.toBe(plainKey);
  });
});
