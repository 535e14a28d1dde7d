// Runs the tests in modules of visavis-kernel-tests: node kernels_check.mjs NATIVE MODULE...
// NATIVE: a line for each operation, as the native build prints them: its name, the digest of its results, cases, levels.
import { readFileSync } from 'node:fs';
import { basename, dirname } from 'node:path';

const [native, ...paths] = process.argv.slice(2);
const digests = new Map(native.split('\n').map((line) => line.split(' ')).filter((words) => words.length === 4)
  .map(([name, digest]) => [name, digest]));
let failures = 0;
let ran = 0;

/** Calls `use` with the exports of a fresh instance, and returns what it reports. */
function instance(module, use) {
  let text = '';
  const { exports } = new WebAssembly.Instance(module, {
    env: {
      visavis_now_ms: () => performance.now(),
      visavis_report: (at, length) => { text += Buffer.from(exports.memory.buffer, at, length).toString(); },
    },
  });
  try {
    use(exports);
  } catch (error) {
    // A panic traps, after its message.
    return { failed: text || String(error) };
  }
  return { text };
}

for (const path of paths) {
  const build = basename(dirname(dirname(dirname(path))));
  const bytes = readFileSync(path);
  if (!WebAssembly.validate(bytes)) {
    console.error(`${build}: this Node (${process.version}) does not know its instructions; use Node 20 or later`);
    process.exit(1);
  }
  const module = new WebAssembly.Module(bytes);
  let count = 0;
  instance(module, (exports) => { count = exports.count(); });
  const levels = new Set();
  let cases = 0;
  for (let i = 0; i < count; i++) {
    const { text, failed } = instance(module, (exports) => exports.run(i));
    ran += 1;
    const [name, digest, number, tested] = (text ?? '').split(' ');
    if (failed) {
      failures += 1;
      console.error(`${build}: ${failed}`);
    } else if (digest !== '-') {
      cases += Number(number);
      tested.split(',').forEach((level) => levels.add(level));
      if (digests.get(name) !== digest) {
        failures += 1;
        console.error(`${build}: ${name}: the reference has other bits than natively (${digest}, ${digests.get(name)})`);
      }
    }
  }
  console.log(`${build}: ${count} tests, ${cases} cases at ${[...levels].join(', ')}`);
  const expected = build.includes('relaxed') ? ['scalar', 'simd128', 'relaxed'] : ['scalar', 'simd128'];
  if (count < 13 || expected.some((level) => !levels.has(level))) {
    failures += 1;
    console.error(`${build}: expected all operations at ${expected.join(', ')}`);
  }
}
console.log(failures === 0 ? `${ran} tests passed` : `${failures} failures`);
process.exit(failures === 0 && paths.length > 0 ? 0 : 1);
