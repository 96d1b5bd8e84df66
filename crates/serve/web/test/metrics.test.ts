import assert from "node:assert/strict";
import { test } from "node:test";
import type { MetricsAnswer } from "../src/api";
import { MAX_ROWS, Series } from "../src/metrics";

function answer(from: number, next: number, ...lines: unknown[]): MetricsAnswer {
  return { from, next, more: false, broken: 0, lines };
}

test("rows are added as they come, with holes where a number is missing", () => {
  const series = new Series();
  assert.ok(series.take(answer(0, 10, { env_steps: 100, a: 1, accidents: { rollover: 2, too_low: 1 } })));
  assert.ok(series.take(answer(10, 20, { env_steps: 200, b: 5 }, { env_steps: 300, a: null, b: 6 })));
  assert.deepEqual(series.envSteps, [100, 200, 300]);
  assert.deepEqual(series.columns.get("a"), [1, null, null]);
  assert.deepEqual(series.columns.get("b"), [null, 5, 6]);
  assert.deepEqual(series.columns.get("accidents"), [3, null, null]);
  assert.deepEqual(series.columns.get("accidents.rollover"), [2, null, null]);
  assert.equal(series.next, 20);
});

test("a file that was cut is taken from its start", () => {
  const series = new Series();
  series.take(answer(0, 20, { env_steps: 100, a: 1 }, { env_steps: 200, a: 2 }));
  // The server has noticed.
  assert.ok(series.take(answer(0, 10, { env_steps: 100, a: 3 })));
  assert.deepEqual(series.columns.get("a"), [3]);
});

test("a file that was cut and has grown past its old end is asked for again", () => {
  const series = new Series();
  series.take(answer(0, 20, { env_steps: 100 }, { env_steps: 200 }));
  assert.equal(series.take(answer(20, 30, { env_steps: 150 })), false);
  assert.equal(series.next, 0);
  assert.ok(series.take(answer(0, 30, { env_steps: 50 }, { env_steps: 100 }, { env_steps: 150 })));
  assert.deepEqual(series.envSteps, [50, 100, 150]);
});

test("lines that are no iterations are counted", () => {
  const series = new Series();
  const lines = [7, null, [], "x", {}, { env_steps: "1" }, { env_steps: 1e300 }, { env_steps: 5 }, { env_steps: 5 }];
  assert.ok(series.take({ ...answer(0, 9, ...lines), broken: 2 }));
  assert.deepEqual(series.envSteps, [5]);
  assert.equal(series.broken, 10);
});

test("names without end are not kept", () => {
  const series = new Series();
  const lines = Array.from({ length: 500 }, (_, i) => ({ env_steps: i + 1, [`name${i}`]: 1 }));
  series.take(answer(0, 1, ...lines));
  assert.equal(series.envSteps.length, 500);
  assert.equal(series.columns.size, 64);
  for (const column of series.columns.values()) assert.equal(column.length, 500);
});

test("of a very long training every second iteration is kept, and it still goes on", () => {
  const series = new Series();
  const rows = (from: number, to: number) => Array.from({ length: to - from }, (_, i) => ({ env_steps: from + i + 1, a: from + i + 1 }));
  assert.ok(series.take(answer(0, 10, ...rows(0, MAX_ROWS))));
  assert.equal(series.envSteps.length, MAX_ROWS / 2);
  assert.ok(series.take(answer(10, 20, ...rows(MAX_ROWS, MAX_ROWS + 3))));
  assert.deepEqual(series.envSteps.slice(-3), [MAX_ROWS - 1, MAX_ROWS + 1, MAX_ROWS + 3]);
  assert.deepEqual(series.columns.get("a"), series.envSteps);
  assert.equal(series.broken, 0);
  // What is not kept is noticed all the same.
  assert.equal(series.take(answer(20, 30, { env_steps: MAX_ROWS })), false);
});
