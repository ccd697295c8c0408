// One sheet about a surface, to print or to keep. #/jobs/ID/report
import { client } from '../../client';
import type { Job, JobReport } from '../../api/types';
import { inWords, jobRequest } from '../../job/parameters';
import { asText, type Value } from '../../job/table';
import { fileNameOf } from '../../job/variants';
import { button, definitions, h } from '../../ui/dom';
import { formatBytes, formatDims, formatSpacing, meshFormatTitle } from '../../ui/format';
import { tellError } from '../../ui/notices';
import { go, hashOf, type Route } from '../../ui/route';
import { saveBlob } from '../../ui/save';
import type { Scope } from '../../ui/signal';
import { cell, row, table } from '../../ui/table';
import { dateOf, volumeName } from '../../volume/names';
import { certificateBody } from './certificate';
import { numbers, section, titleOf } from './job_panel';
import { printCheck } from './print_check';

// The pictures of the surface that was looked at last.
let pictured: { job: string; urls: string[] } = { job: '', urls: [] };

export function openReport({ id }: Job, pictures: () => Promise<Blob[]>): void {
  pictures().then((blobs) => {
    for (const url of pictured.urls) URL.revokeObjectURL(url);
    pictured = { job: id, urls: blobs.map((blob) => URL.createObjectURL(blob)) };
    go(['jobs', id, 'report']);
  }, tellError);
}

// As the server tells it.
export function saveReport(report: JobReport): void {
  const { job, volume } = report;
  saveBlob(new Blob([JSON.stringify(report, null, 2)], { type: 'application/json' }), fileNameOf(job, volume, '.report.json'));
}

export async function reportView(scope: Scope, { path: [, id = ''] }: Route): Promise<HTMLElement> {
  const report = await client.reportOf(id, scope.signal);
  const { job, volume, version, mesher } = report;
  const { mesh, parameters } = job;
  const urls = pictured.job === id ? pictured.urls : [];
  const dicom = volume?.dicom;
  const ofVolume: [string, string][] = [
    ['Volume', volume ? volumeName(volume) : 'deleted'],
    ['Patient ID', dicom?.patient_id ?? ''],
    ['Study', [dicom?.study_description, dateOf(dicom?.study_date)].filter(Boolean).join(', ')],
    ['Samples', volume ? `${formatDims(volume.dims)}, ${volume.type}, ${formatSpacing(volume.spacing)}` : ''],
    ['SHA-256 of the samples', volume?.samples ?? ''],
    ['Notes', volume?.notes.map(({ detail }) => detail).join(' ') ?? ''],
    ['Job', job.id],
    ['Made', new Date(job.finished ?? job.created).toLocaleString('en-GB', { dateStyle: 'long', timeStyle: 'long' })],
    ['Service, mesher', `${version}, ${mesher}`],
  ];
  const files = Object.entries(mesh?.files ?? {}).map(([format, { bytes, sha256 }]) =>
    row({}, cell(meshFormatTitle(format)), cell(formatBytes(bytes)), cell(h('code', sha256))),
  );
  const certificate = certificateBody(job);
  // Its buttons belong to the surface.
  const check = printCheck(job, () => undefined);
  for (const one of check?.querySelectorAll('button') ?? []) one.remove();
  return h('article.report', { 'data-title': `Report, ${titleOf(job)}` }, [
    h('div.actions', [
      button('Print', () => window.print(), { class: 'primary' }),
      button('Save as JSON', () => saveReport(report)),
      h('a.button', { href: hashOf(['jobs', id]) }, 'The surface'),
      urls.length === 0 && h('span.hint', 'Choose Report beside the surface to have its pictures here.'),
    ]),
    h('h1', titleOf(job)),
    h('p', inWords(parameters)),
    urls.length > 0 &&
      h('div.report-pictures', ...urls.map((src, at) => h('img', { src, alt: ['The surface as it was seen', 'From the front', 'From the left', 'From above'][at] }))),
    definitions(ofVolume.filter(([, text]) => text !== '')),
    check && section('Before you print', check),
    mesh && section('Numbers', numbers(job, mesh)),
    certificate && section('Distance from the scan', certificate),
    section('Parameters', definitions(Object.entries(jobRequest(parameters)).map(([name, value]) => [name, asText(value as Value)]))),
    files.length > 0 && section('Files', table(['Format', 'Size', 'SHA-256'], [], files)),
  ]);
}
