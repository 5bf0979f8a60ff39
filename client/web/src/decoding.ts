/**
 * From the bytes of a .tide file, in pieces of any size, to levels (docs/format.md, 1). It neither fetches nor waits
 * but for the files of the package.
 */
import { type Core, coreFor, type Files, type Header, KINDS, ORDER, type Packet, type State } from "./core.js";
import { crc32 } from "./crc32.js";
import { errorOf, MeshtideError } from "./errors.js";
import { LIMITS, type Limits } from "./limits.js";
import { vertexNormals } from "./normals.js";
import { duePackets, type Until } from "./until.js";

const MAGIC = [0x89, 0x54, 0x49, 0x44, 0x45, 0x0d, 0x0a, 0x1a];
const VERSION = 4;
export const PREAMBLE_BYTES = 18;

/** A mesh that can be drawn, and how good it is. */
export interface Level {
  readonly level: number;
  /** Three coordinates for each vertex, in the unit of the input. */
  readonly positions: Float32Array;
  readonly normals: Float32Array;
  /** Three vertices for each face. */
  readonly indices: Uint32Array;
  readonly vertices: number;
  readonly faces: number;
  /** Distances from the finest mesh, as shares of the diagonal of its box. */
  readonly rms: number;
  readonly maximum: number;
  /** Whether it is as the encoder made it. */
  readonly exact: boolean;
  /** Of the file, that it took. */
  readonly bytes: number;
  /** Whether this is the finest level, or the last one that `until` asks for. */
  readonly last: boolean;
}

export class Decoding {
  header: Header | undefined;
  /** Bytes of the file up to the last packet that is due; 0 before the header is there. */
  dueBytes = 0;
  #core: Core | undefined;
  #failed: MeshtideError | undefined;
  #pieces: Uint8Array[] = [];
  #waiting = 0; // bytes of the pieces
  #taken = 0; // bytes of the file that are decoded
  #headerBytes = -1; // not known before the preamble is there
  #checksum = 0;
  #next = 0; // packet
  #due = Number.POSITIVE_INFINITY;
  #shown: State | undefined;

  constructor(
    private readonly files: Files,
    private readonly limits: Partial<Limits> = {},
    private readonly until: Until = {},
  ) {}

  /** Whether all packets that are due have been decoded. */
  get complete(): boolean {
    return this.header !== undefined && this.#next >= this.#due;
  }

  /** Bytes of the decoder's memory. */
  get memoryBytes(): number {
    return this.#core?.memoryBytes ?? 0;
  }

