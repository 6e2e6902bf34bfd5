// What one can see: contrast in both themes, words that are explained, and room for everything on small screens.
import { check } from './desk.mjs';

const TEXT = 4.5; // WCAG 2.2, 1.4.3, level AA
const SHAPES = 3; // 1.4.11

// In the page: colours that are too close, as messages. `least` of text and of what else has to be told apart.
function lowContrasts([leastOfText, leastOfShapes]) {
  const pen = Object.assign(document.createElement('canvas'), { width: 1, height: 1 }).getContext('2d', {
    willReadFrequently: true,
  });
  // Colours over each other, the lowest first, as [r, g, b] of what one sees.
  const seen = (...colors) => {
    pen.clearRect(0, 0, 1, 1);
    for (const color of colors) {
      pen.fillStyle = color;
      pen.fillRect(0, 0, 1, 1);
    }
    return [...pen.getImageData(0, 0, 1, 1).data.slice(0, 3)];
  };
  const luminance = (color) => {
    const [r, g, b] = color.map((value) => {
      const share = value / 255;
      return share <= 0.04045 ? share / 12.92 : ((share + 0.055) / 1.055) ** 2.4;
    });
    return 0.2126 * r + 0.7152 * g + 0.0722 * b;
  };
  const contrast = (a, b) => {
    const [low, high] = [luminance(a), luminance(b)].sort((x, y) => x - y);
    return (high + 0.05) / (low + 0.05);
  };
  const behind = (element) => {
    const colors = [];
    for (let at = element; at; at = at.parentElement) colors.unshift(getComputedStyle(at).backgroundColor);
    return colors;
  };
  const found = [];
  const demand = (a, b, least, what) => {
    const reached = contrast(a, b);
    if (reached < least) found.push(`${what}: ${reached.toFixed(2)}`);
  };

  const hasText = (element) => [...element.childNodes].some((node) => node.nodeType === 3 && node.data.trim());
  let texts = 0;
  for (const element of document.querySelectorAll('body *')) {
    if (element.closest('svg, script, option') || element.getClientRects().length === 0) continue;
    if (!hasText(element) && !element.matches('select')) continue;
    if (element.disabled || element.ariaDisabled === 'true') continue; // which WCAG leaves out
    ++texts;
    const back = behind(element);
    const what = `'${element.textContent.trim().slice(0, 30)}'`;
    demand(seen(...back, getComputedStyle(element).color), seen(...back), leastOfText, what);
  }
  for (const text of document.querySelectorAll('.handle text')) {
    const fill = text.parentNode.querySelector('[fill]').getAttribute('fill');
    demand(seen(getComputedStyle(text).fill), seen(fill), leastOfText, `the number on handle ${text.textContent}`);
  }
  const style = getComputedStyle(document.documentElement);
  const named = (name) => seen(style.getPropertyValue(name));
  for (const [name, on] of [
    ['--accent', '--panel'], // the ring around what has the focus
    ['--accent', '--well'], // the camera in the overview
    ['--faint', '--well'], // capture cameras there
    ['--accent', '--back'],
  ])
    demand(named(name), named(on), leastOfShapes, `${name} on ${on}`);
  // A handle lies over any picture: its light and its dark rim have to be far apart, as one of them shows.
  const [rim, edge] = ['.rim', '.edge'].map((of) => getComputedStyle(document.querySelector(`.handle ${of}`)).stroke);
  demand(seen(rim), seen(edge), 7, 'the rims of a handle');
  return { texts, found };
}

// In the page: controls and headings without a tooltip, or without a name for those who hear the page.
function unexplained() {
  const explained = (element) =>
    element.title || element.getAttribute('aria-describedby') || element.closest('label')?.title ||
    element.querySelector(':scope > title')?.textContent;
  const called = (element) =>
    element.getAttribute('aria-label') || element.closest('label')?.textContent.trim() || element.textContent.trim();
  const nameOf = (element) => element.id || element.textContent.trim() || element.outerHTML.slice(0, 60);
  const controls = [...document.querySelectorAll('button, select, input, a, progress, [tabindex], .chip, .numbers')];
  const headings = [...document.querySelectorAll('aside h2, footer h2')];
  return [
    ...[...controls, ...headings].filter((one) => !explained(one) && !one.closest('#help-box p')).map(nameOf),
    ...controls.filter((one) => !called(one) && !one.matches('progress')).map((one) => `${nameOf(one)} (no name)`),
  ];
}

