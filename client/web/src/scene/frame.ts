// One picture of a surface: drawn at once, or in steps of some blocks each, of which a change ends the rest; with all pixels of
// the screen or with fewer.
import type { PerspectiveCamera, Scene, WebGLRenderer } from 'three';
import { overLayer } from './cross';
import { Painting } from './painting';
import type { Parts } from './parts';

export interface Manner {
  steps: number;
  // The part of the screen's pixels along each side.
  sharpness: number;
}

// Pixels for each of the page's.
export function screenRatio(): number {
  return Math.min(2, window.devicePixelRatio);
}

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
    // three clears a new context to black until it has drawn something.
    renderer.domElement.addEventListener('webglcontextrestored', () => renderer.setClearAlpha(0));
  }

  // `then` is told whether the picture is there: `isOver` may have ended it between two steps. `after` draws over it.
  paint({ steps, sharpness }: Manner, isOver: () => boolean, after: () => void, then: (isWhole: boolean) => void): void {
    const { clientWidth, clientHeight } = this.renderer.domElement;
    const ratio = sharpness * screenRatio();
    const [width, height] = [Math.floor(ratio * clientWidth), Math.floor(ratio * clientHeight)];
    // By a picture that is not whole yet.
    this.showAll();
    const before = (): void => {
      // A canvas of another size is blank, so that it gets it with its picture.
      if (this.renderer.getPixelRatio() !== ratio) this.renderer.setPixelRatio(ratio);
      this.renderer.setViewport(0, 0, clientWidth, clientHeight);
      this.renderer.clear();
    };
    const begin = (step: number): void => this.show(step, steps);
    this.painting.paint({ width, height, steps, isEnlarged: false, begin, before, after }, isOver, (isWhole) => {
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
