// The one type of error that the package throws and reports.

/** Kinds by the module's status numbers (web/src/status.rs). */
const KINDS = ["ok", "argument", "io", "bundle-corrupt", "bundle-version", "bundle-invalid", "audio", "state", "cpu-level"];

export class VisavisError extends Error {
  constructor(kind, message, options) {
    super(message, options);
    this.name = "VisavisError";
    this.kind = kind;
  }

  static ofStatus(status, message) {
    return new VisavisError(KINDS[status] ?? "other", message);
  }

  /** What crosses from worker to page: errors lose their class on the way. */
  static from(plain) {
    return new VisavisError(plain.kind ?? "other", plain.message ?? String(plain));
  }

  toPlain() {
    return { kind: this.kind, message: this.message };
  }
}

export const argument = (message) => new VisavisError("argument", message);

/** A value of any kind, for a message: neither JSON nor a template takes all of them. */
export const named = (value) =>
  typeof value === "string" ? JSON.stringify(value) : value !== null && typeof value === "object" ? "an object" : String(value);
