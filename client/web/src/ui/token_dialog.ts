import { token, unauthorized } from '../api/client';
import { button, field, h } from './dom';

// Asks for a token whenever the daemon refuses for want of one.
export function watchToken(onToken: () => void): void {
  let dialog: HTMLDialogElement | null = null;
  const open = (): void => {
    if (dialog) return;
    const input = h('input', { type: 'password', autocomplete: 'off', required: true, name: 'token' });
    const form = h(
      'form',
      { method: 'dialog' },
      h('h2', {}, 'This server asks for a token'),
      h(
        'p',
        {},
        token.value === ''
          ? 'Your administrator has one for you. It is kept until this tab is closed.'
          : 'The token that was entered is not valid here (any more).',
      ),
      field('Token', input),
      h('div', { class: 'actions' }, h('button', { class: 'primary', type: 'submit' }, 'Continue')),
    );
    const made = h('dialog', { class: 'dialog', 'aria-label': 'Token' }, form);
    dialog = made;
    form.addEventListener('submit', (event) => {
      event.preventDefault();
      const value = input.value.trim();
      if (value === '') return;
      token.value = value;
      unauthorized.value = false;
      dialog = null;
      made.close();
      made.remove();
      onToken();
    });
    made.addEventListener('cancel', (event) => event.preventDefault());
    document.body.append(made);
    made.showModal();
    input.focus();
  };
  unauthorized.watch((isWanted) => {
    if (isWanted) open();
  });
}

// For the bar at the top: to forget the token.
export function tokenButton(): HTMLElement {
  const element = button('Forget token', () => {
    token.value = '';
    window.location.reload();
  });
  element.classList.add('quiet');
  token.watch((value) => {
    element.hidden = value === '';
  });
  return element;
}
