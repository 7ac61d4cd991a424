// Prints the issues that the Khronos validator finds in the .glb files given as arguments; status 1 if there are any.
const fs = require('fs');
const { validateBytes } = require('gltf-validator');

async function main(paths) {
  let issues = 0;
  for (const path of paths) {
    const report = await validateBytes(new Uint8Array(fs.readFileSync(path)), { uri: path });
    for (const message of report.issues.messages) {
      console.log(`${path}: ${message.code} ${message.pointer || ''}: ${message.message}`);
      issues += 1;
    }
  }
  return issues === 0 ? 0 : 1;
}

main(process.argv.slice(2)).then(
  (status) => process.exit(status),
  (error) => {
    console.log(`the validator failed: ${error}`);
    process.exit(1);
  },
);
