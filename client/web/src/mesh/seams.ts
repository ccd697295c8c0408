// Normals across the seams of blocks: the sums at a place that several blocks name add up, and the shading goes on across the seam
// without an edge.
import { packNormal, placeKey, type Block } from './blocks';

type Sum = [number, number, number];

export class Seams {
  private readonly sums = new Map<string, Sum>();
  // Each block with the sums of its border's places.
  private readonly members: { block: Block; sums: Sum[] }[] = [];

  add(block: Block): void {
    const sums = Array.from(block.border, (vertex, at) => {
      const key = placeKey(block.positions, vertex);
      const sum = this.sums.get(key) ?? [0, 0, 0];
      this.sums.set(key, sum);
      for (const axis of [0, 1, 2] as const) sum[axis] += block.borderNormals[3 * at + axis] as number;
      return sum;
    });
    this.members.push({ block, sums });
  }

  // Writes the normals of one block's border; false when there is no such block.
  join(member: number): Block | null {
    const { block, sums } = this.members[member] ?? {};
    if (!block) return null;
    sums?.forEach((sum, at) => packNormal(block.normals, block.border[at] as number, ...sum));
    return block;
  }
}
