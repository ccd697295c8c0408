// Where volumes are dropped: one file, a folder of slices, or several files.
import { ApiError, asApiError, choicesOf, mayPass } from '../api/problem';
import type { Choice, UploadedVolume } from '../api/types';
import { upload, type RawDescription } from '../api/upload';
import { button, field, h, icon } from '../ui/dom';
import { formatBytes } from '../ui/format';
import { refusal } from '../ui/notices';
import type { Scope } from '../ui/signal';
import { filesOfDrop, filesOfList, gather, type Gathered } from '../volume/gather';
import type { NamedFile } from '../volume/tar';
import { rawForm } from './raw_form';

const arrow = 'M8 11V2.5M4.5 6 8 2.5 11.5 6M2.5 10.5v3h11v-3';

// What a person added to an upload that was refused.
interface Addition {
  raw?: RawDescription;
  choices?: Readonly<Record<string, string>>;
}

type OnVolumes = (uploaded: UploadedVolume[]) => void;

// How far an upload is.
class Progress {
  readonly bar: HTMLProgressElement;
  readonly text = h('p', { class: 'upload-status', role: 'status' });
  private readonly began = performance.now();

  constructor(private readonly total: number) {
    this.bar = h('progress', { max: total, value: 0, 'aria-label': 'Upload' });
  }

  show(sent: number): void {
    this.bar.value = sent;
    if (sent >= this.total) {
      this.bar.removeAttribute('value');
      this.text.textContent = `${formatBytes(this.total)} sent; the server reads the volume`;
      return;
    }
    const rate = sent / Math.max(0.001, (performance.now() - this.began) / 1000);
    this.text.textContent = `${formatBytes(sent)} of ${formatBytes(this.total)}, ${formatBytes(rate)}/s`;
  }
}

export class UploadPanel {
  readonly element: HTMLElement;
  private readonly body = h('div', { class: 'drop-body' });
  private readonly fileInput = h('input', { type: 'file', multiple: true, hidden: true, 'data-pick': 'files' });
  private readonly folderInput = h('input', { type: 'file', webkitdirectory: true, hidden: true, 'data-pick': 'folder' });
  private running: AbortController | null = null;

  constructor(
    private readonly scope: Scope,
    private readonly onVolumes: OnVolumes,
  ) {
    this.element = h(
      'section',
      { class: 'drop', 'aria-label': 'Upload a volume' },
      this.body,
      this.fileInput,
      this.folderInput,
    );
    this.takeChosenFiles();
    this.takeDrops();
    scope.onEnd(() => this.running?.abort());
    this.showIdle();
  }

  private takeChosenFiles(): void {
    for (const input of [this.fileInput, this.folderInput]) {
      input.addEventListener('change', () => {
        if (input.files && input.files.length > 0) this.take(filesOfList(input.files));
        input.value = '';
      });
    }
  }

  // The whole page takes a drop: a file that misses the zone would replace the page.
  private takeDrops(): void {
    const { scope, element } = this;
    scope.listen(window, 'dragover', (event: DragEvent) => {
      event.preventDefault();
      element.classList.add('over');
    });
    scope.listen(window, 'dragleave', (event: DragEvent) => {
      if (event.relatedTarget === null) element.classList.remove('over');
    });
    scope.listen(window, 'drop', (event: DragEvent) => {
      event.preventDefault();
      element.classList.remove('over');
      if (!event.dataTransfer) return;
      filesOfDrop(event.dataTransfer).then(
        (files) => this.take(files),
        (error: unknown) => this.showUnusable(asApiError(error)),
      );
    });
  }

  private take(files: NamedFile[]): void {
    if (this.running) return;
    const gathered = gather(files);
    if (gathered) void this.send(gathered);
    else this.showUnusable(new ApiError(-1, 'Nothing to upload', 'There are no files with content in it.'));
  }

  private async send(gathered: Gathered, addition: Addition = {}): Promise<void> {
    const controller = new AbortController();
    this.running = controller;
    const progress = new Progress(gathered.body.size);
    this.showRunning(gathered, progress, controller);
    try {
      const uploaded = await upload(gathered.body, {
        ...addition,
        name: gathered.name,
        signal: controller.signal,
        onProgress: (sent) => progress.show(sent),
      });
      if (this.scope.isOver) return;
      this.showIdle();
      this.onVolumes(uploaded);
    } catch (error) {
      if (this.scope.isOver) return;
      if (error instanceof DOMException && error.name === 'AbortError') this.showIdle();
      else this.showRefused(asApiError(error), gathered, addition);
    } finally {
      this.running = null;
    }
  }

  private showIdle(): void {
    this.element.classList.remove('busy');
    this.body.replaceChildren(
      icon(arrow),
      h('h2', {}, 'Drop a volume here'),
      h('p', {}, 'NIfTI, NRRD, MetaImage, VTK (.vti), a DICOM file or folder, a ZIP or TAR of them, raw samples'),
      h(
        'div',
        { class: 'actions' },
        button('Choose files', () => this.fileInput.click(), { class: 'primary' }),
        button('Choose a folder', () => this.folderInput.click()),
      ),
    );
  }

  private showRunning({ name, count }: Gathered, progress: Progress, controller: AbortController): void {
    this.element.classList.add('busy');
    this.body.replaceChildren(
      h('h2', {}, count > 1 ? `${name} (${count} files)` : name),
      progress.bar,
      progress.text,
      h('div', { class: 'actions' }, button('Cancel', () => controller.abort())),
    );
  }

  // What the server refused, with all that may help it: another try, a choice, a description.
  private showRefused(error: ApiError, gathered: Gathered, before: Addition): void {
    this.element.classList.remove('busy');
    const again = mayPass(error) && button('Try again', () => void this.send(gathered, before));
    const addTo = (more: Record<string, string>): void =>
      void this.send(gathered, { ...before, choices: { ...before.choices, ...more } });
    const parts: Node[] = [refusal(error, again, acceptButton(error, before, addTo), this.otherButton())];
    for (const [parameter, choices] of choicesOf(error)) parts.push(choiceForm(parameter, choices, addTo));
    if (error.status === 415 && gathered.count === 1) {
      parts.push(rawForm(gathered.body.size, (raw) => void this.send(gathered, { raw })));
    }
    this.body.replaceChildren(...parts);
  }

  private showUnusable(error: ApiError): void {
    this.body.replaceChildren(refusal(error, this.otherButton()));
  }

  private otherButton(): HTMLButtonElement {
    return button('Choose another', () => this.showIdle());
  }
}

// Has the upload taken in spite of what it was refused for, beside what was accepted before.
function acceptButton(
  { remedy: { overridable } }: ApiError,
  before: Addition,
  onAccept: (more: Record<string, string>) => void,
): HTMLButtonElement | false {
  if (overridable === undefined) return false;
  const accept = [before.choices?.['accept'], overridable].filter(Boolean).join(',');
  return button('Take it in spite of this', () => onAccept({ accept }));
}

function choiceForm(
  parameter: Choice['parameter'],
  choices: Choice[],
  onChoice: (more: Record<string, string>) => void,
): HTMLElement {
  const noun = { series: 'series', member: 'file', volume: 'volume' }[parameter];
  const select = h(
    'select',
    {},
    ...choices.map(({ value, title }) => h('option', { value }, title === '' ? value : `${title} (${value})`)),
  );
  return h(
    'div',
    { class: 'series' },
    field(`${noun.charAt(0).toUpperCase()}${noun.slice(1)} to read`, select),
    button(`Upload this ${noun}`, () => onChoice({ [parameter]: select.value }), { class: 'primary' }),
  );
}
