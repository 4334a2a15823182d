/** The joints as tables show them: a row a finger, from the base to the end. */

/** @type {(finger: string) => [string, string[]]} */
const row = (finger) => [finger, ["mcp", "pip", "dip"].map((joint) => `${finger}_${joint}`)];

/** @type {[string, string[]][]} */
export const FINGER_ROWS = [["thumb", ["thumb_cmc", "thumb_mcp", "thumb_ip"]], ...["index", "middle", "ring", "little"].map(row)];

/** @type {[string, string[]][]} */
export const HAND_ROWS = [...FINGER_ROWS, ["wrist", ["wrist"]]];
