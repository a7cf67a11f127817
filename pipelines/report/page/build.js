// node build.js NAME CONSTANT OUT.cc: bundles NAME.html with its libraries, NAME.css and NAME.js into
// one piece of HTML without data, and that into a C++ source that defines CONSTANT.
import {createHash} from 'node:crypto';
import {readFileSync, writeFileSync} from 'node:fs';
import {fileURLToPath} from 'node:url';
import * as esbuild from 'esbuild';

const [name, constant, out] = process.argv.slice(2);
const here = (name) => fileURLToPath(new URL(name, import.meta.url));

const bundled = async (name) => {
  const result = await esbuild.build({
    entryPoints: [here(name)],
    bundle: true,
    minify: true,
    write: false,
    legalComments: 'inline',
    charset: 'ascii',
    target: 'es2020',
  });
  return result.outputFiles[0].text.trim();
};

const parts = {
  '@@STYLE@@': await bundled(`${name}.css`),
  // A script element ends at the first </script, wherever it stands.
  '@@SCRIPT@@': (await bundled(`${name}.js`)).replaceAll('</script', '<\\/script'),
};
// The page's own script and style may run, by their hashes, and nothing else: what a name in the data
// could bring, nor anything from elsewhere.
for (const name of ['STYLE', 'SCRIPT']) {
  const hash = createHash('sha256').update(parts[`@@${name}@@`], 'utf8').digest('base64');
  parts[`@@${name}_HASH@@`] = `'sha256-${hash}'`;
}
let page = readFileSync(here(`${name}.html`), 'utf8');
for (const [mark, text] of Object.entries(parts)) page = page.replace(mark, () => text);

const bytes = Array.from(Buffer.from(page, 'utf8'));
writeFileSync(out, `// Made by build.js.
#include "pipelines/report/report_page.h"

namespace cohort {
namespace {
constexpr char kBytes[] = {${bytes.map((b) => (b > 127 ? b - 256 : b)).join(',')}};
}  // namespace
const std::string_view ${constant}(kBytes, sizeof(kBytes));
}  // namespace cohort
`);
