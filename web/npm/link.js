// Messages to the worker and back.

import { VisavisError } from "./errors.js";

export class Link {
  #port;
  #pending = new Map();
  #sessions = new Map();
  #last = 0;
  #ended = null;

  constructor(port) {
    this.#port = port;
    port.onmessage = ({ data }) => this.#receive(data);
    port.onerror = (event) => this.end(new VisavisError("fault", `the worker stopped: ${event.message ?? "it could not be loaded"}`));
  }

  /** Sends what needs no answer. */
  tell(op, session, values, transfer) {
    if (this.#ended) throw this.#ended;
    this.#port.postMessage({ op, session, values }, transfer);
  }

  /** Sends, and resolves to the answer. */
  ask(op, session, values, transfer) {
    if (this.#ended) return Promise.reject(this.#ended);
    const call = ++this.#last;
    return new Promise((resolve, reject) => {
      this.#pending.set(call, { resolve, reject });
      this.#port.postMessage({ call, op, session, values }, transfer);
    });
  }

  listen(session, receive) {
    this.#sessions.set(session, receive);
  }

  forget(session) {
    this.#sessions.delete(session);
  }

  /** After this all calls fail with `error`. */
  end(error) {
    if (this.#ended) return;
    this.#ended = error;
    this.#pending.forEach(({ reject }) => reject(error));
    this.#pending.clear();
    if (error.kind !== "closed") this.#sessions.forEach((receive) => receive({ error }));
    this.#sessions.clear();
    this.#port.terminate?.();
  }

  #receive(message) {
    const error = message.error && VisavisError.from(message.error);
    const waiting = this.#pending.get(message.call);
    this.#pending.delete(message.call);
    if (waiting) error ? waiting.reject(error) : waiting.resolve(message.value);
    // A trap ends all that the instance held.
    if (error?.kind === "fault") this.end(error);
    else if (!waiting) this.#sessions.get(message.session)?.(error ? { error } : message);
  }
}

/** Two ends of a line within one thread; messages are copied and come later, as with a worker. */
export function inlinePair() {
  const [page, host] = [{}, {}];
  const way = (to) => (data, transfer) => {
    const copy = structuredClone(data, { transfer });
    setTimeout(() => to.onmessage?.({ data: copy }));
  };
  page.postMessage = way(host);
  host.postMessage = way(page);
  return [page, host];
}
