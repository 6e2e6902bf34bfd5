// The overview's gestures by mouse: those of the camera change the picture, those of the overview itself leave it.
import { check } from './desk.mjs';

const drawing = (page) => page.evaluate(() => document.getElementById('overview').toDataURL());

// In the page: the middle of the dot of the chosen capture view, which is the only disc of its colour in the overview.
function chosenDot() {
  const canvas = document.getElementById('overview'),
    { width, height } = canvas,
    pen = canvas.getContext('2d');
  const { data } = pen.getImageData(0, 0, width, height);
  pen.fillStyle = getComputedStyle(document.documentElement).getPropertyValue('--accent');
  pen.clearRect(0, 0, 1, 1);
  pen.fillRect(0, 0, 1, 1);
  const wanted = pen.getImageData(0, 0, 1, 1).data;
  pen.putImageData(new ImageData(data, width, height), 0, 0);
  const isWanted = (x, y) => [0, 1, 2].every((c) => Math.abs(data[4 * (y * width + x) + c] - wanted[c]) < 16);
  const near = [-2, -1, 0, 1, 2];
  const found = [];
  for (let y = 2; y < height - 2; ++y) {
    for (let x = 2; x < width - 2; ++x) {
      if (near.every((dy) => near.every((dx) => isWanted(x + dx, y + dy)))) found.push([x, y]);
    }
  }
  const box = canvas.getBoundingClientRect();
  const mean = (axis) => found.reduce((sum, at) => sum + at[axis] + 0.5, 0) / found.length / devicePixelRatio;
  return found.length ? [box.x + mean(0), box.y + mean(1)] : null;
}

async function ofTheCamera(tab, before) {
  const { page } = tab;
  const middle = await tab.centerOf('#overview');
  const to = middle.map((value) => value + 30);
  const handle = await tab.centerOf('.handle');
  const drag = async (button) => {
    await page.mouse.move(...middle);
    await page.mouse.down({ button });
    await page.mouse.move(...to, { steps: 10 });
    await page.mouse.up({ button });
  };
  const wheel = async (by) => {
    await page.mouse.move(...middle);
    for (let i = 0; i < 5; ++i) await page.mouse.wheel(0, by);
  };
  const size = () => page.evaluate(() => document.querySelector('.track line, .track path').getAttribute('stroke-width'));
  for (const [what, act, holds] of [
    ['a drag turns the camera', () => drag('left')],
    [
      'a drag with the right button moves it, and the scene with the pointer',
      () => drag('right'),
      ([x, y]) => x > handle[0] + 5 && y > handle[1] + 5,
    ],
    ['the wheel brings it closer', () => wheel(-100), (_, was, is) => is > was],
    ['and farther', () => wheel(100), (_, was, is) => is < was],
  ]) {
    const [afar, was] = [await drawing(page), Number(await size())];
    await act();
    check((await tab.still()) !== before && (await drawing(page)) !== afar, what);
    if (holds) check(holds(await tab.centerOf('.handle'), was, Number(await size())), 'in the right direction');
    await page.click('#reset-camera');
    check((await tab.still()) === before, 'Reset brings the picture back');
  }
}

async function ofItself(tab, before) {
  const { page } = tab;
  const middle = await tab.centerOf('#overview');
  const to = middle.map((value) => value + 30);
  const first = await drawing(page);
  const shiftWheel = async () => {
    await page.mouse.move(...middle);
    await page.keyboard.down('Shift');
    await page.mouse.wheel(0, -100);
    await page.keyboard.up('Shift');
  };
  for (const [what, act] of [
    ['Shift+drag turns', () => tab.drag([middle, to], { modifier: 'Shift' })],
    ['Ctrl+drag moves', () => tab.drag([middle, to], { modifier: 'Control' })],
    ['Shift+wheel zooms', shiftWheel],
  ]) {
    await act();
    await tab.until((was) => document.getElementById('overview').toDataURL() !== was, first);
    check((await tab.still()) === before, `${what} the overview, and not the camera`);
    await page.locator('#overview').dispatchEvent('dblclick'); // Playwright's own is none in Firefox
    await tab.until((was) => document.getElementById('overview').toDataURL() === was, first);
    check((await tab.still()) === before, 'a double click resets it');
  }
}

async function captureViews(tab, before) {
  const { page } = tab;
  const first = await page.inputValue('#capture');
  const last = String((await page.locator('#capture option').count()) - 1);
  await page.selectOption('#capture', last);
  const there = await tab.still();
  check(there !== before, 'another capture view has another picture');
  const dot = await page.evaluate(chosenDot);
  await page.selectOption('#capture', first);
  check((await tab.still()) === before, 'the first one has its picture again');
  await page.mouse.click(...dot);
  check((await tab.still()) === there, 'a click on the dot of a capture view shows that view');
  check((await page.inputValue('#capture')) === last, 'and chooses it in the list');
  await page.click('#camera-before');
  await tab.still();
  check((await page.inputValue('#capture')) === String(last - 1), 'the button before it chooses the one before');
  await page.click('#camera-after');
  check((await tab.still()) === there, 'and that after it comes back');
}

export async function overview({ tab }) {
  const before = await tab.still();
  await ofTheCamera(tab, before);
  await ofItself(tab, before);
  await captureViews(tab, before);
}
