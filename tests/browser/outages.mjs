// What goes wrong around the page: files that vanish, servers that end and come back, addresses without the token.
import { cpSync, readdirSync, rmSync, truncateSync, writeFileSync } from 'node:fs';
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

export async function outages({ tab, server, openTab }) {
  const { page } = tab;
  await tab.still();
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

  const stranger = await openTab();
  await stranger.page.goto(server.url.replace(/token=./, 'token='));
  check((await stranger.page.textContent('body')).includes('token is wrong'), 'without the token there is no page');
  await stranger.page.close();
}
