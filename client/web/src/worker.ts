/** The worker: fetches the decoder's files from beside this one. */
import { errorOf } from "./errors.js";
import { type Port, serve } from "./worker_service.js";

const ADDRESSES: Record<string, URL> = {
  "meshtide.wasm": new URL("./meshtide.wasm", import.meta.url),
  "meshtide-full.wasm": new URL("./meshtide-full.wasm", import.meta.url),
  "default.states": new URL("./default.states", import.meta.url),
  "high.states": new URL("./high.states", import.meta.url),
  "classic.states": new URL("./classic.states", import.meta.url),
};

const fetched = new Map<string, Promise<ArrayBuffer>>();

function file(name: string): Promise<ArrayBuffer> {
  let bytes = fetched.get(name);
  if (bytes === undefined) {
    bytes = fetchFile(ADDRESSES[name] as URL);
    bytes.catch(() => fetched.delete(name)); // what failed is tried again
    fetched.set(name, bytes);
  }
  return bytes;
}

async function fetchFile(address: URL): Promise<ArrayBuffer> {
  const response = await fetch(address).catch((error: Error) => {
    throw errorOf("network", `${address.pathname} of the decoder cannot be fetched: ${error.message}`);
  });
  if (!response.ok)
    throw errorOf("http", `${address.pathname} of the decoder: the server answers ${response.status}`, {
      status: response.status,
    });
  return response.arrayBuffer();
}

serve(self as unknown as Port, file);
