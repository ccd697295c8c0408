import { Signal } from './signal';

export type Theme = 'light' | 'dark';

const key = 'isomesh.theme';
const preferred = window.matchMedia('(prefers-color-scheme: dark)');

function stored(): Theme | null {
  const value = localStorage.getItem(key);
  return value === 'light' || value === 'dark' ? value : null;
}

function systems(): Theme {
  return preferred.matches ? 'dark' : 'light';
}

// The user's choice, or the system's preference if there is none.
export const theme = new Signal<Theme>(stored() ?? systems());

export function startTheme(): void {
  theme.watch((value) => {
    document.documentElement.dataset.theme = value;
  });
  preferred.addEventListener('change', () => {
    if (stored() === null) theme.value = systems();
  });
}

export function toggleTheme(): void {
  theme.value = theme.value === 'dark' ? 'light' : 'dark';
  if (theme.value === systems()) localStorage.removeItem(key);
  else localStorage.setItem(key, theme.value);
}

export function cssColour(name: string): string {
  return getComputedStyle(document.documentElement).getPropertyValue(name).trim();
}
