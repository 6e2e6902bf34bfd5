// The page as a whole: what is selected, buttons and keys, and what an answer of the server changes.

const element = (id) => document.getElementById(id);

// Runs `change`. Where that puts the control that has the focus out of use, the first of these that can be used gets
// it, so that who uses the keyboard does not begin at the top again.
function keepFocus(ids, change) {
  const before = document.activeElement;
  const usable = (control) => !control.disabled && !control.hidden;
  change();
  if (ids.includes(before?.id) && !usable(before)) ids.map(element).find(usable)?.focus();
}

// Text of an output that is as wide as the longest one that it will get, so that what is beside it stays where it is.
function write(output, text, longest = text) {
  output.textContent = text;
  output.dataset.longest = longest;
}

// For measuring: tests/browser. Browsers keep every entry until it is cleared.
const MOST_MEASURES = 2000;
let measured = 0;
function measure(name, start, detail) {
  performance.measure(name, { start, end: performance.now(), detail });
  if (++measured % 16 === 0 && performance.getEntriesByType('measure').length > MOST_MEASURES)
    performance.clearMeasures();
}

const editor = {
  scene: null,
  state: null,
  selected: new Set(),
  lastGesture: { id: Date.now() % 1e9, kind: '', at: 0 },

  // Changes of one kind that follow each other closely are one gesture, which is undone at once.
  gesture(kind = '') {
    const last = this.lastGesture,
      now = performance.now();
    if (!kind || kind !== last.kind || now - last.at > 700) last.id += 1;
    Object.assign(last, { kind, at: now });
    return last.id;
  },
  send(operations, moved = 0) {
    if (this.state && operations.length) link.send(operations, moved);
  },
  select(chosen) {
    this.selected = chosen;
    stage.draw();
    drawPoints();
  },
  say(text) {
    element('gone-says').textContent = text;
    keepFocus(['gone-close', 'help'], () => (element('gone').hidden = element('gone-close').hidden = !text));
  },
};

const link = new Link({
  async answer(state, picture, moved, fresh) {
    const first = !editor.state;
    if (fresh && !first) return restore();
    // What was done to the trail since this was asked for is on its way, and the page knows what will come of it.
    if (link.pending.some(({ do: what }) => /^(move|remove)_key_frame$/.test(what))) state.trail = editor.state.trail;
    editor.state = state;
    if (picture) {
      await stage.show(picture);
      if (moved && picture.preview) {
        measure('move to picture', moved, { rendering: picture.milliseconds, width: picture.width });
        this.shown = performance.now();
      }
      if (!picture.preview && this.shown) {
        measure('preview to full picture', this.shown);
        this.shown = 0;
      }
      element('status').textContent = `${picture.width} x ${picture.height}, ${picture.milliseconds.toFixed(0)} ms`;
    }
    if (first) stage.layOut();
    requestAnimationFrame(() => stage.draw()); // the next request goes first
    drawSoon(picture?.preview && !first);
  },
  // The picture is, or is not yet, that of the state.
  waits: () => element('picture').setAttribute('aria-busy', true),
  rests() {
    drawSoon.now();
    element('picture').setAttribute('aria-busy', false);
  },
  mistake(message) {
    editor.say((this.said = message));
  },
  good() {
    if (element('gone-says').textContent === this.said) editor.say('');
  },
  gone(error) {
    element('status').textContent = 'not connected';
    editor.say(
      error.status
        ? error.message
        : 'enf-edit does not answer. It may have been stopped; this page goes on by itself when it is back.',
    );
  },
  back: () => editor.say(''),
});
const stage = new Stage(editor);
const overview = new Overview(editor);
const trail = new Trail(editor, link);
const motion = new Motion(editor);

// The server was started anew, or gave the place of this tab to another one: the page tells it where things were.
function restore() {
  const { row, key_points, capture_camera } = editor.state;
  const gesture = editor.gesture();
  link.forget(); // what was asked before was meant for another state
  editor.send([
    { do: 'snap', row, gesture },
    ...key_points.map(({ position }, n) => ({ do: 'place', key_point: n, position, gesture })),
    { do: 'camera', frame: capture_camera },
  ]);
  editor.say(
    'enf-edit was started anew: key points are back where you had them; the camera is at its capture view, and the ' +
      'trail and what could be undone are gone.',
  );
}

// What does not have to keep up with the hand: five times a second while previews follow each other, since whoever
// draws here takes the processor from the next picture.
function drawSoon(busy) {
  clearTimeout(drawSoon.timer);
  const wait = busy ? Math.max(0, drawSoon.last + 200 - performance.now()) : 0;
  drawSoon.timer = setTimeout(drawSoon.now, wait);
}
drawSoon.last = 0;
drawSoon.now = () => {
  clearTimeout(drawSoon.timer);
  drawSoon.last = performance.now();
  draw();
};

