// A video drives a key point.
import { existsSync } from 'node:fs';
import { check } from './desk.mjs';

export async function motion({ tab, options }) {
  const { page } = tab;
  if (!existsSync(options.clip)) {
    console.log(`passed over: there is no ${options.clip}`);
    return;
  }
  await tab.still();
  await tab.key('v');
  await tab.until(() => document.getElementById('motion-box').open);
  await page.setInputFiles('#motion-file', options.clip);
  await tab.until(() => !document.getElementById('motion-picture').hidden);
  const at = await page.evaluate(([x, y]) => {
    const canvas = document.getElementById('motion-picture'),
      box = canvas.getBoundingClientRect(),
      zoom = (Number(canvas.dataset.zoom) * box.width) / canvas.width;
    return [box.x + x * zoom, box.y + y * zoom];
  }, options.clipPoint);
  await page.mouse.click(...at);
  await tab.until(() => !document.getElementById('motion-apply').disabled, null, 120);
  check((await tab.text('motion-says')).includes('Followed through'), 'a point of a video is followed');
  await tab.shot('motion');
  const frames = Number(await page.getAttribute('#motion-frame', 'max'));
  const pair = async (frame, row) => {
    await page.fill('#motion-frame', String(frame));
    await page.fill('#motion-row', String(row));
    await page.click('#motion-pair');
  };
  await pair(0, 1);
  check(!(await page.isDisabled('#motion-straight')), 'one pair says nothing yet');
  await pair(frames, 2);
  await tab.until(() => !document.getElementById('motion-apply').disabled, null, 120);
  check(await page.isDisabled('#motion-straight'), 'two pairs take the place of the range');
  check((await page.locator('#motion-pairs button').count()) === 2, 'pairs are listed');
  await tab.shot('pairs');
  await page.click('#motion-pairs button >> nth=1');
  await page.click('#motion-pairs button');
  await tab.until(() => !document.getElementById('motion-apply').disabled, null, 120);
  check((await page.locator('#motion-pairs button').count()) === 0, 'pairs are removed');
  const before = await tab.text('points');
  await page.click('#motion-preview');
  await tab.until((was) => document.getElementById('points').textContent !== was, before);
  await tab.until(() => !document.getElementById('motion-box').classList.contains('playing'), null, 60);
  await tab.still();
  check((await tab.text('points')) === before, 'a preview moves the key point and puts it back');
  await page.click('#motion-apply');
  await tab.until(() => !document.getElementById('video').disabled);
  check((await tab.text('trail-at')) !== 'empty', 'the motion of a video becomes the trail');
}
