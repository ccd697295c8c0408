// How a surface comes: its progress, and what can be done with it meanwhile.
import type { Page } from 'playwright-core';
import { describe, expect } from 'vitest';
import { ballNrrd, holdMeshes, keepNotices, labelsNrrd, openSurface, setup, surfaceLoaded } from './support';

const { at, it } = setup();

declare global {
  interface Window {
    // What the page said about the loading, one text after the other.
    said: string[];
  }
}

function listen(page: Page): Promise<void> {
  return page.addInitScript(() => {
    window.said = [];
    new MutationObserver(() => {
      const text = document.querySelector('.load-status')?.textContent ?? '';
      if (text !== '' && text !== window.said.at(-1)) window.said.push(text);
    }).observe(document, { subtree: true, childList: true, characterData: true });
  });
}

describe('a surface that is loading', () => {
  it('counts the triangles that are drawn, up to all that there are', async ({ page, daemon }) => {
    await listen(page);
    const volume = await daemon.upload(labelsNrrd(24));
    const { id, mesh } = await daemon.make({ volume, labels: 'all', formats: ['glb'] });
    await openSurface(at, id);
    const counts = (await page.evaluate(() => window.said))
      .map((text) => /^(.+) of (.+) triangles$/.exec(text.replaceAll('\u202f', '')))
      .map((match) => [Number(match?.[1] ?? 0), Number(match?.[2] ?? 0)] as const);
    // Two labels share a wall, so that there are more than the mesh has.
    const all = (mesh?.labels ?? []).reduce((sum, { triangles }) => sum + triangles, 0);
    expect(all).toBeGreaterThan(mesh?.triangles ?? Infinity);
    expect(counts.at(-1)).toEqual([all, all]);
    for (const [drawn, total] of counts) expect(drawn).toBeLessThanOrEqual(total);
  });

  it('is the same if its file is not compressed', async ({ page, daemon }) => {
    await listen(page);
    const volume = await daemon.upload(labelsNrrd(24));
    const job = { volume, labels: 'all', formats: ['glb'], glb_codec: 'none', distances: true, lods: [1, 0.3] };
    const { id, mesh } = await daemon.make(job);
    await openSurface(at, id);
    const all = (mesh?.labels ?? []).reduce((sum, { triangles }) => sum + triangles, 0);
    const last = (await page.evaluate(() => window.said)).at(-1)?.replaceAll('\u202f', '');
    expect(last).toBe(`${all} of ${all} triangles`);
  });

  it('says so where it is measured', async ({ page, daemon }) => {
    const volume = await daemon.upload(ballNrrd(48, 18));
    const { id } = await daemon.make({ volume, iso: 100, formats: ['glb'] });
    await keepNotices(page);
    const release = await holdMeshes(page);
    await page.goto(`${daemon.url}/#/jobs/${id}`);
    await page.getByRole('button', { name: 'Measure' }).click();
    const canvas = page.locator('.viewport canvas');
    await canvas.click();
    await expect.poll(() => page.locator('.toasts').textContent()).toContain('still loading');
    release();
    await surfaceLoaded(page);
    await canvas.click();
    await expect.poll(() => page.locator('.pane [aria-live]').first().textContent()).toBe('First point set');
  });
});