// In the page: controls that are cut off, or lie under something else.
function outOfSight() {
  return [...document.querySelectorAll('button, select, input, a, output, .handle')]
    .filter((one) => one.getClientRects().length > 0 && !one.closest('#points'))
    .filter((one) => {
      const box = one.getBoundingClientRect();
      const inside = box.left >= 0 && box.top >= 0 && box.right <= innerWidth && box.bottom <= innerHeight;
      const top = document.elementFromPoint(box.left + box.width / 2, box.top + box.height / 2);
      return !inside || !(one.contains(top) || top?.contains(one) || top?.closest('.handle'));
    })
    .map((one) => one.id || one.textContent);
}

// In the page: how high the lines at the bottom are while nothing was rendered, while a video is, and once it was.
function footerHeights() {
  const ids = ['video', 'video-cancel', 'video-progress', 'video-file'];
  return [['video'], ['video-cancel', 'video-progress'], ['video', 'video-file']].map((shown) => {
    for (const id of ids) document.getElementById(id).hidden = !shown.includes(id);
    return document.querySelector('footer').getBoundingClientRect().height;
  });
}

export async function look({ tab }) {
  const { page } = tab;
  await tab.still();
  const size = page.viewportSize();
  for (let i = 0; i < 2; ++i) {
    const theme = await page.evaluate(() => document.documentElement.dataset.theme);
    for (const key of ['', '?', 'v']) {
      if (key) await tab.key(key);
      const { texts, found } = await page.evaluate(lowContrasts, [TEXT, SHAPES]);
      const where = { '': 'the page', '?': 'the help', v: 'the dialog of a video' }[key];
      check(found.length === 0, `${theme}, ${where}: ${texts} texts can be read ${found.join('; ')}`);
      await tab.shot(`${theme}-${where.replaceAll(' ', '-')}`);
      if (key) await tab.key('Escape');
    }
    await page.click('#theme');
  }
  const missing = await page.evaluate(unexplained);
  check(missing.length === 0, `every control and heading is explained and has a name ${missing.join('; ')}`);

  for (const [width, height] of [
    [1024, 600],
    [1280, 720],
    [1366, 768],
    [1920, 1080],
  ]) {
    await page.setViewportSize({ width, height });
    await tab.still();
    const lost = await page.evaluate(outOfSight);
    check(lost.length === 0, `${width} x ${height}: every control is in sight ${lost.join('; ')}`);
    const share = await page.evaluate(() => {
      const { width, height } = document.getElementById('picture').getBoundingClientRect();
      return (width * height) / (innerWidth * innerHeight);
    });
    check(share > 0.25, `and the picture has ${(100 * share).toFixed(0)}% of it`);
    await tab.key('?');
    const hidden = await page.evaluate(() => {
      const help = document.getElementById('help-box');
      return help.scrollHeight - help.clientHeight;
    });
    await tab.key('Escape');
    check(hidden <= 0, `the help is in sight, but for ${hidden} pixels`);
    const sharp = await page.evaluate(() => {
      const ticks = document.getElementById('ticks');
      return ticks.width === Math.floor(ticks.clientWidth * devicePixelRatio);
    });
    check(sharp, 'marks of key frames are drawn for this size');
    const heights = await page.evaluate(footerHeights);
    check(heights.every((height) => height < 80), `a video needs no third line: ${heights.join(', ')} pixels`);
    await page.evaluate(() => (document.getElementById('video-file').hidden = true));
    await tab.shot(`${width}x${height}`);
  }
  await page.setViewportSize(size);
}
