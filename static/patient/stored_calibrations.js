/** What self-calibration found of a patient's hands, as the page holds it. */
export function makeKept(api, patient) {
  const listeners = new Set();
  let rows = [];
  const take = (now) => {
    rows = now;
    listeners.forEach((listener) => listener(rows));
  };
  return {
    get now() {
      return rows;
    },
    loaded: api.get(`/api/patients/${patient}/self-calibrations`).then(take),
    /** Hear of it once it is loaded, and of every change; gives back how to stop that. */
    watch: (listener) => {
      listeners.add(listener);
      return () => listeners.delete(listener);
    },
    withdraw: async (id, withdrawn) => {
      const changed = await api.patch(`/api/self-calibrations/${id}`, { withdrawn });
      take(rows.map((row) => (row.id === id ? changed : row)));
    },
  };
}
