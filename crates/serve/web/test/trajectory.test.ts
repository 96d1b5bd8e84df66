import assert from "node:assert/strict";
import { test } from "node:test";
import { bodyHalfSize, durationS, readEpisode, speedSoFar, stepAt } from "../src/trajectory";

/** Two steps of 0.5 s of a robot with one leg whose hip is 0.3 m ahead and 0.1 m left of a body that has turned left by 90 degrees. */
function file(): Record<string, unknown> {
  const quarter = Math.PI / 2;
  return {
    label: "learned gait",
    legs: ["front"],
    control_dt_s: 0.5,
    slope_deg: 10,
    leg_length_m: 0.2,
    terminated: null,
    position_m: [[0, 0, 0.2], [1, 0, 0.2]],
    orientation_rad: [[0, 0, quarter], [0, 0, quarter]],
    hip_m: [[[-0.1, 0.3, 0.2]], [[0.9, 0.3, 0.2]]],
    knee_m: [[[[0, 0, 0.1], [0, 0, 0.1]]], [[[0, 0, 0.1], [0, 0, 0.1]]]],
    foot_m: [[[0, 0, 0]], [[1, 0, 0]]],
    contact: [[1], [0]],
  };
}

test("an episode is read as it stands", () => {
  const episode = readEpisode(file());
  assert.equal(durationS(episode), 1);
  assert.deepEqual([...episode.contact], [1, 0]);
  assert.deepEqual([episode.accident, episode.isUneven, episode.slopeDeg], [null, false, 10]);
  // Row 0 is the state after the first step; the last one stays.
  assert.deepEqual([0, 0.5, 0.74, 1, 9].map((time) => stepAt(episode, time)), [0, 0, 0, 1, 1]);
  assert.equal(speedSoFar(episode, 1), 1);
  assert.equal(speedSoFar(episode, 4), 0.25);
  assert.equal(speedSoFar(episode, 0), null);
});

test("the body's size is measured along the body", () => {
  const [halfLength, halfWidth] = bodyHalfSize(readEpisode(file()));
  assert.ok(Math.abs(halfLength - 0.3) < 1e-6 && Math.abs(halfWidth - 0.1) < 1e-6, `${halfLength} ${halfWidth}`);
});

test("what cannot be drawn is refused in words", () => {
  const cases: [string, unknown, RegExp][] = [
    ["foot_m", [[["many"]]], /^foot_m has not the shape/],
    ["foot_m", [[[0, 0, 0]], [[1, 0, "<b>"]]], /^foot_m\[1\]\[0\]\[2\] is no number/],
    ["hip_m", [[[0, 0, 1e9]], [[0, 0, 0]]], /^hip_m\[0\]\[0\]\[2\] is no number/],
    ["position_m", [], /0 steps/],
    ["position_m", new Array(30_000).fill([0, 0, 0]), /30000 steps/],
    ["legs", new Array(17).fill("x"), /17 legs/],
    ["legs", { length: 4 }, /0 legs/],
    ["control_dt_s", 0, /^control_dt_s/],
    ["control_dt_s", null, /^control_dt_s/],
    ["slope_deg", 90, /^slope_deg/],
    ["leg_length_m", -1, /^leg_length_m/],
  ];
  for (const [key, value, problem] of cases) {
    assert.throws(() => readEpisode({ ...file(), [key]: value }), { message: problem }, key);
  }
  for (const value of [null, 7, "x", []]) assert.throws(() => readEpisode(value));
});
