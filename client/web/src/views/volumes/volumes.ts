// The first view: upload, the volumes that are there, the last surfaces.
import introPicture from '../../intro.webp';
import { client } from '../../client';
import type { Job, Volume } from '../../api/types';
import { inWords, surfaceInWords } from '../../job/parameters';
import { button, checkbox, h } from '../../ui/dom';
import { formatBytes, formatCount, formatSpacing, formatTime } from '../../ui/format';
import { ask, askText, tell, tellError } from '../../ui/notices';
import { hashOf } from '../../ui/route';
import type { Scope } from '../../ui/signal';
import { axisIndex, slicePlacement, slicePlane } from '../../volume/geometry';
import { KnownVolumes } from '../../volume/known';
import { volumeKind, volumeName } from '../../volume/names';
import { uploads } from './upload_panel';
import { VolumeSearch } from './volume_search';

const shownJobs = 8;
const thumbnailPixels = 112;
const refreshEvery = 2000;
// Patients that are asked for at once.
const mostAsked = 50;

// The middle axial slice, turned as radiologists look.
async function paintThumbnail(canvas: HTMLCanvasElement, volume: Volume, signal: AbortSignal): Promise<void> {
  // All samples are the same: there is no picture to ask for.
  if (volume.range[0] === volume.range[1]) return;
  const plane = slicePlane(volume, 'axial');
  const { normal } = plane;
  const index = Math.floor(volume.dims[axisIndex(normal)] / 2);
  const bitmap = await createImageBitmap(
    await client.slicePicture(volume.id, normal, index, volume.range, signal),
  );
  const context = canvas.getContext('2d');
  if (!context) return;
  const room = { width: thumbnailPixels, height: thumbnailPixels, edge: 0 };
  context.setTransform(...slicePlacement(volume, plane, room));
  context.drawImage(bitmap, 0, 0);
  bitmap.close();
  canvas.dataset.painted = '';
}

// Only what comes into sight is fetched.
function whenSeen(element: HTMLElement, scope: Scope, run: () => void): void {
  const seen = new IntersectionObserver((entries) => {
    if (!entries.some((entry) => entry.isIntersecting)) return;
    seen.disconnect();
    run();
  });
  seen.observe(element);
  scope.onEnd(() => seen.disconnect());
}

function thumbnail(volume: Volume, scope: Scope): HTMLElement {
  const canvas = h('canvas.thumbnail', {
    width: thumbnailPixels,
    height: thumbnailPixels,
    'aria-hidden': 'true',
  });
  // A card without its picture still says everything.
  whenSeen(canvas, scope, () => void paintThumbnail(canvas, volume, scope.signal).catch(() => canvas.classList.add('blank')));
  return canvas;
}

function volumeCard(volume: Volume, details: KnownVolumes, scope: Scope, onErased: () => void, onChanged: () => void): HTMLElement {
  const nameNow = (): string => volumeName(details.detailed(volume));
  const erase = async (): Promise<void> => {
    let isWithJobs = false;
    const sure = await ask(
      'Erase this volume?',
      `${nameNow()} and its samples will be removed from the server.`,
      'Erase',
      checkbox('Also erase the surfaces that were made from it', false, (isOn) => (isWithJobs = isOn)),
    );
    if (!sure) return;
    try {
      await client.eraseVolume(volume.id, isWithJobs ? { jobs: 'erase' } : {});
      tell(isWithJobs ? 'The volume and its surfaces were erased.' : 'The volume was erased.');
      onErased();
    } catch (error) {
      tellError(error);
    }
  };
  const rename = async (): Promise<void> => {
    const given = await askText('Name of this volume', volume.name ?? '', 'Rename');
    if (given === null) return;
    try {
      await client.renameVolume(volume.id, given === '' ? null : given);
      onChanged();
    } catch (error) {
      tellError(error);
    }
  };
  const kind = volumeKind(volume);
  const title = h('strong');
  const [renaming, erasing] = [button('Rename', () => void rename(), { class: 'quiet' }), button('Erase', () => void erase(), { class: 'quiet' })];
  const showName = (): void => {
    title.textContent = title.title = nameNow();
    renaming.ariaLabel = `Rename ${nameNow()}`;
    erasing.ariaLabel = `Erase ${nameNow()}`;
  };
  showName();
  // Lists leave the patient out. A card without its patient is still a card.
  if (volume.format === 'dicom') whenSeen(title, scope, () => void details.find([volume.id]).then(showName, () => undefined));
  return h('li.card', { 'data-volume': volume.id }, [
    h('a.card-link', { href: hashOf(['volumes', volume.id]) }, [
      thumbnail(volume, scope),
      h('span.card-text', [
        title,
        h('span', volumeName(volume) === kind ? volume.type : kind),
        h('span', formatSpacing(volume.spacing)),
        h('span.faint', `${formatTime(volume.created)}, ${formatBytes(volume.bytes)}`),
      ]),
    ]),
    h('div.card-actions', renaming, erasing),
  ]);
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
  return h('li', [
    h('a', { href: hashOf(['jobs', job.id]) }, [
      h('span', { class: `state ${job.state}`, title: job.state }),
      h('span.grow', h('b', volume), ` ${jobLine(job)}`),
      h('span.number', result),
      h('span.faint', formatTime(job.created)),
    ]),
  ]);
}

