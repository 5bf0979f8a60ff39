import assert from "node:assert/strict";
import { readdirSync, readFileSync } from "node:fs";
import { test } from "node:test";
import { gzipSync } from "node:zlib";

const DIST = new URL("../dist/", import.meta.url);
const compressed = (name) => gzipSync(readFileSync(new URL(name, DIST)), { level: 9 }).length;

/** The file and all that it imports, compressed. */
function withImports(name, seen = new Set()) {
  if (seen.has(name)) return 0;
  seen.add(name);
  const source = readFileSync(new URL(name, DIST), "utf8");
  const imported = [...source.matchAll(/(?:from|import)\s*"\.\/([^"]+)"/g)].map((match) => match[1]);
  return compressed(name) + imported.reduce((sum, each) => sum + withImports(each, seen), 0);
}

test("what a page fetches stays within its budget", (context) => {
  const budgets = [
    ["decoder.js", withImports("decoder.js"), 2500],
    ["worker.js", withImports("worker.js"), 6000],
    ["loader.js", withImports("loader.js"), 10000],
    ["meshtide.wasm", compressed("meshtide.wasm"), 36000],
    ["meshtide-full.wasm", compressed("meshtide-full.wasm"), 50000],
    ["default.states", compressed("default.states"), 25000],
  ];
  for (const [name, bytes, allowed] of budgets) {
    context.diagnostic(`${name}: ${bytes} of ${allowed} bytes compressed`);
    assert.ok(bytes <= allowed, `${name} takes ${bytes} bytes compressed, and may take ${allowed}`);
  }
});

test("every script has a source map", () => {
  const names = readdirSync(DIST);
  const scripts = names.filter((name) => name.endsWith(".js"));
  assert.ok(scripts.length >= 3);
  for (const name of scripts) assert.ok(names.includes(`${name}.map`), name);
});
