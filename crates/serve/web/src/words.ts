// Numbers as a person reads them.

/** With this many decimals and a true minus; a dash where there is none. */
export function fixed(value: number | null, decimals: number): string {
  if (value === null) return "\u2013";
  if (Math.abs(value) >= 1e7) return value.toExponential(1).replace("-", "\u2212");
  return value.toFixed(decimals).replace("-", "\u2212");
}

/** A few digits, whatever the size. */
export function short(value: number | null): string {
  if (value === null) return "\u2013";
  const size = Math.abs(value);
  if (size !== 0 && (size < 1e-3 || size >= 1e7)) return value.toExponential(2).replace("-", "\u2212");
  return fixed(value, size >= 100 ? 0 : size >= 1 ? 2 : 3);
}

/** A count with thin spaces: 1 003 520. */
export function count(value: number | null): string {
  return value === null ? "\u2013" : Math.round(value).toLocaleString("en").replaceAll(",", "\u202f");
}

/** How long ago. */
export function age(seconds: number): string {
  if (seconds < 60) return `${Math.floor(seconds)} s ago`;
  if (seconds < 3600) return `${Math.floor(seconds / 60)} min ago`;
  if (seconds < 172800) return `${Math.floor(seconds / 3600)} h ago`;
  return `${Math.floor(seconds / 86400)} days ago`;
}

/** Part of a whole, as "42 %". */
export function percent(part: number): string {
  return `${Math.floor(100 * part)} %`;
}
