// The small view of everything: scene box, sparse points, capture cameras, trajectories and the camera that the picture
// is seen from. It is drawn from afar without perspective.

// Low and high corner of the box around points.
function boundsOf(points) {
  return [Math.min, Math.max].map((pick) => points.reduce((a, b) => a.map((x, axis) => pick(x, b[axis]))));
}

// Corner i has the high coordinate of each axis whose bit is set.
const cornersOfBox = (box) => [0, 1, 2, 3, 4, 5, 6, 7].map((i) => [0, 1, 2].map((axis) => box[(i >> axis) & 1][axis]));

class Overview {
  constructor(editor) {
    this.editor = editor;
    this.canvas = document.getElementById('overview');
    new ResizeObserver(() => this.draw()).observe(this.canvas);
    const on = (name, act, options) => this.canvas.addEventListener(name, act, options);
    on('pointerdown', (event) => this.start(event));
    on('pointermove', (event) => this.move(event));
    on('pointerup', (event) => this.end(event));
    on('contextmenu', (event) => event.preventDefault());
    on('wheel', (event) => this.wheel(event), { passive: false });
    on('dblclick', () => this.reset());
    on('keydown', (event) => this.key(event));
  }

  build() {
    const { scene } = this.editor;
    const cameras = scene.training_frames.map((frame) => scene.frames[frame].camera);
    this.up = upOf(cameras);
    const mean = scale(
      cameras.reduce((sum, camera) => add(sum, camera.position), [0, 0, 0]),
      1 / cameras.length,
    );
    const points = scene.tracks.flat();
    this.center = points.length
      ? scale(points.reduce(add, [0, 0, 0]), 1 / points.length)
      : scale(add(...scene.box), 0.5);
    const back = sub(mean, this.center);
    this.front = normalized(sub(back, scale(this.up, dot(back, this.up)))); // from the scene to the cameras
    this.shown = this.worthSeeing();
    this.reset();
  }

  // Points that fit into the canvas at first: cameras, trajectories and most of what the cameras saw. The box reaches
  // to where rays end, often far beyond all that, which would then be small.
  worthSeeing() {
    const { scene } = this.editor;
    const [low, high] = scene.box;
    const within = ([from, to]) => (point) => point.every((x, axis) => from[axis] <= x && x <= to[axis]);
    const inside = scene.points.filter(within(scene.box));
    const sorted = [0, 1, 2].map((axis) => inside.map((point) => point[axis]).sort((a, b) => a - b));
    const at = (share) => sorted.map((x) => x[Math.floor(share * (x.length - 1))]);
    const most = inside.filter(within([at(0.05), at(0.95)]));
    const points = [...scene.frames.map((frame) => frame.camera.position), ...scene.tracks.flat(), ...most];
    const [first, last] = boundsOf(points);
    this.size = Math.hypot(...sub(last, first), 0.05 * Math.hypot(...sub(high, low))); // a camera at rest has none
    return Math.hypot(...sub(high, low)) > 1.25 * this.size ? points : [...points, ...cornersOfBox(scene.box)];
  }

  // The overview itself, as it was at first.
  reset() {
    if (!this.shown) return;
    this.yaw = 0.6;
    this.pitch = 0.5;
    this.closer = 1;
    const axes = this.axes();
    const [first, last] = boundsOf(this.shown.map((point) => axes.map((axis) => dot(axis, point))));
    this.heart = axes.map((axis, i) => scale(axis, (first[i] + last[i]) / 2)).reduce(add); // of what is shown
    this.middle = this.heart; // of the canvas
    this.draw();
  }

  // Axes of the view: right, down, away.
  axes() {
    const side = cross(this.front, this.up);
    const out = add(scale(this.front, Math.cos(this.yaw)), scale(side, Math.sin(this.yaw)));
    const away = scale(add(scale(out, Math.cos(this.pitch)), scale(this.up, Math.sin(this.pitch))), -1);
    const right = normalized(cross(away, this.up));
    return [right, cross(away, right), away];
  }

  draw() {
    const { scene, state } = this.editor;
    if (!state || !this.up) return;
    const { canvas } = this,
      dense = devicePixelRatio,
      width = canvas.clientWidth,
      height = canvas.clientHeight;
    canvas.width = width * dense;
    canvas.height = height * dense;
    const pen = canvas.getContext('2d');
    pen.scale(dense, dense);
    const style = getComputedStyle(document.documentElement),
      color = (name) => style.getPropertyValue(name);
    const [right, down] = this.axes();
    const extent = (axis) => {
      const heart = dot(axis, this.heart);
      return this.shown.reduce((most, point) => Math.max(most, Math.abs(dot(axis, point) - heart)), 0.1 * this.size);
    };
    const zoom = 0.47 * this.closer * Math.min(width / extent(right), height / extent(down));
    this.zoom = zoom; // pixels per scene unit
    const at = (point) => {
      const offset = sub(point, this.middle);
      return [width / 2 + zoom * dot(right, offset), height / 2 + zoom * dot(down, offset)];
    };
    const line = (points, close) => {
      pen.beginPath();
      points.forEach((point, i) => (i ? pen.lineTo(...at(point)) : pen.moveTo(...at(point))));
      if (close) pen.closePath();
      pen.stroke();
    };
    // What the cameras saw.
    pen.fillStyle = color('--faint');
    pen.globalAlpha = 0.4;
    for (const point of scene.points) {
      const [x, y] = at(point);
      pen.fillRect(x - 0.6, y - 0.6, 1.2, 1.2);
    }
    pen.globalAlpha = 1;
    // The box.
    pen.lineWidth = 1;
    pen.strokeStyle = color('--line');
    const corners = cornersOfBox(scene.box);
    for (let i = 0; i < 8; ++i) {
      for (let axis = 0; axis < 3; ++axis) if (!((i >> axis) & 1)) line([corners[i], corners[i | (1 << axis)]]);
    }
    // Where it was filmed from.
    this.dots = scene.frames.map((frame, index) => ({ index, at: at(frame.camera.position) }));
    for (const {
      index,
      at: [x, y],
    } of this.dots) {
      const chosen = index === state.capture_camera;
      pen.fillStyle = color(chosen ? '--accent' : '--faint');
      pen.beginPath();
      pen.arc(x, y, chosen ? 4 : 1.6, 0, 7);
      pen.fill();
    }
    // Where key points went, and are.
    scene.tracks.forEach((track, n) => {
      pen.strokeStyle = `rgb(${scene.colors[n]})`;
      pen.lineWidth = 2;
      line(track);
      const [x, y] = at(state.key_points[n].position);
      pen.fillStyle = pen.strokeStyle;
      pen.beginPath();
      pen.arc(x, y, 5, 0, 7);
      pen.fill();
      pen.strokeStyle = color('--text');
      pen.lineWidth = 1;
      pen.stroke();
    });
    // The camera.
    pen.strokeStyle = color('--accent');
    pen.lineWidth = 1.5;
    const image = cornersOf(state.camera, 0.12 * this.size);
    line(image, true);
    for (const point of image) line([state.camera.position, point]);
  }

