// The trail: recording, key frames, playing, and the video that it makes.

const LONGEST_TRAIL = 300; // seconds

class Trail {
  constructor(editor, link) {
    // chosen: the index of a key frame, or null. dragged: the time that the mark under the pointer would get.
    Object.assign(this, { editor, link, playing: null, recording: null, chosen: null, dragged: null, known: null });
    this.refused = {}; // what was said last to requests that were refused, by what they were for
    const ids = [
      'record',
      'key-frame',
      'key-frame-before',
      'key-frame-at',
      'key-frame-after',
      'key-frame-time',
      'key-frame-replace',
      'key-frame-delete',
      'trail-play',
      'trail-time',
      'ticks',
      'trail-at',
      'trail-clear',
      'download-edit',
      'fps',
      'video-width',
      'video',
      'video-progress',
      'video-cancel',
      'video-file',
    ];
    this.part = Object.fromEntries(ids.map((id) => [id, document.getElementById(id)]));
    const click = (id, act) => this.part[id].addEventListener('click', act);
    click('record', () => this.record());
    click('key-frame', () => this.addKeyFrame());
    click('trail-play', () => this.play());
    click('trail-clear', () => this.editor.send([{ do: 'clear_trail' }]));
    click('key-frame-before', () => this.step(-1));
    click('key-frame-after', () => this.step(1));
    click('key-frame-replace', () => this.replace());
    click('key-frame-delete', () => this.remove());
    this.part['key-frame-time'].addEventListener('change', () => this.typeTime());
    const { ticks } = this.part;
    ticks.addEventListener('pointerdown', (event) => this.hold(event));
    ticks.addEventListener('pointermove', (event) => this.drag(event));
    ticks.addEventListener('pointerup', () => this.drop());
    ticks.addEventListener('pointercancel', () => this.drop(false));
    new ResizeObserver(() => this.editor.state && this.drawTicks()).observe(ticks);
    click('video', () => this.render());
    click('video-cancel', () => this.attempt('cancel', () => ask(addressOf('api/video'), { method: 'DELETE' })));
    this.part['trail-time'].addEventListener('input', () => {
      this.choose(null);
      this.show(Number(this.part['trail-time'].value), this.editor.gesture('scrub'));
    });
    this.part.fps.addEventListener('change', () => this.draw());
    // While recording, every request ends with a key frame; after a rest one before it says that nothing moved.
    link.before = () =>
      this.recording && this.now() - this.recording.last > 0.25 ? [this.keyFrame(this.now() - 0.1)] : [];
    link.behind = () => (this.recording ? [this.keyFrame(this.now())] : []);
    this.watch();
  }

  get trail() {
    return this.editor.state.trail;
  }
  now() {
    return this.recording.base + (performance.now() - this.recording.start) / 1000;
  }

  keyFrame(time) {
    if (this.recording) this.recording.last = time;
    return { do: 'key_frame', time, gesture: this.recording?.gesture };
  }

  record() {
    if (this.recording) {
      const last = this.keyFrame(this.now());
      this.recording = null;
      this.editor.send([last]);
    } else {
      this.stop();
      const base = this.trail.times.length ? this.trail.duration : 0;
      this.recording = { base, start: performance.now(), last: base, gesture: this.editor.gesture() };
      this.editor.send([this.keyFrame(base)]);
    }
    this.draw();
  }

  addKeyFrame() {
    if (this.recording) return;
    this.editor.send([{ do: 'key_frame', time: this.trail.times.length ? this.trail.duration + 1 : 0 }]);
  }

  show(time, gesture) {
    this.part['trail-time'].value = time;
    this.editor.send([{ do: 'show_trail', time, gesture }]);
    this.drawTime();
  }

  // Key frame `index`, or none.
  choose(index) {
    if ((index === null && this.chosen === null) || this.recording) return;
    this.known = null;
    this.chosen = index;
    if (index !== null) {
      this.stop();
      this.show(this.trail.times[index], this.editor.gesture('scrub'));
    }
    this.draw();
  }

