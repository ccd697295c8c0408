// The label that was clicked: its size, and buttons to hide or isolate it.
import type { LabelSummary } from '../../api/types';
import { labelTitle, type LabelState } from '../../job/labels';
import { button, h } from '../../ui/dom';
import type { Scope } from '../../ui/signal';
import { areaText, volumeText } from './label_list';
import { swatchOf } from './label_search';

export class PickedLabel {
  // Announces what is picked.
  readonly element = h('div.picked-label', { role: 'status' });

  constructor(
    scope: Scope,
    private readonly state: LabelState,
  ) {
    this.show(state.picked.value);
    scope.onEnd(state.picked.subscribe((picked) => this.show(picked)));
    scope.onEnd(state.colours.subscribe(() => this.show(state.picked.value)));
  }

  hide(): void {
    const picked = this.state.picked.value;
    if (!picked) return;
    this.state.show(picked.label, false);
    this.state.pick(null);
  }

  isolate(): void {
    const picked = this.state.picked.value;
    if (picked) this.state.isolate(picked.label);
  }

  private show(picked: LabelSummary | null): void {
    this.element.hidden = picked === null;
    if (!picked) {
      this.element.replaceChildren();
      return;
    }
    this.element.replaceChildren(
      swatchOf(this.state.colours.value.get(picked.label) ?? ''),
      h('b', labelTitle(picked)),
      h('span', `volume ${volumeText(picked)}, area ${areaText(picked)}`),
      button('Hide', () => this.hide(), { class: 'quiet', title: 'Hide this label (h)' }),
      button('Only', () => this.isolate(), { class: 'quiet', title: 'Hide all other labels, or show them again (o)' }),
    );
  }
}