function draw() {
  const { state, scene } = editor;
  keepFocus(['undo', 'redo', 'reset-all'], () => {
    element('undo').disabled = !state.can_undo;
    element('redo').disabled = !state.can_redo;
  });
  element('motion').value = state.row;
  const { length } = scene.training_frames;
  write(element('motion-at'), `${state.row + 1} / ${length}`, `${length} / ${length}`);
  element('capture').value = state.capture_camera;
  stage.draw();
  overview.draw();
  trail.draw();
  drawPoints();
}

function make(name, properties, ...children) {
  const made = Object.assign(document.createElement(name), properties);
  made.append(...children);
  return made;
}

// The list is made once and then only changed: a button that has the focus keeps it.
function buildPoints() {
  element('no-points').hidden = editor.scene.colors.length > 0;
  element('weights').disabled = !editor.scene.colors.length;
  element('points').replaceChildren(
    ...editor.scene.colors.map((color, n) => {
      const dotMark = make('span', { className: 'dot' });
      dotMark.style.background = `rgb(${color})`;
      const only = () => (editor.selected.has(n) ? [...editor.selected] : [n]);
      const button = (text, title, act) => {
        const made = make('button', { textContent: text, title, onclick: act });
        made.setAttribute('aria-label', title);
        return made;
      };
      const name = make('button', {
        className: 'name',
        textContent: `Key point ${n + 1}`,
        title: 'Select it; Shift+click or Shift+Enter selects several',
      });
      const choose = (several) => {
        const chosen = new Set(several ? editor.selected : []);
        if (!chosen.delete(n)) chosen.add(n);
        editor.select(chosen);
        if (chosen.has(n)) stage.handles[n].focus();
      };
      name.onclick = (event) => choose(event.shiftKey);
      name.onkeydown = (event) => {
        if (event.key !== 'Enter' || !event.shiftKey) return;
        event.preventDefault(); // of the click, which in Firefox does not know of Shift
        choose(true);
      };
      return make(
        'li',
        {},
        make(
          'div',
          { className: 'row' },
          dotMark,
          name,
          make('span', { className: 'grow' }),
          make('span', { className: 'chip' }),
        ),
        make(
          'div',
          { className: 'row' },
          make('span', { className: 'numbers' }),
          button('\u2212', 'Nearer to the camera (Page down)', () => stage.scaleDepth(only(), 1 / 1.02)),
          button('+', 'Farther from the camera (Page up)', () => stage.scaleDepth(only(), 1.02)),
          button('Reset', 'Back to where this training frame has it (R)', () =>
            editor.send([{ do: 'reset', key_point: n }]),
          ),
        ),
      );
    }),
  );
}

function drawPoints() {
  const { state, selected } = editor;
  if (!state) return;
  [...element('points').children].forEach((item, n) => {
    const point = state.key_points[n];
    item.classList.toggle('selected', selected.has(n));
    item.querySelector('.name').setAttribute('aria-pressed', selected.has(n));
    const chip = item.querySelector('.chip');
    chip.className = `chip ${point.level}`;
    chip.textContent = LEVELS[point.level];
    chip.title = `${point.distance.toFixed(3)} scene units from where training saw it, ${(100 * point.share).toFixed(0)}% of its range`;
    const numbers = item.querySelector('.numbers');
    numbers.textContent = point.position.map((value) => value.toFixed(3)).join('  ');
    numbers.title = `x, y, z in scene units; depth ${point.depth.toFixed(3)}`;
  });
}

function fillSelects() {
  const { scene } = editor;
  const options = (id, entries, chosen) =>
    element(id).replaceChildren(
      ...entries.map(([value, text]) => make('option', { value, textContent: text, selected: value === chosen })),
    );
  options(
    'capture',
    scene.frames.map((frame, i) => [i, frame.id]),
    0,
  );
  const own = scene.frames[0].camera.width;
  const widths = [...new Set([320, 480, 640, 960, 1280, own])]
    .filter((width) => width <= Math.max(1920, own))
    .sort((a, b) => a - b);
  link.stillWidth = Math.min(own, 960);
  options(
    'still-width',
    widths.map((width) => [width, width === own ? `${width} (filmed)` : width]),
    link.stillWidth,
  );
  options(
    'video-width',
    widths.map((width) => [width, width]),
    own,
  );
  element('motion').max = scene.training_frames.length - 1;
}