export async function volumesView(scope: Scope): Promise<HTMLElement> {
  const home = new Home(scope);
  await home.refresh();
  // Shows what other users do.
  scope.repeat(refreshEvery, () => home.refresh());
  return home.element;
}

class Home {
  readonly element: HTMLElement;
  private readonly known = new KnownVolumes();
  // Those of DICOM, which have a patient.
  private readonly details = new KnownVolumes();
  // The contents of each card, and its element.
  private readonly cards = new Map<string, { text: string; card: HTMLElement }>();
  private readonly list = h('ul.cards');
  private readonly count = h('span.count');
  private readonly surfaces = h('ul.rows');
  private readonly more = button('Older volumes', () => void this.showMore().catch(tellError), { hidden: true });
  private readonly finding = new VolumeSearch(() => void this.search().catch(tellError));
  private newest: readonly Volume[] = [];
  private older: Volume[] = [];
  // The cursor of the page after the older volumes.
  private next: string | null = null;
  private isSearching = false;

  // For a first-time user.
  private readonly intro = h('figure.intro', { hidden: true }, [
    h('figcaption', 'isomesh turns a CT, MRI or label volume into a 3D surface mesh.'),
    h('img', { src: introPicture, width: 560, height: 220, alt: 'Left: a slice of a head\u2019s CT with the outline of the bone. Right: the surface of the skull.' }),
  ]);
  private readonly noVolumes = h('li.empty', [
    h('p', 'No volumes yet. Drop a file above, or'),
    button('try a sample', () => void import('../../volume/sample').then(({ sampleHead }) => uploads.take([sampleHead()], { modality: 'ct' }), tellError), {
      class: 'link',
      title: 'Makes and uploads a simple head of 112 \u00d7 112 \u00d7 112 samples',
    }),
  ]);

  constructor(private readonly scope: Scope) {
    this.element = h('div.home', [
      h('h1.sr-only', 'Volumes and surfaces'),
      this.intro,
      uploads.element,
      h('section', { 'aria-labelledby': 'volumes-title' }, [
        h('div.section-head', h('h2', { id: 'volumes-title' }, 'Volumes ', this.count), this.finding.element),
        this.list,
        h('div.actions', this.more),
      ]),
      h('section', { 'aria-labelledby': 'surfaces-title' }, [
        h('div.section-head', [
          h('h2', { id: 'surfaces-title' }, 'Recent surfaces'),
          h('a', { href: hashOf(['jobs']) }, 'All jobs'),
        ]),
        this.surfaces,
      ]),
    ]);
    uploads.restore().catch(tellError);
    uploads.onStored = () => void this.refresh().catch(tellError);
    scope.onEnd(() => (uploads.onStored = null));
  }

