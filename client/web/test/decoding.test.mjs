import assert from "node:assert/strict";
import { createHash } from "node:crypto";
import { readFileSync } from "node:fs";
import { test } from "node:test";
import { Decoding, PREAMBLE_BYTES } from "../dist/decoding.js";
import { asked, files, golden } from "./package_files.mjs";

const LEVELS = JSON.parse(readFileSync(new URL("golden_levels.json", import.meta.url), "ascii"));

const digest = ({ positions, indices }) => createHash("sha256").update(positions).update(indices).digest("hex");

async function failure(bytes, limits) {
  const decoding = new Decoding(files, limits);
  const levels = [];
  try {
    const level = await decoding.push(bytes);
    if (level !== null) levels.push(level);
    decoding.end();
  } catch (error) {
    return { error, levels };
  }
  return { error: null, levels };
}

test("every golden stream decodes to the levels that Python decodes", async () => {
  assert.ok(Object.keys(LEVELS).length > 20);
  for (const [name, levels] of Object.entries(LEVELS)) {
    const decoding = new Decoding(files);
    await decoding.push(golden(name));
    decoding.end();
    const found = levels.map(([level]) => {
      const drawn = decoding.show(level);
      return [level, drawn.positions.length / 3, drawn.indices.length / 3, digest(drawn)];
    });
    assert.deepEqual(found, levels, name);
  }
});

test("pieces of any size give the same last level, and better and better ones before", async () => {
  for (const name of ["compact-dome-previews", "classic-bowl-power", "compact-twins-order"]) {
    const bytes = golden(name);
    for (const size of [1, 7, 64, bytes.length]) {
      const decoding = new Decoding(files);
      const levels = [];
      for (let first = 0; first < bytes.length; first += size) {
        const level = await decoding.push(bytes.slice(first, first + size));
        if (level !== null) levels.push(level);
      }
      decoding.end();
      const { level, rms, exact } = levels.at(-1);
      assert.deepEqual([level, rms, exact], [0, 0, true]);
      assert.equal(digest(levels.at(-1)), LEVELS[name].at(-1)[3]);
      if (size === 1) assert.ok(levels.length > 1);
      for (const [i, each] of levels.entries()) {
        assert.ok(i === 0 || each.rms <= levels[i - 1].rms);
        assert.deepEqual([each.vertices, each.faces], [each.positions.length / 3, each.indices.length / 3]);
        assert.equal(each.normals.length, each.positions.length);
      }
    }
  }
});

test("normals point where the faces do, and are as long as one", async () => {
  const decoding = new Decoding(files);
  const { positions, indices, normals } = await decoding.push(golden("compact-dome"));
  for (let vertex = 0; vertex < normals.length; vertex += 3)
    assert.ok(Math.abs(Math.hypot(...normals.subarray(vertex, vertex + 3)) - 1) < 1e-6);
  const corner = (i) => positions.subarray(3 * indices[i], 3 * indices[i] + 3);
  const [a, b, c] = [corner(0), corner(1), corner(2)];
  const up = (b[0] - a[0]) * (c[1] - a[1]) - (b[1] - a[1]) * (c[0] - a[0]);
  assert.ok(up !== 0);
  assert.equal(Math.sign(normals[3 * indices[0] + 2]), Math.sign(up));
});

test("a file cut at every byte is told, and shows its whole levels", async () => {
  for (const name of ["compact-bowl", "classic-bowl-power", "compact-scattered-1"]) {
    const bytes = golden(name);
    const whole = new Decoding(files);
    await whole.push(bytes);
    let end = bytes.length - whole.header.packets.reduce((sum, { length }) => sum + length, 0);
    const ends = [end, ...whole.header.packets.map(({ length }) => (end += length))];
    const first = ends[whole.header.states[0].packets];
    for (let length = 0; length < bytes.length; length++) {
      const { error, levels } = await failure(bytes.slice(0, length));
      assert.equal(error?.code, "cut", `${name}, ${length} bytes`);
      assert.equal(error.name, "CutError");
      assert.equal(error.place.offset, length);
      assert.equal(levels.length === 1, length >= first, `${name}, ${length} bytes`);
    }
  }
});

