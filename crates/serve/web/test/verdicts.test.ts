import assert from "node:assert/strict";
import { test } from "node:test";

Object.assign(globalThis, { window: { matchMedia: () => ({ matches: false, addEventListener: () => {} }) } });
const { groupsOf } = await import("../src/verdicts");
const { TONES } = await import("../src/palette");

function judged(id: string, slope: number, defaultSpeed = 0.5) {
  const evaluation = {
    protocol: { robot: "doggo", slope_deg: slope },
    policy: { speed_m_per_s: 2 },
    default_gaits: { sine: { speed_m_per_s: defaultSpeed } },
    speed_ratio: 4,
  };
  return { id, tone: TONES[0] as (typeof TONES)[number], evaluation };
}

test("runs that were measured alike stand in one table, with the default gaits last and once", () => {
  const groups = groupsOf([judged("a", 0), judged("b", 20), judged("c", 0)]);
  assert.deepEqual(groups.map((group) => group.gaits.map((gait) => gait.name)), [["a", "c", "sine (default)"], ["b", "sine (default)"]]);
});

test("another default gait is another measure", () => {
  assert.equal(groupsOf([judged("a", 0), judged("b", 0, 0.6)]).length, 2);
});

test("any JSON is a verdict without numbers", () => {
  for (const evaluation of [null, 7, [], { protocol: 3, default_gaits: [], policy: "x", speed_ratio_ci: {} }]) {
    const [group] = groupsOf([{ ...judged("a", 0), evaluation }]);
    assert.equal(group?.gaits.length, 1);
  }
});
