// The panel that takes dropped volumes: one file, a folder of slices, or several files.
import { volumeFormats } from '../../../generated/parameters';
import { client } from '../../client';
import { ApiError, asApiError, mayPass } from '../../api/problem';
import type { RawDescription, UploadedVolume, Volume } from '../../api/types';
import { bringIntoView, button, h, icon } from '../../ui/dom';
import { refusal, tell, tellError } from '../../ui/notices';
import { currentRoute, go, hashOf, isVolumeList } from '../../ui/route';
import { Signal } from '../../ui/signal';
import { filesOfDrop, filesOfList, gather, type Gathered } from '../../volume/gather';
import { KnownVolumes } from '../../volume/known';
import { noteTexts, skippedText, volumeName } from '../../volume/names';
import { faultOf } from '../../volume/sniff';
import type { NamedFile } from '../../volume/tar';
import { mayBeMasks, outcomeList, outcomeOf, rejected, type Outcome } from './outcomes';
import { rawForm } from './raw_form';
import { acceptButton, choiceLists, openQuestion, questionOf, seriesOf, unread, type Asked, type Choices } from './remedies';
import { UploadProgress } from './upload_progress';

const arrow = 'M8 11V2.5M4.5 6 8 2.5 11.5 6M2.5 10.5v3h11v-3';

// The options that a user added to a rejected upload.
interface Addition {
  raw?: RawDescription;
  choices?: Choices;
  // The last question, which `choices` answer.
  asked?: Asked | null;
  // The results of the upload's volumes; `choices` names the one to retry.
  outcomes?: readonly Outcome[];
  // Other choices with which the upload is read after this time.
  next?: readonly Choices[];
}

// Series of an upload that nobody has chosen, which stay offered until a person says no.
interface Rest {
  gathered: Gathered;
  asked: Asked;
}

const idle = '';
const leftKey = 'isomesh-upload';

// An upload with more to choose, for after a reload: no more than its name and ids, because others may use this browser later.
interface Left {
  name: string;
  kept: string;
  stored: [string, string][];
}

// The whole page has one. An upload goes on while other views are shown; `state` says in a word what it does.
export class UploadPanel {
  readonly element: HTMLElement;
  readonly state = new Signal<string>(idle);
  // Called after an upload whose volumes are not opened.
  onStored: (() => void) | null = null;
  private readonly body = h('div.drop-body');
  private readonly queue = h('p.upload-queue', { role: 'status', hidden: true });
  private readonly fileInput = h('input', { type: 'file', multiple: true, hidden: true, 'data-pick': 'files' });
  private readonly folderInput = h('input', { type: 'file', webkitdirectory: true, hidden: true, 'data-pick': 'folder' });
  private running: AbortController | null = null;
  // The last upload of one volume, for readAgain().
  private last: { id: string; gathered: Gathered; choices: Choices } | null = null;
  private waiting: Gathered[] = [];
  private rests: Rest[] = [];
  private left = sessionStorage.getItem(leftKey);
  private isRestoring = false;

  constructor() {
    this.element = h('section.drop', { 'aria-label': 'Upload a volume' }, [
      this.body,
      this.queue,
      this.fileInput,
      this.folderInput,
    ]);
    this.takeChosenFiles();
    this.showIdle();
  }

  // Offers what was to be chosen before the page was loaded again.
  async restore(): Promise<void> {
    const text = this.left;
    this.left = null;
    if (text === null) return;
    const { name, kept, stored } = JSON.parse(text) as Left;
    const volumes = new KnownVolumes();
    try {
      await volumes.find(stored.map(([, id]) => id));
    } catch (error) {
      // Nobody answered: the next visit of the list offers it.
      this.left = text;
      throw error;
    }
    const read = stored.map(([series, id]) => [series, volumes.get(id)] as const).filter((one): one is [string, Volume] => one[1] !== null);
    if (this.running) return;
    this.isRestoring = true;
    await this.send({ name, kept, stored: new Map(read), count: 1, files: [], body: new Blob() });
    this.isRestoring = false;
  }

  private keepLeft({ name, kept, stored }: Gathered): void {
    if (kept === undefined) return;
    const left: Left = { name, kept, stored: [...stored].map(([series, { id }]) => [series, id]) };
    sessionStorage.setItem(leftKey, JSON.stringify(left));
  }

  get isBusy(): boolean {
    return this.running !== null;
  }

