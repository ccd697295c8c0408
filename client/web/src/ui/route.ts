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

export function go(path: readonly string[], query?: URLSearchParams): void {
  window.location.hash = hashOf(path, query);
}

// Notes values in the address without leaving the view; empty values are taken out.
export function noteInAddress(values: Record<string, string>): void {
  const { path, query } = currentRoute();
  for (const [name, value] of Object.entries(values)) {
    if (value === '') query.delete(name);
    else query.set(name, value);
  }
  const hash = hashOf(path, query);
  if (hash !== window.location.hash) history.replaceState(history.state, '', hash);
}
