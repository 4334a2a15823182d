/** The HTTP API: values in, values out; what goes wrong is an Error with the sentence to show. */
import { takeEarly } from "./first_view.js";
import { READER } from "./words/languages.js";
import { t } from "./words/words.js";

export class ApiError extends Error {
  constructor(sentence, status = 0, confirm = []) {
    super(sentence);
    this.status = status;
    this.confirm = confirm; // doubts that a person may confirm away
  }
}

/** `stranger` is called for each answer that asks for a login first. */
export function makeApi(stranger) {
  const protocols = { loading: null };

  async function call(method, path, body) {
    const response = await reach(path, {
      method,
      headers: body === undefined ? {} : { "Content-Type": "application/json" },
      body: body === undefined ? undefined : JSON.stringify(body),
    });
    return response.status === 204 ? null : response.json();
  }

  async function some(path) {
    const response = await reach(path, { method: "GET" });
    return { rows: await response.json(), total: Number(response.headers.get("X-Total-Count")) };
  }

  async function reach(path, options) {
    let response;
    try {
      const asked = options.method === "GET" && takeEarly(path);
      response = await (asked || fetch(path, { ...options, headers: { ...READER, ...options.headers } }));
    } catch {
      throw new ApiError(t("error.unreachable"));
    }
    if (response.status === 401) stranger();
    if (!response.ok) throw await refusal(response);
    return response;
  }

  async function loadTitles() {
    try {
      const all = await call("GET", "/api/protocols");
      return new Map(all.map((p) => [p.name, p.title]));
    } catch (error) {
      protocols.loading = null; // asked again next time
      throw error;
    }
  }

  return {
    get: (path) => call("GET", path),
    /** A part of a long list: its `rows`, and how many there are in `total`. */
    some,
    post: (path, body = {}) => call("POST", path, body),
    patch: (path, body) => call("PATCH", path, body),
    put: (path, body) => call("PUT", path, body),
    remove: (path) => call("DELETE", path),
    /** What is there, whole; `signal` stops it on its way. */
    file: async (path, signal) => (await reach(path, { signal })).blob(),
    upload,
    /** Titles of tasks by name. */
    titles: () => (protocols.loading ??= loadTitles()),
  };
}

/** Send a form with a file; `progress` hears the share sent, `signal` stops it on its way. */
function upload(path, form, progress, signal) {
  return new Promise((resolve, reject) => {
    const request = new XMLHttpRequest();
    request.open("POST", path);
    request.responseType = "json";
    for (const [name, value] of Object.entries(READER)) request.setRequestHeader(name, value);
    request.upload.onprogress = (event) => event.lengthComputable && progress(event.loaded / event.total);
    request.onload = () => {
      const good = request.status < 300;
      good ? resolve(request.response) : reject(new ApiError(request.response?.error ?? t("error.unreadable"), request.status));
    };
    request.onerror = () => reject(new ApiError(t("error.unreachable")));
    request.onabort = () => reject(new ApiError(t("upload.stopped")));
    signal?.addEventListener("abort", () => request.abort());
    request.send(form);
  });
}

async function refusal(response) {
  const body = await response.json().catch(() => ({}));
  return new ApiError(body.error ?? t("error.unreadable"), response.status, body.confirm);
}
