// Runs WebAssembly in Node.
//
//   node run_wasm.mjs tests core_tests.wasm      the tests, then each body that must fail in an instance of its own
//   node run_wasm.mjs interface meshtide.wasm    the core itself: it imports nothing, and its self-check holds
import assert from "node:assert/strict";
import { execFileSync } from "node:child_process";
import { readFileSync } from "node:fs";
import { WASI } from "node:wasi";

const [, program, what, path, body] = process.argv;
const module = await WebAssembly.compile(readFileSync(path));
const text = (memory, from) => {
    const bytes = new Uint8Array(memory.buffer, from);
    return new TextDecoder().decode(bytes.subarray(0, bytes.indexOf(0)));
};

if (what === "interface") {
    assert.deepEqual(WebAssembly.Module.imports(module), []);
    const { exports: core } = await WebAssembly.instantiate(module, {});
    core._initialize();
    const header = readFileSync(new URL("../include/meshtide.h", import.meta.url), "utf8");
    const expected = BigInt(header.match(/MT_SELF_CHECK UINT64_C\((0x[0-9a-f]+)\)/)[1]);
    assert.equal(BigInt.asUintN(64, core.mt_self_check()), expected);
    assert.equal(text(core.memory, core.mt_kind()), "baseline");
    console.log(`1 passed, 0 failed: ${Object.keys(core).join(" ")}`);
} else if (what === "tests") {
    const output = execFileSync(process.execPath, ["--no-warnings", program, "body", path, "-1"], { encoding: "utf8" });
    process.stdout.write(output);
    const bodies = Number(output.match(/(\d+) bodies must fail/)[1]);
    assert.ok(bodies > 0);
    for (let i = 0; i < bodies; i++) {
        const told = execFileSync(process.execPath, ["--no-warnings", program, "body", path, String(i)], {
            encoding: "utf8",
        });
        const [, expected] = told.match(/must fail with (\d+)/);
        assert.match(told, new RegExp(`^trapped with ${expected}$`, "m"), told);
    }
    console.log(`${bodies} passed, 0 failed`);
} else {
    const list = body === "-1" ? [] : ["--fails", body];
    const wasi = new WASI({ version: "preview1", args: ["core_tests", ...list], env: {}, returnOnExit: true });
    const instance = await WebAssembly.instantiate(module, wasi.getImportObject());
    try {
        process.exitCode = wasi.start(instance);
    } catch (error) {
        if (!(error instanceof WebAssembly.RuntimeError)) throw error;
        const { memory, mt_last_failure: failure } = instance.exports;
        console.log(`trapped with ${new DataView(memory.buffer).getInt32(failure.value, true)}`);
    }
}
