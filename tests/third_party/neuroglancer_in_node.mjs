// neuroglancer's reader of precomputed meshes, out of the npm package `neuroglancer`, in Node.js:
//   await openMeshes(folder) -> { transform, properties, manifest(id), fragment(chunk, lod, row) }
// Unchanged modules of neuroglancer parse the descriptions, the shards and the manifests, and decode
// the fragments (in its own WebAssembly). Here are stand-ins for what only a browser has: pictures
// and style sheets, the document, fetch() of a file, the worker's queue of chunks.
import { existsSync, readFileSync } from "node:fs";
import { register } from "node:module";
import { join } from "node:path";
import { fileURLToPath } from "node:url";

register(
  "data:text/javascript," +
    encodeURIComponent(String.raw`
export async function resolve(specifier, context, next) {
  if (/\.(css|svg|html|glsl)(\?raw)?$/.test(specifier) || specifier.startsWith("codemirror"))
    return { url: "data:text/javascript,export default {}", shortCircuit: true };
  return next(specifier, context);
}`),
);

const nothing = new Proxy(function () {}, {
  get: (_, key) => (key === Symbol.toPrimitive ? () => "" : nothing),
  set: () => true,
  apply: () => nothing,
  construct: () => nothing,
});
globalThis.self = globalThis;
globalThis.window = globalThis;
globalThis.navigator ??= { hardwareConcurrency: 1, userAgent: "", platform: "" };
globalThis.location = { hash: "", href: "http://localhost/" };
globalThis.document = nothing;
globalThis.requestAnimationFrame = () => 0;
globalThis.addEventListener = () => {};
for (const name of ["Element", "HTMLElement", "HTMLInputElement", "HTMLTextAreaElement",
  "MouseEvent", "Node", "WheelEvent", "WebGL2RenderingContext"])
  globalThis[name] = class {};

const fetchOfNode = globalThis.fetch;
globalThis.fetch = async (resource, options) => {
  if (String(resource).startsWith("file:"))
    return new Response(readFileSync(fileURLToPath(resource)), {
      headers: { "content-type": "application/wasm" },
    });
  return fetchOfNode(resource, options);
};

// Throws an error with the code ERR_MODULE_NOT_FOUND where the package is not installed.
const modules = "neuroglancer/unstable/";
const { PrecomputedDataSource } = await import(modules + "datasource/precomputed/frontend.js");
const { PrecomputedMultiscaleMeshSource } = await import(
  modules + "datasource/precomputed/backend.js"
);
const { ShardedKvStore } = await import(modules + "datasource/precomputed/sharded.js");

/** Files of a folder, as neuroglancer's stores read them. */
function folderStore(folder) {
  return {
    getUrl: (path) => path,
    read: async (path, { byteRange } = {}) => {
      const file = join(folder, path);
      if (!existsSync(file)) return undefined;
      const bytes = readFileSync(file);
      const offset = byteRange?.offset ?? 0;
      const part = bytes.subarray(offset, offset + (byteRange?.length ?? bytes.length));
      return { response: new Response(part), offset, length: part.length, totalSize: bytes.length };
    },
  };
}

const progressListener = { addSpan: () => {}, removeSpan: () => {} };
const queue = new Proxy({ sources: new Set() }, { get: (of, key) => of[key] ?? (() => undefined) });
const chunkManager = {
  addRef: () => chunkManager,
  dispose: () => {},
  queueManager: queue,
  memoize: { getAsync: (_, options, make) => make({ ...options, progressListener }) },
  getChunkSource: (_, options) => options,
};

export async function openMeshes(folder) {
  const store = folderStore(folder);
  const kvStoreContext = {
    read: (url) => store.read(url.replace("file:///", "")),
    resolveRelativePath: (base, path) => base + path,
  };
  const { subsources } = await PrecomputedDataSource.prototype.get({
    url: { suffix: "", scheme: "neuroglancer-precomputed", url: "" },
    kvStoreUrl: "file:///",
    registry: { chunkManager, sharedKvStoreContext: { chunkManager, kvStoreContext } },
  });
  const described = subsources.find(({ id }) => id === "default");
  const { parameters, format } = described.subsource.mesh;
  const source = Object.create(PrecomputedMultiscaleMeshSource.prototype);
  const base = { store, path: "" };
  const { sharding } = parameters.metadata;
  Object.assign(source, {
    parameters,
    format,
    kvStore: base,
    shardedKvStore: sharding && new ShardedKvStore(chunkManager, base, sharding),
  });
  return {
    transform: described.subsourceToModelSubspaceTransform,
    properties: subsources.find(({ id }) => id === "properties")?.subsource.segmentPropertyMap,
    async manifest(id) {
      const chunk = { source, objectId: BigInt(id) };
      await source.download(chunk);
      return chunk;
    },
    async fragment(manifestChunk, lod, row) {
      const chunk = { manifestChunk, lod, chunkIndex: row };
      await source.downloadFragment(chunk);
      return chunk;
    },
  };
}
