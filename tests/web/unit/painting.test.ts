import { PerspectiveCamera, Scene, type WebGLRenderer } from 'three';
import { describe, expect, it } from 'vitest';
import { efforts, FrameBudget } from '@/scene/budget';
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

const whole = { width: 40, height: 30, isEnlarged: false };

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
    await new Promise((then) => painting.paint({ width: 10, height: 8, isEnlarged: true, steps: 1 }, () => false, then));
    expect(drawn).toEqual(['clear beside', 'scene beside', 'picture canvas']);
  });
});

describe('the budget of frames', () => {
  it('splits a frame of all triangles that takes long, also after coarse ones were quick', () => {
    const budget = new FrameBudget();
    expect([budget.isSlow, budget.steps]).toEqual([false, 1]);
    draw(budget, 3000, { isMoving: false, isCoarse: false });
    for (let n = 0; n < 50; n += 1) draw(budget, 5);
    expect(budget.isSlow).toBe(true);
    expect(budget.steps).toBeGreaterThanOrEqual(40);
  });

  it('takes less effort until 30 frames a second are drawn, and not more than it can', () => {
    const budget = new FrameBudget();
    budget.begin();
    // A machine that draws as long as there are pixels.
    const pace = (): number => 90 * budget.effort.sharpness ** 2;
    for (let n = 0; n < 100; n += 1) draw(budget, pace());
    const { effort } = budget;
    expect(pace()).toBeLessThan(33.5);
    for (let n = 0; n < 100; n += 1) draw(budget, pace());
    expect(budget.effort).toBe(effort);
  });

  it('takes more effort where there is time for it, and all where there is time for all', () => {
    const budget = new FrameBudget();
    budget.begin();
    for (let n = 0; n < 100; n += 1) draw(budget, 120);
    expect(budget.effort).toBe(efforts.at(-1));
    for (let n = 0; n < 100; n += 1) draw(budget, 12);
    // What was too slow in this move is not tried again.
    expect(budget.effort).toBe(efforts.at(-1));
    budget.begin();
    for (let n = 0; n < 100; n += 1) draw(budget, 12);
    expect(budget.effort).toBe(efforts[0]);
  });

  it('takes no pause of the pointer for slow drawing', () => {
    const budget = new FrameBudget();
    const { effort } = budget;
    for (let n = 0; n < 100; n += 1) draw(budget, 30, { isNext: false, pause: 500 });
    expect(budget.effort).toBe(effort);
  });
});

const clocks = new WeakMap<FrameBudget, number>();

// Draws a frame that takes so long, after a pause.
function draw(budget: FrameBudget, took: number, { isMoving = true, isCoarse = true, isNext = true, pause = 0 } = {}): void {
  const began = (clocks.get(budget) ?? 1000) + pause;
  clocks.set(budget, began + took);
  budget.drawn({ began, isMoving, isCoarse, isNext }, began + took);
}
