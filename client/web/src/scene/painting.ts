// A scene painted with fewer pixels than its canvas has, or in steps of which a change ends the rest; then it is put over the
// canvas, which shows the picture before until then. A canvas that changes its size for each picture instead holds the page up
// until all that was drawn before is done.
import {
  GLSL3,
  Mesh,
  type PerspectiveCamera,
  PlaneGeometry,
  RawShaderMaterial,
  type Scene,
  SRGBColorSpace,
  type Texture,
  Vector2,
  type WebGLRenderer,
  WebGLRenderTarget,
} from 'three';
import { whenDrawn } from './compile';
import { enlargingFragmentShader, enlargingVertexShader } from './live_shader';

export interface Picture {
  // In pixels of the canvas.
  width: number;
  height: number;
  // It has fewer pixels than the canvas.
  isEnlarged: boolean;
  // A picture of one step and all pixels is drawn on the canvas itself.
  steps: number;
  // Says what a step paints.
  begin?: (step: number, target: WebGLRenderTarget) => void;
  // Called before the canvas gets the picture, and after it, to draw over it.
  before?: () => void;
  after?: () => void;
}

export class Painting {
  private readonly target: WebGLRenderTarget;
  private readonly uniforms = { picture: { value: null as Texture | null }, part: { value: new Vector2() }, last: { value: new Vector2() } };
  // Puts what was painted over the canvas. To be compiled with the scene.
  readonly enlarging: Mesh<PlaneGeometry, RawShaderMaterial>;

  constructor(
    private readonly renderer: WebGLRenderer,
    private readonly scene: Scene,
    private readonly camera: PerspectiveCamera,
  ) {
    const material = new RawShaderMaterial({
      glslVersion: GLSL3,
      vertexShader: enlargingVertexShader,
      fragmentShader: enlargingFragmentShader,
      uniforms: this.uniforms,
      depthTest: false,
      depthWrite: false,
    });
    this.enlarging = new Mesh(new PlaneGeometry(2, 2), material);
    this.enlarging.frustumCulled = false;
    const attributes = (renderer.getContext() as WebGL2RenderingContext).getContextAttributes();
    this.target = new WebGLRenderTarget(1, 1, {
      samples: attributes?.antialias ? 4 : 0,
      depthBuffer: attributes?.depth ?? true,
      colorSpace: SRGBColorSpace,
      internalFormat: 'RGBA8',
    });
    // three then draws on it with the colours and the shaders of a canvas.
    Object.assign(this.target, { isXRRenderTarget: true });
    this.uniforms.picture.value = this.target.texture;
  }

  // Calls back with true when it is drawn; with false if `isOver` says so between two steps, and then the canvas stays as it is.
  paint(picture: Picture, isOver: () => boolean, then: (isWhole: boolean) => void): void {
    const { renderer, target } = this;
    if (!picture.isEnlarged && picture.steps === 1) {
      this.onCanvas(picture, () => renderer.render(this.scene, this.camera), then);
      return;
    }
    // A canvas may have fewer pixels until it gets the picture.
    const width = Math.max(picture.width, renderer.domElement.width);
    const height = Math.max(picture.height, renderer.domElement.height);
    if (target.width !== width || target.height !== height) target.setSize(width, height);
    target.viewport.set(0, 0, picture.width, picture.height);
    const paintFrom = (step: number): void => {
      if (step > 0 && isOver()) {
        then(false);
      } else if (step === picture.steps) {
        this.onCanvas(picture, () => this.enlarge(picture), then);
      } else {
        picture.begin?.(step, target);
        renderer.setRenderTarget(target);
        if (step === 0) renderer.clear();
        renderer.render(this.scene, this.camera);
        renderer.setRenderTarget(null);
        if (picture.steps === 1) paintFrom(1);
        else this.whenDone(() => paintFrom(step + 1));
      }
    };
    paintFrom(0);
  }

  dispose(): void {
    this.enlarging.geometry.dispose();
    this.enlarging.material.dispose();
    this.target.dispose();
  }

  private onCanvas({ before, after }: Picture, draw: () => void, then: (isWhole: boolean) => void): void {
    before?.();
    draw();
    after?.();
    this.whenDone(() => then(true));
  }

  private enlarge({ width, height }: Picture): void {
    const { part, last } = this.uniforms;
    part.value.set(width / this.target.width, height / this.target.height);
    last.value.set((width - 0.5) / this.target.width, (height - 0.5) / this.target.height);
    this.renderer.render(this.enlarging, this.camera);
  }

  private whenDone(then: () => void): void {
    whenDrawn(this.renderer.getContext() as WebGL2RenderingContext, then);
  }
}
