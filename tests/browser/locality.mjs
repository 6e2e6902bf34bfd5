// In a trained run, a drag changes the picture where the key point's part was and is, and not elsewhere.
import { check } from './desk.mjs';

const CHANGED = 24; // of 255, in any channel: more than JPEG and faint light make of it
// Distances from a key point, of the picture's width: its part, mostly; what surely is no part of it; another's part.
const NEAR = 0.15;
const FAR = 0.3;
const OTHER = 0.08;

const pixels = (page) =>
  page.evaluate(() => {
    const canvas = document.getElementById('picture');
    const { data } = canvas.getContext('2d').getImageData(0, 0, canvas.width, canvas.height);
    return { width: canvas.width, height: canvas.height, data: Array.from(data) };
  });

// Shares that changed of the pixels NEAR `places` (shares of the width), of those FAR from them, and of those around
// `others`, where these are not NEAR.
function shares(before, after, places, others) {
  const [all, changed] = [1, 2].map(() => ({ near: 0, far: 0, other: 0 }));
  for (let i = 0; i < before.width * before.height; ++i) {
    const at = [(i % before.width) + 0.5, Math.floor(i / before.width) + 0.5].map((x) => x / before.width);
    const distance = (from) => Math.min(...from.map(([u, v]) => Math.hypot(at[0] - u, at[1] - v)));
    const differs = [0, 1, 2].some((c) => Math.abs(before.data[4 * i + c] - after.data[4 * i + c]) > CHANGED);
    const away = distance(places);
    const count = (where) => {
      ++all[where];
      if (differs) ++changed[where];
    };
    if (away < NEAR) count('near');
    else if (distance(others) < OTHER) count('other');
    if (away > FAR) count('far');
  }
  return Object.fromEntries(Object.keys(all).map((where) => [where, changed[where] / Math.max(all[where], 1)]));
}

export async function locality({ tab }) {
  const { page } = tab;
  const frame = await page.locator('#frame').boundingBox();
  const count = await page.locator('.handle').count();
  const handle = (n) => tab.centerOf(`.handle:nth-of-type(${n + 2})`);
  const place = ([x, y]) => [(x - frame.x) / frame.width, (y - frame.y) / frame.width];
  for (let n = 0; n < count; ++n) {
    await tab.still();
    const before = await pixels(page);
    const [x, y] = await handle(n);
    await tab.drag([
      [x, y],
      [x + 20, y - 60],
    ]);
    await tab.still();
    const others = [];
    for (let k = 0; k < count; ++k) if (k !== n) others.push(place(await handle(k)));
    const places = [place([x, y]), place(await handle(n))];
    const { near, far, other } = shares(before, await pixels(page), places, others);
    const percent = (share) => `${(100 * share).toFixed(2)}%`;
    check(near > 0.05, `key point ${n + 1}: ${percent(near)} of the pixels near it change`);
    check(far < near / 6, `${percent(far)} of those far from it`);
    check(other < near / 15, `and ${percent(other)} of those around other key points`);
    await tab.key('Shift+R');
  }
}
