// Key points and camera: dragged, nudged, brought nearer, undone, reset.
import { check } from './desk.mjs';

// How far key point 1 is from where training saw it, in percent of its range; as what it is shown, and in which hues.
function warningOf() {
  const chip = document.querySelector('#points .chip');
  const { stroke, visibility } = getComputedStyle(document.querySelector('.handle .warn'));
  const hue = (color) => {
    const [r, g, b] = color.match(/[\d.]+/g).map(Number);
    return Math.round((180 / Math.PI) * Math.atan2(Math.sqrt(3) * (g - b), 2 * r - g - b));
  };
  return {
    percent: Number(/(\d+)% of its range/.exec(chip.title)[1]),
    says: chip.textContent,
    level: document.querySelector('.handle').getAttribute('class').split(' ')[1],
    ring: visibility === 'visible' ? hue(stroke) : null,
    chip: hue(getComputedStyle(chip).color),
  };
}

const isAmber = (hue) => hue !== null && hue > 25 && hue < 55;
const isRed = (hue) => hue !== null && Math.abs(hue) < 10;

// Drags key point 1 towards the picture's farthest corner until it is about this far from where training saw it.
async function dragAway(tab, aim) {
  const box = await tab.page.locator('#frame').boundingBox();
  let pixels = 30,
    warning;
  for (let i = 0; i < 6; ++i) {
    await tab.key('Shift+R');
    await tab.still();
    const [x, y] = await tab.centerOf('.handle');
    const farther = (at, low, size) => (at < low + size / 2 ? low + size - at : low - at);
    const away = [farther(x, box.x, box.width), farther(y, box.y, box.height)];
    const share = Math.min(pixels / Math.hypot(...away), 1);
    await tab.drag([
      [x, y],
      [x + share * away[0], y + share * away[1]],
    ]);
    await tab.still();
    warning = await tab.page.evaluate(warningOf);
    if (Math.abs(warning.percent - aim) < 0.25 * aim) break;
    pixels *= Math.min(Math.max(aim / Math.max(warning.percent, 1), 0.2), 3);
  }
  return warning;
}

async function warnings(tab) {
  const near = await tab.page.evaluate(warningOf);
  check(near.level === 'near' && near.says === 'seen' && near.ring === null, 'where training saw it, nothing warns');
  const far = await dragAway(tab, 25);
  check(
    far.level === 'far' && far.says === 'far' && isAmber(far.ring) && isAmber(far.chip),
    `${far.percent}% of its range away: amber, ${far.ring} and ${far.chip} degrees of hue`,
  );
  await tab.shot('far');
  const beyond = await dragAway(tab, 70);
  check(
    beyond.level === 'beyond' && beyond.says === 'beyond' && isRed(beyond.ring) && isRed(beyond.chip),
    `${beyond.percent}% away: red, ${beyond.ring} and ${beyond.chip} degrees of hue`,
  );
  await tab.shot('beyond');
}

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

  await tab.key('Shift+R');
  await tab.still();
  await warnings(tab);
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
