// Everything by keys alone, from the page's first picture to a rendered video.
import { check } from './desk.mjs';

const CONTROLS = 'button, select, input, a[href], [tabindex="0"]';

// What has the focus: its place among all controls, and whether one sees that it has it.
function whatHasFocus(controls) {
  const here = document.activeElement;
  const usable = [...document.querySelectorAll(controls)].filter(
    (one) => !one.disabled && one.getClientRects().length > 0 && !one.closest('dialog:not([open])'),
  );
  const ring = here.matches('.handle') ? here.querySelector('.chosen') : here;
  const style = getComputedStyle(ring);
  return {
    index: usable.indexOf(here),
    count: usable.length,
    name: here.id || here.getAttribute('aria-label') || here.textContent || here.tagName,
    visible: here.matches('.handle')
      ? style.visibility === 'visible' && parseFloat(style.strokeWidth) >= 2
      : style.outlineStyle !== 'none' && parseFloat(style.outlineWidth) >= 2,
  };
}

// By Tab, or Shift+Tab where the target lies before.
async function tabTo(tab, selector) {
  for (let i = 0; i < 80; ++i) {
    const key = await tab.page.evaluate((of) => {
      const here = document.activeElement,
        target = document.querySelector(of);
      if (here === target) return '';
      const after = here === document.body || here.compareDocumentPosition(target) & Node.DOCUMENT_POSITION_FOLLOWING;
      return after ? 'Tab' : 'Shift+Tab';
    }, selector);
    if (!key) return;
    await tab.key(key);
  }
  throw new Error(`${selector} cannot be reached by Tab`);
}

const focused = (tab) => tab.page.evaluate(() => document.activeElement.id);

async function walk(tab) {
  const order = [],
    unseen = [];
  for (let i = 0; i < 80; ++i) {
    await tab.key('Tab');
    const { index, count, name, visible } = await tab.page.evaluate(whatHasFocus, CONTROLS);
    if (index < 0) break; // past the last
    order.push(index);
    if (!visible) unseen.push(name);
    if (index === count - 1) break;
  }
  const { count } = await tab.page.evaluate(whatHasFocus, CONTROLS);
  check(order.length === count, `Tab reaches every control: ${order.length} of ${count}`);
  check(
    order.every((index, i) => index === i),
    'in the order of the page',
  );
  check(unseen.length === 0, `and shows where it is ${unseen.join(', ')}`);
}

async function edit(tab) {
  const points = () => tab.text('points');
  const selected = () => tab.page.evaluate(() => document.querySelectorAll('#points .selected').length);
  const before = await tab.still();
  const start = await points();
  await tabTo(tab, '.handle');
  check((await selected()) === 1, 'a handle that gets the focus is selected');
  await tab.key('ArrowRight', 'ArrowRight', 'Shift+ArrowUp');
  check((await tab.still()) !== before, 'arrow keys move it');
  const nudged = await points();
  await tab.key('PageUp', 'PageUp');
  await tab.still();
  check((await points()) !== nudged, 'Page up changes its depth');
  await tabTo(tab, '#undo');
  for (let i = 0; i < 9 && (await focused(tab)) === 'undo'; ++i) {
    await tab.key('Enter');
    await tab.still();
  }
  check((await points()) === start, 'Undo brings it back');
  check((await focused(tab)) === 'redo', 'and hands the focus on when nothing is left to undo');
  await tab.key('Enter');
  await tab.still();
  check((await points()) === nudged, 'Redo moves it again');
  await tab.key('Shift+R');
  check((await tab.still()) === before, 'Shift+R resets everything');

  if ((await tab.page.locator('.name').count()) > 1) {
    await tabTo(tab, '#points li:nth-child(2) .name');
    await tab.key('Enter');
    await tabTo(tab, '#points li:nth-child(1) .name');
    await tab.key('Shift+Enter');
    check((await selected()) === 2, 'Shift+Enter in the list selects several');
    await tab.key('ArrowDown');
    await tab.still();
    const lines = (text) => text.split('Key point').slice(1);
    const [was, is] = [lines(start), lines(await points())];
    check(
      was.every((line, n) => line !== is[n]),
      'which move together',
    );
    await tab.key('r');
    await tab.still();
    check((await points()) === start, 'R resets what is selected');
    await tab.key('Escape');
    check((await selected()) === 0, 'Escape selects nothing');
  }
}

