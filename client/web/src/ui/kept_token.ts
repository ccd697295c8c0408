// The token lives as long as the tab.
import { token } from '../client';

const key = 'isomesh.token';

token.value = sessionStorage.getItem(key) ?? '';
token.subscribe((value) => {
  if (value === '') sessionStorage.removeItem(key);
  else sessionStorage.setItem(key, value);
});
