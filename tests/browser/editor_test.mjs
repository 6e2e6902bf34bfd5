// The editor in a real browser:
//   node editor_test.mjs chromium|firefox ENF_EDIT RUN [--only SUBJECT,...] [--size WxH] [--screenshots FOLDER]
//                        [--drag SECONDS] [--video FILE X,Y] [--measure [--fixed]]
//
// Needs a run with key points. Ends with 0, with 77 (skipped) where the browser or Playwright is not there, and with 1
// where a check fails. --drag says how long key points and camera are dragged about at random (10); --video drives a
// key point by this file, else by clip.mp4 in RUN where that is there; --measure only drags for ten seconds and prints
// how long the picture takes to follow the pointer, --fixed with previews of 160 pixels.
import { mkdirSync } from 'node:fs';
import { join, resolve } from 'node:path';
import { launch } from './browsers.mjs';
import { anyFailed, check, Server, Tab } from './desk.mjs';
import { dragging, measure } from './dragging.mjs';
import { editing } from './editing.mjs';
import { keyboard } from './keyboard.mjs';
import { locality } from './locality.mjs';
import { keyFrames } from './key_frames.mjs';
import { look } from './look.mjs';
import { motion } from './motion.mjs';
import { outages } from './outages.mjs';
import { overview } from './overview.mjs';
import { playing } from './playing.mjs';
import { proxy } from './proxy.mjs';
import { trail } from './trail.mjs';

const SUBJECTS = {
  ...{ editing, overview, locality, keyboard, look, playing, motion, trail, 'key-frames': keyFrames, proxy, dragging },
  outages,
};

const [name, program, run, ...flags] = process.argv.slice(2);
if (!run) {
  console.error('expected: chromium|firefox ENF_EDIT RUN');
  process.exit(2);
}
const after = (flag, other, by = 1) => (flags.includes(flag) ? flags[flags.indexOf(flag) + by] : other);
const [width, height] = after('--size', '1280x720').split('x').map(Number);
const options = {
  screenshots: after('--screenshots'),
  dragSeconds: Number(after('--drag', 10)),
  clip: resolve(after('--video', join(run, 'clip.mp4'))),
  clipPoint: after('--video', '40,40', 2).split(',').map(Number),
  fixed: flags.includes('--fixed'),
};
if (options.screenshots) mkdirSync(options.screenshots, { recursive: true });

const browser = await launch(name);
const server = new Server(program, run);
// The system's colours: Playwright would else set light ones.
const context = await browser.newContext({ viewport: { width, height }, colorScheme: null });

// A tab with the editor's first picture.
async function openTab() {
  const tab = new Tab(await context.newPage(), options);
  await tab.open(server.url);
  return tab;
}

async function treat(subject, act) {
  console.log(`${subject} in ${name}`);
  const start = performance.now();
  try {
    const tab = await openTab();
    await act({ tab, server, context, openTab, options });
    check(tab.problems.length === 0, `the page reports no errors ${tab.problems.join('; ')}`);
    await tab.page.close();
  } catch (error) {
    check(false, `${subject}: ${error.stack}`);
  }
  console.log(`${subject} in ${name}: ${((performance.now() - start) / 1000).toFixed(1)} s`);
}

try {
  await server.start();
  const chosen = after('--only', Object.keys(SUBJECTS).join(',')).split(',');
  if (flags.includes('--measure')) await treat('measure', measure);
  else for (const subject of chosen) await treat(subject, SUBJECTS[subject]);
} finally {
  await browser.close();
  server.remove();
}
process.exit(anyFailed() ? 1 : 0);
