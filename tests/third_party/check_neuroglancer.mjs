// Meshes with levels of detail, opened by neuroglancer's own reader: see neuroglancer_in_node.mjs.
//   node check_neuroglancer.mjs ISOBRICK
// Exit status: 0 all is as it must be, 1 otherwise, 77 neuroglancer is missing.
import assert from "node:assert/strict";
import { execFileSync } from "node:child_process";
import { mkdtempSync, readFileSync, readdirSync, rmSync } from "node:fs";
import { tmpdir } from "node:os";
import { join } from "node:path";

let openMeshes, validateOctree, zorder3LessThan;
try {
  ({ openMeshes } = await import("./neuroglancer_in_node.mjs"));
  ({ validateOctree } = await import("neuroglancer/unstable/mesh/multiscale.js"));
  ({ zorder3LessThan } = await import("neuroglancer/unstable/util/zorder.js"));
} catch (error) {
  if (error.code !== "ERR_MODULE_NOT_FOUND") throw error;
  console.log("skipped: neuroglancer is not installed; run 'npm ci' in tests/third_party");
  process.exit(77);
}

const program = process.argv[2];
const folder = mkdtempSync(join(process.env.TMPDIR ?? tmpdir(), "neuroglancer-"));
process.on("exit", () => rmSync(folder, { recursive: true }));
const isobrick = (...words) =>
  JSON.parse(execFileSync(program, [...words, "--json", "-q"], { cwd: folder, encoding: "utf8" }));

// The first row of each level in the octree; levels that neuroglancer adds have one row.
function rowsOfLevels(octree, levels) {
  const rows = octree.length / 5;
  const first = [rows - 1];
  for (let level = levels - 1; level > 0; --level) {
    let begin = rows;
    for (let row = first[0]; row < (first[1] ?? rows); ++row)
      begin = Math.min(begin, octree[5 * row + 3]);
    first.unshift(begin);
  }
  return [...first, rows];
}

const steps = 65535, middle = 32768;

// Checks a fragment, and returns its area in steps.
function checkFragment({ meshData, subChunkOffsets }, lod) {
  const { vertexPositions: points, indices } = meshData;
  assert.equal(subChunkOffsets.length, lod > 0 ? 9 : 2);
  assert.equal(subChunkOffsets.at(-1), indices.length);
  let area = 0;
  for (let part = 0; part + 1 < subChunkOffsets.length; ++part)
    for (let i = subChunkOffsets[part]; i < subChunkOffsets[part + 1]; i += 3) {
      const corners = [0, 1, 2].map((k) =>
        [0, 1, 2].map((axis) => points[3 * indices[i + k] + axis]));
      if (lod > 0)
        for (const corner of corners)
          corner.forEach((x, axis) =>
            assert.ok((part >> axis) & 1 ? x >= middle : x <= middle, "a triangle crosses halves"));
      const [u, v] = [1, 2].map((k) => corners[k].map((x, axis) => x - corners[0][axis]));
      area += Math.hypot(u[1] * v[2] - u[2] * v[1], u[2] * v[0] - u[0] * v[2],
        u[0] * v[1] - u[1] * v[0]) / 2;
    }
  return { area, triangles: indices.length / 3 };
}

// Reads all of a segment: { area, triangles } of each level.
async function readSegment(meshes, id) {
  const chunk = await meshes.manifest(id);
  const { octree, lodScales, chunkShape } = chunk.manifest;
  validateOctree(octree.map((value, i) => (i % 5 === 4 ? value & 0x7fffffff : value)));
  const stored = lodScales.findIndex((scale) => scale === 0);
  const levels = stored < 0 ? lodScales.length : stored;
  for (let lod = 1; lod < levels; ++lod) assert.ok(lodScales[lod] >= lodScales[lod - 1]);
  const first = rowsOfLevels(octree, lodScales.length);
  const found = [];
  for (let lod = 0; lod < levels; ++lod) {
    const sum = { area: 0, triangles: 0 };
    for (let row = first[lod]; row < first[lod + 1]; ++row) {
      const place = (at) => octree.subarray(5 * at, 5 * at + 3);
      if (row > first[lod]) assert.ok(zorder3LessThan(...place(row - 1), ...place(row)));
      const size = chunk.offsets[row + 1] - chunk.offsets[row];
      assert.equal(octree[5 * row + 4] >>> 31, size === 0 ? 1 : 0);
      if (size === 0) continue;
      const { area, triangles } = checkFragment(await meshes.fragment(chunk, lod, row), lod);
      sum.area += area * ((chunkShape[0] * 2 ** lod) / steps) ** 2;
      sum.triangles += triangles;
    }
    found.push(sum);
  }
  return found;
}

const near = (a, b, tolerance) =>
  assert.ok(Math.abs(a - b) <= tolerance * b, `${a} is not within ${tolerance} of ${b}`);

isobrick("synth", "gyroid", "g.zarr", "--dims", "150,110,90", "--type", "u8");
for (const words of [[], ["--sharded"]]) {
  const name = `surface${words.join("")}.neuroglancer`;
  const made = isobrick("extract", "g.zarr", "--isovalue", "127.5", "-o", name, "--measure",
    "--levels", "3", ...words);
  const [surface] = made.surfaces;
  const meshes = await openMeshes(join(folder, name));
  assert.deepEqual([...meshes.properties.inlineProperties.ids], [1n]);
  const levels = await readSegment(meshes, 1);
  assert.equal(levels.length, 3);
  for (const level of levels) near(level.area, surface.measure.area, 0.03);
  near(levels[0].area, surface.measure.area, 1e-3);
  assert.ok(levels[0].triangles >= surface.triangles * 0.999);
  assert.ok(levels[1].triangles < levels[0].triangles / 2);
  assert.ok(levels[2].triangles < levels[1].triangles / 2);
  assert.equal(readdirSync(join(folder, name)).some((file) => file.endsWith(".shard")),
    words.length > 0);
  console.log(`${name}: ${levels.map(({ triangles }) => triangles).join(", ")} triangles`);
}

isobrick("synth", "cells", "c.zarr", "--dims", "96,80,64", "--type", "u16", "--frequency", "4");
for (const words of [[], ["--sharded"]]) {
  const name = `labels${words.join("")}`;
  isobrick("extract", "c.zarr", "--labels", "all", "-o", name, "--format", "neuroglancer",
    "--measure", ...words);
  const { labels } = JSON.parse(readFileSync(join(folder, name, "labels.json"), "utf8"));
  assert.ok(labels.length > 20);
  const meshes = await openMeshes(join(folder, name));
  assert.deepEqual([...meshes.properties.inlineProperties.ids].map(Number).sort((a, b) => a - b),
    labels.map(({ label }) => label));
  for (const { label, measure } of labels) {
    const levels = await readSegment(meshes, label);
    near(levels[0].area, measure.area, 1e-3);
  }
  console.log(`${name}: ${labels.length} labels`);
}
