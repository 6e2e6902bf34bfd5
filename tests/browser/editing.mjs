// Key points and camera: dragged, nudged, brought nearer, undone, reset.
import { check } from './desk.mjs';

export async function editing({ tab }) {
  const { page } = tab;
  const points = () => tab.text('points');
  const before = await tab.still();
  await tab.shot('start');

  const [x, y] = await tab.centerOf('.handle');
  await tab.drag([
    [x, y],
    [x + 40, y - 60],
  ]);
  const moved = await tab.still();
  check(moved !== before, 'a drag changes the picture');
  const [hx, hy] = await tab.centerOf('.handle');
  check(Math.hypot(hx - x - 40, hy - y + 60) < 2, `the handle stays under the pointer: ${hx - x}, ${hy - y}`);
  await tab.shot('dragged');
  await tab.key('Control+z');
  check((await tab.still()) === before, 'undo restores the picture bit for bit');
  await tab.key('Control+Shift+Z');
  check((await tab.still()) === moved, 'redo brings the same picture back');

  const near = await points();
  await page.mouse.move(hx, hy);
  for (let i = 0; i < 5; ++i) await page.mouse.wheel(0, 100);
  check((await tab.still()) !== moved, 'the wheel over a handle changes the picture');
  check((await points()) !== near, 'the wheel changes the depth');
  const [wx, wy] = await tab.centerOf('.handle');
  check(Math.hypot(wx - hx, wy - hy) < 1, 'depth leaves the handle where it is in the picture');
  await tab.key('Control+z');
  check((await tab.still()) === moved, 'a row of turns of the wheel is undone at once');
  check((await points()) === near, 'undo brings the depth back');

  await page.locator('.handle').first().focus();
  for (let i = 0; i < 5; ++i) await tab.key('ArrowRight');
  await tab.still();
  check((await points()) !== near, 'arrow keys nudge the key point');
  await tab.key('Control+z');
  await tab.still();
  check((await points()) === near, 'a row of nudges is undone at once');

  await tab.drag([await tab.centerOf('.handle'), [x + 250, Math.max(y - 250, 60)]]);
  await tab.still();
  check(
    await page.evaluate(() => document.querySelector('.handle').matches('.far, .beyond')),
    'far from training the handle says so',
  );
  check(!(await tab.text('points')).startsWith('Key point 1seen'), 'and so does the list');
  await tab.shot('beyond');
  await tab.key('Shift+R');
  check((await tab.still()) === before, 'reset all brings the first picture back');

  const overview = await tab.centerOf('#overview');
  await tab.drag([overview, overview.map((value) => value + 30)]);
  const turned = await tab.still();
  check(turned !== before, 'dragging in the overview turns the camera');
  await page.click('#weights');
  check((await tab.still()) !== turned, 'weights colour the picture');
  await tab.shot('weights');
  await page.click('#weights');
  await page.click('#reset-camera');
  check((await tab.still()) === before, 'camera, key points and weights come back to the first picture');
}
