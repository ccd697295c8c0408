import { parseObj } from 'molstar/lib/mol-io/reader/obj/parser.js';
import { parsePly } from 'molstar/lib/mol-io/reader/ply/parser.js';
import { parseVtp } from 'molstar/lib/mol-io/reader/vtp/parser.js';
import { shapeFromPly } from 'molstar/lib/mol-model-formats/shape/ply.js';
import { bytesOf, hexesOfBytes, main, surface } from './report.mjs';

// As it shows them without being told anything.
async function coloursOf(file) {
  const provider = await shapeFromPly(file).run();
  const defaults = Object.entries(provider.params).map(([name, value]) => [name, value.defaultValue]);
  const shape = await provider.getShape({}, provider.data, Object.fromEntries(defaults));
  const groups = shape.geometry.groupBuffer.ref.value;
  const rgb = [...new Set(groups)].map((group) => shape.getColor(group, 0)).flatMap((v) => [v >> 16, (v >> 8) & 255, v & 255]);
  return hexesOfBytes(rgb, 3);
}

const surfacesOf = {
  obj: ({ positions, positionIndices, groupNames }) => [
    surface(positions, positionIndices.length / 3, { name: groupNames?.join(' ') }),
  ],
  vtp: ({ positions, numberOfTriangles, cellData }) => [
    surface(positions, numberOfTriangles, { labels: [...new Set(cellData.get('label')?.values.toArray())] }),
  ],
  ply: async (file) => {
    const vertex = file.getElement('vertex');
    const columns = ['x', 'y', 'z'].map((name) => vertex.getProperty(name).toArray());
    const points = Array.from({ length: 3 * vertex.rowCount }, (_, at) => columns[at % 3][Math.floor(at / 3)]);
    const faces = file.getElement('face');
    let triangles = 0;
    for (let row = 0; row < faces.rowCount; row += 1) if (faces.value(row).count === 3) triangles += 1;
    return [surface(points, triangles, { colours: await coloursOf(file) })];
  },
};

await main('molstar', async (path, suffix) => {
  const bytes = bytesOf(path);
  const content = suffix === 'obj' ? new TextDecoder().decode(bytes) : bytes;
  const parsed = await { ply: parsePly, obj: parseObj, vtp: parseVtp }[suffix](content).run();
  if (parsed.isError) throw new Error(parsed.message);
  return surfacesOf[suffix](parsed.result);
});
