// Talking to the server: operations are gathered while a request is on its way, the newest wins, and a picture that
// nobody waits for any more is given up.

const token = new URLSearchParams(location.search).get('token') || '';

// The page's name for the server. A tab that is duplicated begins with a copy of the storage, so the name is in there
// only from the end of the page to its next load, or to its return from the back/forward cache.
const tab = sessionStorage.getItem('tab') || crypto.getRandomValues(new Uint32Array(3)).join('-');
addEventListener('pagehide', () => sessionStorage.setItem('tab', tab));
addEventListener('pageshow', () => sessionStorage.removeItem('tab'));
sessionStorage.removeItem('tab'); // pageshow comes only when everything is loaded

const addressOf = (path, more = {}) => path + '?' + new URLSearchParams({ token, tab, ...more });

async function ask(path, { method = 'GET', body, bytes, signal } = {}) {
  const headers = { 'X-Editor-Token': token };
  if (body) headers['Content-Type'] = 'application/json';
  const answer = await fetch(path, { method, headers, signal, body: bytes || (body && JSON.stringify(body)) });
  const { status, statusText } = answer;
  if (answer.ok) return answer.json();
  const { error = `${status} ${statusText}` } = await answer.json().catch(() => ({})); // a proxy's is no JSON
  throw Object.assign(new Error(error), { status });
}

// Whether `next` can stand for `last` as well, which then takes its values.
function merged(last, next) {
  if (!last || last.do !== next.do || last.gesture !== next.gesture) return false;
  if (last.key_point !== next.key_point) return false;
  if (next.do === 'orbit') Object.assign(last, { right: last.right + next.right, over: last.over + next.over });
  else if (next.do === 'pan') Object.assign(last, { u: last.u + next.u, v: last.v + next.v });
  else if (next.do === 'zoom' || next.do === 'depth') last.factor *= next.factor;
  else if (['move', 'place', 'snap', 'show_trail'].includes(next.do)) Object.assign(last, next);
  else return false;
  return true;
}

class Link {
  // on: { answer(state, picture, moved), waits(), rests(), mistake(message), good(), gone(error), back() }
  constructor(on) {
    Object.assign(this, { on, pending: [], preview: false, still: false, busy: null, moved: 0, isGone: false });
    this.timer = null;
    this.previewWidth = 160;
    this.stillWidth = 320;
    this.refused = null; // the operations of the last request that was answered by an error
    this.weights = 0; // of the colours over the picture
    this.before = () => []; // operations in front of and behind each request's own: how a trail is recorded
    this.behind = () => [];
  }

  // moved: when the pointer did what this says, for measuring; 0 where it did not.
  send(operations, moved = 0) {
    for (const operation of operations) {
      // Points that move together alternate: look back as far as the moves go.
      let i = this.pending.length - 1;
      while (
        i >= 0 &&
        operation.do === 'move' &&
        this.pending[i].do === 'move' &&
        this.pending[i].key_point !== operation.key_point
      )
        --i;
      if (!merged(this.pending[i], operation)) this.pending.push({ ...operation });
    }
    this.moved = moved || this.moved;
    this.preview = true;
    if (this.busy && this.busy.still) this.busy.abort.abort();
    this.stillSoon();
    this.pump();
  }

  forget() {
    this.pending = [];
  }

  // Once the hand has rested for a few frames: a picture in full size that nobody waits for any more is given up.
  stillSoon() {
    clearTimeout(this.timer);
    this.on.waits();
    this.timer = setTimeout(() => {
      this.timer = null;
      this.still = true;
      this.pump();
    }, 60);
  }

  // Whether there is anything to ask for.
  get wants() {
    return this.pending.length > 0 || this.preview || this.still;
  }

  async pump() {
    if (this.busy || this.isGone || !this.wants) return;
    const still = !this.pending.length && !this.preview;
    const [operations, moved] = [this.pending, this.moved];
    Object.assign(this, { pending: [], preview: false, moved: 0 });
    if (still) this.still = false;
    const abort = new AbortController();
    this.busy = { still, abort };
    const picture = { width: still ? this.stillWidth : this.previewWidth, weights: this.weights, preview: !still };
    const all = operations.length ? [...this.before(), ...operations, ...this.behind()] : operations;
    try {
      const answer = await ask('api/edit', {
        method: 'POST',
        body: { tab, operations: all, picture },
        signal: abort.signal,
      });
      if (answer.picture && answer.picture.preview) this.adapt(answer.picture);
      // A picture alone says nothing about an operation that was refused, and follows it at once.
      if (this.refused && (operations.length || !this.refused.length)) {
        this.refused = null;
        this.on.good();
      }
      await this.on.answer(answer.state, answer.picture, moved, answer.fresh);
    } catch (error) {
      if (error.status && error.status !== 403) {
        this.refused = operations;
        this.on.mistake(error.message);
      } else if (error.name !== 'AbortError') {
        this.lose(error); // nobody answers, or nobody who knows this page
      }
    }
    this.busy = null;
    if (!this.wants && !this.timer && !this.isGone) this.on.rests();
    this.pump();
  }

  // Previews as large as keep up with the hand.
  adapt(picture) {
    const perPixel = picture.milliseconds / (picture.width * picture.height);
    this.perPixel = this.perPixel ? 0.8 * this.perPixel + 0.2 * perPixel : perPixel;
    const aspect = picture.height / picture.width;
    const fits = [240, 320, 480].filter(
      (width) => width * width * aspect * this.perPixel < 36 && width <= this.stillWidth,
    );
    this.previewWidth =
      Number(document.documentElement.dataset.preview) || fits.pop() || Math.min(160, this.stillWidth);
  }

  async lose(error) {
    this.isGone = true;
    this.on.waits();
    this.on.gone(error);
    while (this.isGone) {
      await new Promise((done) => setTimeout(done, 1000));
      try {
        await ask('api/video');
        this.isGone = false;
      } catch (again) {
        this.isGone = !again.status || again.status === 403;
        if (this.isGone && again.message !== error.message) this.on.gone((error = again)); // once, as one may close it
      }
    }
    this.on.back();
    this.preview = this.still = true;
    this.pump();
  }
}
