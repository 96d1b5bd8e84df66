// The numbers of a training, as they come.

import type { MetricsAnswer } from "./api";
import { at, entries, number } from "./values";

/** Of more iterations every second one is dropped: no screen shows as many. */
export const MAX_ROWS = 20_000;

/** More different numbers are not kept: a hostile file could name a new one in every line. */
const MAX_COLUMNS = 64;

/** Numbers of metrics.jsonl that count episodes by cause; their sum is a number too. */
const ACCIDENTS = "accidents";

/** All numbers of a run, one row an iteration, or every second, fourth ... of a long one. */
export class Series {
  /** The horizontal axis [env steps], ascending. */
  envSteps: number[] = [];
  /** Each number of metrics.jsonl by its name, `accidents.rollover` for nested ones; null where there is none. */
  columns = new Map<string, (number | null)[]>();
  /** The byte to ask from. */
  next = 0;
  /** Lines that are no iteration. */
  broken = 0;
  /** Changes with every change. */
  version = 0;
  /** Iterations so far, and every which of them is kept. */
  private numRead = 0;
  private stride = 1;
  /** Of the last iteration, kept or not. */
  private lastEnvSteps = Number.NEGATIVE_INFINITY;

  /** Takes an answer in. False if what was there is no longer so: then everything has to be asked for again. */
  take(answer: MetricsAnswer): boolean {
    if (answer.from !== this.next) {
      this.clear();
      if (answer.from !== 0) return false;
    }
    const isContinued = this.numRead > 0;
    for (const [position, line] of answer.lines.entries()) {
      const envSteps = number(at(line, "env_steps"));
      if (envSteps !== null && envSteps > this.lastEnvSteps) {
        this.read(envSteps, line);
      } else if (isContinued && position === 0 && envSteps !== null) {
        // A resume has cut the file where an older line ended, and written on.
        this.clear();
        return false;
      } else {
        this.broken += 1;
      }
    }
    if (answer.lines.length > 0) this.version += 1;
    this.broken += answer.broken;
    this.next = answer.next;
    return true;
  }

  private clear(): void {
    this.envSteps = [];
    this.columns.clear();
    this.next = 0;
    this.broken = 0;
    this.version += 1;
    this.numRead = 0;
    this.stride = 1;
    this.lastEnvSteps = Number.NEGATIVE_INFINITY;
  }

  private read(envSteps: number, line: unknown): void {
    this.lastEnvSteps = envSteps;
    const isKept = this.numRead % this.stride === 0;
    this.numRead += 1;
    if (!isKept) return;
    this.envSteps.push(envSteps);
    for (const [name, value] of flat(line)) {
      const column = this.column(name);
      if (column) column[this.envSteps.length - 1] = value;
    }
    for (const column of this.columns.values()) if (column.length < this.envSteps.length) column.push(null);
    if (this.envSteps.length >= MAX_ROWS) this.thinOut();
  }

  private thinOut(): void {
    const isKept = (_: unknown, row: number) => row % 2 === 0;
    this.envSteps = this.envSteps.filter(isKept);
    for (const [name, column] of this.columns) this.columns.set(name, column.filter(isKept));
    this.stride *= 2;
  }

  private column(name: string): (number | null)[] | undefined {
    let column = this.columns.get(name);
    if (!column && this.columns.size < MAX_COLUMNS) {
      column = new Array<null>(this.envSteps.length - 1).fill(null);
      this.columns.set(name, column);
    }
    return column;
  }
}

/** The numbers of a line by their names, and the sum of the accidents. */
function flat(line: unknown): [string, number][] {
  const found: [string, number][] = [];
  for (const [name, value] of entries(line).slice(0, MAX_COLUMNS)) {
    if (name === "env_steps") continue;
    const nested = entries(value).slice(0, MAX_COLUMNS);
    for (const [inner, value] of nested) {
      const read = number(value);
      if (read !== null) found.push([`${name}.${inner}`, read]);
    }
    const read = number(value);
    if (read !== null) found.push([name, read]);
    if (name === ACCIDENTS) found.push([name, nested.reduce((sum, [, value]) => sum + (number(value) ?? 0), 0)]);
  }
  return found.slice(0, MAX_COLUMNS);
}
