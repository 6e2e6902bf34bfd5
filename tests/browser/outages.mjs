// What goes wrong around the page: files that vanish, servers that end and come back, addresses without the token.
import { cpSync, readdirSync, rmSync, truncateSync, writeFileSync } from 'node:fs';
import { createServer } from 'node:http';
import { join } from 'node:path';
import { check } from './desk.mjs';

// What the dialog of a video says to files that are none, and to one that is too large.
async function badVideos(tab, server) {
  const { page } = tab;
  const clip = join(server.scratch, 'clip.mp4');
  await tab.key('v');
  for (const [bytes, expected] of [
    [1000, 'cannot be read as a video'],
    [201 << 20, 'at most 200 can be sent'],
    [0, 'cannot be read as a video'],
  ]) {
    writeFileSync(clip, '');
    truncateSync(clip, bytes); // zeros, which take no room
    await page.setInputFiles('#motion-file', clip);
    await tab.until((text) => document.getElementById('motion-says').textContent.includes(text), expected);
    check(await page.isDisabled('#motion-apply'), `a video of ${bytes} bytes that is none: ${expected}`);
    await page.setInputFiles('#motion-file', []);
  }
  await tab.key('Escape');
  tab.problems.length = 0; // of requests that were refused, which browsers report as well
}

// What the server answers to an edit is said whatever its status, until it is closed or the next edit is carried out.
async function refusals(tab) {
  const { page } = tab;
  const nudge = () => page.locator('.handle').first().press('ArrowRight');
  for (const status of [400, 413, 500]) {
    const error = `made up for status ${status}`;
    await page.route('**/api/edit*', (route) => route.fulfill({ status, json: { error } }));
    await nudge();
    await tab.until((text) => document.getElementById('gone-says').textContent === text, error);
    check((await tab.text('status')) !== 'not connected', `${status}: the page says what the server says`);
    await tab.until(() => document.querySelector('#gone-close').getClientRects().length > 0);
    await tab.still(); // the full picture is refused as well, and would say it once more
    await page.locator('#gone-close').press('Enter');
    const focused = await page.evaluate(() => document.activeElement.id);
    check((await page.isHidden('#gone')) && focused === 'help', 'keys close it, and the focus stays near');
    await nudge();
    await page.waitForSelector('#gone:not([hidden])');
    await page.unroute('**/api/edit*');
    await tab.still();
    check(await page.isVisible('#gone'), 'a picture alone leaves it there');
    await nudge();
    await page.waitForSelector('#gone', { state: 'hidden' });
    check(true, 'the next edit that is carried out clears it');
  }
  await tab.key('Shift+R');
  await tab.still();
  tab.problems.length = 0; // of requests that were refused, which browsers report as well
}

// How the video is getting on is asked for all the time: a refusal is said, and only silence is a server that is gone.
async function watching(tab) {
  const { page } = tab;
  for (const status of [404, 409, 500]) {
    const error = `made up for a video, with status ${status}`;
    await page.unroute('**/api/video*');
    await page.route('**/api/video*', (route) => route.fulfill({ status, json: { error } }));
    await tab.until((text) => document.getElementById('gone-says').textContent === text, error);
    check((await tab.text('status')) !== 'not connected', `${status} for the video: the page says what the server says`);
  }
  await page.unroute('**/api/video*');
  await page.waitForSelector('#gone', { state: 'hidden' });
  check(true, 'the next answer clears it');
  await page.route('**/api/video*', (route) => route.abort());
  await tab.until(() => document.getElementById('status').textContent === 'not connected');
  check((await tab.text('gone-says')).includes('does not answer'), 'where nobody answers it says that');
  await page.unroute('**/api/video*');
  await page.waitForSelector('#gone', { state: 'hidden' });
  await tab.until(() => document.getElementById('status').textContent.includes('ms'));
  check(true, 'and goes on when it is back');
  tab.problems.length = 0; // of requests that failed, which browsers report as well
}

