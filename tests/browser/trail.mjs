// A trail is recorded, handed out, and becomes a video that other programs can read.
import { spawnSync } from 'node:child_process';
import { readFileSync } from 'node:fs';
import { check } from './desk.mjs';

const WIDTH = 320;

// Every frame of a video as grey values; nothing where there is no ffmpeg.
function decode(file) {
  const wish = ['-v', 'error', '-i', file, '-f', 'rawvideo', '-pix_fmt', 'gray', '-'];
  const { status, error, stdout, stderr } = spawnSync('ffmpeg', wish, { maxBuffer: 1 << 30 });
  if (error) return null;
  if (status !== 0) throw new Error(`ffmpeg: ${stderr}`);
  return stdout;
}

const meanDifference = (a, b) => a.reduce((sum, value, i) => sum + Math.abs(value - b[i]), 0) / a.length;

// The picture on screen as grey values, at the size of the video.
function greyPicture(page, height) {
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
    [WIDTH, height],
  );
}

export async function trail({ tab }) {
  const { page } = tab;
  await tab.still();
  const [x, y] = await tab.centerOf('.handle');
  await page.click('#record');
  await tab.drag([
    [x, y],
    [x + 30, y - 50],
  ]);
  await page.click('#record');
  await tab.until(() => !document.getElementById('video').disabled);
  await tab.still();
  await tab.shot('trail');

  const { path } = await tab.download(() => page.click('#download-edit'));
  const edit = JSON.parse(readFileSync(path, 'utf8'));
  check(edit.frames.length > 2, `the trail is handed out as an edit file of ${edit.frames.length} frames`);

  await page.selectOption('#video-width', String(WIDTH));
  await page.click('#video');
  await tab.until(() => !document.getElementById('video-file').hidden, null, 120);
  const video = await tab.download(() => page.click('#video-file'));
  check(video.name === 'edited.mp4', `the recorded trail becomes a video, saved as ${video.name}`);
  const frames = decode(video.path);
  if (frames) {
    const [w, h] = (await tab.picture()).split(':')[0].split('x').map(Number);
    const height = 2 * Math.round((WIDTH * h) / w / 2);
    const size = WIDTH * height;
    check(frames.length === size * edit.frames.length, `all its frames can be decoded, at ${WIDTH} x ${height}`);
    const [first, last] = [frames.subarray(0, size), frames.subarray(frames.length - size)];
    const shown = await greyPicture(page, height);
    const [toFirst, toLast] = [meanDifference(shown, first), meanDifference(shown, last)];
    check(toLast < 4, `its last frame is the picture on screen, but for ${toLast.toFixed(2)} of 255 grey values`);
    check(toFirst > 2 * toLast, `its first one is another: ${toFirst.toFixed(2)} grey values away`);
  } else {
    console.log('passed over: there is no ffmpeg to decode the video');
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
