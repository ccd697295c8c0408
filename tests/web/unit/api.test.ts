import { describe, expect, it } from 'vitest';
import { merged } from '@/api/follow';
import { EventData } from '@/api/job_events';
import { adviceFor, ApiError, asApiError, choicesOf, errorOf } from '@/api/problem';
import type { Job } from '@/api/types';
import { dispositionOf, uploadedOf, uploadPath } from '@/api/upload';

describe('errorOf', () => {
  it('takes a problem by its words', () => {
    const body = JSON.stringify({
      type: 'urn:isomesh:problem:unusable-volume',
      title: 'Unusable volume',
      status: 422,
      detail: 'slice 41 of 93 is missing',
      overridable: 'frame-of-reference',
      choices: [{ parameter: 'series', value: '1.2.840.1', title: 'head, 93 slices' }],
    });
    const error = errorOf(422, body);
    expect(error).toMatchObject({ status: 422, title: 'Unusable volume', detail: 'slice 41 of 93 is missing' });
    expect(error.remedy.overridable).toBe('frame-of-reference');
    expect([...choicesOf(error)]).toEqual([
      ['series', [{ parameter: 'series', value: '1.2.840.1', title: 'head, 93 slices' }]],
    ]);
    expect(adviceFor(error)).toBe('');
  });

  it('says the status of a proxy that answers with a page of its own', () => {
    for (const body of ['<html>502</html>', '', 'null', '[]', '{"title": 5}']) {
      expect(errorOf(502, body)).toMatchObject({ status: 502, title: 'HTTP status 502' });
    }
  });

  it('knows a connection that failed, and leaves faults of its own apart', () => {
    expect(asApiError(new TypeError('Failed to fetch')).isUnreachable).toBe(true);
    expect(asApiError(new RangeError('x')).isUnreachable).toBe(false);
    const known = new ApiError(404, 'Not found', '');
    expect(asApiError(known)).toBe(known);
  });

  it('says what to do next', () => {
    for (const status of [0, 401, 404, 413, 415, 422, 503, 507]) {
      expect(adviceFor(new ApiError(status, '', '')), String(status)).not.toBe('');
    }
    expect(adviceFor(new ApiError(400, '', ''))).toBe('');
    expect(adviceFor(new ApiError(422, '', 'The data file is missing. Send both files in one ZIP.'))).toBe('');
  });
});

describe('EventData', () => {
  const stream = ': ping\n\nevent: stage\ndata: {"stage":"smooth"}\n\n: ping\n\nevent: done\ndata: {}\n\n';

  it('finds what events say, however the text comes', () => {
    for (const size of [1, 2, 5, stream.length]) {
      const data = new EventData();
      const found = [];
      for (let i = 0; i < stream.length; i += size) found.push(...data.take(stream.slice(i, i + size)));
      expect(found.map((text) => JSON.parse(text) as unknown), `pieces of ${size}`).toEqual([{ stage: 'smooth' }, {}]);
    }
  });
});

describe('merged', () => {
  const job = { id: 'a', state: 'running', stage: 'load', progress: 0 } as Job;

  it('takes over what an event says, and nothing of another job', () => {
    const change = { id: 'a', state: 'running', stage: 'smooth', progress: 0.5 } as const;
    expect(merged(job, change)).toMatchObject({ id: 'a', stage: 'smooth', progress: 0.5 });
    expect(merged(job, { ...change, id: 'b' })).toBe(job);
  });
});

describe('uploadPath', () => {
  it('describes raw samples and what was chosen', () => {
    expect(uploadPath({})).toBe('/v1/volumes?keep=true');
    expect(uploadPath({ choices: { series: '1.2.3', volume: '4' } })).toBe('/v1/volumes?keep=true&series=1.2.3&volume=4');
    const raw = { dims: [2, 3, 4] as [number, number, number], type: 'int16' as const, spacing: [1, 1, 0.5] as [number, number, number], byteOrder: 'big' as const };
    expect(decodeURIComponent(uploadPath({ raw }))).toBe('/v1/volumes?keep=true&dims=2,3,4&type=int16&spacing=1,1,0.5&byte_order=big');
  });
});

describe('dispositionOf', () => {
  it('tells any name in ASCII', () => {
    expect(dispositionOf("M\u00fcller's ct.nii")).toBe("attachment; filename*=UTF-8''M%C3%BCller%27s%20ct.nii");
  });
});

describe('uploadedOf', () => {
  it('is a list for one volume and for several', () => {
    expect(uploadedOf(201, '{"id":"a"}')).toEqual([{ member: '', status: 201, volume: { id: 'a' }, problem: null }]);
    expect(uploadedOf(207, '{"volumes":[{"member":"b"},{"member":"c"}]}')).toHaveLength(2);
  });
});
