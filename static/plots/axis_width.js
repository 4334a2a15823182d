/** The width of an axis whose texts may be longer than its room: a number that is cut off says something else. */
const EDGE = 10; // px between a text and what is beside it

/** As wide as the widest text so far, so that the plot does not change its width to and fro; a text is measured once. */
export function widening(least) {
  const measured = new Set();
  let size = least;
  return (u, texts, k) => {
    const unknown = (texts ?? []).filter((text) => !measured.has(text));
    if (unknown.length) u.ctx.font = u.axes[k].font[0];
    for (const text of unknown) {
      measured.add(text);
      size = Math.ceil(Math.max(size, u.ctx.measureText(text ?? "").width / devicePixelRatio + EDGE));
    }
    return size;
  };
}
