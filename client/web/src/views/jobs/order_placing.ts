// Finds a series in a PACS and orders its surface by a rule of the server.
import { client } from '../../client';
import { asApiError } from '../../api/problem';
import type { PacsSeries, PacsSeriesList } from '../../api/types';
import { button, field, h } from '../../ui/dom';
import { formatCount } from '../../ui/format';
import { refusal } from '../../ui/notices';
import { cell, row, table } from '../../ui/table';
import { dateOf } from '../../volume/names';
import { daysAsked, nameAsked } from './order_texts';

const columns = ['Patient', 'Study date', 'Description', 'Modality', 'Images', 'Action'];
const uid = { pattern: '[0-9.]{1,64}', title: 'A UID of digits and dots' };

function input(name: string, attributes: Record<string, string | boolean> = {}): HTMLInputElement {
  return h('input', { type: 'text', name, autocomplete: 'off', ...attributes });
}

export class OrderPlacing {
  readonly element: HTMLElement;
  private readonly pacs = h('select', { onChange: () => this.show() });
  private readonly patientId = input('patient_id');
  private readonly patientName = input('patient_name', { title: 'Its beginning is enough; * stands for any text' });
  private readonly from = h('input', { type: 'date', name: 'from' });
  private readonly to = h('input', { type: 'date', name: 'to' });
  private readonly modality = input('modality', { size: '6', title: 'Such as CT or MR' });
  private readonly searchedStudy = input('searched_study', uid);
  private readonly study = input('study', { ...uid, required: true });
  private readonly series = input('series', { ...uid, required: true });
  private readonly rule = input('rule');
  private readonly found = h('div.found-series', { 'aria-live': 'polite' });
  private readonly problem = h('div');
  private searches = 0;

  constructor(private readonly onPlaced: () => Promise<void>) {
    const search = h('form.job-filter', { onSubmit: (event: Event) => this.search(event), 'aria-label': 'Search the PACS' }, [
      field('PACS', this.pacs),
      field('Patient ID', this.patientId),
      field('Patient name', this.patientName),
      field('From', this.from),
      field('To', this.to),
      field('Modality', this.modality),
      field('Study UID', this.searchedStudy),
      h('button', { type: 'submit' }, 'Search'),
    ]);
    const order = h('form.job-filter', { onSubmit: (event: Event) => this.place(event), 'aria-label': 'Order' }, [
      field('Study Instance UID', this.study),
      field('Series Instance UID', this.series),
      field('Rule', this.rule),
      h('button.primary', { type: 'submit' }, 'Place the order'),
    ]);
    this.element = h('details.more', h('summary', 'New order'), search, this.found, order, this.problem);
  }

  // A choice stays while it is made.
  offer(pacs: readonly string[]): void {
    if (this.pacs.length === 0) this.pacs.append(...pacs.map((name) => h('option', name)));
  }

  private search(event: Event): void {
    event.preventDefault();
    const number = this.searches + 1;
    this.show(h('p.hint', 'Searching...'));
    const query = {
      patient_id: this.patientId.value.trim(),
      patient_name: nameAsked(this.patientName.value),
      date: daysAsked(this.from.value, this.to.value),
      modality: this.modality.value.trim().toUpperCase(),
      study: this.searchedStudy.value.trim(),
    };
    client.searchPacs(this.pacs.value, query).then(
      (list) => this.showIfLast(number, this.listOf(list)),
      (error: unknown) => this.showIfLast(number, [refusal(asApiError(error))]),
    );
  }

  private showIfLast(number: number, shown: HTMLElement[]): void {
    if (number === this.searches) this.show(...shown);
  }

  // What an earlier search still finds is of no use any more.
  private show(...shown: HTMLElement[]): void {
    this.searches += 1;
    this.found.replaceChildren(...shown);
  }

  private listOf({ series, complete }: PacsSeriesList): HTMLElement[] {
    if (series.length === 0 && complete) return [h('p.empty', 'The PACS has no such series.')];
    const more = complete ? [] : [h('p.attention', 'The PACS has more: search for less.')];
    return [...more, table(columns, ['Action'], series.map((each) => this.row(each)))];
  }

  private row(each: PacsSeries): HTMLElement {
    const name = each.patient_name.replaceAll('^', ' ').trim();
    const description = [each.study_description, each.series_description].filter(Boolean).join(', ');
    const images = each.instances === null ? '?' : formatCount(each.instances);
    const label = `Choose ${[name || each.patient_id, dateOf(each.study_date), description, each.modality].filter(Boolean).join(', ')}`;
    const choice: HTMLElement = row(
      { 'data-series': each.series },
      cell(h('b', name || each.patient_id), name === '' ? null : h('span.faint', ` ${each.patient_id}`)),
      cell(dateOf(each.study_date) || each.study_date),
      cell(description),
      cell(each.modality),
      cell(images),
      cell(button('Choose', () => this.choose(each, choice), { class: 'quiet', 'aria-label': label })),
    );
    return choice;
  }

  private choose({ study, series }: PacsSeries, chosen: HTMLElement): void {
    for (const each of this.found.querySelectorAll('tr[aria-current]')) each.removeAttribute('aria-current');
    chosen.setAttribute('aria-current', 'true');
    this.study.value = study;
    this.series.value = series;
    this.rule.focus();
  }

  private place(event: Event): void {
    event.preventDefault();
    this.problem.replaceChildren();
    client
      .placeOrder({ pacs: this.pacs.value, study: this.study.value, series: this.series.value }, this.rule.value || undefined)
      .then(() => {
        this.series.value = '';
        return this.onPlaced();
      })
      .catch((error: unknown) => this.problem.replaceChildren(refusal(asApiError(error))));
  }
}
