// The page behind a proxy, under a path.
import { createServer, request as ask } from 'node:http';
import { check, Tab } from './desk.mjs';

const PREFIX = '/some/prefix';

// Hands on what comes under PREFIX, without it; `host`: what it says the host is, by default what the browser said.
async function startProxy(server, host) {
  const target = new URL(server.url);
  const proxy = createServer((from, to) => {
    if (!from.url.startsWith(`${PREFIX}/`)) return to.writeHead(404).end();
    const headers = { ...from.headers, ...(host && { host }) };
    const wish = { port: target.port, host: target.hostname, method: from.method, path: from.url.slice(PREFIX.length) };
    const onward = ask({ ...wish, headers }, (answer) => {
      to.writeHead(answer.statusCode, answer.headers);
      answer.pipe(to);
    });
    onward.on('error', () => to.destroy());
    return from.pipe(onward);
  });
  await new Promise((listening) => proxy.listen(0, '127.0.0.1', listening));
  const url = `http://127.0.0.1:${proxy.address().port}${PREFIX}/${target.search}`;
  return { url, close: () => (proxy.closeAllConnections(), proxy.close()) };
}

export async function proxy({ tab, server, context, options }) {
  const direct = await tab.still();
  const kept = await startProxy(server);
  const behind = new Tab(await context.newPage(), options);
  await behind.open(kept.url);
  check((await behind.still()) === direct, 'behind a proxy, under a path, the page has the same picture');
  const [x, y] = await behind.centerOf('.handle');
  await behind.drag([
    [x, y],
    [x + 40, y - 60],
  ]);
  check((await behind.still()) !== direct, 'and a drag changes it');
  await behind.key('k');
  await behind.until(() => document.getElementById('download-edit').href);
  const { path } = await behind.download(() => behind.page.click('#download-edit'));
  check(Boolean(path), 'the edit file can be had there');
  check(behind.problems.length === 0, `the page reports no errors ${behind.problems.join('; ')}`);
  await behind.page.close();
  kept.close();

  const renamed = await startProxy(server, new URL(server.url).host);
  const refused = await context.newPage();
  await refused.goto(renamed.url);
  const said = refused.locator('#gone-says', { hasText: "is not this editor's" });
  await said.waitFor({ timeout: 20000 });
  check(true, "behind one that says another host, the page says that it is not this editor's");
  await refused.close();
  renamed.close();
}
