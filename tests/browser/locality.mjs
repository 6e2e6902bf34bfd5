// In a trained run, a drag changes the picture where the key point's part was and is, and not elsewhere.
import { check } from './desk.mjs';

const CHANGED = 24; // of 255, in any channel: more than JPEG and faint light make of it
const NEAR = 0.3; // of the picture's width: how far the part reaches from its key point

const pixels = (page) =>
  page.evaluate(() => {
    const canvas = document.getElementById('picture');
    const { data } = canvas.getContext('2d').getImageData(0, 0, canvas.width, canvas.height);
    return { width: canvas.width, height: canvas.height, data: Array.from(data) };
  });

// Shares of the pixels within NEAR of `places` (shares of the width), and of all others, that changed.
function shares(before, after, places) {
  const counts = { near: 0, nearChanged: 0, far: 0, farChanged: 0 };
  for (let i = 0; i < before.width * before.height; ++i) {
    const [x, y] = [(i % before.width) + 0.5, Math.floor(i / before.width) + 0.5].map((at) => at / before.width);
    const changed = [0, 1, 2].some((c) => Math.abs(before.data[4 * i + c] - after.data[4 * i + c]) > CHANGED);
    const where = places.some(([u, v]) => Math.hypot(x - u, y - v) < NEAR) ? 'near' : 'far';
    ++counts[where];
    if (changed) ++counts[`${where}Changed`];
  }
  return { near: counts.nearChanged / counts.near, far: counts.farChanged / counts.far };
}

export async function locality({ tab }) {
  const { page } = tab;
  const frame = await page.locator('#frame').boundingBox();
  const places = [];
  const place = async (n) => {
    const [x, y] = await tab.centerOf(`.handle:nth-of-type(${n + 2})`);
    places.push([(x - frame.x) / frame.width, (y - frame.y) / frame.width]);
    return [x, y];
  };
  for (let n = 0; n < (await page.locator('.handle').count()); ++n) {
    await tab.still();
    const before = await pixels(page);
    places.length = 0;
    const [x, y] = await place(n);
    await tab.drag([
      [x, y],
      [x + 20, y - 60],
    ]);
    await tab.still();
    await place(n);
    const { near, far } = shares(before, await pixels(page), places);
    const percent = (share) => `${(100 * share).toFixed(2)}%`;
    check(near > 0.02, `key point ${n + 1}: ${percent(near)} of the pixels near it change`);
    check(far < near / 3, `and ${percent(far)} of the others`);
    await tab.key('Shift+R');
  }
}
