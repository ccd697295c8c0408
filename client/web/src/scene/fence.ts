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