  // Uploads them, with these choices; after the upload that is under way.
  take(files: NamedFile[], choices?: Choices): void {
    const gathered = gather(files);
    if (!gathered) {
      if (!this.running) this.showUnusable(new ApiError(-1, 'Nothing to upload', 'There are no files.'));
    } else {
      gathered.choices = choices;
      if (!this.running) return void this.begin(gathered);
      this.waiting.push(gathered);
      this.showQueue();
      // A file that a person brings now counts more.
      if (this.isRestoring) this.running.abort();
    }
  }

  // True if readAgain() works: the files of other uploads are gone.
  hasFileOf(id: string): boolean {
    return this.last?.id === id;
  }

  // Reads the file of this volume once more, with these choices in addition to the earlier ones.
  readAgain(id: string, choices: Choices): void {
    if (this.last?.id !== id) return;
    if (this.running) {
      tell('Wait until the present upload has ended.');
      return;
    }
    void this.send(this.last.gathered, { choices: { ...this.last.choices, ...choices } });
  }

  takeDrop(transfer: DataTransfer): void {
    filesOfDrop(transfer).then(
      (files) => this.take(files),
      (error: unknown) => this.showUnusable(asApiError(error)),
    );
  }

  private takeChosenFiles(): void {
    for (const input of [this.fileInput, this.folderInput]) {
      input.addEventListener('change', () => {
        if (input.files && input.files.length > 0) this.take(filesOfList(input.files));
        input.value = '';
      });
    }
  }

  private showQueue(): void {
    const count = this.waiting.length;
    this.queue.hidden = count === 0;
    this.queue.textContent = `Next: ${this.waiting.map(({ name }) => name).join(', ')}`;
  }

  // Asks before it sends a file that is certainly not a volume.
  private async begin(gathered: Gathered): Promise<void> {
    this.running = new AbortController();
    // If the browser cannot read a file, the upload fails with the reason.
    const fault = await faultOf(gathered.files).catch(() => null);
    if (!fault) {
      await this.send(gathered, { choices: gathered.choices });
      return;
    }
    this.running = null;
    // The server takes no empty file.
    const anyway = gathered.body.size > 0 && button('Upload it anyway', () => void this.send(gathered));
    this.showProblem(fault, gathered, [anyway]);
  }

  private async send(gathered: Gathered, addition: Addition = {}): Promise<void> {
    const controller = new AbortController();
    this.running = controller;
    const { kept } = gathered;
    const progress = new UploadProgress(kept === undefined ? gathered.body.size : 0);
    this.showRunning(gathered, progress, controller);
    this.state.value = 'Uploading';
    try {
      const uploaded = await client.upload(gathered.body, {
        ...addition,
        name: gathered.name,
        kept,
        signal: controller.signal,
        onProgress: (sent) => {
          progress.show(sent);
          if (kept === undefined) this.state.value = `Uploading ${Math.floor((100 * sent) / gathered.body.size)} %`;
        },
        onBusy: () => {
          progress.showBusy();
          this.state.value = 'Upload: the server is busy';
        },
      });
      gathered.kept = uploaded.kept ?? kept;
      this.running = null;
      this.state.value = idle;
      this.showUploaded(uploaded.volumes, gathered, addition);
    } catch (error) {
      this.running = null;
      const failure = asApiError(error);
      if (kept !== undefined && failure.status === 410 && gathered.body.size > 0) {
        // It was chosen too late.
        gathered.kept = undefined;
        await this.send(gathered, addition);
        return;
      }
      gathered.kept = failure.remedy.kept ?? kept;
      this.state.value = idle;
      this.showFailed(error, gathered, addition);
    } finally {
      progress.end();
    }
  }

  // Starts the next upload, unless this one needs the user's attention.
  private goOn(): void {
    const [next] = this.waiting.splice(0, 1);
    this.showQueue();
    if (next) void this.begin(next);
  }

