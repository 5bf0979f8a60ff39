// The decoder of meshtide.wasm or meshtide-full.wasm, called from JavaScript as a browser does it: streams, levels,
// failures.
//
// What fails ends the instance: it traps, and mt_last_failure says why. Then the error is thrown, and every later call
// throws it again; whoever wants to go on makes another Core, which costs no compilation.
const FAULTS = [ "none", "malformed", "limit", "memory", "argument", "version", "internal", "unsupported" ];
const MAGIC = [ 0x89, 0x54, 0x49, 0x44, 0x45, 0x0d, 0x0a, 0x1a ];
const PREAMBLE_BYTES = 18;
const ORDER = 5; // the kind of packet that tells what is of no use to a viewer

// The fields of mt_limits in their order, and what they are where the caller says nothing.
export const LIMITS = {
    vertices : 2 ** 26,
    faces : 2 ** 27,
    levels : 64,
    packets : 2 ** 16,
    headerBytes : 2 ** 24,
    packetBytes : 2 ** 30,
    memory : 2 ** 31,
    verticesPerByte : 2 ** 12,
    facesPerByte : 2 ** 13,
};

const CRC = Uint32Array.from({length : 256}, (_, byte) => {
    for (let bit = 0; bit < 8; bit++) byte = byte & 1 ? byte >>> 1 ^ 0xedb88320 : byte >>> 1;
    return byte;
});
const crc32 = bytes => ~bytes.reduce((crc, byte) => crc >>> 8 ^ CRC[(crc ^ byte) & 255], ~0) >>> 0;

// fault: one of FAULTS; packet: what was being pushed, or null; offset: a byte of it or of the header, or null.
export class CoreError extends Error {
    constructor(failure, packet = null) {
        super(failure.text);
        Object.assign(this, failure, {packet});
    }
}

export class Core {
    // module: compiled from either file, by which many instances can be made.
    constructor(module, limits = {}) {
        this.exports = new WebAssembly.Instance(module, {}).exports;
        this.exports._initialize();
        this.states = this.exports.mt_states_new();
        this.room = this.exports.malloc(128); // for what functions return through pointers, then the limits
        this.limits = this.room + 48;
        Object.values({...LIMITS, ...limits})
            .forEach((limit, i) => this.view().setBigUint64(this.limits + 8 * i, BigInt(limit), true));
        this.error = null;
        this.loaded = new Set();
    }

    view() { return new DataView(this.exports.memory.buffer); } // anew after each call: the memory grows
    text(from) {
        const bytes = new Uint8Array(this.exports.memory.buffer, from);
        return new TextDecoder().decode(bytes.subarray(0, bytes.indexOf(0)));
    }

    call(packet, name, ...values) {
        if (this.error !== null) throw this.error;
        try {
            return this.exports[name](...values);
        } catch (error) {
            if (!(error instanceof WebAssembly.RuntimeError)) throw error;
            this.error = new CoreError(this.failure(error), packet);
            throw this.error;
        }
    }
    failure(trap) {
        const view = this.view(), at = this.exports.mt_last_failure.value;
        const fault = view.getInt32(at, true);
        if (fault === 0) return {fault : "internal", text : `a trap without a reason: ${trap.message}`, offset : null};
        const offset = view.getBigInt64(at + 8, true);
        return {
            fault : FAULTS[fault],
            text : this.text(view.getUint32(at + 4, true)),
            offset : offset < 0n ? null : Number(offset),
            claimed : view.getBigUint64(at + 16, true),
            allowed : view.getBigUint64(at + 24, true),
        };
    }

    // Calls `work(pointer, size)` with bytes that stand in the core's memory meanwhile.
    lend(bytes, work) {
        const pointer = this.call(null, "malloc", bytes.length);
        if (pointer === 0)
            throw new CoreError({fault : "memory", text : "the system has no memory left", offset : null});
        new Uint8Array(this.exports.memory.buffer).set(bytes, pointer);
        work(pointer, BigInt(bytes.length));
        this.exports.free(pointer);
    }

    // The stream of a header, by its bytes.
    parse(header) {
        this.lend(header,
                  (pointer, size) => this.call(null, "mt_stream_parse", pointer, size, this.limits, this.room, 0));
        return this.view().getUint32(this.room, true);
    }

