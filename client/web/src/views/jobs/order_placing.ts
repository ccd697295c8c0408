// Finds a series in a PACS and orders its surface by a rule of the server.
import { client } from '../../client';
import { asApiError } from '../../api/problem';
import type { PacsSeries, PacsSeriesList } from '../../api/types';
import { button, field, h } from '../../ui/dom';
import { formatCount } from '../../ui/format';
import { refusal } from '../../ui/notices';
import type { Scope } from '../../ui/signal';
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
  private readonly pacs = h('select', { onChange: () => this.forget() });
  private readonly patientId = input('patient_id');
  private readonly patientName = input('patient_name', { title: 'The beginning of the name is enough; * stands for any text' });
  private readonly from = h('input', { type: 'date', name: 'from' });
  private readonly to = h('input', { type: 'date', name: 'to' });
  private readonly modality = input('modality', { size: '6', title: 'Such as CT or MR' });
  private readonly searchedStudy = input('searched_study', uid);
  private readonly study = input('study', { ...uid, required: true });
  private readonly series = input('series', { ...uid, required: true });
  private readonly rule = input('rule');
  private readonly state = h('p.hint', { role: 'status' });
  private readonly found = h('div.found-series');
  private readonly problem = h('div');
  private searching = new AbortController();

  constructor(
    scope: Scope,
    private readonly onPlaced: () => Promise<void>,
  ) {
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
    scope.signal.addEventListener('abort', () => this.searching.abort());
    this.element = h('details.more', h('summary', 'New order'), search, this.state, this.found, order, this.problem);
  }

  // A choice stays while it is made.
  offer(pacs: readonly string[]): void {
    if (this.pacs.length === 0) this.pacs.append(...pacs.map((name) => h('option', name)));
  }

  private search(event: Event): void {
    event.preventDefault();
    this.show('Searching...');
    const { signal } = this.searching;
    const query = {
      patient_id: this.patientId.value.trim(),
      patient_name: nameAsked(this.patientName.value),
      date: daysAsked(this.from.value, this.to.value),
      modality: this.modality.value.trim().toUpperCase(),
      study: this.searchedStudy.value.trim(),
    };
    client.searchPacs(this.pacs.value, query, signal).then(
      (list) => this.list(list),
      (error: unknown) => signal.aborted || this.show('', refusal(asApiError(error))),
    );
  }

  // Ends the search in progress, whose results would be those of another question.
  private show(state: string, ...shown: HTMLElement[]): void {
    this.searching.abort();
    this.searching = new AbortController();
    this.state.textContent = state;
    this.found.replaceChildren(...shown);
  }

  private list({ series, complete }: PacsSeriesList): void {
    const count = series.length === 1 ? '1 series' : `${formatCount(series.length)} series`;
    const none = complete ? 'The PACS has no such series.' : 'No such series in the studies that were listed.';
    const more = complete ? '' : ' The PACS has more studies: narrow the search.';
    const rows = table(columns, ['Action'], series.map((each) => this.row(each)));
    rows.setAttribute('aria-label', 'Series found');
    this.show((series.length > 0 ? `${count}.` : none) + more, ...(series.length > 0 ? [rows] : []));
  }

  // UIDs of one PACS mean nothing to another.
  private forget(): void {
    this.show('');
    this.study.value = this.series.value = '';
  }

  private row(each: PacsSeries): HTMLElement {
    const name = each.patient_name.replaceAll('^', ' ').trim();
    const description = [each.study_description, each.series_description].filter(Boolean).join(', ');
    const images = each.instances === null ? '' : `${formatCount(each.instances)} ${each.instances === 1 ? 'image' : 'images'}`;
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
    this.unmark();
    chosen.setAttribute('aria-current', 'true');
    this.study.value = study;
    this.series.value = series;
    this.rule.focus();
  }

  private unmark(): void {
    for (const each of this.found.querySelectorAll('tr[aria-current]')) each.removeAttribute('aria-current');
  }

  private place(event: Event): void {
    event.preventDefault();
    this.problem.replaceChildren();
    client
      .placeOrder({ pacs: this.pacs.value, study: this.study.value, series: this.series.value }, this.rule.value || undefined)
      .then(() => {
        this.series.value = '';
        this.unmark();
        return this.onPlaced();
      })
      .catch((error: unknown) => this.problem.replaceChildren(refusal(asApiError(error))));
  }
}
