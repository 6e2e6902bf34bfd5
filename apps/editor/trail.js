// The trail: recording, key frames, playing, and the video that it makes.

class Trail {
  constructor(editor, link) {
    Object.assign(this, { editor, link, playing: null, recording: null });
    const ids = [
      'record',
      'key-frame',
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
    click('video', () => this.render());
    click('video-cancel', () => ask('api/video', { method: 'DELETE' }));
    this.part['trail-time'].addEventListener('input', () => this.show(Number(this.part['trail-time'].value), 'scrub'));
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
    return { do: 'key_frame', time };
  }

  record() {
    if (this.recording) {
      const last = this.keyFrame(this.now());
      this.recording = null;
      this.editor.send([last]);
    } else {
      this.stop();
      const base = this.trail.times.length ? this.trail.duration : 0;
      this.recording = { base, start: performance.now(), last: base };
      this.editor.send([{ do: 'key_frame', time: base }]);
    }
    this.draw();
  }

  addKeyFrame() {
    if (this.recording) return;
    this.editor.send([{ do: 'key_frame', time: this.trail.times.length ? this.trail.duration + 1 : 0 }]);
  }

  show(time, kind) {
    this.part['trail-time'].value = time;
    this.editor.send([{ do: 'show_trail', time, gesture: kind === 'scrub' ? this.editor.gesture('scrub') : kind }]);
    this.drawTime();
  }

  stop() {
    cancelAnimationFrame(this.playing);
    this.playing = null;
    this.part['trail-play'].textContent = 'Play';
  }

  play() {
    if (this.recording || !this.trail.times.length) return;
    if (this.playing) return this.stop();
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
    const { times, duration } = this.trail;
    this.part['trail-at'].textContent = this.recording
      ? `recording ${duration.toFixed(1)} s`
      : times.length
        ? `${Number(this.part['trail-time'].value).toFixed(1)} / ${duration.toFixed(1)} s`
        : 'empty';
  }

  draw() {
    if (!this.editor.state) return;
    const { times, duration } = this.trail,
      some = times.length > 0;
    this.part.record.setAttribute('aria-pressed', Boolean(this.recording));
    this.part.record.textContent = this.recording ? '\u25a0 Stop' : '\u25cf Record';
    this.part['trail-time'].max = duration;
    keepFocus(['trail-time', 'trail-play', 'trail-clear', 'key-frame', 'record'], () => {
      for (const id of ['trail-time', 'trail-play', 'trail-clear'])
        this.part[id].disabled = !some || Boolean(this.recording);
      this.part['key-frame'].disabled = Boolean(this.recording);
    });
    this.part.video.disabled = !some || Boolean(this.recording) || this.rendering;
    this.part['download-edit'].setAttribute('aria-disabled', !some);
    if (some) this.part['download-edit'].href = addressOf('api/trail', { fps: this.part.fps.value });
    else this.part['download-edit'].removeAttribute('href'); // nor can it have the focus
    this.drawTime();
    this.drawTicks();
  }

  // Anew only where they, the place for them or the colours have changed.
  drawTicks() {
    const { times, duration } = this.trail,
      { ticks } = this.part;
    const color = getComputedStyle(ticks).color;
    const key = JSON.stringify([times, ticks.clientWidth, devicePixelRatio, color]);
    if (key === this.drawnTicks) return;
    this.drawnTicks = key;
    ticks.width = ticks.clientWidth * devicePixelRatio;
    ticks.height = ticks.clientHeight * devicePixelRatio;
    const pen = ticks.getContext('2d');
    pen.fillStyle = color;
    const margin = 8 * devicePixelRatio; // half of the slider's knob
    for (const time of times) {
      pen.fillRect(
        margin + (duration ? time / duration : 0) * (ticks.width - 2 * margin),
        0,
        devicePixelRatio,
        ticks.height,
      );
    }
  }

  async render() {
    try {
      const body = { tab, fps: Number(this.part.fps.value), width: Number(this.part['video-width'].value) };
      await ask('api/video', { method: 'POST', body });
      this.editor.say('');
    } catch (error) {
      this.editor.say(error.message);
    }
    this.watch();
  }

  // How the video is getting on; also how the page notices that the server has gone.
  async watch() {
    clearTimeout(this.timer);
    try {
      const status = await ask('api/video');
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
    } catch (error) {
      if (!this.link.isGone && !this.link.busy) this.link.lose(error);
    }
    this.timer = setTimeout(() => this.watch(), this.rendering ? 300 : 2000);
  }
}