function playMotion() {
  const button = element('motion-play');
  if (playMotion.timer) {
    clearInterval(playMotion.timer);
    playMotion.timer = null;
  } else {
    const gesture = editor.gesture(),
      start = performance.now(),
      first = editor.state.row;
    playMotion.timer = setInterval(() => {
      const row = (first + Math.floor((performance.now() - start) / 50)) % editor.scene.training_frames.length;
      editor.send([{ do: 'snap', row, gesture }]);
    }, 50);
  }
  button.textContent = playMotion.timer ? 'Stop' : 'Play';
}

const resetSelected = () => {
  const gesture = editor.gesture();
  editor.send([...editor.selected].map((n) => ({ do: 'reset', key_point: n, gesture })));
};
const toggle = (id) => element(id).click();
const retrace = (which) => {
  trail.keepChoice();
  editor.send([{ do: which }]);
};
const undo = () => retrace('undo');
const redo = () => retrace('redo');
const resetAll = () => editor.send([{ do: 'reset_all' }]);
const resetCamera = () => editor.send([{ do: 'reset_camera' }]);
const nextCamera = (step) => {
  const count = editor.scene.frames.length;
  editor.send([{ do: 'camera', frame: (editor.state.capture_camera + step + count) % count }]);
};

function wire() {
  const click = (id, act) => element(id).addEventListener('click', act);
  click('undo', undo);
  click('redo', redo);
  click('reset-all', resetAll);
  click('reset-camera', resetCamera);
  click('camera-before', () => nextCamera(-1));
  click('camera-after', () => nextCamera(1));
  click('motion-play', playMotion);
  click('gone-close', () => editor.say(''));
  click('help', () => element('help-box').showModal());
  click('theme', () => {
    const root = document.documentElement;
    root.dataset.theme = root.dataset.theme === 'dark' ? 'light' : 'dark';
    localStorage.setItem('theme', root.dataset.theme);
    draw();
  });
  const change = (id, act) => element(id).addEventListener('input', act);
  const weights = () => {
    element('strength').hidden = !element('weights').checked;
    link.weights = element('weights').checked ? Number(element('strength').value) : 0;
    link.preview = true;
    link.stillSoon();
    link.pump();
  };
  change('weights', weights);
  change('strength', weights);
  change('tracks', () => stage.draw());
  change('still-width', () => {
    link.stillWidth = Number(element('still-width').value);
    link.stillSoon();
  });
  change('capture', () => editor.send([{ do: 'camera', frame: Number(element('capture').value) }]));
  change('motion', () =>
    editor.send([{ do: 'snap', row: Number(element('motion').value), gesture: editor.gesture('motion') }]),
  );
  addEventListener('keydown', (event) => {
    const typing = event.target.closest('select, input[type="range"]:not(#trail-time), input[type="number"], dialog');
    const key = event.key.toLowerCase();
    if (event.ctrlKey || event.metaKey) {
      if (key === 'z') (event.shiftKey ? redo : undo)();
      else if (key === 'y') redo();
      else return;
    } else if (typing || event.altKey || event.defaultPrevented) {
      return;
    } else if (key === 'r') {
      (event.shiftKey ? resetAll : resetSelected)();
    } else if (key === ' ' && !event.target.closest('button, a, input')) {
      trail.record();
    } else {
      const acts = {
        w: () => toggle('weights'),
        t: () => toggle('tracks'),
        c: resetCamera,
        k: () => (event.shiftKey ? trail.replace() : trail.addKeyFrame()),
        ',': () => trail.step(-1),
        '.': () => trail.step(1),
        '<': () => trail.nudge(-0.1),
        '>': () => trail.nudge(0.1),
        delete: () => trail.remove(),
        escape: () => trail.choose(null),
        p: () => trail.play(),
        v: () => motion.open(),
        '?': () => toggle('help'),
      };
      if (!acts[key]) return;
      acts[key]();
    }
    event.preventDefault();
  });
}

async function begin() {
  document.documentElement.dataset.theme =
    localStorage.getItem('theme') || (matchMedia('(prefers-color-scheme: dark)').matches ? 'dark' : 'light');
  wire();
  try {
    editor.scene = await ask('api/scene');
    editor.state = (await ask('api/edit', { method: 'POST', body: { tab, operations: [] } })).state;
  } catch (error) {
    link.on.gone(error);
    setTimeout(() => location.reload(), 3000);
    return;
  }
  element('title').textContent = document.title = editor.scene.title;
  fillSelects();
  buildPoints();
  motion.build();
  stage.build();
  overview.build();
  draw();
  link.preview = true;
  link.still = true;
  link.pump();
}

begin();
