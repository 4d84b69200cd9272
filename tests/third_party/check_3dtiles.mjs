// 3D Tiles, opened by the reader of 3d-tiles-renderer and three.js, and their contents by Khronos'
// validator of glTF: see tiles_in_node.mjs.
//   node check_3dtiles.mjs ISOBRICK
// Exit status: 0 all is as it must be, 1 otherwise, 77 a package is missing.
import assert from "node:assert/strict";
import { execFileSync } from "node:child_process";
import { mkdtempSync, readFileSync, readdirSync, rmSync, statSync, writeFileSync } from "node:fs";
import { tmpdir } from "node:os";
import { join } from "node:path";

let openTiles, validator;
try {
  // First: it takes the stand-ins of the other for a browser.
  validator = (await import("gltf-validator")).default;
  ({ openTiles } = await import("./tiles_in_node.mjs"));
} catch (error) {
  if (error.code !== "ERR_MODULE_NOT_FOUND") throw error;
  console.log("skipped: 3d-tiles-renderer, three or gltf-validator is not installed; " +
    "run 'npm ci' in tests/third_party");
  process.exit(77);
}

const program = process.argv[2];
const folder = mkdtempSync(join(process.env.TMPDIR ?? tmpdir(), "3dtiles-"));
process.on("exit", () => rmSync(folder, { recursive: true }));
const isobrick = (...words) =>
  JSON.parse(execFileSync(program, [...words, "--json", "-q"], { cwd: folder, encoding: "utf8" }));

const filesOf = (name) =>
  readdirSync(join(folder, name), { recursive: true })
    .filter((file) => statSync(join(folder, name, file)).isFile()).sort();

// The validator does not know the extension of compressed contents. To it, bytes that only the extension names are not used.
const isOfCompression = ({ code, message }) => code === "UNUSED_OBJECT" ||
  (code === "UNSUPPORTED_EXTENSION" && message.includes("EXT_meshopt_compression"));

async function validate(name, isCompressed = false) {
  let contents = 0;
  for (const file of filesOf(name).filter((file) => file.endsWith(".glb"))) {
    const bytes = new Uint8Array(readFileSync(join(folder, name, file)));
    const { issues } = await validator.validateBytes(bytes, { uri: file, format: "glb" });
    const found = issues.messages.filter((issue) => !isCompressed || !isOfCompression(issue));
    assert.deepEqual(found, [], `${name}/${file}`);
    assert.equal(issues.messages.length > 0, isCompressed, `${name}/${file}`);
    ++contents;
  }
  assert.ok(contents > 0);
}

const near = (a, b, tolerance, what) =>
  assert.ok(Math.abs(a - b) <= tolerance, `${what}: ${a} is not within ${tolerance} of ${b}`);

function checkBox(box, bounds, metres) {
  const size = Math.max(...bounds.hi.map((hi, axis) => hi - bounds.lo[axis])) * metres;
  ["x", "y", "z"].forEach((axis, i) => {
    near(box.min[axis], bounds.lo[i] * metres, 1e-4 * size, `min ${axis}`);
    near(box.max[axis], bounds.hi[i] * metres, 1e-4 * size, `max ${axis}`);
  });
}

// Compares a surface with the PLY of it. `metres`: of the volume's unit.
async function checkSurface(store, metres, ...words) {
  const name = `${store}${words.join("")}.3dtiles`;
  const isovalue = ["extract", `${store}.zarr`, "--isovalue", "127.5"];
  const [plain] = isobrick(...isovalue, "-o", `${name}.ply`, "--measure").surfaces;
  const [made] = isobrick(...isovalue, "-o", name, ...words).surfaces;
  await validate(name, words.includes("--compress"));
  const tiles = await openTiles(join(folder, name));
  const area = plain.measure.area * metres ** 2;
  // From the coarsest level to finer ones. A single level has tiles without content above it.
  for (const errorTarget of made.levels.length > 1 ? [1e9, 16, 4, 1] : []) {
    const shown = await tiles.show(errorTarget);
    near(shown.area, area, 0.05 * area, "area of a coarse level");
  }
  const finest = await tiles.show(0);
  near(finest.area, area, 1e-3 * area, "area");
  assert.equal(finest.tiles, made.levels[0].fragments);
  assert.ok(finest.triangles >= plain.triangles, "triangles of the finest level");
  if (finest.tiles === 1) assert.equal(finest.triangles, plain.triangles);
  checkBox(finest.box, plain.measure.bounds, metres);
  assert.deepEqual([...tiles.requested].sort(), filesOf(name));
  tiles.close();
  console.log(`${name}: ${finest.triangles} triangles in ${finest.tiles} of ` +
    `${filesOf(name).length} files`);
}

