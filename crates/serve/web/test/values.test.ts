import assert from "node:assert/strict";
import { test } from "node:test";
import { at, entries, interval, list, number, text } from "../src/values";

test("what is not there is undefined, whatever stands on the way", () => {
  assert.equal(at({ a: { b: 1 } }, "a", "b"), 1);
  for (const value of [null, 7, "text", [], {}, { a: null }, { a: "b" }]) assert.equal(at(value, "a", "b"), undefined);
  // What every object has by its prototype is in no file.
  assert.equal(at({}, "constructor"), undefined);
});

test("numbers that cannot be drawn are none", () => {
  assert.equal(number(-1.5), -1.5);
  for (const value of [Number.NaN, Infinity, 1e21, "1", null, [1], true]) assert.equal(number(value), null);
});

test("texts, lists, objects and intervals are what they should be or empty", () => {
  assert.equal(text("x".repeat(1000))?.length, 301);
  assert.equal(text({ toString: "x" }), null);
  assert.deepEqual(list({ length: 3 }), []);
  assert.deepEqual(entries([1, 2]), []);
  assert.deepEqual(interval([1, 2]), [1, 2]);
  for (const value of [[1], [1, 2, 3], [1, "2"], null, "12"]) assert.equal(interval(value), null);
});
