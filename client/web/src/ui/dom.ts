// Elements without a framework.

type Handler = (event: never) => void;
export type Attribute = string | number | boolean | null | undefined | Handler;
export type Child = Node | string | null | undefined | false;

type Attributes = Readonly<Record<string, Attribute>>;
type Children = Child | readonly Child[];
// Attributes come before the children, and may be left out.
type Content = [Attributes, ...Children[]] | Children[];

function setAttributes(element: Element, attributes: Attributes): void {
  for (const [name, value] of Object.entries(attributes)) {
    if (typeof value === 'function') {
      element.addEventListener(name.replace(/^on/, '').toLowerCase(), value as EventListener);
    } else if (value === true) {
      element.setAttribute(name, '');
    } else if (value !== false && value !== null && value !== undefined) {
      element.setAttribute(name, String(value));
    }
  }
}

function isAttributes(one: Attributes | Children): one is Attributes {
  return typeof one === 'object' && one !== null && Object.getPrototypeOf(one) === Object.prototype;
}

function fill(element: Element, classes: readonly string[], content: Content): void {
  if (classes.length > 0) element.setAttribute('class', classes.join(' '));
  for (const one of content) {
    if (isAttributes(one)) setAttributes(element, one);
    else element.append(...[one].flat().filter((child): child is Node | string => Boolean(child)));
  }
}

type Tag = keyof HTMLElementTagNameMap;
type TagOf<Name> = Name extends `${infer T}.${string}` ? T : Name;

// An element, of classes that follow its name (p.hint.grow), with attributes (functions named onEvent are listeners; true is
// an empty attribute, false and null none) and children (false and null are left out).
export function h<Name extends Tag | `${Tag}.${string}`>(name: Name, ...content: Content): HTMLElementTagNameMap[TagOf<Name> & Tag] {
  const [tag, ...classes] = name.split('.');
  const element = document.createElement(tag as TagOf<Name> & Tag);
  fill(element, classes, content);
  return element;
}

const svgNamespace = 'http://www.w3.org/2000/svg';

export function svg(name: string, ...content: Content): SVGElement {
  const [tag = '', ...classes] = name.split('.');
  const element = document.createElementNS(svgNamespace, tag);
  fill(element, classes, content);
  return element;
}

export function button(
  text: Child,
  onClick: () => void,
  attributes: Attributes = {},
): HTMLButtonElement {
  return h('button', { type: 'button', onClick, ...attributes }, text);
}

// An icon of lines on a grid of 16, for the eye only.
export function icon(path: string): SVGElement {
  return svg('svg.icon', { viewBox: '0 0 16 16', 'aria-hidden': 'true' }, [
    svg('path', { d: path }),
  ]);
}

let lastId = 0;

export function uniqueId(prefix: string): string {
  lastId += 1;
  return `${prefix}-${lastId}`;
}

// A label above its control.
export function field(label: string, control: HTMLElement, hint = ''): HTMLElement {
  if (control.id === '') control.id = uniqueId('field');
  const note = hint === '' ? null : h('p.hint', { id: `${control.id}-hint` }, hint);
  if (note) control.setAttribute('aria-describedby', note.id);
  return h('div.field', h('label', { for: control.id }, label), control, note);
}

// A list of values and their names, one of which is chosen.
export function select<T extends string>(
  choices: readonly (readonly [T, string])[],
  value: string | undefined,
  onChange: (value: T) => void = () => undefined,
  attributes: Attributes = {},
): HTMLSelectElement {
  const options = choices.map(([name, text]) => h('option', { value: name, selected: name === value }, text));
  const element = h('select', attributes, ...options);
  element.addEventListener('change', () => onChange(element.value as T));
  return element;
}

// Terms and what is said of each.
export function definitions(rows: readonly (readonly [string, Child])[]): HTMLElement {
  return h('dl', ...rows.flatMap(([name, value]) => [h('dt', name), h('dd', value)]));
}

export interface Choice<T extends string> {
  value: T;
  label: string;
  title?: string;
}

// A row of choices, of which exactly one is chosen.
export function segmented<T extends string>(
  label: string,
  choices: readonly Choice<T>[],
  value: T,
  onChange: (value: T) => void,
): HTMLElement {
  const name = uniqueId('choice');
  return h('fieldset.segmented', [
    h('legend', label),
    h('div.segments', [
      ...choices.map((choice) =>
        h('label', { title: choice.title }, [
          h('input', {
            type: 'radio',
            name,
            value: choice.value,
            checked: choice.value === value,
            onChange: () => onChange(choice.value),
          }),
          h('span', choice.label),
        ]),
      ),
    ]),
  ]);
}

// Selects a choice of a row without calling `onChange`.
export function choose(row: HTMLElement, value: string): void {
  for (const input of row.querySelectorAll('input')) input.checked = input.value === value;
}

export function checkbox(
  label: string,
  isOn: boolean,
  onChange: (isOn: boolean) => void,
  attributes: Attributes = {},
): HTMLLabelElement {
  const input = h('input', { type: 'checkbox', checked: isOn, ...attributes });
  input.addEventListener('change', () => onChange(input.checked));
  return h('label.check', input, h('span', label));
}

// Scrolls as little as possible so that the element is in view.
export function bringIntoView(element: Element): void {
  const isCalm = matchMedia('(prefers-reduced-motion: reduce)').matches;
  element.scrollIntoView({ block: 'nearest', behavior: isCalm ? 'instant' : 'smooth' });
}

// True while a dialog covers the page, so that all keys are the dialog's.
export function isBehindDialog(): boolean {
  return document.querySelector('dialog[open]') !== null;
}

// True while a control or a dialog takes what is typed, so that the keys are no shortcuts of the page.
export function isTyping(event: KeyboardEvent): boolean {
  const target = event.target as HTMLElement | null;
  // A click on a dialog's text leaves the focus to the page's body.
  return isBehindDialog() || target?.closest('input:not([type=checkbox]):not([type=radio]):not([type=range]):not([type=color]), textarea, select') != null;
}
