// The picture and the key points on it.

const SVG = 'http://www.w3.org/2000/svg';
// The pointer as soon as it moves, not only before the page's next frame, which waits for the last one to be drawn.
const MOVES = 'onpointerrawupdate' in window ? 'pointerrawupdate' : 'pointermove';
const LEVELS = { near: 'seen', far: 'far', beyond: 'beyond' };

function svg(name, attributes, parent) {
  const element = document.createElementNS(SVG, name);
  for (const [key, value] of Object.entries(attributes)) element.setAttribute(key, value);
  parent.append(element);
  return element;
}

class Stage {
  // editor: { scene, state, selected (Set), send(operations, moved), gesture(kind), select(set) }
  constructor(editor) {
    this.editor = editor;
    [this.frame, this.canvas, this.overlay] = ['frame', 'picture', 'overlay'].map((id) => document.getElementById(id));
    this.lines = svg('g', {}, this.overlay);
    this.handles = [];
    this.drag = null;
    new ResizeObserver(() => this.layOut()).observe(document.getElementById('stage'));
  }

  build() {
    for (const handle of this.handles) handle.remove();
    this.handles = this.editor.scene.colors.map((color, n) => {
      const group = svg('g', { class: 'handle', tabindex: 0, role: 'button' }, this.overlay);
      svg('title', {}, group);
      svg('circle', { class: 'reach', r: 20 }, group);
      svg('circle', { class: 'warn', r: 15 }, group);
      svg('circle', { class: 'chosen', r: 19 }, group);
      svg('circle', { r: 9, fill: `rgb(${color})` }, group);
      svg('circle', { class: 'rim', r: 10 }, group);
      svg('circle', { class: 'edge', r: 11.5 }, group);
      svg('text', {}, group).textContent = n + 1;
      group.addEventListener('pointerdown', (event) => this.start(event, n));
      group.addEventListener(MOVES, (event) => this.move(event));
      group.addEventListener('pointermove', () => this.drag?.going && this.draw());
      for (const end of ['pointerup', 'pointercancel']) group.addEventListener(end, () => this.end());
      group.addEventListener('wheel', (event) => this.wheel(event, n), { passive: false });
      group.addEventListener('keydown', (event) => this.key(event));
      group.addEventListener('focus', () => {
        if (!this.drag && !this.editor.selected.has(n)) this.editor.select(new Set([n]));
      });
      return group;
    });
    this.layOut();
  }

  // The picture as large as the place allows.
  layOut() {
    const { state } = this.editor;
    if (!state) return;
    const stage = document.getElementById('stage'),
      style = getComputedStyle(stage);
    const room = {
      width: stage.clientWidth - 2 * parseFloat(style.paddingLeft),
      height: stage.clientHeight - 2 * parseFloat(style.paddingTop),
    };
    const zoom = Math.min(room.width / state.camera.width, room.height / state.camera.height);
    this.zoom = Math.max(zoom, 0.1);
    this.frame.style.width = `${Math.floor(state.camera.width * this.zoom)}px`;
    this.frame.style.height = `${Math.floor(state.camera.height * this.zoom)}px`;
    this.draw();
  }

  async show(picture) {
    const bytes = Uint8Array.from(atob(picture.data), (character) => character.charCodeAt(0));
    const image = await createImageBitmap(new Blob([bytes], { type: picture.type }));
    if (this.canvas.width !== image.width) this.canvas.width = image.width;
    if (this.canvas.height !== image.height) this.canvas.height = image.height;
    this.canvas.getContext('2d').drawImage(image, 0, 0);
    image.close();
  }

  // Anew only where the camera or the size has changed.
  drawTracks() {
    const { scene, state } = this.editor;
    const shown = document.getElementById('tracks').checked;
    const key = JSON.stringify([shown, this.zoom, state.camera]);
    if (key === this.drawnTracks) return;
    this.drawnTracks = key;
    this.lines.replaceChildren();
    if (!shown) return;
    scene.tracks.forEach((track, n) => this.drawBand(track, scene.colors[n], scene.reach[n]));
    scene.tracks.forEach((track, n) => {
      let path = '',
        pen = 'M';
      for (const point of track) {
        const seen = project(state.camera, point);
        if (seen) path += `${pen}${(seen.u * this.zoom).toFixed(1)} ${(seen.v * this.zoom).toFixed(1)}`;
        pen = seen ? 'L' : 'M';
      }
      if (!path) return;
      svg('path', { d: path, class: 'track casing' }, this.lines);
      svg('path', { d: path, class: 'track line-color', stroke: `rgb(${scene.colors[n]})` }, this.lines);
    });
  }

