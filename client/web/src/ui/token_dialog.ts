import type { LoginProvider } from '../api/types';
import { token, unauthorized } from '../client';
import { asApiError } from '../api/problem';
import { button, field, h } from './dom';
import { beginLogin, findLogin } from './login';
import { tellError } from './notices';
import { Signal } from './signal';

// True if the dialog was closed without a token.
const isDeclined = new Signal<boolean>(false);

// The dialog's choices.
interface Ways {
  provider: LoginProvider | null;
  hasTokens: boolean;
  // Why there may be no login now.
  trouble: string;
}

async function findWays(): Promise<Ways> {
  try {
    const { provider, tokens } = await findLogin();
    return { provider, hasTokens: tokens || !provider, trouble: '' };
  } catch (error) {
    return { provider: null, hasTokens: true, trouble: asApiError(error).detail };
  }
}

function dialogTexts({ provider }: Ways): [title: string, text: string] {
  const isFirst = token.value === '';
  if (provider) {
    const text = isFirst ? 'You continue here after the login.' : 'Your login has expired, or this server does not accept it.';
    return ['This server requires a login', text];
  }
  const text = isFirst
    ? 'Ask your administrator for a token. The page keeps it until you close this tab.'
    : 'This server does not accept the token. It may have expired.';
  return ['This server requires a token', text];
}

function loginButton(provider: LoginProvider): HTMLButtonElement {
  const go = (): void => {
    beginLogin(provider).catch(tellError);
  };
  return button('Log in', go, { class: 'primary', autofocus: true });
}

// Asks for a login or a token whenever the daemon rejects a request that has none.
export function watchToken(onToken: () => void): void {
  let dialog: HTMLDialogElement | null = null;
  let isOpening = false;
  const open = (ways: Ways): void => {
    const { provider, hasTokens, trouble } = ways;
    const [title, text] = dialogTexts(ways);
    const input = h('input', { type: 'password', autocomplete: 'off', required: true, name: 'token' });
    const form = h('form', { method: 'dialog' }, [
      field('Token', input),
      h('div.actions', h(provider ? 'button' : 'button.primary', { type: 'submit' }, 'Continue')),
    ]);
    const made = h('dialog.dialog', { 'aria-label': provider ? 'Login' : 'Token' }, [
      h('h2', title),
      h('p', text),
      trouble !== '' && h('p', trouble),
      provider && h('div.actions', loginButton(provider)),
      hasTokens && form,
    ]);
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
    if (!provider) input.focus();
  };
  const findAndOpen = async (): Promise<void> => {
    if (dialog || isOpening) return;
    isOpening = true;
    const ways = await findWays();
    isOpening = false;
    open(ways);
  };
  unauthorized.watch((isWanted) => {
    if (!isWanted) return;
    if (isDeclined.value) unauthorized.value = false;
    else void findAndOpen();
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
