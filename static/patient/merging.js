/** Two people's changes to the same thing, put together: what one of them left alone is as the other made it. */
import { isSame } from "../same.js";

/** What was never written is as what was emptied. */
export const same = (a, b) => isSame(a ?? null, b ?? null);

/**
 * `mine` on top of `stored`, both begun from `seen`; objects part by part. Where both changed the same part to different values, mine
 * is taken and `clash` hears its name.
 */
export function merged(seen, stored, mine, clash, name = "") {
  if (same(mine, seen)) return stored;
  if (same(stored, seen) || same(stored, mine)) return mine;
  if (!isTable(stored) || !isTable(mine)) {
    clash(name);
    return mine;
  }
  const names = [...new Set([...Object.keys(stored), ...Object.keys(mine)])];
  const parts = names.map((part) => [part, merged(seen?.[part], stored[part], mine[part], clash, part)]);
  return Object.fromEntries(parts.filter(([, value]) => value !== undefined));
}

const isTable = (value) => typeof value === "object" && value !== null && !Array.isArray(value);
