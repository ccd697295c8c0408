import { PerspectiveCamera, Scene, type WebGLRenderer } from 'three';
import { describe, expect, it } from 'vitest';
import { FrameBudget } from '@/scene/budget';
import { Painting } from '@/scene/painting';

// Notes what is drawn where.
function painted(): { painting: Painting; drawn: string[] } {
  const drawn: string[] = [];
  let place = 'canvas';
  const scene = new Scene();
  const gl = { fenceSync: () => null, flush: () => undefined, deleteSync: () => undefined, getContextAttributes: () => ({ antialias: true, depth: true }) };
  const renderer = {
    domElement: { width: 40, height: 30 },
    getContext: () => gl,
    setRenderTarget: (target: unknown) => (place = target === null ? 'canvas' : 'beside'),
    clear: () => drawn.push(`clear ${place}`),
    render: (what: unknown) => drawn.push(`${what === scene ? 'scene' : 'picture'} ${place}`),
  };
  return { painting: new Painting(renderer as unknown as WebGLRenderer, scene, new PerspectiveCamera()), drawn };
}

const whole = { width: 40, height: 30 };

describe('a painting', () => {
  it('of one step goes to the canvas', async () => {
    const { painting, drawn } = painted();
    expect(await new Promise((then) => painting.paint({ ...whole, steps: 1 }, () => false, then))).toBe(true);
    expect(drawn).toEqual(['scene canvas']);
  });

  it('of several steps is made beside the canvas, which gets it whole', async () => {
    const { painting, drawn } = painted();
    const steps: number[] = [];
    const picture = { ...whole, steps: 3, begin: (step: number) => steps.push(step), after: () => drawn.push('over it') };
    expect(await new Promise((then) => painting.paint(picture, () => false, then))).toBe(true);
    expect(steps).toEqual([0, 1, 2]);
    expect(drawn).toEqual(['clear beside', 'scene beside', 'scene beside', 'scene beside', 'picture canvas', 'over it']);
  });

  it('gives way to a change after the step that is drawn, and leaves the canvas as it is', async () => {
    const { painting, drawn } = painted();
    let hasChanged = false;
    const picture = { ...whole, steps: 200, begin: (step: number) => (hasChanged = step === 1) };
    expect(await new Promise((then) => painting.paint(picture, () => hasChanged, then))).toBe(false);
    expect(drawn).toEqual(['clear beside', 'scene beside', 'scene beside']);
  });

  it('of fewer pixels is enlarged', async () => {
    const { painting, drawn } = painted();
    await new Promise((then) => painting.paint({ width: 10, height: 8, steps: 1 }, () => false, then));
    expect(drawn).toEqual(['clear beside', 'scene beside', 'picture canvas']);
  });
});

describe('the budget of frames', () => {
  it('splits a frame of all triangles that takes long, also after coarse ones were quick', () => {
    const budget = new FrameBudget();
    expect([budget.isSlow, budget.steps]).toEqual([false, 1]);
    budget.drawn(performance.now() - 3000, { isMoving: false, isCoarse: false });
    for (let n = 0; n < 50; n += 1) budget.drawn(performance.now() - 5, { isMoving: true, isCoarse: true });
    expect(budget.isSlow).toBe(true);
    expect(budget.steps).toBeGreaterThanOrEqual(40);
  });
});
