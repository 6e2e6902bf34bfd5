// Key frames of a trail: chosen, replaced, moved in time, deleted; and what was done to them undone.
import { check } from './desk.mjs';

// What the page says of the trail: which key frame is chosen, of how many, when it is, and how long the trail is.
const trailOf = (page) =>
  page.evaluate(() => ({
    chosen: document.getElementById('key-frame-at').textContent,
    time: document.getElementById('key-frame-time').value,
    duration: Number(document.getElementById('trail-time').max),
  }));

// Until the page says this, and the server has carried out everything.
async function expectTrail(tab, chosen, duration, what) {
  const said = ([of, length]) =>
    document.getElementById('key-frame-at').textContent === of &&
    Math.abs(Number(document.getElementById('trail-time').max) - length) < 0.005;
  await tab.until(said, [chosen, duration], 10).catch(() => {});
  await tab.still();
  const now = await trailOf(tab.page);
  check(now.chosen === chosen && Math.abs(now.duration - duration) < 0.005, `${what}: ${now.chosen}, ${now.duration} s`);
}

// Frames of the edit file, which the server makes of what it has.
const editFrames = (page) =>
  page.evaluate(async () => (await (await fetch(document.getElementById('download-edit').href)).json()).frames);

// Key frames of three states, a second apart; their pictures.
async function threeKeyFrames(tab) {
  const pictures = [];
  for (const [dx, dy] of [
    [0, 0],
    [30, -40],
    [-50, 10],
  ]) {
    const [x, y] = await tab.centerOf('.handle');
    if (dx) await tab.drag([[x, y], [x + dx, y + dy]]);
    pictures.push(await tab.still());
    await tab.key('k');
    await tab.still();
  }
  return pictures;
}

async function choose(tab, [a, b, c]) {
  const { page } = tab;
  await expectTrail(tab, '\u2013 / 3', 2, 'three key frames, of which none is chosen');
  await tab.key('.');
  await expectTrail(tab, '2 / 3', 2, 'a period chooses the next one');
  check((await tab.still()) === b, 'and shows it');
  await tab.key('.', '.');
  check((await tab.still()) === c, 'the last one is the end');
  await page.click('#key-frame-before');
  await page.click('#key-frame-before');
  check((await tab.still()) === a, 'the button goes back to the first');
  const marks = await page.locator('#ticks').boundingBox();
  await page.mouse.click(marks.x + marks.width / 2, marks.y + marks.height / 2);
  check((await tab.still()) === b && (await trailOf(page)).chosen === '2 / 3', 'a click on a mark chooses its key frame');
  await page.locator('.handle').first().focus();
  await tab.key('Escape');
  check((await trailOf(page)).chosen === '2 / 3', 'Escape on a handle lets go of its key point first');
  await tab.key('Escape');
  check((await trailOf(page)).chosen === '\u2013 / 3', 'and then chooses no key frame');
}

async function replace(tab, [, b]) {
  const [x, y] = await tab.centerOf('.handle');
  await tab.key(',');
  await tab.drag([[x, y], [x + 10, y + 40]]);
  const other = await tab.still();
  await tab.key('Shift+K');
  const there = async () => {
    await tab.key(',', '.');
    return tab.still();
  };
  check((await there()) === other && other !== b, 'Shift+K puts the present state in its place');
  await tab.key('Control+z'); // of the way there
  await tab.key('Control+z');
  check((await there()) === b, 'undo brings the key frame back that was there');
}

