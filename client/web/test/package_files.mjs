// What the tests have in common: the built package's files, golden streams, and a worker without a thread of its own.
import { readFile, readFileSync } from "node:fs";
import { promisify } from "node:util";
import { Connection } from "../dist/decoder.js";
import { serve } from "../dist/worker_service.js";

const DIST = new URL("../dist/", import.meta.url);
const GOLDEN = new URL("../../../tests/golden/", import.meta.url);

export const asked = []; // names of the files that were fetched

export async function files(name) {
  asked.push(name);
  return promisify(readFile)(new URL(name, DIST));
}

export const golden = (name) => new Uint8Array(readFileSync(new URL(`${name}.tide`, GOLDEN)));

/** A connection to a service on the other end of a channel, and what ends both. */
export function connect() {
  const { port1, port2 } = new MessageChannel();
  serve(port2, files);
  return { connection: new Connection(port1), close: () => port1.close() };
}
