// A video drives a key point: the file goes to the server in pieces, a point of its first frame is chosen, and the
// motion that the server finds is tried in the picture or becomes the trail.

const PIECE = 512 * 1024; // bytes; requests are limited to twice that
const MOST_KEY_FRAMES = 300; // of a trail that is made at once

class Motion {
  constructor(editor) {
    Object.assign(this, { editor, found: null, point: null, playing: 0, pairs: [] });
    const ids = ['box', 'file', 'key-point', 'says', 'picture', 'progress', 'reversed', 'straight', 'preview', 'apply'];
    ids.push('pairing', 'frame', 'frame-at', 'row', 'pair', 'pairs');
    this.part = Object.fromEntries(ids.map((id) => [id, document.getElementById(`motion-${id}`)]));
    const on = (name, event, act) => this.part[name].addEventListener(event, act);
    document.getElementById('motion-open').addEventListener('click', () => this.open());
    document.getElementById('motion-close').addEventListener('click', () => this.part.box.close());
    on('file', 'change', () => this.attempt(() => this.upload(this.part.file.files[0])));
    on('picture', 'click', (event) => {
      const { picture } = this.part,
        zoom = this.image.width / picture.clientWidth;
      this.point = [event.offsetX * zoom, event.offsetY * zoom];
      this.attempt(() => this.follow());
    });
    on('picture', 'keydown', (event) => this.key(event));
    for (const id of ['key-point', 'reversed', 'straight'])
      on(id, 'change', () => this.found && this.attempt(() => this.follow()));
    on('frame', 'input', () => this.draw());
    on('pair', 'click', () => this.addPair());
    on('preview', 'click', () => this.preview());
    on('apply', 'click', () => this.apply());
    on('box', 'close', () => this.stop());
  }

  build() {
    const { colors } = this.editor.scene;
    this.part['key-point'].replaceChildren(...colors.map((_, n) => new Option(n + 1, n)));
    document.getElementById('motion-open').hidden = !colors.length;
  }

  open() {
    if (!this.editor.scene?.colors.length || this.part.box.open) return;
    if (trail.recording) trail.record(); // what is tried here is no part of it
    Object.assign(this.part.row, { max: this.editor.scene.training_frames.length, value: this.editor.state.row + 1 });
    this.part.box.showModal();
  }

  say(text) {
    this.part.says.textContent = text;
  }

  // Whatever goes wrong is said in the box.
  async attempt(act) {
    this.found = null;
    this.draw();
    try {
      await act();
    } catch (error) {
      this.part.progress.hidden = true;
      this.say(error.message);
    }
    this.draw();
  }

  showProgress(done, total) {
    Object.assign(this.part.progress, { hidden: false, max: Math.max(total, 1), value: done });
  }

  async upload(file) {
    if (!file) return;
    this.image = this.point = null;
    this.setPairs([]);
    this.say(`Sending ${file.name}`);
    let answer;
    for (let offset = 0; offset === 0 || offset < file.size; offset += PIECE) {
      this.showProgress(offset, file.size);
      const last = offset + PIECE >= file.size ? 1 : 0;
      answer = await ask(addressOf('api/motion/video', { offset, size: file.size, last }), {
        method: 'POST',
        bytes: file.slice(offset, offset + PIECE),
      });
    }
    const bytes = Uint8Array.from(atob(answer.picture), (character) => character.charCodeAt(0));
    this.image = await createImageBitmap(new Blob([bytes], { type: 'image/jpeg' }));
    this.point = [answer.width / 2, answer.height / 2];
    this.part.progress.hidden = true;
    this.say('Click what is to be followed: something with texture that stays in view.');
  }

  async follow() {
    const request = (this.request = (this.request || 0) + 1);
    const { reversed, straight } = this.part;
    this.draw();
    this.say('Following it');
    const body = { tab, u: this.point[0], v: this.point[1], key_point: Number(this.part['key-point'].value) };
    await ask('api/motion', {
      method: 'POST',
      body: {
        ...body,
        reversed: reversed.checked,
        axes: straight.checked ? 1 : 2,
        pairs: this.pairs.length > 1 ? this.pairs : [],
      },
    });
    for (;;) {
      const status = await ask(addressOf('api/motion'));
      if (request !== this.request) return;
      this.showProgress(status.done, status.total);
      if (status.state === 'failed') throw new Error(status.message);
      if (status.state === 'done') {
        this.found = { ...status, keyPoint: body.key_point };
        break;
      }
      await new Promise((wait) => setTimeout(wait, 150));
    }
    this.part.progress.hidden = true;
    const share = this.found.farthest;
    const warning = share > 0.4 ? ': the picture is likely to come apart' : share > 0.15 ? ': it may lose detail' : '';
    this.say(
      `Followed through ${this.found.path.length} frames. Key point ${body.key_point + 1} goes at most ` +
        `${(100 * share).toFixed(0)}% of its range from where training saw it${warning}.`,
    );
  }