  private showUploaded(uploaded: UploadedVolume[], gathered: Gathered, addition: Addition): void {
    const { outcomes, choices = {}, asked = null } = addition;
    const [first] = uploaded;
    const { series } = choices;
    if (series !== undefined && first?.volume) gathered.stored.set(series, first.volume);
    const [again, ...next] = addition.next ?? [];
    if (again) {
      void this.send(gathered, { ...addition, choices: again, next });
    } else if (outcomes && first) {
      this.showOutcomes(withOutcome(outcomes, choices, { ...first, member: choices['member'] ?? '' }), gathered);
    } else if (uploaded.length > 1 || !first?.volume) {
      this.showOutcomes(uploaded.map((each) => outcomeOf(each, choices)), gathered);
    } else {
      this.last = { id: first.volume.id, gathered, choices };
      this.keepRest(gathered, asked);
      this.showIdle();
      // Several are not opened.
      if (addition.next) this.onStored?.();
      else this.tellOf(first);
      if (this.rests.length === 0) this.goOn();
    }
  }

  private keepRest(gathered: Gathered, asked: Asked | null): void {
    this.rests = this.rests.filter((rest) => rest.gathered !== gathered);
    if (asked && unread(asked, gathered.stored).length > 0) this.rests.push({ gathered, asked });
  }

  // The series that were not chosen are offered after each one that is read, until there is none or a person says no.
  private showRest(rest: Rest): void {
    const { gathered, asked } = rest;
    this.keepLeft(gathered);
    const no = (): void => {
      this.keepRest(gathered, null);
      this.showIdle();
      this.goOn();
    };
    this.body.replaceChildren(
      h('div', { role: 'status' }, h('h2', moreSeries(rest)), h('p', gathered.name)),
      ...choiceLists(asked, {}, gathered.stored, (choices, ...next) => void this.send(gathered, { choices, asked, ...(next.length > 0 && { next }) })),
      h('div.actions', button('No more of these', no)),
    );
  }

  // Opens the volume if this panel is shown; elsewhere a note says that it was stored.
  private tellOf({ status, volume }: UploadedVolume): void {
    if (!volume) return;
    const path = ['volumes', volume.id];
    if (!isPanelShown() || this.waiting.length > 0) {
      this.onStored?.();
      tell(h('span', h('a', { href: hashOf(path) }, volumeName(volume)), ' was uploaded.'));
      return;
    }
    // Its page shows the notes of the file that came first.
    if (status === 200) {
      const skipped = skippedText([volume]);
      tell(['This volume is already stored.', ...noteTexts(volume), skipped && `${skipped}.`].filter(Boolean).join(' '));
    }
    go(path);
    const rest = this.rests.at(-1);
    if (rest) tell(h('span', `${moreSeries(rest)}. `, h('a', { href: hashOf([]) }, 'Choose one')));
  }

  private showFailed(error: unknown, gathered: Gathered, addition: Addition): void {
    const { outcomes, choices = {} } = addition;
    const isCancelled = error instanceof DOMException && error.name === 'AbortError';
    if (outcomes) {
      const shown = isCancelled
        ? outcomes
        : outcomes.map((each) => (each.member === choices['member'] ? rejected(each, choices, asApiError(error)) : each));
      this.showOutcomes(shown, gathered);
    } else if (isCancelled) {
      this.showIdle();
      this.goOn();
    } else {
      this.showRefused(asApiError(error), gathered, addition);
    }
  }

  private showIdle(): void {
    this.element.classList.remove('busy');
    this.state.value = idle;
    const rest = this.rests.at(-1);
    if (rest) {
      this.showRest(rest);
      return;
    }
    if (this.left === null) sessionStorage.removeItem(leftKey);
    this.body.replaceChildren(
      icon(arrow),
      h('h2', 'Drop a volume here'),
      h('p', `${volumeFormats.map(({ title }) => title).join(', ')}: a file, a folder, or a ZIP or TAR archive`),
      h('div.actions', [
        button('Choose files', () => this.fileInput.click(), { class: 'primary' }),
        button('Choose a folder', () => this.folderInput.click()),
      ]),
    );
  }

  private showRunning({ name, count }: Gathered, progress: UploadProgress, controller: AbortController): void {
    this.element.classList.add('busy');
    this.body.replaceChildren(
      h('h2', count > 1 ? `${name} (${count} files)` : name),
      progress.bar,
      progress.text,
      h('div.actions', button('Cancel', () => controller.abort())),
    );
  }

