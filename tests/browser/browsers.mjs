// This system's own browsers, driven by Playwright, which brings none here.
import { accessSync, constants } from 'node:fs';
import { delimiter, join } from 'node:path';

export const SKIPPED = 77;

const PROGRAMS = {
  chromium: ['chromium', 'chromium-browser', 'google-chrome'],
  firefox: ['firefox-esr', 'firefox'],
};
const LAUNCH = {
  chromium: { args: ['--disable-gpu'] },
  firefox: { channel: 'moz-firefox' }, // over WebDriver BiDi, which needs no patched Firefox
};

function skip(why) {
  console.log(`skipped: ${why}`);
  process.exit(SKIPPED);
}

async function loadPlaywright() {
  try {
    return await import('playwright-core');
  } catch (error) {
    if (error.code !== 'ERR_MODULE_NOT_FOUND') throw error;
    return skip('playwright-core is not installed; scripts/setup --tests does that where there is a network');
  }
}

function isProgram(path) {
  try {
    accessSync(path, constants.X_OK);
    return true;
  } catch {
    return false;
  }
}

function findProgram(names) {
  const folders = (process.env.PATH || '').split(delimiter);
  return names.flatMap((name) => folders.map((folder) => join(folder, name))).find(isProgram);
}

// Ends the process with SKIPPED where the browser or Playwright is not there.
export async function launch(name) {
  if (!PROGRAMS[name]) throw new Error(`expected one of ${Object.keys(PROGRAMS).join(', ')}, found '${name}'`);
  const playwright = await loadPlaywright();
  const executablePath = findProgram(PROGRAMS[name]);
  if (!executablePath) return skip(`there is none of ${PROGRAMS[name].join(', ')} here`);
  return playwright[name].launch({ executablePath, ...LAUNCH[name] });
}
