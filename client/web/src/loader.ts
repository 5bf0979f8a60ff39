/**
 * Loads streams into three.js: a mesh with the first level, refined in place from there on.
 *
 *     const mesh = await new MeshtideLoader().loadAsync("bunny.tide");
 *     scene.add(mesh);
 *     await mesh.complete;
 */
import { BufferAttribute, BufferGeometry, Loader, Mesh, MeshStandardMaterial } from "three";
import { type Connection, Decoder, type Level, type Limits, type MeshtideError, type Until } from "./decoder.js";
import { download } from "./download.js";
import { errorOf } from "./errors.js";
import { websocket } from "./websocket.js";

export * from "./decoder.js";

/** auto: websocket for http(s)://host/meshes/ID, one plain request for everything else. */
export type Transport = "auto" | "download" | "websocket";

const RETRIES = 5;

/** A mesh whose geometry is replaced by finer ones as they come. */
export class ProgressiveMesh extends Mesh<BufferGeometry, MeshStandardMaterial> {
  /** Ends when the last level that is wanted is shown, and fails where one of them cannot be. */
  readonly complete: Promise<void>;
  constructor(
    geometry: BufferGeometry,
    /** What is shown. */
    public level: Level,
    complete: Promise<void>,
  ) {
    super(geometry, new MeshStandardMaterial());
    this.complete = complete;
  }
}

export class MeshtideLoader extends Loader<ProgressiveMesh> {
  until: Until = {};
  limits: Partial<Limits> = {};
  transport: Transport = "auto";
  /** Connections in a row that may bring nothing new. */
  retries = RETRIES;
  /** Is called with each level as soon as the mesh shows it. */
  onLevel: ((level: Level, mesh: ProgressiveMesh) => void) | null = null;
  /** Where to decode, instead of in the worker that all decoders of the page share. */
  connection: Connection | null = null;
  readonly #running = new Set<AbortController>();

  /** onLoad is called at the first level; onError for whatever fails, before or after that. */
  override load(
    url: string,
    onLoad: (mesh: ProgressiveMesh) => void,
    onProgress?: (event: ProgressEvent) => void,
    onError?: (error: unknown) => void,
  ): void {
    const base = typeof location === "undefined" ? undefined : location.href;
    const address = new URL(this.path + url, base).href;
    const controller = new AbortController();
    this.#running.add(controller);
    this.manager.itemStart(address);
    const ended = this.#run(address, controller.signal, onLoad, (loaded, total) =>
      onProgress?.({ type: "progress", lengthComputable: total > 0, loaded, total } as ProgressEvent),
    );
    ended
      .catch((error: unknown) => {
        this.manager.itemError(address);
        onError?.(error);
      })
      .finally(() => {
        this.#running.delete(controller);
        this.manager.itemEnd(address);
      });
  }

  /** Stops all that is loading; the meshes keep what they show. */
  override abort(): this {
    for (const controller of this.#running) controller.abort();
    return this;
  }

  dispose(): void {
    this.abort();
  }

  async #run(
    url: string,
    signal: AbortSignal,
    onLoad: (mesh: ProgressiveMesh) => void,
    onProgress: (loaded: number, total: number) => void,
  ): Promise<void> {
    const { until, limits, connection } = this;
    const decoder = new Decoder(connection === null ? { limits, until } : { limits, until, connection });
    const stop = () => decoder.dispose();
    signal.addEventListener("abort", stop);
    let mesh: ProgressiveMesh | undefined;
    const end = settled();
    let loaded = 0;
    try {
      for await (const bytes of this.#bytes(url, signal)) {
        loaded += bytes.length;
        const { level, complete, dueBytes } = await decoder.push(bytes);
        onProgress(Math.min(loaded, dueBytes || loaded), dueBytes);
        if (level !== null) {
          if (mesh === undefined) {
            mesh = new ProgressiveMesh(geometryOf(level), level, end.promise);
            onLoad(mesh);
          } else refine(mesh, level);
          this.onLevel?.(level, mesh);
        }
        if (complete) break;
      }
      await decoder.end();
      end.resolve();
    } catch (error) {
      const told = signal.aborted ? errorOf("aborted", "loading was aborted") : (error as MeshtideError);
      end.reject(told);
      throw told;
    } finally {
      signal.removeEventListener("abort", stop);
      decoder.dispose();
    }
  }

  #bytes(url: string, signal: AbortSignal): AsyncGenerator<Uint8Array> {
    const { retries, until } = this;
    const { pathname } = new URL(url);
    const hosted = /\/meshes\/.+/.test(pathname) && !pathname.endsWith(".tide");
    const chosen = this.transport === "auto" ? (hosted ? "websocket" : "download") : this.transport;
    if (chosen === "websocket") return websocket(url, { signal, retries, until });
    const credentials = this.withCredentials ? "include" : "same-origin";
    return download(url, { signal, retries, headers: this.requestHeader, credentials });
  }
}

function geometryOf({ positions, normals, indices }: Level): BufferGeometry {
  const geometry = new BufferGeometry();
  geometry.setAttribute("position", new BufferAttribute(positions, 3));
  geometry.setAttribute("normal", new BufferAttribute(normals, 3));
  geometry.setIndex(new BufferAttribute(indices, 1));
  return geometry;
}

/** Swaps the geometry, all between two frames. */
function refine(mesh: ProgressiveMesh, level: Level): void {
  const before = mesh.geometry;
  mesh.geometry = geometryOf(level);
  mesh.level = level;
  before.dispose();
}

/** A promise that is settled from outside; nobody has to listen to it. */
function settled(): { promise: Promise<void>; resolve: () => void; reject: (error: unknown) => void } {
  let [resolve, reject] = [() => {}, (_: unknown) => {}];
  const promise = new Promise<void>((succeed, fail) => {
    [resolve, reject] = [succeed, fail];
  });
  promise.catch(() => undefined);
  return { promise, resolve, reject };
}