async function retime(tab, [, b, c]) {
  const { page } = tab;
  await page.fill('#key-frame-time', '1.5');
  await tab.key('Enter');
  await expectTrail(tab, '2 / 3', 2, 'its time can be typed');
  const halfway = (await editFrames(page))[36].key_points;
  await page.locator('#key-frame-delete').focus(); // in the field a comma would be typed
  await tab.key('.', ',');
  check((await tab.still()) === b && (await trailOf(page)).time === '1.50', 'it is there then');
  await tab.key('>', '>');
  await expectTrail(tab, '2 / 3', 2, '> moves it later');
  check((await trailOf(page)).time === '1.70', 'by a tenth of a second');
  await tab.key(...'>>>>>>>>');
  await expectTrail(tab, '3 / 3', 2.51, 'as often as it is pressed, however fast, and past the one that is in the way');
  await page.fill('#key-frame-time', '1.7');
  await tab.key('Enter');
  await expectTrail(tab, '2 / 3', 2, 'back before it');
  await page.locator('#key-frame-delete').focus();
  await tab.key('<', '<');
  await page.fill('#key-frame-time', '3');
  await tab.key('Enter');
  await expectTrail(tab, '3 / 3', 3, 'past another one it is the next');
  const frames = await editFrames(page);
  check(frames.length === 73, `the edit file is as long: ${frames.length} frames`);
  const same = (one, other) => JSON.stringify(one) === JSON.stringify(other);
  check(same(frames[72].key_points, halfway), 'and ends with it');
  await page.fill('#key-frame-time', '2');
  await tab.key('Enter');
  check((await tab.text('gone-says')).includes('already'), 'two at the same time are refused');
  await page.fill('#key-frame-time', '3.5');
  await tab.key('Enter');
  await expectTrail(tab, '3 / 3', 3.5, 'another time is taken');
  check(await page.isHidden('#gone'), 'and what was said is gone');
  await page.fill('#key-frame-time', '3');
  await tab.key('Enter');
  await expectTrail(tab, '3 / 3', 3, 'and the first one once more');

  const marks = await page.locator('#ticks').boundingBox();
  const at = (time) => [marks.x + 8 + (time / 3) * (marks.width - 16), marks.y + marks.height / 2];
  await tab.drag([at(2), at(1)]);
  await expectTrail(tab, '2 / 3', 3, 'a mark can be dragged');
  check(Math.abs((await trailOf(page)).time - 1) < 0.1 && (await tab.still()) === c, 'to another time');
  await tab.key('Control+z');
  await tab.until(() => document.getElementById('key-frame-time').value === '', null, 10).catch(() => {});
  await tab.key('.', '.');
  await expectTrail(tab, '3 / 3', 3, 'which is undone');
  await tab.key(',');
  await tab.still();
  check((await trailOf(page)).time === '2.00', 'in one step');
}

// Of A at 0, C at 2 and B at 3 seconds.
async function remove(tab, [a, b, c]) {
  const { page } = tab;
  await tab.key('Delete');
  await expectTrail(tab, '2 / 2', 3, 'Delete removes the one that is chosen');
  check((await tab.still()) === b, 'and shows the next');
  await tab.key('Control+z');
  await expectTrail(tab, '3 / 3', 3, 'undo brings it back');
  await tab.key(',');
  check((await tab.still()) === c, 'where it was');
  await tab.key(',');
  check((await tab.still()) === a, 'after the first');
  await page.click('#key-frame-delete');
  await expectTrail(tab, '1 / 2', 1, 'without the first one the trail begins with the second');
  check((await tab.still()) === c && (await trailOf(page)).time === '0.00', 'at 0');
  await tab.key('k');
  await expectTrail(tab, '1 / 3', 2, 'the next key frame comes a second after the last');
}

async function clear(tab) {
  const { page } = tab;
  const before = JSON.stringify(await editFrames(page));
  await page.click('#trail-clear');
  await expectTrail(tab, 'none', 0, 'Clear empties the trail');
  check(await page.isDisabled('#video'), 'of which there is no video then');
  await page.click('#undo');
  await expectTrail(tab, '\u2013 / 3', 2, 'Undo brings it back');
  check(JSON.stringify(await editFrames(page)) === before, 'as it was');
  await page.click('#redo');
  await expectTrail(tab, 'none', 0, 'Redo clears it again');
}

// A recording is undone at once, without what was dragged meanwhile.
async function recording(tab) {
  const { page } = tab;
  await page.click('#record');
  const [x, y] = await tab.centerOf('.handle');
  await tab.drag([[x, y], [x + 30, y - 20]]);
  await page.click('#record');
  await tab.still();
  await tab.key('Control+z', 'Control+z');
  await expectTrail(tab, 'none', 0, 'a drag and its recording are undone in two steps');
  await tab.key('Control+Shift+Z');
  await tab.until(() => document.getElementById('trail-at').textContent !== 'empty');
  check((await editFrames(page)).length > 2, 'and done again');
}

export async function keyFrames({ tab }) {
  await tab.still();
  const pictures = await threeKeyFrames(tab);
  await choose(tab, pictures);
  await replace(tab, pictures);
  await retime(tab, pictures);
  await remove(tab, pictures);
  await clear(tab);
  await recording(tab);
}
