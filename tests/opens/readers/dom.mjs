// As much of a browser as the readers ask for: an XML parser, fetch of files, and workers that run in this thread.
import { resolveObjectURL } from 'node:buffer';
import { readFileSync } from 'node:fs';
import { fileURLToPath } from 'node:url';
import vm from 'node:vm';
import { DOMParser as Parser, parseHTML } from 'linkedom';

class InlineWorker {
  constructor(url) {
    this.ready = (async () => {
      const scope = { console, WebAssembly, setTimeout, URL, TextDecoder, performance, onmessage: null };
      scope.self = scope;
      scope.postMessage = (data) => this.onmessage?.({ data });
      vm.runInNewContext(await resolveObjectURL(url).text(), scope);
      return scope;
    })();
  }

  postMessage(data) {
    const copy = structuredClone(data);
    void this.ready.then((scope) => scope.onmessage({ data: copy }));
  }

  terminate() {}
}

// A request for a file.
class FileRequest extends EventTarget {
  status = 0;
  readyState = 0;

  open(method, url) {
    this.responseURL = url;
  }

  send() {
    let bytes = new Uint8Array();
    try {
      bytes = Uint8Array.from(readFileSync(fileURLToPath(this.responseURL)));
      this.status = 200;
    } catch {
      this.status = 404;
    }
    this.responseText = this.responseType === 'arraybuffer' ? '' : new TextDecoder().decode(bytes);
    this.response = this.responseType === 'arraybuffer' ? bytes.buffer : this.responseText;
    this.readyState = 4;
    queueMicrotask(() => ['readystatechange', 'load', 'loadend'].forEach((type) => this.dispatchEvent(new Event(type))));
  }

  setRequestHeader() {}
  getResponseHeader() {}
  abort() {}
}

// A browser's selectors match XML elements by their names without prefixes; linkedom's do not.
class DOMParser extends Parser {
  parseFromString(text, type) {
    return super.parseFromString(text.replace(/<(\/?)\w+:/g, '<$1'), type);
  }
}

const { window, document, Node } = parseHTML('<html><head></head><body></body></html>');
const fetchFromNet = globalThis.fetch;
Object.assign(globalThis, {
  document,
  window,
  self: globalThis,
  DOMParser,
  Node,
  XMLHttpRequest: FileRequest,
  Worker: InlineWorker,
  ProgressEvent: class extends Event {},
  fetch: (request, options) => {
    const url = String(request?.url ?? request);
    return url.startsWith('file:') ? Promise.resolve(new Response(readFileSync(fileURLToPath(url)))) : fetchFromNet(request, options);
  },
});
