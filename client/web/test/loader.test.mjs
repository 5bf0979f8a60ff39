import assert from "node:assert/strict";
import { once } from "node:events";
import { createServer } from "node:http";
import { after, before, test } from "node:test";
import { WebSocket } from "ws";
import { MeshtideLoader } from "../dist/loader.js";
import { connect, golden } from "./package_files.mjs";
import { startRelay, startServer } from "./servers.mjs";

globalThis.WebSocket = WebSocket; // the same for every version of Node

const NAME = "compact-dome-previews";
const ADDRESSES = [`/meshes/${NAME}.tide`, `/meshes/${NAME}`];
let server;
let worker;

before(async () => {
  server = await startServer();
  worker = connect();
});
after(async () => {
  worker.close();
  await server.stop();
});

function loader(options = {}) {
  return Object.assign(new MeshtideLoader(), { connection: worker.connection, ...options });
}

/** Answers every request with the bytes, in two pieces, the second of which `release` lets go. */
async function startFile(bytes, { status = 200, pause = bytes.length } = {}) {
  let release;
  const released = new Promise((resolve) => {
    release = resolve;
  });
  const file = createServer(async (_, answer) => {
    answer.writeHead(status);
    answer.write(bytes.subarray(0, pause));
    if (pause < bytes.length) await released;
    answer.end(bytes.subarray(pause));
  });
  file.listen(0, "127.0.0.1");
  await once(file, "listening");
  const stop = () => {
    release();
    file.closeAllConnections();
    file.close();
  };
  return { url: `http://127.0.0.1:${file.address().port}/a.tide`, release, stop };
}

for (const address of ADDRESSES) {
  test(`${address} is loaded to its finest level`, async () => {
    const levels = [];
    const events = [];
    const loading = loader({ onLevel: (level) => levels.push(level) });
    const mesh = await loading.loadAsync(server.url + address, (event) => events.push(event));
    await mesh.complete;
    assert.deepEqual([mesh.level.level, mesh.level.exact, mesh.level.last], [0, true, true]);
    assert.equal(mesh.geometry.getAttribute("position").count, mesh.level.vertices);
    assert.equal(mesh.geometry.index.count, 3 * mesh.level.faces);
    assert.equal(levels.at(-1), mesh.level);
    const { loaded, total } = events.at(-1);
    assert.deepEqual([loaded, total], [golden(NAME).length, golden(NAME).length]);
  });

  test(`${address} is resumed where connections were lost`, async () => {
    const cuts = [900, 1300, 1100];
    const relay = await startRelay(server.port, cuts);
    const mesh = await loader().loadAsync(relay.url + address);
    await mesh.complete;
    assert.deepEqual([mesh.level.level, mesh.level.exact], [0, true]);
    assert.ok(relay.connections() > 1, `${relay.connections()} connections`);
    relay.stop();
  });

  test(`${address} fails by name when every connection is lost, and keeps what it shows`, async () => {
    const relay = await startRelay(server.port, [1500, 0, 0, 0, 0]);
    const mesh = await loader({ retries: 1 }).loadAsync(relay.url + address);
    await assert.rejects(mesh.complete, { name: "TransferError", code: "network" });
    assert.ok(mesh.geometry.getAttribute("position").count > 0);
    relay.stop();
  });

  test(`${address} stops where it is told to`, async () => {
    const mesh = await loader({ until: { error: 0.02 } }).loadAsync(server.url + address);
    await mesh.complete;
    assert.ok(mesh.level.level > 0);
    assert.ok(mesh.level.rms <= 0.02);
    assert.ok(mesh.level.bytes < golden(NAME).length);
  });

  test(`${address} that is not there is told`, async () => {
    const expected = address.endsWith(".tide") ? { code: "http", place: { status: 404 } } : { code: "refused" };
    await assert.rejects(loader().loadAsync(server.url + address.replace("dome", "doom")), expected);
  });
}

test("each level replaces the one before in the same mesh, whose geometry is disposed of", async () => {
  const bytes = golden(NAME);
  const file = await startFile(bytes, { pause: 500 });
  const mesh = await loader().loadAsync(file.url);
  const first = mesh.geometry;
  let disposed = 0;
  first.addEventListener("dispose", () => disposed++);
  file.release();
  await mesh.complete;
  assert.notEqual(mesh.geometry, first);
  assert.equal(disposed, 1);
  file.stop();
});

test("abort stops loading; the mesh keeps what it shows", async () => {
  const file = await startFile(golden(NAME), { pause: 500 });
  const errors = [];
  const loading = loader();
  const mesh = await new Promise((resolve) => {
    loading.load(file.url, resolve, undefined, (error) => errors.push(error));
  });
  const shown = mesh.geometry;
  assert.equal(loading.abort(), loading);
  await assert.rejects(mesh.complete, { code: "aborted" });
  await new Promise(setImmediate);
  assert.equal(errors.length, 1);
  assert.equal(mesh.geometry, shown);
  file.stop();
});

test("cut, damaged and other files are told by name", async () => {
  const damaged = golden(NAME);
  damaged[damaged.length - 1] ^= 1;
  const newer = golden(NAME);
  newer[8] = 9;
  const cases = [
    [golden(NAME).subarray(0, 1500), "cut"],
    [damaged, "damaged"],
    [newer, "version"],
    [new TextEncoder().encode("<!doctype html><title>Sign in</title>"), "not-a-stream"],
  ];
  for (const [bytes, code] of cases) {
    const file = await startFile(bytes);
    const ended = loader()
      .loadAsync(file.url)
      .then((mesh) => mesh.complete);
    await assert.rejects(ended, { code });
    file.stop();
  }
});

test("limits hold", async () => {
  await assert.rejects(loader({ limits: { vertices: 9 } }).loadAsync(server.url + ADDRESSES[0]), { code: "limit" });
});

test("a server that is busy is asked again, one that refuses is not", async () => {
  for (const [status, count] of [
    [503, 2],
    [403, 1],
  ]) {
    let asked = 0;
    const refusing = createServer((_, answer) => {
      asked++;
      answer.writeHead(status).end();
    }).listen(0, "127.0.0.1");
    await once(refusing, "listening");
    const url = `http://127.0.0.1:${refusing.address().port}/a.tide`;
    await assert.rejects(loader({ retries: 1 }).loadAsync(url), { code: "http", place: { status } });
    assert.equal(asked, count);
    refusing.closeAllConnections();
    refusing.close();
  }
});

test("a file that changed between two connections is told", async () => {
  let asked = 0;
  const bytes = golden(NAME);
  const changing = createServer((_, answer) => {
    answer.writeHead(200, { ETag: `"${asked++}"`, "Content-Length": bytes.length });
    answer.write(bytes.subarray(0, 900), () => answer.destroy());
  }).listen(0, "127.0.0.1");
  await once(changing, "listening");
  const ended = loader()
    .loadAsync(`http://127.0.0.1:${changing.address().port}/a.tide`)
    .then((mesh) => mesh.complete);
  await assert.rejects(ended, { name: "TransferError", code: "changed" });
  assert.equal(asked, 2);
  changing.close();
});