  // To the key frame before (-1) or after (1) the chosen one, or the moment that is shown.
  step(by) {
    const { times } = this.trail,
      now = Number(this.part['trail-time'].value);
    if (!times.length) return;
    const after = times.filter((time) => time <= now + 0.006).length; // the slider knows hundredths
    const index = this.chosen === null ? (by < 0 ? after - 1 : after) : this.chosen + by;
    this.choose(Math.min(Math.max(index, 0), times.length - 1));
  }

  // Before an undo: which key frame is chosen. Where the undo changes the trail, its time says which it is then.
  keepChoice() {
    if (this.chosen !== null) this.known = { times: String(this.trail.times), time: this.trail.times[this.chosen] };
  }

  restoreChoice() {
    const { known } = this,
      { times } = this.trail;
    if (!known || String(times) === known.times) return;
    const index = times.indexOf(known.time);
    this.chosen = index < 0 ? null : index;
    this.known = null;
  }

  replace() {
    if (this.chosen === null) return;
    this.editor.send([{ do: 'replace_key_frame', index: this.chosen }]);
  }

  // Chooses the one behind it, or the one that is the last then.
  remove() {
    if (this.chosen === null) return;
    const gesture = this.editor.gesture(),
      index = this.chosen;
    this.editor.send([{ do: 'remove_key_frame', index, gesture }]);
    this.expect(this.trail.times.filter((_, i) => i !== index));
    const { times } = this.trail;
    this.chosen = times.length ? Math.min(index, times.length - 1) : null;
    if (this.chosen !== null) this.show(times[this.chosen], gesture);
    this.draw();
  }

  isTaken(time) {
    return this.trail.times.some((other, i) => i !== this.chosen && Math.abs(other - time) < 0.005);
  }

  // Moves the chosen key frame to this time, past others where it has to; what is shown stays.
  retime(time) {
    const index = this.chosen;
    this.accept('time');
    this.editor.send([{ do: 'move_key_frame', index, time, gesture: this.editor.gesture('retime') }]);
    const others = this.trail.times.filter((_, i) => i !== index);
    this.expect([...others, time].sort((a, b) => a - b));
    this.chosen = others.filter((other) => other < time).length;
    this.draw();
    this.part['trail-time'].value = this.trail.times[this.chosen];
    this.drawTime();
  }

  // By seconds from `time`; farther where there is a key frame already.
  nudge(by, time = this.trail.times[this.chosen] + by) {
    if (this.chosen === null || this.trail.times.length < 2) return;
    while (this.isTaken(time)) time += by / 10;
    if (time >= 0 && time <= LONGEST_TRAIL) this.retime(time);
  }

  typeTime() {
    const input = this.part['key-frame-time'],
      time = Number(input.value);
    if (this.chosen === null || input.value === '' || !input.reportValidity()) return;
    if (this.isTaken(time)) this.editor.say((this.refused.time = `There is a key frame at ${time} s already.`));
    else this.retime(time);
    this.drawKeyFrame(true);
  }

  // Until the server says so: times of key frames, of which the first is where the trail begins.
  expect(times) {
    const from0 = times.map((time) => time - times[0]);
    this.known = null;
    this.editor.state.trail = { times: from0, duration: times.length ? from0[times.length - 1] : 0 };
  }

  // The time at a place of the marks, in pixels, and back; the slider's knob keeps half of its width from both ends.
  get margin() {
    return 8;
  }
  timeAt(x) {
    const width = this.part.ticks.clientWidth - 2 * this.margin;
    return ((x - this.margin) / width) * this.trail.duration;
  }
  placeOf(time) {
    const { duration } = this.trail;
    const width = this.part.ticks.clientWidth - 2 * this.margin;
    return this.margin + (duration ? Math.min(time / duration, 1) : 0) * width;
  }

