// zarrita with the short decoder of packed bricks must find the samples that were packed.
//   node check_packed.mjs ISOBRICK READERS
// Exit status: 0 equal, 1 different, 77 zarrita is missing.
import { spawnSync } from "node:child_process";
import { mkdtempSync, readFileSync, rmSync } from "node:fs";
import { tmpdir } from "node:os";
import { join } from "node:path";
import { pathToFileURL } from "node:url";

let zarr, FileSystemStore;
try {
  zarr = await import("zarrita");
  ({ FileSystemStore } = await import("@zarrita/storage"));
} catch (error) {
  if (error.code !== "ERR_MODULE_NOT_FOUND") throw error;
  console.log("skipped: zarrita is not installed; run 'npm ci' in tests/third_party");
  process.exit(77);
}
const [isobrick, readers] = process.argv.slice(2);
const { PackedCodec } = await import(pathToFileURL(join(readers, "packed.mjs")));
zarr.registry.set("isobrick.packed", async () => PackedCodec);

const folder = mkdtempSync(join(tmpdir(), "isobrick-packed-"));
let failures = 0;

function run(...words) {
  const { status, stderr } = spawnSync(isobrick, words, { encoding: "utf8" });
  if (status !== 0) throw new Error(`${words.join(" ")}: ${stderr}`);
}

for (const type of ["u8", "i8", "u16", "i16", "u32", "i32", "f32", "f64"])
  for (const field of ["gyroid", "cells"]) {
    if (field === "cells" && type.startsWith("f")) continue;
    const store = join(folder, `${field}_${type}.zarr`);
    run("synth", field, store, "--dims", "50,33,40", "--type", type, "--brick", "24", "--codec",
      "packed");
    run("export", store, join(folder, "a.raw"), "--force");
    const array = await zarr.open.v3(new FileSystemStore(join(store, "0")), { kind: "array" });
    const { data } = await zarr.get(array);
    const expected = readFileSync(join(folder, "a.raw"));
    const found = Buffer.from(data.buffer, data.byteOffset, data.byteLength);
    if (found.equals(expected)) continue;
    ++failures;
    console.log(`wrong: ${field} of ${type}`);
  }
rmSync(folder, { recursive: true });
process.exit(failures ? 1 : 0);