  // The region that counts as seen: everything within reach of the track. Its width follows the depth, so it is made of
  // pieces, which the group's opacity turns into one.
  drawBand(track, color, reach) {
    const { camera } = this.editor.state;
    const band = svg('g', { class: 'track', opacity: 0.22, stroke: `rgb(${color})` }, this.lines);
    const seen = track.map((point) => project(camera, point)).filter(Boolean);
    let last = null;
    for (const point of seen) {
      const width = (2 * reach * camera.focal_length * this.zoom) / point.depth;
      const at = [point.u * this.zoom, point.v * this.zoom];
      // Pieces shorter than a few pixels only cost time.
      if (last && Math.hypot(at[0] - last[0], at[1] - last[1]) < 3 && point !== seen[seen.length - 1]) continue;
      const d = `M${(last || at).map((value) => value.toFixed(1)).join(' ')}L${at.map((value) => value.toFixed(1)).join(' ')}`;
      svg('path', { d, 'stroke-width': width.toFixed(1) }, band);
      last = at;
    }
  }

  draw() {
    const { state, selected } = this.editor;
    if (!state || !this.zoom) return;
    this.drawTracks();
    state.key_points.forEach((point, n) => {
      const handle = this.handles[n];
      if (!handle) return;
      const held = this.drag && this.drag.at.get(n); // under the pointer, whatever the server knows by now
      const [u, v] = held || [point.u, point.v];
      handle.style.display = point.in_front ? '' : 'none';
      handle.setAttribute('transform', `translate(${u * this.zoom} ${v * this.zoom})`);
      handle.setAttribute('class', `handle ${point.level}${selected.has(n) ? ' selected' : ''}`);
      const away = `${(100 * point.share).toFixed(0)}% of its range from where training saw it`;
      const text = `Key point ${n + 1}: ${LEVELS[point.level]}, ${away}`;
      handle.setAttribute('aria-label', text);
      handle.querySelector('title').textContent = `${text}. Drag to move; wheel for depth`;
    });
  }

  start(event, n) {
    if (event.button !== 0) return;
    const { editor } = this;
    const handle = this.handles[n];
    handle.setPointerCapture(event.pointerId);
    const depthOnly = event.shiftKey;
    let toggled = null;
    if (event.shiftKey) {
      // A shift-click adds to the selection, or takes out of it; moved, it changes the depth of all that is selected.
      toggled = editor.selected.has(n) ? n : null;
      const chosen = new Set(editor.selected);
      chosen.add(n);
      editor.select(chosen);
    } else if (!editor.selected.has(n)) {
      editor.select(new Set([n]));
    }
    const from = new Map(
      [...editor.selected].map((k) => [k, [editor.state.key_points[k].u, editor.state.key_points[k].v]]),
    );
    this.drag = {
      x: event.clientX,
      y: event.clientY,
      lastY: event.clientY,
      from,
      at: new Map(),
      depthOnly,
      toggled,
      gesture: editor.gesture(),
    };
  }

  move(event) {
    const { drag, editor } = this;
    if (!drag) return;
    const dx = event.clientX - drag.x,
      dy = event.clientY - drag.y;
    if (!drag.going && Math.hypot(dx, dy) < 3) return;
    drag.going = true;
    if (drag.depthOnly) {
      const factor = Math.exp((drag.lastY - event.clientY) * 0.002);
      drag.lastY = event.clientY;
      editor.send(
        [...drag.from.keys()].map((n) => ({ do: 'depth', key_point: n, factor, gesture: drag.gesture })),
        event.timeStamp,
      );
      return;
    }
    const operations = [];
    for (const [n, [u, v]] of drag.from) {
      const at = [u + dx / this.zoom, v + dy / this.zoom];
      drag.at.set(n, at);
      operations.push({ do: 'move', key_point: n, u: at[0], v: at[1], gesture: drag.gesture });
    }
    editor.send(operations, event.timeStamp);
  }

  end() {
    const { drag, editor } = this;
    this.drag = null;
    if (!drag || drag.going || drag.toggled === null) return;
    const chosen = new Set(editor.selected);
    chosen.delete(drag.toggled);
    editor.select(chosen);
  }

  scaleDepth(points, factor, moved = 0) {
    const gesture = this.editor.gesture('depth');
    this.editor.send(
      points.map((n) => ({ do: 'depth', key_point: n, factor, gesture })),
      moved,
    );
  }

  wheel(event, n) {
    event.preventDefault();
    const { selected } = this.editor;
    this.scaleDepth(selected.has(n) ? [...selected] : [n], Math.exp(Math.sign(event.deltaY) * -0.02), event.timeStamp);
  }

  key(event) {
    const { editor } = this;
    const chosen = [...editor.selected];
    const step = event.shiftKey ? 10 : 1;
    const arrows = { ArrowLeft: [-step, 0], ArrowRight: [step, 0], ArrowUp: [0, -step], ArrowDown: [0, step] };
    const arrow = arrows[event.key];
    if (arrow) {
      const gesture = editor.gesture('nudge');
      editor.send(
        chosen.map((n) => ({ do: 'nudge', key_point: n, u: arrow[0], v: arrow[1], gesture })),
        event.timeStamp,
      );
    } else if (event.key === 'PageUp' || event.key === 'PageDown') {
      this.scaleDepth(chosen, event.key === 'PageUp' ? 1.02 : 1 / 1.02, event.timeStamp);
    } else if (event.key === 'Escape' && chosen.length) {
      editor.select(new Set());
    } else {
      return;
    }
    event.preventDefault();
  }
}
