// An HTTP server that responds as openapi.yaml describes, as far as clients need it for one job.
import { createServer, type IncomingMessage, type Server, type ServerResponse } from 'node:http';
import type { AddressInfo } from 'node:net';
import { vi } from 'vitest';

// Waits until the check passes.
export function eventually(check: () => void): Promise<void> {
  return vi.waitFor(check, { timeout: 30_000 });
}

// The one job that a daemon has.
export const id = '0123456789abcdef';

export class Daemon {
  // The job runs until `end`, unless a test begins with another state.
  state = 'running';
  readonly asked: string[] = [];
  query = new URLSearchParams(); // of the last request
  readonly tokens = new Set<string | undefined>();
  uploaded = Buffer.alloc(0);
  // Responds in its place, as a proxy before it may.
  proxy: ((response: ServerResponse) => void) | null = null;
  // Keeps requests for the job without a response.
  holds = false;
  readonly streams = new Set<ServerResponse>();
  readonly held = new Set<ServerResponse>();
  private readonly server: Server;

  constructor(readonly name: string) {
    this.server = createServer((request, response) => void this.answer(request, response));
  }

  async start(): Promise<void> {
    await new Promise<void>((resolve) => this.server.listen(0, '127.0.0.1', resolve));
  }

  async stop(): Promise<void> {
    this.server.closeAllConnections();
    await new Promise((resolve) => this.server.close(resolve));
  }

  get address(): string {
    return `http://127.0.0.1:${(this.server.address() as AddressInfo).port}`;
  }

  end(): void {
    this.state = 'succeeded';
    for (const stream of this.streams) stream.write(`data: ${JSON.stringify({ id, state: 'succeeded' })}\n\n`);
  }

  private async answer(request: IncomingMessage, response: ServerResponse): Promise<void> {
    const [path = '', query] = request.url?.split('?') ?? [];
    this.query = new URLSearchParams(query);
    const isLast = this.query.get('cursor') === 'the rest';
    this.asked.push(`${request.method} ${path}`);
    this.tokens.add(request.headers.authorization);
    const keep = (all: Set<ServerResponse>): void => {
      all.add(response);
      response.on('close', () => all.delete(response));
    };
    if (this.proxy) {
      this.proxy(response);
    } else if (path === '/v1/events') {
      keep(this.streams);
      response.writeHead(200, { 'Content-Type': 'text/event-stream' }).write(': here\n\n');
    } else if (path === `/v1/jobs/${id}` && this.holds) {
      keep(this.held);
    } else if (path === `/v1/jobs/${id}`) {
      const mesh = { files: { glb: { href: `/v1/jobs/${id}/mesh.glb` } } };
      response.end(JSON.stringify({ id, state: this.state, progress: 0.5, volume: this.name, mesh }));
    } else if (path === `/v1/jobs/${id}/mesh.glb`) {
      response.end('glTF');
    } else if (path === `/v1/jobs/${id}/labels`) {
      response.end(JSON.stringify(isLast ? { labels: [{ label: 3 }], next: null } : { labels: [{ label: 1 }, { label: 2 }], next: 'the rest' }));
    } else if (path === `/v1/jobs/${id}/walls`) {
      const atEdges = this.query.get('edge_contacts') === 'true' ? [{ a: 3, b: 5, area_mm2: 0.1, faces: 0 }] : [];
      const walls = isLast ? [{ a: 3, b: 4, area_mm2: 1, faces: 5 }, ...atEdges] : [{ a: 3, b: null, area_mm2: 2, faces: 6 }];
      response.end(JSON.stringify({ walls, next: isLast ? null : 'the rest' }));
    } else if (path === `/v1/volumes/${id}/labels`) {
      const labels = isLast ? [{ label: 3 }] : [{ label: 1 }, { label: 2 }];
      response.end(JSON.stringify({ volume: id, background: 0, labels, next: isLast ? null : 'the rest' }));
    } else if (path === '/v1/jobs' && request.method === 'POST') {
      response.writeHead(202).end(JSON.stringify({ id, key: request.headers['idempotency-key'] }));
    } else if (path === '/v1/volumes' && this.query.has('upload')) {
      // A body that is kept cannot be one that is still to come.
      const isWhole = request.headers['upload-complete'] === undefined && request.headers['content-length'] === '0';
      const kept = { id: this.query.get('upload') };
      response.writeHead(isWhole ? 201 : 400).end(JSON.stringify(isWhole ? kept : { title: 'Invalid parameter' }));
    } else if (path === '/v1/volumes' && request.method === 'POST') {
      response.writeHead(201, { Location: '/v1/uploads/a' }).end();
    } else if (path === '/v1/uploads/a') {
      const pieces: Buffer[] = [];
      for await (const piece of request) pieces.push(piece as Buffer);
      this.uploaded = Buffer.concat(pieces);
      response.writeHead(201).end(JSON.stringify({ id: this.name }));
    } else {
      response.writeHead(404).end(JSON.stringify({ title: 'Not found', detail: `${this.name} has no ${path}` }));
    }
  }
}
