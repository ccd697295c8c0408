// The iso-value as a number to type.
import { field } from '../../ui/dom';
import { NumberField } from '../../ui/number_field';

export class IsoField {
  readonly element: HTMLElement;
  private readonly number = new NumberField({}, { id: 'iso', class: 'iso-input' });
  private iso = 0;

  // `onIso` gets what is typed. `mark` says if it is a number.
  constructor(
    private readonly onIso: (iso: number) => void,
    private readonly mark: (isGood: boolean) => void,
  ) {
    this.element = field('Iso-value', this.number.input);
    this.element.append(this.number.fault);
    this.number.input.addEventListener('input', () => this.take());
    // An empty field shows the value that is used. A text that is no number stays until it is corrected: the
    // value that is used is what stood there while it was typed, 1.234 of 1.234,5.
    this.number.input.addEventListener('blur', () => {
      if (this.number.value === null) this.replace(this.iso);
      else this.show(this.iso);
    });
  }

  get isMarked(): boolean {
    return this.number.isMarked;
  }

  // Shows the value that is used, except over what is being typed or has to be corrected.
  show(iso: number): void {
    this.iso = iso;
    if (document.activeElement !== this.number.input && !this.isMarked) this.number.write(iso);
  }

  // Shows it instead of what was typed.
  replace(iso: number): void {
    this.iso = iso;
    this.number.write(iso);
    this.mark(true);
  }

  private take(): void {
    const { value } = this.number;
    const isGood = value !== null && Number.isFinite(value);
    this.number.mark(isGood ? '' : this.number.textFault || 'Enter a number.');
    this.mark(isGood);
    if (isGood) this.onIso(value);
  }
}
