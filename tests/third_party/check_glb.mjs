// Has Khronos' validator look at every GLB of a folder, external buffers included.
//   node check_glb.mjs FOLDER
// It must report nothing, but that it does not know the extension of compressed ones. Exit status: 0 nothing found, 1 otherwise, 77 gltf-validator is missing.
import { readdirSync, readFileSync } from "node:fs";
import { join } from "node:path";

let validator;
try {
  validator = (await import("gltf-validator")).default;
} catch (error) {
  if (error.code !== "ERR_MODULE_NOT_FOUND") throw error;
  console.log("skipped: gltf-validator is not installed; run 'npm ci' in tests/third_party");
  process.exit(77);
}

const folder = process.argv[2];
const names = readdirSync(folder).filter((name) => name.endsWith(".glb"));
let wrong = names.length < 10 ? 1 : 0;
for (const name of names) {
  const report = await validator.validateBytes(new Uint8Array(readFileSync(join(folder, name))), {
    uri: name,
    format: "glb",
    externalResourceFunction: async (uri) =>
      new Uint8Array(readFileSync(join(folder, decodeURIComponent(uri)))),
  });
  // That a GLB names external buffers is worth an information; a cut one must.
  // To the validator, bytes that only the extension of compression names are not used.
  const isExpected = ({ code, message }) =>
    (code === "URI_GLB" && name.endsWith(".cut.glb")) ||
    (name.includes(".compressed.") &&
      (code === "UNUSED_OBJECT" ||
        (code === "UNSUPPORTED_EXTENSION" && message.includes("EXT_meshopt_compression"))));
  const found = report.issues.messages.filter((issue) => !isExpected(issue));
  const { totalVertexCount = 0, totalTriangleCount = 0 } = report.info ?? {};
  console.log(`${name}: ${totalVertexCount} vertices, ${totalTriangleCount} triangles`);
  for (const { code, message, pointer } of found) console.log(`  ${code} ${pointer} ${message}`);
  // Every resource was really read, but those that only the extension names.
  const resources = name.includes(".compressed.") ? [] : (report.info.resources ?? []);
  const unread = resources.filter((resource) => resource.byteLength === undefined);
  if (found.length > 0 || report.issues.truncated || unread.length > 0) wrong = 1;
}
process.exit(wrong);
