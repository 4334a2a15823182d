/** What is known of a patient's course: asked for once by all parts of the page, and again when something was changed. */
export function makeCourse(api, id) {
  const address = `/api/patients/${id}/progress`;
  const listeners = new Set();
  const titles = api.titles().catch(() => new Map());
  return {
    first: Promise.all([api.get(address), titles]),
    again: () => api.get(address),
    show: () => listeners.forEach((listener) => listener()),
    watch(listener) {
      listeners.add(listener);
      return () => listeners.delete(listener);
    },
  };
}
