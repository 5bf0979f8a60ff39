/** The largest claims of a stream that are accepted, before memory is taken for them. */
export interface Limits {
  /** Of one level. */
  readonly vertices: number;
  readonly faces: number;
  readonly levels: number;
  readonly packets: number;
  readonly headerBytes: number;
  readonly packetBytes: number;
  /** Bytes that decoding takes. */
  readonly memory: number;
  /** Of a level beyond 65536, by the bytes that tell of it. */
  readonly verticesPerByte: number;
  /** Beyond 131072. */
  readonly facesPerByte: number;
}

/** In the order of mt_limits. Memory is what a page may take beside others; the rest is as for other decoders. */
export const LIMITS: Limits = {
  vertices: 2 ** 26,
  faces: 2 ** 27,
  levels: 64,
  packets: 2 ** 16,
  headerBytes: 2 ** 24,
  packetBytes: 2 ** 30,
  memory: 2 ** 29,
  verticesPerByte: 2 ** 12,
  facesPerByte: 2 ** 13,
};