  /** Takes the next bytes of the file; gives the best level if they made a better one. */
  async push(bytes: Uint8Array): Promise<Level | null> {
    if (this.#failed !== undefined) throw this.#failed;
    try {
      if (this.complete) return null; // no more was asked for
      this.#pieces.push(bytes);
      this.#waiting += bytes.length;
      if (this.header === undefined && !(await this.#readHeader())) return null;
      this.#readPackets();
      return this.#better();
    } catch (error) {
      if (error instanceof MeshtideError) this.#failed = error;
      throw error;
    }
  }

  /** To be called where the bytes end: tells a file that was cut off. */
  end(): void {
    if (this.#failed !== undefined) throw this.#failed;
    if (this.complete) return;
    const offset = this.#taken + this.#waiting;
    if (this.header === undefined) throw errorOf("cut", "the file ends within its header", { offset });
    const missing = this.#due - this.#next;
    throw errorOf("cut", `the file ends early: ${missing} of ${this.#due} packets are missing`, { offset });
  }

  /** Draws a level that is available, or null. */
  show(level: number): Pick<Level, "positions" | "indices"> | null {
    const core = this.#core as Core;
    const { bits, origin, extent } = this.header as Header;
    if (!core.isAvailable(level)) return null;
    const shown = this.#locate({ level }, 0, () => core.show(level));
    const positions = new Float32Array(shown.positions.length);
    const step = extent / (2 ** bits - 1);
    for (let i = 0; i < positions.length; i += 3)
      for (let axis = 0; axis < 3; axis++)
        positions[i + axis] = (shown.positions[i + axis] as number) * step + (origin[axis] as number);
    if (!positions.every(Number.isFinite))
      throw errorOf("malformed", "its positions are not finite; the stream is damaged", { level });
    return { positions, indices: Uint32Array.from(shown.faces) };
  }

  async #readHeader(): Promise<boolean> {
    if (this.#headerBytes < 0) {
      const preamble = this.#peek(Math.min(PREAMBLE_BYTES, this.#waiting));
      if (MAGIC.some((byte, i) => i < preamble.length && preamble[i] !== byte))
        throw errorOf("not-a-stream", "this is no .tide file: it begins with other bytes", { offset: 0 });
      const view = new DataView(preamble.buffer);
      if (preamble.length >= 10 && view.getUint16(8, true) !== VERSION) {
        const version = view.getUint16(8, true);
        throw errorOf("version", `the stream is of format version ${version}, and this decoder reads ${VERSION}`, {
          offset: 8,
        });
      }
      if (preamble.length < PREAMBLE_BYTES) return false;
      this.#headerBytes = view.getUint32(10, true);
      this.#checksum = view.getUint32(14, true);
      const allowed = this.limits.headerBytes ?? LIMITS.headerBytes;
      if (this.#headerBytes > allowed)
        throw errorOf("limit", `the stream claims ${this.#headerBytes} of header_bytes, and the limit is ${allowed}`, {
          offset: 10,
        });
      this.#take(PREAMBLE_BYTES);
    }
    if (this.#waiting < this.#headerBytes) return false;
    const bytes = this.#take(this.#headerBytes);
    if (crc32(bytes) !== this.#checksum)
      throw errorOf("damaged", "the checksum of the header is not that of its bytes", { offset: PREAMBLE_BYTES });
    const core = await this.#locateLater(PREAMBLE_BYTES, () => coreFor(bytes, this.files, this.limits));
    const header = core.header();
    await this.#locateLater(PREAMBLE_BYTES, () => core.start(header, this.files));
    this.#due = duePackets(header, this.#taken, this.until);
    this.dueBytes = header.packets.slice(0, this.#due).reduce((sum, { length }) => sum + length, this.#taken);
    this.#core = core;
    this.header = header;
    return true;
  }

  #readPackets(): void {
    const { packets } = this.header as Header;
    for (; this.#next < this.#due; this.#next++) {
      const packet = packets[this.#next] as Packet;
      if (this.#waiting < packet.length) return;
      const start = this.#taken;
      const payload = this.#take(packet.length);
      const { level, slice, kind } = packet;
      const place = { kind: KINDS[kind] as string, level, slice };
      if (crc32(payload) !== packet.checksum)
        throw errorOf("damaged", "the checksum of the packet is not that of its bytes", { ...place, offset: start });
      if (kind !== ORDER) this.#locate(place, start, () => (this.#core as Core).push(packet, payload));
    }
    this.#pieces = []; // what follows was not asked for
    this.#waiting = 0;
  }

  /** The best of the states that are complete, if it was not shown yet. */
  #better(): Level | null {
    const { states } = this.header as Header;
    const complete = states.filter((state) => state.packets <= this.#next);
    const best = complete.reduce<State | undefined>(
      (found, state) => (found === undefined || rank(state) <= rank(found) ? state : found),
      undefined,
    );
    if (best === undefined || best === this.#shown) return null;
    const drawn = this.show(best.level);
    if (drawn === null) throw errorOf("malformed", "a state of the header is not there after its packets", best);
    this.#shown = best;
    const { level, vertices, faces, rms, maximum } = best;
    const last = this.complete;
    const exact = (this.#core as Core).isExact(level);
    const normals = vertexNormals(drawn.positions, drawn.indices);
    return { ...drawn, normals, level, vertices, faces, rms, maximum, exact, bytes: this.#taken, last };
  }

  #locate<Result>(place: { level: number }, start: number, work: () => Result): Result {
    try {
      return work();
    } catch (error) {
      throw located(error, place, start);
    }
  }

  async #locateLater<Result>(start: number, work: () => Promise<Result>): Promise<Result> {
    try {
      return await work();
    } catch (error) {
      throw located(error, {}, start);
    }
  }

  /** The first bytes of what waits, in an array of their own. */
  #peek(size: number): Uint8Array {
    const bytes = new Uint8Array(size);
    let filled = 0;
    for (const piece of this.#pieces) {
      if (filled === size) break;
      const part = piece.subarray(0, size - filled);
      bytes.set(part, filled);
      filled += part.length;
    }
    return bytes;
  }

  #take(size: number): Uint8Array {
    const bytes = this.#peek(size);
    let left = size;
    while (left > 0) {
      const piece = this.#pieces[0] as Uint8Array;
      if (piece.length > left) this.#pieces[0] = piece.subarray(left);
      else this.#pieces.shift();
      left -= Math.min(left, piece.length);
    }
    this.#waiting -= size;
    this.#taken += size;
    return bytes;
  }
}

/** By which states are compared, the better the less: only level 0 is the finest mesh, whatever another one claims. */
function rank(state: State): number {
  return state.level > 0 && state.rms === 0 ? Number.POSITIVE_INFINITY : state.rms;
}

function located(error: unknown, place: object, start: number): unknown {
  if (!(error instanceof MeshtideError)) return error;
  const { offset } = error.place;
  return errorOf(error.code, error.reason, {
    ...place,
    ...error.place,
    ...(offset === undefined ? {} : { offset: start + offset }),
  });
}
