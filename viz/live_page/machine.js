// The module's memory and its steps: what computes, and nothing that is shown.

const FINER = 4, FINEST = 500; // steps of the reference beside one: a limit, so that any dt is answered within a frame
const HORIZON = 1500; // steps at most that the error ahead takes
const COURSE = 300; // first steps that the picture of coordinates over time holds
const LOOKS = 40; // states at which the size of a group of meters is looked at
const OTHERS = 1e-6; // of the largest state of its group, below which one counts as no smaller: it may be rounding

const decoded = (base64) => Uint8Array.from(atob(base64), (letter) => letter.charCodeAt(0));

/** The two modules, of the rate and of what is shown. */
async function liveModules(data) {
  return Promise.all([data.rate, data.shown].map(async (text) => (await WebAssembly.instantiate(decoded(text), { math: LIVE_MATH })).instance));
}

/** Two runs of one system from one start: `run` by the steps that are asked for, `fine` by much shorter ones. */
function liveMachine(data, instances) {
  const [rate, shown] = instances.map((each) => each.exports);
  const n = data.inputs.length, size = 8 * n;
  const base = rate.memory.buffer.byteLength;
  rate.memory.grow(Math.ceil((4 * size) / 65536));
  const array = (k) => new Float64Array(rate.memory.buffer, base + k * size, n);
  const [run, fine, ahead, beside] = [0, 1, 2, 3].map(array);
  const places = new Map([run, fine, ahead, beside].map((each, k) => [each, base + k * size]));
  const seen = new Float64Array(shown.memory.buffer, 0, n);
  const results = new Float64Array(shown.memory.buffer, size, data.shownCount);
  const step = (inputs, method, h, count) => rate[method](places.get(inputs), h, count);
  const sizes = new Float64Array(data.states);
  const finer = (dt) => Math.min(FINEST, Math.max(FINER, Math.ceil((2 * dt) / data.dt)));

  /** What is shown at a state: a copy. */
  function look(inputs) {
    seen.set(inputs);
    shown.evaluate(0, size);
    return results.slice();
  }

  /** The state in which a run differs most from its reference, by how much, and as a share of its size so far, in any unit. */
  function apart(a, b) {
    const largest = new Map();
    const states = data.inputs.slice(0, data.states);
    states.forEach(({ group }, i) => {
      if (Number.isFinite(b[i])) sizes[i] = Math.max(sizes[i], Math.abs(b[i]));
      largest.set(group, Math.max(largest.get(group) ?? 0, sizes[i]));
    });
    let found = { index: 0, most: 0, share: 0 };
    for (let i = 0; i < data.states; i++) {
      const most = Math.abs(a[i] - b[i]);
      const share = most ? most / Math.max(sizes[i], OTHERS * largest.get(states[i].group)) : 0;
      if (share > found.share || most !== most) found = { index: i, most, share };
      if (most !== most) break;
    }
    return found;
  }
  const forget = () => { sizes.fill(0); };

  /** How far a run by these steps is off after `seconds` from here on. */
  function errorAhead(method, dt, seconds) {
    const k = finer(dt);
    const count = Math.max(1, Math.min(Math.floor(HORIZON / (k + 1)), Math.round(seconds / dt)));
    ahead.set(run);
    beside.set(run);
    step(ahead, method, dt, count);
    step(beside, "dopri5", dt / k, count * k);
    return { ...apart(ahead, beside), seconds: count * dt };
  }

  /** The largest value of every group of meters on the way from here. */
  function sizesAhead(method, dt) {
    const found = new Map(), h = Math.max(dt, data.dt), steps = Math.max(1, Math.round((COURSE * data.dt) / h / LOOKS));
    ahead.set(run);
    for (let k = 0; k < LOOKS; k++) {
      larger(found, look(ahead));
      step(ahead, method, h, steps);
    }
    return found;
  }
  /** Have the sizes of groups no smaller than these values. */
  function larger(found, values) {
    data.meters.forEach(({ group }, k) => { if (Number.isFinite(values[k])) found.set(group, Math.max(found.get(group) ?? 0, Math.abs(values[k]))); });
  }

  /** Both runs from here on, rows of a time and a state; the steps are no shorter than a picture needs. */
  function course(method, dt) {
    const h = Math.max(dt, data.dt), k = finer(h);
    const count = Math.max(1, Math.round((COURSE * data.dt) / h));
    ahead.set(run);
    beside.set(fine);
    const row = (time, of) => ({ time, state: of.slice(0, data.states) });
    const rows = { run: [row(0, ahead)], fine: [row(0, beside)] };
    for (let done = 0; done < count; done++) {
      step(ahead, method, h, 1);
      rows.run.push(row((done + 1) * h, ahead));
      for (let sub = 0; sub < k; sub += FINER) {
        const steps = Math.min(FINER, k - sub);
        step(beside, "dopri5", h / k, steps);
        rows.fine.push(row((done + (sub + steps) / k) * h, beside));
      }
    }
    return rows;
  }

  /** A digest of the states after every hundredth of 1000 steps of 2^-10 s by rk4 from the start. */
  async function digest() {
    data.inputs.forEach(({ value }, i) => { ahead[i] = value; });
    const states = [];
    for (let row = 0; row < 10; row++) {
      step(ahead, "rk4", 2 ** -10, 100);
      states.push(...ahead.subarray(0, data.states));
    }
    const bytes = new Uint8Array(await crypto.subtle.digest("SHA-256", new Float64Array(states)));
    return Array.from(bytes.subarray(0, 16), (byte) => byte.toString(16).padStart(2, "0")).join("");
  }

  return { run, fine, step, finer, look, apart, forget, errorAhead, sizesAhead, larger, course, digest };
}
