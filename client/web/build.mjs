// Builds dist/: the entry points, their source maps, and the files that the worker fetches, side by side.
import { cpSync, mkdirSync, readdirSync, rmSync } from "node:fs";
import { fileURLToPath } from "node:url";
import { build } from "esbuild";

const here = new URL("./", import.meta.url);
const codec = new URL("../../codec/", here);
const dist = fileURLToPath(new URL("dist/", here));
const copy = (folder, ending) => {
  for (const name of readdirSync(folder)) if (name.endsWith(ending)) cpSync(new URL(name, folder), `${dist}/${name}`);
};

rmSync(dist, { recursive: true, force: true });
mkdirSync(dist);
await build({
  entryPoints: ["decoder", "decoding", "loader", "worker", "worker_service"].map((name) =>
    fileURLToPath(new URL(`src/${name}.ts`, here)),
  ),
  outdir: dist,
  bundle: true,
  splitting: true,
  format: "esm",
  target: "es2022",
  minify: true,
  sourcemap: true,
  external: ["three"],
  logLevel: "warning",
});
copy(new URL("core/wasm/", codec), ".wasm");
copy(new URL("meshtide_codec/states/", codec), ".states");
