// The numbers of a training, as they come.

import type { MetricsAnswer } from "./api";
import { at, entries, number } from "./values";

/** More iterations of a run are not kept. */
const MAX_ROWS = 100_000;

/** More different numbers are not kept: a hostile file could name a new one in every line. */
const MAX_COLUMNS = 64;

/** Numbers of metrics.jsonl that count episodes by cause; their sum is a number too. */
const ACCIDENTS = "accidents";

/** All numbers of a run, one row an iteration. */
export class Series {
  /** The horizontal axis [env steps], ascending. */
  envSteps: number[] = [];
  /** Each number of metrics.jsonl by its name, `accidents.rollover` for nested ones; null where there is none. */
  columns = new Map<string, (number | null)[]>();
  /** The byte to ask from. */
  next = 0;
  /** Lines that are no iteration. */
  broken = 0;

  /** Takes an answer in. False if what was there is no longer so: then everything has to be asked for again. */
  take(answer: MetricsAnswer): boolean {
    if (answer.from !== this.next) {
      this.clear();
      if (answer.from !== 0) return false;
    }
    const isContinued = this.envSteps.length > 0;
    for (const [position, line] of answer.lines.entries()) {
      const isRow = this.push(line);
      // A resume has cut the file where an older line ended, and written on.
      if (!isRow && isContinued && position === 0 && number(at(line, "env_steps")) !== null) {
        this.clear();
        return false;
      }
      if (!isRow) this.broken += 1;
    }
    this.broken += answer.broken;
    this.next = answer.next;
    return true;
  }

  private clear(): void {
    this.envSteps = [];
    this.columns.clear();
    this.next = 0;
    this.broken = 0;
  }

  private push(line: unknown): boolean {
    const envSteps = number(at(line, "env_steps"));
    const last = this.envSteps[this.envSteps.length - 1];
    if (envSteps === null || (last !== undefined && envSteps <= last) || this.envSteps.length >= MAX_ROWS) return false;
    this.envSteps.push(envSteps);
    for (const [name, value] of flat(line)) {
      const column = this.column(name);
      if (column) column[this.envSteps.length - 1] = value;
    }
    for (const column of this.columns.values()) if (column.length < this.envSteps.length) column.push(null);
    return true;
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