  async refresh(): Promise<void> {
    const [page, { jobs }] = await Promise.all([client.listVolumes('', this.scope.signal), client.listJobs()]);
    const newest = new Set(page.volumes.map(({ id }) => id));
    this.older = this.older.filter(({ id }) => !newest.has(id));
    if (this.older.length === 0) this.next = page.next;
    this.known.learn(page.volumes);
    const shown = jobs.slice(0, shownJobs);
    await this.known.find(shown.map(({ volume }) => volume));
    const made = shown.flatMap(({ volume }) => this.known.get(volume) ?? []);
    await this.findPatients(made);
    this.known.learn(made.map((volume) => this.details.detailed(volume)));
    this.newest = page.volumes;
    this.intro.hidden = page.volumes.length > 0 || shown.length > 0;
    this.showVolumes([...page.volumes, ...this.older]);
    this.surfaces.replaceChildren(...shown.map((job) => surfaceRow(job, this.known.nameOf(job.volume))));
    if (shown.length === 0) this.surfaces.append(h('li.empty', 'No surfaces yet.'));
  }

  private async showMore(): Promise<void> {
    if (this.more.disabled) return;
    this.more.disabled = true;
    try {
      await this.loadMore();
    } finally {
      this.more.disabled = false;
    }
  }

  private async loadMore(): Promise<void> {
    if (this.next === null) return;
    const page = await client.listVolumes(this.next, this.scope.signal);
    const known = new Set(this.older.map(({ id }) => id));
    this.older = [...this.older, ...page.volumes.filter(({ id }) => !known.has(id))];
    this.next = page.next;
    await this.refresh();
  }

  // Among all volumes, also those that were not asked for yet.
  private async search(): Promise<void> {
    this.showVolumes([...this.newest, ...this.older]);
    // One that is under way goes on for what is typed now.
    if (this.isSearching) return;
    this.isSearching = true;
    try {
      while (this.finding.isOn && this.next !== null && !this.scope.isOver) await this.loadMore();
      const all = [...this.newest, ...this.older];
      for (let at = 0; at < all.length && this.finding.isOn && !this.scope.isOver; at += mostAsked) await this.findPatients(all.slice(at, at + mostAsked));
      this.showVolumes([...this.newest, ...this.older]);
    } finally {
      this.isSearching = false;
    }
  }

  private findPatients(volumes: readonly Volume[]): Promise<void> {
    return this.details.find(volumes.filter(({ format }) => format === 'dicom').map(({ id }) => id));
  }

  // Cards that stay as they are keep their elements, and with those their pictures and the focus.
  private showVolumes(volumes: readonly Volume[]): void {
    this.finding.element.hidden = volumes.length < 2;
    const byId = new Map(volumes.map((volume) => [volume.id, volume]));
    const shown = this.finding.found(volumes.map((volume) => this.details.detailed(volume)));
    const cards = shown.flatMap(({ id }) => byId.get(id) ?? []).map((volume) => {
      const text = JSON.stringify(volume);
      const known = this.cards.get(volume.id);
      if (known?.text === text) return known.card;
      const card = volumeCard(volume, this.details, this.scope, () => this.erased(volume.id), () => void this.renewed().catch(tellError));
      this.cards.set(volume.id, { text, card });
      return card;
    });
    this.more.hidden = this.next === null;
    const all = `${formatCount(volumes.length)}${this.next === null ? '' : '+'}`;
    this.count.textContent = volumes.length === 0 ? '' : this.finding.isOn ? `${formatCount(shown.length)} of ${all}` : all;
    if (volumes.length === 0) cards.push(this.noVolumes);
    else if (cards.length === 0) cards.push(h('li.empty', 'No volume matches the search.'));
    const isSame = cards.length === this.list.children.length && cards.every((card, at) => card === this.list.children[at]);
    if (isSame) return;
    const focused = document.activeElement;
    this.list.replaceChildren(...cards);
    if (focused instanceof HTMLElement && this.list.contains(focused)) focused.focus({ preventScroll: true });
  }

  // Older ones are asked for again, or they would stay as they were.
  private async renewed(): Promise<void> {
    this.older = [];
    await this.refresh();
    await this.search();
  }

  private erased(volume: string): void {
    this.older = this.older.filter(({ id }) => id !== volume);
    this.refresh().catch(tellError);
  }
}