// A scene without key points has no weights to show.
async function noKeyPoints(openTab) {
  const { page } = await openTab();
  await page.route('**/api/scene*', async (route) => {
    const answer = await route.fetch();
    await route.fulfill({ response: answer, json: { ...(await answer.json()), tracks: [], colors: [], reach: [] } });
  });
  await page.reload();
  await page.waitForSelector('#no-points:not([hidden])');
  await page.keyboard.press('w');
  check(
    (await page.isDisabled('#weights')) && !(await page.isChecked('#weights')),
    'without key points weights cannot be shown',
  );
  await page.close();
}

// In a page: what it gets to read of the editor, after an edit that it sends without asking to read the answer.
async function intrude([scene, edit, body]) {
  const ask = (...request) =>
    fetch(...request).then(
      (answer) => answer.status,
      () => 'refused',
    );
  await ask(edit, { method: 'POST', body }); // text: no preflight goes before it
  return ask(scene);
}

// Pages of another origin get no answer and change nothing, though they know the address and its token.
async function intruders(tab, server, openTab) {
  const { page } = await openTab();
  const other = createServer((_, answer) => answer.setHeader('Content-Type', 'text/html').end('<p>another page</p>'));
  await new Promise((listening) => other.listen(0, '127.0.0.1', listening));
  const addressOf = (path) => server.url.replace('/?', `/${path}?`);
  const edit = JSON.stringify({ tab: 'intruder', operations: [{ do: 'key_frame', time: 0 }] });
  const wish = [addressOf('api/scene'), addressOf('api/edit'), edit];
  const hasTrail = async () => (await fetch(`${addressOf('api/trail')}&tab=intruder`)).ok;
  const origin = `http://127.0.0.1:${other.address().port}`;
  for (const [address, itsOrigin] of [
    [origin, origin],
    ['data:text/html,<p>another page</p>', 'null'],
  ]) {
    await page.goto(address);
    const read = await page.evaluate(intrude, wish);
    const { status } = await fetch(wish[0], { headers: { Origin: itsOrigin } });
    check(read === 'refused' && status === 403, `a page of origin ${itsOrigin} gets to read nothing: ${status}`);
    check(!(await hasTrail()), 'and its edit is not carried out');
  }
  check((await tab.page.evaluate(intrude, wish)) === 200 && (await hasTrail()), 'which the own page may do');
  await page.close();
  other.close();
}

export async function outages({ tab, server, openTab }) {
  const { page } = tab;
  await tab.still();
  await refusals(tab);
  await watching(tab);
  await noKeyPoints(openTab);
  const kept = `${server.run}-kept`;
  cpSync(server.run, kept, { recursive: true });
  rmSync(server.run, { recursive: true });
  const handle = await tab.centerOf('.handle');
  await tab.drag([handle, [handle[0] + 25, handle[1] - 15]]);
  check(await page.isHidden('#gone'), 'a run folder that was deleted is not missed');
  for (const entry of readdirSync(server.temporary)) rmSync(join(server.temporary, entry), { recursive: true });
  await badVideos(tab, server);

  await tab.still();
  const placed = await tab.text('points');
  const { port } = new URL(server.url);
  check((await server.end()) === 0, 'Ctrl-C ends the server with 0');
  await page.waitForSelector('#gone:not([hidden])');
  await tab.shot('gone');
  await server.start({ run: kept, port });
  await tab.until(() => document.getElementById('gone').textContent.includes('started anew'));
  await tab.still();
  check((await tab.text('points')) === placed, 'after a restart the page puts key points back, and says so');
  tab.problems.length = 0; // of requests that nobody answered

  await intruders(tab, server, openTab);
  const stranger = await openTab();
  await stranger.page.goto(server.url.replace(/token=./, 'token='));
  check((await stranger.page.textContent('body')).includes('token is wrong'), 'without the token there is no page');
  await stranger.page.close();
}
