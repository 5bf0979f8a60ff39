/** The bytes of a .tide file by plain requests: one, and another for the rest after each lost connection. */
import { type AttemptOptions, attempts, Interruption } from "./attempts.js";
import { errorOf } from "./errors.js";

export interface DownloadOptions extends AttemptOptions {
  readonly headers: Record<string, string>;
  readonly credentials: RequestCredentials;
}

/** Answers after which the same request may succeed. */
const PASSING = [408, 425, 429, 500, 502, 503, 504];

export function download(url: string, options: DownloadOptions): AsyncGenerator<Uint8Array> {
  const state = { received: 0, tag: null as string | null };
  return attempts(() => request(url, options, state), options);
}

async function* request(
  url: string,
  { signal, headers, credentials }: DownloadOptions,
  state: { received: number; tag: string | null },
): AsyncGenerator<Uint8Array> {
  const asked: Record<string, string> = { ...headers };
  if (state.received > 0) {
    asked.Range = `bytes=${state.received}-`;
    if (state.tag !== null && !state.tag.startsWith("W/")) asked["If-Range"] = state.tag;
  }
  const lost = (error: unknown) =>
    new Interruption(
      errorOf("network", `the connection to ${new URL(url).host} was lost: ${(error as Error).message}`),
    );
  const response = await fetch(url, { headers: asked, credentials, signal }).catch((error: unknown) => {
    throw lost(error);
  });
  if (response.status === 416 && state.received > 0) return; // nothing is left
  if (!response.ok) {
    const error = errorOf("http", `the server answers ${response.status} ${response.statusText}`.trim(), {
      status: response.status,
    });
    throw PASSING.includes(response.status) ? new Interruption(error) : error;
  }
  const tag = response.headers.get("ETag");
  if (state.received > 0 && tag !== state.tag) {
    await response.body?.cancel();
    throw errorOf("changed", "the file has changed on the server while it was loaded; load it again");
  }
  state.tag = tag;
  let known = 0; // bytes at the front of the answer that have been received before
  if (response.status === 200) known = state.received;
  else if (!response.headers.get("Content-Range")?.startsWith(`bytes ${state.received}-`))
    throw errorOf("protocol", `the server sends another range than from byte ${state.received} on`);
  if (response.body === null) return;
  const reader = response.body.getReader();
  try {
    for (;;) {
      const { done, value } = await reader.read().catch((error: unknown) => {
        throw lost(error);
      });
      if (done) return;
      const fresh = value.subarray(Math.min(known, value.length));
      known -= value.length - fresh.length;
      state.received += fresh.length;
      if (fresh.length > 0) yield fresh;
    }
  } finally {
    reader.cancel().catch(() => undefined); // whoever stops early wants no more of it
  }
}
