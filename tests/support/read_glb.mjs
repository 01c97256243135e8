// Prints as JSON what three.js reads of the Gaussians of a .glb file: centres and covariances in the
// world of the scene, colours as bytes, and the extras of the node.
// Usage: node read_glb.mjs NODE_MODULES FILE
import { readFileSync } from 'node:fs';
import { pathToFileURL } from 'node:url';

const [modules, file] = process.argv.slice(2);
const addons = pathToFileURL(`${modules}/three/examples/jsm/loaders/`);
const { GLTFLoader } = await import(new URL('GLTFLoader.js', addons));
const extension = await import(new URL('GLTFGaussianSplatLoaderExtension.js', addons));

const loader = new GLTFLoader();
loader.register((parser) => new extension.GLTFGaussianSplatLoaderExtension(parser));
const { scene } = await loader.parseAsync(Uint8Array.from(readFileSync(file)).buffer, '');
scene.updateMatrixWorld(true);
const splats = [];
scene.traverse((object) => { if (object.isGaussianSplat) splats.push(object); });
const [{ splatGeometry, matrixWorld, userData }] = splats;
const arrays = Object.fromEntries(
  Object.entries(splatGeometry.attributes).map(([name, { array }]) => [name, Array.from(array)]),
);
console.log(JSON.stringify({
  count: splats.length, matrix: matrixWorld.elements, extras: userData.gslts, arrays,
}));