    // which: 0 effort default, which a stream with previews needs too; 1 effort high; 2 profile classic.
    loadStates(which, bytes) {
        this.lend(bytes, (pointer, size) => this.call(null, "mt_states_load", this.states, which, pointer, size, 0));
    }
    need(which, load) {
        if (!this.loaded.has(which)) this.loadStates(which, load(which));
        this.loaded.add(which);
    }
}

// The module that decodes the stream of a header: the smaller one, unless that refuses it. compile(name): of a file.
export async function moduleFor(header, compile) {
    const module = await compile("meshtide.wasm");
    try {
        new Core(module).parse(header);
    } catch (error) {
        if (error.fault !== "unsupported") throw error;
        return compile("meshtide-full.wasm");
    }
    return module;
}

// The header and the packets of a .tide file; packets that are not whole are left out.
export function splitFile(bytes) {
    const view = new DataView(bytes.buffer, bytes.byteOffset, bytes.byteLength);
    const damaged = text => new CoreError({fault : "malformed", text, offset : 0});
    if (bytes.length < PREAMBLE_BYTES || MAGIC.some((byte, i) => bytes[i] !== byte)) throw damaged("not a .tide file");
    const length = view.getUint32(10, true);
    const header = bytes.subarray(PREAMBLE_BYTES, PREAMBLE_BYTES + length);
    if (header.length < length || crc32(header) !== view.getUint32(14, true))
        throw damaged("the header is not whole, or damaged");
    return {header, rest : bytes.subarray(PREAMBLE_BYTES + length)};
}

// Decodes one stream.
export class Decoder {
    // header: its bytes; load(which): the bytes of trained states.
    constructor(core, header, load) {
        this.core = core;
        this.stream = core.parse(header);
        const fields = core.exports.mt_stream_header(this.stream), view = core.view();
        const needed = view.getInt32(fields, true) === 0 ? [ 2 ] : [ 0, view.getInt32(fields + 72, true) ];
        const packets = view.getUint32(fields + 40, true);
        this.packets = Array.from({length : Number(view.getBigUint64(fields + 48, true))},
                                  (_, i) => ({
                                      length : Number(view.getBigUint64(packets + 16 * i, true)),
                                      checksum : view.getUint32(packets + 16 * i + 8, true),
                                      slice : view.getUint16(packets + 16 * i + 12, true),
                                      level : view.getUint8(packets + 16 * i + 14),
                                      kind : view.getUint8(packets + 16 * i + 15),
                                  }));
        for (const which of new Set(needed)) core.need(which, load);
        core.call(null, "mt_decoder_new", this.stream, core.limits, core.states, core.room, 0);
        this.decoder = core.view().getUint32(core.room, true);
    }

    // Takes the packet of a row of the header's table.
    push(index, payload) {
        const packet = this.packets[index];
        if (payload.length !== packet.length || crc32(payload) !== packet.checksum)
            throw new CoreError({fault : "malformed", text : "the packet is damaged", offset : 0}, packet);
        const {kind, level, slice} = packet;
        this.core.lend(payload, (pointer, size) => this.core.call(packet, "mt_decoder_push", this.decoder, kind, level,
                                                                  slice, pointer, size, 0));
    }
    // Takes all whole packets of a file, behind its header, that are wanted.
    pushAll(rest, wanted = packet => packet.kind !== ORDER) {
        let first = 0;
        for (const [index, packet] of this.packets.entries()) {
            const payload = rest.subarray(first, first + packet.length);
            first += packet.length;
            if (payload.length === packet.length && wanted(packet)) this.push(index, payload);
        }
    }

    // Numbers of the levels that can be shown.
    available() {
        const levels = BigInt.asUintN(64, this.core.call(null, "mt_decoder_available", this.decoder));
        return Array.from({length : 64}, (_, level) => level).filter(level => levels >> BigInt(level) & 1n);
    }
    // What is drawn of a level; lent until the next call.
    show(level) {
        const {core} = this;
        core.call(null, "mt_decoder_show", this.decoder, level, core.room, 0);
        const view = core.view(), {buffer} = core.exports.memory;
        const count = at => Number(view.getBigUint64(core.room + at, true));
        return {
            positions : new Float64Array(buffer, view.getUint32(core.room, true), 3 * count(8)),
            faces : new Int32Array(buffer, view.getUint32(core.room + 16, true), 3 * count(24)),
        };
    }

    free() {
        this.core.call(null, "mt_decoder_free", this.decoder);
        this.core.call(null, "mt_stream_free", this.stream);
    }
}
