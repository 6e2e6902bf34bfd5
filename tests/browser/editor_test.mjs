// The editor in a real browser:
//   node editor_test.mjs ENF_EDIT RUN [--measure] [--drag SECONDS] [--video FILE X,Y] [--size WxH] [--screenshots FOLDER]
//
// Needs a run with key points. Ends with 0, with 77 (skipped) where there is no Chromium, and with 1 where a check
// fails. --measure drags for ten seconds and prints how long the picture takes to follow the pointer; --drag says how
// long key points and camera are dragged about at random (20); --video drives a key point by this file, else by
// clip.mp4 in RUN where that is there.
import { spawn } from 'node:child_process';
import { cpSync, existsSync, mkdirSync, mkdtempSync, readFileSync, rmSync, writeFileSync } from 'node:fs';
import { tmpdir } from 'node:os';
import { join, resolve } from 'node:path';
import { Browser, findChromium, pause } from './browser.mjs';

const [program, run, ...flags] = process.argv.slice(2);
const chromium = findChromium();
if (!chromium) {
  console.log('skipped: no Chromium here');
  process.exit(77);
}
const after = (flag, other, by = 1) => (flags.includes(flag) ? flags[flags.indexOf(flag) + by] : other);
const folder = after('--screenshots', '');
const [width, height] = after('--size', '1280x720').split('x').map(Number);
const dragSeconds = Number(after('--drag', 20));
const clip = resolve(after('--video', join(run, 'clip.mp4')));
const clipPoint = after('--video', '40,40', 2).split(',').map(Number);
if (folder) mkdirSync(folder, { recursive: true });

let failures = 0;
function check(condition, what) {
  console.log(`${condition ? 'passed' : 'FAILED'}: ${what}`);
  if (!condition) ++failures;
}

// A copy of the run, which is deleted while the editor goes on, and a token that outlives the server.
const scratch = mkdtempSync(join(tmpdir(), 'enf-browser-test-'));
const copy = join(scratch, 'run');
cpSync(run, copy, { recursive: true });
let server, url;
async function startServer(of, port) {
  const flags = ['--port', String(port), '--quiet', '--token-file', join(scratch, 'token')];
  server = spawn(program, [of, ...flags], { stdio: ['ignore', 'pipe', 'inherit'] });
  url = await new Promise((found) => server.stdout.once('data', (data) => found(String(data).trim())));
}
await startServer(copy, 0);
const browser = new Browser(chromium, { width, height });

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

// Bytes of memory that the server holds.
const memory = () => 1024 * Number(/VmRSS:\s+(\d+)/.exec(readFileSync(`/proc/${server.pid}/status`, 'utf8'))[1]);
const MiB = 1 << 20;

// Key points and camera here and there, with a second tab that does nothing else meanwhile.
async function dragAtRandom(seconds) {
  await browser.evaluate(`(() => { let last = performance.now(); window.longest = 0; const step = (now) => {
    window.longest = Math.max(window.longest, now - last); last = now; requestAnimationFrame(step); };
    requestAnimationFrame(step); performance.clearMeasures(); })()`);
  let seed = 1;
  const random = () => (seed = (seed * 16807) % 2147483647) / 2147483647;
  const start = Date.now();
  const sizes = [];
  for (let i = 0; Date.now() - start < 1000 * seconds; ++i) {
    const at = await centerOf(i % 5 === 4 ? '#overview' : `.handle:nth-of-type(${2 + (i % 2)})`).catch(() => centerOf('.handle'));
    const inside = (value, most) => Math.min(Math.max(value, 20), most - 120);
    const to = [inside(at[0] + 300 * (random() - 0.5), width), inside(at[1] + 240 * (random() - 0.5), height)];
    await drag([at, to], { steps: 12, wait: 12 });
    if (i % 7 === 6) await browser.key('R', 8);
    if (i % 11 === 10) await browser.key('C');
    if (i % 20 === 0) sizes.push(memory());
  }
  await browser.key('R', 8);
  await browser.key('C');
  await still();
  sizes.push(memory());
  // The first minute fills the store of finished pictures, 64 MiB.
  const settled = sizes[Math.min(sizes.length - 1, Math.floor(sizes.length / 10))];
  const [peak, end, longest, pictures] = [
    Math.max(...sizes),
    sizes[sizes.length - 1],
    await browser.evaluate('window.longest'),
    await browser.evaluate(`performance.getEntriesByName('move to picture').length`),
  ];
  console.log(
    `${seconds} s of dragging: ${pictures} pictures, longest time between two frames of the page ${longest.toFixed(0)} ms; ` +
      `server ${(settled / MiB).toFixed(0)} MiB after a tenth, ${(end / MiB).toFixed(0)} at the end, ${(peak / MiB).toFixed(0)} at most`,
  );
  check(pictures > seconds, 'the picture follows at random');
  check(end - settled < 96 * MiB, 'dragging leaks nothing');
}

