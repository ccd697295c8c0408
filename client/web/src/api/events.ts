// Reads server-sent events from a response's body (WHATWG HTML, 9.2.6). EventSource is not used because it
// cannot carry a token.
export interface ServerEvent {
  name: string;
  data: string;
}

export class EventParser {
  private pending = '';
  private name = '';
  private data: string[] = [];

  // Returns the events that this piece of text completes.
  take(text: string): ServerEvent[] {
    this.pending += text;
    const events: ServerEvent[] = [];
    // A carriage return at the end may be the first half of a line's end.
    for (;;) {
      const match = /\r\n|\n|\r(?!$)/.exec(this.pending);
      if (match === null) return events;
      const line = this.pending.slice(0, match.index);
      this.pending = this.pending.slice(match.index + match[0].length);
      this.takeLine(line, events);
    }
  }

  private takeLine(line: string, events: ServerEvent[]): void {
    if (line === '') {
      if (this.data.length > 0) events.push({ name: this.name || 'message', data: this.data.join('\n') });
      this.name = '';
      this.data = [];
      return;
    }
    const colon = line.indexOf(':');
    if (colon === 0) return; // a comment
    const field = colon < 0 ? line : line.slice(0, colon);
    const value = colon < 0 ? '' : line.slice(colon + 1).replace(/^ /, '');
    if (field === 'event') this.name = value;
    if (field === 'data') this.data.push(value);
  }
}
