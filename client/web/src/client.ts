// The page's one client: of the server that the page comes from.
import { Client } from './api/client';
import type { Job, JobRequest } from './api/types';
import { Signal, type Scope } from './ui/signal';

class PageClient extends Client {
  // The id of the last job that this page has submitted.
  readonly submitted = new Signal<string>('');

  override async submitJob(request: JobRequest): Promise<Job> {
    const job = await super.submitJob(request);
    this.submitted.value = job.id;
    return job;
  }
}

// The page comes from the server itself, so it needs no address.
export const client = new PageClient({ server: '' });
export const { busy, connected, token, unauthorized } = client.connection;

// Calls it whenever the server can be reached again.
export function onReconnect(scope: Scope, run: () => void): void {
  scope.onEnd(
    connected.subscribe((isConnected) => {
      if (isConnected) run();
    }),
  );
}
