// Keeps the labels 1 to N of a segmentation in a compressed NIfTI-1 file of unsigned bytes: node keep_labels.mjs IN N OUT
import { readFileSync, writeFileSync } from 'node:fs';
import { gunzipSync, gzipSync } from 'node:zlib';

const [file, count, target] = process.argv.slice(2);
if (!target || !(Number(count) > 0)) {
  console.error('Usage: node keep_labels.mjs IN N OUT');
  process.exit(2);
}
const nifti = gunzipSync(readFileSync(file));
const unsignedByte = 2;
if (nifti.readInt32LE(0) !== 348 || nifti.readInt16LE(70) !== unsignedByte) throw new Error(`${file} has no unsigned bytes in little-endian NIfTI-1`);
for (let at = nifti.readFloatLE(108); at < nifti.length; at += 1) if (nifti[at] > Number(count)) nifti[at] = 0;
writeFileSync(target, gzipSync(nifti));
