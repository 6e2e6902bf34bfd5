// Dragging for long, and how long the picture takes to follow the pointer.
import { check, pause, Tab } from './desk.mjs';

const MiB = 1 << 20;

const LONGEST = 2000; // ms without a frame of the page: more than slow machines need
const MOST_MEASURES = 2100; // that the page keeps, and some that came since it looked

export async function dragging({ tab, server, openTab, options }) {
  const other = await openTab();
  await twoAtOnce(tab, other, 'a second tab');
  await tab.page.bringToFront();
  await dragAtRandom(tab, server, options.dragSeconds);
  await other.page.close();
  const twin = await duplicate(tab, options);
  await twoAtOnce(tab, twin, 'a duplicated tab');
  await comeBack(tab, twin);
  check(twin.problems.length === 0, `a duplicated tab reports no errors ${twin.problems.join('; ')}`);
  await twin.page.close();
}

// As the browser does it: with a copy of the tab's session storage. The tab has an edit, which the copy does not get.
async function duplicate(tab, options) {
  const first = await tab.still();
  const [x, y] = await tab.centerOf('.handle');
  await tab.drag([
    [x, y],
    [x + 30, y - 20],
  ]);
  await tab.still();
  const opened = tab.page.waitForEvent('popup');
  await tab.page.evaluate(() => void window.open(location.href));
  const twin = new Tab(await opened, options);
  await twin.until(() => document.getElementById('status')?.textContent.includes('ms'));
  check((await twin.still()) === first, 'a duplicated tab begins anew');
  await tab.page.bringToFront();
  await tab.key('Shift+R');
  return twin;
}

// Both are dragged at the same time, to different places; each shows its own state, and goes back to the first alone.
async function twoAtOnce(tab, other, name) {
  const tabs = [tab, other];
  const still = async () => [await tab.still(), await other.still()];
  const first = await still();
  check(first[0] === first[1], `${name} begins with the same picture`);
  const ends = await Promise.all(
    tabs.map(async (one, i) => {
      const [x, y] = await one.centerOf('.handle');
      const end = [x + (i ? -40 : 30), y + (i ? 20 : -30)];
      // Few steps, as in Chromium a page that is not in front may take a second for each; and short ones, as in Firefox
      // the pointers of both pages are one, which only one of them can capture.
      await one.drag([[x, y], [x + 10, y + 10], end], { steps: 4 });
      return end;
    }),
  );
  const moved = await still();
  check(moved[0] !== moved[1] && !moved.includes(first[0]), `${name} that is dragged at the same time shows another`);
  for (const [i, one] of tabs.entries()) {
    const [x, y] = await one.centerOf('.handle');
    const off = Math.hypot(x - ends[i][0], y - ends[i][1]);
    check(off < 2, `the handle of ${i ? name : 'the first'} is where it was let go, but for ${off.toFixed(1)} pixels`);
  }
  await tab.key('Control+z');
  check((await tab.still()) === first[0] && (await other.still()) === moved[1], `undo leaves ${name} alone`);
  await other.key('Control+z');
  check((await other.still()) === first[0], `${name} has its own undo`);
}

// Each has its own key points after it was loaded anew, and after another page was there meanwhile.
async function comeBack(tab, twin) {
  for (const [one, by] of [
    [tab, 30],
    [twin, -30],
  ]) {
    await one.page.bringToFront();
    const [x, y] = await one.centerOf('.handle');
    await one.drag([
      [x, y],
      [x + by, y + by],
    ]);
    await one.still();
  }
  const before = [await tab.text('points'), await twin.text('points')];
  const whenBack = async () => {
    for (const one of [tab, twin]) {
      await one.until(() => document.getElementById('status')?.textContent.includes('ms'));
      await one.still();
    }
    return before[0] === (await tab.text('points')) && before[1] === (await twin.text('points'));
  };
  await Promise.all([tab.page.reload(), twin.page.reload()]);
  check(before[0] !== before[1] && (await whenBack()), 'loaded anew, each tab has its own key points');
  for (const one of [tab, twin]) {
    await one.page.goto('about:blank');
    await one.page.goBack();
  }
  check(await whenBack(), 'and after the way to another page and back');
}

