/** Values as of JSON, compared; what is one object is not looked into. */

export function isSame(one, other) {
  if (Object.is(one, other)) return true;
  if (typeof one !== "object" || typeof other !== "object" || !one || !other) return false;
  const names = Object.keys(one);
  if (Array.isArray(one) !== Array.isArray(other) || names.length !== Object.keys(other).length) return false;
  return names.every((name) => Object.hasOwn(other, name) && isSame(one[name], other[name]));
}

/** `full` with other parts at some paths of keys, [[path, value], ...]; `full` itself stays, and shares what is on none of the paths. */
export function withChanges(full, changes) {
  const root = { full };
  const own = new Set([root]); // may be written into
  for (const [path, value] of changes) {
    let at = root;
    let key = "full";
    for (const next of path) {
      if (!own.has(at[key])) own.add((at[key] = { ...at[key] }));
      [at, key] = [at[key], next];
    }
    at[key] = value;
  }
  return root.full;
}

/** `now`, in which every part that is as in `before` is the very object of before: who compares two such values later is done at once. */
export function sharing(before, now) {
  if (Object.is(before, now)) return now;
  if (typeof before !== "object" || typeof now !== "object" || !before || !now) return now;
  const names = Object.keys(now);
  let same = Array.isArray(before) === Array.isArray(now) && names.length === Object.keys(before).length;
  for (const name of names) {
    if (Object.hasOwn(before, name)) now[name] = sharing(before[name], now[name]);
    same &&= Object.hasOwn(before, name) && Object.is(before[name], now[name]);
  }
  return same ? before : now;
}
