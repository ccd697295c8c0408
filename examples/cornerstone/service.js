// Requests to the daemon, by the client that it serves itself.
const server = new URLSearchParams(location.search).get('server') ?? 'http://127.0.0.1:8080';
const samplesOf = {
  uint8: Uint8Array,
  int8: Int8Array,
  uint16: Uint16Array,
  int16: Int16Array,
  uint32: Uint32Array,
  int32: Int32Array,
  float32: Float32Array,
  float64: Float64Array,
};
const slicesAtOnce = 8;

const { ApiError, Client, choicesOf, emptyReason } = await import(/* @vite-ignore */ `${server}/client.js`);
const client = new Client({ server });

export async function upload(file) {
  try {
    const { volumes } = await client.upload(file, { name: file.name });
    if (volumes[0].problem) throw new Error(volumes[0].problem.detail);
    return volumes[0].volume;
  } catch (error) {
    const choices = error instanceof ApiError ? choicesOf(error) : new Map();
    if (choices.size > 0) error.message += ` This page cannot ask for ${[...choices.keys()].join(' and ')}.`;
    throw error;
  }
}

// All samples, x fastest, in an array of the given type.
export async function samples({ id, type, dims }, { as: Numbers }) {
  const [columns, rows, slices] = dims;
  const whole = new Numbers(columns * rows * slices);
  let next = 0;
  const fetchSlices = async () => {
    while (next < slices) {
      const index = next;
      next += 1;
      const slice = new samplesOf[type](await client.samplesOfSlice(id, 'z', index));
      whole.set(slice, index * columns * rows);
    }
  };
  await Promise.all(Array.from({ length: slicesAtOnce }, fetchSlices));
  return whole;
}

export const labelsOf = (volume) => client.labelsOf(volume.id, 0);

// The job when it has succeeded: one closed surface for each label, in one PLY file with the labels' colours.
export async function meshOfLabels(volume, maxErrorMm) {
  const request = { volume: volume.id, labels: 'all', formats: ['ply'] };
  if (maxErrorMm > 0) request.max_error_mm = maxErrorMm;
  const job = await client.follow((await client.submitJob(request)).id);
  if (job.state !== 'succeeded') throw new Error(job.error?.detail ?? `The job is ${job.state}.`);
  if (job.mesh.empty) throw new Error(emptyReason(job.mesh));
  return job;
}

export const addressOf = (job) => new URL(job.mesh.files.ply.href, server).href;
