// The first view: upload, the volumes that are there, the last surfaces.
import { eraseVolume, listJobs, listVolumes, slicePicture } from '../api/client';
import type { Job, Volume } from '../api/types';
import { inWords, surfaceInWords } from '../job/parameters';
import { button, h } from '../ui/dom';
import { formatBytes, formatCount, formatSpacing, formatTime } from '../ui/format';
import { ask, tell, tellError } from '../ui/notices';
import { go, hashOf } from '../ui/route';
import type { Scope } from '../ui/signal';
import { axisIndex, slicePlane } from '../volume/geometry';
import { nameIn, volumeKind, volumeName } from '../volume/names';
import { UploadPanel } from './upload_panel';

const shownJobs = 8;
const thumbnailPixels = 112;

// The middle axial slice, turned as radiologists look.
async function paintThumbnail(canvas: HTMLCanvasElement, volume: Volume, signal: AbortSignal): Promise<void> {
  const { normal, right, down } = slicePlane(volume, 'axial');
  const index = Math.floor(volume.dims[axisIndex(normal)] / 2);
  const bitmap = await createImageBitmap(
    await slicePicture(volume.id, normal, index, volume.range, signal),
  );
  const size = (axis: 'x' | 'y' | 'z'): number =>
    volume.dims[axisIndex(axis)] * volume.spacing[axisIndex(axis)];
  const scale = thumbnailPixels / Math.max(size(right.axis), size(down.axis));
  const context = canvas.getContext('2d');
  if (!context) return;
  const width = size(right.axis) * scale;
  const height = size(down.axis) * scale;
  context.translate((thumbnailPixels - width) / 2, (thumbnailPixels - height) / 2);
  if (right.flipped) context.transform(-1, 0, 0, 1, width, 0);
  if (down.flipped) context.transform(1, 0, 0, -1, 0, height);
  if (axisIndex(right.axis) > axisIndex(down.axis)) {
    context.transform(0, 1, 1, 0, 0, 0);
    context.drawImage(bitmap, 0, 0, height, width);
  } else {
    context.drawImage(bitmap, 0, 0, width, height);
  }
  bitmap.close();
  canvas.dataset.painted = '';
}

function thumbnail(volume: Volume, scope: Scope): HTMLElement {
  const canvas = h('canvas', {
    width: thumbnailPixels,
    height: thumbnailPixels,
    class: 'thumbnail',
    'aria-hidden': 'true',
  });
  // Only what comes into sight is fetched.
  const seen = new IntersectionObserver((entries) => {
    if (!entries.some((entry) => entry.isIntersecting)) return;
    seen.disconnect();
    // A card without its picture still says everything.
    paintThumbnail(canvas, volume, scope.signal).catch(() => canvas.classList.add('blank'));
  });
  seen.observe(canvas);
  scope.onEnd(() => seen.disconnect());
  return canvas;
}

function volumeCard(volume: Volume, scope: Scope, onErased: () => void): HTMLElement {
  const erase = async (): Promise<void> => {
    const sure = await ask(
      'Erase this volume?',
      `${volumeName(volume)} and its samples are removed from the server. Its surfaces stay.`,
      'Erase',
    );
    if (!sure) return;
    try {
      await eraseVolume(volume.id);
      tell('The volume was erased.');
      onErased();
    } catch (error) {
      tellError(error);
    }
  };
  const name = volumeName(volume);
  const kind = volumeKind(volume);
  return h(
    'li',
    { class: 'card', 'data-volume': volume.id },
    h(
      'a',
      { href: hashOf(['volumes', volume.id]), class: 'card-link' },
      thumbnail(volume, scope),
      h(
        'span',
        { class: 'card-text' },
        h('strong', { title: name }, name),
        h('span', {}, name === kind ? volume.type : kind),
        h('span', {}, formatSpacing(volume.spacing)),
        h('span', { class: 'faint' }, `${formatTime(volume.created)}, ${formatBytes(volume.bytes)}`),
      ),
    ),
    button('Erase', () => void erase(), { class: 'quiet', 'aria-label': `Erase ${volumeName(volume)}` }),
  );
}

export function jobLine(job: Job): string {
  return `${surfaceInWords(job.parameters)}, ${inWords(job.parameters)}`;
}

function surfaceRow(job: Job, volume: string): HTMLElement {
  const result = job.mesh
    ? `${formatCount(job.mesh.triangles)} triangles`
    : job.state === 'running'
      ? `${Math.round(100 * job.progress)} %`
      : job.state;
  return h(
    'li',
    {},
    h(
      'a',
      { href: hashOf(['jobs', job.id]) },
      h('span', { class: `state ${job.state}`, title: job.state }),
      h('span', { class: 'grow' }, h('b', {}, volume), ` ${jobLine(job)}`),
      h('span', { class: 'number' }, result),
      h('span', { class: 'faint' }, formatTime(job.created)),
    ),
  );
}

export async function volumesView(scope: Scope): Promise<HTMLElement> {
  const list = h('ul', { class: 'cards' });
  const count = h('span', { class: 'count' });
  const surfaces = h('ul', { class: 'rows' });
  const show = async (): Promise<void> => {
    const [volumes, page] = await Promise.all([listVolumes(), listJobs()]);
    count.textContent = volumes.length > 0 ? formatCount(volumes.length) : '';
    list.replaceChildren(
      ...[...volumes].reverse().map((volume) =>
        volumeCard(volume, scope, () => void show().catch(tellError)),
      ),
    );
    if (volumes.length === 0) {
      list.append(h('li', { class: 'empty' }, 'No volumes yet. Drop one above to begin.'));
    }
    const jobs = page.jobs.slice(0, shownJobs);
    const byId = new Map(volumes.map((volume) => [volume.id, volume]));
    surfaces.replaceChildren(...jobs.map((job) => surfaceRow(job, nameIn(byId, job.volume))));
    if (jobs.length === 0) surfaces.append(h('li', { class: 'empty' }, 'No surfaces yet.'));
  };
  const panel = new UploadPanel(scope, (only) => {
    if (only?.volume) {
      // Its page shows the notes of the file that came first.
      const notes = only.volume.notes.map(({ detail }) => detail);
      if (only.status === 200) tell(['This volume was there already.', ...notes].join(' '));
      go(['volumes', only.volume.id]);
    } else {
      void show().catch(tellError);
    }
  });
  await show();
  return h(
    'div',
    { class: 'home' },
    panel.element,
    h('section', { 'aria-labelledby': 'volumes-title' }, h('h2', { id: 'volumes-title' }, 'Volumes ', count), list),
    h(
      'section',
      { 'aria-labelledby': 'surfaces-title' },
      h(
        'div',
        { class: 'section-head' },
        h('h2', { id: 'surfaces-title' }, 'Last surfaces'),
        h('a', { href: hashOf(['jobs']) }, 'All jobs'),
      ),
      surfaces,
    ),
  );
}
