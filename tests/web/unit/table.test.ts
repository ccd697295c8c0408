import { describe, expect, it } from 'vitest';
import { commandSnippet } from '@/job/snippets';
import { defaultParameters, estimateQuery, jobRequest, parametersOfQuery, queryOfParameters } from '@/job/parameters';
import { applies, asText, fits, parameterOf, parameters, valueIn, withValue, type Parameter, type Value } from '@/job/table';
import { shown } from '@/views/prepare/parameter_form';
import { estimateNames, jobParameters, notInTheForm, notOfThePage } from '../openapi';

const defaults = defaultParameters('v'.repeat(64), 60);
// Every parameter is for such a job.
const taubin = withValue(defaults, parameterOf('smoothing'), 'taubin');

// A value that the daemon takes and that it would not take by itself.
function otherValue(parameter: Parameter): Value {
  const { kind, values = [], minimum = 0, maximum = minimum + 4 } = parameter;
  switch (kind) {
    case 'switch':
      return parameter.default !== true;
    case 'choice':
      return values.find((value) => value !== parameter.default) ?? '';
    case 'choices':
      return ['glb', 'stl'];
    case 'integer':
      return minimum + 1;
    case 'number':
      return minimum + (maximum - minimum) / 4;
    case 'text':
      return 'text';
    case 'numbers':
      return [1, 0.25];
    case 'places':
      return parameter.name === 'crop' ? [[-1, -2, -3], [4, 5, 6.5]] : [[-1, -2.5, 3]];
    case 'labels':
    case 'by label':
      throw new Error(`${parameter.name} is not in the form`);
  }
}

describe('the table of parameters', () => {
  it('has a row for each parameter of the schema, with what that says of it', () => {
    const expected = [...jobParameters].filter(([name]) => !notOfThePage.includes(name));
    expect(parameters.map(({ name }) => name)).toEqual(expected.map(([name]) => name));
    for (const [name, schema] of expected) {
      const row = parameterOf(name);
      expect(schema.title, `${name} has no title`).toMatch(/\w/);
      expect(row.title).toBe(schema.title);
      expect(row.default, name).toEqual(schema.default);
      expect(row.values, name).toEqual(name === 'formats' ? expect.arrayContaining(['drc', 'glb']) : schema.enum);
      expect([row.minimum, row.above, row.maximum], name).toEqual([schema.minimum, schema.exclusiveMinimum, schema.maximum]);
    }
  });

  it('has nothing that the form does not show', () => {
    const inTheForm = [...jobParameters.keys()].filter((name) => !notInTheForm.includes(name));
    expect(shown.map(({ name }) => name)).toEqual(inTheForm);
  });

  it.each(shown.map((parameter) => [parameter.name, parameter] as const))('carries %s everywhere', (name, parameter) => {
    const value = otherValue(parameter);
    const job = withValue(name === 'smoothing' ? defaults : taubin, parameter, value);
    expect(fits(parameter, value, job)).toBe(true);
    expect(valueIn(jobRequest(job), parameter)).toEqual(value);
    expect(estimateNames).toContain(parameter.query);
    expect(estimateQuery(job).get(parameter.query)).toBe(asText(value));
    const address = new URLSearchParams(queryOfParameters(job, defaults));
    expect(parametersOfQuery(address, defaults)).toEqual(job);
    const isSwitch = typeof value === 'boolean';
    const option = isSwitch ? `--${value ? '' : 'no-'}${parameter.option}` : `--${parameter.option} ${asText(value)}`;
    expect(commandSnippet('http://h:1', job, false)).toContain(option);
  });

  it('knows bounds that are no part of the range, and those of one case alone', () => {
    const lambda = parameterOf('lambda');
    expect([0, 0.01, 1, 1.01].map((value) => fits(lambda, value, defaults))).toEqual([false, true, true, false]);
    expect([0.66, 0.67].map((value) => fits(lambda, value, taubin))).toEqual([true, false]);
    expect([null, Number.NaN].map((value) => fits(lambda, value, defaults))).toEqual([true, false]);
    expect([0, 0.5, 0.51].map((value) => fits(parameterOf('pass_band'), value, taubin))).toEqual([false, true, false]);
    expect(applies(parameterOf('pass_band'), taubin)).toBe(true);
    expect(applies(parameterOf('pass_band'), defaults)).toBe(false);
    expect([-1, 0, 1e9].map((value) => fits(parameterOf('max_displacement_mm'), value, defaults))).toEqual([false, true, true]);
    expect([1.5, 1001, null].map((value) => fits(parameterOf('passes'), value, defaults))).toEqual([false, false, false]);
    expect([[], ['exe'], ['stl']].map((value) => fits(parameterOf('formats'), value, defaults))).toEqual([false, false, true]);
  });
});
