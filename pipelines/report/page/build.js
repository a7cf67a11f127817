// node build.js OUT.cc: bundles the page with its libraries, styles and script into one piece of
// HTML without data, and that into a C++ source.
import {readFileSync, writeFileSync} from 'node:fs';
import {fileURLToPath} from 'node:url';
import * as esbuild from 'esbuild';

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
  '@@STYLE@@': await bundled('report.css'),
  // A script element ends at the first </script, wherever it stands.
  '@@SCRIPT@@': (await bundled('report.js')).replaceAll('</script', '<\\/script'),
};
let page = readFileSync(here('report.html'), 'utf8');
for (const [mark, text] of Object.entries(parts)) page = page.replace(mark, () => text);

const bytes = Array.from(Buffer.from(page, 'utf8'));
writeFileSync(process.argv[2], `// Made by build.js.
#include "pipelines/report/report_page.h"

namespace cohort {
namespace {
constexpr char kBytes[] = {${bytes.map((b) => (b > 127 ? b - 256 : b)).join(',')}};
}  // namespace
const std::string_view kReportPage(kBytes, sizeof(kBytes));
}  // namespace cohort
`);
