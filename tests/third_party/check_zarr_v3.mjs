// Writes Zarr version 3 with zarrita and compares what isobrick makes of it.
//   node check_zarr_v3.mjs ISOBRICK
// Exit status: 0 equal, 1 different, 77 zarrita is missing.
import { spawnSync } from "node:child_process";
import { existsSync, mkdtempSync, readFileSync, rmSync } from "node:fs";
import { tmpdir } from "node:os";
import { join } from "node:path";

let zarr, FileSystemStore;
try {
  zarr = await import("zarrita");
  ({ FileSystemStore } = await import("@zarrita/storage"));
} catch (error) {
  if (error.code !== "ERR_MODULE_NOT_FOUND") throw error;
  console.log("skipped: zarrita is not installed; run 'npm ci' in tests/third_party");
  process.exit(77);
}

// zarrita's own can only decode.
for (const name of ["gzip", "zlib"])
  for (const prefix of ["", "numcodecs."])
    zarr.registry.set(prefix + name, async () => (await import(`numcodecs/${name}`)).default);

const isobrick = process.argv[2];
const folder = mkdtempSync(join(tmpdir(), "isobrick-zarr-"));
let checks = 0;
let failures = 0;

function check(condition, what) {
  ++checks;
  if (condition) return;
  ++failures;
  console.log(`wrong: ${what}`);
}

function run(expected, ...words) {
  const { status, stderr, stdout } = spawnSync(isobrick, words, { encoding: "utf8" });
  check(status === expected, `${words.join(" ")}: ${status} ${stderr}`);
  return stderr + stdout;
}

const types = {
  uint8: Uint8Array, int8: Int8Array, uint16: Uint16Array, int16: Int16Array,
  uint32: Uint32Array, int32: Int32Array, float32: Float32Array, float64: Float64Array,
};

function samples(type, count) {
  const data = new types[type](count);
  for (let i = 0; i < count; ++i) data[i] = 50 + 40 * Math.sin(i / 7) + (i % 13);
  return data;
}

function strides(shape) {
  const stride = new Array(shape.length);
  for (let i = shape.length - 1, step = 1; i >= 0; --i) {
    stride[i] = step;
    step *= shape[i];
  }
  return stride;
}

async function write(location, type, shape, options) {
  const data = samples(type, shape.reduce((a, b) => a * b));
  const array = await zarr.create(location, { shape, dtype: type, fillValue: 0, ...options });
  await zarr.set(array, null, { data, shape, stride: strides(shape) });
  return data;
}

function expectSamples(path, bytes, ...selection) {
  const raw = join(folder, "out.raw");
  rmSync(raw, { force: true });
  run(0, "export", path, raw, "--force", ...selection);
  const same = existsSync(raw) && Buffer.compare(readFileSync(raw), Buffer.from(bytes)) === 0;
  check(same, `${path} ${selection.join(" ")}`);
}

const bytesOf = (data) => new Uint8Array(data.buffer, data.byteOffset, data.byteLength);
const little = { name: "bytes", configuration: { endian: "little" } };
const big = { name: "bytes", configuration: { endian: "big" } };
const compressors = {
  none: [],
  gzip: [{ name: "gzip", configuration: { level: 5 } }],
  zlib: [{ name: "numcodecs.zlib", configuration: { level: 5 } }],
  zstd: [{ name: "zstd", configuration: { level: 3, checksum: false } }],
  lz4: [{ name: "numcodecs.lz4", configuration: { acceleration: 1 } }],
};
for (const [cname, shuffle] of [["lz4", 1], ["zstd", 2], ["zlib", 0], ["blosclz", 1]])
  compressors[`blosc_${cname}`] = [
    { name: "blosc", configuration: { cname, clevel: 5, shuffle, typesize: 2, blocksize: 0 } },
  ];

async function checkArrays() {
  for (const [name, codecs] of Object.entries(compressors))
    for (const chunkSeparator of ["/", "."]) {
      const path = join(folder, `${name}${chunkSeparator === "/" ? "" : "_dot"}.zarr`);
      const data = await write(zarr.root(new FileSystemStore(path)), "uint16", [19, 33, 41], {
        chunkShape: [8, 16, 20], codecs: [little, ...codecs], chunkSeparator,
      });
      expectSamples(path, bytesOf(data));
    }
  for (const type of Object.keys(types))
    for (const bytes of [little, big]) {
      const path = join(folder, `${type}_${bytes.configuration.endian}.zarr`);
      const data = await write(zarr.root(new FileSystemStore(path)), type, [9, 17, 21], {
        chunkShape: [8, 16, 20], codecs: [bytes, ...compressors.gzip],
      });
      expectSamples(path, bytesOf(data));
    }
}

async function checkImage() {
  const path = join(folder, "image.zarr");
  const root = zarr.root(new FileSystemStore(path));
  const axes = [
    { name: "t", type: "time" }, { name: "c", type: "channel" },
    ...["z", "y", "x"].map((name) => ({ name, type: "space", unit: "micrometer" })),
  ];
  const datasets = [{
    path: "full",
    coordinateTransformations: [{ type: "scale", scale: [1, 1, 2, 0.5, 0.25] }],
  }];
  await zarr.create(root, {
    attributes: { ome: { version: "0.5", multiscales: [{ axes, datasets }] } },
  });
  const shape = [2, 3, 19, 33, 41];
  const data = await write(root.resolve("full"), "float32", shape, {
    chunkShape: [2, 2, 8, 16, 20], codecs: [little, ...compressors.blosc_zstd],
  });
  const size = 19 * 33 * 41 * 4;
  for (const t of [0, 1])
    for (const c of [0, 1, 2])
      expectSamples(path, bytesOf(data).subarray((3 * t + c) * size, (3 * t + c + 1) * size),
                    "--time", `${t}`, "--channel", `${c}`);
  check(run(2, "export", path, join(folder, "no.raw")).includes("choose one with --time"),
        "ambiguous");
  check(run(0, "info", path).includes("3 volumes: --channel 0 … 2"), "listed");
  check(run(2, "info", path, "--time", "2", "--channel", "0").includes("--time 2 is not there"),
        "not there");
  run(0, "index", path, "--kind", "octree", "--time", "1", "--channel", "2");
  const mesh = join(folder, "mesh.ply");
  run(0, "extract", path, "--isovalue", "52.5", "-o", mesh, "--time", "1", "--channel", "2");
  check(readFileSync(mesh).length > 10000, "mesh");
  run(0, "extract", path, "--isovalue", "52.5", "-o", mesh, "--force", "--time", "0",
      "--channel", "2"); // that volume has no ranges: by the cache
}

await checkArrays();
await checkImage();
rmSync(folder, { recursive: true });
console.log(`${checks} checks, ${failures} failures`);
process.exit(failures > 0 ? 1 : 0);
