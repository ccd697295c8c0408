#!/bin/sh
# Guess: cornerstone3D finds the segments of a labelmap in its voxels, at the latest when it converts all of them to surfaces or contours
#   (`getUniqueSegmentIndices`).
# Seen: it never looks at the voxels. A labelmap that is added without `config.segments` has one segment, number 1, whatever its voxels
#   are; so a conversion makes one surface of three, without a warning.
# Packages: npm @cornerstonejs/core 5.14.0, @cornerstonejs/tools 5.14.0. Date: 2026-11-30.
set -eu
t=$(mktemp -d)
trap 'rm -rf "$t"' EXIT
cd "$t"
npm install --prefix . --ignore-scripts --no-audit --no-fund --no-save @cornerstonejs/core@5.14.0 @cornerstonejs/tools@5.14.0 >npm.log 2>&1
cat >count.mjs <<'M'
import { volumeLoader } from '@cornerstonejs/core';
import { segmentation, utilities } from '@cornerstonejs/tools';

const labels = [2, 3, 7];
const scalarData = new Uint8Array(64);
scalarData.set(labels, 20);
const identity = [1, 0, 0, 0, 1, 0, 0, 0, 1];
const metadata = {
  BitsAllocated: 8, BitsStored: 8, HighBit: 7, SamplesPerPixel: 1, PixelRepresentation: 0, PhotometricInterpretation: 'MONOCHROME2',
  Modality: 'SEG', ImageOrientationPatient: identity.slice(0, 6), PixelSpacing: [1, 1], FrameOfReferenceUID: '1.2.3', Columns: 4, Rows: 4,
  voiLut: [], VOILUTFunction: 'LINEAR',
};
const grid = { dimensions: [4, 4, 4], spacing: [1, 1, 1], origin: [0, 0, 0], direction: identity };
volumeLoader.createLocalVolume('labels', { metadata, ...grid, scalarData });
const representation = { type: 'Labelmap', data: { volumeId: 'labels' } };
const segments = Object.fromEntries(labels.map((segmentIndex) => [segmentIndex, { segmentIndex }]));
segmentation.addSegmentations([
  { segmentationId: 'without', representation },
  { segmentationId: 'with', representation, config: { segments } },
]);
for (const id of ['without', 'with']) {
  console.log(`${id} config.segments: ${utilities.segmentation.getUniqueSegmentIndices(id).join(' ')}`);
}
M
seen=$(node count.mjs 2>/dev/null)
echo "$seen"
want='without config.segments: 1
with config.segments: 2 3 7'
[ "$seen" = "$want" ] || { echo changed; exit 1; }
