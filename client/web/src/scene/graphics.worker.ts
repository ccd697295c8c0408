// Asks for a context, and waits for it in the page's stead.
const context = new OffscreenCanvas(1, 1).getContext('webgl2');
// An answer of the graphics process, which a context has not waited for yet.
context?.getParameter(context.VERSION);
context?.finish();
postMessage(null);
