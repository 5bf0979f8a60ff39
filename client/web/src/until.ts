import type { Header } from "./core.js";
import { errorOf } from "./errors.js";

/** Where refinement stops; of several bounds the one that is reached first. */
export interface Until {
  /** The last state of this level, or of the next finer one that has any. */
  readonly level?: number;
  /** Bytes of the file. */
  readonly bytes?: number;
  /** RMS distance from the finest mesh, as a share of the diagonal of its box. */
  readonly error?: number;
}

/** How many packets, from the first, a bound asks for. `start`: bytes in front of the first packet. */
export function duePackets(header: Header, start: number, until: Until): number {
  let due = header.packets.length;
  const lower = (packets: number | undefined) => {
    if (packets !== undefined) due = Math.min(due, packets);
  };
  const { level, bytes, error } = until;
  if (level !== undefined) {
    if (level < 0) throw errorOf("malformed", `a stream has no level ${level}`);
    const own = header.states.filter((state) => state.level === level).at(-1);
    lower((own ?? header.states.find((state) => state.level < level))?.packets);
  }
  if (error !== undefined) lower(header.states.find((state) => state.rms <= error)?.packets);
  if (bytes !== undefined) {
    let end = start;
    const whole = header.packets.findIndex((packet) => {
      end += packet.length;
      return end > bytes;
    });
    if (whole >= 0) lower(whole);
  }
  return due;
}
