// One picture of a surface: drawn at once, or in steps of some blocks each, of which a change ends the rest.
import type { PerspectiveCamera, Scene, WebGLRenderer } from 'three';
import { overLayer } from './cross';
import { Painting } from './painting';
import type { Parts } from './parts';

export class Frame {
  readonly painting: Painting;
  // A step leaves blocks out.
  private areLeftOut = false;

  constructor(
    private readonly renderer: WebGLRenderer,
    scene: Scene,
    private readonly camera: PerspectiveCamera,
    private readonly parts: Parts,
  ) {
    this.painting = new Painting(renderer, scene, camera);
    camera.layers.enable(overLayer);
  }

  // `then` is told whether the picture is there: `isOver` may have ended it between two steps. `after` draws over it.
  paint(steps: number, isOver: () => boolean, after: () => void, then: (isWhole: boolean) => void): void {
    const { width, height, clientWidth, clientHeight } = this.renderer.domElement;
    // By a picture that is not whole yet.
    this.showAll();
    const before = (): void => {
      this.renderer.setViewport(0, 0, clientWidth, clientHeight);
      this.renderer.clear();
    };
    const begin = (step: number): void => this.show(step, steps);
    this.painting.paint({ width, height, steps, begin, before, after }, isOver, (isWhole) => {
      this.showAll();
      then(isWhole);
    });
  }

  private showAll(): void {
    if (!this.areLeftOut) return;
    this.areLeftOut = false;
    this.parts.setStep(null, 1);
    this.camera.layers.enable(overLayer);
  }

  // With the last one comes what lies over the surface.
  private show(step: number, steps: number): void {
    this.areLeftOut = true;
    this.parts.setStep(step, steps);
    if (step + 1 === steps) this.camera.layers.enable(overLayer);
    else this.camera.layers.disable(overLayer);
  }
}
