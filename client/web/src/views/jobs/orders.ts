// A hospital's orders: what waits and why, what failed, and how the PACS are. #/orders
import { client } from '../../client';
import { isFinal, type Order, type OrderList, type OrderState, type PacsList } from '../../api/types';
import { surfaceInWords } from '../../job/parameters';
import { button, field, h, select } from '../../ui/dom';
import { formatTime, shortId } from '../../ui/format';
import { tellError } from '../../ui/notices';
import { hashOf, noteInAddress, type Route } from '../../ui/route';
import type { Scope } from '../../ui/signal';
import { cell, keepFocus, row, table } from '../../ui/table';
import { OrderPlacing } from './order_placing';
import { orderStates, saidOf } from './order_texts';

const refreshEvery = 2000;
const columns = ['State', 'Details', 'Series', 'Rule', 'Created', 'Action'];
const dots: Partial<Record<OrderState, string>> = { waiting: 'queued', fetching: 'running', meshing: 'running', sending: 'running' };

export async function ordersView(scope: Scope, route: Route): Promise<HTMLElement> {
  const wanted = route.query.get('state') as OrderState | null;
  const orders = new Orders(scope, wanted && orderStates.includes(wanted) ? wanted : '');
  await orders.refresh();
  scope.repeat(refreshEvery, () => orders.refresh());
  return orders.element;
}

function pacsItem({ name, last_success: success, last_failure: failure, reason }: PacsList['pacs'][number]): HTMLElement {
  const isDown = failure !== null && (success === null || failure > success);
  const text = isDown
    ? `last request failed, ${formatTime(failure)}${reason === null ? '' : `: ${reason}`}`
    : success === null
      ? 'not contacted yet'
      : `answered ${formatTime(success)}`;
  return h('li', { 'data-pacs': name }, [
    h('span', { class: `state ${isDown ? 'failed' : success === null ? 'queued' : 'succeeded'}` }),
    h('b', name),
    h('span', { class: isDown ? 'attention' : 'faint' }, text),
  ]);
}

class Orders {
  readonly element: HTMLElement;
  private readonly pacs = h('ul.pacs', { 'aria-label': 'PACS' });
  private readonly body = h('div.queue-body', { tabindex: '0', role: 'region', 'aria-label': 'Orders' });
  private readonly more = button('Older orders', () => this.showMore(), { hidden: true });
  private readonly placing: OrderPlacing;
  private orders: Order[] = [];
  private pages = 1; // that are shown
  private next: string | null = null;

  constructor(
    private readonly scope: Scope,
    private state: OrderState | '',
  ) {
    const states = orderStates.map((name) => [name, name] as const);
    const choice = select<OrderState | ''>([['', 'all'], ...states], state, (chosen) => {
      this.state = chosen;
      this.pages = 1;
      noteInAddress({ state: chosen });
      this.refresh().catch(tellError);
    });
    this.placing = new OrderPlacing(scope, () => this.refresh());
    this.element = h('div.queue.orders', [
      h('div.section-head', h('h1', 'Orders'), h('span.grow'), field('State', choice)),
      this.pacs,
      this.placing.element,
      this.body,
      h('div.actions', this.more),
    ]);
  }

  async refresh(): Promise<void> {
    const { state, pages } = this;
    const [shown, { pacs }] = await Promise.all([this.load(state, pages), client.listPacs(this.scope.signal)]);
    // Another state or an older page was chosen meanwhile.
    if (state !== this.state || pages !== this.pages) return;
    this.orders = shown.orders;
    this.next = shown.next;
    this.pacs.replaceChildren(...pacs.map(pacsItem));
    this.placing.offer(pacs.map(({ name }) => name));
    this.show();
  }

  private async load(state: OrderState | '', pages: number): Promise<{ orders: Order[]; next: string | null }> {
    const orders: Order[] = [];
    let next: string | null = '';
    for (let page = 0; page < pages && next !== null; ++page) {
      const part: OrderList = await client.listOrders(state, next, this.scope.signal);
      orders.push(...part.orders);
      next = part.next;
    }
    return { orders, next };
  }

  private showMore(): void {
    this.pages += 1;
    this.refresh().catch(tellError);
  }

  private show(): void {
    this.more.hidden = this.next === null;
    const now = Date.now();
    const none = this.state === '' ? 'No orders yet.' : `No orders are ${this.state}.`;
    const shown =
      this.orders.length === 0
        ? h('p.empty', none)
        : table(columns, ['Action'], this.orders.map((each) => this.row(each, now)));
    keepFocus(this.body, 'order', () => this.body.replaceChildren(shown));
  }

  private row(order: Order, now: number): HTMLElement {
    const { id, state, source, rule, job, volume, created, parameters } = order;
    const { text, isBad, next } = saidOf(order, now);
    const made = [
      volume !== null && h('a', { href: hashOf(['volumes', volume]) }, 'volume'),
      job !== null && h('a', { href: hashOf(['jobs', job]) }, 'surface'),
    ];
    return row(
      { 'data-order': id },
      cell(h('span', { class: `state ${dots[state] ?? state}` }), state),
      cell(
        h('span', { class: isBad ? 'attention' : '' }, text),
        next === '' ? null : h('span.next-attempt', next),
        h('span.order-links', ...made),
      ),
      cell(source.pacs, h('span.of-volume', { title: source.series }, source.series)),
      cell(rule ?? surfaceInWords(parameters)),
      cell(h('span.faint', formatTime(created))),
      cell(this.action(order)),
    );
  }

  private action({ id, state }: Order): HTMLElement | null {
    const act = (run: (id: string) => Promise<Order>) => (): void => {
      run(id).then(() => void this.refresh().catch(tellError), tellError);
    };
    const named = (text: string): Record<string, string> => ({ class: 'quiet', 'aria-label': `${text} order ${shortId(id)}` });
    if (state === 'failed') return button('Retry', act((order) => client.retryOrder(order)), named('Retry'));
    return isFinal(state) ? null : button('Cancel', act((order) => client.cancelOrder(order)), named('Cancel'));
  }
}
