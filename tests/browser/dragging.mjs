// Dragging for long, and how long the picture takes to follow the pointer.
import { check, pause } from './desk.mjs';

const MiB = 1 << 20;

// A second tab is there meanwhile, and nothing in it may change.
export async function dragging({ tab, server, openTab, options }) {
  const first = await tab.still();
  const other = await openTab();
  await other.drag([await other.centerOf('.handle'), [400, 300]]);
  await other.still();
  await tab.page.bringToFront();
  check((await tab.still()) === first, 'a second tab edits for itself');
  await dragAtRandom(tab, server, options.dragSeconds);
  await other.page.close();
}

async function dragAtRandom(tab, server, seconds) {
  const { page } = tab;
  const { width, height } = page.viewportSize();
  await page.evaluate(() => {
    let last = performance.now();
    window.longest = 0;
    const step = (now) => {
      window.longest = Math.max(window.longest, now - last);
      last = now;
      requestAnimationFrame(step);
    };
    requestAnimationFrame(step);
    performance.clearMeasures();
  });
  let seed = 1;
  const random = () => (seed = (seed * 16807) % 2147483647) / 2147483647;
  const inside = (value, most) => Math.min(Math.max(value, 20), most - 120);
  const start = Date.now();
  const sizes = [];
  for (let i = 0; Date.now() - start < 1000 * seconds; ++i) {
    const handles = await page.locator('.handle').count();
    const at = await tab.centerOf(i % 5 === 4 ? '#overview' : `.handle:nth-of-type(${2 + (i % handles)})`);
    const to = [inside(at[0] + 300 * (random() - 0.5), width), inside(at[1] + 240 * (random() - 0.5), height)];
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
  const { longest, pictures } = await page.evaluate(() => ({
    longest: window.longest,
    pictures: performance.getEntriesByName('move to picture').length,
  }));
  console.log(
    `${seconds} s of dragging: ${pictures} pictures, longest time between two frames of the page ${longest.toFixed(0)} ms; ` +
      `server ${(settled / MiB).toFixed(0)} MiB after a tenth, ${(end / MiB).toFixed(0)} at the end, ${(peak / MiB).toFixed(0)} at most`,
  );
  check(pictures > seconds, 'the picture follows at random');
  check(end - settled < 96 * MiB, 'dragging leaks nothing');
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
