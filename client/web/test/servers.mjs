// A meshtide server in a process of its own, and a relay in front of it that can lose connections.
import { spawn } from "node:child_process";
import { once } from "node:events";
import { connect, createServer } from "node:net";
import { fileURLToPath } from "node:url";

const GOLDEN = fileURLToPath(new URL("../../../tests/golden", import.meta.url));

export async function startServer() {
  const command = process.env.MESHTIDE;
  if (command === undefined) throw new Error("set MESHTIDE to the command `meshtide` that serves the test's meshes");
  const port = await freePort();
  const process_ = spawn(command, ["serve", GOLDEN, "--port", String(port)], { stdio: "ignore" });
  const url = `http://127.0.0.1:${port}`;
  for (const end = Date.now() + 60_000; ; ) {
    const answer = await fetch(`${url}/meshes/compact-dome-previews.tide`).catch(() => null);
    if (answer?.ok) break;
    if (process_.exitCode !== null || Date.now() > end) throw new Error(`${command} serve does not start`);
    await new Promise((resolve) => setTimeout(resolve, 100));
  }
  const stop = async () => {
    process_.kill();
    await once(process_, "exit");
  };
  return { port, url, stop };
}

/** Passes connections on to a port; the nth is cut after as many bytes of the server as cuts[n] says. */
export async function startRelay(port, cuts) {
  let connections = 0;
  const sockets = new Set();
  const relay = createServer((socket) => {
    const cut = cuts[connections++] ?? Number.POSITIVE_INFINITY;
    const server = connect(port, "127.0.0.1");
    let passed = 0;
    for (const each of [socket, server]) {
      sockets.add(each);
      each.on("error", () => undefined);
      each.on("close", () => {
        socket.destroy();
        server.destroy();
      });
    }
    socket.on("data", (bytes) => server.write(bytes));
    server.on("data", (bytes) => {
      const part = bytes.subarray(0, cut - passed);
      passed += part.length;
      socket.write(part, () => {
        if (passed >= cut) socket.destroy();
      });
    });
  });
  relay.listen(0, "127.0.0.1");
  await once(relay, "listening");
  const stop = () => {
    for (const each of sockets) each.destroy();
    relay.close();
  };
  return { url: `http://127.0.0.1:${relay.address().port}`, connections: () => connections, stop };
}

async function freePort() {
  const server = createServer().listen(0, "127.0.0.1");
  await once(server, "listening");
  const { port } = server.address();
  server.close();
  await once(server, "close");
  return port;
}