test("a flipped bit anywhere is told by name, and where it is", async () => {
  const bytes = golden("classic-tangle-power");
  const codes = new Set();
  for (let bit = 0; bit < 8 * bytes.length; bit += 5) {
    const damaged = bytes.slice();
    damaged[bit >> 3] ^= 1 << (bit & 7);
    const { error } = await failure(damaged);
    assert.ok(error !== null, `bit ${bit}`);
    codes.add(error.code);
    if (error.code === "damaged")
      assert.ok(error.place.offset <= Math.max(bit >> 3, PREAMBLE_BYTES), `bit ${bit}: ${error.message}`);
  }
  assert.deepEqual([...codes].sort(), ["cut", "damaged", "limit", "not-a-stream", "version"]);
});

test("a damaged packet leaves what came before, names itself, and every later call fails alike", async () => {
  const bytes = golden("compact-dome");
  bytes[bytes.length - 1] ^= 1;
  const decoding = new Decoding(files);
  const level = await decoding.push(bytes.slice(0, -1));
  assert.ok(level.level > 0 || !level.last);
  await assert.rejects(decoding.push(bytes.slice(-1)), (error) => {
    assert.equal(error.name, "StreamError");
    assert.equal(error.code, "damaged");
    assert.match(error.message, /^level \d+, (Diff|Map&Conn) packet, byte \d+: the checksum/);
    return true;
  });
  await assert.rejects(decoding.push(new Uint8Array(1)), { code: "damaged" });
  assert.throws(() => decoding.end(), { code: "damaged" });
});

test("other files and other versions are told", async () => {
  const other = await failure(new TextEncoder().encode("<!doctype html>"));
  assert.deepEqual([other.error.code, other.error.place.offset], ["not-a-stream", 0]);
  const newer = golden("compact-bowl");
  newer[8] = 5;
  assert.match((await failure(newer)).error.message, /format version 5, and this decoder reads 4/);
});

test("limits hold before memory is taken", async () => {
  const bytes = golden("compact-dome");
  for (const [name, limit] of Object.entries({
    vertices: 20,
    faces: 20,
    levels: 1,
    packets: 2,
    packetBytes: 9,
    memory: 999,
  })) {
    const { error } = await failure(bytes, { [name]: limit });
    assert.deepEqual([error?.name, error?.code], ["LimitError", "limit"], name);
    assert.match(error.message, name === "memory" ? /more memory than/ : new RegExp(`the limit is ${limit}$`), name);
  }
  const claims = bytes.slice();
  new DataView(claims.buffer).setUint32(10, 3e9, true);
  assert.match((await failure(claims)).error.message, /3000000000 of header_bytes/);
});

test("refinement stops where it is told to, and asks for no more bytes", async () => {
  const bytes = golden("compact-dome");
  const all = new Decoding(files);
  await all.push(bytes);
  const { states } = all.header;
  const middle = states[states.length >> 1];
  for (const until of [{ level: middle.level }, { error: middle.rms }, { bytes: bytes.length - 1 }]) {
    const decoding = new Decoding(files, {}, until);
    const level = await decoding.push(bytes.slice());
    decoding.end();
    assert.ok(decoding.complete);
    assert.ok(level.last);
    assert.ok(level.bytes < bytes.length, JSON.stringify(until));
    if (until.error !== undefined) assert.ok(level.rms <= until.error);
    if (until.level !== undefined) assert.ok(level.level <= until.level || level.rms <= middle.rms);
  }
});

test("trained states of effort high are fetched for its streams only", async () => {
  asked.length = 0;
  await failure(golden("compact-bowl"));
  assert.ok(!asked.includes("high.states"));
  await failure(golden("compact-bowl-high"));
  assert.ok(asked.includes("high.states"));
});

test("a hundred streams take no more memory than a few", async () => {
  const bytes = golden("compact-dome-previews");
  const decode = async () => {
    const decoding = new Decoding(files);
    await decoding.push(bytes.slice());
    decoding.end();
    return decoding.memoryBytes;
  };
  const size = await decode();
  assert.ok(size > 0 && size < 2 ** 24);
  for (let i = 0; i < 10; i++) await decode();
  globalThis.gc();
  const before = process.memoryUsage().rss;
  for (let i = 0; i < 100; i++) assert.equal(await decode(), size);
  globalThis.gc();
  const grown = process.memoryUsage().rss - before;
  assert.ok(grown < 20 * size, `${grown} bytes more`);
});
