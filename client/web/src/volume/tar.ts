// Several files as one TAR (POSIX.1-2001, ustar with pax headers), put together from views of the
// files: nothing of their bytes is read here.

const block = 512;
const longestName = 100;
const largestOctal = 8 ** 11;

export interface NamedFile {
  path: string;
  file: Blob;
}

function put(header: Uint8Array, offset: number, text: string): void {
  header.set(new TextEncoder().encode(text), offset);
}

function octal(value: number, digits: number): string {
  return value.toString(8).padStart(digits, '0') + '\0';
}

export function tarHeader(name: string, size: number, type: '0' | 'x'): Uint8Array<ArrayBuffer> {
  const header = new Uint8Array(block);
  put(header, 0, name);
  put(header, 100, octal(0o644, 7));
  put(header, 108, octal(0, 7));
  put(header, 116, octal(0, 7));
  put(header, 124, octal(size < largestOctal ? size : 0, 11));
  put(header, 136, octal(0, 11));
  put(header, 148, ' '.repeat(8));
  put(header, 156, type);
  put(header, 257, 'ustar\0');
  put(header, 263, '00');
  const sum = header.reduce((total, byte) => total + byte, 0);
  put(header, 148, octal(sum, 6) + ' ');
  return header;
}

// "LENGTH key=value\n", where LENGTH counts itself.
export function paxRecord(key: string, value: string): string {
  const rest = ` ${key}=${value}\n`;
  const bytes = new TextEncoder().encode(rest).length;
  let length = bytes + String(bytes).length;
  if (String(length).length !== String(bytes).length) length = bytes + String(length).length;
  return `${length}${rest}`;
}

function padding(size: number): Uint8Array<ArrayBuffer> {
  return new Uint8Array((block - (size % block)) % block);
}

function isPlainName(name: string): boolean {
  return name.length <= longestName && /^[\x20-\x7e]+$/.test(name);
}

export function packTar(files: NamedFile[]): Blob {
  const parts: BlobPart[] = [];
  files.forEach(({ path, file }, index) => {
    const records: string[] = [];
    if (!isPlainName(path)) records.push(paxRecord('path', path));
    if (file.size >= largestOctal) records.push(paxRecord('size', String(file.size)));
    if (records.length > 0) {
      const text = new TextEncoder().encode(records.join(''));
      parts.push(tarHeader(`pax/${index}`, text.length, 'x'), text, padding(text.length));
    }
    const name = isPlainName(path) ? path : `file-${index}`;
    parts.push(tarHeader(name, file.size, '0'), file, padding(file.size));
  });
  parts.push(new Uint8Array(2 * block));
  return new Blob(parts, { type: 'application/x-tar' });
}