  // Pairs are [frame of the video, row of the training frames]; one alone says nothing yet.
  addPair() {
    const { frame, row } = this.part;
    if (!row.reportValidity() || row.value === '') return;
    const pair = [Number(frame.value), Number(row.value) - 1];
    this.setPairs([...this.pairs.filter(([other]) => other !== pair[0]), pair].sort(([a], [b]) => a - b));
    if (this.pairs.length > 1) this.attempt(() => this.follow());
  }

  setPairs(pairs) {
    const { pairs: list, reversed, straight } = this.part,
      before = this.pairs;
    this.pairs = pairs;
    list.hidden = !pairs.length;
    list.replaceChildren(
      ...pairs.map(([frame, row]) => {
        const item = document.createElement('li'),
          button = document.createElement('button');
        button.textContent = `${frame + 1} is ${row + 1} \u00d7`;
        button.title = `Video frame ${frame + 1} is training frame ${row + 1}: remove this pair`;
        button.addEventListener('click', () => {
          this.setPairs(this.pairs.filter(([other]) => other !== frame));
          if (this.found) this.attempt(() => this.follow());
        });
        item.append(button);
        return item;
      }),
    );
    reversed.disabled = straight.disabled = pairs.length > 1;
    if (before.length && !pairs.length) this.part.pair.focus();
  }

  draw() {
    const { picture, preview, apply, pairing, frame } = this.part;
    preview.disabled = apply.disabled = !this.found;
    pairing.hidden = !this.found && !this.pairs.length; // there while a new pair is followed: the focus is in it
    if (this.found) {
      const { length } = this.found.track;
      frame.max = length - 1;
      write(this.part['frame-at'], `${Number(frame.value) + 1} / ${length}`, `${length} / ${length}`);
    }
    picture.hidden = !this.image;
    if (!this.image) return;
    const zoom = Math.max(1, 640 / this.image.width); // of a small video, so that lines on it can be thin
    Object.assign(picture, { width: this.image.width * zoom, height: this.image.height * zoom });
    picture.dataset.zoom = zoom;
    const pen = picture.getContext('2d');
    pen.scale(zoom, zoom);
    pen.drawImage(this.image, 0, 0);
    const unit = this.image.width / 640;
    const stroke = (draw) => {
      for (const [color, width] of [
        ['#000', 4],
        ['#fff', 2],
      ]) {
        Object.assign(pen, { strokeStyle: color, lineWidth: width * unit });
        pen.beginPath();
        draw();
        pen.stroke();
      }
    };
    if (this.found) stroke(() => this.found.track.forEach(([x, y]) => pen.lineTo(x, y)));
    if (this.found && Number(frame.value) > 0) {
      const [u, v] = this.found.track[Number(frame.value)];
      stroke(() => pen.arc(u, v, 7 * unit, 0, 2 * Math.PI));
    }
    const [x, y] = this.point;
    stroke(() => {
      for (const [dx, dy] of [
        [1, 0],
        [0, 1],
      ]) {
        pen.moveTo(x - 10 * unit * dx, y - 10 * unit * dy);
        pen.lineTo(x + 10 * unit * dx, y + 10 * unit * dy);
      }
    });
  }

  key(event) {
    const step = event.shiftKey ? 10 : 1;
    const arrows = { ArrowLeft: [-step, 0], ArrowRight: [step, 0], ArrowUp: [0, -step], ArrowDown: [0, step] };
    const arrow = arrows[event.key];
    if (arrow) this.point = this.point.map((value, axis) => value + arrow[axis]);
    else if (event.key !== 'Enter') return;
    event.preventDefault();
    if (!arrow) this.attempt(() => this.follow());
    else this.draw();
  }

  place(frame, gesture) {
    const { path, keyPoint } = this.found;
    return { do: 'place', key_point: keyPoint, position: path[frame], gesture };
  }

  preview() {
    const gesture = this.editor.gesture(),
      start = performance.now(),
      { path, fps } = this.found;
    this.part.box.classList.add('playing');
    const step = () => {
      const frame = Math.floor(((performance.now() - start) / 1000) * fps);
      if (frame >= path.length) return this.stop();
      this.editor.send([this.place(frame, gesture)]);
      this.playing = requestAnimationFrame(step);
    };
    this.playing = requestAnimationFrame(step);
  }

  stop() {
    if (!this.playing) return;
    cancelAnimationFrame(this.playing);
    this.playing = 0;
    this.part.box.classList.remove('playing');
    this.editor.send([{ do: 'undo' }]);
  }

  apply() {
    const { path, fps } = this.found,
      gesture = this.editor.gesture();
    const stride = Math.ceil(path.length / MOST_KEY_FRAMES);
    const operations = [{ do: 'clear_trail', gesture }];
    for (let frame = 0; frame < path.length; frame += stride) {
      operations.push(this.place(frame, gesture), { do: 'key_frame', time: frame / fps, gesture });
    }
    this.editor.send(operations);
    this.part.box.close();
  }
}
