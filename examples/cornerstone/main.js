// Shows the surfaces that isomesh makes of a segmentation: over the image's slices and in three dimensions, beside those that
// cornerstone3D makes in the browser, with the time and the memory that each takes.
//
// The daemon must allow this page's origin: isomeshd --cors-origin http://localhost:8000
import * as core from '@cornerstonejs/core';
import * as polySeg from '@cornerstonejs/polymorphic-segmentation';
import * as tools from '@cornerstonejs/tools';
import { outlinesOver } from './outlines.js';
import { addressOf, labelsOf, meshOfLabels, samples, upload } from './service.js';

const { GeometryType, MeshType, OrientationAxis, ViewportType } = core.Enums;
const { Labelmap, Surface } = tools.Enums.SegmentationRepresentations;
const planes = ['axial', 'coronal', 'sagittal'];
const scenes = ['isomesh', 'polyseg'];
const segmentationId = 'segmentation';
const form = document.querySelector('form');
const output = document.querySelector('output');
const rows = document.querySelector('tbody');

core.init();
tools.init({ addons: { polySeg } });
polySeg.init({ autoTerminateOnIdle: { enabled: false } });
for (const tool of [tools.StackScrollTool, tools.ZoomTool, tools.TrackballRotateTool]) tools.addTool(tool);

const engine = new core.RenderingEngine('engine');

function openViewports() {
  engine.setViewports([
    ...planes.map((plane) => ({
      viewportId: plane,
      type: ViewportType.ORTHOGRAPHIC,
      element: document.getElementById(plane),
      defaultOptions: { orientation: OrientationAxis[plane.toUpperCase()], background: [0, 0, 0] },
    })),
    ...scenes.map((scene) => ({
      viewportId: scene,
      type: ViewportType.VOLUME_3D,
      element: document.getElementById(scene),
      defaultOptions: { orientation: OrientationAxis.CORONAL, background: [0.13, 0.14, 0.16] },
    })),
  ]);
  const { MouseBindings } = tools.Enums;
  const scrolling = tools.ToolGroupManager.createToolGroup('slices');
  scrolling.addTool(tools.StackScrollTool.toolName);
  scrolling.setToolActive(tools.StackScrollTool.toolName, { bindings: [{ mouseButton: MouseBindings.Wheel }] });
  const turning = tools.ToolGroupManager.createToolGroup('scenes');
  turning.addTool(tools.TrackballRotateTool.toolName);
  turning.setToolActive(tools.TrackballRotateTool.toolName, { bindings: [{ mouseButton: MouseBindings.Primary }] });
  turning.addTool(tools.ZoomTool.toolName);
  turning.setToolActive(tools.ZoomTool.toolName, { bindings: [{ mouseButton: MouseBindings.Secondary }] });
  for (const plane of planes) scrolling.addViewport(plane, engine.id);
  for (const scene of scenes) turning.addViewport(scene, engine.id);
}

// The daemon's geometry is DICOM's: LPS millimetres. cornerstone3D wants the axes' directions one after the other; the daemon's
// matrix has them in its columns.
function addVolume(volumeId, volume, scalarData) {
  const direction = [0, 1, 2].flatMap((axis) => [0, 1, 2].map((row) => volume.direction[3 * row + axis]));
  const { dims: dimensions, spacing, origin } = volume;
  const metadata = {
    BitsAllocated: 8 * scalarData.BYTES_PER_ELEMENT,
    BitsStored: 8 * scalarData.BYTES_PER_ELEMENT,
    SamplesPerPixel: 1,
    HighBit: 8 * scalarData.BYTES_PER_ELEMENT - 1,
    PhotometricInterpretation: 'MONOCHROME2',
    PixelRepresentation: 0,
    Modality: 'OT',
    ImageOrientationPatient: direction.slice(0, 6),
    PixelSpacing: [spacing[1], spacing[0]],
    FrameOfReferenceUID: 'patient',
    Columns: dimensions[0],
    Rows: dimensions[1],
    voiLut: [],
    VOILUTFunction: 'LINEAR',
  };
  const made = core.volumeLoader.createLocalVolume(volumeId, { metadata, dimensions, spacing, origin, direction, scalarData });
  made.modified(); // or its texture stays black
}

async function showImage(volume) {
  addVolume('image', volume, await samples(volume, { as: Float32Array }));
  await core.setVolumesForViewports(engine, [{ volumeId: 'image' }], planes);
  const [lower, upper] = volume.range;
  for (const plane of planes) engine.getViewport(plane).setProperties({ voiRange: { lower, upper } });
  engine.render();
}

async function addSegmentation(volume, image) {
  const differenceOf = (member) => Math.max(...volume[member].map((value, at) => Math.abs(value - image[member][at])));
  const isOffGrid = ['origin', 'direction', 'spacing'].some((member) => differenceOf(member) > 1e-3);
  if (String(volume.dims) !== String(image.dims) || isOffGrid) throw new Error('The segmentation is not on the grid of the image.');
  const [lowest, highest] = volume.range;
  if (!Number.isInteger(highest) || lowest < 0 || highest > 255) throw new Error('This page takes labels from 0 to 255.');
  addVolume(segmentationId, volume, await samples(volume, { as: Uint8Array }));
  // Without this list, cornerstone3D converts the segment 1 only.
  const { labels } = await labelsOf(volume);
  const segments = Object.fromEntries(labels.map(({ label }) => [label, { segmentIndex: label }]));
  const representation = { type: Labelmap, data: { volumeId: segmentationId } };
  tools.segmentation.addSegmentations([{ segmentationId, representation, config: { segments } }]);
}

