// Reading what may be anything: every file of a run may come from somebody else.

/** What a number of our files stays far below; beyond it nothing can be drawn. */
const LARGEST = 1e20;

/** Longer texts are cut. */
const MAX_TEXT = 300;

/** What stands at `keys` in nested objects; undefined where there is nothing. */
export function at(value: unknown, ...keys: string[]): unknown {
  let found: unknown = value;
  for (const key of keys) {
    if (typeof found !== "object" || found === null || !Object.hasOwn(found, key)) return undefined;
    found = (found as Record<string, unknown>)[key];
  }
  return found;
}

/** A finite number of a size that can be drawn, or null. */
export function number(value: unknown): number | null {
  return typeof value === "number" && Math.abs(value) <= LARGEST ? value : null;
}

/** A text, cut where it is long, or null. */
export function text(value: unknown): string | null {
  if (typeof value !== "string") return null;
  return value.length > MAX_TEXT ? `${value.slice(0, MAX_TEXT)}\u2026` : value;
}

export function list(value: unknown): unknown[] {
  return Array.isArray(value) ? value : [];
}

/** Keys and values of an object; none of anything else. */
export function entries(value: unknown): [string, unknown][] {
  return typeof value === "object" && value !== null && !Array.isArray(value) ? Object.entries(value) : [];
}

/** The texts of a list. */
export function texts(value: unknown): string[] {
  return list(value).flatMap((item) => text(item) ?? []);
}

/** Two ends of an interval, or null. */
export function interval(value: unknown): [number, number] | null {
  const [low, high, ...rest] = list(value).map(number);
  return low != null && high != null && rest.length === 0 ? [low, high] : null;
}
