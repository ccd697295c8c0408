// The place in the page is its address, so that links, back and reload keep it: behind the hash stands
// a path and a query, such as #/volumes/ID?iso=60.

export interface Route {
  path: string[];
  query: URLSearchParams;
}

export function parseRoute(hash: string): Route {
  const text = hash.replace(/^#\/?/, '');
  const mark = text.indexOf('?');
  const path = mark < 0 ? text : text.slice(0, mark);
  return {
    path: path.split('/').filter(Boolean).map(decoded),
    query: new URLSearchParams(mark < 0 ? '' : text.slice(mark + 1)),
  };
}

// A path that was typed wrongly stays as it is.
function decoded(part: string): string {
  try {
    return decodeURIComponent(part);
  } catch {
    return part;
  }
}

export function hashOf(path: readonly string[], query?: URLSearchParams): string {
  const text = query?.toString() ?? '';
  return `#/${path.map(encodeURIComponent).join('/')}${text === '' ? '' : `?${text}`}`;
}

export function currentRoute(): Route {
  return parseRoute(window.location.hash);
}

export function isVolumeList({ path: [name, id] }: Route): boolean {
  return name === undefined || (name === 'volumes' && id === undefined);
}

export function go(path: readonly string[], query?: URLSearchParams): void {
  writePending();
  window.location.hash = hashOf(path, query);
}

// Browsers let a page change its address only so often (Safari a hundred times in half a minute).
const noteEvery = 400;
let pending: { path: string; values: Record<string, string> } | null = null;
let noteTimer = 0;

// Notes values in the address without leaving the view; empty values are taken out. The first of
// several is there at once, the last soon.
export function noteInAddress(values: Record<string, string>): void {
  const path = currentRoute().path.join('/');
  pending = { path, values: { ...(pending?.path === path ? pending.values : {}), ...values } };
  if (noteTimer === 0) writeAgain();
}

function writeAgain(): void {
  if (pending) {
    writePending();
    noteTimer = window.setTimeout(writeAgain, noteEvery);
  } else {
    noteTimer = 0;
  }
}

function writePending(): void {
  const noted = pending;
  pending = null;
  const { path, query } = currentRoute();
  // The person went somewhere else meanwhile.
  if (noted?.path !== path.join('/')) return;
  for (const [name, value] of Object.entries(noted.values)) {
    if (value === '') query.delete(name);
    else query.set(name, value);
  }
  const hash = hashOf(path, query);
  if (hash !== window.location.hash) history.replaceState(history.state, '', hash);
}
