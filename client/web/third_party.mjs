// A plugin of Vite's: writes which packages of npm are in the page, with their licences, for server/install/sbom.
// THIRD_PARTY names the file; without it nothing is written.
import { readdirSync, readFileSync, writeFileSync } from 'node:fs';
import { fileURLToPath } from 'node:url';

const modules = fileURLToPath(new URL('node_modules/', import.meta.url));
const apache = new URL('../../LICENSE', import.meta.url);

// What three brings of others, and does not say in its own licence.
const within = {
  draco: { license: 'Apache-2.0', text: () => readFileSync(apache, 'utf8') },
};

function licenseOf(name) {
  const file = readdirSync(modules + name).find((each) => /^licen[cs]e/i.test(each));
  if (!file) throw new Error(`${name} has no file of its licence`);
  return readFileSync(`${modules}${name}/${file}`, 'utf8');
}

function packageOf(id) {
  const path = id.slice(id.indexOf(modules) + modules.length);
  const [name] = /^(@[^/]+\/)?[^/]+/.exec(path);
  const library = /^three\/examples\/jsm\/libs\/([a-z_-]+)/.exec(path)?.[1];
  const { version, license } = JSON.parse(readFileSync(`${modules}${name}/package.json`, 'utf8'));
  const purl = `pkg:npm/${name.replace('@', '%40')}@${version}`;
  if (!library) return { name, version, purl, license, text: licenseOf(name) };
  const known = within[library];
  if (!known) throw new Error(`the licence of ${path} is not known: see third_party.mjs`);
  // Which version of it that is, three does not say.
  return { name: library, version, purl: `${purl}#examples/jsm/libs/${library}`, ...known, text: known.text() };
}

const found = new Map();

// The page and each of its workers are built by themselves, so each has one.
export function thirdParty() {
  return {
    name: 'third-party',
    generateBundle() {
      for (const id of this.getModuleIds()) {
        if (!id.includes(modules)) continue;
        const one = packageOf(id);
        found.set(one.name, one);
      }
    },
    closeBundle() {
      if (!process.env.THIRD_PARTY) return;
      const sorted = [...found.values()].sort((a, b) => a.name.localeCompare(b.name));
      writeFileSync(process.env.THIRD_PARTY, `${JSON.stringify(sorted, null, 1)}\n`);
    },
  };
}
