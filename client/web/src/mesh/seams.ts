// Normals across the seams of blocks. All blocks share one grid, so that a vertex on a seam has the
// same bits in every block that names it: the sums of its normals add up, and the shading goes on across
// the seam without an edge.
import { packNormal, type Block } from './blocks';

export class Seams {
  private slots = new Int32Array(1 << 12).fill(-1);
  private places = new Float32Array(3 * (1 << 10));
  private sums = new Float32Array(3 * (1 << 10));
  private count = 0;
  // Of each block, the numbers of its border's places.
  private readonly members: { block: Block; numbers: Int32Array }[] = [];

  add(block: Block): void {
    const numbers = new Int32Array(block.border.length);
    block.border.forEach((vertex, i) => {
      const at = 3 * vertex;
      const number = this.numberOf(
        block.positions[at] as number,
        block.positions[at + 1] as number,
        block.positions[at + 2] as number,
      );
      for (let axis = 0; axis < 3; axis += 1) {
        this.sums[3 * number + axis] =
          (this.sums[3 * number + axis] as number) + (block.borderNormals[3 * i + axis] as number);
      }
      numbers[i] = number;
    });
    this.members.push({ block, numbers });
  }

  // Writes the normals of one block's border; false when there is no such block.
  join(member: number): Block | null {
    const entry = this.members[member];
    if (!entry) return null;
    entry.numbers.forEach((number, i) => {
      packNormal(
        entry.block.normals,
        entry.block.border[i] as number,
        this.sums[3 * number] as number,
        this.sums[3 * number + 1] as number,
        this.sums[3 * number + 2] as number,
      );
    });
    return entry.block;
  }

  private numberOf(x: number, y: number, z: number): number {
    if (2 * this.count >= this.slots.length) this.grow();
    const slot = this.slotOf(x, y, z);
    const found = this.slots[slot] as number;
    if (found >= 0) return found;
    if (3 * this.count >= this.places.length) {
      this.places = doubled(this.places);
      this.sums = doubled(this.sums);
    }
    this.places.set([x, y, z], 3 * this.count);
    this.slots[slot] = this.count;
    this.count += 1;
    return this.count - 1;
  }

  private slotOf(x: number, y: number, z: number): number {
    const mask = this.slots.length - 1;
    const hash =
      Math.imul(bits(x), 0x9e37_79b1) ^ Math.imul(bits(y), 0x85eb_ca6b) ^ Math.imul(bits(z), 0xc2b2_ae35);
    let slot = (hash ^ (hash >>> 15)) & mask;
    for (;;) {
      const number = this.slots[slot] as number;
      if (number < 0) return slot;
      if (
        this.places[3 * number] === x &&
        this.places[3 * number + 1] === y &&
        this.places[3 * number + 2] === z
      ) {
        return slot;
      }
      slot = (slot + 1) & mask;
    }
  }

  private grow(): void {
    this.slots = new Int32Array(2 * this.slots.length).fill(-1);
    for (let number = 0; number < this.count; number += 1) {
      const at = 3 * number;
      const slot = this.slotOf(
        this.places[at] as number,
        this.places[at + 1] as number,
        this.places[at + 2] as number,
      );
      this.slots[slot] = number;
    }
  }
}

const single = new Float32Array(1);
const singleBits = new Int32Array(single.buffer);

function bits(value: number): number {
  single[0] = value === 0 ? 0 : value; // -0 is at the same place
  return singleBits[0] as number;
}

function doubled(values: Float32Array<ArrayBuffer>): Float32Array<ArrayBuffer> {
  const larger = new Float32Array(2 * values.length);
  larger.set(values);
  return larger;
}
