import './style/base.css';
import './style/controls.css';
import './style/shell.css';
import './style/common.css';
import './style/volumes.css';
import './style/prepare.css';
import './style/surface.css';
import './style/labels.css';
import './style/accuracy.css';
import './style/jobs.css';
import './style/compare.css';
import './style/small.css';
import './style/contrast.css';
import './ui/kept_token';
import { busy, client, connected, onReconnect } from './client';
import { ApiError, asApiError } from './api/problem';
import { surfaceInWords } from './job/parameters';
import { WatchedJobs } from './job/watched';
import { button, h, icon, isTyping } from './ui/dom';
import { showHelp } from './ui/help';
import { finishLogin } from './ui/login';
import { mountNotices, pendingRefusal, refusal, tell, tellError } from './ui/notices';
import { currentRoute, go, hashOf, isVolumeList, type Route } from './ui/route';
import { Scope } from './ui/signal';
import { startTheme, toggleTheme } from './ui/theme';
import { tokenButtons, watchToken } from './ui/token_dialog';
import { uploads } from './views/volumes/upload_panel';

const retryEvery = 2000;

interface Place {
  title: string;
  show: (scope: Scope, route: Route) => Promise<HTMLElement>;
}

// Views are loaded when they are needed.
function placeOf(route: Route): Place {
  const [name, id] = route.path;
  if (isVolumeList(route)) {
    return { title: 'Volumes', show: async (scope) => (await import('./views/volumes/volumes')).volumesView(scope) };
  }
  if (name === 'volumes') return { title: 'New surface', show: async (...of) => (await import('./views/prepare/prepare')).prepareView(...of) };
  if (name === 'jobs' && id === undefined) return { title: 'Jobs', show: async (...of) => (await import('./views/jobs/queue')).queueView(...of) };
  if (name === 'orders') return { title: 'Orders', show: async (...of) => (await import('./views/jobs/orders')).ordersView(...of) };
  if (name === 'jobs' && route.path[2] === 'report') return { title: 'Report', show: async (...of) => (await import('./views/jobs/report')).reportView(...of) };
  if (name === 'jobs') return { title: 'Surface', show: async (...of) => (await import('./views/jobs/job')).jobView(...of) };
  if (name === 'compare') return { title: 'Compare', show: async (...of) => (await import('./views/compare/compare')).compareView(...of) };
  if (name === 'together') {
    return { title: 'Surfaces in one scene', show: async (...of) => (await import('./views/compare/together')).togetherView(...of) };
  }
  return {
    title: 'Not found',
    show: () => Promise.reject(new ApiError(-1, 'Not found', 'No page has this address.')),
  };
}

const halfDisc = 'M8 2a6 6 0 1 0 0 12A6 6 0 0 0 8 2Zm0 0v12';
const main = h('main', { id: 'main', tabindex: '-1' });
const banner = h('div.banner', { role: 'alert', hidden: true });
const links = [
  h('a', { href: hashOf([]), 'data-place': 'volumes' }, 'Volumes'),
  h('a', { href: hashOf(['jobs']), 'data-place': 'jobs' }, 'Jobs'),
  h('a', { href: hashOf(['orders']), 'data-place': 'orders', hidden: true }, 'Orders'),
];

// Only if the daemon knows a PACS.
function showOrders(): void {
  const link = links.find(({ dataset }) => dataset.place === 'orders');
  client.hasOrders().then(
    (isOn) => {
      if (link) link.hidden = !isOn;
    },
    // The server is unreachable, which the banner says. The page asks again when it is back.
    () => {
      const waiting = new Scope();
      onReconnect(waiting, () => {
        waiting.end();
        showOrders();
      });
    },
  );
}

// Shows the state of an upload while other views are open.
function uploadNote(): HTMLElement {
  const note = h('a.upload-note', { href: hashOf([]), hidden: true });
  uploads.state.watch((state) => {
    note.textContent = state;
    note.hidden = state === '';
  });
  return note;
}

function shell(): HTMLElement[] {
  return [
    h('a.skip', { href: '#main', onClick: (event: Event) => {
      event.preventDefault();
      main.focus();
    } }, 'Skip to content'),
    h('header.top', [
      h('a.brand', { href: hashOf([]) }, 'isomesh'),
      h('nav', { 'aria-label': 'Main' }, ...links),
      h('span.grow'),
      uploadNote(),
      ...tokenButtons(),
      button('Shortcuts', showHelp, { class: 'quiet keys', title: 'Keyboard shortcuts (?)' }),
      button(icon(halfDisc), toggleTheme, { class: 'quiet', 'aria-label': 'Switch between light and dark' }),
    ]),
    banner,
    main,
  ];
}

let scope = new Scope();
let shownPath = '';

// The title of the browser's tab says what it shows.
function nameTab(view: HTMLElement, place: Place): void {
  const name = (): void => void (document.title = `${view.dataset.title ?? place.title} \u00b7 isomesh`);
  name();
  const renamed = new MutationObserver(name);
  renamed.observe(view, { attributes: true, attributeFilter: ['data-title'] });
  scope.onEnd(() => renamed.disconnect());
}