  hold(event) {
    const { times } = this.trail;
    if (event.button !== 0 || this.recording || !times.length) return;
    const away = times.map((time) => Math.abs(this.placeOf(time) - event.offsetX));
    const nearest = away.indexOf(Math.min(...away));
    if (away[nearest] > 8) return;
    this.part.ticks.setPointerCapture(event.pointerId);
    if (nearest !== this.chosen) this.choose(nearest);
    this.held = event.offsetX;
  }

  drag(event) {
    if (this.held === undefined || this.trail.times.length < 2) return;
    if (this.dragged === null && Math.abs(event.offsetX - this.held) < 3) return;
    const time = Math.round(100 * this.timeAt(event.offsetX)) / 100;
    this.dragged = Math.min(Math.max(time, 0), LONGEST_TRAIL);
    this.drawKeyFrame(true);
    this.drawTicks();
  }

  drop(moved = true) {
    const { dragged, held } = this;
    Object.assign(this, { held: undefined, dragged: null });
    if (held === undefined || !moved) return this.draw();
    if (dragged === null) this.choose(this.chosen);
    else this.nudge(0.1, dragged);
    this.draw();
  }

  stop() {
    cancelAnimationFrame(this.playing);
    this.playing = null;
    this.part['trail-play'].textContent = 'Play';
  }

  play() {
    if (this.recording || !this.trail.times.length) return;
    if (this.playing) return this.stop();
    this.choose(null);
    const gesture = this.editor.gesture(),
      start = performance.now();
    const step = () => {
      const time = Math.min((performance.now() - start) / 1000, this.trail.duration);
      this.show(time, gesture);
      if (time >= this.trail.duration) return this.stop();
      this.playing = requestAnimationFrame(step);
    };
    this.part['trail-play'].textContent = 'Stop';
    this.playing = requestAnimationFrame(step);
  }

  drawTime() {
    const { times, duration } = this.trail,
      { 'trail-at': output, 'trail-time': slider } = this.part;
    const length = duration.toFixed(1);
    if (this.recording) write(output, `recording ${length} s`);
    else if (!times.length) write(output, 'empty');
    else write(output, `${Number(slider.value).toFixed(1)} / ${length} s`, `${length} / ${length} s`);
  }

  draw() {
    if (!this.editor.state) return;
    const { times, duration } = this.trail,
      some = times.length > 0;
    this.restoreChoice();
    if (this.recording || this.chosen >= times.length) this.chosen = null;
    this.part.record.setAttribute('aria-pressed', Boolean(this.recording));
    this.part.record.textContent = this.recording ? '\u25a0 Stop' : '\u25cf Record';
    this.part['trail-time'].max = duration;
    const all = ['trail-time', 'trail-play', 'trail-clear', 'key-frame-before', 'key-frame-after'];
    const ofChosen = ['key-frame-time', 'key-frame-replace', 'key-frame-delete'];
    keepFocus([...all, 'key-frame', 'record', ...ofChosen], () => {
      for (const id of all) this.part[id].disabled = !some || Boolean(this.recording);
      for (const id of ofChosen) this.part[id].disabled = this.chosen === null;
      if (times.length < 2) this.part['key-frame-time'].disabled = true;
      this.part['key-frame'].disabled = Boolean(this.recording);
    });
    this.part.video.disabled = !some || Boolean(this.recording) || this.rendering;
    this.part['download-edit'].setAttribute('aria-disabled', !some);
    if (some) this.part['download-edit'].href = addressOf('api/trail', { fps: this.part.fps.value });
    else this.part['download-edit'].removeAttribute('href'); // nor can it have the focus
    this.drawTime();
    this.drawKeyFrame();
    this.drawTicks();
  }

