// Has three.js and its decoder of meshoptimizer read every compressed GLB of a folder, and compares the
// triangles with those of the GLB that is not compressed.
//   node check_compressed_glb.mjs FOLDER
// Exit status: 0 all are the same, 1 otherwise, 77 three is missing, or nothing is compressed.
import { readFileSync, readdirSync } from "node:fs";
import { join } from "node:path";

// Stand-ins for what only a browser has.
globalThis.self = globalThis;

let GLTFLoader, MeshoptDecoder;
try {
  ({ GLTFLoader } = await import("three/addons/loaders/GLTFLoader.js"));
  ({ MeshoptDecoder } = await import("three/addons/libs/meshopt_decoder.module.js"));
} catch (error) {
  if (error.code !== "ERR_MODULE_NOT_FOUND") throw error;
  console.log("skipped: three is not installed; run 'npm ci' in tests/third_party");
  process.exit(77);
}

const folder = process.argv[2];

/** The corners of each triangle with their normals, turned so that the smallest is the first. */
async function trianglesOf(name) {
  const bytes = new Uint8Array(readFileSync(join(folder, name)));
  const loader = new GLTFLoader().setMeshoptDecoder(MeshoptDecoder);
  const { scene } = await loader.parseAsync(bytes.buffer, "");
  const triangles = [];
  scene.traverse((mesh) => {
    if (!mesh.isMesh) return;
    const { index, attributes } = mesh.geometry;
    const numbers = Object.values(attributes);
    const corner = (i) =>
      numbers
        .map((of) => Array.from({ length: of.itemSize }, (_, k) => of.getComponent(i, k)).join())
        .join();
    for (let i = 0; i < index.count; i += 3) {
      const corners = [0, 1, 2].map((k) => corner(index.getX(i + k)));
      const first = corners.indexOf([...corners].sort()[0]);
      triangles.push([0, 1, 2].map((k) => corners[(first + k) % 3]).join(" "));
    }
  });
  return triangles;
}

const names = readdirSync(folder).filter((name) => name.endsWith(".compressed.glb"));
if (names.length === 0) {
  console.log("skipped: isobrick was built without libmeshoptimizer-dev");
  process.exit(77);
}
let wrong = 0;
for (const name of names) {
  const triangles = await trianglesOf(name);
  const expected = await trianglesOf(name.replace(".compressed", ""));
  const same =
    triangles.length === expected.length && triangles.every((text, i) => text === expected[i]);
  console.log(`${name}: ${triangles.length} triangles, ${same ? "the same" : "OTHERS"}`);
  if (!same) wrong = 1;
}
process.exit(wrong);
