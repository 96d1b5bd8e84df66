// A recorded episode, read from trajectories/NAME.json (docs/run-directory.md has its shapes).

import { at, list, number, text } from "./values";

const MAX_STEPS = 20_000;
const MAX_LEGS = 16;

/** Nothing of a robot is farther from its start [m]. */
const FARTHEST_M = 1e4;

/** T steps of a robot with L legs: forward, left, up in the ground's frame [m]. */
export interface Episode {
  numSteps: number;
  numLegs: number;
  /** Time of a step [s]. */
  dtS: number;
  /** Of the ground, positive uphill [deg]. */
  slopeDeg: number;
  /** The accident that ended it. */
  accident: string | null;
  /** Whether the ground is no plane, which is drawn as one. */
  isUneven: boolean;
  legLength: number;
  /** The body, T x 3, and its roll, pitch and yaw [rad], T x 3. */
  position: Float32Array;
  orientation: Float32Array;
  /** T x L x 3, T x L x 2 x 3, T x L x 3. */
  hip: Float32Array;
  knee: Float32Array;
  foot: Float32Array;
  /** T x L: 1 on the ground. */
  contact: Uint8Array;
}

/** Checks every number. What is wrong is an Error in words. */
export function readEpisode(file: unknown): Episode {
  const numSteps = list(at(file, "position_m")).length;
  const numLegs = list(at(file, "legs")).length;
  if (numSteps < 1 || numSteps > MAX_STEPS) throw new Error(`position_m has ${numSteps} steps, not 1 to ${MAX_STEPS}`);
  if (numLegs < 1 || numLegs > MAX_LEGS) throw new Error(`there are ${numLegs} legs, not 1 to ${MAX_LEGS}`);
  const numbers = (key: string, ...shape: number[]) => {
    const all = new Float32Array(shape.reduce((product, length) => product * length, 1));
    fill(all, 0, at(file, key), shape, key);
    return all;
  };
  const positive = (key: string, largest: number) => {
    const value = number(at(file, key));
    if (value === null || value <= 0 || value > largest) throw new Error(`${key} is not between 0 and ${largest}`);
    return value;
  };
  const slopeDeg = number(at(file, "slope_deg")) ?? 0;
  if (Math.abs(slopeDeg) >= 90) throw new Error("slope_deg is not below 90");
  return {
    numSteps,
    numLegs,
    dtS: positive("control_dt_s", 10),
    slopeDeg,
    accident: text(at(file, "terminated")),
    isUneven: at(file, "foot_ground_m") !== undefined,
    legLength: positive("leg_length_m", 100),
    position: numbers("position_m", numSteps, 3),
    orientation: numbers("orientation_rad", numSteps, 3),
    hip: numbers("hip_m", numSteps, numLegs, 3),
    knee: numbers("knee_m", numSteps, numLegs, 2, 3),
    foot: numbers("foot_m", numSteps, numLegs, 3),
    contact: Uint8Array.from(numbers("contact", numSteps, numLegs), (value) => (value === 0 ? 0 : 1)),
  };
}

/** Length of the episode [s]. */
export function durationS(episode: Episode): number {
  return episode.numSteps * episode.dtS;
}

/** The step that is seen at a time; row 0 is the state after the first step, and the last one stays. */
export function stepAt(episode: Episode, timeS: number): number {
  return Math.max(0, Math.min(episode.numSteps - 1, Math.round(timeS / episode.dtS) - 1));
}

/** Mean forward speed since the start [m/s]; null at the start. */
export function speedSoFar(episode: Episode, timeS: number): number | null {
  const step = stepAt(episode, timeS);
  const time = Math.max(timeS, (step + 1) * episode.dtS);
  return step === 0 ? null : (episode.position[3 * step] ?? 0) / time;
}

/** Half of the body's length and width from its hips [m]: in the body's frame, at the first step. */
export function bodyHalfSize(episode: Episode): [number, number] {
  const [roll = 0, pitch = 0, yaw = 0] = episode.orientation;
  const [x0 = 0, y0 = 0, z0 = 0] = episode.position;
  let [halfLength, halfWidth] = [0, 0];
  for (let leg = 0; leg < episode.numLegs; leg++) {
    const [x = 0, y = 0, z = 0] = episode.hip.subarray(3 * leg, 3 * leg + 3);
    const [bx, by] = inBody([x - x0, y - y0, z - z0], roll, pitch, yaw);
    halfLength = Math.max(halfLength, Math.abs(bx));
    halfWidth = Math.max(halfWidth, Math.abs(by));
  }
  return [halfLength, halfWidth];
}

/** Turns a vector back by yaw about z, pitch about y, roll about x; forward and left of what comes out. */
function inBody([x, y, z]: [number, number, number], roll: number, pitch: number, yaw: number): [number, number] {
  const [x1, y1] = [Math.cos(yaw) * x + Math.sin(yaw) * y, Math.cos(yaw) * y - Math.sin(yaw) * x];
  const [x2, z2] = [Math.cos(pitch) * x1 - Math.sin(pitch) * z, Math.sin(pitch) * x1 + Math.cos(pitch) * z];
  return [x2, Math.cos(roll) * y1 + Math.sin(roll) * z2];
}

/** Copies nested lists of this shape into `all` from `offset` on. */
function fill(all: Float32Array, offset: number, value: unknown, shape: number[], name: string): void {
  const [length = 0, ...inner] = shape;
  if (!Array.isArray(value) || value.length !== length) throw new Error(`${name} has not the shape that it should have`);
  const size = inner.reduce((product, length) => product * length, 1);
  for (let i = 0; i < length; i++) {
    if (inner.length > 0) {
      fill(all, offset + i * size, value[i], inner, `${name}[${i}]`);
    } else {
      const read = number(value[i]);
      if (read === null || Math.abs(read) > FARTHEST_M) throw new Error(`${name}[${i}] is no number that can be drawn`);
      all[offset + i] = read;
    }
  }
}
