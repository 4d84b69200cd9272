// Opens an OME-Zarr store with zarrita and compares arrays with raw files.
//   node check_store.mjs STORE ARRAY=RAW …
// RAW holds the array's samples, C order, little endian. Every level of the
// image must be named. Exit status: 0 equal, 1 different, 77 zarrita is missing.
import { readFileSync } from "node:fs";
import { resolve } from "node:path";

let zarr, FileSystemStore;
try {
  zarr = await import("zarrita");
  ({ FileSystemStore } = await import("@zarrita/storage"));
} catch (error) {
  if (error.code !== "ERR_MODULE_NOT_FOUND") throw error;
  console.log("skipped: zarrita is not installed; run 'npm ci' in tests/third_party");
  process.exit(77);
}

const table = Uint32Array.from({ length: 256 }, (_, n) => {
  for (let k = 0; k < 8; ++k) n = n & 1 ? 0x82f63b78 ^ (n >>> 1) : n >>> 1;
  return n >>> 0;
});

function crc32c(bytes) {
  let crc = ~0;
  for (const byte of bytes) crc = table[(crc ^ byte) & 0xff] ^ (crc >>> 8);
  return ~crc >>> 0;
}

// zarrita's own codec cuts the checksum off unseen; this one looks at it.
let checksums = 0;
class CheckingCrc32c {
  kind = "bytes_to_bytes";
  static fromConfig() {
    return new CheckingCrc32c();
  }
  computeEncodedSize(size) {
    return size + 4;
  }
  decode(bytes) {
    const body = bytes.subarray(0, bytes.length - 4);
    const stored = new DataView(bytes.buffer, bytes.byteOffset).getUint32(body.length, true);
    if (crc32c(body) !== stored) throw new Error("crc32c does not match");
    ++checksums;
    return body;
  }
}
zarr.registry.set("crc32c", () => CheckingCrc32c);

function fail(message) {
  console.error(message);
  process.exit(1);
}

const [storePath, ...pairs] = process.argv.slice(2);
const expected = new Map(pairs.map((pair) => pair.split("=")));
const root = zarr.root(new FileSystemStore(resolve(storePath)));
const { ome } = (await zarr.open.v3(root, { kind: "group" })).attrs;
if (ome.version !== "0.5") fail(`${storePath}: OME-Zarr ${ome.version}`);
const [image] = ome.multiscales;
if (image.axes.map((axis) => axis.name).join("") !== "zyx") fail(`${storePath}: wrong axes`);
for (const { path, coordinateTransformations } of image.datasets) {
  if (!expected.has(path)) fail(`${storePath}: level ${path} was not expected`);
  const kinds = coordinateTransformations.map((transformation) => transformation.type).join();
  if (kinds !== "scale,translation") fail(`${storePath}: level ${path}: ${kinds}`);
}

for (const [path, file] of expected) {
  const array = await zarr.open.v3(root.resolve(path), { kind: "array" });
  const { data } = await zarr.get(array);
  const samples = new Uint8Array(data.buffer, data.byteOffset, data.byteLength);
  const raw = readFileSync(file);
  if (Buffer.compare(samples, raw) !== 0) {
    const at = raw.findIndex((byte, i) => byte !== samples[i]);
    fail(`${storePath}/${path}: ${samples.length} bytes, wanted ${raw.length}; differs at ${at}`);
  }
}
console.log(`${storePath}: ${expected.size} arrays equal, ${checksums} checksums right`);
