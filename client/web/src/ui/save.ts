import { send, token } from '../api/client';

export function saveBlob(blob: Blob, name: string): void {
  const url = URL.createObjectURL(blob);
  const link = document.createElement('a');
  link.href = url;
  link.download = name;
  link.click();
  setTimeout(() => URL.revokeObjectURL(url), 60_000);
}

// A link cannot carry a token, so that then the page fetches the file itself.
export async function saveFile(href: string, name: string): Promise<void> {
  if (token.value !== '') {
    saveBlob(await (await send(href)).blob(), name);
    return;
  }
  const link = document.createElement('a');
  link.href = href;
  link.download = name;
  link.click();
}
