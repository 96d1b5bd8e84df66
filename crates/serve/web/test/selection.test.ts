import assert from "node:assert/strict";
import { test } from "node:test";

// The palette asks for the scheme.
Object.assign(globalThis, { window: { matchMedia: () => ({ matches: false, addEventListener: () => {} }) } });
const { Selection } = await import("../src/selection");
const { TONES } = await import("../src/palette");

test("the address keeps what is shown, whatever its name", () => {
  const selection = new Selection();
  for (const id of ["a&b=c#d", "more/second", "<img src=x>", "\u{1f415}"]) selection.add(id);
  selection.view = "more/second";
  const again = Selection.fromAddress(selection.toAddress());
  assert.deepEqual(again.ids(), selection.ids());
  assert.equal(again.view, "more/second");
  assert.deepEqual(Selection.fromAddress("").ids(), []);
});

test("a run keeps its tone while others come and go", () => {
  const selection = new Selection();
  for (const id of ["a", "b", "c"]) selection.add(id);
  const tone = selection.tone("c");
  selection.remove("a");
  assert.equal(selection.tone("c"), tone);
  selection.add("d");
  assert.equal(selection.tone("c"), tone);
  assert.deepEqual(selection.ids(), ["d", "b", "c"]);
});

test("no more are shown than there are tones", () => {
  const selection = new Selection();
  for (let i = 0; i < 20; i++) selection.add(`run${i}`);
  assert.equal(selection.ids().length, TONES.length);
  assert.ok(selection.isFull());
});
