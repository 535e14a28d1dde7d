// Validates .glb and .vrma files; prints one line a check and exits 1 on any error or warning. Given a .bvh as well, all files
// are taken for the same motion and compared joint by joint.
import { readFileSync } from 'node:fs';
import { basename } from 'node:path';
import validator from 'gltf-validator';
import { agree } from './agree.mjs';
import { checkGlb, checkVrma } from './structure.mjs';
import { load } from './load.mjs';

const files = process.argv.slice(2);
if (files.length === 0) {
  console.error('usage: validate.mjs FILE.glb|FILE.vrma|FILE.bvh ...');
  process.exit(2);
}

let failed = false;
const report = (file, check, problems, note) => {
  failed ||= problems.length > 0;
  console.log(`${basename(file)}: ${check}: ${problems.length === 0 ? 'ok' : 'FAILED'}${note ? `, ${note}` : ''}`);
  for (const problem of problems) console.log(`  ${problem}`);
};

for (const file of files.filter((f) => !f.endsWith('.bvh'))) {
  try {
    const bytes = new Uint8Array(readFileSync(file));
    const result = await validator.validateBytes(bytes, { uri: basename(file), maxIssues: 0 });
    const { numErrors, numWarnings, numInfos, numHints, messages } = result.issues;
    // Severity 0 is an error, 1 a warning. An extension that the validator does not know is information only.
    const problems = messages.filter((m) => m.severity <= 1).map((m) => `${m.code} at ${m.pointer ?? m.offset}: ${m.message}`);
    const counts = `${numErrors} errors, ${numWarnings} warnings, ${numInfos} infos, ${numHints} hints`;
    const infos = [...new Set(messages.filter((m) => m.severity > 1).map((m) => m.code))].join(' ');
    report(file, `glTF validator ${validator.version()}`, problems, infos ? `${counts} (${infos})` : counts);

    const vrma = file.endsWith('.vrma');
    report(file, vrma ? 'VRM animation structure' : 'structure', vrma ? checkVrma(bytes) : checkGlb(bytes));
    const { problems: loading, note } = await load(bytes, vrma);
    report(file, vrma ? 'three-vrm-animation' : 'three', loading, note);
  } catch (error) {
    report(file, 'read', [String(error)]);
  }
}

if (files.length > 1 && files.some((f) => f.endsWith('.bvh'))) {
  try {
    const { problems, note } = await agree(files.map((f) => [basename(f), new Uint8Array(readFileSync(f))]));
    report('all files', 'same motion', problems, note);
  } catch (error) {
    report('all files', 'same motion', [String(error)]);
  }
}
process.exit(failed ? 1 : 0);
