/** The width of an axis whose texts may be longer than its room: a number that is cut off says something else. */
const EDGE = 10; // px between a text and what is beside it

/** As wide as the widest text so far, so that the plot does not change its width to and fro. */
export function widening(least) {
  let size = least;
  return (u, texts, k) => {
    u.ctx.font = u.axes[k].font[0];
    const widths = (texts ?? []).map((text) => u.ctx.measureText(text ?? "").width / devicePixelRatio);
    size = Math.ceil(Math.max(size, ...widths.map((width) => width + EDGE)));
    return size;
  };
}