// A ball of millimetres whose axes are exchanged, off the origin.
const n = 48;
const ball = Buffer.alloc(n ** 3);
for (let i = 0, z = 0; z < n; ++z)
  for (let y = 0; y < n; ++y)
    for (let x = 0; x < n; ++x, ++i)
      ball[i] = Math.max(0, 255 - 7 * Math.hypot(x - 20, y - 24, z - 26));
writeFileSync(join(folder, "ball.nrrd"), Buffer.concat([Buffer.from(
  `NRRD0004\ntype: uint8\ndimension: 3\nsizes: ${n} ${n} ${n}\nencoding: raw\n` +
  "space dimension: 3\nspace directions: (0,2,0) (-2,0,0) (0,0,3)\n" +
  'space origin: (500,-50,20)\nspace units: "mm" "mm" "mm"\n\n'), ball]));
isobrick("convert", "ball.nrrd", "ball.zarr");
await checkSurface("ball", 1e-3, "--levels", "3");

isobrick("synth", "gyroid", "gyroid.zarr", "--dims", "150,110,90", "--type", "u8");
await checkSurface("gyroid", 1);
await checkSurface("gyroid", 1, "--levels", "1", "--normals", "none");

// Whether this build can compress.
let compresses = true;
try {
  await checkSurface("ball", 1e-3, "--levels", "3", "--compress");
} catch (error) {
  if (!`${error.stderr}`.includes("meshoptimizer")) throw error;
  compresses = false;
  console.log("nothing is compressed: isobrick was built without libmeshoptimizer-dev");
}
if (compresses) {
  await checkSurface("gyroid", 1, "--compress");
  await checkSurface("gyroid", 1, "--levels", "1", "--normals", "none", "--compress");
}

isobrick("synth", "cells", "cells.zarr", "--dims", "96,80,64", "--type", "u16", "--frequency", "4");
isobrick("extract", "cells.zarr", "--labels", "all", "-o", "labels", "--format", "3dtiles",
  "--measure");
const { labels } = JSON.parse(readFileSync(join(folder, "labels", "labels.json"), "utf8"));
assert.ok(labels.length > 20);
const area = labels.reduce((sum, { measure }) => sum + measure.area, 0);

async function checkLabels(name, isCompressed) {
  await validate(name, isCompressed);
  const tiles = await openTiles(join(folder, name));
  const all = await tiles.show(0);
  near(all.area, area, 1e-3 * area, "area of labels");
  assert.deepEqual([...tiles.requested, "labels.json"].sort(), filesOf(name));
  tiles.close();
  return all.triangles;
}

const triangles = await checkLabels("labels", false);
if (compresses) {
  isobrick("extract", "cells.zarr", "--labels", "all", "-o", "packed", "--format", "3dtiles",
    "--compress");
  assert.equal(await checkLabels("packed", true), triangles);
}
for (const { label, file, measure } of labels.slice(0, 3)) {
  assert.equal(file, `${label}/tileset.json`);
  const one = await openTiles(join(folder, "labels", `${label}`));
  const shown = await one.show(0);
  near(shown.area, measure.area, 1e-3 * measure.area, `area of ${label}`);
  checkBox(shown.box, measure.bounds, 1);
  one.close();
}
console.log(`labels: ${labels.length}, ${triangles} triangles`);
process.exit(0);
