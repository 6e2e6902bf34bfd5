// What all subjects share: an enf-edit of their own, pages of it, and what is done and seen there.
import { spawn } from 'node:child_process';
import { cpSync, mkdirSync, mkdtempSync, readFileSync, rmSync } from 'node:fs';
import { tmpdir } from 'node:os';
import { basename, join, resolve } from 'node:path';

export const pause = (milliseconds) => new Promise((done) => setTimeout(done, milliseconds));

let failures = 0;
export const anyFailed = () => failures > 0;
export function check(condition, what) {
  console.log(`${condition ? 'passed' : 'FAILED'}: ${what}`);
  if (!condition) ++failures;
}

// enf-edit on a copy of a run, with temporary files of its own and a token that outlives it.
export class Server {
  constructor(program, run) {
    this.program = program;
    this.scratch = mkdtempSync(join(tmpdir(), 'enf-browser-test-'));
    this.run = join(this.scratch, basename(resolve(run)));
    this.temporary = join(this.scratch, 'temporary');
    cpSync(run, this.run, { recursive: true });
    mkdirSync(this.temporary);
  }

  async start({ run = this.run, port = 0 } = {}) {
    const flags = ['--port', String(port), '--quiet', '--token-file', join(this.scratch, 'token')];
    const env = { ...process.env, TMPDIR: this.temporary };
    this.process = spawn(this.program, [run, ...flags], { env, stdio: ['ignore', 'pipe', 'inherit'] });
    this.url = await new Promise((found, failed) => {
      this.process.stdout.once('data', (data) => found(String(data).trim()));
      this.process.once('exit', (code) => failed(new Error(`${this.program} ended with ${code} before it served`)));
    });
  }

  // Ctrl-C; the exit status.
  async end() {
    const ended = new Promise((done) => this.process.once('exit', done));
    this.process.kill('SIGINT');
    return ended;
  }

  // Bytes of memory that it holds.
  memory() {
    return 1024 * Number(/VmRSS:\s+(\d+)/.exec(readFileSync(`/proc/${this.process.pid}/status`, 'utf8'))[1]);
  }

  remove() {
    this.process?.kill('SIGKILL');
    rmSync(this.scratch, { recursive: true, force: true });
  }
}

// One page of the editor, which is a tab for the server.
export class Tab {
  constructor(page, options) {
    this.page = page;
    this.shots = options.screenshots;
    this.problems = []; // errors that the page reported
    page.on('pageerror', (error) => this.problems.push(error.message));
    page.on('console', (message) => message.type() === 'error' && this.problems.push(message.text()));
  }

  // Waits for the first picture.
  async open(url) {
    await this.page.goto(url);
    await this.until(() => document.getElementById('status').textContent.includes('ms'));
  }

  // The page forbids eval, which Playwright's own waiting for a function needs.
  async until(condition, argument, seconds = 30) {
    for (const end = Date.now() + 1000 * seconds; Date.now() < end; await pause(50)) {
      if (await this.page.evaluate(condition, argument)) return;
    }
    throw new Error(`waited ${seconds} s in vain for: ${condition}`);
  }

  text(id) {
    return this.page.evaluate((of) => document.getElementById(of).textContent, id);
  }

  centerOf(selector) {
    return this.page.evaluate((of) => {
      const box = document.querySelector(of).getBoundingClientRect();
      return [box.x + box.width / 2, box.y + box.height / 2];
    }, selector);
  }

  // Where it has to be that of a state that `rests`: empty while the page waits for another one, or shows a preview.
  picture(rests = false) {
    return this.page.evaluate((ofRest) => {
      const canvas = document.getElementById('picture');
      const wide = String(canvas.width) === document.getElementById('still-width').value;
      if (ofRest && (!wide || canvas.getAttribute('aria-busy') === 'true')) return '';
      return `${canvas.width}x${canvas.height}:${canvas.toDataURL()}`;
    }, rests);
  }

  // The picture of a state that rests, the same twice in a row: what the pointer did may be on its way to the page.
  async still(seconds = 60) {
    let last = '';
    for (const end = Date.now() + 1000 * seconds; Date.now() < end; await pause(80)) {
      const now = await this.picture(true);
      if (now && now === last) return now;
      last = now;
    }
    throw new Error(`waited ${seconds} s in vain for the picture to rest`);
  }

  // Through these places with the button down, `steps` moves between two of them, which last `wait` ms or longer.
  async drag(path, { steps = 10, wait = 16, modifier } = {}) {
    const { mouse, keyboard } = this.page;
    await mouse.move(...path[0]);
    if (modifier) await keyboard.down(modifier);
    await mouse.down();
    for (let i = 1; i < path.length; ++i) {
      for (let k = 1; k <= steps; ++k) {
        const at = [0, 1].map((axis) => path[i - 1][axis] + ((path[i][axis] - path[i - 1][axis]) * k) / steps);
        await Promise.all([mouse.move(...at), pause(wait)]);
      }
    }
    await mouse.up();
    if (modifier) await keyboard.up(modifier);
  }

  key(...keys) {
    return keys.reduce((before, key) => before.then(() => this.page.keyboard.press(key)), Promise.resolve());
  }

  // What the page saves when `act` is done, as { name, path }. Firefox numbers names that it has had.
  async download(act) {
    const [file] = await Promise.all([this.page.waitForEvent('download'), act()]);
    return { name: file.suggestedFilename().replace(/\(\d+\)/, ''), path: await file.path() };
  }

  async shot(name) {
    if (!this.shots) return;
    const known = this.problems.length;
    await this.page.screenshot({ path: join(this.shots, `${name}.png`) });
    this.problems.length = known; // Playwright adds a style, which the page's policy forbids, and Firefox reports
  }
}
