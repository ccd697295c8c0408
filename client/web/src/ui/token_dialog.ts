import { token, unauthorized } from '../client';
import { button, field, h } from './dom';
import { Signal } from './signal';

// True if the dialog was closed without a token.
const isDeclined = new Signal<boolean>(false);

// Asks for a token whenever the daemon rejects a request that has none.
export function watchToken(onToken: () => void): void {
  let dialog: HTMLDialogElement | null = null;
  const open = (): void => {
    if (dialog) return;
    const input = h('input', { type: 'password', autocomplete: 'off', required: true, name: 'token' });
    const form = h('form', { method: 'dialog' }, [
      h('h2', 'This server requires a token'),
      h('p', [
        token.value === ''
          ? 'Ask your administrator for a token. The page keeps it until you close this tab.'
          : 'This server does not accept the token. It may have expired.',
      ]),
      field('Token', input),
      h('div.actions', h('button.primary', { type: 'submit' }, 'Continue')),
    ]);
    const made = h('dialog.dialog', { 'aria-label': 'Token' }, form);
    dialog = made;
    form.addEventListener('submit', (event) => {
      event.preventDefault();
      const value = input.value.trim();
      if (value === '') return;
      token.value = value;
      unauthorized.value = false;
      isDeclined.value = false;
      dialog = null;
      made.close();
      onToken();
    });
    // After the dialog was closed without a token, the page's own requests do not open it again. The next view and
    // the button in the bar do.
    made.addEventListener('close', () => {
      made.remove();
      if (dialog !== made) return;
      dialog = null;
      unauthorized.value = false;
      isDeclined.value = true;
    });
    document.body.append(made);
    made.showModal();
    input.focus();
  };
  unauthorized.watch((isWanted) => {
    if (!isWanted) return;
    if (isDeclined.value) unauthorized.value = false;
    else open();
  });
  window.addEventListener('hashchange', () => (isDeclined.value = false));
}

// For the bar at the top: to forget the token, or to enter one after all.
export function tokenButtons(): HTMLElement[] {
  const forget = button(
    'Forget token',
    () => {
      token.value = '';
      window.location.reload();
    },
    { class: 'quiet' },
  );
  const ask = (): void => {
    isDeclined.value = false;
    unauthorized.value = true;
  };
  const enter = button('Enter a token', ask, { class: 'primary' });
  token.watch((value) => {
    forget.hidden = value === '';
  });
  isDeclined.watch((isOn) => {
    enter.hidden = !isOn;
  });
  return [enter, forget];
}
