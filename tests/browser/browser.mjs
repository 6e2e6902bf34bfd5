// A headless Chromium, spoken to over its debugging pipe: no package is needed beyond Node and Chromium.
import { spawn, spawnSync } from 'node:child_process';
import { mkdtempSync, rmSync } from 'node:fs';
import { tmpdir } from 'node:os';
import { join } from 'node:path';

// The program's name, or nothing where there is none.
export function findChromium() {
  return ['chromium', 'chromium-browser', 'google-chrome'].find((name) => spawnSync(name, ['--version']).status === 0);
}

export class Browser {
  constructor(program, { width = 1280, height = 720 } = {}) {
    this.profile = mkdtempSync(join(tmpdir(), 'enf-browser-'));
    const flags = [
      '--headless',
      '--no-sandbox',
      '--disable-gpu',
      '--no-first-run',
      '--remote-debugging-pipe',
      `--window-size=${width},${height}`,
      `--user-data-dir=${this.profile}`,
      'about:blank',
    ];
    this.process = spawn(program, flags, { stdio: ['ignore', 'ignore', 'ignore', 'pipe', 'pipe'] });
    this.size = { width, height };
    this.waiting = new Map();
    this.next = 1;
    this.problems = []; // exceptions and errors that the page reported
    let text = '';
    this.process.stdio[4].on('data', (data) => {
      text += data;
      const messages = text.split('\0');
      text = messages.pop();
      for (const message of messages) this.take(JSON.parse(message));
    });
  }

  take(message) {
    if (message.method === 'Runtime.exceptionThrown')
      this.problems.push(message.params.exceptionDetails.exception?.description);
    if (message.method === 'Log.entryAdded' && message.params.entry.level === 'error')
      this.problems.push(message.params.entry.text);
    const waiting = this.waiting.get(message.id);
    if (!waiting) return;
    this.waiting.delete(message.id);
    if (message.error) waiting.reject(new Error(message.error.message));
    else waiting.resolve(message.result);
  }

  send(method, params = {}, sessionId = this.session) {
    const id = this.next++;
    this.process.stdio[3].write(JSON.stringify({ id, method, params, sessionId }) + '\0');
    return new Promise((resolve, reject) => this.waiting.set(id, { resolve, reject }));
  }

  async open(url) {
    const { targetId } = await this.send('Target.createTarget', { url: 'about:blank' }, undefined);
    ({ sessionId: this.session } = await this.send('Target.attachToTarget', { targetId, flatten: true }, undefined));
    for (const domain of ['Page', 'Runtime', 'Log']) await this.send(`${domain}.enable`);
    await this.send('Emulation.setDeviceMetricsOverride', { ...this.size, deviceScaleFactor: 1, mobile: false });
    await this.send('Page.navigate', { url });
  }

  // The value of an expression in the page; promises are waited for.
  async evaluate(expression) {
    const answer = await this.send('Runtime.evaluate', { expression, awaitPromise: true, returnByValue: true });
    if (answer.exceptionDetails) throw new Error(answer.exceptionDetails.exception?.description || expression);
    return answer.result.value;
  }

  async until(expression, seconds = 20) {
    for (const end = Date.now() + 1000 * seconds; Date.now() < end; await pause(50)) {
      if (await this.evaluate(expression)) return;
    }
    throw new Error(`waited ${seconds} s in vain for: ${expression}`);
  }

  mouse(type, [x, y], more = {}) {
    return this.send('Input.dispatchMouseEvent', {
      type,
      x,
      y,
      button: type === 'mouseMoved' && !more.buttons ? 'none' : 'left',
      clickCount: type === 'mouseMoved' ? 0 : 1,
      ...more,
    });
  }

  // modifiers: 1 Alt, 2 Ctrl, 8 Shift.
  async key(key, modifiers = 0) {
    const codes = { ArrowLeft: 37, ArrowUp: 38, ArrowRight: 39, ArrowDown: 40, Tab: 9, PageUp: 33, PageDown: 34 };
    const windowsVirtualKeyCode = codes[key] || key.toUpperCase().charCodeAt(0);
    await this.send('Input.dispatchKeyEvent', { type: 'rawKeyDown', key, modifiers, windowsVirtualKeyCode });
    await this.send('Input.dispatchKeyEvent', { type: 'keyUp', key, modifiers, windowsVirtualKeyCode });
  }

  async screenshot() {
    return Buffer.from((await this.send('Page.captureScreenshot', { format: 'png' })).data, 'base64');
  }

  async close() {
    const ended = new Promise((done) => this.process.on('exit', done));
    this.process.kill();
    await ended;
    rmSync(this.profile, { recursive: true, force: true, maxRetries: 20, retryDelay: 100 });
  }
}

export const pause = (milliseconds) => new Promise((done) => setTimeout(done, milliseconds));
