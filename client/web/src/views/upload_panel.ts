// Where volumes are dropped: one file, a folder of slices, or several files.
import { upload, type RawDescription } from '../api/upload';
import { ApiError, asApiError, mayPass, seriesOf } from '../api/problem';
import type { Volume } from '../api/types';
import { button, field, h, icon } from '../ui/dom';
import { formatBytes } from '../ui/format';
import { refusal } from '../ui/notices';
import type { Scope } from '../ui/signal';
import { filesOfDrop, filesOfList, gather, type Gathered } from '../volume/gather';
import type { NamedFile } from '../volume/tar';
import { rawForm } from './raw_form';

const arrow = 'M8 11V2.5M4.5 6 8 2.5 11.5 6M2.5 10.5v3h11v-3';

export interface UploadPanel {
  element: HTMLElement;
}

export function uploadPanel(scope: Scope, onVolume: (volume: Volume, isNew: boolean, name: string) => void): UploadPanel {
  const body = h('div', { class: 'drop-body' });
  const zone = h('section', { class: 'drop', 'aria-label': 'Upload a volume' }, body);
  let running: AbortController | null = null;

  const fileInput = h('input', { type: 'file', multiple: true, hidden: true, 'data-pick': 'files' });
  const folderInput = h('input', { type: 'file', webkitdirectory: true, hidden: true, 'data-pick': 'folder' });
  for (const input of [fileInput, folderInput]) {
    input.addEventListener('change', () => {
      if (input.files && input.files.length > 0) take(filesOfList(input.files));
      input.value = '';
    });
  }
  zone.append(fileInput, folderInput);

  const showIdle = (): void => {
    zone.classList.remove('busy');
    body.replaceChildren(
      icon(arrow),
      h('h2', {}, 'Drop a volume here'),
      h('p', {}, 'NIfTI, NRRD, MetaImage, VTK (.vti), a DICOM file or folder, a ZIP or TAR of them, raw samples'),
      h(
        'div',
        { class: 'actions' },
        button('Choose files', () => fileInput.click(), { class: 'primary' }),
        button('Choose a folder', () => folderInput.click()),
      ),
    );
  };

  const showProblem = (error: ApiError, gathered: Gathered): void => {
    zone.classList.remove('busy');
    // What the server understood and refused, it would refuse again.
    const again = mayPass(error) && button('Try again', () => void send(gathered));
    const other = button('Choose another', showIdle);
    const series = seriesOf(error);
    const parts: Node[] = [refusal(series.length > 0 ? withoutSeries(error) : error, again, other)];
    if (series.length > 0) parts.push(seriesForm(series, (uid) => void send(gathered, { series: uid })));
    if (error.status === 415 && gathered.count === 1) {
      parts.push(rawForm(gathered.body.size, (raw) => void send(gathered, { raw })));
    }
    body.replaceChildren(...parts);
  };

  const send = async (
    gathered: Gathered,
    how: { raw?: RawDescription; series?: string } = {},
  ): Promise<void> => {
    const controller = new AbortController();
    running = controller;
    const total = gathered.body.size;
    const bar = h('progress', { max: total, value: 0, 'aria-label': 'Upload' });
    const status = h('p', { class: 'upload-status', role: 'status' });
    zone.classList.add('busy');
    const files = gathered.count > 1 ? ` (${gathered.count} files)` : '';
    body.replaceChildren(
      h('h2', {}, `${gathered.name}${files}`),
      bar,
      status,
      h('div', { class: 'actions' }, button('Cancel', () => controller.abort())),
    );
    const began = performance.now();
    try {
      const { volume, isNew } = await upload(gathered.body, {
        ...how,
        signal: controller.signal,
        onProgress: (sent) => {
          bar.value = sent;
          if (sent >= total) {
            bar.removeAttribute('value');
            status.textContent = `${formatBytes(total)} sent; the server reads the volume`;
            return;
          }
          const rate = sent / Math.max(0.001, (performance.now() - began) / 1000);
          status.textContent = `${formatBytes(sent)} of ${formatBytes(total)}, ${formatBytes(rate)}/s`;
        },
      });
      if (scope.isOver) return;
      showIdle();
      onVolume(volume, isNew, gathered.name);
    } catch (error) {
      if (scope.isOver) return;
      if (error instanceof DOMException && error.name === 'AbortError') showIdle();
      else showProblem(asApiError(error), gathered);
    } finally {
      running = null;
    }
  };

  const take = (files: NamedFile[]): void => {
    if (running) return;
    const gathered = gather(files);
    if (gathered) {
      void send(gathered);
      return;
    }
    body.replaceChildren(
      refusal(
        new ApiError(-1, 'Nothing to upload', 'There are no files with content in it.'),
        button('Choose another', showIdle),
      ),
    );
  };

  // The whole page takes a drop: a file that misses the zone would replace the page.
  scope.listen(window, 'dragover', (event: DragEvent) => {
    event.preventDefault();
    zone.classList.add('over');
  });
  scope.listen(window, 'dragleave', (event: DragEvent) => {
    if (event.relatedTarget === null) zone.classList.remove('over');
  });
  scope.listen(window, 'drop', (event: DragEvent) => {
    event.preventDefault();
    zone.classList.remove('over');
    if (!event.dataTransfer) return;
    filesOfDrop(event.dataTransfer).then(take, (error: unknown) =>
      body.replaceChildren(
        refusal(asApiError(error), button('Choose another', showIdle)),
      ),
    );
  });
  scope.onEnd(() => running?.abort());

  showIdle();
  return { element: zone };
}

function withoutSeries(error: ApiError): ApiError {
  return new ApiError(
    error.status,
    error.title,
    error.detail,
    error.faults.filter((fault) => fault.field !== 'series'),
  );
}

function seriesForm(
  series: { uid: string; text: string }[],
  onChoice: (uid: string) => void,
): HTMLElement {
  const choice = h(
    'select',
    {},
    ...series.map(({ uid, text }) => h('option', { value: uid }, text)),
  );
  return h(
    'div',
    { class: 'series' },
    field('Series to read', choice),
    button('Upload this series', () => onChoice(choice.value), { class: 'primary' }),
  );
}