async function driveByVideo() {
  await browser.key('v');
  await browser.until(`document.getElementById('motion-box').open`);
  const { root } = await browser.send('DOM.getDocument');
  const { nodeId } = await browser.send('DOM.querySelector', { nodeId: root.nodeId, selector: '#motion-file' });
  await browser.send('DOM.setFileInputFiles', { nodeId, files: [clip] });
  await browser.until(`!document.getElementById('motion-picture').hidden`);
  const at = await browser.evaluate(`(() => { const c = document.getElementById('motion-picture'), r = c.getBoundingClientRect(),
      zoom = (Number(c.dataset.zoom) * r.width) / c.width;
    return [r.x + ${clipPoint[0]} * zoom, r.y + ${clipPoint[1]} * zoom]; })()`);
  await browser.mouse('mousePressed', at);
  await browser.mouse('mouseReleased', at);
  await browser.until(`!document.getElementById('motion-apply').disabled`, 120);
  check((await textOf('motion-says')).includes('Followed through'), 'a point of a video is followed');
  await shot('motion.png');
  const before = await textOf('points');
  await browser.evaluate(`document.getElementById('motion-preview').click()`);
  await browser.until(`document.getElementById('points').textContent !== ${JSON.stringify(before)}`);
  await browser.until(`!document.getElementById('motion-box').classList.contains('playing')`, 60);
  await still();
  check((await textOf('points')) === before, 'a preview moves the key point and puts it back');
  await browser.evaluate(`document.getElementById('motion-apply').click()`);
  await browser.until(`!document.getElementById('video').disabled`);
  check((await textOf('trail-at')) !== 'empty', 'the motion of a video becomes the trail');
  await browser.key('z', 2);
  await browser.evaluate(`document.getElementById('trail-clear').click()`);
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

async function endServer(what) {
  server.kill('SIGINT');
  check((await new Promise((ended) => server.on('exit', ended))) === 0, what);
}

try {
  await browser.open(url);
  await browser.until(
    `document.querySelectorAll('.handle').length > 0 && document.getElementById('status').textContent.includes('ms')`,
  );
  const before = await still();
  await shot('start.png');
  rmSync(copy, { recursive: true });
  check(true, 'the run folder is deleted: all that follows works without it');

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

  await drag([await centerOf('.handle'), [x + 250, Math.max(y - 250, 60)]]);
  await still();
  check(
    await browser.evaluate(`document.querySelector('.handle').matches('.far, .beyond')`),
    'far from training the handle says so',
  );
  await shot('beyond.png');
  await browser.key('R', 8);
  await still();

  await drag([await centerOf('#overview'), (await centerOf('#overview')).map((value) => value + 30)]);
  const turned = await still();
  check(turned !== before, 'dragging in the overview turns the camera');
  await browser.evaluate(`document.getElementById('weights').click()`);
  check((await still()) !== turned, 'weights colour the picture');
  await shot('weights.png');
  await browser.evaluate(`document.getElementById('weights').click(); document.getElementById('reset-camera').click()`);
  check((await still()) === before, 'camera, key points and weights come back to the first picture');

  if (existsSync(clip)) await driveByVideo();
  await still();

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
  await browser.key('R', 8);
  await browser.key('C');
  const here = await still();
  const first = browser.session;
  await browser.open(url);
  await browser.until(`document.querySelectorAll('.handle').length > 0`);
  await still();
  await drag([await centerOf('.handle'), [x + 30, y + 20]]);
  await still();
  browser.session = first;
  await browser.send('Page.bringToFront');
  check((await still()) === here, 'a second tab edits for itself');
  await dragAtRandom(dragSeconds);
  check(browser.problems.length === 0, `the page reports no errors ${browser.problems.join('; ')}`);

  await drag([await centerOf('.handle'), [x + 25, y - 15]]);
  await still();
  const placed = await textOf('points');
  await endServer('Ctrl-C ends the server with 0');
  await browser.until(`!document.getElementById('gone').hidden`);
  await startServer(run, new URL(url).port);
  await browser.until(`document.getElementById('gone').textContent.includes('started anew')`);
  await still();
  check((await textOf('points')) === placed, 'after a restart of the server the page puts key points back, and says so');
  browser.problems.length = 0;
  await endServer('Ctrl-C ends the second server with 0');
  await browser.until(`!document.getElementById('gone').hidden`);
  check(true, 'the page says that the server has gone');
  await shot('gone.png');
} catch (error) {
  check(false, error.stack);
} finally {
  await browser.close();
  server.kill();
  rmSync(scratch, { recursive: true, force: true });
}
process.exit(failures ? 1 : 0);
