// NASA's reader of 3D Tiles for three.js, out of the npm package `3d-tiles-renderer`, in Node.js:
//   await openTiles(folder) -> { show(errorTarget), requested, close() }
// Nothing is drawn. Here are stand-ins for what only a browser has, and a server for the files.
import { existsSync, readFileSync } from "node:fs";
import { createServer } from "node:http";
import { join } from "node:path";

globalThis.self = globalThis;
globalThis.window ??= globalThis;
globalThis.location = { href: "http://localhost/" };
globalThis.requestAnimationFrame = (call) => setTimeout(call, 0);
globalThis.cancelAnimationFrame = clearTimeout;
globalThis.document ??= { addEventListener() {}, createElement: () => ({}), hidden: false };

// Throws an error with the code ERR_MODULE_NOT_FOUND where the packages are not installed.
const { Box3, PerspectiveCamera, Sphere, Triangle, Vector3 } = await import("three");
const { MeshoptDecoder } = await import("three/addons/libs/meshopt_decoder.module.js");
const { TilesRenderer } = await import("3d-tiles-renderer/three");
const { GLTFExtensionsPlugin } = await import("3d-tiles-renderer/three/plugins");

const pause = () => new Promise((resolve) => setTimeout(resolve, 1));

/** What is shown: { tiles, triangles, area, box } of the world. */
function measure(tiles) {
  const shown = { tiles: 0, triangles: 0, area: 0, box: new Box3() };
  const corner = [new Vector3(), new Vector3(), new Vector3()];
  const triangle = new Triangle(...corner);
  tiles.group.updateMatrixWorld(true);
  tiles.forEachLoadedModel((scene, tile) => {
    if (!tiles.visibleTiles.has(tile)) return;
    ++shown.tiles;
    scene.traverse((mesh) => {
      if (!mesh.isMesh) return;
      const { index, attributes } = mesh.geometry;
      for (let i = 0; i < index.count; i += 3) {
        corner.forEach((point, k) => {
          point.fromBufferAttribute(attributes.position, index.getX(i + k));
          point.applyMatrix4(mesh.matrixWorld);
          shown.box.expandByPoint(point);
        });
        triangle.set(...corner);
        shown.area += triangle.getArea();
      }
      shown.triangles += index.count / 3;
    });
  });
  return shown;
}

export async function openTiles(folder) {
  const requested = new Set();
  const server = createServer((request, response) => {
    const name = decodeURIComponent(request.url).replace(/^\/tiles\//, "");
    requested.add(name);
    response.statusCode = existsSync(join(folder, name)) ? 200 : 404;
    response.end(response.statusCode === 200 ? readFileSync(join(folder, name)) : undefined);
  });
  await new Promise((resolve) => server.listen(0, "localhost", resolve));
  const tiles = new TilesRenderer(`http://localhost:${server.address().port}/tiles/tileset.json`);
  tiles.registerPlugin(new GLTFExtensionsPlugin({ meshoptDecoder: MeshoptDecoder, autoDispose: false }));
  let failure = null;
  tiles.addEventListener("load-error", ({ error }) => (failure = error));
  const camera = new PerspectiveCamera(60, 1, 1, 2);
  tiles.setCamera(camera);
  tiles.setResolution(camera, 1000, 1000);

  /** Loads what a camera needs that sees all of it, until nothing changes. */
  async function show(errorTarget) {
    tiles.errorTarget = errorTarget;
    const sphere = new Sphere();
    let before = "";
    for (let still = 0; still < 60 && !failure; ) {
      if (tiles.getBoundingSphere(sphere)) {
        camera.position.copy(sphere.center);
        camera.position.z += 3 * sphere.radius;
        camera.near = sphere.radius;
        camera.far = 5 * sphere.radius;
        camera.updateProjectionMatrix();
        camera.updateMatrixWorld();
      }
      tiles.update();
      const { inCache, queued, downloading, parsing, visible } = tiles.stats;
      const now = [inCache, queued, downloading, parsing, visible].join();
      still = now === before && queued + downloading + parsing === 0 && tiles.root ? still + 1 : 0;
      before = now;
      await pause();
    }
    if (failure) throw failure;
    return measure(tiles);
  }
  const close = () => {
    tiles.dispose();
    server.closeAllConnections();
    server.close();
  };
  return { show, requested, close };
}
