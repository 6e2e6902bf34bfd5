// The editor in a real browser: node editor_test.mjs ENF_EDIT RUN [--measure] [--screenshots FOLDER]
//
// Needs a run with key points. Ends with 0, with 77 (skipped) where there is no Chromium, and with 1 where a check
// fails. --measure drags for ten seconds and prints how long the picture takes to follow the pointer.
import { spawn } from 'node:child_process';
import { mkdirSync, writeFileSync } from 'node:fs';
import { join } from 'node:path';
import { Browser, findChromium, pause } from './browser.mjs';

const [program, run, ...flags] = process.argv.slice(2);
const chromium = findChromium();
if (!chromium) {
  console.log('skipped: no Chromium here');
  process.exit(77);
}
const folder = flags.includes('--screenshots') ? flags[flags.indexOf('--screenshots') + 1] : '';
if (folder) mkdirSync(folder, { recursive: true });

let failures = 0;
function check(condition, what) {
  console.log(`${condition ? 'passed' : 'FAILED'}: ${what}`);
  if (!condition) ++failures;
}

const server = spawn(program, [run, '--port', '0', '--quiet'], { stdio: ['ignore', 'pipe', 'inherit'] });
const url = await new Promise((found) => server.stdout.once('data', (data) => found(String(data).trim())));
const browser = new Browser(chromium);

const picture = () =>
  browser.evaluate(`(() => { const c = document.getElementById('picture');
  return c.width + 'x' + c.height + ':' + c.toDataURL(); })()`);
const centerOf = (selector) =>
  browser.evaluate(`(() => { const r = document.querySelector('${selector}').getBoundingClientRect();
  return [r.x + r.width / 2, r.y + r.height / 2]; })()`);
const textOf = (id) => browser.evaluate(`document.getElementById('${id}').textContent`);
const shot = async (name) => folder && writeFileSync(join(folder, name), await browser.screenshot());
// The picture of a state that rests: the same twice in a row, half a second apart.
async function still() {
  for (let last = ''; ; await pause(500)) {
    const now = await picture();
    if (now === last) return now;
    last = now;
  }
}

async function drag(path, { steps = 10, wait = 16, modifiers = 0 } = {}) {
  await browser.mouse('mouseMoved', path[0]);
  await browser.mouse('mousePressed', path[0], { modifiers });
  for (let i = 1; i < path.length; ++i) {
    for (let k = 1; k <= steps; ++k) {
      const at = [0, 1].map((axis) => path[i - 1][axis] + ((path[i][axis] - path[i - 1][axis]) * k) / steps);
      await browser.mouse('mouseMoved', at, { buttons: 1, modifiers });
      await pause(wait);
    }
  }
  await browser.mouse('mouseReleased', path[path.length - 1], { modifiers });
}

async function measure() {
  if (flags.includes('--fixed')) await browser.evaluate(`document.documentElement.dataset.preview = 160`);
  const [x, y] = await centerOf('.handle');
  await browser.evaluate('performance.clearMeasures()');
  const path = [[x, y]];
  for (let i = 0; i < 20; ++i) path.push([x + 60 * Math.sin(i), y - 40 * Math.abs(Math.sin(0.7 * i))]);
  await drag(path, { steps: 30, wait: 16 });
  await pause(1000);
  const shown = await browser.evaluate(
    `performance.getEntriesByName('move to picture').map((entry) => [entry.duration, entry.detail.rendering, entry.detail.width])`,
  );
  const of = (column, share) =>
    shown
      .map((row) => row[column])
      .sort((a, b) => a - b)
      [Math.floor(share * (shown.length - 1))].toFixed(0);
  console.log(
    `pointer to picture: ${shown.length} pictures, ${of(2, 0)} to ${of(2, 1)} pixels wide, median ${of(0, 0.5)} ms, ` +
      `nine tenths within ${of(0, 0.9)} ms; of it rendering and waiting for it: median ${of(1, 0.5)} ms`,
  );
}

try {
  await browser.open(url);
  await browser.until(
    `document.querySelectorAll('.handle').length > 0 && document.getElementById('status').textContent.includes('ms')`,
  );
  const before = await still();
  await shot('start.png');

  const [x, y] = await centerOf('.handle');
  await drag([
    [x, y],
    [x + 40, y - 60],
  ]);
  const moved = await still();
  check(moved !== before, 'a drag changes the picture');
  const [hx, hy] = await centerOf('.handle');
  check(Math.hypot(hx - x - 40, hy - y + 60) < 2, `the handle stays under the pointer: ${hx - x}, ${hy - y}`);
  await shot('dragged.png');
  await browser.key('z', 2);
  check((await still()) === before, 'undo restores the picture bit for bit');
  await browser.key('z', 2 | 8);
  check((await still()) === moved, 'redo brings the same picture back');

  await browser.evaluate(`document.querySelector('.handle').focus()`);
  const chosen = await textOf('points');
  for (let i = 0; i < 5; ++i) await browser.key('ArrowRight');
  await still();
  check((await textOf('points')) !== chosen, 'arrow keys nudge the key point');
  await browser.key('z', 2);
  await still();
  check((await textOf('points')) === chosen, 'a row of nudges is undone at once');

  await drag([await centerOf('.handle'), [x + 250, y - 250]]);
  await still();
  check(
    await browser.evaluate(`document.querySelector('.handle').matches('.far, .beyond')`),
    'far from training the handle says so',
  );
  await shot('beyond.png');
  await browser.key('R', 8);
  await still();

  await drag([await centerOf('#overview'), [1160, 200]]);
  const turned = await still();
  check(turned !== before, 'dragging in the overview turns the camera');
  await browser.evaluate(`document.getElementById('weights').click()`);
  check((await still()) !== turned, 'weights colour the picture');
  await shot('weights.png');
  await browser.evaluate(`document.getElementById('weights').click(); document.getElementById('reset-camera').click()`);
  check((await still()) === before, 'camera, key points and weights come back to the first picture');

  await browser.evaluate(`document.getElementById('record').click()`);
  await drag([
    [x, y],
    [x + 30, y - 50],
    [x, y],
  ]);
  await pause(300);
  await browser.evaluate(`document.getElementById('record').click()`);
  await browser.until(`!document.getElementById('video').disabled`);
  await shot('trail.png');
  await browser.evaluate(`document.getElementById('video').click()`);
  await browser.until(`!document.getElementById('video-file').hidden`, 120);
  check(true, 'the recorded trail becomes a video');
  await browser.evaluate(`document.getElementById('theme').click()`);
  await shot('theme.png');
  if (flags.includes('--measure')) await measure();
  check(browser.problems.length === 0, `the page reports no errors ${browser.problems.join('; ')}`);

  server.kill('SIGINT');
  check((await new Promise((ended) => server.on('exit', ended))) === 0, 'Ctrl-C ends the server with 0');
  await browser.until(`!document.getElementById('gone').hidden`);
  check(true, 'the page says that the server has gone');
  await shot('gone.png');
} catch (error) {
  check(false, error.stack);
} finally {
  await browser.close();
  server.kill();
}
process.exit(failures ? 1 : 0);
