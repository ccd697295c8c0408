// The mesh files that the page can show.
import type { Job, MeshFile } from '../api/types';
import { isShownCodec, shownFiles } from '../job/parameters';
import { meshFormatTitle } from '../ui/format';

export interface ViewableFile {
  file: MeshFile;
  format: 'glb' | 'drc';
}

// The smallest file that has all that the page shows of the job; null if it can show none.
export function viewableFile({ mesh, parameters }: Job): ViewableFile | null {
  const { glb_codec: codec = 'draco', space = 'lps', labels, distances, lods = [] } = parameters;
  const files = mesh?.files;
  const glb: ViewableFile | null = files?.glb && isShownCodec(codec) ? { file: files.glb, format: 'glb' } : null;
  // Slices are in LPS.
  const drc: ViewableFile | null = files?.drc && space === 'lps' ? { file: files.drc, format: 'drc' } : null;
  // Draco has about a tenth of the bytes of a GLB without compression, but holds one level of one surface, without distances.
  const isAllInDraco = labels === undefined && !distances && lods.length < 2;
  return codec === 'none' && isAllInDraco ? (drc ?? glb) : (glb ?? drc);
}

// The reason why the page can show none of the job's files.
export function whyNotShown({ mesh, parameters }: Job): string {
  const { glb_codec: codec = 'draco', space = 'lps' } = parameters;
  const made = [mesh?.files.glb && `GLB with the codec ${codec}`, mesh?.files.drc && `Draco in ${space.toUpperCase()}`].filter(Boolean);
  const own = made.length > 0 ? made.join(' and ') : Object.keys(mesh?.files ?? {}).map(meshFormatTitle).join(', ');
  return `The page shows ${shownFiles}. This job has ${own} only.`;
}
