/** The few kinds of msgpack values that messages consist of. */
import { errorOf } from "./errors.js";

export type Value = null | boolean | number | string | Uint8Array | readonly Value[];
/** A number that is always written as a double. */
export class Double {
  constructor(readonly value: number) {}
}
export type Written = Value | Double | readonly Written[];

const LARGEST_WORD = 0xffffffff;
const DEEPEST = 4;

export function pack(value: Written): Uint8Array {
  const bytes: number[] = [];
  write(value, bytes);
  return Uint8Array.from(bytes);
}

function write(value: Written, to: number[]): void {
  if (value === null) to.push(0xc0);
  else if (value instanceof Double) to.push(0xcb, ...big(8, (view) => view.setFloat64(0, value.value)));
  else if (typeof value === "boolean") to.push(value ? 0xc3 : 0xc2);
  else if (typeof value === "number") {
    if (value < 128) to.push(value);
    else if (value <= LARGEST_WORD) to.push(0xce, ...big(4, (view) => view.setUint32(0, value)));
    else to.push(0xcf, ...big(8, (view) => view.setBigUint64(0, BigInt(value))));
  } else if (typeof value === "string") {
    const text = new TextEncoder().encode(value);
    to.push(0xda, ...big(2, (view) => view.setUint16(0, text.length)), ...text);
  } else if (value instanceof Uint8Array) to.push(0xc4, value.length, ...value);
  else {
    to.push(0x90 + (value as readonly Written[]).length);
    for (const each of value as readonly Written[]) write(each, to);
  }
}

function big(size: number, fill: (view: DataView) => void): Uint8Array {
  const bytes = new Uint8Array(size);
  fill(new DataView(bytes.buffer));
  return bytes;
}

/** The one value in the bytes of a stranger. */
export function unpack(bytes: Uint8Array): Value {
  const view = new DataView(bytes.buffer, bytes.byteOffset, bytes.byteLength);
  const bad = () => errorOf("protocol", "the server sends a message that is none");
  let at = 0;
  const next = (size: number) => {
    at += size;
    if (at > bytes.length) throw bad();
    return at - size;
  };
  const bin = (size: number) => {
    const start = next(size);
    return bytes.subarray(start, start + size);
  };
  const str = (size: number) => new TextDecoder().decode(bin(size));
  const whole = (value: bigint) => {
    if (value > BigInt(Number.MAX_SAFE_INTEGER)) throw bad();
    return Number(value);
  };
  const read = (depth: number): Value => {
    if (depth > DEEPEST) throw bad();
    const type = view.getUint8(next(1));
    if (type < 0x80) return type;
    if (type >= 0x90 && type < 0xa0) return Array.from({ length: type & 15 }, () => read(depth + 1));
    if (type >= 0xa0 && type < 0xc0) return str(type & 31);
    switch (type) {
      case 0xc0:
        return null;
      case 0xc2:
      case 0xc3:
        return type === 0xc3;
      case 0xc4:
        return bin(view.getUint8(next(1)));
      case 0xc5:
        return bin(view.getUint16(next(2)));
      case 0xc6:
        return bin(view.getUint32(next(4)));
      case 0xcc:
        return view.getUint8(next(1));
      case 0xcd:
        return view.getUint16(next(2));
      case 0xce:
        return view.getUint32(next(4));
      case 0xcf:
        return whole(view.getBigUint64(next(8)));
      case 0xd9:
        return str(view.getUint8(next(1)));
      case 0xda:
        return str(view.getUint16(next(2)));
      default:
        throw bad();
    }
  };
  const value = read(0);
  if (at !== bytes.length) throw bad();
  return value;
}
