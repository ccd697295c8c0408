// Messages of the page: short notices, errors in place, questions.
import { adviceFor, asApiError, type ApiError } from '../api/problem';
import { button, h, type Child } from './dom';

const shownFor = 6000;

const stack = h('div.toasts', { role: 'status', 'aria-live': 'polite' });

export function mountNotices(parent: HTMLElement): void {
  parent.append(stack);
}

export function tell(content: Child): void {
  const toast = h('div.toast', content);
  stack.append(toast);
  setTimeout(() => toast.remove(), shownFor);
}

export function tellError(error: unknown): void {
  if (error instanceof DOMException && error.name === 'AbortError') return;
  const failure = asApiError(error);
  const toast = h('div.toast.bad', { role: 'alert' }, [
    h('strong', failure.title),
    h('span', failure.detail),
    button('Close', () => toast.remove(), { class: 'quiet' }),
  ]);
  stack.append(toast);
  setTimeout(() => toast.remove(), 3 * shownFor);
}

// An error with its cause and what to do next.
export function refusal(error: ApiError, ...actions: Child[]): HTMLElement {
  return refusalWith(error, adviceFor(error), actions);
}

// For requests that the page repeats by itself.
export function pendingRefusal(error: ApiError, ...actions: Child[]): HTMLElement {
  return refusalWith(error, error.isUnreachable ? 'The page tries again automatically.' : adviceFor(error), actions);
}

function refusalWith(error: ApiError, advice: string, actions: readonly Child[]): HTMLElement {
  const faults = error.faults.filter(({ message }) => !error.detail.includes(message));
  return h('div.refusal', { role: 'alert' }, [
    h('h2', error.title),
    h('p', error.detail),
    faults.length > 0 &&
      h('ul', ...faults.map(({ field, message }) => h('li', h('b', field), ` ${message}`))),
    advice !== '' && h('p.advice', advice),
    actions.length > 0 && h('div.actions', ...actions),
  ]);
}

// Shows a dialog; resolves with whether the person agrees.
function showDialog(title: string, content: Child, action: HTMLButtonElement, dialog: HTMLDialogElement): Promise<boolean> {
  return new Promise((resolve) => {
    dialog.append(
      h('h2', title),
      h('div', content),
      h('div.actions', [
        button('Cancel', () => dialog.close(), { autofocus: true }),
        action,
      ]),
    );
    dialog.addEventListener('close', () => {
      dialog.remove();
      resolve(dialog.returnValue === 'yes');
    });
    document.body.append(dialog);
    dialog.showModal();
  });
}

// Resolves with true when the person agrees. `more` are choices below the text.
export function ask(title: string, text: string, action: string, more: Child = null): Promise<boolean> {
  const dialog = h('dialog.dialog', { 'aria-label': title });
  const agree = button(action, () => dialog.close('yes'), { class: 'danger' });
  return showDialog(title, h('div.stack', h('p', text), more), agree, dialog);
}

// Resolves with the text that the person enters, which may be empty, or null.
export async function askText(title: string, text: string, action: string): Promise<string | null> {
  const dialog = h('dialog.dialog', { 'aria-label': title });
  const input = h('input', { type: 'text', value: text, maxlength: 255, 'aria-label': title });
  const agree = button(action, () => dialog.close('yes'), { class: 'primary' });
  input.addEventListener('keydown', (event) => {
    // Enter also ends what an input method composes.
    if (event.key !== 'Enter' || event.isComposing) return;
    // Or it would press the button that had the focus before the dialog.
    event.preventDefault();
    agree.click();
  });
  return (await showDialog(title, input, agree, dialog)) ? input.value.trim() : null;
}