async function dragAtRandom(tab, server, seconds) {
  const { page } = tab;
  const stage = await page.locator('#stage').boundingBox(); // outside of it key points would lie under controls
  await page.evaluate(() => {
    let last = performance.now();
    Object.assign(window, { longest: 0, pictures: 0 });
    const step = (now) => {
      window.longest = Math.max(window.longest, now - last);
      last = now;
      requestAnimationFrame(step);
    };
    requestAnimationFrame(step);
    performance.clearMeasures();
    new PerformanceObserver((list) => (window.pictures += list.getEntriesByName('move to picture').length)).observe({
      type: 'measure',
    });
    // As many as hours of dragging leave: the page clears them.
    for (let i = 0; i < 5000; ++i) performance.measure('long ago');
  });
  const heap = await heapOf(page);
  let seed = 1;
  const random = () => (seed = (seed * 16807) % 2147483647) / 2147483647;
  const inside = (value, low, size) => Math.min(Math.max(value, low + 20), low + size - 20);
  const start = Date.now();
  const sizes = [];
  for (let i = 0; Date.now() - start < 1000 * seconds; ++i) {
    const handles = await page.locator('.handle').count();
    const at = await tab.centerOf(i % 5 === 4 ? '#overview' : `.handle:nth-of-type(${2 + (i % handles)})`);
    const to = [
      inside(at[0] + 300 * (random() - 0.5), stage.x, stage.width),
      inside(at[1] + 240 * (random() - 0.5), stage.y, stage.height),
    ];
    await tab.drag([at, to], { steps: 12, wait: 12 });
    if (i % 7 === 6) await tab.key('Shift+R');
    if (i % 11 === 10) await tab.key('c');
    if (i % 20 === 0) sizes.push(server.memory());
  }
  await tab.key('Shift+R', 'c');
  await tab.still();
  sizes.push(server.memory());
  // The first minute fills the store of finished pictures, 64 MiB.
  const settled = sizes[Math.min(sizes.length - 1, Math.floor(sizes.length / 10))];
  const [peak, end] = [Math.max(...sizes), sizes[sizes.length - 1]];
  const { longest, pictures, measures } = await page.evaluate(() => ({
    longest: window.longest,
    pictures: window.pictures,
    measures: performance.getEntriesByType('measure').length,
  }));
  const grown = (await heapOf(page)) - heap;
  console.log(
    `${seconds} s of dragging: ${pictures} pictures, longest time between two frames of the page ` +
      `${longest.toFixed(0)} ms; server ${(settled / MiB).toFixed(0)} MiB after a tenth, ` +
      `${(end / MiB).toFixed(0)} at the end, ${(peak / MiB).toFixed(0)} at most; page ${(grown / MiB).toFixed(1)} MiB more than before`,
  );
  check(pictures > seconds, 'the picture follows at random');
  check(longest < LONGEST, `and the page is never without a frame for ${LONGEST} ms`);
  check(end - settled < 96 * MiB, 'dragging leaks nothing');
  check(grown < 16 * MiB && measures < MOST_MEASURES, `nor in the page, which keeps ${measures} measures`);
}

// Bytes that the page's objects take, without those that nothing refers to; 0 where the browser does not tell.
async function heapOf(page) {
  const session = await page.context().newCDPSession(page).catch(() => null);
  if (!session) return 0;
  await session.send('HeapProfiler.collectGarbage');
  const { usedSize } = await session.send('Runtime.getHeapUsage');
  await session.detach();
  return usedSize;
}

export async function measure({ tab, options }) {
  const { page } = tab;
  await tab.still();
  if (options.fixed) await page.evaluate(() => (document.documentElement.dataset.preview = 160));
  const [x, y] = await tab.centerOf('.handle');
  await page.evaluate(() => performance.clearMeasures());
  const path = [[x, y]];
  for (let i = 0; i < 20; ++i) path.push([x + 60 * Math.sin(i), y - 40 * Math.abs(Math.sin(0.7 * i))]);
  await tab.drag(path, { steps: 30, wait: 16 });
  await pause(1000);
  const shown = await page.evaluate(() =>
    performance
      .getEntriesByName('move to picture')
      .map((entry) => [entry.duration, entry.detail.rendering, entry.detail.width]),
  );
  for (let i = 0; i < 10; ++i) {
    const from = await tab.centerOf('.handle');
    await tab.drag([from, [x + (i % 2 ? 12 : -12), y]], { steps: 8, wait: 16 });
    await pause(700);
  }
  const full = await page.evaluate(() =>
    performance.getEntriesByName('preview to full picture').map((entry) => [entry.duration]),
  );
  const of = (column, share, rows = shown) =>
    rows
      .map((row) => row[column])
      .sort((a, b) => a - b)
      [Math.floor(share * (rows.length - 1))].toFixed(0);
  console.log(
    `pointer to picture: ${shown.length} pictures, ${of(2, 0)} to ${of(2, 1)} pixels wide, median ${of(0, 0.5)} ms, ` +
      `nine tenths within ${of(0, 0.9)} ms; of it rendering and waiting for it: median ${of(1, 0.5)} ms; ` +
      `from the last preview to the full picture: median ${of(0, 0.5, full)} ms of ${full.length}`,
  );
}
