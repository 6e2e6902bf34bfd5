// Both Play buttons: the picture changes as time goes by, and stays when they are stopped.
import { check, pause } from './desk.mjs';

const ENOUGH = 5; // different pictures

// How many different pictures are seen until there are `ENOUGH`, or for 20 seconds.
async function differentPictures(tab) {
  const seen = new Set();
  for (const end = Date.now() + 20000; seen.size < ENOUGH && Date.now() < end; await pause(50)) {
    seen.add(await tab.picture());
  }
  return seen.size;
}

// Whether picture and text stay as they are.
async function rests(tab, text) {
  const [picture, says] = [await tab.still(), await tab.text(text)];
  await pause(500);
  return picture === (await tab.still()) && says === (await tab.text(text));
}

async function capturedMotion(tab) {
  const { page } = tab;
  const at = await tab.text('motion-at');
  await page.click('#motion-play');
  check((await tab.text('motion-play')) === 'Stop', 'the button that plays what was filmed becomes Stop');
  const pictures = await differentPictures(tab);
  check(pictures >= ENOUGH, `what was filmed plays: ${pictures} different pictures`);
  check((await tab.text('motion-at')) !== at, 'the frame that is shown is said');
  await page.click('#motion-play');
  check((await tab.text('motion-play')) === 'Play' && (await rests(tab, 'motion-at')), 'Stop stops it');
  await tab.key('Control+z');
  await tab.still();
  check((await tab.text('motion-at')) === at, 'one undo goes back to before it');
}

async function aTrail(tab) {
  const { page } = tab;
  const first = await tab.still();
  await tab.key('k');
  const [x, y] = await tab.centerOf('.handle');
  await tab.drag([
    [x, y],
    [x + 30, y - 50],
  ]);
  const last = await tab.still();
  await tab.key('k');
  await tab.until(() => document.getElementById('trail-time').max === '1');
  await tab.key('.');
  await page.fill('#key-frame-time', '4');
  await tab.key('Enter');
  await tab.until(() => document.getElementById('trail-time').max === '4');

  const time = async () => Number(await page.inputValue('#trail-time'));
  await page.click('#trail-play');
  const pictures = await differentPictures(tab);
  check(pictures >= ENOUGH, `a trail plays: ${pictures} different pictures`);
  const early = await time();
  await tab.until((than) => Number(document.getElementById('trail-time').value) > than, early);
  await page.click('#trail-play');
  const stopped = await time();
  check((await tab.text('trail-play')) === 'Play' && stopped < 4, `it is stopped at ${stopped} of 4 s`);
  check((await rests(tab, 'trail-at')) && ![first, last].includes(await tab.still()), 'and rests on its way');
  await page.click('#trail-play');
  await tab.until(() => document.getElementById('trail-play').textContent === 'Play');
  check((await tab.still()) === last && (await time()) === 4, 'played through, it ends by itself with its last key frame');
}

export async function playing({ tab }) {
  await tab.still();
  await capturedMotion(tab);
  await aTrail(tab);
}