// Includes workers and WebAssembly. Null if the browser has no such measurement.
async function pageMemory() {
  if (!self.crossOriginIsolated || !performance.measureUserAgentSpecificMemory) return null;
  return (await performance.measureUserAgentSpecificMemory()).bytes;
}

// The box around all segments in the patient's millimetres: of the voxels' faces, and only of volumes along the patient's axes.
function boxOfSegments() {
  const { voxelManager, dimensions, imageData } = core.cache.getVolume(segmentationId);
  const scalars = voxelManager.getCompleteScalarDataArray();
  const low = [...dimensions];
  const high = [-1, -1, -1];
  scalars.forEach((label, at) => {
    if (label === 0) return;
    const row = Math.floor(at / dimensions[0]);
    [at % dimensions[0], row % dimensions[1], Math.floor(row / dimensions[1])].forEach((index, axis) => {
      low[axis] = Math.min(low[axis], index - 0.5);
      high[axis] = Math.max(high[axis], index + 0.5);
    });
  });
  return boxOf([...imageData.indexToWorld(low), ...imageData.indexToWorld(high)]);
}

// The least x, y and z, and the greatest.
function boxOf(points) {
  const box = [Infinity, Infinity, Infinity, -Infinity, -Infinity, -Infinity];
  for (let at = 0; at < points.length; at += 1) {
    box[at % 3] = Math.min(box[at % 3], points[at]);
    box[3 + (at % 3)] = Math.max(box[3 + (at % 3)], points[at]);
  }
  return box;
}

async function measured(name, make) {
  output.textContent = `${name} ...`;
  const before = await pageMemory();
  const begin = performance.now();
  const made = await make();
  const seconds = (performance.now() - begin) / 1000;
  const grown = before === null ? null : (await pageMemory()) - before;
  const megabytes = (count) => `${(count / 1e6).toFixed(1)} MB`;
  const cells = [made.segments, made.triangles, `${seconds.toFixed(2)} s`, megabytes(made.bytes), grown === null ? 'unknown' : megabytes(grown)];
  const segmentsBox = boxOfSegments();
  const box = boxOf(made.points.flatMap((each) => boxOf(each)));
  const off = Math.max(...box.map((value, at) => Math.abs(value - segmentsBox[at])));
  cells.push(`${off.toFixed(2)} mm`);
  const row = rows.insertRow();
  row.append(Object.assign(document.createElement('th'), { textContent: name }));
  for (const cell of cells) row.insertCell().textContent = String(cell);
  return made;
}

async function showIsomesh(volume, maxErrorMm) {
  const job = await meshOfLabels(volume, maxErrorMm);
  const geometry = await core.geometryLoader.loadAndCacheGeometry(`mesh:${addressOf(job)}`, {
    type: GeometryType.MESH,
    geometryData: { id: 'isomesh', format: MeshType.PLY },
  });
  const surface = geometry.data.defaultActor.getMapper().getInputData();
  // cornerstone3D takes the body of an error for a mesh.
  if (surface.getNumberOfPoints() === 0) throw new Error('The mesh did not arrive.');
  const scene = engine.getViewport('isomesh');
  geometry.data.actors.forEach((actor, at) => scene.addActor({ uid: `isomesh-${at}`, actor }));
  scene.resetCamera();
  scene.render();
  const { labels, triangles } = job.mesh;
  return { segments: labels.length, triangles, bytes: geometry.sizeInBytes, points: [surface.getPoints().getData()], surface };
}

async function showPolySeg() {
  await tools.segmentation.addSegmentationRepresentations('polyseg', [{ segmentationId, type: Surface }]);
  const surfaces = await surfacesOf(segmentationId);
  const scene = engine.getViewport('polyseg');
  scene.resetCamera();
  scene.render();
  const triangles = surfaces.reduce((sum, { polys }) => sum + polys.length / 4, 0);
  const bytes = surfaces.reduce((sum, { sizeInBytes }) => sum + sizeInBytes, 0);
  return { segments: surfaces.length, triangles, bytes, points: surfaces.map(({ points }) => points) };
}

// The conversion begins when the representation is first rendered, and ends some time after.
async function surfacesOf(id) {
  const { segmentation } = tools;
  const find = () => segmentation.state.getSegmentation(id).representationData[Surface]?.geometryIds;
  while (!find()) await new Promise((resolve) => setTimeout(resolve, 10));
  return [...find().values()].map((geometryId) => core.cache.getGeometry(geometryId).data);
}

form.addEventListener('submit', async (event) => {
  event.preventDefault();
  form.querySelector('button').disabled = true; // a second run needs a fresh page
  const { image, segmentation, error } = form.elements;
  try {
    output.textContent = 'Uploading ...';
    const head = await upload(image.files[0]);
    const labels = await upload(segmentation.files[0]);
    openViewports();
    await showImage(head);
    await addSegmentation(labels, head);
    const { surface } = await measured('isomesh', () => showIsomesh(labels, Number(error.value)));
    for (const plane of planes) outlinesOver(engine.getViewport(plane), surface);
    await measured('cornerstone3D', showPolySeg);
    output.textContent = 'Done.';
  } catch (problem) {
    output.textContent = problem.message;
    throw problem;
  }
});
