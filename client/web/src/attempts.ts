/** Connections one after the other until all has arrived. */
import { errorOf, type MeshtideError } from "./errors.js";

const FIRST_PAUSE_MS = 250;

export interface AttemptOptions {
  readonly signal: AbortSignal;
  /** Attempts in a row that bring nothing new, besides the first. */
  readonly retries: number;
}

/** A failure that another connection may mend. */
export class Interruption extends Error {
  constructor(override readonly cause: MeshtideError) {
    super(cause.message);
  }
}

/** What connections bring. `connect` goes on where the one before stopped, and throws Interruptions. */
export async function* attempts(
  connect: () => AsyncGenerator<Uint8Array>,
  { signal, retries }: AttemptOptions,
): AsyncGenerator<Uint8Array> {
  for (let failures = 0; ; ) {
    try {
      for await (const bytes of connect()) {
        if (bytes.length > 0) failures = 0;
        yield bytes;
      }
      return;
    } catch (error) {
      if (signal.aborted) throw errorOf("aborted", "loading was aborted");
      if (!(error instanceof Interruption)) throw error;
      failures++;
      if (failures > retries) throw error.cause;
      await pause(FIRST_PAUSE_MS * 2 ** (failures - 1), signal);
    }
  }
}

function pause(milliseconds: number, signal: AbortSignal): Promise<void> {
  return new Promise((resolve, reject) => {
    const stop = () => {
      clearTimeout(timer);
      reject(errorOf("aborted", "loading was aborted"));
    };
    const timer = setTimeout(() => {
      signal.removeEventListener("abort", stop);
      resolve();
    }, milliseconds);
    signal.addEventListener("abort", stop, { once: true });
  });
}
