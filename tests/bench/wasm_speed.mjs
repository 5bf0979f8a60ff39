// Called by wasm_speed.py: decodes a stream as often as asked, and tells the seconds of the quickest and the first run.
import {readFileSync} from "node:fs";

const [, , repository, file, runs] = process.argv;
const {Core, Decoder, moduleFor, splitFile} = await import(`${repository}/codec/core/tests/wasm_decoder.mjs`);
const states = which =>
    readFileSync(`${repository}/codec/meshtide_codec/states/${["default", "high", "classic"][which]}.states`);
const compile = name => WebAssembly.compile(readFileSync(`${repository}/codec/core/wasm/${name}`));
const data = readFileSync(file), core = new Core(await moduleFor(splitFile(data).header, compile));
const processorSeconds = () => {
    const {user, system} = process.cpuUsage();
    return (user + system) / 1e6;
};
let least = Infinity, first = null;
for (let run = 0; run < Number(runs); run++) {
    const start = processorSeconds(), clock = performance.now();
    const {header, rest} = splitFile(data), decoder = new Decoder(core, header, states);
    decoder.pushAll(rest);
    decoder.show(0);
    decoder.free();
    least = Math.min(least, processorSeconds() - start);
    first ??= (performance.now() - clock) / 1000;
}
console.log(JSON.stringify({least, first}));
