// A control for one number. It is a text: Chromium drops a comma that is typed into an input of type
// number, which makes 7 of 0,7.
import { h, uniqueId } from './dom';
import { numberOf, stepped, textFault, type Steps } from './numbers';

export class NumberField {
  readonly input: HTMLInputElement;
  // The reason why the number is not valid, to be shown near the input.
  readonly fault = h('p.fault', { id: uniqueId('fault'), hidden: true });

  constructor(
    private steps: Steps,
    attributes: Record<string, string | number> = {},
  ) {
    // The decimal keys of some phones have no minus.
    const inputmode = (steps.min ?? -1) < 0 ? 'text' : 'decimal';
    this.input = h('input', { type: 'text', role: 'spinbutton', inputmode, autocomplete: 'off', spellcheck: 'false', ...attributes });
    this.limit(steps);
    this.input.addEventListener('input', () => this.tell());
    this.input.addEventListener('keydown', (event) => {
      if (event.key === 'ArrowUp') this.move(event, 1);
      else if (event.key === 'ArrowDown') this.move(event, -1);
    });
  }

  // Null for an empty input, NaN for what is no number.
  get value(): number | null {
    return numberOf(this.input.value);
  }

  // The reason why the text is no number; empty if it is one, or is empty.
  get textFault(): string {
    return textFault(this.input.value);
  }

  get isMarked(): boolean {
    return this.input.getAttribute('aria-invalid') === 'true';
  }

  // Shows a value, which is valid.
  write(value: number | null): void {
    this.input.value = value === null ? '' : String(value);
    this.tell();
    this.mark('');
  }

  // Other limits for the arrow keys.
  limit(steps: Steps): void {
    this.steps = { ...this.steps, ...steps };
    for (const bound of ['min', 'max'] as const) {
      const value = this.steps[bound];
      if (value === undefined) this.input.removeAttribute(`aria-value${bound}`);
      else this.input.setAttribute(`aria-value${bound}`, String(value));
    }
  }

  // Says why the value is not valid; with '' it is.
  mark(fault: string): void {
    this.input.setAttribute('aria-invalid', String(fault !== ''));
    // Some forms have one place for the faults of all their fields.
    if (fault !== '' && this.fault.parentNode) this.input.setAttribute('aria-errormessage', this.fault.id);
    else this.input.removeAttribute('aria-errormessage');
    this.fault.textContent = fault;
    this.fault.hidden = fault === '';
  }

  private tell(): void {
    const { value } = this;
    if (value === null || Number.isNaN(value)) this.input.removeAttribute('aria-valuenow');
    else this.input.setAttribute('aria-valuenow', String(value));
  }

  private move(event: KeyboardEvent, direction: 1 | -1): void {
    if (event.altKey || event.ctrlKey || event.metaKey) return;
    event.preventDefault();
    const { value } = this;
    if (Number.isNaN(value)) return;
    this.input.value = String(stepped(value, direction, this.steps));
    for (const name of ['input', 'change']) this.input.dispatchEvent(new Event(name, { bubbles: true }));
  }
}