async function show(): Promise<void> {
  scope.end();
  const mine = new Scope();
  scope = mine;
  const route = currentRoute();
  const place = placeOf(route);
  document.title = `${place.title} \u00b7 isomesh`;
  for (const link of links) {
    const isHere = link.dataset.place === (route.path[0] ?? 'volumes');
    if (isHere) link.setAttribute('aria-current', 'page');
    else link.removeAttribute('aria-current');
  }
  const isMove = shownPath !== '' && shownPath !== route.path.join('/');
  shownPath = route.path.join('/') || '/';
  main.setAttribute('aria-busy', 'true');
  const slow = setTimeout(() => main.replaceChildren(h('p.loading', 'Loading')), 300);
  mine.onEnd(() => clearTimeout(slow));
  try {
    const view = await place.show(mine, route);
    if (mine.isOver) return;
    main.replaceChildren(view);
    nameTab(view, place);
    if (isMove) {
      main.scrollTop = 0;
      main.focus({ preventScroll: true });
    }
  } catch (error) {
    if (mine.isOver) return;
    const failure = asApiError(error);
    if (failure.status === -1 && !(error instanceof ApiError)) console.error(error);
    const again = button('Try again', () => void show());
    const home = h('a.button', { href: hashOf([]) }, 'All volumes');
    const way = failure.link ? h('a.button', { href: failure.link.href }, failure.link.text) : home;
    const shown = failure.isUnreachable ? pendingRefusal(failure, again, way) : refusal(failure, again, way);
    main.replaceChildren(h('h1.sr-only', 'This page cannot be shown'), h('div.page-problem', shown));
    // If the server could not be reached, the page tries again when the connection is back.
    if (failure.isUnreachable) onReconnect(mine, () => void show());
  } finally {
    clearTimeout(slow);
    if (!mine.isOver) main.removeAttribute('aria-busy');
  }
}

function showConnection(): void {
  banner.hidden = connected.value && !busy.value;
  banner.classList.toggle('waits', connected.value);
  banner.textContent = connected.value
    ? 'The server is busy. The page tries again automatically.'
    : 'The connection to the server is lost. The page reconnects automatically.';
}

function watchConnection(): void {
  let timer = 0;
  busy.subscribe(showConnection);
  connected.subscribe((isConnected) => {
    clearInterval(timer);
    showConnection();
    if (isConnected) return;
    timer = window.setInterval(() => {
      void client.connection.isAlive().then((alive) => {
        if (alive) connected.value = true;
      });
    }, retryEvery);
  });
}

// A hidden page leaves its stream of jobs to others.
function watchVisibility(): void {
  document.addEventListener('visibilitychange', () => {
    if (document.hidden) client.events.stop();
    else client.events.start();
  });
}

function watchKeys(): void {
  let isGoing = false;
  window.addEventListener('keydown', (event) => {
    if (event.ctrlKey || event.metaKey || event.altKey || isTyping(event)) return;
    if (isGoing && event.key === 'v') go([]);
    if (isGoing && event.key === 'j') go(['jobs']);
    if (isGoing && event.key === 'o' && links.some(({ dataset, hidden }) => dataset.place === 'orders' && !hidden)) go(['orders']);
    if (event.key === '?') showHelp();
    isGoing = event.key === 'g';
  });
}

// The browser would replace the page by a file that is dropped outside the upload panel.
function watchDrops(): void {
  const mark = (isOver: boolean): void => {
    uploads.element.classList.toggle('over', isOver);
    main.classList.toggle('drop-over', isOver);
  };
  const isOfFiles = ({ dataTransfer }: DragEvent): boolean => dataTransfer?.types.includes('Files') ?? false;
  window.addEventListener('dragover', (event) => {
    if (!isOfFiles(event)) return;
    event.preventDefault();
    mark(true);
  });
  window.addEventListener('dragleave', (event) => {
    if (event.relatedTarget === null) mark(false);
  });
  window.addEventListener('drop', (event) => {
    if (!isOfFiles(event) || !event.dataTransfer) return;
    event.preventDefault();
    mark(false);
    uploads.takeDrop(event.dataTransfer);
  });
  window.addEventListener('beforeunload', (event) => {
    if (uploads.isBusy) event.preventDefault();
  });
}

// Tells the user when one of their jobs ends while another view is open.
function watchJobs(): void {
  const watched = new WatchedJobs(({ id, state, parameters }) => {
    const [place, job] = currentRoute().path;
    if (place === 'jobs' && job === id) return;
    const what = { succeeded: 'is ready', failed: 'could not be made', cancelled: 'was cancelled' }[state as string] ?? state;
    tell(h('span', h('a', { href: hashOf(['jobs', id]) }, `The surface for ${surfaceInWords(parameters)}`), ` ${what}.`));
  });
  client.submitted.subscribe((id) => watched.add(id));
  watched.start();
}

function start(): void {
  watchConnection();
  watchKeys();
  watchDrops();
  watchVisibility();
  showOrders();
  watchJobs();
  watchToken(() => void show());
  window.addEventListener('hashchange', () => void show());
  void show();
}

startTheme();
document.body.append(...shell());
mountNotices(document.body);
void finishLogin().catch(tellError).then(start);
