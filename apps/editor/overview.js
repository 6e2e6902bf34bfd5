// The small view of everything: scene box, capture cameras, trajectories and the camera that the picture is seen from.
// It is drawn from afar without perspective.

class Overview {
  constructor(editor) {
    this.editor = editor;
    this.canvas = document.getElementById('overview');
    this.yaw = 0.6;
    this.pitch = 0.5;
    new ResizeObserver(() => this.draw()).observe(this.canvas);
    const on = (name, act, options) => this.canvas.addEventListener(name, act, options);
    on('pointerdown', (event) => this.start(event));
    on('pointermove', (event) => this.move(event));
    on('pointerup', (event) => this.end(event));
    on('contextmenu', (event) => event.preventDefault());
    on('wheel', (event) => this.wheel(event), { passive: false });
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
    const [low, high] = scene.box;
    const corner = (i) => [0, 1, 2].map((axis) => ((i >> axis) & 1 ? high : low)[axis]);
    const middle = scale(add(low, high), 0.5);
    const most = (axis) =>
      Math.max(...[0, 1, 2, 3, 4, 5, 6, 7].map((i) => Math.abs(dot(axis, sub(corner(i), middle)))));
    const zoom = 0.47 * Math.min(width / most(right), height / most(down));
    const at = (point) => {
      const offset = sub(point, middle);
      return [width / 2 + zoom * dot(right, offset), height / 2 + zoom * dot(down, offset)];
    };
    const line = (points, close) => {
      pen.beginPath();
      points.forEach((point, i) => (i ? pen.lineTo(...at(point)) : pen.moveTo(...at(point))));
      if (close) pen.closePath();
      pen.stroke();
    };
    // The box.
    pen.lineWidth = 1;
    pen.strokeStyle = color('--line');
    for (let i = 0; i < 8; ++i) {
      for (let axis = 0; axis < 3; ++axis) if (!((i >> axis) & 1)) line([corner(i), corner(i | (1 << axis))]);
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
    const corners = cornersOf(state.camera, 0.12 * Math.hypot(...sub(high, low)));
    line(corners, true);
    for (const point of corners) line([state.camera.position, point]);
  }

  start(event) {
    this.canvas.setPointerCapture(event.pointerId);
    this.drag = { x: event.clientX, y: event.clientY, far: 0, sideways: event.button !== 0, own: event.shiftKey };
  }

  move(event) {
    const { drag, editor } = this;
    if (!drag) return;
    const dx = event.clientX - drag.x,
      dy = event.clientY - drag.y;
    Object.assign(drag, { x: event.clientX, y: event.clientY, far: drag.far + Math.hypot(dx, dy) });
    if (drag.far < 3) return;
    if (drag.own) {
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

  end(event) {
    const clicked = this.drag && this.drag.far < 3 && event.button === 0;
    this.drag = null;
    if (!clicked) return;
    const far = ({ at: [x, y] }) => Math.hypot(x - event.offsetX, y - event.offsetY);
    const nearest = this.dots.reduce((best, next) => (far(next) < far(best) ? next : best));
    if (far(nearest) < 8) this.editor.send([{ do: 'camera', frame: nearest.index }]);
  }

  wheel(event) {
    event.preventDefault();
    this.editor.send([{ do: 'zoom', factor: Math.exp(Math.sign(event.deltaY) * 0.06) }], event.timeStamp);
  }

  key(event) {
    const arrows = { ArrowLeft: [-1, 0], ArrowRight: [1, 0], ArrowUp: [0, 1], ArrowDown: [0, -1] };
    const arrow = arrows[event.key];
    if (arrow && event.ctrlKey) this.turn(0.1 * arrow[0], 0.1 * arrow[1]);
    else if (arrow && event.shiftKey) this.editor.send([{ do: 'pan', u: -4 * arrow[0], v: 4 * arrow[1] }], event.timeStamp);
    else if (arrow) this.editor.send([{ do: 'orbit', right: 0.03 * arrow[0], over: 0.03 * arrow[1] }], event.timeStamp);
    else if (event.key === '+' || event.key === '=')
      this.editor.send([{ do: 'zoom', factor: 1 / 1.06 }], event.timeStamp);
    else if (event.key === '-') this.editor.send([{ do: 'zoom', factor: 1.06 }], event.timeStamp);
    else return;
    event.preventDefault();
  }
}
