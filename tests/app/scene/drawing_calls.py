"""Counts what a page has the graphics processor draw: `counted` in it, from its first script on; nothing is drawn while `counted.drop`.

`moved` are the pictures in which the bones of the hand's fingers are elsewhere than in the picture before.
"""

COUNTED = """
  let rendering = false;
  let begun = 0;
  window.counted = { pictures: 0, moved: 0, rendered: 0, calls: 0, triangles: 0, drop: false };
  const each = { drawArrays: 2, drawArraysInstanced: 2, drawElements: 1, drawElementsInstanced: 1, drawRangeElements: 3 };
  for (const [name, at] of Object.entries(each)) {
    const draw = WebGL2RenderingContext.prototype[name];
    WebGL2RenderingContext.prototype[name] = function (...given) {
      if (!rendering) {
        rendering = true;
        counted.rendered += 1;
        queueMicrotask(() => (rendering = false)); // when all that was to be drawn at once is drawn
      }
      counted.calls += 1;
      begun ||= requestAnimationFrame(next); // a page that draws nothing has no pictures to count
      if (given[0] === this.TRIANGLES) counted.triangles += (given[at] / 3) * (name.endsWith("Instanced") ? given.at(-1) : 1);
      if (!counted.drop) draw.apply(this, given);
    };
  }
  let last = 0;
  const next = () => {
    const now = window.__viserMutable?.nodeRefFromName["/hand/fingers"]?.children.find((one) => one.isSkinnedMesh)?.skeleton.boneMatrices;
    const sum = now?.reduce((a, b) => a + b, 0) ?? 0;
    counted.pictures += 1;
    if (sum !== last) counted.moved += 1;
    last = sum;
    requestAnimationFrame(next);
  };
"""
