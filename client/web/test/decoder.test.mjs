import assert from "node:assert/strict";
import { test } from "node:test";
import { CutError, Decoder, LimitError, MeshtideError, StreamError } from "../dist/decoder.js";
import { connect, golden } from "./package_files.mjs";

test("levels come through the port, transferred, with the header once", async () => {
  const { connection, close } = connect();
  const decoder = new Decoder({ connection });
  const bytes = golden("compact-dome");
  const half = bytes.slice(0, bytes.length >> 1);
  const first = await decoder.push(half);
  assert.equal(half.byteLength, 0, "its buffer was transferred");
  assert.equal(first.header.profile, "compact");
  assert.equal(first.complete, false);
  assert.ok(first.level.positions instanceof Float32Array);
  const second = await decoder.push(bytes.slice(bytes.length >> 1));
  assert.equal(second.header, null);
  assert.deepEqual([second.complete, second.level.level, second.level.last], [true, 0, true]);
  await decoder.end();
  decoder.dispose();
  close();
});

test("pushes that are not waited for are answered in their order", async () => {
  const { connection, close } = connect();
  const decoder = new Decoder({ connection });
  const bytes = golden("compact-bowl");
  const calls = [];
  for (let first = 0; first < bytes.length; first += 50) calls.push(decoder.push(bytes.slice(first, first + 50)));
  const levels = (await Promise.all(calls)).map(({ level }) => level).filter((level) => level !== null);
  assert.ok(levels.length > 1);
  assert.equal(levels.at(-1).level, 0);
  assert.deepEqual(
    levels.map(({ bytes }) => bytes),
    levels.map(({ bytes }) => bytes).sort((a, b) => a - b),
  );
  close();
});

test("errors keep their class, code and place on the way, and end one stream only", async () => {
  const { connection, close } = connect();
  const [broken, limited, cut, sound] = [{}, { limits: { vertices: 9 } }, {}, {}].map(
    (options) => new Decoder({ ...options, connection }),
  );
  const damaged = golden("compact-bowl");
  damaged[damaged.length - 1] ^= 4;
  await assert.rejects(broken.push(damaged), (error) => {
    assert.ok(error instanceof StreamError && error instanceof MeshtideError);
    assert.equal(error.code, "damaged");
    assert.equal(typeof error.place.level, "number");
    return true;
  });
  await assert.rejects(limited.push(golden("compact-bowl")), LimitError);
  await cut.push(golden("compact-bowl").slice(0, 99));
  await assert.rejects(cut.end(), CutError);
  assert.equal((await sound.push(golden("compact-bowl"))).level.level, 0);
  close();
});

test("what was disposed of fails, waiting calls too", async () => {
  const { connection, close } = connect();
  const decoder = new Decoder({ connection });
  const waiting = decoder.push(golden("compact-bowl"));
  decoder.dispose();
  decoder.dispose();
  await assert.rejects(waiting, { code: "disposed" });
  await assert.rejects(decoder.push(new Uint8Array(1)), { code: "disposed" });
  close();
});

test("a worker that ends fails every call, now and later", async () => {
  const { connection, close } = connect();
  const decoder = new Decoder({ connection });
  const waiting = decoder.push(golden("compact-bowl"));
  connection.break("the worker cannot run");
  await assert.rejects(waiting, { code: "wasm", message: "the worker cannot run" });
  await assert.rejects(decoder.end(), { code: "wasm" });
  close();
});
