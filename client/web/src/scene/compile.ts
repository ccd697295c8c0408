// Shaders are made beside the page: whoever draws with one that is not ready waits for it in the middle of a call.
import type { Camera, Material, Object3D, WebGLRenderer } from 'three';

const lookEvery = 10;

// Calls back once all that was drawn until now is done, and does not hold the page up until then: where software
// draws, a page that goes on drawing waits for it in the middle of a call.
export function whenDrawn(gl: WebGL2RenderingContext, then: () => void): void {
  const sync = gl.fenceSync(gl.SYNC_GPU_COMMANDS_COMPLETE, 0);
  gl.flush();
  const look = (): void => {
    const isWaiting = sync !== null && gl.clientWaitSync(sync, 0, 0) === gl.TIMEOUT_EXPIRED;
    if (isWaiting && !gl.isContextLost()) {
      setTimeout(look, 1);
      return;
    }
    gl.deleteSync(sync);
    then();
  };
  setTimeout(look, 1);
}

interface Program {
  isReady(): boolean;
}

function isReady(renderer: WebGLRenderer, material: Material): boolean {
  const { currentProgram } = renderer.properties.get(material) as { currentProgram?: Program };
  return currentProgram?.isReady() ?? true;
}

// Begins to make what these scenes are drawn with, all of it for the render target that is set now. Calls back when
// it is there, unless the signal has ended. three's own compileAsync throws when a material is let go meanwhile.
export function compile(
  renderer: WebGLRenderer,
  scenes: readonly [Object3D, Camera][],
  signal: AbortSignal,
  then: () => void,
): void {
  const materials = scenes.flatMap(([scene, camera]) => [...renderer.compile(scene, camera)]);
  const look = (): void => {
    if (signal.aborted) return;
    if (materials.every((material) => isReady(renderer, material))) then();
    else setTimeout(look, lookEvery);
  };
  // Where nothing tells whether they are ready, they are made in turn with what is drawn.
  whenDrawn(renderer.getContext() as WebGL2RenderingContext, look);
}
