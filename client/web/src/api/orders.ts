// A hospital's orders: the daemon has these routes where it was started with one.
import { json } from './client';
import type { Order, OrderList, OrderState, PacsList } from './types';

function pathOf(id: string): string {
  return `/v1/orders/${encodeURIComponent(id)}`;
}

// Whether this daemon knows a PACS. It stays so for as long as it runs.
export async function hasOrders(): Promise<boolean> {
  return (await json<{ orders: boolean }>('/version')).orders;
}

export function listPacs(signal?: AbortSignal): Promise<PacsList> {
  return json('/v1/pacs', { signal });
}

// The newest first, in pages; in any state where none is named.
export function listOrders(state: OrderState | '', cursor = '', signal?: AbortSignal): Promise<OrderList> {
  const query = new URLSearchParams(Object.entries({ state, cursor }).filter(([, value]) => value !== ''));
  const text = query.toString();
  return json(`/v1/orders${text === '' ? '' : `?${text}`}`, { signal });
}

export function cancelOrder(id: string): Promise<Order> {
  return json(pathOf(id), { method: 'DELETE' });
}

// From its beginning, after it has failed.
export function retryOrder(id: string): Promise<Order> {
  return json(`${pathOf(id)}/retry`, { method: 'POST' });
}