  // What is being typed stays, unless it is `done`.
  drawKeyFrame(done = false) {
    const { times } = this.trail,
      { chosen } = this,
      { 'key-frame-at': output, 'key-frame-time': input } = this.part;
    const count = times.length;
    if (!count) write(output, 'none');
    else write(output, `${chosen === null ? '\u2013' : chosen + 1} / ${count}`, `${count} / ${count}`);
    if (!done && document.activeElement === input) return;
    input.value = chosen === null ? '' : (this.dragged ?? times[chosen]).toFixed(2);
  }

  // Diamonds, slim where others are near. Anew only where they, the place for them or the colours have changed.
  drawTicks() {
    const { times } = this.trail,
      { ticks } = this.part,
      { chosen, dragged } = this;
    const style = getComputedStyle(ticks);
    const [color, accent] = ['--faint', '--accent'].map((name) => style.getPropertyValue(name));
    const key = JSON.stringify([times, chosen, dragged, ticks.clientWidth, devicePixelRatio, color]);
    if (key === this.drawnTicks) return;
    this.drawnTicks = key;
    ticks.width = ticks.clientWidth * devicePixelRatio;
    ticks.height = ticks.clientHeight * devicePixelRatio;
    const pen = ticks.getContext('2d');
    pen.scale(devicePixelRatio, devicePixelRatio);
    const middle = ticks.clientHeight / 2;
    const mark = (x, half) => {
      pen.beginPath();
      for (const [dx, dy] of [[-half, 0], [0, -middle], [half, 0], [0, middle]]) pen.lineTo(x + dx, middle + dy);
      pen.fill();
    };
    const at = times.map((time) => this.placeOf(time));
    const gap = (i) => Math.min(...[at[i] - at[i - 1], at[i + 1] - at[i]].filter(Number.isFinite));
    pen.fillStyle = color;
    at.forEach((x, i) => mark(x, Math.max(1, Math.min(4, gap(i) / 2))));
    if (chosen === null) return;
    pen.fillStyle = accent;
    mark(this.placeOf(dragged ?? times[chosen]), 6);
  }

  // What was said to a refusal of this is over.
  accept(what) {
    const said = this.refused[what];
    if (said && document.getElementById('gone-says').textContent === said) this.editor.say('');
    this.refused[what] = '';
  }

  // A refusal is said in the server's words; where nobody answers, or nobody who knows this page, the page waits.
  async attempt(what, act) {
    const { refused } = this;
    try {
      const answer = await act();
      this.accept(what);
      return answer;
    } catch (error) {
      if (error.status && error.status !== 403) {
        if (error.message !== refused[what]) this.editor.say((refused[what] = error.message)); // once: one may close it
      } else if (!this.link.isGone && !this.link.busy) {
        this.link.lose(error);
      }
      return null;
    }
  }

  async render() {
    const body = { tab, fps: Number(this.part.fps.value), width: Number(this.part['video-width'].value) };
    this.refused.render = '';
    if (await this.attempt('render', () => ask('api/video', { method: 'POST', body }))) this.editor.say('');
    this.watch();
  }

  // How the video is getting on; also how the page notices that the server has gone.
  async watch() {
    clearTimeout(this.timer);
    const status = await this.attempt('watch', () => ask(addressOf('api/video')));
    if (status) {
      this.rendering = status.state === 'running';
      const { part } = this;
      part['video-progress'].max = Math.max(status.total, 1);
      part['video-progress'].value = status.done;
      part['video-progress'].textContent = `${status.done} of ${status.total}`;
      part['video-file'].href = addressOf('api/video/file');
      keepFocus(['video-cancel', 'video-file', 'video', 'record'], () => {
        part['video-progress'].hidden = part['video-cancel'].hidden = !this.rendering;
        part['video-file'].hidden = status.state !== 'done';
        part.video.hidden = this.rendering;
        if (this.editor.state) part.video.disabled = !this.trail.times.length || Boolean(this.recording);
      });
      if (status.state === 'failed' && this.told !== status.message) this.editor.say((this.told = status.message));
    }
    this.timer = setTimeout(() => this.watch(), this.rendering ? 300 : 2000);
  }
}