  // A rejected upload with the ways out: another attempt, a choice, a description.
  private showRefused(error: ApiError, gathered: Gathered, before: Addition): void {
    const again = mayPass(error) && button('Try again', () => void this.send(gathered, before));
    const known = before.choices ?? {};
    const asked = openQuestion(error, known, before.asked ?? null);
    const sendWith = (choices: Choices, ...next: Choices[]): void =>
      void this.send(gathered, { ...before, choices, asked, next: next.length > 0 ? next : undefined });
    const accept = acceptButton(error, known, sendWith);
    const question = questionOf(error, known);
    const lists = choiceLists(asked, known, gathered.stored, sendWith);
    if (question !== '' && !accept) {
      this.showQuestion(question, gathered, lists);
      return;
    }
    this.showProblem(error, gathered, [again, accept], before.raw);
    this.body.append(...lists);
  }

  // Nothing is wrong: the upload holds more than one.
  private showQuestion(question: string, gathered: Gathered, lists: readonly HTMLElement[]): void {
    const { name } = gathered;
    this.keepLeft(gathered);
    this.element.classList.remove('busy');
    this.state.value = 'Upload: your choice is needed';
    if (!isPanelShown()) tell(h('a', { href: hashOf([]) }, `${name}: ${question}`));
    const asked = h('div', { role: 'status' }, h('h2', question), h('p', name));
    this.body.replaceChildren(asked, ...lists, h('div.actions', this.otherButton()));
    this.reveal();
  }

  private showProblem(error: ApiError, gathered: Gathered, actions: readonly (HTMLElement | false)[], described?: RawDescription): void {
    this.element.classList.remove('busy');
    this.state.value = 'Upload: your choice is needed';
    if (!isPanelShown()) tellError(error);
    this.body.replaceChildren(refusal(error, ...actions, this.otherButton()));
    const mayBeRaw = error.status === 415 && gathered.count === 1 && gathered.body.size > 0;
    if (mayBeRaw || described) {
      this.body.append(rawForm(gathered.body.size, (raw) => void this.send(gathered, { raw }), described));
    }
    this.reveal();
  }

  // The results of several volumes stay until the next upload, since each rejected one can be retried.
  private showOutcomes(outcomes: readonly Outcome[], gathered: Gathered): void {
    this.element.classList.remove('busy');
    const stored = outcomes.filter(({ volume }) => volume !== null).length + gathered.stored.size;
    const count = outcomes.reduce((sum, { asked }) => sum + Math.max(1, seriesOf(asked).length), 0);
    this.body.replaceChildren(
      h('h2', { role: 'status' }, `${stored} of ${count} volumes in the upload were stored`),
      outcomeList(outcomes, gathered.stored, ({ asked }, choices, ...next) => void this.send(gathered, { choices, asked, outcomes, next })),
      ...(mayBeMasks(outcomes) ? [this.masksQuestion(gathered)] : []),
      h('div.actions', button('Upload another', () => {
        this.showIdle();
        this.goOn();
      })),
    );
    this.reveal();
    this.onStored?.();
    if (stored === count) this.goOn();
  }

  private masksQuestion(gathered: Gathered): HTMLElement {
    const together = (): void => void this.send(gathered, { choices: { masks: 'true' } });
    return h('div.stack', h('p', 'Are these masks of one structure each?'), h('div.actions', button('One surface each, together', together)));
  }

  private showUnusable(error: ApiError): void {
    if (!isPanelShown()) tellError(error);
    this.body.replaceChildren(refusal(error, this.otherButton()));
    this.reveal();
  }

  // Files may be dropped anywhere on the page, also where the panel is scrolled out of sight.
  private reveal(): void {
    const [first] = this.body.children;
    if (first && isPanelShown()) bringIntoView(first);
  }

  private otherButton(): HTMLButtonElement {
    return button('Choose another file', () => {
      this.showIdle();
      this.goOn();
    });
  }
}

// The address counts: the view that shows the panel may still be loading.
function isPanelShown(): boolean {
  return isVolumeList(currentRoute());
}

function moreSeries({ asked, gathered: { stored } }: Rest): string {
  const left = unread(asked, stored).length;
  return left === 1 ? '1 more series is in this upload' : `${left} more series are in this upload`;
}

function withOutcome(outcomes: readonly Outcome[], choices: Choices, uploaded: UploadedVolume): Outcome[] {
  const after = (before: Outcome): Outcome => {
    // The other series are still offered.
    if (before.asked && choices['series'] !== undefined) return { ...before, ...before.asked };
    return outcomeOf(uploaded, choices, before.asked);
  };
  return outcomes.map((each) => (each.member === uploaded.member ? after(each) : each));
}

export const uploads = new UploadPanel();
