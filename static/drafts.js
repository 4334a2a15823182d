/** What was typed and is not saved: it stays on the way to other pages and back, and whoever leaves the document is asked first. */
const drafts = new Map();

/** The draft of a place; it is unsaved while it has `typed`. */
export function draftOf(place) {
  if (!drafts.has(place)) drafts.set(place, {});
  return drafts.get(place);
}

addEventListener("beforeunload", (event) => {
  if ([...drafts.values()].some((draft) => draft.typed)) event.preventDefault();
});
