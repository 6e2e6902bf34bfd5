// A trail is recorded, handed out, and becomes a video that other programs can read; enf-render makes the same of it.
import { spawnSync } from 'node:child_process';
import { readFileSync } from 'node:fs';
import { dirname, join } from 'node:path';
import { check } from './desk.mjs';

const hasFfmpeg = () => !spawnSync('ffmpeg', ['-version']).error;

// What a program writes to standard output.
function outputOf(program, wish) {
  const { status, error, stdout, stderr } = spawnSync(program, wish, { maxBuffer: 1 << 30 });
  if (error) throw error;
  if (status !== 0) throw new Error(`${program} ended with ${status}: ${stderr}`);
  return stdout;
}

// Every frame of a video as grey values.
const decode = (file) => outputOf('ffmpeg', ['-v', 'error', '-i', file, '-f', 'rawvideo', '-pix_fmt', 'gray', '-']);

const meanDifference = (a, b) => a.reduce((sum, value, i) => sum + Math.abs(value - b[i]), 0) / a.length;

// The picture on screen as grey values, at this size.
function greyPicture(page, size) {
  return page.evaluate(
    ([width, height]) => {
      const small = document.createElement('canvas');
      Object.assign(small, { width, height });
      const pen = small.getContext('2d');
      pen.drawImage(document.getElementById('picture'), 0, 0, width, height);
      const { data } = pen.getImageData(0, 0, width, height);
      return Array.from({ length: width * height }, (_, i) =>
        Math.round(0.299 * data[4 * i] + 0.587 * data[4 * i + 1] + 0.114 * data[4 * i + 2]),
      );
    },
    size,
  );
}

// The video against what the program for it renders of the edit file: frame by frame the same, and as far from that of
// the same edit backwards as its frames are from each other.
function compareWithRendered(frames, { width, height, count }, edit, server) {
  const size = width * height;
  const out = join(server.scratch, 'rendered.mp4');
  const wish = [server.run, '--edit', edit, '--size', `${width}x${height}`, '--out', out, '--quiet'];
  outputOf(join(dirname(server.program), 'enf-render'), wish);
  const rendered = decode(out);
  check(rendered.length === frames.length, 'enf-render makes as many frames of the edit file');
  const frameOf = (video, i) => video.subarray(i * size, (i + 1) * size);
  const farthest = (other) =>
    Math.max(...Array.from({ length: count }, (_, i) => meanDifference(frameOf(frames, i), frameOf(rendered, other(i)))));
  const [same, backwards] = [farthest((i) => i), farthest((i) => count - 1 - i)];
  check(same < 2, `of which none is more than ${same.toFixed(2)} of 255 grey values from the editor's`);
  check(backwards > 2 * Math.max(same, 1), `backwards they would be ${backwards.toFixed(2)} grey values away`);
}

export async function trail({ tab, server }) {
  const { page } = tab;
  await tab.still();
  const [x, y] = await tab.centerOf('.handle');
  await page.click('#record');
  await tab.drag([
    [x, y],
    [x + 60, y - 80],
  ]);
  await page.click('#record');
  await tab.until(() => !document.getElementById('video').disabled);
  await tab.still();
  await tab.shot('trail');

  const { path } = await tab.download(() => page.click('#download-edit'));
  const edit = JSON.parse(readFileSync(path, 'utf8'));
  check(edit.frames.length > 2, `the trail is handed out as an edit file of ${edit.frames.length} frames`);

  const width = Number(await page.locator('#video-width option').first().getAttribute('value')); // the smallest
  await page.selectOption('#video-width', String(width));
  await page.click('#video');
  await tab.until(() => !document.getElementById('video-file').hidden, null, 120);
  const video = await tab.download(() => page.click('#video-file'));
  check(video.name === 'edited.mp4', `the recorded trail becomes a video, saved as ${video.name}`);
  if (hasFfmpeg()) {
    const frames = decode(video.path);
    const [w, h] = (await tab.picture()).split(':')[0].split('x').map(Number);
    const height = 2 * Math.round((width * h) / w / 2);
    const size = width * height;
    check(frames.length === size * edit.frames.length, `all its frames can be decoded, at ${width} x ${height}`);
    const [first, last] = [frames.subarray(0, size), frames.subarray(frames.length - size)];
    const shown = await greyPicture(page, [width, height]);
    const [toFirst, toLast] = [meanDifference(shown, first), meanDifference(shown, last)];
    check(toLast < 4, `its last frame is the picture on screen, but for ${toLast.toFixed(2)} of 255 grey values`);
    check(toFirst > 2 * toLast, `its first one is another: ${toFirst.toFixed(2)} grey values away`);
    compareWithRendered(frames, { width, height, count: edit.frames.length }, path, server);
  } else {
    console.log('SKIPPED: what is in the video, as there is no ffmpeg here to decode it; scripts/setup installs it');
  }

  await page.selectOption('#fps', '60');
  await page.selectOption('#video-width', '1280');
  await page.click('#video');
  await page.click('#video-cancel');
  await tab.until(() => document.getElementById('video-cancel').hidden);
  check(await page.isHidden('#video-file'), 'a video that is cancelled is not offered');
  await page.click('#trail-clear');
  await tab.until(() => document.getElementById('trail-at').textContent === 'empty');
  check(await page.isDisabled('#video'), 'a trail that was cleared makes no video');
}
