// Runs WebAssembly in Node.
//
//   node run_wasm.mjs tests core_tests.wasm         the tests
//   node run_wasm.mjs decoder meshtide.wasm BYTES   what the file is: at most so many, compressed; without imports
//   node run_wasm.mjs decode meshtide.wasm STATES   requests from the input, answers to the output, JSON in lines
//
// A request names a file, and may limit what its header claims: {"file": "a.tide", "limits": {"vertices": 9}}. The
// answer lists each level as [level, vertices, faces, SHA-256 of positions and faces], or tells the error.
import assert from "node:assert/strict";
import {createHash} from "node:crypto";
import {readFileSync} from "node:fs";
import {createInterface} from "node:readline";
import {gzipSync} from "node:zlib";

import {Core, CoreError, Decoder, splitFile} from "./wasm_decoder.mjs";

const NOT_SUPPORTED = 58; // WASI's errno
const [, , what, path, argument] = process.argv;
const bytes = readFileSync(path), module = await WebAssembly.compile(bytes);

if (what === "decoder") {
    assert.deepEqual(WebAssembly.Module.imports(module), []);
    const size = gzipSync(bytes, {level : 9}).length;
    assert.ok(size <= Number(argument), `${size} bytes compressed`);
    const core = new Core(module);
    core.exports.free(core.exports.malloc(1 << 20));
    assert.notEqual(core.states, 0);
    const names = WebAssembly.Module.exports(module).map(each => each.name);
    console.log(`1 passed, 0 failed: ${bytes.length} bytes, ${size} compressed: ${names.join(" ")}`);
} else if (what === "decode") {
    const load = which => readFileSync(`${argument}/${["default", "high", "classic"][which]}.states`);
    const digest = shown => createHash("sha256").update(shown.positions).update(shown.faces).digest("hex");
    for await (const line of createInterface({input : process.stdin})) {
        const {file, limits} = JSON.parse(line), answer = {levels : [], error : null};
        try {
            const {header, rest} = splitFile(readFileSync(file));
            const decoder = new Decoder(new Core(module, limits), header, load);
            decoder.pushAll(rest);
            for (const level of decoder.available()) {
                const shown = decoder.show(level);
                answer.levels.push([ level, shown.positions.length / 3, shown.faces.length / 3, digest(shown) ]);
            }
            decoder.free();
        } catch (error) {
            if (!(error instanceof CoreError)) throw error;
            const {fault, packet, offset} = error;
            answer.error = {fault, text : error.message, offset, packet : packet && [ packet.kind, packet.level ]};
        }
        console.log(JSON.stringify(answer));
    }
} else if (what === "tests") {
    let instance;
    const view = () => new DataView(instance.exports.memory.buffer);
    // How a body of check_fails (tests/check.hpp) ends: the fault, 0 where it does not fail.
    const attempt = (call, body) => {
        const {__stack_pointer : stack, __indirect_function_table : table, mt_last_failure : failure} = instance.exports;
        const before = stack.value;
        try {
            table.get(call)(body);
            return 0;
        } catch (error) {
            if (!(error instanceof WebAssembly.RuntimeError)) throw error;
            stack.value = before;
            return view().getInt32(failure.value, true);
        }
    };
    const texts = new TextDecoder();
    const system = {
        args_sizes_get(count, size) {
            view().setUint32(count, 0, true);
            view().setUint32(size, 0, true);
            return 0;
        },
        args_get : () => 0,
        fd_write(_file, parts, count, written) {
            let sum = 0;
            for (let i = 0; i < count; i++) {
                const at = view().getUint32(parts + 8 * i, true), size = view().getUint32(parts + 8 * i + 4, true);
                process.stdout.write(texts.decode(new Uint8Array(view().buffer, at, size), {stream : true}));
                sum += size;
            }
            view().setUint32(written, sum, true);
            return 0;
        },
        fd_fdstat_get : () => NOT_SUPPORTED,
        fd_seek : () => NOT_SUPPORTED,
        fd_close : () => 0,
        proc_exit(code) { process.exit(code); },
    };
    instance = new WebAssembly.Instance(module, {tests : {attempt}, wasi_snapshot_preview1 : system});
    instance.exports._start();
}
