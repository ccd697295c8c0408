// What other projects get of this folder, as the module `isomesh` (client/javascript).
export {
  cancelJob,
  connect,
  eraseVolume,
  estimateOf,
  getJob,
  getVolume,
  histogramOf,
  labelsOf,
  listJobs,
  listVolumes,
  meshOf,
  previewFile,
  renameVolume,
  slicePicture,
  submitJob,
} from './client';
export { follow } from './follow';
export { cancelOrder, hasOrders, listOrders, listPacs, retryOrder } from './orders';
export { adviceFor, ApiError, choicesOf } from './problem';
export { isFinal } from './types';
export type * from './types';
export { upload } from './upload';
export type { RawDescription, Uploaded, UploadOptions } from './upload';