async function look(tab) {
  const before = await tab.still();
  const overview = () => tab.page.evaluate(() => document.getElementById('overview').toDataURL());
  await tabTo(tab, '#overview');
  let last = before;
  for (const [key, what] of [
    ['ArrowLeft', 'turn the camera'],
    ['Shift+ArrowLeft', 'move it'],
    ['+', 'bring it closer'],
    ['-', 'and back'],
  ]) {
    for (let i = 0; i < 4; ++i) await tab.key(key);
    const now = await tab.still();
    check(now !== last, `${key} in the overview: ${what}`);
    last = now;
  }
  const afar = await overview();
  await tab.key('Control+ArrowLeft');
  check((await overview()) !== afar && (await tab.still()) === last, 'Ctrl+ArrowLeft turns the overview alone');
  await tab.key('c');
  check((await tab.still()) === before, 'C resets the camera');
  await tabTo(tab, '#motion');
  const at = await tab.text('motion-at');
  await tab.key('ArrowRight');
  await tab.still();
  check((await tab.text('motion-at')) !== at, 'arrow keys move the slider of the motion');
  await tab.key('Home');
  await tab.still();
}

async function makeVideo(tab) {
  await tabTo(tab, '.handle');
  await tab.key(' ', 'ArrowRight', 'ArrowRight');
  await tab.until(() => document.getElementById('trail-at').textContent.startsWith('recording'));
  await tab.key(' ');
  await tab.until(() => !document.getElementById('trail-time').disabled);
  const length = () => tab.page.evaluate(() => Number(document.getElementById('trail-time').max));
  const recorded = await length();
  await tab.key('k');
  await tab.until((than) => Number(document.getElementById('trail-time').max) > than, recorded);
  check(true, 'Space records a trail, K adds a key frame');
  await tabTo(tab, '#trail-time');
  await tab.key('End');
  await tab.until(() => {
    const {value, max} = document.getElementById('trail-time');
    return Number(value) > 0 && Number(max) - Number(value) < 0.1;
  });
  check(true, 'End goes to its end');

  await tabTo(tab, '#video-width');
  await tab.key('Home');
  await tabTo(tab, '#video');
  await tab.key('Enter');
  await tab.until(() => document.activeElement.id === 'video-cancel');
  await tab.key('Enter');
  await tab.until(() => document.activeElement.id === 'video');
  check(true, 'Render video hands the focus to Cancel, and that hands it back');
  await tab.key('Enter');
  await tab.until(() => document.activeElement.id === 'video-file', null, 120);
  const { name } = await tab.download(() => tab.key('Enter'));
  check(name === 'edited.mp4', `Enter saves the video that was made as ${name}`);
}

async function dialogs(tab) {
  for (const [key, id] of [
    ['v', 'motion-box'],
    ['?', 'help-box'],
  ]) {
    await tabTo(tab, '#reset-camera');
    await tab.key(key);
    await tab.until((of) => document.getElementById(of).open, id);
    const inside = await tab.page.evaluate((of) => document.getElementById(of).contains(document.activeElement), id);
    await tab.key('Escape');
    await tab.until((of) => !document.getElementById(of).open, id);
    check(inside && (await focused(tab)) === 'reset-camera', `${key} opens ${id}, Escape closes it where it was opened`);
  }
}

export async function keyboard({ tab }) {
  await tab.still();
  await walk(tab);
  await edit(tab);
  await look(tab);
  await makeVideo(tab);
  await dialogs(tab);
}
