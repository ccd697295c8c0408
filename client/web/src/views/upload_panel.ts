// Where volumes are dropped: one file, a folder of slices, or several files.
import { ApiError, asApiError, mayPass } from '../api/problem';
import type { UploadedVolume } from '../api/types';
import { upload, type RawDescription } from '../api/upload';
import { button, h, icon } from '../ui/dom';
import { formatBytes } from '../ui/format';
import { refusal } from '../ui/notices';
import type { Scope } from '../ui/signal';
import { filesOfDrop, filesOfList, gather, type Gathered } from '../volume/gather';
import type { NamedFile } from '../volume/tar';
import { outcomeList, outcomeOf, type Outcome } from './outcomes';
import { rawForm } from './raw_form';
import { acceptButton, choiceForms, type Choices } from './remedies';

const arrow = 'M8 11V2.5M4.5 6 8 2.5 11.5 6M2.5 10.5v3h11v-3';

// What a person added to an upload that was refused.
interface Addition {
  raw?: RawDescription;
  choices?: Choices;
  // What became of the upload's volumes, of which `choices` names one that is tried again.
  outcomes?: readonly Outcome[];
}

// Called with the only volume of an upload, or with none after an upload of several, which stay listed here.
type OnVolumes = (only: UploadedVolume | null) => void;

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
      if (!this.scope.isOver) this.showUploaded(uploaded, gathered, addition);
    } catch (error) {
      if (!this.scope.isOver) this.showFailed(error, gathered, addition);
    } finally {
      this.running = null;
    }
  }

  private showUploaded(uploaded: UploadedVolume[], gathered: Gathered, { outcomes, choices = {} }: Addition): void {
    const [first] = uploaded;
    if (outcomes && first) {
      this.showOutcomes(withOutcome(outcomes, choices, { ...first, member: choices['member'] ?? '' }), gathered);
    } else if (uploaded.length > 1 || !first?.volume) {
      this.showOutcomes(uploaded.map((each) => outcomeOf(each, choices)), gathered);
    } else {
      this.showIdle();
      this.onVolumes(first);
    }
  }

  private showFailed(error: unknown, gathered: Gathered, addition: Addition): void {
    const { outcomes, choices = {} } = addition;
    const isCancelled = error instanceof DOMException && error.name === 'AbortError';
    if (outcomes) {
      const shown = isCancelled
        ? outcomes
        : outcomes.map((each) => (each.member === choices['member'] ? { ...each, choices, error: asApiError(error) } : each));
      this.showOutcomes(shown, gathered);
    } else if (isCancelled) {
      this.showIdle();
    } else {
      this.showRefused(asApiError(error), gathered, addition);
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
    const known = before.choices ?? {};
    const sendWith = (choices: Choices): void => void this.send(gathered, { ...before, choices });
    const parts: Node[] = [
      refusal(error, again, acceptButton(error, known, sendWith), this.otherButton()),
      ...choiceForms(error, known, sendWith),
    ];
    if (error.status === 415 && gathered.count === 1) {
      parts.push(rawForm(gathered.body.size, (raw) => void this.send(gathered, { raw })));
    }
    this.body.replaceChildren(...parts);
  }

  // What became of several volumes stays until the next upload, since each refused one may be tried again.
  private showOutcomes(outcomes: readonly Outcome[], gathered: Gathered): void {
    this.element.classList.remove('busy');
    const stored = outcomes.filter(({ volume }) => volume !== null).length;
    this.body.replaceChildren(
      h('h2', { role: 'status' }, `${stored} of the ${outcomes.length} volumes in the upload were stored`),
      outcomeList(outcomes, (_, choices) => void this.send(gathered, { choices, outcomes })),
      h('div', { class: 'actions' }, button('Upload another', () => this.showIdle())),
    );
    this.onVolumes(null);
  }

  private showUnusable(error: ApiError): void {
    this.body.replaceChildren(refusal(error, this.otherButton()));
  }

  private otherButton(): HTMLButtonElement {
    return button('Choose another', () => this.showIdle());
  }
}

function withOutcome(outcomes: readonly Outcome[], choices: Choices, uploaded: UploadedVolume): Outcome[] {
  return outcomes.map((each) => (each.member === uploaded.member ? outcomeOf(uploaded, choices) : each));
}
