import { client, token } from '../client';

export function saveBlob(blob: Blob, name: string): void {
  const url = URL.createObjectURL(blob);
  const link = document.createElement('a');
  link.href = url;
  link.download = name;
  link.click();
  setTimeout(() => URL.revokeObjectURL(url), 60_000);
}

// What is larger a browser writes to the disk itself, under the name that the daemon gives it.
const mostInMemory = 250_000_000;

// Under that name. A link cannot carry a token, and browsers take the name that the daemon says before that of a
// link, so that the page fetches the file itself.
export async function saveFile(href: string, name: string, bytes: number): Promise<void> {
  if (token.value !== '' || bytes <= mostInMemory) {
    saveBlob(await client.connection.blob(href), name);
    return;
  }
  const link = document.createElement('a');
  link.href = client.connection.addressOf(href);
  link.download = name;
  link.click();
}