  start(event) {
    this.canvas.setPointerCapture(event.pointerId);
    const own = event.ctrlKey ? 'move' : event.shiftKey ? 'turn' : null;
    this.drag = { x: event.clientX, y: event.clientY, far: 0, sideways: event.button !== 0, own };
  }

  move(event) {
    const { drag, editor } = this;
    if (!drag) return;
    const dx = event.clientX - drag.x,
      dy = event.clientY - drag.y;
    if (!dx && !dy) return;
    Object.assign(drag, { x: event.clientX, y: event.clientY, far: drag.far + Math.hypot(dx, dy) });
    if (drag.far < 3) return;
    if (drag.own === 'move') {
      this.shift(dx, dy);
    } else if (drag.own) {
      this.turn(-dx * 0.01, dy * 0.01);
    } else if (drag.sideways) {
      editor.send([{ do: 'pan', u: dx, v: dy }], event.timeStamp);
    } else {
      editor.send([{ do: 'orbit', right: -dx * 0.008, over: dy * 0.008 }], event.timeStamp);
    }
  }

  // The overview itself, by radians.
  turn(right, over) {
    this.yaw += right;
    this.pitch = Math.min(1.5, Math.max(-1.5, this.pitch + over));
    this.draw();
  }

  // By pixels.
  shift(dx, dy) {
    if (!this.zoom) return;
    const [right, down] = this.axes();
    this.middle = sub(this.middle, add(scale(right, dx / this.zoom), scale(down, dy / this.zoom)));
    this.draw();
  }

  // What is this many pixels from the middle of the canvas stays where it is.
  magnify(factor, x = 0, y = 0) {
    const closer = Math.min(100, Math.max(0.1, this.closer * factor));
    const rest = this.closer / closer - 1;
    this.closer = closer;
    this.shift(rest * x, rest * y);
  }

  end(event) {
    this.move(event); // a fast hand may lift before a move was heard
    const clicked = this.drag && this.drag.far < 3 && event.button === 0;
    this.drag = null;
    if (!clicked) return;
    const far = ({ at: [x, y] }) => Math.hypot(x - event.offsetX, y - event.offsetY);
    const nearest = this.dots.reduce((best, next) => (far(next) < far(best) ? next : best));
    if (far(nearest) < 8) this.editor.send([{ do: 'camera', frame: nearest.index }]);
  }

  wheel(event) {
    event.preventDefault();
    if (event.shiftKey || event.ctrlKey) {
      const { clientWidth, clientHeight } = this.canvas;
      const turned = Math.sign(event.deltaY || event.deltaX); // with Shift some browsers scroll sideways
      this.magnify(Math.exp(-0.1 * turned), event.offsetX - clientWidth / 2, event.offsetY - clientHeight / 2);
    } else {
      this.editor.send([{ do: 'zoom', factor: Math.exp(Math.sign(event.deltaY) * 0.06) }], event.timeStamp);
    }
  }

  key(event) {
    const arrows = { ArrowLeft: [-1, 0], ArrowRight: [1, 0], ArrowUp: [0, 1], ArrowDown: [0, -1] };
    const arrow = arrows[event.key];
    if (arrow && event.ctrlKey && event.shiftKey) this.shift(10 * arrow[0], -10 * arrow[1]);
    else if (arrow && event.ctrlKey) this.turn(0.1 * arrow[0], 0.1 * arrow[1]);
    else if (arrow && event.shiftKey) this.editor.send([{ do: 'pan', u: -4 * arrow[0], v: 4 * arrow[1] }], event.timeStamp);
    else if (arrow) this.editor.send([{ do: 'orbit', right: 0.03 * arrow[0], over: 0.03 * arrow[1] }], event.timeStamp);
    else if (event.key === '+' || event.key === '=')
      this.editor.send([{ do: 'zoom', factor: 1 / 1.06 }], event.timeStamp);
    else if (event.key === '-') this.editor.send([{ do: 'zoom', factor: 1.06 }], event.timeStamp);
    else if (event.key === 'PageUp') this.magnify(1 / 1.1);
    else if (event.key === 'PageDown') this.magnify(1.1);
    else if (event.key === 'Home') this.reset();
    else return;
    event.preventDefault();
  }
}
